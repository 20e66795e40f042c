r"""Leads: onto the first ruling of a train and off the last one, in one motion with the cut.

        C1   ==================>======.            the cut, at its feed
             . . . . . . . . . . . . . `-.         the lead, at its own
                                           `\
                                             |     ``lead_mm`` off the surface

Over s, which runs on from the cut's own, the tip and both rotaries are cubics that begin with the place,
the rate and the bend that the cut has there. So nothing jumps at the ruling that the tick would see:
the cut's own bend fades while the way off bends more and more, as a railway's cubic parabola does.
The rotaries turn on: on a twisted surface the flank leaves as it would follow the next rulings.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from controller.geometry import series as jets
from controller.geometry.arrays import Array
from controller.geometry.placement import AT_LOWER, Placed
from controller.geometry.vectors import Vector, norm
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine, Tool
from controller.messages import message
from controller.motion.motions import Rotaries, ToolSpline
from controller.plan.context import Context
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment, joints_of, motion_named, rotaries_of, straight
from controller.plan.surfaces import audit, rates
from controller.plan.surfaces.cuts import Edge, beside, gouge, tolerance_mm
from controller.plan.surfaces.legs import CutSegment
from controller.program.program import Place

LEADS = ("lead in", "lead out")
POSES = 33  # of a lead that are looked at
OVERCUT_MM = 1e-3  # by which a lead may reach deeper into the surface than the cut itself does ...
SPARE_MM = 1e-3  # of the form tolerance, for what is not looked at
CLEAR_MM, MORE = 2e-4, 0.1  # ... and one that joins it; or such a share more, within the form tolerance
# Where none does: as much again as the cut, or so much of what is left of that tolerance, but no more than
# half of it. Some microns within it harm a part less than a cut that rests, or slows down, at its ruling.
AGAIN, OF_REST = 0.1, 0.5
SLENDER = 1.5  # length of a lead over how far off it leads: it bends no more than an arc of that radius
# What is tried in turn: share of ``lead_mm``, how slender, over what part the rotaries come to stand; the
# first ``AT_FEED`` are as long as the feed needs. Past the end of a twisted surface the flank goes on to
# reach into it: what leaves sooner, or turns on less, reaches less.
SHAPES = (
    (1.0, SLENDER, 0.0),
    (1.0, SLENDER, 0.2),
    (1.0, SLENDER, 0.45),
    (1.0, SLENDER, 0.0),
    (1.0, 0.75, 0.0),
    (1.0, 0.75, 0.2),
    (1.0, 0.35, 0.2),
    (0.5, 1.0, 0.2),
    (0.25, 1.0, 0.2),
)
AT_FEED = 3
SHORTER = tuple(10.0 ** (k / 10.0) for k in range(20, -7, -1))  # mm: preferred numbers, ISO 3, series R10
KEPT = 0.98  # of the feed at the ruling, as ``End.feed_share`` estimates it ...
NEARLY = 0.9  # ... or this of the most that any keeps
ROOM = 1.2  # times the way in which the feed is reached: the lead bends meanwhile
LONGEST = 5.0  # times ``lead_mm``, however long a machine needs to its feed
FADING, FADING_RAD = 1.0, math.radians(10.0)  # by so much of itself, and so far, a bend may turn the way
MAX_FADE = 0.45  # of a lead, on which the cut's bend fades: twice that must fit
DIPS, TICKS, MIN_MM = 1.5, 4.0, 0.004  # of the way at the cut's feed beside the ruling
MAX_TILT_RAD = math.radians(20.0)  # of the axis on a lead
EASY_SHARE = 0.4  # of both, where the feed does not need more
MAX_TURN_RAD = math.radians(60.0)  # of a rotary: beside a pole it might be any number of turns
STANDS_RAD = 1e-9  # per mm: rounding of a rotary that stands
MIN_RATE = 0.2  # mm of the tip per mm of the contact: in a tight hollow the tip all but stands


@dataclass(frozen=True, slots=True)
class Lead:
    """The way onto or off C1 at one end of a train, and how the tool stands at its outer end."""

    segments: tuple[Segment, ...]
    tip: Vector  # table frame
    axis: Vector
    rotaries: Rotaries


def lay(legs: Sequence[CutSegment], at_start: bool, context: Context) -> Lead:
    """The longest lead that stays outside of the train's surfaces and in travel; none where ``lead_mm`` is 0.

    Refuses (or tells, where the machine is to warn only) what would cut into them in any case.
    """
    leg = legs[0 if at_start else -1]
    end = End.of(leg, at_start, context)
    if context.machine.lead_mm <= 0.0:
        return end.standing(())
    free = Room.of(legs, at_start, context)
    found = free.best(end.joined(context.machine), lambda lead: end.feed_share(lead, context.machine))
    if found is not None:
        return end.led(found)
    off = end.straight_off()
    if off is None:
        return end.standing(())
    reached = free.reached(off)
    if reached > OVERCUT_MM:
        gouge(
            message(
                "gouge.lead", lead=motion_named(off.name), length=context.machine.lead_mm, reached=reached
            ),
            message("gouge.shorter_lead"),
            leg.cut.block,
            context,
        )
    context.tell(leg.cut.block.place, message("lead.rests", lead=motion_named(off.name)))
    return end.led(off)


def _off_mm(leg: CutSegment, machine: Machine) -> float:
    """At most the radius of a cutter that leans against the twist: a longer lead reaches over the end."""
    surface = leg.cut.motion.surface
    leans = isinstance(surface, Placed) and (surface.normals_v != AT_LOWER or surface.through is not None)
    return min(machine.lead_mm, leg.cut.tool.radius_mm) if leans else machine.lead_mm


@dataclass(frozen=True, slots=True)
class End:
    """Where a lead joins a path: ``rows`` (3, 5) of tip and both rotaries, with two derivatives.

    ``rates`` (axes,) and ``bends`` (axes,) are first and second derivatives of the joints, without sign, and
    ``tilt`` is the rate of the axis (rad), all over s in mm; a lead is no longer than ``most``.
    """

    place: Place
    joints: Joints
    feed_mm_s: float  # of the path, along s
    tip: Vector  # table frame
    axis: Vector
    away: Vector  # unit vector off the part
    off_mm: float  # at most
    length_mm: float  # of the tool
    at_start: bool  # of what is cut: the lead leads onto it
    kinematics: Kinematics
    rows: Array
    rates: Array
    bends: Array
    tilt: float
    most: float = math.inf

    @staticmethod
    def of(leg: CutSegment, at_start: bool, context: Context) -> End:
        """That of a cut."""
        segment = leg.segment
        s, q = (0.0, segment.start) if at_start else (segment.motion.end, segment.end)
        edge = leg.cut.start if at_start else leg.cut.end
        off_mm, length_mm = _off_mm(leg, context.machine), leg.cut.motion.length_mm
        return End.at(segment, s, q, edge, off_mm, length_mm, at_start, context.kinematics)

    @staticmethod
    def at(
        segment: Segment,
        s: float,
        joints: Joints,
        edge: Edge | Vector,
        off_mm: float,
        length_mm: float,
        at_start: bool,
        kinematics: Kinematics,
    ) -> End:
        """A place of any motion; ``joints``: there; ``edge``: of a cut, or which way is off the part."""
        series = rates.joint_series(segment, s, joints, kinematics)
        tip, axis = kinematics.forward(series, length_mm, jets)
        turns = kinematics.spread(series)[3:]
        rows = np.array([[jets.jet(one).derivative(k).item() for one in (*tip, *turns)] for k in range(3)])
        rows[1:, 3:][np.abs(rows[1:, 3:]) < STANDS_RAD] = 0.0
        tilt = math.hypot(*(jets.jet(one).derivative(1).item() for one in axis))
        first, second = (np.abs([one.derivative(k).item() for one in series]) for k in (1, 2))
        if isinstance(edge, Edge):
            here = (edge.tip, edge.axis, edge.away)
        else:
            here = (*kinematics.forward(joints, length_mm), edge)
        feed_mm_s = float(segment.feed_at(np.array([s]))[0])
        own = (segment.place, joints, feed_mm_s, *here, off_mm, length_mm, at_start, kinematics)
        return End(*own, rows, first, second, tilt)

    @property
    def name(self) -> str:
        return LEADS[not self.at_start]

    @property
    def tip_rate(self) -> float:
        """Millimetres of the tip per mm of s."""
        return max(float(np.linalg.norm(self.rows[1, :3])), MIN_RATE)

    def joined(self, machine: Machine) -> Iterator[Segment]:
        """Leads that join the cut; none where it has no rate.

        The longest first; then those of each shorter ``lead_mm`` of ``SHORTER``, so that a longer one is
        never worse than a shorter one.
        """
        if not np.isfinite(self.rows).all():
            return
        settling = self.settling(machine)
        yield from self._shapes(machine.lead_mm, self.off_mm, settling, machine)
        for lead_mm in SHORTER:
            if lead_mm < machine.lead_mm:
                yield from self._shapes(lead_mm, min(self.off_mm, lead_mm), settling, machine)

    def _shapes(self, lead_mm: float, off_mm: float, settling: float, machine: Machine) -> Iterator[Segment]:
        """One of each of ``SHAPES``, no further off than ``off_mm``."""
        tip_rate = self.tip_rate
        most, feed = self._longest(), lead_feed(self.feed_mm_s, tip_rate, machine)
        way = max(self._ramp(machine), self._bending(off_mm, machine))
        ramp = min(ROOM * way, LONGEST * lead_mm)
        for k, (share, slender, holds) in enumerate(SHAPES):
            off = share * off_mm
            length = max(
                min(slender * off / tip_rate, EASY_SHARE * most), min(ramp, most) if k < AT_FEED else 0.0
            )
            yield self._lead(min(length, self.most), off, feed, settling, holds)

    def _longest(self) -> float:
        """The longest way on which neither the axis nor a rotary turns by more than it is to."""
        turn = float(np.abs(self.rows[1, 3:]).max())
        return min(MAX_TURN_RAD / (turn + 1e-12), MAX_TILT_RAD / (self.tilt + 1e-12))

    def _along(self, machine: Machine) -> tuple[float, float, float]:
        """Largest speed, acceleration and jerk along s that the joints allow at the ruling."""
        limits = rates.limits(machine)
        velocity, acceleration, jerk = (limits / (self.rates[:, None] + 1e-12)).min(axis=0).tolist()
        bent = float(np.sqrt(limits[:, 1] / (self.bends + 1e-12)).min())
        return min(self.feed_mm_s, velocity, bent), acceleration, jerk

    def _ramp(self, machine: Machine) -> float:
        """The way from rest to the feed, or to what the joints' velocities leave of it."""
        v, acceleration, jerk = self._along(machine)
        if v * jerk < acceleration**2:
            return v * math.sqrt(v / jerk)
        return 0.5 * v * (v / acceleration + acceleration / jerk)

    def _bending(self, off_mm: float, machine: Machine) -> float:
        """The way L over which no axis' jerk is in the way of the feed v.

        A cubic leads off, with the third derivative 6 off / L^3 on linear axes, while the cut's own bend q"
        fades over ``MAX_FADE`` L: (6 off / L^3 + |q"| / (MAX_FADE L)) v^3 = jerk is a cubic in L with one
        positive root.
        """
        speed, _, _ = self._along(machine)
        per_jerk = speed**3 / rates.limits(machine)[:, 2]
        one, lift = np.ones(len(per_jerk)), np.zeros(len(per_jerk))
        lift[list(machine.linear())] = 6.0 * off_mm
        cubics = np.array([one, -self.bends * per_jerk / MAX_FADE, 0.0 * one, -lift * per_jerk])
        return max(float(np.roots(cubic).real.max()) for cubic in cubics.T)

    def settling(self, machine: Machine) -> float:
        """The way at the cut's own feed beside the ruling.

        To brake late and dip below the feed saves time: there is room for it before the cut begins.
        """
        v, acceleration, jerk = self._along(machine)
        dip_s = 2.0 * min(math.sqrt(2.0 * v / jerk), acceleration / jerk)
        return max(v * (DIPS * dip_s + TICKS * machine.period_s), MIN_MM)

    def _lead(self, length: float, off_mm: float, feed_mm_s: float, settling: float, holds: float) -> Segment:
        """Cubics over ``length`` whose tip ends ``off_mm`` off the tangent; the cut's bend fades first.

        ``holds``: over this share of it, twice, the rotaries come to stand; 0: they turn on.
        """
        fade = holds * length if holds else min(self._fade(length), MAX_FADE * length)
        sign = -1.0 if self.at_start else 1.0
        x = sign * np.array([0.0, fade, 2.0 * fade, length])  # of s, from the ruling
        spans = self._spans(x, off_mm, bool(holds))
        if self.at_start:
            spans = [beyond(cubic, d) for cubic, d in zip(spans, np.diff(x), strict=True)][::-1]
        knots, cubics = np.sort(x - x.min()), np.array([cubic.T for cubic in spans])
        spline = spline_of(knots, cubics, self.length_mm, self.place.line)
        outer = spline.joints(0.0 if self.at_start else length, self._rotaries, self.kinematics)
        assert outer is not None
        ends = (outer, self.joints) if self.at_start else (self.joints, outer)
        made = Segment(spline, self.place, self.feed_mm_s, False, *ends, True, self.name)
        return self._fed(made, feed_mm_s, settling)

    def _spans(self, x: Array, off_mm: float, holds: bool) -> list[Array]:
        """Coefficients (4, 5) between the knots ``x`` (4,), each from the knot nearer to the ruling.

        Their bends are straight lines from knot to knot, to which the cubic that leads off is added.
        """
        value, first, bend = self.rows
        bends = np.array([bend, 0.0 * bend, 0.0 * bend, 0.0 * bend])
        if holds:
            bends[1, 3:] = -(first[3:] / x[1] + 0.5 * bend[3:])
        end, spans = value + first * x[-1], list[Array]()
        for d, b, c in zip(np.diff(x), bends, bends[1:], strict=False):
            spans.append(np.array([value, first, 0.5 * b, (c - b) / (6.0 * d)]))
            value, first = value + d * (first + d * (2.0 * b + c) / 6.0), first + 0.5 * d * (b + c)
        lift = np.zeros(5)
        lift[:3] = ((end - value)[:3] + off_mm * np.array(self.away)) / x[-1] ** 3
        powers = (np.array([at**3, 3.0 * at**2, 3.0 * at, 1.0]) for at in x)
        return [cubic + np.outer(power, lift) for cubic, power in zip(spans, powers, strict=False)]

    def _fade(self, length: float) -> float:
        """Over what way the bends of the cut fade: one that is sharp at its end is not drawn on far."""
        tip, turn = float(np.linalg.norm(self.rows[2, :3])), float(np.abs(self.rows[2, 3:]).max())
        by_tip = FADING * float(np.linalg.norm(self.rows[1, :3])) / (tip + 1e-12)
        by_turn = 2.0 * FADING_RAD / (turn * length + 1e-12)
        return min(max(min(by_tip, by_turn), 0.01 * length), 0.9 * length)

    def _fed(self, lead: Segment, feed_mm_s: float, settling: float) -> Segment:
        """At ``feed_mm_s``, and beside the ruling at the cut's own."""
        own, length = self.feed_mm_s, lead.motion.end
        if settling >= length or feed_mm_s <= own:
            return replace(lead, turning=((0.0, math.inf),))
        at = length - settling if self.at_start else settling
        if self.at_start:
            steps, own_s = ((0.0, feed_mm_s), (at, own)), (at, math.inf)
        else:
            steps, own_s = ((0.0, own), (at, feed_mm_s)), (0.0, at)
        return replace(lead, feed_mm_s=steps[0][1], feed_steps=steps, turning=(own_s,))

    def feed_share(self, lead: Segment, machine: Machine) -> float:
        """About what share of its feed the contact has at the ruling with this lead.

        The lead may be too short for it, or itself slower where rotaries are to come to stand soon.
        """
        (speed, _, _), ramp = self._along(machine), self._ramp(machine)
        way = np.linspace(0.0, min(ramp, lead.motion.end), POSES)
        s = lead.motion.end - way if self.at_start else way
        allowed = rates.derivatives(lead, s, self.kinematics).even_speed(*rates.limits(machine).T)
        return min(1.0, float(allowed.min()) / speed, math.pow(lead.motion.end / ramp, 2.0 / 3.0))

    def straight_off(self) -> Segment | None:
        """A line off the path with the tool axis held: the machine rests at that place."""
        rotaries = self._rotaries
        xyz = self.kinematics.linear(beside(self.tip, (self.away, self.off_mm)), rotaries, self.length_mm)
        outer = joints_of(xyz, rotaries, self.kinematics)
        ends = (outer, self.joints) if self.at_start else (self.joints, outer)
        return straight(self.name, self.place, *ends, self.feed_mm_s, self.kinematics)

    @property
    def _rotaries(self) -> Rotaries:
        return rotaries_of(self.joints, self.kinematics)

    def standing(self, segments: tuple[Segment, ...]) -> Lead:
        return Lead(segments, self.tip, self.axis, self._rotaries)

    def led(self, segment: Segment) -> Lead:
        """The way of one segment."""
        outer = segment.start if self.at_start else segment.end
        pose = self.kinematics.forward(outer, self.length_mm)
        return Lead((segment,), pose.tip, pose.axis, rotaries_of(outer, self.kinematics))


