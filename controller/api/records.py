"""Rows of the store as values, and the tables that hold facts only (programs have files, too).

Every ``..._s`` that names a moment is seconds since 1970 (UTC); ``facts`` are JSON values.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from controller.api import log_in_marker
from controller.api.database import Database, StoreError
from controller.messages import Key, Message, message

Facts = Mapping[str, Any]
Clock = Callable[[], float]

ROLES = ("view", "operate", "set_up")  # each may do what those before it may


@dataclass(frozen=True, slots=True)
class User:
    name: str
    password: str  # argon2 hash
    role: str  # one of ROLES


@dataclass(frozen=True, slots=True)
class Token:
    """A script's key; only its hash is kept."""

    name: str
    role: str
    made_s: float
    made_by: str
    expires_s: float | None = None  # None: it does not


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the audit log."""

    id: int
    at_s: float
    user: str
    address: str
    action: str
    detail: str
    allowed: bool


@dataclass(slots=True)
class Values:
    """Named JSON values: settings, marks, verdicts. Raises StoreError."""

    _database: Database
    _table: str
    _clock: Clock = time.time

    def all(self) -> dict[str, Any]:
        rows = self._database.rows(f"SELECT key, value FROM {self._table} ORDER BY 1")
        return {row[0]: json.loads(row[1]) for row in rows}

    def get(self, key: str, default: Any = None) -> Any:
        rows = self._database.rows(f"SELECT value FROM {self._table} WHERE key = ?", (key,))
        return json.loads(rows[0][0]) if rows else default

    def set(self, key: str, value: Any, by: str) -> None:
        with self._database.write() as sql:
            self._put(sql, key, value, by)

    def put(self, values: Mapping[str, Any], by: str) -> None:
        """Several, all of them or none."""
        with self._database.write() as sql:
            for key, value in values.items():
                self._put(sql, key, value, by)

    def remove(self, key: str) -> None:
        """Nothing happens where there is no such value."""
        with self._database.write() as sql:
            sql.execute(f"DELETE FROM {self._table} WHERE key = ?", (key,))

    def replace(self, values: Mapping[str, Any], by: str, sql: sqlite3.Connection) -> None:
        """All of them at once, within the caller's transaction; for a restored back-up."""
        sql.execute(f"DELETE FROM {self._table}")
        for key, value in values.items():
            self._put(sql, key, value, by)

    def _put(self, sql: sqlite3.Connection, key: str, value: Any, by: str) -> None:
        sql.execute(
            f"REPLACE INTO {self._table} (key, value, changed_s, changed_by) VALUES (?, ?, ?, ?)",
            (key, _json(value), self._clock(), by),
        )


