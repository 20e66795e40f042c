"""The one SQLite file of the store: opened, brought to this version's schema, and written in transactions.

    with database.write() as sql:      # one writer among all processes, from here to the end
        sql.execute(...)

Panel, command line and service may all have it open: WAL lets them read while one writes,
and the write lock is also what keeps files beside the database in step with its rows.
"""

from __future__ import annotations

import contextlib
import sqlite3
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from controller import atomic_file, messages, own_database, own_files, sealed_rows
from controller.api import log_in_marker, own_folder

# The schema of the store, as the steps that lead to it: step n makes version n + 1.
#
# A step that was shipped is never edited; a change is a new step at the end. Times are
# seconds since 1970 (UTC), shares 0 to 1, values with structure are JSON.

_FIRST = """
CREATE TABLE programs (
    name TEXT PRIMARY KEY,              -- as uploaded, a safe file name
    sha256 TEXT NOT NULL,               -- programs/<sha256>.ngc; several names may share one
    size INTEGER NOT NULL,              -- bytes
    lines INTEGER NOT NULL,
    uploaded_s REAL NOT NULL,
    uploaded_by TEXT NOT NULL
) STRICT;
CREATE INDEX programs_by_content ON programs (sha256);
CREATE TABLE checks (
    sha256 TEXT NOT NULL,               -- of the program
    machine TEXT NOT NULL,              -- sha256 of machine file, offsets and tools
    state TEXT NOT NULL CHECK (state IN ('waiting', 'running', 'passed', 'refused', 'failed')),
    progress REAL NOT NULL,
    result TEXT NOT NULL,               -- JSON: figures and notes, or sentence, line and column
    changed_s REAL NOT NULL,
    PRIMARY KEY (sha256, machine)
) STRICT;
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    program TEXT NOT NULL,              -- name and content as they were then
    sha256 TEXT NOT NULL,
    began_s REAL NOT NULL,
    ended_s REAL,
    result TEXT NOT NULL,               -- 'running', 'completed', 'stopped', 'fault', 'lost'
    facts TEXT NOT NULL,                -- JSON: cut time, worst following error, recording, ...
    source TEXT UNIQUE                  -- the service's record it was read from
) STRICT;
CREATE TABLE alarms (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    at_s REAL NOT NULL,
    name TEXT NOT NULL,                 -- of the row in the fault table
    axis TEXT NOT NULL,
    sentence TEXT NOT NULL,
    facts TEXT NOT NULL,                -- JSON: key and values of what is said, recovery, recording, ...
    acknowledged_s REAL,
    acknowledged_by TEXT,
    source TEXT UNIQUE                  -- the service's line it was read from
) STRICT;
CREATE TABLE offsets (
    name TEXT PRIMARY KEY,              -- G54 .. G59
    facts TEXT NOT NULL,                -- JSON: origin_mm, turned_deg
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT;
CREATE TABLE tools (
    number INTEGER PRIMARY KEY,
    facts TEXT NOT NULL,                -- JSON: name, radius_mm, length_mm, flute_mm
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT;
CREATE TABLE settings (
    key TEXT PRIMARY KEY,
    value TEXT NOT NULL,                -- JSON
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT;
CREATE TABLE users (
    name TEXT PRIMARY KEY,
    password TEXT NOT NULL,             -- argon2 hash
    role TEXT NOT NULL CHECK (role IN ('view', 'operate', 'set_up')),
    changed_s REAL NOT NULL
) STRICT;
CREATE TABLE tokens (
    sha256 TEXT PRIMARY KEY,            -- of the token; the token itself is shown once and not kept
    name TEXT NOT NULL UNIQUE,
    role TEXT NOT NULL CHECK (role IN ('view', 'operate', 'set_up')),
    made_s REAL NOT NULL,
    made_by TEXT NOT NULL
) STRICT;
CREATE TABLE audit (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    at_s REAL NOT NULL,
    user TEXT NOT NULL,
    address TEXT NOT NULL,
    action TEXT NOT NULL,
    detail TEXT NOT NULL,
    allowed INTEGER NOT NULL
) STRICT
"""

_LOG_INS = """
CREATE TABLE sessions (
    sha256 TEXT PRIMARY KEY,            -- of the cookie
    user TEXT NOT NULL,
    mark TEXT NOT NULL,                 -- of password and role as they were at the log-in
    began_s REAL NOT NULL,
    seen_s REAL NOT NULL                -- the last request, to a minute
) STRICT;
ALTER TABLE tokens ADD COLUMN expires_s REAL
"""  # NULL: it does not expire

_QUEUE = """
CREATE TABLE queue (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    place INTEGER NOT NULL,             -- in its order
    program TEXT NOT NULL,              -- name
    count INTEGER NOT NULL,             -- wanted
    done INTEGER NOT NULL,
    added_s REAL NOT NULL,
    added_by TEXT NOT NULL
) STRICT;
CREATE TABLE marks (
    key TEXT PRIMARY KEY,               -- how far somebody has looked at runs and alarms
    value TEXT NOT NULL,                -- JSON
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT
"""

# From here on a file beside the store says whether anybody has to log in: see ``log_in_marker``.
_MARKED = "PRAGMA user_version = 4"

# From here on every row has a sum, which a version before would not keep: see ``sealed_rows``.
_SUMMED = "PRAGMA user_version = 5"

