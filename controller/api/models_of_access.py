"""What is sent and answered about who may do what: control, log-in, users, tokens, the audit log."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from controller.api.models import Number, Sent, Told
from controller.api.passwords import MAX_LENGTH, MIN_LENGTH
from controller.api.roles import RoleName

UserName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.@-]{1,40}$")]
Password = Annotated[str, Field(min_length=MIN_LENGTH, max_length=MAX_LENGTH)]


# ---- sent


class TakeControl(Sent):
    take_over: bool = False


class LogIn(Sent):
    name: Annotated[str, Field(max_length=40)]
    password: Annotated[str, Field(max_length=200)]


class Confirm(Sent):
    password: Annotated[str, Field(max_length=MAX_LENGTH)]


class OwnPassword(Sent):
    old: Annotated[str, Field(max_length=MAX_LENGTH)]
    password: Password


class NewUser(Sent):
    name: UserName
    password: Password
    role: RoleName


class UserChange(Sent):
    """What is null stays."""

    password: Password | None = None
    role: RoleName | None = None


class NewToken(Sent):
    name: UserName
    role: RoleName
    days: Annotated[
        float | None, Field(gt=0.0, le=3650.0, description="From now on; null: it does not expire.")
    ] = None


# ---- answered

EXPIRES = Field(None, description="Seconds since 1970; null: it does not.")


class ControlFacts(Told):
    holder: str | None
    since_s: Number
    silent_s: Number = Field(description="For so long no request has brought the token.")
    mine: bool = Field(description="Whether the X-Control-Token that was sent is the one.")


class ControlToken(Told):
    holder: str
    token: str = Field(description="Send it as X-Control-Token; it is shown only here.")


class SessionFacts(Told):
    """Who asks, and what to send along."""

    name: str
    role: RoleName
    how: Literal["local", "session", "token"]
    csrf: str | None = Field(description="Of a session: send it as X-CSRF-Token with all but GET.")
    may_stop: bool = Field(description="Whether hold, stop and emergency stop are taken from who asks.")


class OpenSession(Told):
    id: str = Field(description="Its name, to end it by; nobody can log in with it.")
    user: str
    began_s: float = Field(description="Seconds since 1970.")
    seen_s: float = Field(description="Its last request, likewise.")
    mine: bool = Field(description="Whether it is the one that asks.")


class SessionList(Told):
    sessions: list[OpenSession] = Field(description="The latest request first.")


class UserFacts(Told):
    name: str
    role: RoleName


class UserList(Told):
    users: list[UserFacts]


class TokenFacts(Told):
    name: str
    role: RoleName
    made_s: float
    made_by: str
    expires_s: Number = EXPIRES


class TokenList(Told):
    tokens: list[TokenFacts]


class MadeToken(Told):
    name: str
    role: RoleName
    token: str = Field(description="It is shown only here.")
    expires_s: Number = EXPIRES


class AuditEntry(Told):
    id: int
    at_s: float
    user: str
    address: str
    action: str
    detail: str
    allowed: bool


class AuditList(Told):
    entries: list[AuditEntry]
    before: int | None
