"""Ways aside: off the part to the place where a path is gone on with, by a lead, with the tool that is in.

        retract height  ---------<------ position ------.      rotaries turn only here
              ^                                         |
              | retract, along the tool axis first      | down
              |                                         |
             now                                        o    here the tool waits, off the part
                                                         `.
        path  ======(done)======. . . . . . . . . . . . . `===(goes on)====>    lead, joined to the path

Beside a surface the lead leads off it as those of its cut do. Of lines nobody knows on which side the part
is: there the tool waits above, and comes down along its own axis over what the lines have cut already.
Every way is looked at against the surfaces of the whole program, as thick as the tool is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from controller.geometry.vectors import Vector, add, norm, scale
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine, Tool
from controller.messages import Message, message, text
from controller.motion.motions import SurfaceCut
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment, joints_of, rotaries_of, straight, xyz_of
from controller.plan.surfaces import audit, links
from controller.plan.surfaces.cuts import edge
from controller.plan.surfaces.leads import LEADS, End
from controller.plan.surfaces.walls import NONE, Walls
from controller.program.program import Place

RETRACT_MM_S = 10.0  # off the part, and down to where the tool waits or its feed begins
TURNING_MM_S = 5.0  # to a place of a program that stands, or turns rotaries alone: its feed is not the tip's
OFF_MM = 1.0  # a lead's, where the machine has none
FOLLOW_MM = 0.25  # between samples when the rotaries are followed to a place
PASSED = frozenset(("pivot", "swivel", links.NAME, LEADS[1]))  # nothing is cut: what follows is gone on with
BEGUN_AGAIN = frozenset(("plunge", LEADS[0]))  # onto the part
FREE = frozenset(("retract", "position", "down", "lift"))
ASIDE_MM = 2e-3  # by which a lead beside a line may leave what the line has cut
ARM_MM = 100.0  # off a rotary: so far its turn moves the tool
SHORTEST_MM = 0.2  # of a lead along lines
FAR_MM = 100.0  # along a tool axis that lies so flat that Z gains nothing
FLAT = 0.1  # of Z per mm along the axis
STANDING = 1e-3  # of the tip, in mm per unit of s: only the axis turns there
BESIDE_MM = 2.0  # of the cut before and after a place: so deep as there the tool may get anyway
STANDS_MM = 0.01  # in contact
MORE, MORE_MM = 0.1, 5e-3  # than that


class NotPossible(Exception):
    """Why the tool cannot leave the path, or not come to it, and what to do."""

    def __init__(self, why: Message) -> None:
        super().__init__(text(why))
        self.said = why


@dataclass(frozen=True, slots=True)
class Fitted:
    """What a way is laid by: the tool in the spindle, None where it is not known, and the program's walls."""

    tool: Tool | None = None
    walls: Walls = NONE


@dataclass(frozen=True, slots=True)
class Reentry:
    """How a path is gone on with: where the tool waits, and the way in.

    ``ways`` lead on from ``waits``; the last of them runs into the path at ``s`` if it ``joins``.
    ``allowed_mm``: so deep the tool gets into walls there by the program's own will.
    """

    waits: Joints
    s: float
    ways: tuple[Segment, ...] = ()
    joins: bool = False
    allowed_mm: float = 0.0


def joints_at(segment: Segment, s: float, kinematics: Kinematics) -> Joints:
    """The joints at a place of a segment, on the branch and in the turns of the program's own path."""
    steps = max(2, round(s / FOLLOW_MM)) if isinstance(segment.motion, SurfaceCut) else 2
    row = joints_along(segment, np.linspace(0.0, s, steps), kinematics)[-1]
    near = tuple(map(float, row))
    exact = segment.motion.joints(s, rotaries_of(near, kinematics), kinematics)
    return exact if exact is not None else near


def begins_at(segment: Segment, s: float) -> float | None:
    """Where a segment is gone on with that was left at ``s``; None: it is passed over."""
    if segment.name in PASSED:
        return None
    return 0.0 if segment.name in BEGUN_AGAIN else s


def apart(one: Joints, other: Joints, kinematics: Kinematics) -> float:
    """How far (mm) the tool goes from one place to the other, its axis held."""
    return math.dist(kinematics.forward(one, 0.0).tip, kinematics.forward(other, 0.0).tip)


# ---- onto the path -----------------------------------------------------------------


def is_free(segment: Segment) -> bool:
    """Whether a motion leads beside the part, or onto it only at its end."""
    return segment.feed_mm_s is None or segment.name in FREE or segment.name in BEGUN_AGAIN