@dataclass(slots=True)
class Users:
    """Users with their password hashes, and the tokens of scripts. Raises StoreError."""

    _database: Database
    _clock: Clock = time.time

    def all(self) -> list[User]:
        """Those that are sound: who has a role that is none, after a bad bit, is nobody."""
        rows = self._database.rows("SELECT name, password, role FROM users ORDER BY name")
        return [User(*row) for row in rows if row[2] in ROLES and isinstance(row[1], str)]

    def known(self) -> int | None:
        """How many users there are by the file beside the store; None: it cannot be known."""
        return log_in_marker.users(self._state)

    @property
    def lost(self) -> Message | None:
        """What is said where the store has fewer users than there are; None: all is well."""
        there, known = len(self.all()), self.known()
        if there:
            fewer = known is not None and there < known
            return message("users_lost_some", were=known, are=there) if fewer else None
        where = {"file": self._database.file, "folder": self._state}
        return None if known == 0 else message("users_lost", **where)

    @property
    def _state(self) -> Path:
        return self._database.file.parent

    def _mark(self, count: int) -> None:
        """Raises StoreError."""
        try:
            log_in_marker.write(self._state, count)
        except OSError as error:
            raise StoreError.of("store", "store_unwritten", file=self._state, why=error) from error

    def get(self, name: str) -> User | None:
        return next((user for user in self.all() if user.name == name), None)

    def set(self, name: str, password: str, role: str) -> None:
        """Make or change a user; ``password`` is the hash."""
        _role(role)
        with self._database.write() as sql:
            sql.execute(
                "REPLACE INTO users (name, password, role, changed_s) VALUES (?, ?, ?, ?)",
                (name, password, role, self._clock()),
            )
            self._mark(_users(sql))  # before there are any, so that no death in between opens anything

    def remove(self, name: str) -> None:
        with self._database.write() as sql:
            known = self.known()
            if not sql.execute("DELETE FROM users WHERE name = ?", (name,)).rowcount:
                raise StoreError.of("missing", "missing", what=Key("what.user"), name=name)
            there = _users(sql)
        if there or known is not None:
            self._mark(max(there, (known or 1) - 1))

    def tokens(self) -> list[Token]:
        return list(self.by_hash().values())

    def by_hash(self) -> dict[str, Token]:
        """All tokens, by the hash of each."""
        rows = self._database.rows("SELECT sha256, name, role, made_s, made_by, expires_s FROM tokens")
        return {row[0]: Token(*row[1:]) for row in rows if row[2] in ROLES}

    def token(self, sha256: str) -> Token | None:
        """The token of that hash."""
        rows = self._database.rows(
            "SELECT name, role, made_s, made_by, expires_s FROM tokens WHERE sha256 = ?", (sha256,)
        )
        return next((Token(*row) for row in rows if row[1] in ROLES), None)

    def add_token(
        self, sha256: str, name: str, role: str, by: str, lasts_s: float | None = None
    ) -> float | None:
        """``lasts_s``: from now on; when it expires, seconds since 1970, None: never."""
        _role(role)
        now_s = self._clock()
        expires_s = None if lasts_s is None else now_s + lasts_s
        try:
            with self._database.write() as sql:
                sql.execute(
                    "INSERT INTO tokens (sha256, name, role, made_s, made_by, expires_s) "
                    "VALUES (?, ?, ?, ?, ?, ?)",
                    (sha256, name, role, now_s, by, expires_s),
                )
        except sqlite3.IntegrityError as error:
            raise StoreError.of("exists", "exists", what=Key("what.token"), name=name) from error
        return expires_s

    def sessions(self) -> list[tuple[str, str, str, float, float]]:
        """Log-ins, the oldest first: SHA-256 of the cookie, user, mark, begin, last request."""
        rows = self._database.rows(
            "SELECT sha256, user, mark, began_s, seen_s FROM sessions ORDER BY began_s"
        )
        return [(row[0], row[1], row[2], row[3], row[4]) for row in rows]

    def keep_sessions(self, rows: Iterable[tuple[str, str, str, float, float]], ended: Iterable[str]) -> None:
        """New ones and those that were seen again, as ``sessions`` gives them; ``ended``: their SHA-256."""
        with self._database.write() as sql:
            sql.executemany("REPLACE INTO sessions VALUES (?, ?, ?, ?, ?)", rows)
            sql.executemany("DELETE FROM sessions WHERE sha256 = ?", [(key,) for key in ended])

    def remove_token(self, name: str) -> None:
        with self._database.write() as sql:
            if not sql.execute("DELETE FROM tokens WHERE name = ?", (name,)).rowcount:
                raise StoreError.of("missing", "missing", what=Key("what.token"), name=name)


@dataclass(slots=True)
class Audit:
    """Who asked for what; the oldest lines go. Raises StoreError."""

    _database: Database
    _clock: Clock = time.time
    most: int = field(default=100_000)

    def add(self, user: str, address: str, action: str, detail: str = "", allowed: bool = True) -> None:
        with self._database.write() as sql:
            done = sql.execute(
                "INSERT INTO audit (at_s, user, address, action, detail, allowed) VALUES (?, ?, ?, ?, ?, ?)",
                (self._clock(), user, address, action, detail, allowed),
            )
            sql.execute("DELETE FROM audit WHERE id <= ?", ((done.lastrowid or 0) - self.most,))

    def list(self, most: int = 100, before: int | None = None) -> list[Entry]:
        """The latest first."""
        rows = self._database.rows(
            "SELECT * FROM audit WHERE id < ? ORDER BY id DESC LIMIT ?", (_before(before), most)
        )
        return [Entry(**{**dict(row), "allowed": bool(row["allowed"])}) for row in rows]


def _users(sql: sqlite3.Connection) -> int:
    return int(sql.execute("SELECT count(*) FROM users").fetchone()[0])


def _before(number: int | None) -> int:
    return 2**62 if number is None else min(max(number, 0), 2**62)


def _json(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


def _role(role: str) -> None:
    if role not in ROLES:
        raise StoreError("form", message("store.role", role=role, names=", ".join(ROLES)))
