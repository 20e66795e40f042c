"""The one SQLite file of the store: opened, brought to this version's schema, and written in transactions.

    with database.write() as sql:      # one writer among all processes, from here to the end
        sql.execute(...)

Panel, command line and service may all have it open: WAL lets them read while one writes,
and the write lock is also what keeps files beside the database in step with its rows.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from controller import messages
from controller.api.schema import MIGRATIONS

FILE = "store.sqlite"
WAIT_S = 10.0  # for another process to end its transaction; all of them are short


class StoreError(Exception):
    """What is ``said`` to the user; ``code`` says which kind it is, for the answer's status.

    missing: there is no such thing; exists: the name is taken; running: the program is in use;
    name, size (too large), cut (not all of it), empty, sha256, form: what was sent is wrong; slow: it did
    not come; many: others are under way; space: the disk is full; store: the store itself cannot be used.
    """

    def __init__(self, code: str, text: messages.Said | str) -> None:
        """``text``: a sentence alone where it has no key."""
        self.said = messages.plain(text)
        super().__init__(messages.text(self.said))
        self.code = code

    @classmethod
    def told(cls, code: str, key: str, **values: object) -> StoreError:
        """With the catalogue's text of that key."""
        return cls(code, messages.said(key, **values))


class Database:
    """A connection that several threads of a process may use, one at a time."""

    def __init__(self, folder: Path) -> None:
        """Open, or make, the database of a state folder. Raises StoreError."""
        self.file = folder / FILE
        self._lock = threading.RLock()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._sql = _connected(self.file)
            _migrate(self)
        except (OSError, sqlite3.Error) as error:
            raise StoreError.told("store", "store_unusable", file=self.file, why=error) from error

    def close(self) -> None:
        with self._lock:
            self._sql.close()

    def rows(self, question: str, values: tuple[Any, ...] = ()) -> list[sqlite3.Row]:
        """All rows of a SELECT. Raises StoreError."""
        with self._lock:
            try:
                return self._sql.execute(question, values).fetchall()
            except UnicodeEncodeError:  # half of a pair: nothing that is kept has such a name
                return []
            except sqlite3.Error as error:
                raise StoreError.told("store", "store_unread", file=self.file, why=error) from error

    @contextlib.contextmanager
    def write(self) -> Iterator[sqlite3.Connection]:
        """A transaction: all of it or, on any exception, nothing. Raises StoreError."""
        with self._lock:
            try:
                self._sql.execute("BEGIN IMMEDIATE")
                try:
                    yield self._sql
                    self._sql.execute("COMMIT")
                except BaseException:
                    with contextlib.suppress(sqlite3.Error):
                        self._sql.execute("ROLLBACK")
                    raise
            except sqlite3.IntegrityError:
                raise  # the caller knows which rule it was
            except sqlite3.Error as error:
                code = "space" if "full" in str(error) else "store"
                raise StoreError.told(code, "store_unwritten", file=self.file, why=error) from error


def _connected(file: Path) -> sqlite3.Connection:
    # The group may write: service and panel are two users. SQLite gives -wal and -shm the same mode.
    os.close(os.open(file, os.O_RDWR | os.O_CREAT, 0o660))
    if file.stat().st_uid == os.geteuid():
        file.chmod(0o660)
    sql = sqlite3.connect(file, timeout=WAIT_S, isolation_level=None, check_same_thread=False)
    sql.row_factory = sqlite3.Row
    sql.execute("PRAGMA journal_mode = WAL")
    sql.execute("PRAGMA synchronous = FULL")  # an acknowledged alarm stays so after a power loss
    sql.execute("PRAGMA foreign_keys = ON")
    return sql


def _migrate(database: Database) -> None:
    """Bring the schema to this version, step by step; before that a copy is put beside it."""
    newest = len(MIGRATIONS)
    if (version := _version(database)) == newest:
        return
    if version > newest:
        raise StoreError(
            "store",
            f"{database.file}: has schema {version}, and this version of Directrix knows {newest} at most; "
            f"run the newer version, or restore a back-up of before the update.",
        )
    if version > 0:
        _copy_beside(database, version)
    with database.write() as sql:
        for step in MIGRATIONS[_version(database) :]:  # again: another process may have been quicker
            for statement in step.split(";\n"):
                sql.execute(statement)
        sql.execute(f"PRAGMA user_version = {newest}")


def _version(database: Database) -> int:
    return int(database.rows("PRAGMA user_version")[0][0])


def _copy_beside(database: Database, version: int) -> None:
    copy = database.file.with_name(f"store.schema{version}.sqlite")
    copy.unlink(missing_ok=True)
    database.rows("VACUUM INTO ?", (str(copy),))
