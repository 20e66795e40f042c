"""The facts of the service in one SQLite file, which it alone writes.

    store = ServiceStore(state)
    store.put("usage", {...})                  # on the disk when it returns; the one before is kept
    store.document("usage", taken, missing)    # of the newest that is sound
    with store.write() as sql: ...             # several rows: all of them or none
    with own_database.reading(state / FILE) as sql: ...    # who else wants to know

Every row carries a sum (``sealed_rows``). At each start and once a day all are held against them: what is
not as it was written is taken out, and ``losses`` say so. A copy of the whole that was found sound lies
beside the file: it counts where the file cannot be opened, is gone, or is older than the copy.

A reserve beside it is given up where the disk is full, so that what ends a run on a full disk, an emergency
stop above all, is still written.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from controller import atomic_file, own_database, own_files, sealed_file, sealed_rows
from controller.machine.toml_table import ConfigError
from controller.messages import Message, message

FILE = "service.sqlite"
COPY = f"{FILE}.before"  # as it was found sound last
RESERVE = "reserve"
RESERVE_BYTES = 1 << 20  # some thousand alarms
AHEAD_PAGES = 100  # so much is written ahead, about: its place is written again, and needs no new one
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EIO)  # of a disk that may have room once the reserve is given up
DOCUMENTS, GENERATIONS = "documents", 2  # of each the newest, and the one before
T = TypeVar("T")

# Steps that lead to the schema: step n makes version n + 1. One that was shipped is never edited. Times are
# seconds since 1970 (UTC).
_FIRST = """
CREATE TABLE starts (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    count INTEGER NOT NULL              -- of services on this file: a copy with more of them is newer
) STRICT;
CREATE TABLE documents (
    name TEXT NOT NULL,
    generation INTEGER NOT NULL,        -- the newest counts, and the one before is kept
    at_s REAL NOT NULL,
    value TEXT NOT NULL,                -- JSON
    PRIMARY KEY (name, generation)
) STRICT;
CREATE TABLE alarms (
    id INTEGER PRIMARY KEY,
    facts TEXT NOT NULL                 -- JSON: time_s, name, key and values of what is said, ...
) STRICT
"""
_TOOLS = """
CREATE TABLE place (tool INTEGER PRIMARY KEY, pocket INTEGER NOT NULL) STRICT;
CREATE TABLE known (id INTEGER PRIMARY KEY CHECK (id = 1), time_s REAL NOT NULL) STRICT;
CREATE TABLE change (
    id INTEGER PRIMARY KEY CHECK (id = 1), tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL,
    step INTEGER NOT NULL, name TEXT NOT NULL, carries INTEGER NOT NULL, goes_to INTEGER NOT NULL
) STRICT;
CREATE TABLE preparation (
    id INTEGER PRIMARY KEY CHECK (id = 1), tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL,
    step INTEGER NOT NULL, name TEXT NOT NULL
) STRICT;
CREATE TABLE log (
    id INTEGER PRIMARY KEY AUTOINCREMENT, time_s REAL NOT NULL, what TEXT NOT NULL,
    tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL, step INTEGER NOT NULL, name TEXT NOT NULL
) STRICT
"""
_REQUESTS = """
CREATE TABLE requests (
    id INTEGER PRIMARY KEY AUTOINCREMENT, time_s REAL NOT NULL,
    user TEXT NOT NULL, role TEXT NOT NULL, address TEXT NOT NULL,   -- as the panel names them
    peer TEXT NOT NULL,                 -- the user at the socket, by the kernel
    verb TEXT NOT NULL, args TEXT NOT NULL,
    refused TEXT NOT NULL               -- code of the refusal
) STRICT
"""
_RUNS = """
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    record TEXT UNIQUE,                 -- name of its folder, which may have gone; NULL: it never had one
    program TEXT NOT NULL, sha256 TEXT NOT NULL,     -- name and content as they were then
    began_s REAL NOT NULL, ended_s REAL NOT NULL,
    result TEXT NOT NULL,
    facts TEXT NOT NULL                 -- JSON: cut time, following errors, ...
) STRICT
"""
MIGRATIONS: tuple[str, ...] = (_FIRST, _TOOLS, _REQUESTS, _RUNS)

_NOT_KNOWN = "DELETE FROM known"  # somebody must look where the tools are

# Codes of SQLite that say nothing of the file's content.
_OF_THE_DISK = {
    sqlite3.SQLITE_FULL: errno.ENOSPC,
    sqlite3.SQLITE_IOERR: errno.EIO,
    sqlite3.SQLITE_READONLY: errno.EROFS,
    sqlite3.SQLITE_CANTOPEN: errno.EACCES,
    sqlite3.SQLITE_PERM: errno.EPERM,
    sqlite3.SQLITE_BUSY: errno.EBUSY,
    sqlite3.SQLITE_LOCKED: errno.EBUSY,
}


class ServiceStore:
    """One per service; any thread."""

    def __init__(self, folder: Path) -> None:
        """Open, or make. Raises OSError for a file that may not be used, ConfigError for a newer one."""
        self.file, self._lock = folder / FILE, threading.RLock()
        self.losses: list[Message] = []  # what alarms say of this start
        self._is_older = False  # than what was written last: a copy, or without what was written ahead
        self._lost: set[str] = set()  # tables of which rows were taken out
        own_files.make_folder(folder)
        self._was_there = sealed_file.is_marked(self.file)
        try:
            self._sql = self._opened()
        except OSError as error:
            if error.errno not in FULL:
                raise
            self.give_up_reserve()
            self._sql = self._opened()
        with contextlib.suppress(OSError), self.write() as sql:  # a full disk forbids no start
            sql.execute("INSERT INTO starts VALUES (1, 1) ON CONFLICT (id) DO UPDATE SET count = count + 1")
            if self.losses:
                sql.execute(_NOT_KNOWN)
            sealed_file.mark(folder, [FILE])
        self._copy_beside()
        self._put_by()

    def close(self) -> None:
        with self._lock:
            self._sql.close()
        self._put_by()  # on a full disk of what this has set free, without which the next start has no room

    # -- facts

    def document(self, name: str, taken: Callable[[Any], T], missing: T) -> T:
        """What ``taken`` makes of the newest generation, else of the one before, else ``missing``.

        ``taken`` raises as ``sealed_file.UNREADABLE`` for values that are not sound.
        """
        newest_first = "SELECT value FROM documents WHERE name = ? ORDER BY generation DESC"
        for row in self.rows(newest_first, (name,)):
            try:
                return taken(json.loads(row[0]))
            except (*sealed_file.UNREADABLE, ConfigError):
                self.losses.append(message("store_damaged", file=self.file, what=name, aside="-"))
        return missing

    def has(self, name: str) -> bool:
        """Whether there is a document of that name."""
        return bool(self._generations(name))

    def is_newest(self, name: str) -> bool:
        """Whether a document is what was kept last; False: by what was lost at this start it may be older."""
        is_whole = DOCUMENTS not in self._lost or self._generations(name) == GENERATIONS
        return is_whole and not self._is_older

    def _generations(self, name: str) -> int:
        return int(self.rows("SELECT count(*) FROM documents WHERE name = ?", (name,))[0][0])

    def put(self, name: str, value: Any) -> None:
        """Keep a document, and its generation before. Raises OSError."""
        with self.write() as sql:
            put_document(sql, name, value)

    def keep(self, name: str, value: Any) -> None:
        """Likewise on a full disk, too. Raises OSError."""
        self.insist(lambda sql: put_document(sql, name, value))

    def insist(self, work: Callable[[sqlite3.Connection], object]) -> None:
        """A transaction of what is to be kept on a full disk, too. Raises OSError.

        What was written ahead is taken into the file, so that its place is written again; where that is not
        enough the reserve is given up.
        """
        for make_room in (self._take_in, self.give_up_reserve, None):
            try:
                with self.write() as sql:
                    work(sql)
                return
            except OSError as error:
                if make_room is None or error.errno not in FULL:
                    raise
            with contextlib.suppress(OSError):
                make_room()

    def _take_in(self) -> None:
        """Raises OSError."""
        with self._lock, self._of_the_disk():
            self._sql.execute("PRAGMA wal_checkpoint(RESTART)")

    def rows(self, question: str, values: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        """All rows of a SELECT. Raises OSError."""
        with self._lock, self._of_the_disk():
            return self._sql.execute(question, values).fetchall()

    @contextlib.contextmanager
    def write(self) -> Iterator[sqlite3.Connection]:
        """A transaction: all of it is on the disk behind it or, on any exception, nothing. Raises OSError."""
        with self._lock, self._of_the_disk(), own_database.transaction(self._sql) as sql:
            yield sql

    @contextlib.contextmanager
    def _of_the_disk(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise OSError(_errno(error) or errno.EIO, str(error), str(self.file)) from error

    def give_up_reserve(self) -> None:
        """Give the disk some room again. Raises OSError."""
        own_files.remove(self.file.with_name(RESERVE))

    def _put_by(self) -> None:
        """The reserve, as far as the disk has it."""
        reserve = self.file.with_name(RESERVE)
        with contextlib.suppress(OSError):
            if not reserve.exists() or reserve.lstat().st_size < RESERVE_BYTES:
                with own_files.new(reserve) as file:
                    file.write(bytes(RESERVE_BYTES))
                    os.fsync(file.fileno())

    # -- whether it is as it was written

    def check(self) -> list[Message]:
        """Hold every row against its sum, and take out what is not as it was written: what an alarm says of
        that. What is sound is copied; for what is not to be mended the next start takes that copy. Raises
        OSError.
        """
        with self._lock:
            try:
                losses = self._taken_out(self._sql)
            except sqlite3.Error as error:
                if (code := _errno(error)) is not None:
                    raise OSError(code, str(error), str(self.file)) from error
                return [message("store_damaged", file=self.file, what=str(error), aside="-")]
        self._copy_beside()
        return losses

    def _opened(self) -> sqlite3.Connection:
        """The file; where it is damaged its copy instead, else one that is new. Raises OSError."""
        for _ in range(2):
            try:
                return self._sound()
            except sealed_file.Damaged as error:
                self._replace(error.said)
            except sqlite3.Error as error:
                if (code := _errno(error)) is not None:
                    raise OSError(code, str(error), str(self.file)) from error
                self._replace(str(error))
        return self._sound()

    def _sound(self) -> sqlite3.Connection:
        """Raises sealed_file.Damaged, sqlite3.Error, OSError."""
        if not os.path.lexists(self.file) and (self._was_there or os.path.lexists(self._copy)):
            raise sealed_file.Damaged(message("sealed.gone"))
        known = own_database.ahead(self.file)
        sql = own_database.opened(self.file)
        try:
            if (aside := own_database.put_lost_aside(sql, self.file, known)) is not None:
                what = message("cli.state.lost")
                self.losses.append(message("store_damaged", file=self.file, what=what, aside=aside.name))
                self._is_older = True
            sql.execute(f"PRAGMA wal_autocheckpoint = {AHEAD_PAGES}")
            if self._was_there and not _version(sql):
                raise sealed_file.Damaged(message("sealed.empty"))
            sealed_rows.seal(sql, anew=_migrate(sql, self.file))
            self.losses += self._taken_out(sql)
            if not self.losses and _starts(sql) < self._starts_of_copy():
                raise sealed_file.Damaged(message("sealed.older"))
        except BaseException:
            sql.close()
            raise
        return sql

    def _taken_out(self, sql: sqlite3.Connection) -> list[Message]:
        """Takes out what is damaged; what an alarm says of it. Raises sqlite3.Error, also where something
        damaged is left, and OSError.
        """
        with own_database.transaction(sql):
            if (found := sealed_rows.mend(sql, self.file)) is None:
                return []
            rows, what, aside = found
            self._lost |= {name for name, _ in rows}
            sql.execute(_NOT_KNOWN)
            if left := sealed_rows.broken(sql):
                raise sqlite3.DatabaseError(left[0])
        return [message("store_damaged", file=self.file, what=what, aside=aside.name)]

    # -- the copy

    @property
    def _copy(self) -> Path:
        return self.file.with_name(COPY)

    def _copy_beside(self) -> None:
        """Of what was just found sound; a disk that takes none keeps the one before."""
        with contextlib.suppress(OSError, sqlite3.Error):
            with self._lock:
                data = self._sql.serialize()
            atomic_file.write(self._copy, data, mode=own_database.MODE)  # while others write on

    def _starts_of_copy(self) -> int:
        """0: there is none that can be read."""
        with contextlib.suppress(OSError, sqlite3.Error), contextlib.closing(_loaded(self._copy)) as sql:
            return _starts(sql)
        return 0

    def _replace(self, why: Message | str) -> None:
        """Puts the file aside, with what stands beside it, and its copy in its place. Raises OSError."""
        self._is_older = True
        aside = own_files.put_aside(self.file)
        for end in own_database.BESIDE:
            own_files.put_aside(self.file.with_name(f"{FILE}{end}"))
        named = aside.name if aside else ""
        if not os.path.lexists(self._copy):
            self._was_there = False
            self.losses.append(sealed_file.begun_anew(self.file, why, named))
            return
        at_s = self._copy.lstat().st_mtime
        own_files.rename(self._copy, self.file)
        self.losses.append(sealed_file.before_counts(self.file, why, named, at_s))


def document_of(folder: Path, name: str) -> Any:
    """The newest of a document, for who only reads; only if all documents are as they were written.

    Raises FileNotFoundError where there is none, OSError, sealed_file.Damaged, sqlite3.Error.
    """
    with own_database.reading(folder / FILE) as sql:
        if rows := sealed_rows.damaged(sql, DOCUMENTS):
            raise sealed_file.Damaged(message("cli.state.rows", tables=sealed_rows.summary(rows, ())))
        # Not by an index, which a bad bit may lead to an older one.
        newest = "SELECT value FROM documents NOT INDEXED WHERE name = ? ORDER BY generation DESC"
        row = sql.execute(newest, (name,)).fetchone()
    if row is None:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), name)
    return json.loads(row[0])


def put_document(sql: sqlite3.Connection, name: str, value: Any) -> None:
    """In the caller's transaction; one that is new stands there twice, so that a row that is lost shows."""
    newest_of = "SELECT coalesce(max(generation), 0) FROM documents WHERE name = ?"
    newest = sql.execute(newest_of, (name,)).fetchone()[0]
    sql.execute("DELETE FROM documents WHERE name = ? AND generation < ?", (name, newest))
    facts = time.time(), json.dumps(value)
    for generation in (newest + 1,) if newest else range(1, GENERATIONS + 1):
        sql.execute("INSERT INTO documents VALUES (?, ?, ?, ?)", (name, generation, *facts))


