"""Notices by webhook and mail: where to, of what, and whether they come through."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from typing import Any

from fastapi import APIRouter, Request

from controller import messages
from controller.api import models_of_notices as models
from controller.api import notice_settings, notices
from controller.api.access import needs, panel_of, principal
from controller.api.answers import Refusal, documented
from controller.api.app_state import Panel
from controller.api.notice_settings import NoticeSettings
from controller.api.roles import Role

router = APIRouter(tags=["notices"])
GUARD = [needs(Role.SET_UP)]


@router.get("/notices", dependencies=GUARD, responses=documented(401, 403, 503))
async def settings(request: Request) -> models.NoticeFacts:
    """What is set, but for what is secret, and what came of the last notice by each way."""
    panel = panel_of(request)
    return _facts(panel, await _load(panel))


@router.patch("/notices", dependencies=GUARD, responses=documented(401, 403, 422, 503))
async def change(request: Request, body: models.NoticeChange) -> models.NoticeFacts:
    """Change some of it; the next notice goes by it."""
    panel, who = panel_of(request), await principal(request)
    found = notices.changed(await _load(panel), body.model_dump())
    await asyncio.to_thread(notice_settings.keep, panel.store.settings, found, who.name)
    return _facts(panel, found)


@router.post("/notices/test", dependencies=GUARD, responses=documented(401, 403, 409, 503))
async def test(request: Request) -> models.NoticeFacts:
    """Send one now by every way that is set, once; ``last`` tells what came of it."""
    panel = panel_of(request)
    found = await _load(panel)
    if not found.wanted:
        raise Refusal.told(409, "refused", "notice_none")
    await panel.notices.test(found)
    return _facts(panel, found)


async def _load(panel: Panel) -> NoticeSettings:
    return await asyncio.to_thread(panel.notices.settings)


def _facts(panel: Panel, found: NoticeSettings) -> models.NoticeFacts:
    shown = {name: value for name, value in asdict(found).items() if name not in ("webhook", "password")}
    last = {way: _delivery(one) for way, one in panel.notices.outcomes.items()}
    hidden: dict[str, Any] = {"webhook": found.webhook_shown, "password_set": bool(found.password)}
    return models.NoticeFacts(**shown, **hidden, last=last)


def _delivery(one: notices.Outcome) -> models.Delivery:
    return models.Delivery(at_s=one.at_s, sent=one.sent, **messages.facts(one.why))
