"""Tool life and maintenance: counted by the service, also while nobody looks."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request

from controller.api import models_of_usage as models
from controller.api.access import needs, panel_of, principal
from controller.api.roles import Role
from controller.api.routes.machine import LOOKS, MOVES
from controller.api.routes.tables import ToolNumber

router = APIRouter(tags=["tool life and maintenance"])
OPERATE = [needs(Role.OPERATE)]


@router.get("/usage", dependencies=[needs(Role.VIEW)], responses=LOOKS)
async def usage(request: Request) -> models.UsageFacts:
    """How much each tool has cut, how far each axis has gone, and what maintenance is due."""
    return await _asked(request, "usage")


@router.put("/usage/tools/{number}", dependencies=OPERATE, responses=MOVES)
async def tool_life(request: Request, number: ToolNumber, body: models.ToolLife) -> models.UsageFacts:
    """Limits of a tool; one that is worn starts no program unless that is confirmed."""
    return await _asked(request, "tool_life", tool=number, **body.model_dump())


@router.post("/usage/tools/{number}/renewed", dependencies=OPERATE, responses=MOVES)
async def tool_renewed(request: Request, number: ToolNumber) -> models.UsageFacts:
    """It has a new edge: counted from nothing."""
    return await _asked(request, "tool_renewed", tool=number)


@router.put("/usage/maintenance", dependencies=[needs(Role.SET_UP)], responses=MOVES)
async def maintenance(request: Request, body: models.Maintenance) -> models.UsageFacts:
    """Make a job of maintenance, give it another interval, or take it out."""
    return await _asked(request, "maintenance", **body.model_dump())


@router.post("/usage/maintenance/done", dependencies=OPERATE, responses=MOVES)
async def maintained(request: Request, body: models.Maintained) -> models.UsageFacts:
    """It was done just now."""
    who = await principal(request)
    return await _asked(request, "maintained", name=body.name, by=who.name)


async def _asked(request: Request, verb: str, **args: Any) -> models.UsageFacts:
    return models.UsageFacts(**await panel_of(request).door.ask(verb, **args))
