"""The touches of a run as a table: where the axes were at each edge, with which probe, in which direction."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

from controller.machine.model import Machine
from controller.plan.planner import Touch

Row = list[str | int | float]


def rows(touches: Sequence[Touch], machine: Machine) -> Iterator[Row]:
    """A head, and a row for each touch: axes in mm and degrees as shown, the rest in mm."""
    names = [axis.name for axis in machine.axes]
    yield ["line", "touched", *names, "i", "j", "k", "feed_mm_min", "tool", "length_mm", "radius_mm"]
    for touch in touches:
        tool = machine.tool(touch.tool)
        size = (0.0, 0.0)
        if tool is not None:  # as it is led: to the centre of its ball, and the ball as it touches
            radius_mm = tool.radius_mm + tool.wear_radius_mm
            size = (tool.length_mm + tool.wear_length_mm - radius_mm, radius_mm)
        at = [round(q, 6) for q in machine.shown(touch.came.at)]
        ways = [round(d, 9) for d in touch.direction]
        feed_mm_min = round(60.0 * touch.feed_mm_s, 3)
        yield [touch.line, int(touch.came.touched), *at, *ways, feed_mm_min, touch.tool, *size]


def text(touches: Sequence[Touch], machine: Machine) -> str:
    """The table as CSV, which ``calibration.touch_table`` reads."""
    made = io.StringIO()
    csv.writer(made).writerows(rows(touches, machine))
    return made.getvalue()


def write(path: Path, touches: Sequence[Touch], machine: Machine) -> None:
    """The same as a file. Raises OSError."""
    path.write_text(text(touches, machine), encoding="utf-8", newline="")
