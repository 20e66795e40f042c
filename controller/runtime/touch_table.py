"""The touches of a run as a table: where the axes were at each edge, with which probe, in which direction."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from controller.machine.model import Machine
from controller.plan.planner import Touch

Row = list[str | int | float]


def rows(touches: Sequence[Touch], machine: Machine) -> Iterator[Row]:
    """A head, and a row for each touch: axes in mm and degrees as shown, the rest in mm."""
    names = [axis.name for axis in machine.axes]
    yield [
        "line",
        "touched",
        *names,
        "direction_x",
        "direction_y",
        "direction_z",
        "tool",
        "length_mm",
        "radius_mm",
    ]
    for touch in touches:
        tool = machine.tool(touch.tool)
        size = (tool.length_mm, tool.radius_mm) if tool is not None else (0.0, 0.0)
        at = [round(q, 6) for q in machine.shown(touch.came.at)]
        ways = [round(d, 9) for d in touch.direction]
        yield [touch.line, int(touch.came.touched), *at, *ways, touch.tool, *size]


def write(path: Path, touches: Sequence[Touch], machine: Machine) -> None:
    """The table as a CSV file. Raises OSError."""
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows(touches, machine))
