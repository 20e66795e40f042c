"""SQLite files of a folder that others may write, too: see ``own_files``. And what a bad bit costs them."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import sqlite3
import stat
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from controller import atomic_file, own_files
from drives.texts import message

BESIDE = ("-wal", "-shm")
MODE = 0o640  # SQLite gives -wal and -shm the same
WAIT_S = 10.0  # for another process to end its transaction; all of them are short


class Connection(sqlite3.Connection):
    """Raises sqlite3.Error also where SQLite's own words quote a name that a bad bit has made no text."""

    def execute(self, *given: Any) -> sqlite3.Cursor:
        try:
            return super().execute(*given)
        except UnicodeDecodeError as error:
            raise sqlite3.DatabaseError(f"its schema is damaged ({error.reason})") from error


def opened(file: Path) -> sqlite3.Connection:
    """Opens, or makes, a SQLite file that is written ahead (WAL), in no transaction; for any thread.

    SQLite itself follows a link in the place of the database. It also rolls back a journal that it finds
    beside one, and deletes the file that this names. Ours have none, but at the moment they are made: so a
    journal goes, and root opens as the folder's owner, who can delete no more than he could before.

    Raises OSError, sqlite3.Error.
    """
    with own_files.folder(file.parent) as at:
        with contextlib.suppress(FileExistsError):
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | own_files.FLAGS
            made = os.open(file.name, flags, MODE, dir_fd=at)
            os.fchmod(made, MODE)
            own_files.give(made, at)
            os.close(made)
        # Looked at without being opened: to close one would give up SQLite's locks of this process.
        owner = os.fstat(at).st_uid
        _remove_what_a_reader_left(file, at, owner)
        facts = _seen(file, at, owner)
        if facts.st_size:
            own_files.remove(file.with_name(f"{file.name}-journal"))
        with _as_owner(at, file.parent):
            return _connected(file, facts, at)


