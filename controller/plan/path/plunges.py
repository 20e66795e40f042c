"""Lines that lead a mill down its axis which does not cut over its centre are told: their stock is not known.

What surfaces leave standing is known, and a plunge along it is refused (``verify.looks``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from controller.geometry.arrays import columns
from controller.geometry.vectors import ROUNDING
from controller.machine.kinematics import Kinematics
from controller.machine.model import TOOL_AT_POWER_ON, Machine, Tool
from controller.messages import message
from controller.motion.motions import ToolSpline
from controller.plan.rotaries.branch import joints_along
from controller.plan.stretch import Chain, Note, Pause, Stretch
from controller.program.program import Place

OF_PROGRAM = ("line", "arc", "curve")  # names of motions that a program writes itself
POSES, MAX_POSES = 9, 4000  # that are looked at: for each line of a motion, and of all


def noted(
    items: Iterable[Chain | Pause], machine: Machine, kinematics: Kinematics, note: Callable[[Note], None]
) -> Iterator[Chain | Pause]:
    """The path as it is; ``note`` is told of the first such line of each tool that is fed."""
    tool, told = machine.tool(TOOL_AT_POWER_ON), set[int]()
    for item in items:
        if isinstance(item, Pause):
            tool = item.modal.tool_in(machine)
        elif tool is not None and not tool.centre_cutting and tool.number not in told:
            places = (_plunge(one, tool, kinematics) for one in item.stretches)
            place = next((one for one in places if one is not None), None)
            if place is not None:
                told.add(tool.number)
                note(Note(place, message("note.plunge", tool=tool.number)))
        yield item


def _plunge(one: Stretch, tool: Tool, kinematics: Kinematics) -> Place | None:
    """The line of a motion at feed that leads down the tool axis more than across it; None: none does."""
    if one.feed_mm_s is None or one.cutting or one.name not in OF_PROGRAM:
        return None
    motion = one.motion
    lines = len(motion.lines) if isinstance(motion, ToolSpline) else 1
    s = np.linspace(0.0, motion.end, min(POSES * lines, MAX_POSES))
    pose = kinematics.forward(tuple(joints_along(one, s, kinematics).T), tool.length_mm, np)
    way, axis = np.diff(columns(pose.tip, len(s)), axis=0), columns(pose.axis, len(s))[:-1]
    down = -(way * axis).sum(axis=1)
    more = down - np.linalg.norm(way + down[:, None] * axis, axis=1)
    k = int(np.argmax(more))
    if more[k] <= ROUNDING:
        return None
    line = motion.line_at(float(s[k])) if isinstance(motion, ToolSpline) else one.place.line
    return one.place if line == one.place.line else Place(line, 1)