def put(folder: Path, name: str, value: Any) -> None:
    """Keeps a document where no service runs. Raises OSError, ConfigError."""
    with contextlib.closing(ServiceStore(folder)) as store:
        store.put(name, value)


def stamp(folder: Path) -> tuple[object, ...]:
    """What changes with whatever is written. Raises OSError."""
    found, ahead = (folder / FILE).stat(), None
    with contextlib.suppress(FileNotFoundError):
        ahead = (folder / f"{FILE}-wal").stat()
    return found.st_size, found.st_mtime_ns, ahead and (ahead.st_size, ahead.st_mtime_ns)


def in_memory(file: Path | None) -> sqlite3.Connection:
    """What a file has, with sums of what is written to it from then on. Where it cannot be read it is what
    its copy has, and without one, or for None, an empty store.
    """
    for source in (file, file and file.with_name(COPY), None):
        sql = _empty()
        try:
            if source is not None:
                sql = _loaded(source)
            sealed_rows.seal(sql, anew=_migrate(sql, Path(FILE)))
            return sql
        except (OSError, sqlite3.Error, ConfigError):
            sql.close()
    raise AssertionError("an empty store can be made")


def _empty() -> sqlite3.Connection:
    return sqlite3.connect(":memory:", isolation_level=None, factory=own_database.Connection)


