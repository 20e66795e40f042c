"""Notices by webhook and mail: where to, of what, and whether they come through."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from typing import Annotated, Any, Literal

from fastapi import Request
from pydantic import AfterValidator, Field

from controller import messages
from controller.api import notice_settings, notices
from controller.api.access import panel_of, principal
from controller.api.answers import Refusal, Texts
from controller.api.app_state import Panel
from controller.api.models import Number, Sent, Told
from controller.api.notice_settings import NoticeSettings
from controller.api.router import SET_UP, Router

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


router = Router(tags=["notices"])


@router.get("/notices", SET_UP, 503)
async def settings(request: Request) -> NoticeFacts:
    """What is set, but for what is secret, and what came of the last notice by each way."""
    panel = panel_of(request)
    return _facts(panel, await _load(panel))


@router.patch("/notices", SET_UP, 422, 503)
async def change(request: Request, body: NoticeChange) -> NoticeFacts:
    """Change some of it; the next notice goes by it."""
    panel, who = panel_of(request), await principal(request)
    found = notices.changed(await _load(panel), body.model_dump())
    await asyncio.to_thread(notice_settings.keep, panel.store.settings, found, who.name)
    return _facts(panel, found)


@router.post("/notices/test", SET_UP, 409, 503)
async def test(request: Request) -> NoticeFacts:
    """Send one now by every way that is set, once; ``last`` tells what came of it."""
    panel = panel_of(request)
    found = await _load(panel)
    if not found.is_enabled:
        raise Refusal.of(409, "refused", "notice_none")
    await panel.notices.test(found)
    return _facts(panel, found)


async def _load(panel: Panel) -> NoticeSettings:
    return await asyncio.to_thread(panel.notices.settings)


def _facts(panel: Panel, found: NoticeSettings) -> NoticeFacts:
    shown = {name: value for name, value in asdict(found).items() if name not in ("webhook", "password")}
    last = {way: _delivery(one) for way, one in panel.notices.outcomes.items()}
    hidden: dict[str, Any] = {"webhook": found.webhook_shown, "password_set": bool(found.password)}
    return NoticeFacts(**shown, **hidden, last=last)


def _delivery(one: notices.Outcome) -> Delivery:
    return Delivery(at_s=one.at_s, sent=one.sent, **messages.facts(one.why))
