"""The tool changer: where its tools are, and what an operator confirms of them."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Request
from pydantic import Field

from controller.api import models
from controller.api.access import moves, needs, panel_of
from controller.api.roles import Role
from controller.api.routes.machine import LOOKS, MOVES, ask

router = APIRouter(tags=["tool changer"])
Number = Annotated[int, Field(ge=0, le=99999)]


class ToolPlaces(models.Sent):
    """Every tool that is not named is in its pocket."""

    spindle: Annotated[int, Field(ge=0, le=99999, description="The tool in it, 0 = it is empty.")]
    away: Annotated[
        list[Number], Field(default_factory=list, max_length=999, description="Out of the machine.")
    ]
    clear: Annotated[bool, Field(description="You have looked, and nothing of it touches the spindle.")] = (
        False
    )


class Pocket(models.Sent):
    tool: Annotated[int, Field(ge=0, le=99999, description="Whose it is, 0 = nobody's.")]


@router.get("/changer", dependencies=[needs(Role.VIEW)], responses=LOOKS)
async def changer(request: Request) -> models.Told:
    """Spindle, pockets, the step under way, what must be confirmed, and the last steps."""
    facts: dict[str, Any] = await panel_of(request).door.ask("changer")
    return models.Told(**facts)


@router.post("/changer/confirm", dependencies=[moves()], responses=MOVES)
async def confirm(request: Request, body: ToolPlaces) -> models.Done:
    """Where every tool is, as you see it: after a change that was interrupted nothing moves before."""
    return await ask(request, "changer_confirm", **body.model_dump())


@router.put("/changer/pockets/{number}", dependencies=[moves()], responses=MOVES)
async def pocket(request: Request, number: Annotated[int, Path(ge=1, le=999)], body: Pocket) -> models.Done:
    """Give a pocket to a tool; where all tools are must be confirmed then."""
    return await ask(request, "changer_pocket", pocket=number, tool=body.tool)
