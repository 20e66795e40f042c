"""To a train of cuts and away from it: retract, position, plunge, leads; and the pivots inside.

        retract height  ----------<----- position ------.      rotaries turn only here
                                                        |  down (rapid)
        clearance height  . . . . . . . . . . . . . . . +
                                                        |  plunge along the tool axis, at feed
        C1   ==================>=====.                  |
             cut                      `--- lead in -----'      see ``leads``

While the tool axis stands, X Y Z are a rigid image of the table frame: what is an arc
about the part there is an arc of X Y Z, and ``_Stand`` draws it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.curves import Arc
from controller.geometry.vectors import Vector, cross, dot, norm, scale, subtract
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints
from controller.motion.motions import Rotaries, SurfaceCut
from controller.plan.context import Context
from controller.plan.rotaries.branch import field, joints_on
from controller.plan.rotaries.turns import SAME_ROTARY_RAD
from controller.plan.segment import (
    ContinuousPath,
    Segment,
    joints_of,
    rotaries_of,
    round_arc,
    straight,
    xyz_of,
)
from controller.plan.surfaces import audit
from controller.plan.surfaces.cuts import Edge, beside, turn
from controller.plan.surfaces.leads import Lead
from controller.plan.surfaces.legs import CutSegment
from controller.plan.surfaces.train import Meeting
from controller.program.program import Place

QUARTER = math.pi / 2.0


@dataclass(frozen=True, slots=True)
class _Stand:
    """A standing tool axis: tips of the table frame to joints, with the rotaries held."""

    rotaries: Rotaries
    length_mm: float
    place: Place
    feed_mm_s: float
    kinematics: Kinematics

    @staticmethod
    def at(leg: CutSegment, rotaries: Rotaries, kinematics: Kinematics) -> _Stand:
        block = leg.cut.block
        return _Stand(rotaries, leg.cut.motion.length_mm, block.place, block.feed_mm_s, kinematics)

    def xyz(self, tip: Vector) -> Vector:
        return self.kinematics.linear(tip, self.rotaries, self.length_mm)

    def joints(self, tip: Vector) -> Joints:
        return joints_of(self.xyz(tip), self.rotaries, self.kinematics)

    def line(self, name: str, start: Vector, end: Vector, feed_mm_s: float | None) -> Segment | None:
        return straight(name, self.place, self.joints(start), self.joints(end), feed_mm_s, self.kinematics)

    def arc(self, name: str, centre: Vector, start: Vector, end: Vector, sweep_rad: float) -> Segment:
        """The arc about ``centre`` from one tip to another (table frame), at feed."""
        first, last = subtract(start, centre), subtract(end, centre)
        # What of the end is across the start: the radius vector a quarter turn ahead.
        ahead = subtract(last, scale(first, math.cos(sweep_rad)))
        second = beside(centre, (ahead, norm(first) / norm(ahead)))
        middle = self.xyz(centre)
        arc = Arc(middle, subtract(self.xyz(start), middle), subtract(self.xyz(second), middle), sweep_rad)
        a, b = self.joints(start), self.joints(end)
        return round_arc(name, self.place, a, b, arc, self.feed_mm_s, self.kinematics)


# ---- from the retract height to the lead and back --------------------------------


def above(stand: _Stand, lead: Lead, legs: Sequence[CutSegment], context: Context) -> Vector:
    """The tip on the tool-axis line through a lead's outer end that is clear of the train's highest point.

    Highest is meant as the machine stands: along Z with the rotaries of that end. A
    tilted head climbs along its own axis until the lower edge of its end face is
    clearance_mm above, or, where that is nearer (a head near the horizontal), until
    the whole block lies behind its end face.
    """
    tip, axis, radius = lead.tip, lead.axis, legs[0].cut.tool.radius_mm
    points = audit.surface_points([other.cut for other in legs])
    x, y, z = points
    heights = context.kinematics.linear((x, y, z), stand.rotaries, stand.length_mm, np)[2]
    base = stand.xyz(tip)
    climb = stand.xyz(beside(tip, (axis, 1.0)))[2] - base[2]  # of Z per mm along the axis
    climb = min(1.0, climb)
    behind = float((np.array(axis) @ points).max()) - dot(axis, tip) + context.machine.clearance_mm
    if climb < 1e-3:
        return beside(tip, (axis, max(0.0, behind)))
    dip = radius * math.sqrt(max(0.0, 1.0 - climb * climb)) if climb < 1.0 - 1e-12 else 0.0
    over = (float(np.max(heights)) + context.machine.clearance_mm + dip - base[2]) / climb
    return beside(tip, (axis, max(0.0, min(over, behind))))


def arrive(legs: Sequence[CutSegment], onto: Lead, now: Joints, context: Context) -> list[ContinuousPath]:
    """Chains from ``now`` to the start of the lead in."""
    leg = legs[0]
    stand = _Stand.at(leg, onto.rotaries, context.kinematics)
    clear = above(stand, onto, legs, context)
    target = stand.joints(clear)
    _, _, z = xyz_of(now, context.kinematics)
    height = max(context.machine.retract_mm, xyz_of(target, context.kinematics)[2], z)
    place = leg.cut.block.place
    up, over = at_height(now, height, context.kinematics), at_height(target, height, context.kinematics)
    return chains(
        straight("retract", place, now, up, None, context.kinematics),
        straight("position", place, up, over, None, context.kinematics),
        straight("down", place, over, target, None, context.kinematics),
        stand.line("plunge", clear, onto.tip, stand.feed_mm_s),
    )


def depart(legs: Sequence[CutSegment], off: Lead, context: Context) -> list[ContinuousPath]:
    """Chains from the end of the lead out to the retract height."""
    stand = _Stand.at(legs[-1], off.rotaries, context.kinematics)
    clear = above(stand, off, legs, context)
    # Without a lead the flank is still on the surface: away from it at feed only.
    feed = None if context.machine.lead_mm > 0.0 else stand.feed_mm_s
    target = stand.joints(clear)
    height = max(context.machine.retract_mm, xyz_of(target, context.kinematics)[2])
    return chains(
        stand.line("lift", off.tip, clear, feed),
        straight(
            "retract",
            stand.place,
            target,
            at_height(target, height, context.kinematics),
            None,
            context.kinematics,
        ),
    )


def at_height(joints: Joints, z_mm: float, kinematics: Kinematics) -> Joints:
    """The same position with Z at ``z_mm``."""
    x, y, _, *pair = kinematics.spread(joints)
    return kinematics.arrange((x, y, z_mm, *pair))


def chains(*segments: Segment | None) -> list[ContinuousPath]:
    """One chain for each segment that moves."""
    return [ContinuousPath((segment,)) for segment in segments if segment is not None]


# ---- inside a train --------------------------------------------------------------


def between(before: CutSegment, after: CutSegment, meeting: Meeting, kinematics: Kinematics) -> list[Segment]:
    """What stands between two cuts of a train: a pivot about the shared ruling, a swivel at a pole."""
    found: list[Segment] = []
    stand = _Stand.at(before, before.end, kinematics)
    reached = before.end
    if meeting is Meeting.PIVOT:
        way = turn(before.cut, after.cut)
        if way is None:
            found.append(_pivot(stand, before.cut.end, after.cut.start, after))
        else:
            found.append(_turn(way, before, after, kinematics))
            reached = rotaries_of(found[-1].end, kinematics)
    if max(abs(a - b) for a, b in zip(after.start, reached, strict=True)) > SAME_ROTARY_RAD:
        found.append(_swivel(reached, after, kinematics))
    return found


def _turn(way: SurfaceCut, before: CutSegment, after: CutSegment, kinematics: Kinematics) -> Segment:
    """As a pivot, and the tool axis tilts from one placement to the other."""
    found = field(way, kinematics)
    joints = joints_on(way, found.u, found.follow(before.end), kinematics)
    block = after.cut.block
    start, end = _tuple(joints[0]), _tuple(joints[-1])
    return Segment(way, block.place, block.feed_mm_s, False, start, end, True, "pivot")


def _pivot(stand: _Stand, before: Edge, after: Edge, leg: CutSegment) -> Segment:
    """The contact stands, the tip goes round it with the tool axis held."""
    first, last = subtract(before.tip, before.contact), subtract(after.tip, before.contact)
    angle = math.atan2(norm(cross(first, last)), dot(first, last))
    turned = _Stand(
        stand.rotaries, stand.length_mm, leg.cut.block.place, leg.cut.block.feed_mm_s, stand.kinematics
    )
    return turned.arc("pivot", before.contact, before.tip, after.tip, angle)


def _swivel(a: Rotaries, after: CutSegment, kinematics: Kinematics) -> Segment:
    """At a pole two blocks may ask for different angles of the work's rotary: it turns, the pose stands.

    With the other rotary held, X Y Z follow the standing tip on a circle f(t); from
    f(0), f(pi/2) and f(pi) its centre and radius vectors are exact.
    """
    tip, block, length = after.cut.start.tip, after.cut.block, after.cut.motion.length_mm
    b = after.start
    k = 0 if abs(b[0] - a[0]) > abs(b[1] - a[1]) else 1
    sign = math.copysign(1.0, b[k] - a[k])

    def xyz(by: float) -> Vector:
        rotaries = (b[0], a[1] + by * sign) if k else (a[0] + by * sign, b[1])
        return kinematics.linear(tip, rotaries, length)

    at_0, at_half = xyz(0.0), xyz(math.pi)
    centre = scale(beside(at_0, (at_half, 1.0)), 0.5)
    arc = Arc(centre, subtract(at_0, centre), subtract(xyz(QUARTER), centre), abs(b[k] - a[k]))
    start, end = joints_of(at_0, a, kinematics), joints_of(kinematics.linear(tip, b, length), b, kinematics)
    if norm(arc.first) > 1e-6:
        return round_arc("swivel", block.place, start, end, arc, block.feed_mm_s, kinematics)
    turn = straight("swivel", block.place, start, end, block.feed_mm_s, kinematics)
    assert turn is not None
    return turn


def _tuple(row: Array) -> Joints:
    return tuple(map(float, row))