@dataclass(frozen=True, slots=True)
class WayOnto:
    """Lays ways onto a path, with what is fitted on a machine."""

    machine: Machine
    kinematics: Kinematics
    fitted: Fitted = Fitted()

    @property
    def _off_mm(self) -> float:
        """Of a lead."""
        return self.machine.lead_mm if self.machine.lead_mm > 0.0 else OFF_MM

    def see_free(self, now: Joints, allowed_mm: float) -> None:
        """Raises NotPossible where a tool that was fitted meanwhile is in a wall, deeper than is allowed."""
        tool = self.fitted.tool
        if tool is None:
            return
        stands = self.fitted.walls.at(now, tool, self.kinematics)
        if stands.depth_mm > max(allowed_mm, STANDS_MM):
            where = {"tool": tool.number, "depth": stands.depth_mm, "line": stands.line}
            raise NotPossible(message("aside.stands", **where))

    def enter(self, segment: Segment, s: float, clear_mm: float) -> Reentry:
        """The way onto a segment at ``s``. Raises NotPossible.

        ``clear_mm``: along the tool axis, from where on it is above the part.
        """
        joints = joints_at(segment, s, self.kinematics)
        if is_free(segment):
            return Reentry(joints, s)
        if isinstance(segment.motion, SurfaceCut):
            return self._beside_a_surface(segment, segment.motion, s, joints)
        return self._over_a_line(segment, s, joints, clear_mm)

    def enter_pause(self, joints: Joints, place: Place, clear_mm: float) -> Reentry:
        """The way to a place where the program stands, in contact perhaps."""
        waits = self._above(joints, clear_mm)
        return Reentry(waits, 0.0, self._down(waits, joints, place, TURNING_MM_S))

    def _beside_a_surface(self, segment: Segment, cut: SurfaceCut, s: float, joints: Joints) -> Reentry:
        """By a lead that joins the cut; where none stays off walls, by a line that rests at the ruling."""
        tool, walls, kin = self.fitted.tool, self.fitted.walls, self.kinematics
        end = End.at(segment, s, joints, edge(cut, cut.arc.u_at(s)), self._off_mm, cut.length_mm, True, kin)
        allowed_mm = most_mm = 0.0
        if tool is not None:
            near = np.clip(s + BESIDE_MM * np.linspace(-1.0, 1.0, 17), 0.0, cut.end)
            allowed_mm = max(0.0, walls.deepest(segment, near, tool, kin).depth_mm)
            most_mm = allowed_mm + max(MORE_MM, MORE * allowed_mm)
        for lead in end.joined(self.machine):
            if self._lets(lead, most_mm):
                return Reentry(lead.start, s, (lead,), True, most_mm)
        off = end.straight_off()
        if off is not None and self._lets(off, most_mm):
            return Reentry(off.start, s, (off,), False, most_mm)
        raise NotPossible(message("aside.no_lead", line=segment.line_at(s)))

    def _lets(self, lead: Segment, most_mm: float) -> bool:
        """Whether a lead stays in travel, off walls but where it meets its cut, and begins clear of them."""
        s = np.linspace(0.0, lead.motion.end, audit.TURN_POSES)
        tool, walls, kin = self.fitted.tool, self.fitted.walls, self.kinematics
        if audit.outside(self.machine, s, joints_along(lead, s, kin)) is not None:
            return False
        if tool is None:
            return True
        return (
            walls.deepest(lead, s, tool, kin).depth_mm <= most_mm and walls.at(lead.start, tool, kin).is_clear
        )

    def _over_a_line(self, segment: Segment, s: float, joints: Joints, clear_mm: float) -> Reentry:
        """Down along the tool axis, the end of it a lead along what the line has cut, as far as that goes."""
        kin, feed_mm_s = self.kinematics, _feed(segment, s)
        length_mm = getattr(segment.motion, "length_mm", 0.0)
        axis = kin.forward(joints, length_mm).axis
        end = End.at(segment, s, joints, axis, self._off_mm, length_mm, True, kin)
        most = _along_the_cut(end, s)
        is_long = most * end.tip_rate >= SHORTEST_MM
        lead = next(replace(end, most=most).joined(self.machine), None) if is_long else None
        into = joints if lead is None else lead.start
        waits = self._above(into, clear_mm)
        down = self._down(waits, into, segment.place, feed_mm_s)
        if lead is None:
            return Reentry(waits, s, down)
        return Reentry(waits, s, (*down, lead), True)

    def _above(self, joints: Joints, clear_mm: float) -> Joints:
        """Where the tool waits over a place: above the part, as far as the travel lets it."""
        room_mm = room_along_axis(joints, self.machine, self.kinematics)
        return along_axis(joints, min(clear_mm, room_mm), self.kinematics)

    def _down(self, waits: Joints, joints: Joints, place: Place, feed_mm_s: float) -> tuple[Segment, ...]:
        """Along the tool axis, the last of it at feed."""
        kin, off_mm = self.kinematics, max(self.machine.lead_mm, OFF_MM)
        near = along_axis(joints, off_mm, kin) if apart(waits, joints, kin) > off_mm else waits
        ways = (
            straight("plunge", place, waits, near, RETRACT_MM_S, kin),
            straight("plunge", place, near, joints, feed_mm_s, kin),
        )
        return tuple(way for way in ways if way is not None)


def _along_the_cut(end: End, s: float) -> float:
    """How long a lead along the tangent may be, in the unit of s, for the line to have been there before."""
    if not np.isfinite(end.rows).all() or float(np.linalg.norm(end.rows[1, :3])) < STANDING:
        return 0.0
    bend = float(np.linalg.norm(end.rows[2, :3])) + ARM_MM * float(np.abs(end.rows[2, 3:]).max())
    return min(s, math.sqrt(2.0 * ASIDE_MM / (bend + 1e-12)))


def _feed(segment: Segment, s: float) -> float:
    """The feed (mm/s) of the way down to a place; where only rotaries move theirs tells nothing."""
    curve = getattr(segment.motion, "curve", None)
    if curve is not None and norm(tuple(np.subtract(curve.at(1.0), curve.at(0.0)))) < 1e-6:
        return TURNING_MM_S
    return min(RETRACT_MM_S, float(segment.feed_at(np.array([s]))[0]))


# ---- along the tool axis -------------------------------------------------------------


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
