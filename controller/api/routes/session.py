"""Log-in, log-out, and the control token."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import Header, Path, Request, Response

from controller.api import models_of_access as models
from controller.api import passwords
from controller.api.access import (
    COOKIE,
    address,
    check_origin,
    cookie_of,
    note_refused,
    panel_of,
    principal,
    stopping_role,
)
from controller.api.answers import Refusal
from controller.api.roles import Principal, Role
from controller.api.router import MOVE, OPERATE, VIEW, Router
from controller.api.sessions import NAME_DIGITS, SESSION_S, Session, name_of, sha256
from controller.api.store import User
from controller.messages import Key

router = Router(tags=["access"])
AGAIN = (409, 422, 429, 503)
SessionName = Annotated[str, Path(pattern=rf"^[0-9a-f]{{{NAME_DIGITS}}}$")]


@router.post("/session", None, 409, 422, 429)
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
    _set_cookie(request, response, cookie)
    return _facts(request, who)


def _set_cookie(request: Request, response: Response, cookie: str) -> None:
    secure = request.url.scheme == "https"
    response.set_cookie(
        COOKIE, cookie, max_age=int(SESSION_S), httponly=True, samesite="strict", secure=secure, path="/"
    )


@router.get("/session", VIEW)
async def session(request: Request) -> models.SessionFacts:
    """Who asks."""
    return _facts(request, await principal(request))


@router.delete("/session", VIEW, 503, status_code=204)
async def log_out(request: Request, response: Response) -> None:
    """End the session."""
    await asyncio.to_thread(panel_of(request).users.log_out, cookie_of(request))
    response.delete_cookie(COOKIE, path="/")


def _facts(request: Request, who: Principal) -> models.SessionFacts:
    return models.SessionFacts(
        name=who.name,
        role=who.role.label,
        how=who.how,
        csrf=who.csrf or None,
        may_stop=who.role >= stopping_role(panel_of(request)),
    )


# ---- the own password, and the sessions that are open


@router.post("/session/confirm", VIEW, *AGAIN, status_code=204)
async def confirm(request: Request, body: models.Confirm) -> None:
    """Give the password again: for two minutes users and tokens may be changed by this session."""
    await _confirmed(request, body.password)


@router.put("/session/password", VIEW, *AGAIN)
async def own_password(request: Request, response: Response, body: models.OwnPassword) -> models.SessionFacts:
    """Another password of one's own; it asks for the old one. All other sessions of the user end."""
    user = await _confirmed(request, body.old)
    panel = panel_of(request)
    check_password(body.password, user.name)
    hashed = await panel.users.hash(body.password)
    await asyncio.to_thread(panel.store.users.set, user.name, hashed, user.role)
    await asyncio.to_thread(panel.users.refresh)
    cookie, who = panel.users.begin(user.name, Role.named(user.role))
    await asyncio.to_thread(panel.users.write_sessions)
    _set_cookie(request, response, cookie)
    return _facts(request, who)


async def _confirmed(request: Request, password: str) -> User:
    """Raises Refusal 403 for another password, 409 for who is in no session."""
    panel, who = panel_of(request), await principal(request)
    if who.how != "session":
        raise Refusal.of(409, "log_in", "no_session", name=who.name)
    try:
        return await panel.users.confirm(cookie_of(request), who.name, password, address(request))
    except Refusal as refusal:
        note_refused(request, who.name, "password", refusal)
        raise


def check_password(password: str, name: str) -> None:
    """Raises Refusal 422 for one that is easy to guess."""
    if (why := passwords.check(password, [name])) is not None:
        raise Refusal(422, "password", why)


@router.get("/sessions", VIEW)
async def sessions(request: Request) -> models.SessionList:
    """The sessions that are open: one's own, for who sets up all of them."""
    own = cookie_of(request)
    rows = [
        models.OpenSession(
            id=name, user=one.user, began_s=one.began_s, seen_s=one.seen_s, mine=name == name_of(sha256(own))
        )
        for name, one in await _visible(request)
    ]
    return models.SessionList(sessions=rows)


@router.delete("/sessions/{name}", VIEW, 404, 422, 503, status_code=204)
async def end_session(request: Request, name: SessionName) -> None:
    """End one; whose it is has to log in again."""
    if name not in [known for known, _ in await _visible(request)]:
        raise Refusal.of(404, "missing", "missing", what=Key("what.session"), name=name)
    await asyncio.to_thread(panel_of(request).users.end_session, name)


async def _visible(request: Request) -> list[tuple[str, Session]]:
    """Sessions that who asks may see, and end."""
    who = await principal(request)
    found = panel_of(request).users.sessions()
    return [(name, one) for name, one in found if who.role >= Role.SET_UP or one.user == who.name]


# ---- the control token


@router.get("/control", VIEW, 422)
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


@router.post("/control", OPERATE, 409, 422)
async def take_control(request: Request, body: models.TakeControl) -> models.ControlToken:
    """Take the control token. Taken over, what the other one jogs comes to rest."""
    panel, who = panel_of(request), await principal(request)
    before = panel.control.holder
    token = panel.control.take(who, body.take_over)
    panel.events.tell("control", {"holder": who.name})
    if before:
        await _rest(request)
    return models.ControlToken(holder=who.name, token=token)


@router.delete("/control", MOVE, 409, 422, status_code=204)
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
