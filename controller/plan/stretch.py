"""What ``path.trace`` returns: chains of stretches, pauses between them, and notes.

A stretch is one motion with its feed. A chain runs through without a planned stop
and begins and ends at rest; everything else that a program asks for happens at
rest, in a pause.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from controller.curves import Arc, Line
from controller.geometry import Vector, norm, subtract
from controller.kinematics import Kinematics
from controller.machine import Joints
from controller.motions import JointMove, Motion, Rotaries
from controller.plan.program import Act, Modal, Place, ProgramError

STILL_MM = 1e-9  # moves below (also in degrees) are no moves


@dataclass(frozen=True, slots=True)
class Stretch:
    """One motion of a block, with its feed and the joints at both ends."""

    motion: Motion
    place: Place
    feed_mm_s: float | None  # in the unit of the motion's s per second; None = rapid
    cutting: bool  # the cutter follows a surface
    start: Joints
    end: Joints
    exact: bool  # G61
    name: str  # 'retract', 'position', 'down', 'plunge', 'lead in', 'cut', 'pivot', 'swivel', ...


@dataclass(frozen=True, slots=True)
class Chain:
    """Stretches run through without a planned stop; at rest before and after."""

    stretches: tuple[Stretch, ...]


@dataclass(frozen=True, slots=True)
class Pause:
    """Standstill: a dwell of ``seconds``, or a machine function with the modal state after it."""

    place: Place
    modal: Modal
    seconds: float = 0.0
    act: Act | None = None


@dataclass(frozen=True, slots=True)
class Note:
    """A decision or a warning that ``check`` shows."""

    place: Place
    sentence: str


@dataclass(frozen=True, slots=True)
class Path:
    """A whole program as motion; ``end`` are the joints where it leaves the machine."""

    items: tuple[Chain | Pause, ...]
    notes: tuple[Note, ...]
    end: Joints


Tell = Callable[[Place, str], None]


@dataclass(frozen=True, slots=True)
class Voice:
    """How the parts of the trace speak: refuse a block, or note something about it."""

    program: str
    tell: Tell

    def refuse(self, place: Place, sentence: str) -> NoReturn:
        raise ProgramError(self.program, place.line, place.column, sentence)


def rotaries_of(joints: Joints, kinematics: Kinematics) -> Rotaries:
    """The two rotary positions out of five joints."""
    return joints[kinematics.order.index(3)], joints[kinematics.order.index(4)]


def xyz_of(joints: Joints, kinematics: Kinematics) -> Vector:
    """X, Y and Z out of five joints."""
    order = kinematics.order
    return joints[order.index(0)], joints[order.index(1)], joints[order.index(2)]


def joints_of(xyz: Vector, rotaries: Rotaries, kinematics: Kinematics) -> Joints:
    """Five joints in the machine's order."""
    values = (*xyz, *rotaries)
    a, b, c, d, e = (float(values[i]) for i in kinematics.order)
    return (a, b, c, d, e)


def straight(
    name: str, place: Place, start: Joints, end: Joints, feed_mm_s: float | None, kinematics: Kinematics
) -> Stretch | None:
    """A line of joint space; None where nothing moves.

    s is in millimetres of X Y Z; where only rotaries move, in degrees (RS-274: F is
    then degrees per minute).
    """
    a, b = xyz_of(start, kinematics), xyz_of(end, kinematics)
    first, last = rotaries_of(start, kinematics), rotaries_of(end, kinematics)
    length = norm(subtract(b, a))
    if length < 1e-6:
        turned = math.degrees(math.hypot(last[0] - first[0], last[1] - first[1]))
        length = max(length, turned)
    if length < STILL_MM:
        return None
    move = JointMove(Line(a, b), length, first, last, kinematics.order)
    return Stretch(move, place, feed_mm_s, False, start, end, True, name)


def round_arc(
    name: str,
    place: Place,
    start: Joints,
    end: Joints,
    arc: Arc,
    feed_mm_s: float | None,
    kinematics: Kinematics,
) -> Stretch:
    """An arc or helix of X Y Z between two joint positions, rotaries turning evenly."""
    length = math.hypot(norm(arc.first) * arc.sweep_rad, norm(arc.rise))
    first, last = rotaries_of(start, kinematics), rotaries_of(end, kinematics)
    move = JointMove(arc, length, first, last, kinematics.order)
    return Stretch(move, place, feed_mm_s, False, start, end, True, name)
