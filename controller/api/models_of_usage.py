"""What is sent and answered about tool life and maintenance."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from controller.api.models import Number, Sent, Told

ItemName = Annotated[str, Field(min_length=1, max_length=60)]


class ToolLife(Sent):
    """What is null has no limit."""

    cut_min: Annotated[float | None, Field(ge=0.1, le=1e6, description="Minutes of cutting.")] = None
    parts: Annotated[int | None, Field(ge=1, le=1_000_000)] = None


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
    parts: int = Field(description="Programs that ran whole and in which it cut.")
    since_s: Number = Field(description="When it was new, seconds since 1970; null: since it is counted.")
    most_cut_min: Number
    most_parts: int | None
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
