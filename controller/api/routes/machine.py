"""The machine itself: its status, its facts and its drives."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Annotated, Any

from fastapi import Path, Query, Request

from controller.api import models
from controller.api.access import panel_of
from controller.api.answers import Answer, Refusal
from controller.api.router import LOOKS, VIEW, Router
from controller.ipc import control_socket

router = Router(tags=["machine"])
Last = Annotated[
    bool,
    Query(description="Where the service is gone, what it told last, with gone_s; without it that is a 503."),
]


async def ask(request: Request, verb: str, **args: Any) -> models.Done:
    """One verb of the service, done. Raises Refusal."""
    panel = panel_of(request)
    panel.go_on.on_command(verb)
    return models.Done(request=verb, result=await panel.door.ask(verb, **args))


@router.get("/status", VIEW, 422, 503, response_model=models.Status)
async def status(request: Request, last: Last = False) -> Answer:
    """What the machine is doing: mode, job with its exact time left, joints, what limits the feed."""
    panel = panel_of(request)
    now = await _or_last_known(panel.watch.status(), request, "status", last)
    # As it is, not through the model: this is asked for a hundred times a second.
    return Answer({**now, "control": panel.control.holder or None})


@router.get("/facts", VIEW, 422, 503)
async def facts(request: Request, last: Last = False) -> dict[str, Any]:
    """What does not change while the machine moves: axes, units, limits, tools, offsets, period."""
    return await _or_last_known(panel_of(request).door.ask("facts"), request, "facts", last)


async def _or_last_known(
    asked: Awaitable[dict[str, Any]], request: Request, what: str, wanted: bool
) -> dict[str, Any]:
    """The answer, or the last values of a service that has ended; one that runs and is silent is refused."""
    try:
        return await asked
    except Refusal as refusal:
        if wanted and refusal.facts.code == "gone":
            panel = panel_of(request)
            if found := await asyncio.to_thread(control_socket.last_known, panel.store.folder, what):
                return {**found, "gone_s": panel.watch.gone_s(found["gone_s"])}
        raise


@router.get("/drives/{axis}/terminals", VIEW, 409, 422, 503)
async def terminals(
    request: Request, axis: Annotated[str, Path(max_length=1, pattern="^[XYZABC]$")]
) -> models.Terminals:
    """What the drive of an axis sees at its terminals, read from it now: limit and reference switches."""
    return models.Terminals(**await panel_of(request).door.ask("terminals", axis=axis))


@router.get("/drives", VIEW, *LOOKS, response_model_exclude_unset=True)
async def drives(request: Request) -> models.DriveList:
    """State, statusword, error and age of the heartbeat of every drive."""
    found = await panel_of(request).door.ask("drives")
    return models.DriveList(drives=list(found.get("drives") or []))
