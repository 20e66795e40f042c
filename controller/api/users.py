"""Users, their sessions and scripts' tokens: who somebody is who sends a password, cookie or token.

Passwords are kept as argon2 hashes, tokens as SHA-256 (they are random, so a slow hash adds
nothing). What somebody may do is the role; sessions and tokens have an end, and outlive a restart.

Who guesses passwords is slowed down by address, and only a crowd of addresses by the name that it
guesses at: were it by name alone, anybody could keep somebody else from logging in. Even a crowd
keeps nobody out who has logged in before from where he sits.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import secrets
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from controller.api.answers import Refusal
from controller.api.database import StoreError
from controller.api.records import Token, User
from controller.api.records import Users as Rows
from controller.api.roles import Principal, Role
from controller.api.sessions import Session, Sessions, csrf_of, sha256
from controller.messages import Message

FREE_TRIES = 5  # wrong passwords from an address before it has to wait
CROWD_TRIES = 100  # of one name, from all addresses that are strange to it
LONGEST_WAIT_S = 60.0
# One wrong try is forgotten in the time that an address may be made to wait for its next: so one
# address alone fills its own measure and never that of a name.
FORGOTTEN_S = LONGEST_WAIT_S
PLACES = 1000  # pairs of name and address that are remembered
REFRESH_S = 2.0
HASHES_AT_ONCE = 2  # each takes 64 MB and tens of milliseconds
TOKEN_MARK = "dx_"  # so that a token is known as one wherever it turns up


@dataclass(slots=True)
class Tries:
    """Wrong passwords of one user name, or from one address."""

    free: int
    wrong: float = 0.0  # as many as were remembered at ``last_s``
    last_s: float = -1e9

    def wait_s(self, now_s: float) -> float:
        """How long before the next try is looked at; doubles with every wrong one."""
        if self.wrong < self.free:
            return 0.0
        pause_s = min(LONGEST_WAIT_S, math.exp2(self.wrong - self.free))
        return max(0.0, self.last_s + pause_s - now_s)

    def remembered(self, now_s: float) -> float:
        return max(0.0, self.wrong - (now_s - self.last_s) / FORGOTTEN_S)

    def add(self, now_s: float) -> None:
        """One more."""
        self.wrong, self.last_s = self.remembered(now_s) + 1.0, now_s

    def take_back(self) -> None:
        """The last was not wrong."""
        self.wrong -= 1.0


@dataclass(slots=True)
class Brake:
    """Slows down who guesses passwords; ``keys``: how many free tries each of them has."""

    _tries: dict[str, Tries] = field(default_factory=dict)

    def check(self, now_s: float, keys: Mapping[str, int]) -> None:
        """Raises Refusal where one of the keys has to wait."""
        wait_s = max(self._tries[key].wait_s(now_s) if key in self._tries else 0.0 for key in keys)
        if wait_s > 0.0:
            later = {"Retry-After": str(int(wait_s) + 1)}
            raise Refusal.of(429, "too_often", "too_often", headers=later, seconds=wait_s)

    def wrong(self, now_s: float, keys: Mapping[str, int]) -> None:
        self._tries = {key: tries for key, tries in self._tries.items() if tries.remembered(now_s) > 0.0}
        for key, free in keys.items():
            self._tries.setdefault(key, Tries(free)).add(now_s)

    def right(self, keys: Iterable[str]) -> None:
        """That try was not wrong. Those before it stay: an own account is no way to go on guessing."""
        for key in keys:
            if key in self._tries:
                self._tries[key].take_back()


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
        wall: Callable[[], float] = time.time,
    ) -> None:
        """``clock`` in s, for who guesses; ``wall`` in s since 1970, for what expires. Raises StoreError."""
        self._rows, self._clock, self._hasher = rows, clock, hasher or PasswordHasher()
        self._hashing = asyncio.Semaphore(HASHES_AT_ONCE)
        self._wall, self._sessions = wall, Sessions(rows, wall)
        self._brake = Brake()
        self._places: dict[tuple[str, str], None] = {}  # (name, address) of log-ins, latest last
        self._users: dict[str, User] = {}
        self.lost: Message | None = None  # what is said of users that the store has lost
        self._marks: dict[str, str] = {}  # of users: of password and role
        self._tokens: dict[str, Token] = {}  # by SHA-256
        self.refresh()

    def refresh(self) -> None:
        """Read users and tokens from the store, and write sessions into it. Raises StoreError."""
        self._users = {user.name: user for user in self._rows.all()}
        self.lost = self._rows.lost
        self._marks = {user.name: sha256(f"{user.password} {user.role}") for user in self._users.values()}
        self._tokens = self._rows.by_hash()
        self.write_sessions()

    def write_sessions(self) -> None:
        """What the store does not know yet. Raises StoreError."""
        self._sessions.write(self._marks)

    @property
    def any(self) -> bool:
        """Whether there are users at all, also lost ones; without, only this computer may ask."""
        return bool(self._users) or self.lost is not None

    def check_lost(self) -> None:
        """Raises Refusal where there were users and the store has none any more: nobody can log in."""
        if self.lost is not None and not self._users:
            more, headers = self.lost["values"], {"WWW-Authenticate": "Bearer"}
            raise Refusal.of(401, "log_in", self.lost["key"], headers=headers, **more)

    @cached_property
    def _nobody(self) -> str:
        """Checked for unknown names, so that the time taken does not show which names there are."""
        return self._hasher.hash(secrets.token_urlsafe(16))

    async def hash(self, password: str) -> str:
        async with self._hashing:
            return await asyncio.to_thread(self._hasher.hash, password)

    async def log_in(self, name: str, password: str, address: str) -> tuple[str, Principal]:
        """(cookie, who it is). Raises Refusal for a wrong name or password, or too many of them."""
        user = await self._checked(name, password, address)
        if user is None:
            raise Refusal.of(401, "log_in", "wrong_password")
        self._remember(name, address)
        begun = self.begin(name, Role.named(user.role))
        with contextlib.suppress(StoreError):  # a full disk keeps nobody out; the session ends with the panel
            await asyncio.to_thread(self.write_sessions)
        return begun

    async def _checked(self, name: str, password: str, address: str) -> User | None:
        """Whose password it is; None: it is wrong. Raises Refusal for too many wrong ones."""
        keys = {f"from {address}": FREE_TRIES}
        if (name, address) not in self._places:
            keys[f"user {name}"] = CROWD_TRIES
        self._brake.check(self._clock(), keys)
        # Counted before it is known, so that a hundred at once do not all get a free try.
        self._brake.wrong(self._clock(), keys)
        self.check_lost()
        user = self._users.get(name)
        async with self._hashing:
            right = await asyncio.to_thread(self._verify, user, password)
        if user is None or not right:
            return None
        self._brake.right(keys)
        return user

    async def confirm(self, cookie: str, name: str, password: str, address: str) -> User:
        """The user of a session gives the password again. Raises Refusal 403 for another, 429."""
        user = await self._checked(name, password, address)
        if user is None:
            raise Refusal.of(403, "confirm", "confirm_wrong", name=name)
        self._sessions.confirm(cookie)
        return user

    def is_confirmed(self, cookie: str) -> bool:
        """Whether the user of a session gave the password again, a short while ago."""
        return self._sessions.is_confirmed(cookie)

    def sessions(self) -> list[tuple[str, Session]]:
        """All that last, by the name of each."""
        return self._sessions.lasting(self._marks)

    def end_session(self, name: str) -> None:
        """Raises StoreError."""
        self._sessions.end_named(name)
        self.write_sessions()

    def _remember(self, name: str, address: str) -> None:
        self._places.pop((name, address), None)
        while len(self._places) >= PLACES:
            del self._places[next(iter(self._places))]
        self._places[name, address] = None

    def _verify(self, user: User | None, password: str) -> bool:
        try:
            return self._hasher.verify(user.password if user else self._nobody, password)
        except (VerificationError, InvalidHashError):
            return False

    def begin(self, name: str, role: Role) -> tuple[str, Principal]:
        """A session of somebody who is known: (cookie, who it is)."""
        cookie, csrf = self._sessions.begin(name, self._marks[name])
        return cookie, Principal(name, role, "session", csrf)

    def by_cookie(self, cookie: str) -> Principal | None:
        """Whose session it is; None where it ended or the user is gone."""
        session = self._sessions.of(cookie, self._marks)
        user = self._users.get(session.user) if session is not None else None
        return Principal(user.name, Role.named(user.role), "session", csrf_of(cookie)) if user else None

    async def by_token(self, token: str) -> Principal | None:
        """Whose script it is. Raises StoreError, and Refusal for one that has expired."""
        if not token.startswith(TOKEN_MARK):
            return None
        key = sha256(token)
        # One that is not in memory was made within the last ``REFRESH_S``, or never.
        found = self._tokens.get(key) or await asyncio.to_thread(self._rows.token, key)
        if found is None:
            return None
        self._tokens[key] = found
        if found.expires_s is not None and self._wall() >= found.expires_s:
            raise Refusal.of(401, "token", "token_expired", name=found.name)
        return Principal(f"token {found.name}", Role.named(found.role), "token")

    def log_out(self, cookie: str) -> None:
        """Ends the session, for good. Raises StoreError."""
        self._sessions.end(cookie)
        self.write_sessions()


def new_token() -> tuple[str, str]:
    """(a random token, its SHA-256 for the store)."""
    token = TOKEN_MARK + secrets.token_urlsafe(32)
    return token, sha256(token)