# Copies of what the service keeps in its own files, which nothing has read.
_NO_COPIES = "DROP TABLE IF EXISTS offsets;\nDROP TABLE IF EXISTS tools"

# Runs and alarms are the service's, which takes them over from the copy that is put beside; how a run was cut
# is judged here.
_NO_HISTORY = """
CREATE TABLE verdicts (
    key TEXT PRIMARY KEY,               -- name of a run's record
    value TEXT NOT NULL,                -- JSON
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT;
INSERT INTO verdicts
SELECT source, json_extract(facts, '$.as_cut'), began_s, 'verdicts' FROM runs
WHERE source IS NOT NULL AND json_type(facts, '$.as_cut') = 'object';
DROP TABLE runs;
DROP TABLE alarms;
DELETE FROM marks WHERE key = 'notices.told'
"""

MIGRATIONS: tuple[str, ...] = (_FIRST, _LOG_INS, _QUEUE, _MARKED, _SUMMED, _NO_COPIES, _NO_HISTORY)


MARKED = 4  # the schema from which on a log-in marker is there


class StoreError(messages.TextError):
    """A refusal of the store's; ``code`` says which kind it is, for the answer's status.

    missing: there is no such thing; exists: the name is taken; running: the program is in use;
    name, size (too large), cut (not all of it), empty, sha256, form: what was sent is wrong; slow: it did
    not come; many: others are under way; space: the disk is full; store: the store itself cannot be used.
    """

    def __init__(self, code: str, text: messages.Message | str) -> None:
        """``text``: a sentence alone where it has no key."""
        super().__init__(text)
        self.code = code

    @classmethod
    def of(cls, code: str, key: str, **values: object) -> StoreError:
        """An error with the text of that key."""
        return cls(code, messages.message(key, **values))


class Database:
    """A connection that several threads of a process may use, one at a time."""

    def __init__(self, folder: Path) -> None:
        """Open, or make, the database of a state folder. Raises StoreError."""
        self.file = own_folder.of(folder) / own_folder.STORE
        self._lock = threading.RLock()
        try:
            own_files.make_folder(folder)
            own = own_folder.make(folder)
            there = own_files.names(own)
            if not {own_folder.STORE, log_in_marker.FILE} & {*there}:
                log_in_marker.write(own, 0)
            ahead = own_database.ahead(self.file)
            self._sql = own_database.opened(self.file)
            self._sql.row_factory = sqlite3.Row
            self.lost = own_database.put_lost_aside(self._sql, self.file, ahead)
            self.is_gone = own_folder.PROGRAMS in there and not _version(self)  # all that was in it
            self._sql.execute("PRAGMA foreign_keys = ON")
            sealed_rows.seal(self._sql, anew=_migrate(self))
        except (OSError, sqlite3.Error) as error:
            raise StoreError.of("store", "store_unusable", file=self.file, why=error) from error

    def close(self) -> None:
        with self._lock:
            self._sql.close()

    def take_out_damaged(self) -> tuple[str, Path] | None:
        """Takes rows out that are not as they were written, and makes indexes anew that do not fit: what was
        found, and where a copy of the whole lies. Raises StoreError.
        """
        with self.write() as sql:
            try:
                found = sealed_rows.mend(sql, self.file)
            except OSError as error:
                raise StoreError.of("space", "store_unwritten", file=self.file, why=error) from error
        return found and found[1:]

    def copy(self) -> bytes:
        """The file of a database with all that is in this one."""
        with self._lock:
            return self._sql.serialize()

    def rows(self, question: str, values: tuple[Any, ...] = ()) -> list[sqlite3.Row]:
        """All rows of a SELECT. Raises StoreError."""
        with self._lock:
            try:
                return self._sql.execute(question, values).fetchall()
            except UnicodeEncodeError:  # half of a pair: nothing that is kept has such a name
                return []
            except sqlite3.Error as error:
                raise StoreError.of("store", "store_unread", file=self.file, why=error) from error

    @contextlib.contextmanager
    def write(self) -> Iterator[sqlite3.Connection]:
        """A transaction: all of it or, on any exception, nothing. Raises StoreError."""
        with self._lock:
            try:
                with own_database.transaction(self._sql) as sql:
                    yield sql
            except sqlite3.IntegrityError:
                raise  # the caller knows which rule it was
            except sqlite3.Error as error:
                code = "space" if "full" in str(error) else "store"
                raise StoreError.of(code, "store_unwritten", file=self.file, why=error) from error


def _migrate(database: Database) -> bool:
    """Bring the schema to this version, step by step; before that a copy is put beside it. Whether it was
    of another one.
    """
    newest = len(MIGRATIONS)
    if (version := _version(database)) == newest:
        return False
    if version > newest:
        raise StoreError(
            "store",
            messages.message("store.schema", file=database.file, version=version, newest=newest),
        )
    if version > 0:
        _copy_beside(database, version)
    with database.write() as sql:
        # again: another process may have been quicker
        own_database.migrate(sql, MIGRATIONS, _version(database))
        if 0 < version < MARKED and not log_in_marker.is_there(database.file.parent):
            users = sql.execute("SELECT count(*) FROM users").fetchone()[0]
            log_in_marker.write(database.file.parent, users)
    return True


def _version(database: Database) -> int:
    return int(database.rows("PRAGMA user_version")[0][0])


def _copy_beside(database: Database, version: int) -> None:
    atomic_file.write(database.file.with_name(f"store.schema{version}.sqlite"), database.copy())
