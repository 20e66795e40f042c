"""Jogging: a direction that must be asked for again and again, or a step.

Dead-man: the service stops by itself 200 ms after the last request. Requests can overtake
each other on their way, so a late one could start what a stop has ended: it is known by
the name of its press, and refused; a stop from anywhere ends the press of a key that is held
(``controller.service.jogging``). So is one that a panel which hung has kept, sooner
than other requests (``access``): by then nobody may be pressing any more.
"""

from __future__ import annotations

from fastapi import APIRouter, Request

from controller.api import models
from controller.api.access import moves, stops
from controller.api.answers import Refusal
from controller.api.routes.machine import MOVES, ask

router = APIRouter(tags=["jog"])
SEEN_S = 0.4  # age of the tick that whoever presses has seen; statuses come every 50 ms


@router.post("/jog", dependencies=[moves(most_s=SEEN_S)], responses=MOVES)
async def jog(request: Request, body: models.Jog) -> models.Done:
    """Move on along an axis; repeat at least every 200 ms, at limits it comes to rest."""
    return await ask(request, "jog", frame=body.frame, axis=body.axis, speed=body.speed, press=body.press)


@router.post("/jog/step", dependencies=[moves()], responses=MOVES)
async def jog_step(request: Request, body: models.JogStep) -> models.Done:
    """Move by a distance; at limits it comes to rest."""
    return await ask(request, "jog_step", frame=body.frame, axis=body.axis, distance=body.distance)


@router.post("/jog/stop", dependencies=[stops()], responses=MOVES)
async def jog_stop(request: Request, body: models.JogStop) -> models.Done:
    """Come to rest. Needs no control token."""
    try:
        return await ask(request, "jog_stop", press=body.press)
    except Refusal as refusal:
        if refusal.status != 409:
            raise
        return models.Done(request="jog_stop")  # nothing jogs any more, which is what was asked for
