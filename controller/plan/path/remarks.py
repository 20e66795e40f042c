"""What a check remarks of a sound path: each reads it, hands it on, and notes what somebody should know."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from controller.geometry.arrays import columns
from controller.geometry.vectors import ROUNDING
from controller.machine.kinematics import Kinematics
from controller.machine.model import TOOL_AT_POWER_ON, Joints, Machine, Tool
from controller.messages import message
from controller.motion.motions import ThreadMove
from controller.plan.rotaries.branch import joints_along
from controller.plan.rotaries.turns import SAME_ROTARY_RAD
from controller.plan.segment import ContinuousPath, Note, PathItem, Pause, Segment
from controller.program.program import Place

OF_PROGRAM = ("line", "arc", "curve")  # names of motions that a program writes itself
POSES, MAX_POSES = 9, 4000  # that are looked at: for each line of a motion, and of all


def plunges(
    items: Iterable[PathItem], machine: Machine, kinematics: Kinematics, note: Callable[[Note], None]
) -> Iterator[PathItem]:
    """Notes of each tool that does not cut over its centre the first line at feed which leads it down its
    axis.

    The stock of lines is not known; what surfaces leave is, and a plunge along it is refused
    (``verify.looks``).
    """
    tool, told = machine.tool(TOOL_AT_POWER_ON), set[int]()
    for item in items:
        if isinstance(item, Pause):
            tool = item.modal.tool_in(machine)
        elif tool is not None and not tool.centre_cutting and tool.number not in told:
            places = (_plunge(one, tool, kinematics) for one in item.segments)
            place = next((one for one in places if one is not None), None)
            if place is not None:
                told.add(tool.number)
                note(Note(place, message("note.plunge", tool=tool.number)))
        yield item


def _plunge(one: Segment, tool: Tool, kinematics: Kinematics) -> Place | None:
    """The line of a motion at feed that leads down the tool axis more than across it; None: none does."""
    if one.feed_mm_s is None or one.cutting or one.name not in OF_PROGRAM:
        return None
    s = np.linspace(0.0, one.motion.end, min(POSES * len(one.lines), MAX_POSES))
    pose = kinematics.forward(tuple(joints_along(one, s, kinematics).T), tool.length_mm, np)
    way, axis = np.diff(columns(pose.tip, len(s)), axis=0), columns(pose.axis, len(s))[:-1]
    down = -(way * axis).sum(axis=1)
    more = down - np.linalg.norm(way + down[:, None] * axis, axis=1)
    k = int(np.argmax(more))
    if more[k] <= ROUNDING:
        return None
    line = one.line_at(float(s[k]))
    return one.place if line == one.place.line else Place(line, 1)


def standing_spindle(
    items: Iterable[PathItem], machine: Machine, note: Callable[[Note], None]
) -> Iterator[PathItem]:
    """Notes the first feed move before the spindle ever turns.

    Surfaces are refused without it. Where no spindle is, and where the operator switches it as he likes,
    nothing is told.
    """
    waits = machine.spindle is not None and machine.spindle.is_driven
    for item in items:
        if waits and isinstance(item, Pause):
            waits = item.modal.spindle_rev_min == 0.0
        elif waits and (place := _fed(item)) is not None:
            note(Note(place, message("note.spindle_off")))
            waits = False
        yield item


def _fed(item: PathItem) -> Place | None:
    """Where a chain first moves at a feed."""
    fed = (
        one for one in item.segments if one.feed_mm_s is not None and not isinstance(one.motion, ThreadMove)
    )
    return next((one.place for one in fed), None)


def changed_rotaries(
    items: Iterable[PathItem], machine: Machine, start: Joints, note: Callable[[Note], None]
) -> Iterator[PathItem]:
    """Notes each tool change that ends with a rotary elsewhere: M6 names no axis, and the tool may be askew.

    The places are those of the changer's steps in the machine file (``move_deg`` of ``[changer]``); a change
    by hand, or one whose steps name no rotary, leaves them where they are.
    """
    before = now = start
    for item in items:
        if isinstance(item, ContinuousPath):
            now = item.segments[-1].end
        elif item.changing is not None:
            before = now if item.changing.step == 0 else before
            if item.changing.last and (turned := _turned(machine, before, now)):
                key = "note.change_leaves_plane" if item.modal.tilted else "note.change_turns"
                note(Note(item.place, message(key, axes=", ".join(turned))))
        yield item


def _turned(machine: Machine, before: Joints, now: Joints) -> list[str]:
    """The rotaries that are elsewhere, each with its place before and after, in degrees as programmed."""
    found = []
    for i in machine.rotary():
        axis = machine.axes[i]
        if abs(now[i] - before[i]) > SAME_ROTARY_RAD:
            places = (f"{joints[i] * axis.shown_per_unit:.6g}" for joints in (before, now))
            found.append(f"{axis.name} {' -> '.join(places)}")
    return found
