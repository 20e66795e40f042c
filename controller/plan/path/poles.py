"""Where the contact stands in a wall while a rotary turns at a pole, and which tilt of the part mends that.

At a pole the tool axis is that of the work's rotary. Where the axis comes in from one side and leaves to
another, the rotary turns by the angle between them under the standing tool, whatever the path mode. With the
part tilted so that the axis passes the pole at a distance d, it turns while the contact goes on: where the
axis turns by w (rad/s), the rotary's angle is atan(w t / d), of which rate, acceleration and jerk are at most
w / d, 0.65 (w / d)^2 and 2 (w / d)^3.
"""

from __future__ import annotations

import math

from controller.geometry.vectors import Vector, cross, norm, scale, subtract, unit
from controller.machine.model import Machine
from controller.messages import Message, message
from controller.plan.segment import Segment
from controller.plan.surfaces.legs import CutSegment

MAX_ACCELERATION, MAX_JERK = 3.0 * math.sqrt(3.0) / 8.0, 2.0  # of atan(x), per x' squared and cubed
STEP = 1e-3  # of a cut's length, over which its axis is looked at
MIN_TURN = 1e-6  # of the axis, rad/mm


def standing(swivel: Segment, before: CutSegment, after: CutSegment, machine: Machine) -> Message:
    """The note of a turn at a pole between two cuts: place, rotary, angle, time, and the tilt."""
    turns = [abs(b - a) for a, b in zip(swivel.start, swivel.end, strict=True)]
    k = max(machine.rotary(), key=lambda i: turns[i])
    limits = machine.axes[k].limits
    seconds = max(
        turns[k] / limits.velocity,
        2.0 * math.sqrt(turns[k] / limits.acceleration),
        (32.0 * turns[k] / limits.jerk) ** (1.0 / 3.0),
    )
    x, y, z = after.cut.start.contact
    facts = {"x": x, "y": y, "z": z, "axis": machine.axes[k].name, "degrees": math.degrees(turns[k])}
    stands = message("note.swivel", **facts, seconds=seconds)
    tilt = _tilt(before, after, limits.velocity, limits.acceleration, limits.jerk)
    if tilt is None:
        return stands
    about = [math.degrees(one) for one in tilt]
    turned = ", ".join(f"{one:.1f}" for one in about)
    return message("note.swivel_tilt", stands=stands, degrees=math.degrees(norm(tilt)), tilt=turned)


def _tilt(
    before: CutSegment, after: CutSegment, velocity: float, acceleration: float, jerk: float
) -> Vector | None:
    """The rotation vector (rad, table frame) with which the rotary keeps its limits; None: there is none."""
    into, out = _turning(before, at_end=True), _turning(after, at_end=False)
    if norm(into) < MIN_TURN or norm(out) < MIN_TURN:
        return None
    inside = subtract(unit(out), unit(into))  # between the two sides on which the axis comes and leaves
    feed = before.cut.block.feed_mm_s
    if norm(inside) < STEP or feed is None:
        return None
    rate = feed * max(norm(into), norm(out))
    least = max(1.0 / velocity, math.sqrt(MAX_ACCELERATION / acceleration), (MAX_JERK / jerk) ** (1.0 / 3.0))
    motion = after.cut.motion
    pole = motion.part.turn(motion.pose(0.0).axis)
    return scale(cross(pole, unit(inside)), rate * least)


def _turning(leg: CutSegment, at_end: bool) -> Vector:
    """How the axis turns where a cut ends or begins, rad per mm of the contact, in the table frame."""
    motion = leg.cut.motion
    h = STEP * motion.end
    a, b = (motion.end - h, motion.end) if at_end else (0.0, h)
    change = subtract(motion.pose(b).axis, motion.pose(a).axis)
    return scale(motion.part.turn(change), 1.0 / h)