@contextlib.contextmanager
def transaction(sql: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    """One that writes: all of it or, on any exception, nothing. Raises sqlite3.Error."""
    sql.execute("BEGIN IMMEDIATE")
    try:
        yield sql
        sql.execute("COMMIT")
    except BaseException:
        with contextlib.suppress(sqlite3.Error):
            sql.execute("ROLLBACK")
        raise


def migrate(sql: sqlite3.Connection, steps: Sequence[str], version: int) -> None:
    """The schema from this version to the newest, in a transaction; step n makes version n + 1."""
    for step in steps[version:]:
        for statement in step.split(";\n"):
            sql.execute(statement)
    sql.execute(f"PRAGMA user_version = {len(steps)}")


def _stat(name: str, at: int) -> os.stat_result:
    return os.stat(name, dir_fd=at, follow_symlinks=False)


@contextlib.contextmanager
def reading(file: Path) -> Iterator[sqlite3.Connection]:
    """Opens a SQLite file of the service for who only reads it: all that is read is of one moment.

    Whoever is neither its owner nor root writes nothing, also not beside it: what he left there would be a
    stranger's, and the service's own next start would refuse it. So without a -wal, when nobody has the file
    open, it is read as it is ("immutable"); with one, by the -shm that its writer has made.

    Raises OSError, sqlite3.Error.
    """
    with own_files.folder(file.parent) as at:
        owner = os.fstat(at).st_uid
        facts = _seen(file, at, owner)
        if os.geteuid() in (0, owner):
            sql = opened(file)
        else:
            written_ahead = os.path.lexists(file.with_name(f"{file.name}-wal"))
            how = "mode=ro&readonly_shm=1" if written_ahead else "mode=ro&immutable=1"
            sql = _connected(file, facts, at, how)
    with contextlib.closing(sql):
        sql.execute("BEGIN")
        yield sql


def _seen(file: Path, at: int, owner: int) -> os.stat_result:
    """Facts of the file, which is what it should be, as is what stands beside it. Raises OSError."""
    for end in BESIDE:
        with contextlib.suppress(FileNotFoundError):
            own_files.see(_stat(file.name + end, at), file.with_name(file.name + end), owner, alone=True)
    facts = _stat(file.name, at)
    own_files.see(facts, file, owner, alone=True)
    return facts


def _remove_what_a_reader_left(file: Path, at: int, owner: int) -> None:
    """Removes an empty -wal of another user, and the -shm to it: there is nothing in them."""
    found = {}
    for end in BESIDE:
        with contextlib.suppress(FileNotFoundError):
            found[end] = _stat(file.name + end, at)
    if "-wal" in found and found["-wal"].st_size:
        return
    for end, facts in found.items():
        if stat.S_ISREG(facts.st_mode) and facts.st_uid not in (0, os.geteuid(), owner):
            own_files.remove(file.with_name(file.name + end))


def _connected(file: Path, facts: os.stat_result, at: int, how: str = "mode=rw") -> sqlite3.Connection:
    real = Path(os.path.realpath(file.parent), file.name)
    named = f"file:{quote(str(real))}?{how}"
    more: Any = {"isolation_level": None, "check_same_thread": False, "factory": Connection}
    sql: sqlite3.Connection = sqlite3.connect(named, timeout=WAIT_S, uri=True, **more)
    try:
        opened_as = sql.execute("PRAGMA database_list").fetchone()[2]
        now = _stat(file.name, at)
        if opened_as != str(real) or (now.st_dev, now.st_ino) != (facts.st_dev, facts.st_ino):
            raise own_files.refusal(errno.ELOOP, message("own_file.exchanged"), file)
        if how == "mode=rw":
            sql.execute("PRAGMA journal_mode = WAL")
            sql.execute("PRAGMA synchronous = FULL")  # what was said to be kept stays so after a power loss
        sql.execute("PRAGMA trusted_schema = OFF")
        sql.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except BaseException:
        sql.close()
        raise
    return sql


@contextlib.contextmanager
def _as_owner(at: int, path: Path) -> Iterator[None]:
    """Root does it with the rights of a folder's owner, if he comes there; who is not root, with his own."""
    of, group, comes = os.fstat(at), os.getegid(), False
    if os.geteuid() != 0 or of.st_uid == 0:
        yield
        return
    os.setegid(of.st_gid)
    try:
        os.seteuid(of.st_uid)
        try:
            with contextlib.suppress(PermissionError):
                os.stat(path / ".")
                comes = True
            if not comes:
                os.seteuid(0)
            yield
        finally:
            os.seteuid(0)
    finally:
        os.setegid(group)


# How SQLite writes ahead (sqlite.org/fileformat2.html, "The Write-Ahead Log"): a header of 32 bytes, then
# frames of 24 bytes and a page. Each frame has the header's salts, and sums over all that is before it. What
# is shared beside it (sqlite.org/walformat.html, "The WAL-Index Header") has the count of committed frames
# and their salts, twice, and behind that how many of them are in the database already.
_HEADER, _FRAME, _SUMS = 32, 24, struct.Struct(">II")
_ORDERS = {0x377F0682: "<", 0x377F0683: ">"}  # magic number: of the bytes that are summed
_INDEX, _COUNT, _SALTS = 48, struct.Struct("=I"), slice(32, 40)
_LOCK, _IN_USE = struct.Struct("hhqqi"), (fcntl.F_WRLCK, os.SEEK_SET, 128, 1, 0)  # of who has it open
_OPEN: list[BinaryIO] = []  # to close one would give up SQLite's locks of this process
Ahead = tuple[int, bytes]


def ahead(file: Path) -> Ahead:
    """How many frames have to be there, and their salts, before a process opens a database: by what one that
    was killed has left beside it. After a power loss that is as old as the disk has it.

    0 frames: all is in the database, somebody has it open, or nobody knows.
    """
    data, in_use = b"", False
    with contextlib.suppress(OSError):
        index = own_files.opened(file.with_name(f"{file.name}-shm"), os.O_RDONLY, shared=True)
        _OPEN.append(index)
        data = index.read(2 * _INDEX + _COUNT.size)
        in_use = _LOCK.unpack(fcntl.fcntl(index, fcntl.F_GETLK, _LOCK.pack(*_IN_USE)))[0] != fcntl.F_UNLCK
    if in_use or len(data) < 2 * _INDEX + _COUNT.size or data[:_INDEX] != data[_INDEX : 2 * _INDEX]:
        return 0, b""
    frames, done = (int(_COUNT.unpack_from(data, at)[0]) for at in (16, 2 * _INDEX))
    return (frames if done < frames else 0), data[_SALTS]


def has_lost(sql: sqlite3.Connection, file: Path, known: Ahead = (0, b"")) -> bool:
    """Whether a bad bit or a cut has cost what was written ahead of a database that was just opened;
    ``known``: what ``ahead`` found before.

    SQLite drops all from the first bad frame on and says nothing. What is left of the time before has other
    salts; what was never committed has the right sums. Raises OSError, sqlite3.Error.
    """
    good = 0  # frames
    with contextlib.suppress(sqlite3.OperationalError):  # a full disk takes none of them; each is looked at
        good = int(sql.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()[1])
    if not _is_bad_after(max(0, good), known, file):
        return False
    sql.execute("BEGIN IMMEDIATE")  # what another process was just writing is written now
    try:
        return _is_bad_after(max(0, good), known, file)
    finally:
        sql.execute("ROLLBACK")


def put_lost_aside(sql: sqlite3.Connection, file: Path, known: Ahead) -> Path | None:
    """Where that is so: what was written ahead is copied, and what can be read of it is in the database; name
    of the copy. Raises OSError, sqlite3.Error.
    """
    if not has_lost(sql, file, known):
        return None
    written = file.with_name(f"{file.name}-wal")
    aside = own_files.aside(written)
    atomic_file.write(aside, own_files.read_bytes(written, shared=True), mode=MODE)
    sql.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return aside


def _is_bad_after(good: int, known: Ahead, file: Path) -> bool:
    """Whether frames are damaged, or gone, that belong to the ``good`` ones before them. Raises OSError."""
    data = b""
    with contextlib.suppress(FileNotFoundError):
        data = own_files.read_bytes(file.with_name(f"{file.name}-wal"), shared=True)
    if len(data) < _HEADER:
        return known[0] > 0
    order, size = _ORDERS.get(int.from_bytes(data[:4], "big"), ""), int.from_bytes(data[8:12], "big")
    salts, sums = data[16:24], _SUMS.unpack_from(data, 24)
    if not order or _summed(data[:24], (0, 0), order) != sums:
        return True
    most = known[0] if known[1] == salts else 0
    length = _FRAME + size
    frames = [data[at : at + length] for at in range(_HEADER, len(data) - length + 1, length)]
    if good:
        if good > len(frames) or frames[good - 1][8:16] != salts:
            return False  # begun anew meanwhile
        sums = _SUMS.unpack_from(frames[good - 1], 16)
    for i, frame in enumerate(frames[good:], good):
        found, before = _SUMS.unpack_from(frame, 16), sums
        right = _summed(frame[_FRAME:], _summed(frame[:8], before, order), order) == found
        if right and frame[8:16] == salts:
            sums = found
            continue
        return right or i < most or any(one[8:16] == salts for one in frames[i:])
    return len(frames) < most


def _summed(data: bytes, sums: tuple[int, ...], order: str) -> tuple[int, int]:
    a, b = sums
    for one, other in struct.iter_unpack(f"{order}II", data):
        a = (a + one + b) & 0xFFFFFFFF
        b = (b + other + a) & 0xFFFFFFFF
    return a, b
