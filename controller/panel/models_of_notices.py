"""What is sent and answered about notices by webhook and mail."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from controller.panel.models import Number, Sent, Told

Text = Annotated[str, Field(max_length=2000)]
Security = Literal["starttls", "tls", "none"]


class NoticeChange(Sent):
    """What is null stays."""

    alarms: bool | None = None
    program_end: bool | None = None
    tool_change: bool | None = None
    language: Literal["en", "de"] | None = None
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


class Delivery(Told):
    """What came of the last notice by a way; null: none was sent yet."""

    at_s: Number = None
    sent: bool | None = None
    sentence: str | None = None
    sentence_de: str | None = None


class NoticeFacts(Told):
    alarms: bool
    program_end: bool
    tool_change: bool
    language: Literal["en", "de"]
    webhook: str = Field(description="Scheme and host alone: what follows may be a key.")
    host: str
    port: int
    security: Security
    user: str
    password_set: bool
    sender: str
    to: str
    last: dict[str, Delivery] = Field(description="By way: webhook, mail.")
