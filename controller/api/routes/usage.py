"""Tool life and maintenance: counted by the service, also while nobody looks."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import Request
from pydantic import Field

from controller.api.access import panel_of, principal
from controller.api.models import Number, Sent, Told
from controller.api.router import LOOKS, MOVES, OPERATE, SET_UP, VIEW, Router
from controller.api.routes.tables import ToolNumber

ItemName = Annotated[str, Field(min_length=1, max_length=60)]


class ToolLife(Sent):
    """What is null has no limit."""

    cut_min: Annotated[float | None, Field(ge=0.1, le=1e6, description="Minutes of cutting.")] = None
    cut_m: Annotated[float | None, Field(ge=0.1, le=1e6, description="Metres of cutting.")] = None
    parts: Annotated[int | None, Field(ge=1, le=1_000_000)] = None
    sister: Annotated[
        int | None, Field(ge=1, le=99999, description="What comes in its place at M6 once it is worn.")
    ] = None


class Maintenance(Sent):
    name: ItemName
    counter: Annotated[str, Field(max_length=40, description="An axis, motion or spindle.")] = ""
    every: Annotated[
        float | None,
        Field(ge=0.001, le=1e9, description="In the counter's unit; null: no such job any more."),
    ] = None


class Maintained(Sent):
    name: ItemName


class ToolUse(Told):
    number: int
    cut_s: float
    cut_m: float = Field(description="Along the path, at feed.")
    parts: int = Field(description="Programs that ran whole and in which it cut.")
    since_s: Number = Field(description="When it was new, seconds since 1970; null: since it is counted.")
    most_cut_min: Number
    most_cut_m: Number
    most_parts: int | None
    sister: int | None
    worn: bool


class Counter(Told):
    name: str
    value: float
    unit: Literal["m", "turns", "h"]


class Item(Told):
    """A job of maintenance."""

    name: str
    counter: str
    every: float
    used: float = Field(description="Of it, since it was done last.")
    unit: str
    done_s: Number
    done_by: str
    due: bool


class UsageFacts(Told):
    tools: list[ToolUse]
    counters: list[Counter] = Field(description="Of each axis how far it went; motion and spindle: hours.")
    items: list[Item]


router = Router(tags=["tool life and maintenance"])
OF_TOOL = (*MOVES, 404)


@router.get("/usage", VIEW, *LOOKS)
async def usage(request: Request) -> UsageFacts:
    """How much each tool has cut, how far each axis has gone, and what maintenance is due."""
    return await _usage_facts(request, "usage")


@router.put("/usage/tools/{number}", OPERATE, *OF_TOOL)
async def tool_life(request: Request, number: ToolNumber, body: ToolLife) -> UsageFacts:
    """Limits of a tool; one that is worn starts no program unless that is confirmed."""
    return await _usage_facts(request, "tool_life", tool=number, **body.model_dump())


@router.post("/usage/tools/{number}/renewed", OPERATE, *OF_TOOL)
async def tool_renewed(request: Request, number: ToolNumber) -> UsageFacts:
    """It has a new edge: counted from nothing."""
    return await _usage_facts(request, "tool_renewed", tool=number)


@router.put("/usage/maintenance", SET_UP, *MOVES)
async def maintenance(request: Request, body: Maintenance) -> UsageFacts:
    """Make a job of maintenance, give it another interval, or take it out."""
    return await _usage_facts(request, "maintenance", **body.model_dump())


@router.post("/usage/maintenance/done", OPERATE, *MOVES)
async def maintained(request: Request, body: Maintained) -> UsageFacts:
    """It was done just now."""
    who = await principal(request)
    return await _usage_facts(request, "maintained", name=body.name, by=who.name)


async def _usage_facts(request: Request, verb: str, **args: Any) -> UsageFacts:
    return UsageFacts(**await panel_of(request).door.ask(verb, **args))
