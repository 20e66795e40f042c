"""The figures of a position, each defined once: from joints and the way in which a program reads its words.

- machine: the joints as programs write them, in mm and degrees of the configured sense;
- actual: the same of where the drives say that they are;
- work: what the words X Y Z A B C of the program are, here, in the state that is in force: under its offset,
  shifts and turns. X Y Z are positions of the axes less the length that G43 adds to Z; in a tilted plane and
  under tip control they are the place of the tip in the part, which turns with the table;
- distance to go: what the end of the motion reads in work figures there, less what is read now;
- tip: that of the tool in the spindle, whatever length is in force, in the part frame that is.

Status, REST, command line, page and picture show these and no others, and touching off sets the same. Joints
are in the machine's order, mm and rad (carried sense).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from controller.geometry.vectors import Frame, Pose, Vector, Z
from controller.machine.kinematics import Kinematics
from controller.machine.model import STILL, Joints, Machine, Offset, Pair

Figures = tuple[float, ...]  # of the axes in the machine's order, mm and degrees as shown
ALONG = 0.1  # cosine of the angle to the tool below which a letter says nothing of its length


class Reading(NamedTuple):
    """How the words of a program are read."""

    frame: Frame  # of its positions, seen from the table with its rotaries at zero
    length_mm: float = 0.0  # of the tool that is in force, 0 under G49
    of_tip: bool = False  # X Y Z are a place of the tip: in a tilted plane, and under tip control
    turned_rad: Pair = STILL  # what the words of the rotaries are shifted by (carried sense)


def work(machine: Machine, kinematics: Kinematics, joints: Joints, reading: Reading) -> Figures:
    """What the words of a program are that lead to these joints."""
    place = _point(kinematics, joints, reading, machine)
    figures = list(machine.shown(joints))
    for i, value in zip(machine.linear(), reading.frame.from_parent(place), strict=True):
        figures[i] = float(value)
    for i, turned in zip(machine.rotary(), reading.turned_rad, strict=False):
        figures[i] -= turned * machine.axes[i].shown_per_unit
    return tuple(figures)


def _point(kinematics: Kinematics, joints: Joints, reading: Reading, machine: Machine) -> Vector:
    """What X Y Z are places of, in the parent of the reading's frame."""
    if reading.of_tip:
        return kinematics.forward(joints, reading.length_mm).tip
    x, y, z = (joints[i] for i in machine.linear())
    return x, y, z - reading.length_mm


def to_go(now: Figures, end: Figures) -> Figures:
    """Of work figures: with what is read now it makes what is read at the end."""
    return tuple([b - a for a, b in zip(now, end, strict=True)])


def tip(kinematics: Kinematics, joints: Joints, length_mm: float, frame: Frame) -> Pose:
    """Tip (mm) and axis (unit vector, towards the spindle) of a tool so long, in a frame of the table."""
    found = kinematics.forward(joints, length_mm)
    return Pose(frame.from_parent(found.tip), frame.turn_back(found.axis))


# ---- touching off: what must be set for the figures to read as wanted


def offset_for(
    machine: Machine, now: Figures, reading: Reading, offset: Offset, wanted: Mapping[str, float]
) -> Offset:
    """The work offset with which the axes of ``wanted`` read so, and all others as ``now``.

    ``reading`` and ``now`` are under ``offset``. Whatever shifts and turns inside of it stays as it is, so
    the origin moves by what the figures change, along the axes that the figures count along.
    """
    less = {axis.name: b - wanted.get(axis.name, b) for axis, b in zip(machine.axes, now, strict=True)}
    by = reading.frame.turn((less["X"], less["Y"], less["Z"]))
    x, y, z = (o + float(d) for o, d in zip(offset.frame.origin, by, strict=True))
    turned = list(offset.turned_rad)
    for k, i in enumerate(machine.rotary()[: len(turned)]):
        turned[k] += less[machine.axes[i].name] / machine.axes[i].shown_per_unit
    return Offset(offset.frame._replace(origin=(x, y, z)), (turned[0], turned[1]))


def length_for(
    kinematics: Kinematics, joints: Joints, reading: Reading, letter: str, less_mm: float
) -> float | None:
    """The length of the tool with which X, Y or Z reads ``less_mm`` less than under ``reading``.

    None where that letter lies across the tool, so that no length changes it.
    """
    up = kinematics.forward(joints, reading.length_mm).axis if reading.of_tip else Z
    along = reading.frame.turn_back(up)["XYZ".index(letter)]
    return None if abs(along) < ALONG else reading.length_mm + less_mm / float(along)