def _loaded(file: Path) -> sqlite3.Connection:
    """A file, without what is written ahead of it, in memory. Raises OSError, sqlite3.Error."""
    data = bytearray(own_files.read_bytes(file))
    data[18:20] = b"\1\1"  # of the file format: nothing is written ahead
    sql = _empty()
    sql.deserialize(bytes(data))
    return sql


def settle(file: Path) -> Message | None:
    """Takes into the file what stands beside it, so that it can be replaced; the service must not run.

    One that is no store is put aside with what stands beside it, and the answer says so. Raises OSError.
    """
    if not os.path.lexists(file):
        return None
    try:
        with contextlib.closing(own_database.opened(file)) as sql:
            sql.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    except sqlite3.Error as error:
        for end in own_database.BESIDE:
            own_files.put_aside(file.with_name(f"{file.name}{end}"))
        aside = own_files.put_aside(file)
        return sealed_file.begun_anew(file, str(error), aside.name if aside else "")
    return None


def _errno(error: sqlite3.Error) -> int | None:
    """None: it is the file that is wrong, or what is asked of it."""
    return _OF_THE_DISK.get(getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF)


def _starts(sql: sqlite3.Connection) -> int:
    row = sql.execute("SELECT count FROM starts").fetchone()
    return int(row[0]) if row is not None else 0


def _version(sql: sqlite3.Connection) -> int:
    """Of the schema; 0: it is empty."""
    return int(sql.execute("PRAGMA user_version").fetchone()[0])


def _migrate(sql: sqlite3.Connection, file: Path) -> bool:
    """Brings the schema to this version; whether it was another. Raises ConfigError for a newer one."""
    version, newest = _version(sql), len(MIGRATIONS)
    if version == newest:
        return False
    if version > newest:
        raise ConfigError(message("store.schema", file=file, version=version, newest=newest))
    with own_database.transaction(sql):
        own_database.migrate(sql, MIGRATIONS, version)
    return True
