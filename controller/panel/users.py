"""Users, their sessions and scripts' tokens: who somebody is who sends a password, cookie or token.

Passwords are kept as argon2 hashes, tokens as SHA-256 (they are random, so a slow hash adds
nothing). Sessions live in memory: a restart of the panel logs everybody out.
"""

from __future__ import annotations

import asyncio
import hashlib
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from controller.panel.answers import Refusal
from controller.panel.records import Token, User
from controller.panel.records import Users as Rows
from controller.panel.roles import Principal, Role

SESSION_S = 12 * 3600.0  # a shift
IDLE_S = 2 * 3600.0
SESSIONS = 1000  # at once; the oldest go
FREE_TRIES = 5  # wrong passwords before one has to wait
LONGEST_WAIT_S = 60.0
FORGOTTEN_S = 3600.0
REFRESH_S = 2.0
HASHES_AT_ONCE = 2  # each takes 64 MB and tens of milliseconds
TOKEN_MARK = "dx_"  # so that a token is known as one wherever it turns up


@dataclass(slots=True)
class Session:
    """One log-in of a browser."""

    user: str
    csrf: str
    began_s: float
    seen_s: float


@dataclass(slots=True)
class Tries:
    """Wrong passwords of one user name, or from one address."""

    wrong: int = 0
    last_s: float = -1e9

    def wait_s(self, now_s: float) -> float:
        """How long before the next try is looked at; doubles with every wrong one."""
        if self.wrong < FREE_TRIES:
            return 0.0
        pause_s = min(LONGEST_WAIT_S, 2.0 ** (self.wrong - FREE_TRIES))
        return max(0.0, self.last_s + pause_s - now_s)


@dataclass(slots=True)
class Brake:
    """Slows down who guesses passwords, by name and by address."""

    _tries: dict[str, Tries] = field(default_factory=dict)

    def check(self, now_s: float, *keys: str) -> None:
        """Raises Refusal where one of the keys has to wait."""
        wait_s = max(self._tries.get(key, Tries()).wait_s(now_s) for key in keys)
        if wait_s > 0.0:
            later = {"Retry-After": str(int(wait_s) + 1)}
            raise Refusal.told(429, "too_often", "too_often", later, seconds=wait_s)

    def wrong(self, now_s: float, *keys: str) -> None:
        old = [key for key, tries in self._tries.items() if now_s - tries.last_s > FORGOTTEN_S]
        for key in old:
            del self._tries[key]
        for key in keys:
            tries = self._tries.setdefault(key, Tries())
            tries.wrong, tries.last_s = tries.wrong + 1, now_s

    def right(self, *keys: str) -> None:
        for key in keys:
            self._tries.pop(key, None)


class Users:
    """Knows who somebody is, from memory: a hold must not wait for the disk.

    What the store holds is read anew by ``refresh``: after every change made here, and every
    ``REFRESH_S`` for those that the command line made.
    """

    def __init__(
        self,
        rows: Rows,
        clock: Callable[[], float] = time.monotonic,
        hasher: PasswordHasher | None = None,
    ) -> None:
        """Raises StoreError."""
        self._rows, self._clock, self._hasher = rows, clock, hasher or PasswordHasher()
        self._hashing = asyncio.Semaphore(HASHES_AT_ONCE)
        self._sessions: dict[str, Session] = {}  # by SHA-256 of the cookie
        self._brake = Brake()
        self._users: dict[str, User] = {}
        self._tokens: dict[str, Token] = {}  # those seen, by SHA-256
        self.refresh()

    def refresh(self) -> None:
        """Read users and tokens from the store. Raises StoreError."""
        self._users = {user.name: user for user in self._rows.all()}
        found = {sha256: self._rows.token(sha256) for sha256 in list(self._tokens)}
        self._tokens = {sha256: token for sha256, token in found.items() if token is not None}

    @property
    def any(self) -> bool:
        """Whether there are users at all; without, only this computer may ask."""
        return bool(self._users)

    @cached_property
    def _nobody(self) -> str:
        """Checked for unknown names, so that the time taken does not tell which names there are."""
        return self._hasher.hash(secrets.token_urlsafe(16))

    async def hash(self, password: str) -> str:
        async with self._hashing:
            return await asyncio.to_thread(self._hasher.hash, password)

    async def log_in(self, name: str, password: str, address: str) -> tuple[str, Principal]:
        """(cookie, who it is). Raises Refusal for a wrong name or password, or too many of them."""
        keys = (f"user {name}", f"from {address}")
        self._brake.check(self._clock(), *keys)
        # Counted before it is known, so that a hundred at once do not all get a free try.
        self._brake.wrong(self._clock(), *keys)
        user = self._users.get(name)
        async with self._hashing:
            right = await asyncio.to_thread(self._verify, user, password)
        if user is None or not right:
            raise Refusal.told(401, "log_in", "wrong_password")
        self._brake.right(*keys)
        return self.begin(name, Role.named(user.role))

    def _verify(self, user: User | None, password: str) -> bool:
        try:
            return self._hasher.verify(user.password if user else self._nobody, password)
        except (VerificationError, InvalidHashError):
            return False

    def begin(self, name: str, role: Role) -> tuple[str, Principal]:
        """A session of somebody who is known: (cookie, who it is)."""
        cookie, csrf, now_s = secrets.token_urlsafe(32), secrets.token_urlsafe(24), self._clock()
        while len(self._sessions) >= SESSIONS:
            del self._sessions[next(iter(self._sessions))]
        self._sessions[_sha256(cookie)] = Session(name, csrf, now_s, now_s)
        return cookie, Principal(name, role, "session", csrf)

    def by_cookie(self, cookie: str) -> Principal | None:
        """Whose session it is; None where it ended or the user is gone."""
        key, now_s = _sha256(cookie), self._clock()
        session = self._sessions.get(key)
        if session is None:
            return None
        user = self._users.get(session.user)
        if user is None or now_s - session.began_s > SESSION_S or now_s - session.seen_s > IDLE_S:
            del self._sessions[key]
            return None
        session.seen_s = now_s
        return Principal(session.user, Role.named(user.role), "session", session.csrf)

    async def by_token(self, token: str) -> Principal | None:
        """Whose script it is. Raises StoreError."""
        if not token.startswith(TOKEN_MARK):
            return None
        key = _sha256(token)
        found = self._tokens.get(key) or await asyncio.to_thread(self._rows.token, key)
        if found is None:
            return None
        self._tokens[key] = found
        return Principal(f"token {found.name}", Role.named(found.role), "token")

    def log_out(self, cookie: str) -> None:
        self._sessions.pop(_sha256(cookie), None)

    def end_sessions(self, user: str) -> None:
        """After a new password or role: what was logged in by the old one is not any more."""
        for key in [key for key, session in self._sessions.items() if session.user == user]:
            del self._sessions[key]


def new_token() -> tuple[str, str]:
    """(a random token, its SHA-256 for the store)."""
    token = TOKEN_MARK + secrets.token_urlsafe(32)
    return token, _sha256(token)


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
