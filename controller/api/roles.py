"""Who may do what: three roles, and the control token that only one holds at a time."""

from __future__ import annotations

import secrets
import time
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, cast

from controller.api.answers import Refusal
from controller.messages import Key

RoleName = Literal["view", "operate", "set_up"]


class Role(IntEnum):
    """Each may do what those before it may."""

    VIEW = 1  # look at everything that is not about users
    OPERATE = 2  # upload, and move the machine while holding the control token
    SET_UP = 3  # users, tokens, settings, back-up

    @classmethod
    def named(cls, name: str) -> Role:
        return cls[name.upper()]

    @property
    def label(self) -> RoleName:
        return cast(RoleName, self.name.lower())


@dataclass(frozen=True, slots=True)
class Principal:
    """Who asks."""

    name: str
    role: Role
    how: Literal["local", "session", "token"]
    csrf: str = ""  # of a session: what its page must send along


@dataclass(slots=True)
class Control:
    """The control token: who holds it may move the machine; hold, stop and e-stop need none.

    It names a page or a script, not a user: two pages of one user cannot both jog.
    """

    holder: str = ""  # user or token name; "" = free
    since_s: float = 0.0  # seconds since 1970
    heard_s: float = 0.0  # monotonic: of the last request that brought the token
    _token: str = field(default="", repr=False)

    def take(self, who: Principal, take_over: bool = False) -> str:
        """A new token, shown only here. Raises Refusal while somebody holds it, unless taken over."""
        if self.holder and not take_over:
            raise Refusal.of(409, "control", "control_held", holder=self.holder)
        self.holder, self.since_s, self._token = who.name, time.time(), secrets.token_urlsafe(16)
        self.heard_s = time.monotonic()
        return self._token

    def free(self) -> None:
        self.holder, self.since_s, self._token = "", 0.0, ""

    def holds(self, token: str) -> bool:
        """Whether it is that token; then its holder was heard of."""
        known = bool(self._token) and secrets.compare_digest(token.encode(), self._token.encode())
        if known:
            self.heard_s = time.monotonic()
        return known

    @property
    def silent_s(self) -> float | None:
        """For so long nothing has brought the token; None where nobody holds it."""
        return time.monotonic() - self.heard_s if self.holder else None

    def check(self, token: str) -> None:
        """Raises Refusal where ``token`` is not the one that was given last."""
        if self.holds(token):
            return
        raise Refusal.of(409, "control", "no_control", holder=self.holder or Key("nobody"))
