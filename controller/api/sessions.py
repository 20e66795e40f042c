"""Log-ins of browsers: known from memory, for a hold must not wait for the disk, and kept over a restart.

    cookie, csrf = sessions.begin(user, mark)     ``mark``: of password and role; other ones end the session
    sessions.of(cookie, marks)                    whose it is, while it lasts
    sessions.write(marks)                         what changed, into the store; by another thread

The store has no cookie and nothing that leads to one: only its SHA-256. What a page sends along with it
(CSRF token) is made of the cookie itself. Times are those of the wall, which go on while nothing runs.
"""

from __future__ import annotations

import hashlib
import math
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from controller.api.records import Users as Rows

SESSION_S = 12 * 3600.0  # a shift
IDLE_S = 2 * 3600.0
SESSIONS = 1000  # at once; the oldest go
SEEN_S = 60.0  # how old what the store knows of the last request may be
CONFIRMED_S = 120.0  # a password that was given again counts for so long
NAME_DIGITS = 16
SET_BACK_S = 60.0  # of the wall's clock: a session from further ahead is none


@dataclass(slots=True)
class Session:
    """One log-in of a browser."""

    user: str
    mark: str
    began_s: float  # seconds since 1970
    seen_s: float
    written_s: float = -math.inf  # what the store has of ``seen_s``
    confirmed_s: float = -math.inf  # the password was given again; no other process knows of it


class Sessions:
    """One thread asks; another one may ``write`` meanwhile."""

    def __init__(self, rows: Rows, clock: Callable[[], float]) -> None:
        """``clock``: seconds since 1970. Raises StoreError."""
        self._rows, self._clock = rows, clock
        self._known = {
            key: Session(user, mark, began_s, seen_s, seen_s)
            for key, user, mark, began_s, seen_s in rows.sessions()
        }
        self._ended: set[str] = set()  # keys that the store still has

    def begin(self, user: str, mark: str) -> tuple[str, str]:
        """A session of somebody who is known: its cookie, and what goes with it."""
        cookie, now_s = secrets.token_urlsafe(32), self._clock()
        while len(self._known) >= SESSIONS:
            self._end(next(iter(self._known)))
        self._known[sha256(cookie)] = Session(user, mark, now_s, now_s)
        return cookie, csrf_of(cookie)

    def of(self, cookie: str, marks: Mapping[str, str]) -> Session | None:
        """None where it has ended, or the user is gone or has another password or role."""
        key, now_s = sha256(cookie), self._clock()
        session = self._known.get(key)
        if session is None:
            return None
        if not self._lasts(session, marks, now_s):
            self._end(key)
            return None
        session.seen_s = now_s
        return session

    def end(self, cookie: str) -> None:
        """Log out."""
        self._end(sha256(cookie))

    def confirm(self, cookie: str) -> None:
        """Its user has given the password again."""
        if (session := self._known.get(sha256(cookie))) is not None:
            session.confirmed_s = self._clock()

    def is_confirmed(self, cookie: str) -> bool:
        """Whether that was a short while ago."""
        session = self._known.get(sha256(cookie))
        return session is not None and 0.0 <= self._clock() - session.confirmed_s <= CONFIRMED_S

    def lasting(self, marks: Mapping[str, str]) -> list[tuple[str, Session]]:
        """Those that last, by the name of each, the latest request first."""
        now_s = self._clock()
        found = [(key, one) for key, one in self._known.copy().items() if self._lasts(one, marks, now_s)]
        return [(name_of(key), one) for key, one in sorted(found, key=lambda pair: -pair[1].seen_s)]

    def end_named(self, name: str) -> None:
        """The one of that name; nothing where there is none any more."""
        for key in [key for key in self._known.copy() if name_of(key) == name]:
            self._end(key)

    def write(self, marks: Mapping[str, str]) -> None:
        """Bring the store up to date. Raises StoreError; then the next time does it."""
        now_s = self._clock()
        for key, session in self._known.copy().items():
            if not self._lasts(session, marks, now_s):
                self._end(key)
        new = {key: one for key, one in self._known.copy().items() if one.seen_s - one.written_s >= SEEN_S}
        ended = self._ended.copy()
        if new or ended:
            rows = [(key, one.user, one.mark, one.began_s, one.seen_s) for key, one in new.items()]
            self._rows.keep_sessions(rows, ended)
        for row in rows if new else ():
            new[row[0]].written_s = row[4]
        self._ended -= ended

    def _lasts(self, session: Session, marks: Mapping[str, str], now_s: float) -> bool:
        current = marks.get(session.user) == session.mark
        young = -SET_BACK_S <= now_s - session.began_s <= SESSION_S
        return current and young and now_s - session.seen_s <= IDLE_S

    def _end(self, key: str) -> None:
        if self._known.pop(key, None) is not None:
            self._ended.add(key)


def name_of(key: str) -> str:
    """The name of a session; it leads to no cookie."""
    return key[:NAME_DIGITS]


def csrf_of(cookie: str) -> str:
    """What the page of a session must send along; it shows nothing of the cookie."""
    return sha256(f"csrf {cookie}")


def sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
