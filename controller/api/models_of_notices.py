"""What is sent and answered about notices by webhook and mail."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from controller import messages
from controller.api.answers import Texts
from controller.api.models import Number, Sent, Told

Text = Annotated[str, Field(max_length=2000)]


def _known(language: str) -> str:
    messages.of(language)
    return language


Language = Annotated[str, AfterValidator(_known)]
Security = Literal["starttls", "tls", "none"]


class NoticeChange(Sent):
    """What is null stays."""

    alarms: bool | None = None
    program_end: bool | None = None
    tool_change: bool | None = None
    language: Language | None = None
    webhook: Annotated[Text | None, Field(description="URL, http or https; empty: none.")] = None
    host: Annotated[Text | None, Field(description="Of the mail server; empty: no mail.")] = None
    port: Annotated[int | None, Field(ge=1, le=65535)] = None
    security: Security | None = None
    user: Annotated[Text | None, Field(description="Empty: the server asks for no log-in.")] = None
    password: Annotated[Text | None, Field(description="Told to nobody again; another host forgets it.")] = (
        None
    )
    sender: Text | None = None
    to: Annotated[Text | None, Field(description="Addresses, by commas.")] = None


class Delivery(Told, Texts):
    """What came of the last notice by a way, and why it was not sent."""

    at_s: Number = None
    sent: bool | None = None


class NoticeFacts(Told):
    alarms: bool
    program_end: bool
    tool_change: bool
    language: str
    webhook: str = Field(description="Scheme and host alone: what follows may be a key.")
    host: str
    port: int
    security: Security
    user: str
    password_set: bool
    sender: str
    to: str
    last: dict[str, Delivery] = Field(description="By way: webhook, mail.")
