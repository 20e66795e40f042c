"""From anywhere to a place inside of a program: away from the part, over the place, down along the tool axis.

retract height   --------<------- position --------.      rotaries turn only here; spindle and
        ^                                          |      coolant start here
        | retract (along the tool axis first)      | down (rapid)
        |                                          + clearance above all that is cut up to there
        now                                        | plunge along the tool axis, at feed
                                                   * the place
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from controller.geometry.vectors import Vector, add, scale
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import said
from controller.plan.stretch import (
    Chain,
    Pause,
    Stretch,
    joints_of,
    motion_named,
    rotaries_of,
    straight,
    xyz_of,
)
from controller.plan.surfaces import audit
from controller.plan.surfaces.approach import at_height
from controller.program.program import UNSAID, Act, Modal, Place
from controller.values import dataclass

FAR_MM = 100.0  # along a tool axis that lies so flat that Z gains nothing
FLAT = 0.1  # of Z per mm along the axis
TURNING_MM_S = 5.0  # to a place where only the rotaries move, whose feed is in degrees


@dataclass(frozen=True, slots=True)
class Target:
    """The place that is to be entered."""

    joints: Joints
    modal: Modal  # the state in which it is
    place: Place
    feed_mm_s: float
    clear_mm: float  # along the tool axis, from where on the way is free


def along_axis(joints: Joints, by_mm: float, kinematics: Kinematics) -> Joints:
    """The joints with the tool ``by_mm`` further off along its own axis."""
    rotaries = rotaries_of(joints, kinematics)
    gauge, axis = kinematics.forward(joints, 0.0)
    tip: Vector = add(gauge, scale(axis, by_mm))
    return joints_of(kinematics.linear(tip, rotaries, 0.0), rotaries, kinematics)


def room_along_axis(joints: Joints, machine: Machine, kinematics: Kinematics) -> float:
    """How far (mm) the tool can go off along its own axis before an axis is at the end of its travel."""
    step = along_axis(joints, 1.0, kinematics)
    room = math.inf
    for axis, here, there in zip(machine.axes, joints, step, strict=True):
        rate = there - here
        if abs(rate) > 1e-12:
            room = min(room, ((axis.travel_max if rate > 0.0 else axis.travel_min) - here) / rate)
    return max(0.0, room)


def to_height(joints: Joints, height_mm: float, machine: Machine, kinematics: Kinematics) -> Joints:
    """Off along the tool axis until Z is at ``height_mm``, as far as the travel lets it."""
    z = xyz_of(joints, kinematics)[2]
    if z >= height_mm:
        return joints
    climb = xyz_of(along_axis(joints, 1.0, kinematics), kinematics)[2] - z
    way = (height_mm - z) / climb if climb > FLAT else FAR_MM
    return along_axis(joints, min(way, room_along_axis(joints, machine, kinematics)), kinematics)


def enter(
    target: Target, now: Joints, in_spindle: int, machine: Machine, kinematics: Kinematics, name: str
) -> list[Chain | Pause]:
    """The way from ``now`` to the target, with tool, spindle and coolant as they are there.

    ``in_spindle``: number of the tool that is in the spindle. Raises ProgramError where the way
    leaves an axis' travel.
    """
    if machine.changer is not None and target.modal.tool != in_spindle:
        sentence = said("tool.restart_other", found=in_spindle, wanted=target.modal.tool)
        raise target.place.refusal(name, sentence)
    room = room_along_axis(target.joints, machine, kinematics)
    clear = along_axis(target.joints, min(target.clear_mm, room), kinematics)
    off = to_height(now, machine.retract_mm, machine, kinematics)
    height = max(machine.retract_mm, *(xyz_of(q, kinematics)[2] for q in (clear, off)))
    up, over = at_height(off, height, kinematics), at_height(clear, height, kinematics)

    def move(name: str, start: Joints, end: Joints, feed_mm_s: float | None = None) -> Stretch | None:
        return straight(name, target.place, start, end, feed_mm_s, kinematics)

    before = [move("retract", now, off), move("retract", off, up), move("position", up, over)]
    after = [move("down", over, clear), move("plunge", clear, target.joints, target.feed_mm_s)]
    for stretch in (*before, *after):
        _audit(stretch, machine, name)
    items: list[Chain | Pause] = [Chain((stretch,)) for stretch in before if stretch is not None]
    items += _settings(target, in_spindle)
    return items + [Chain((stretch,)) for stretch in after if stretch is not None]


def _settings(target: Target, in_spindle: int) -> Iterator[Pause]:
    """Another tool is changed by hand at a stop; then spindle, coolant and outputs."""
    modal, still = target.modal, replace(target.modal, spindle_rev_min=0.0, coolant=0)
    if modal.tool != in_spindle:
        yield Pause(target.place, still, act=Act.TOOL)
        yield Pause(target.place, still, act=Act.STOP)
    if modal.spindle_rev_min or modal.coolant:
        yield Pause(target.place, modal, act=Act.SPINDLE)
    if modal.outputs != UNSAID:
        yield Pause(target.place, modal, act=Act.OUTPUT)


def _audit(stretch: Stretch | None, machine: Machine, name: str) -> None:
    excess = audit.outside_at(machine, stretch.end) if stretch is not None else None
    if stretch is not None and excess is not None:
        where = said("travel.in_entry", motion=motion_named(stretch.name))
        sentence = audit.describe(machine.axes[excess.axis], excess, where)
        raise stretch.place.refusal(name, sentence)


def highest(tops: Sequence[Vector], joints: Joints, length_mm: float, kinematics: Kinematics) -> float:
    """How far (mm) the highest of some points of the table frame is above the tip, along the tool axis."""
    tip, axis = kinematics.forward(joints, length_mm)
    return max(
        (sum((p - q) * a for p, q, a in zip(top, tip, axis, strict=True)) for top in tops), default=0.0
    )
