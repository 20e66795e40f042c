"""Lines that lead a mill down its axis which does not cut over its centre are told: their stock is not known.

What surfaces leave standing is known, and a plunge along it is refused (``verify.looks``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from controller.machine.kinematics import Kinematics
from controller.machine.model import TOOL_AT_POWER_ON, Machine, Tool
from controller.messages import said
from controller.plan.restart.program_position import BESIDE
from controller.plan.stretch import Chain, Note, Pause, Stretch


def noted(
    items: Iterable[Chain | Pause], machine: Machine, kinematics: Kinematics, note: Callable[[Note], None]
) -> Iterator[Chain | Pause]:
    """The path as it is; ``note`` is told of the first such line of each tool that is fed."""
    tool, told = machine.tool(TOOL_AT_POWER_ON), set[int]()
    for item in items:
        if isinstance(item, Pause):
            tool = item.modal.tool_in(machine)
        elif tool is not None and not tool.centre_cutting and tool.number not in told:
            down = next((one for one in item.stretches if _plunges(one, tool, kinematics)), None)
            if down is not None:
                told.add(tool.number)
                note(Note(down.place, said("note.plunge", tool=tool.number)))
        yield item


def _plunges(one: Stretch, tool: Tool, kinematics: Kinematics) -> bool:
    """Whether a motion at feed ends further down the tool axis than across it."""
    if one.feed_mm_s is None or one.cutting or one.name in BESIDE:
        return False
    start, end = (kinematics.forward(joints, tool.length_mm) for joints in (one.start, one.end))
    way, axis = np.subtract(end.tip, start.tip), np.array(start.axis)
    down = -float(way @ axis)
    return down > float(np.linalg.norm(way + down * axis))
