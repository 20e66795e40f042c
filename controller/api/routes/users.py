"""Users, tokens of scripts and the audit log: for who sets up."""

from __future__ import annotations

import asyncio
from dataclasses import asdict
from typing import Annotated

from fastapi import Path, Request

from controller.api import models_of_access as models
from controller.api.access import needs, panel_of, principal
from controller.api.answers import Refusal
from controller.api.app_state import Panel
from controller.api.roles import Role
from controller.api.router import SET_UP, Router
from controller.api.routes.records import Before, Most, before
from controller.api.routes.session import check_password
from controller.api.users import new_token
from controller.messages import Key

router = Router(tags=["users"])
Name = Annotated[str, Path(pattern=r"^[A-Za-z0-9_.@-]{1,40}$")]
AGAIN = needs(Role.SET_UP, again=True)
CHANGES = (404, 409, 422)


@router.get("/users", SET_UP)
async def users(request: Request) -> models.UserList:
    """All users and their roles."""
    rows = await asyncio.to_thread(panel_of(request).store.users.all)
    return models.UserList(
        users=[models.UserFacts(name=row.name, role=Role.named(row.role).label) for row in rows]
    )


@router.post("/users", AGAIN, 409, 422, status_code=201)
async def add_user(request: Request, body: models.NewUser) -> models.UserFacts:
    """Add a user; the first one is added at the command line."""
    panel = panel_of(request)
    rows = await asyncio.to_thread(panel.store.users.all)
    if any(row.name == body.name for row in rows):
        raise Refusal.of(409, "exists", "exists", what=Key("what.user"), name=body.name)
    if not rows:
        # From the first user on everybody has to log in: whoever made it would own the machine, and
        # without users any program on this computer could be who.
        raise Refusal.of(409, "role", "first_user")
    check_password(body.password, body.name)
    await _set(panel, body.name, await panel.users.hash(body.password), body.role)
    return models.UserFacts(name=body.name, role=body.role)


@router.patch("/users/{name}", AGAIN, *CHANGES)
async def change_user(request: Request, name: Name, body: models.UserChange) -> models.UserFacts:
    """Another password, another role; the user's sessions end."""
    panel = panel_of(request)
    row = await asyncio.to_thread(panel.store.users.get, name)
    if row is None:
        raise Refusal.of(404, "missing", "missing", what=Key("what.user"), name=name)
    role = body.role or Role.named(row.role).label
    await _not_the_last(panel, name, role == "set_up")
    if body.password is not None:
        check_password(body.password, name)
    password = row.password if body.password is None else await panel.users.hash(body.password)
    await _set(panel, name, password, role)
    return models.UserFacts(name=name, role=role)


@router.delete("/users/{name}", AGAIN, *CHANGES, status_code=204)
async def remove_user(request: Request, name: Name) -> None:
    """Remove a user; the sessions end."""
    panel = panel_of(request)
    await _not_the_last(panel, name, False)
    await asyncio.to_thread(panel.store.users.remove, name)
    await _changed(panel)


async def _not_the_last(panel: Panel, name: str, still: bool) -> None:
    """Nobody locks everybody out by removing the last one who sets up."""
    rows = await asyncio.to_thread(panel.store.users.all)
    setting_up = {row.name for row in rows if row.role == "set_up"}
    if not still and setting_up == {name}:
        raise Refusal.of(409, "role", "last_set_up", name=name)


async def _set(panel: Panel, name: str, password: str, role: str) -> None:
    await asyncio.to_thread(panel.store.users.set, name, password, role)
    await _changed(panel)


async def _changed(panel: Panel) -> None:
    """Also sessions of an old password or role, or of somebody who is gone, end by it."""
    await asyncio.to_thread(panel.users.refresh)


# ---- tokens of scripts


@router.get("/tokens", SET_UP)
async def tokens(request: Request) -> models.TokenList:
    """The scripts' tokens; not what they are, only whose."""
    rows = await asyncio.to_thread(panel_of(request).store.users.tokens)
    return models.TokenList(tokens=[models.TokenFacts(**asdict(row)) for row in rows])


@router.post("/tokens", AGAIN, 409, 422, status_code=201)
async def add_token(request: Request, body: models.NewToken) -> models.MadeToken:
    """Make a token for a script; it is told only once."""
    panel, who = panel_of(request), await principal(request)
    token, sha256 = new_token()
    lasts_s = None if body.days is None else body.days * 86400.0
    add = panel.store.users.add_token
    expires_s = await asyncio.to_thread(add, sha256, body.name, body.role, who.name, lasts_s)
    return models.MadeToken(name=body.name, role=body.role, token=token, expires_s=expires_s)


@router.delete("/tokens/{name}", AGAIN, *CHANGES, status_code=204)
async def remove_token(request: Request, name: Name) -> None:
    """Its script is refused from now on."""
    panel = panel_of(request)
    await asyncio.to_thread(panel.store.users.remove_token, name)
    await asyncio.to_thread(panel.users.refresh)


@router.get("/audit", SET_UP, 422)
async def audit(request: Request, most: Most = 100, before_id: Before = None) -> models.AuditList:
    """Who asked for what, the latest first."""
    rows = await asyncio.to_thread(panel_of(request).store.audit.list, most, before_id)
    entries = [models.AuditEntry(**asdict(row)) for row in rows]
    return models.AuditList(entries=entries, before=before(rows, most))
