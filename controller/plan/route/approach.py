"""To a train of cuts and away from it: retract, position, plunge, leads; and the pivots inside.

        retract height  ----------<----- position ------.      rotaries turn only here
                                                        |  down (rapid)
        clearance height  . . . . . . . . . . . . . . . +
                                                        |  plunge along the tool axis, at feed
        C1   ==================>=====,                  |
             cut                      `--- lead in -----'      quarter arc, tangent to C1

While the tool axis stands, X Y Z are a rigid image of the table frame: what is an arc
about the part there is an arc of X Y Z, and ``_Stand`` draws it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.curves import Arc
from controller.geometry import Vector, cross, dot, norm, scale, subtract
from controller.kinematics import Kinematics
from controller.machine import Joints, Machine
from controller.motions import Rotaries, SurfaceCut
from controller.placement import AT_LOWER, Placed
from controller.plan.route import audit
from controller.plan.route.branch import field, joints_on
from controller.plan.route.cuts import Edge, beside, gouge, hollow, turn
from controller.plan.route.stretch import (
    Chain,
    Stretch,
    Voice,
    joints_of,
    rotaries_of,
    round_arc,
    straight,
    xyz_of,
)
from controller.plan.route.train import SAME_ROTARY_RAD, Leg, Meeting
from controller.plan.text.program import Place

Array = npt.NDArray[np.float64]

QUARTER = math.pi / 2.0
LEAD_POSES = 25
OVERCUT_MM = 1e-3  # by which a lead may reach deeper into the surface than the cut itself does


@dataclass(frozen=True, slots=True)
class _Stand:
    """A standing tool axis: tips of the table frame to joints, with the rotaries held."""

    rotaries: Rotaries
    length_mm: float
    place: Place
    feed_mm_s: float
    kinematics: Kinematics

    @staticmethod
    def at(leg: Leg, end: bool, kinematics: Kinematics) -> _Stand:
        block = leg.cut.block
        rotaries = leg.end if end else leg.start
        return _Stand(rotaries, leg.cut.motion.length_mm, block.place, block.feed_mm_s, kinematics)

    def xyz(self, tip: Vector) -> Vector:
        return self.kinematics.linear(tip, self.rotaries, self.length_mm)

    def joints(self, tip: Vector) -> Joints:
        return joints_of(self.xyz(tip), self.rotaries, self.kinematics)

    def line(self, name: str, start: Vector, end: Vector, feed_mm_s: float | None) -> Stretch | None:
        return straight(name, self.place, self.joints(start), self.joints(end), feed_mm_s, self.kinematics)

    def arc(self, name: str, centre: Vector, start: Vector, end: Vector, sweep_rad: float) -> Stretch:
        """The arc about ``centre`` from one tip to another (table frame), at feed."""
        first, last = subtract(start, centre), subtract(end, centre)
        # What of the end is across the start: the radius vector a quarter turn ahead.
        ahead = subtract(last, scale(first, math.cos(sweep_rad)))
        second = beside(centre, (ahead, norm(first) / norm(ahead)))
        middle = self.xyz(centre)
        arc = Arc(middle, subtract(self.xyz(start), middle), subtract(self.xyz(second), middle), sweep_rad)
        a, b = self.joints(start), self.joints(end)
        return round_arc(name, self.place, a, b, arc, self.feed_mm_s, self.kinematics)


@dataclass(frozen=True, slots=True)
class Lead:
    """The way onto or off C1 at one end of a train: stretches and the outermost tip."""

    stretches: tuple[Stretch, ...]
    outermost: Vector
    tips: tuple[Vector, ...]  # samples of it in the table frame, for the gouge check


def lead_in(leg: Leg, machine: Machine, kinematics: Kinematics) -> Lead:
    """The quarter arc that ends on C1 in its direction; nothing where ``lead_mm`` is 0."""
    edge, lead = leg.cut.start, _lead_mm(leg, machine)
    if lead <= 0.0:
        return Lead((), edge.tip, (edge.tip,))
    if edge.away != edge.out:
        return _aside(leg, False, lead, kinematics)
    centre = beside(edge.tip, (edge.out, lead))
    start = beside(centre, (edge.tangent, -lead))
    stretch = _Stand.at(leg, False, kinematics).arc("lead in", centre, start, edge.tip, QUARTER)
    return Lead((stretch,), start, _arc_tips(centre, start, edge.tip))


def lead_out(leg: Leg, machine: Machine, kinematics: Kinematics) -> Lead:
    """A straight run on, where it does not run into a hollow, and the quarter arc away."""
    edge, lead = leg.cut.end, _lead_mm(leg, machine)
    if lead <= 0.0:
        return Lead((), edge.tip, (edge.tip,))
    if edge.away != edge.out:
        return _aside(leg, True, lead, kinematics)
    stand = _Stand.at(leg, True, kinematics)
    stretches: list[Stretch] = []
    tip = edge.tip
    if not hollow(leg.cut, 1.0):
        tip = beside(edge.tip, (edge.tangent, lead))
        straight_on = stand.line("run on", edge.tip, tip, stand.feed_mm_s)
        stretches += [straight_on] if straight_on else []
    centre = beside(tip, (edge.out, lead))
    end = beside(centre, (edge.tangent, lead))
    stretches.append(stand.arc("lead out", centre, tip, end, QUARTER))
    line = tuple(beside(edge.tip, (subtract(tip, edge.tip), k / 8.0)) for k in range(8))
    return Lead(tuple(stretches), end, line + _arc_tips(centre, tip, end))


def _aside(leg: Leg, end: bool, lead_mm: float, kinematics: Kinematics) -> Lead:
    """Straight off the ruling: a way that is tangent at C1 is not above, where the normal turns so far."""
    edge = leg.cut.end if end else leg.cut.start
    off = beside(edge.tip, (edge.away, lead_mm))
    stand = _Stand.at(leg, end, kinematics)
    name, way = ("lead out", (edge.tip, off)) if end else ("lead in", (off, edge.tip))
    stretch = stand.line(name, *way, stand.feed_mm_s)
    tips = tuple(beside(edge.tip, (edge.away, lead_mm * k / 8.0)) for k in range(9))
    return Lead((stretch,) if stretch else (), off, tips)


def _lead_mm(leg: Leg, machine: Machine) -> float:
    """No more than the radius of a cutter that leans against the twist: a longer one reaches over the end."""
    surface = leg.cut.motion.surface
    leans = isinstance(surface, Placed) and surface.normals_v != AT_LOWER
    return min(machine.lead_mm, leg.cut.tool.radius_mm) if leans else machine.lead_mm


def _arc_tips(centre: Vector, start: Vector, end: Vector) -> tuple[Vector, ...]:
    first, last = subtract(start, centre), subtract(end, centre)
    angles = (QUARTER * k / (LEAD_POSES - 1) for k in range(LEAD_POSES))
    return tuple(beside(centre, (first, math.cos(a)), (last, math.sin(a))) for a in angles)


def audit_lead(lead: Lead, legs: Sequence[Leg], at_start: bool, machine: Machine, voice: Voice) -> None:
    """A lead must not reach deeper into the train's surfaces than the cut does, beside it, into its own.

    On a twisted surface a cylinder overcuts a little even where it is placed right, so
    0 would be too strict; what the cut does to its neighbours is no excuse.
    """
    cut = legs[0].cut if at_start else legs[-1].cut
    radius, edge = cut.tool.radius_mm, cut.start if at_start else cut.end
    if radius <= 0.0:
        return
    points = audit.surface_points([leg.cut for leg in legs])
    tips: Array = np.array(lead.tips).T
    axes = np.repeat(np.array(edge.axis)[:, None], tips.shape[1], axis=1)
    reached = audit.depth(points, tips, axes, radius, cut.tool.taper_rad)
    allowed = audit.depth_near(cut, audit.surface_points([cut]), at_start, machine.lead_mm + 2.0 * radius)
    if reached > allowed + OVERCUT_MM:
        name = "lead in" if at_start else "lead out"
        gouge(
            f"the {name} of {machine.lead_mm:.3f} mm would cut {reached - allowed:.3f} mm into the surface",
            "set a smaller lead_mm, take a smaller cutter or the other side (G41/G42)",
            cut.block,
            machine,
            voice,
        )


# ---- from the retract height to the lead and back --------------------------------


def above(leg: Leg, end: bool, tip: Vector, legs: Sequence[Leg], machine: Machine, kin: Kinematics) -> Vector:
    """The tip on the tool-axis line through ``tip`` that stands clear of the train's highest point.

    Highest is meant as the machine stands: along Z with the rotaries of that end. A
    tilted head climbs along its own axis until the lower edge of its end face is
    clearance_mm above, or, where that is nearer (a head near the horizontal), until
    the whole block lies behind its end face.
    """
    cut = leg.cut
    edge, stand = (cut.end if end else cut.start), _Stand.at(leg, end, kin)
    points = audit.surface_points([other.cut for other in legs])
    x, y, z = points
    heights = kin.linear((x, y, z), stand.rotaries, stand.length_mm, np)[2]
    base = stand.xyz(tip)
    climb = stand.xyz(beside(tip, (edge.axis, 1.0)))[2] - base[2]  # of Z per mm along the axis
    climb = min(1.0, climb)
    behind = float((np.array(edge.axis) @ points).max()) - dot(edge.axis, tip) + machine.clearance_mm
    if climb < 1e-3:
        return beside(tip, (edge.axis, max(0.0, behind)))
    dip = cut.tool.radius_mm * math.sqrt(max(0.0, 1.0 - climb * climb)) if climb < 1.0 - 1e-12 else 0.0
    over = (float(np.max(heights)) + machine.clearance_mm + dip - base[2]) / climb
    return beside(tip, (edge.axis, max(0.0, min(over, behind))))


def arrive(legs: Sequence[Leg], now: Joints, machine: Machine, kinematics: Kinematics) -> list[Chain]:
    """Chains from ``now`` to the start of the lead in."""
    leg = legs[0]
    stand = _Stand.at(leg, False, kinematics)
    beginning = lead_in(leg, machine, kinematics).outermost
    clear = above(leg, False, beginning, legs, machine, kinematics)
    target = stand.joints(clear)
    _, _, z = xyz_of(now, kinematics)
    height = max(machine.retract_mm, xyz_of(target, kinematics)[2], z)
    place = leg.cut.block.place
    up, over = at_height(now, height, kinematics), at_height(target, height, kinematics)
    return chains(
        straight("retract", place, now, up, None, kinematics),
        straight("position", place, up, over, None, kinematics),
        straight("down", place, over, target, None, kinematics),
        stand.line("plunge", clear, beginning, stand.feed_mm_s),
    )


def depart(legs: Sequence[Leg], machine: Machine, kinematics: Kinematics) -> list[Chain]:
    """Chains from the end of the lead out to the retract height."""
    leg = legs[-1]
    stand = _Stand.at(leg, True, kinematics)
    end = lead_out(leg, machine, kinematics).outermost
    clear = above(leg, True, end, legs, machine, kinematics)
    # Without a lead the flank is still on the surface: away from it at feed only.
    feed = None if machine.lead_mm > 0.0 else stand.feed_mm_s
    target = stand.joints(clear)
    height = max(machine.retract_mm, xyz_of(target, kinematics)[2])
    return chains(
        stand.line("lift", end, clear, feed),
        straight("retract", stand.place, target, at_height(target, height, kinematics), None, kinematics),
    )


def at_height(joints: Joints, z_mm: float, kinematics: Kinematics) -> Joints:
    """The same position with Z at ``z_mm``."""
    values = list(joints)
    values[kinematics.order.index(2)] = z_mm
    a, b, c, d, e = values
    return (a, b, c, d, e)


def chains(*stretches: Stretch | None) -> list[Chain]:
    """One chain for each stretch that moves."""
    return [Chain((stretch,)) for stretch in stretches if stretch is not None]


# ---- inside a train --------------------------------------------------------------


def between(before: Leg, after: Leg, meeting: Meeting, kinematics: Kinematics) -> list[Stretch]:
    """What stands between two cuts of a train: a pivot about the shared ruling, a swivel at a pole."""
    found: list[Stretch] = []
    stand = _Stand.at(before, True, kinematics)
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


def _turn(way: SurfaceCut, before: Leg, after: Leg, kinematics: Kinematics) -> Stretch:
    """As a pivot, and the tool axis tilts from one placement to the other."""
    found = field(way, kinematics)
    joints = joints_on(way, found.u, found.follow(before.end), kinematics)
    block = after.cut.block
    start, end = _tuple(joints[0]), _tuple(joints[-1])
    return Stretch(way, block.place, block.feed_mm_s, False, start, end, True, "pivot")


def _pivot(stand: _Stand, before: Edge, after: Edge, leg: Leg) -> Stretch:
    """The contact stands, the tip goes round it with the tool axis held."""
    first, last = subtract(before.tip, before.contact), subtract(after.tip, before.contact)
    angle = math.atan2(norm(cross(first, last)), dot(first, last))
    turned = _Stand(
        stand.rotaries, stand.length_mm, leg.cut.block.place, leg.cut.block.feed_mm_s, stand.kinematics
    )
    return turned.arc("pivot", before.contact, before.tip, after.tip, angle)


def _swivel(a: Rotaries, after: Leg, kinematics: Kinematics) -> Stretch:
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


def cut_stretch(leg: Leg) -> Stretch:
    """The cut itself."""
    block = leg.cut.block
    start, end = _tuple(leg.joints[0]), _tuple(leg.joints[-1])
    return Stretch(leg.cut.motion, block.place, block.feed_mm_s, True, start, end, True, "cut")


def _tuple(row: Array) -> Joints:
    a, b, c, d, e = (float(q) for q in row)
    return (a, b, c, d, e)
