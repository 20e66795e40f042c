"""What is answered to those who look closely: scope, buses, machine file, the path as a picture."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from controller.api.models import Number, Told


class TickSpan(Told):
    """Which ticks there are."""

    period_s: float
    oldest: int | None
    newest: int | None


class SignalList(TickSpan):
    signals: dict[str, str] = Field(description="Name to unit.")


class TriggerFacts(TickSpan):
    tick: int | None = Field(description="At which it fired; null: not yet.")


class TickWindow(TickSpan):
    """Columns of equally many ticks."""

    ticks: list[int] = Field(description="The first of each column.")
    per_column: int
    low: dict[str, list[Number]] = Field(description="By signal; with one tick a column, its value.")
    high: dict[str, list[Number]] = Field(description="Empty with one tick a column.")


class BusList(Told):
    """Buses as budgeted and as heard, and how late the ticks came."""

    buses: list[dict[str, Any]]
    max_share: Number = Field(None, description="That a bus may be full by its budget.")
    near_share: Number = Field(None, description="From here on it is nearly that full.")
    lateness: dict[str, Any] | None = None


class FileRow(Told):
    """One value of the machine file."""

    table: str
    key: str
    value: str
    line: int
    comment: str


class MachineFile(Told):
    name: str
    rows: list[FileRow]
    text: str


class PathPicture(Told):
    """A program's path and surfaces in the table's frame, thinned to what can be drawn."""

    tips: list[list[float]] = Field(description="Points of the tool's tip (mm), in the order of the path.")
    axes: list[list[float]] = Field(description="Axis of the tool at each point, a unit vector.")
    kinds: list[int] = Field(description="Of the way to each point: 0 rapid, 1 feed, 2 on a surface.")
    motions: list[int] = Field(description="Number of each point's motion, as the status tells it.")
    lines: list[int] = Field(description="Line of the program of each point.")
    rulings: list[list[float]] = Field(description="Upper and lower end of a ruling: six numbers (mm).")
    surfaces: list[int] = Field(description="Rulings of each surface, in their order.")
    tolerance_mm: float = Field(description="No point that was left out is further from the lines than this.")


class RunSums(Told):
    """All runs together."""

    runs: int
    failed: int = Field(description="Ended neither by themselves nor by an operator.")
    results: dict[str, int] = Field(description="How many, by their result.")
    duration_s: float
    cut_time_s: float
