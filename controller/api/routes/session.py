"""Log-in, log-out, and the control token."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Header, Request, Response

from controller.api import models_of_access as models
from controller.api.access import (
    COOKIE,
    address,
    check_origin,
    moves,
    needs,
    note_refused,
    panel_of,
    principal,
    stopping_role,
)
from controller.api.answers import Refusal, documented
from controller.api.roles import Principal, Role
from controller.api.sessions import SESSION_S

router = APIRouter(tags=["access"])


@router.post("/session", responses=documented(401, 403, 409, 422, 429))
async def log_in(request: Request, response: Response, body: models.LogIn) -> models.SessionFacts:
    """Log in; the answer sets the cookie and tells the token that goes with it."""
    panel, where = panel_of(request), address(request)
    check_origin(request)
    if not panel.users.any:
        raise Refusal.of(409, "log_in", "no_users")
    try:
        cookie, who = await panel.users.log_in(body.name, body.password, where)
    except Refusal as refusal:
        if refusal.status == 401:  # a wrong try, of which there are few
            panel.note(body.name, where, "log in", allowed=False)
        else:
            note_refused(request, "", "log in", refusal)
        raise
    panel.note(who.name, where, "log in")
    secure = request.url.scheme == "https"
    response.set_cookie(
        COOKIE, cookie, max_age=int(SESSION_S), httponly=True, samesite="strict", secure=secure, path="/"
    )
    return _facts(request, who)


@router.get("/session", dependencies=[needs(Role.VIEW)], responses=documented(401, 403))
async def session(request: Request) -> models.SessionFacts:
    """Who asks."""
    return _facts(request, await principal(request))


@router.delete(
    "/session", status_code=204, dependencies=[needs(Role.VIEW)], responses=documented(401, 403, 503)
)
async def log_out(request: Request, response: Response) -> None:
    """End the session."""
    await asyncio.to_thread(panel_of(request).users.log_out, request.cookies.get(COOKIE, ""))
    response.delete_cookie(COOKIE, path="/")


def _facts(request: Request, who: Principal) -> models.SessionFacts:
    return models.SessionFacts(
        name=who.name,
        role=who.role.label,
        how=who.how,
        csrf=who.csrf or None,
        may_stop=who.role >= stopping_role(panel_of(request)),
    )


# ---- the control token


@router.get("/control", dependencies=[needs(Role.VIEW)], responses=documented(401, 403, 422))
async def control(
    request: Request, x_control_token: Annotated[str, Header(description="Whether it is this one.")] = ""
) -> models.ControlFacts:
    """Who may move the machine now."""
    held = panel_of(request).control
    mine = held.holds(x_control_token)
    return models.ControlFacts(
        holder=held.holder or None,
        since_s=held.since_s if held.holder else None,
        silent_s=held.silent_s,
        mine=mine,
    )


@router.post("/control", dependencies=[needs(Role.OPERATE)], responses=documented(401, 403, 409, 422))
async def take_control(request: Request, body: models.TakeControl) -> models.ControlToken:
    """Take the control token. Taken over, what the other one jogs comes to rest."""
    panel, who = panel_of(request), await principal(request)
    before = panel.control.holder
    token = panel.control.take(who, body.take_over)
    panel.events.tell("control", {"holder": who.name})
    if before:
        await _rest(request)
    return models.ControlToken(holder=who.name, token=token)


@router.delete("/control", status_code=204, dependencies=[moves()], responses=documented(401, 403, 409, 422))
async def give_control(request: Request) -> None:
    """Give the control token back; a program goes on."""
    panel = panel_of(request)
    panel.control.free()
    panel.events.tell("control", {"holder": None})
    await _rest(request)


async def _rest(request: Request) -> None:
    """Whoever jogged does not hold control any more."""
    try:
        await panel_of(request).door.ask("jog_stop")
    except Refusal:
        return  # nothing jogs; or no service is there, and its drives stop by themselves