def spline_of(knots: Array, cubics: Array, length_mm: float, line: int) -> ToolSpline:
    """``cubics`` (n, 5, 4) of tip and rotaries between n + 1 ``knots``, for a tool of that length."""
    flat, lines = array("d", cubics.ravel().tolist()), array("l", [line])
    return ToolSpline(array("d", knots.tolist()), flat, True, length_mm, lines, array("d", [0.0]))


def beyond(cubic: Array, x: float) -> Array:
    """Coefficients (4, n) of the same cubics in powers of what lies behind ``x``."""
    a, b, c, d = cubic
    return np.array([a + x * (b + x * (c + x * d)), b + x * (2.0 * c + x * 3.0 * d), c + 3.0 * x * d, d])


def lead_feed(feed_mm_s: float, tip_rate: float, machine: Machine) -> float:
    """Feed of the tip (mm/s): never so low that the cut could not begin at its own."""
    fastest = min(machine.axes[i].limits.velocity for i in machine.linear())
    own = fastest if machine.lead_feed_mm_s is None else machine.lead_feed_mm_s
    return max(own, feed_mm_s * tip_rate)


@dataclass(frozen=True, slots=True)
class Room:
    """Where a lead may be: points (3, N) of the train's surfaces, and how deep the cut gets into its own.

    On a twisted surface a cylinder overcuts a little even where it is placed right, so 0 would be
    too strict; what the cut does to its neighbours is no excuse.
    """

    tool: Tool
    points: Array
    allowed_mm: float
    more_mm: float  # than that: where going on costs what the twist does, within the form tolerance
    most_mm: float  # likewise, where no lead keeps to that
    context: Context

    @staticmethod
    def of(legs: Sequence[CutSegment], at_start: bool, context: Context) -> Room:
        cut = legs[0 if at_start else -1].cut
        points, allowed = audit.surface_points([leg.cut for leg in legs]), 0.0
        if cut.tool.radius_mm > 0.0:
            reach = context.machine.lead_mm + 2.0 * cut.tool.radius_mm
            allowed = audit.depth_near(cut, audit.surface_points([cut]), at_start, reach)
            allowed += context.kinematics.lean_rad * norm(cut.motion.surface.ruling(0.0 if at_start else 1.0))
        more = most = MORE * allowed
        tolerance = tolerance_mm(cut.block.modal, cut.tool, context.machine)
        if tolerance is not None and allowed < tolerance:
            left = tolerance - SPARE_MM - allowed
            more, most = min(more, left), min(max(allowed, AGAIN * left), OF_REST * left)
        more = max(CLEAR_MM, more)
        return Room(cut.tool, points, allowed, more, max(more, most), context)

    def lets(self, one: Segment) -> bool:
        """Whether it stays in travel and hardly reaches deeper than the cut."""
        return self._reached_in_travel(one) <= self.more_mm

    def best(self, leads: Iterator[Segment], kept: Callable[[Segment], float]) -> Segment | None:
        """The first that keeps the feed and hardly reaches deeper than the cut.

        Where there is none: within bounds the least deep of those that keep it, or nearly the most of it.
        """
        tried = list[tuple[float, float, Segment]]()
        for one in leads:
            reached = self._reached_in_travel(one)
            if reached > self.most_mm:
                continue
            share = min(kept(one), KEPT)
            if reached <= self.more_mm and share >= KEPT:
                return one
            tried.append((share, reached, one))
        most = max((share for share, _, _ in tried), default=0.0)
        enough = most if most >= KEPT else NEARLY * most
        return min((one for one in tried if one[0] >= enough), key=itemgetter(1))[2] if tried else None

    def reached(self, lead: Segment) -> float:
        """How much deeper (mm) a lead gets into the surfaces than the cut does beside it."""
        return self._reached(self._along(lead)[1])

    def _reached_in_travel(self, lead: Segment) -> float:
        """Likewise; infinite where it leaves an axis' travel."""
        s, joints = self._along(lead)
        outside = audit.outside(self.context.machine, s, joints) is not None
        return math.inf if outside else self._reached(joints)

    def _along(self, lead: Segment) -> tuple[Array, Array]:
        """Where it is looked at, and the joints (N, axes) there."""
        s = np.linspace(0.0, lead.motion.end, POSES)
        return s, joints_along(lead, s, self.context.kinematics)

    def _reached(self, joints: Array) -> float:
        if self.tool.radius_mm <= 0.0:
            return 0.0
        pose = self.context.kinematics.forward(tuple(joints.T), self.tool.length_mm, np)
        tips, axes = (np.array([np.broadcast_to(c, joints.shape[:1]) for c in v]) for v in pose)
        depth = audit.depth(self.points, tips, axes, self.tool)
        return depth - self.allowed_mm
