"""Joints of surfaces within a tolerance: the poses on both sides are led over into each other.

Programs have three to five decimals, so the rulings that two surfaces share agree but their normals
differ by hundredths of a degree. There the cutter would have to pivot, or would cut a nanometre into
one of the two. Instead both cuts are corrected next to the joint (``placement.Blend``) by half of what
their poses, and the first two derivatives of these over the length of the contact, differ by: they
come to the same pose at the same rates. What this leaves on the surfaces, or takes off them, is
computed point by point (``blends``), and the blend made shorter until it is within the tolerance, or
longer where the limits of the joints would slow the contact down on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.placement import Blend
from controller.geometry.vectors import add, angle_between, cross, dot, norm, scale, subtract
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.memory import remembered
from controller.motion.motions import SurfaceCut
from controller.plan.context import Context
from controller.plan.surfaces import passing
from controller.plan.surfaces.blends import End, Looked, Rounding, between, led_over, placed
from controller.plan.surfaces.cuts import MAX_KNOWN, REMEMBERED, SAME_RAD, Cut, apart, edge, turned
from controller.plan.surfaces.placements import name_of
from controller.program.program import Modal

USEFUL_S = 0.1  # a blend takes so long at the feed, on either side, unless it is passed more slowly then
USEFUL_MM = (1.0, 10.0)
LONGER = 2.0  # times: the next one that is tried where the joints are too slow for a blend
SHARE = 0.49  # of a cut: both its ends may be blended
SHORTEST_MM = 0.02
TRIES = 10
USED = 0.9  # of what the tolerance leaves, for what lies between the points that are looked at
CUBIC, TINY = 3.0, 1e-12
ROUNDED_MM = 0.01  # the paper's unit, and the coarsest that programs are written in
CLOSE = 0.85  # of the shortest blend that is too long: so near to it one is long enough
ROUNDINGS = (0.0594, 0.09, 0.12, 0.16)  # how far each stays away from a corner of slope 1 over its reach
CLEAR_OF_POLE = 10.0  # times the change of the axis: so far from the pole it hardly turns a rotary
ALONG_RULING = (0.0, 0.25, 0.5, 0.75, 0.99)  # of the ruling, from below: just below C0, a cone may have a tip
MEANT_MM = 1e-9  # poses nearer than this are meant to be one
SMOOTH, ALIKE = 1e-9, 3.0  # rad within a millimetre; times the tolerance, within the same


class Tolerance(NamedTuple):
    """How far two surfaces may be apart and the blend may leave them (mm), and their turn (rad)."""

    mm: float
    rad: float
    creases: bool = False  # whether what turns by more along the ruling is blended, too: G64 P


EXACT = Tolerance(1e-5, math.radians(1e-3))  # G61: the rounding of the program's own numbers


class Joint(NamedTuple):
    """Two cuts, blended: what they differed by, and what the blend costs."""

    before: Cut
    after: Cut
    angle_rad: float  # of the normals, at the contact
    crease_rad: float  # the largest along the ruling
    gap_mm: float
    reach_mm: float  # of the longer of both blends
    deviates_mm: float
    slowed: passing.Slowest | None
    shortened: bool  # by the tolerance
    axis_too: bool  # or, beside a pole, the tip alone


def tolerance(before: Cut, after: Cut, machine: Machine) -> Tolerance:
    """What holds at the joint of two blocks: the tighter of both."""
    a, b = (allowed_by(cut.block.modal, machine) for cut in (before, after))
    if EXACT in (a, b):
        return EXACT
    return Tolerance(min(a.mm, b.mm), min(a.rad, b.rad), a.creases and b.creases)


def allowed_by(modal: Modal, machine: Machine) -> Tolerance:
    """What G61, or G64 with its P and Q, and the machine file let a joint be."""
    if modal.exact_joints:
        return EXACT
    degrees = modal.blend_deg or machine.joint_tolerance_deg
    tip_mm = modal.blend_mm or machine.joint_tolerance_mm
    return Tolerance(tip_mm, math.radians(degrees), modal.blend_mm > 0.0)


def joined(before: Cut, after: Cut, allowed: Tolerance, context: Context) -> Joint | None:
    """The two cuts run through, if they meet within the tolerance and a blend keeps it."""
    end, start = before.end, after.start
    angle, gap = turned(end, start), apart(end.contact, start.contact)
    longest = max(norm(before.motion.surface.ruling(1.0)), norm(after.motion.surface.ruling(0.0)))
    tilt = apart(end.ruling, start.ruling)
    if max(abs(angle), tilt) > allowed.rad or max(gap, tilt * longest) > allowed.mm:
        return None
    step = subtract(start.contact, end.contact)
    upper = add(step, scale(subtract(start.ruling, end.ruling), longest))
    hollow = 0.0
    if after.side * angle < 0.0:  # each of the two is cut by the other one's flank
        hollow = after.tool.radius_mm * (1.0 - math.cos(angle))
    across = max(abs(dot(step, end.out)), abs(dot(upper, end.out)))
    within = Tolerance(USED * (allowed.mm - hollow), allowed.rad)
    found = _Fastest(before, after, within, across, context).passed
    if found is None:
        return None
    return Joint(
        *_cuts(before, after, found.pair),
        abs(angle),
        crease(before.motion, after.motion),
        max(gap, tilt * longest),
        found.pair.reach_mm,
        hollow + found.pair.deviates_mm,
        found.slowed,
        found.shortened,
        found.pair.axis_too,
    )


class _Passed(NamedTuple):
    """A blend, what the contact slows down to on it, and whether the tolerance keeps it from being longer."""

    pair: _Pair
    slowed: passing.Slowest | None
    shortened: bool

    @property
    def share(self) -> float:
        return self.slowed.share if self.slowed else 1.0


@lru_cache(2)
def _passed_on(_: Machine) -> dict[str, passing.Slowest | None]:
    """As ``_chosen``, of the machines of the last programs: another tool table makes another machine."""
    return {}


@dataclass(frozen=True, slots=True)
class _Fastest:
    """The blend of two cuts that is passed fastest within a tolerance.

    One of the useful length, as a rule. On one that reaches further a turn of the tool has more time, and
    deviates by more: so long ones are tried where the limits of the joints ask for it.
    """

    before: Cut
    after: Cut
    allowed: Tolerance
    gap_mm: float
    context: Context

    @property
    def passed(self) -> _Passed | None:
        feed, best = self.after.block.feed_mm_s, None
        reach, most = min(max(USEFUL_S * feed, USEFUL_MM[0]), USEFUL_MM[1]), self._reach(math.inf)
        while (one := self._passed(reach)) is not None:
            if best is None or one.share > best.share:
                best = one
            if one.slowed is None or one.shortened or reach >= most or not one.pair.axis_too:
                break
            reach = min(LONGER * reach, most)
        return best

    def _passed(self, reach_mm: float) -> _Passed | None:
        motions = self.before.motion, self.after.motion
        pair = _shortened(*motions, reach_mm, self.allowed, self.gap_mm, self.context.kinematics)
        if pair is None:
            return None
        return _Passed(pair, self._slowed(pair, reach_mm), pair.reach_mm < self._reach(reach_mm))

    def _slowed(self, pair: _Pair, reach_mm: float) -> passing.Slowest | None:
        bare, a, b = (self.before, self.after), self.before.motion, self.after.motion
        rest = (
            b.offset_mm,
            b.length_mm,
            a.part,
            b.part,
            self.after.block.feed_mm_s,
            self.allowed,
            self.gap_mm,
        )
        name, found = name_of(a.surface, b.surface, *rest, reach_mm), _passed_on(self.context.machine)
        if name not in found:
            if len(found) >= MAX_KNOWN:
                found.clear()
            blended = _cuts(*bare, pair)
            found[name] = passing.slowest(blended, bare, pair.reach_mm, self.context)
        return found[name]

    def _reach(self, reach_mm: float) -> float:
        return max(min(reach_mm, SHARE * cut.motion.end) for cut in (self.before, self.after))


def _cuts(before: Cut, after: Cut, pair: _Pair) -> tuple[Cut, Cut]:
    first = replace(before, motion=pair.before, end=edge(pair.before, 1.0))
    return first, replace(after, motion=pair.after, start=edge(pair.after, 0.0))


def is_rounding(before: Cut, after: Cut, allowed: Tolerance) -> bool:
    """Whether rounding of the program explains how two cuts differ all along the ruling that they share.

    Surfaces that are meant to run on otherwise may agree at the contact and meet in a crease above it.
    Rounding turns the ways along u, and the normals, by as much as the ends of their first legs are off.
    """
    for share in ALONG_RULING:
        met = _Across.at(before.motion, after.motion, share)
        by_tangent, by_normal = (ROUNDED_MM * each for each in met.per_leg)
        if met.tangents_rad > max(allowed.rad, by_tangent) or met.normals_rad > max(allowed.rad, by_normal):
            return False
    return True


def crease(before: SurfaceCut, after: SurfaceCut) -> float:
    """Largest angle (rad) of the normals along the ruling that two cuts share."""
    return max(_Across.at(before, after, share).normals_rad for share in ALONG_RULING)


class _Across(NamedTuple):
    """How two surfaces differ at one point of the ruling that they share."""

    tangents_rad: float  # between the ways along u
    normals_rad: float
    per_leg: tuple[float, float]  # what a millimetre at their first control points turns ways and normals by

    @staticmethod
    def at(before: SurfaceCut, after: SurfaceCut, share: float) -> _Across:
        """``share`` of the ruling from its lower end."""
        ways, normals, along, across = [], [], 0.0, 0.0
        for motion, u in ((before, 1.0), (after, 0.0)):
            surface = placed(motion)
            (tangent, turn), ruling = surface.rates(u, math), surface.ruling(u)
            ways.append(add(tangent, scale(turn, share)))
            normals.append(cross(ways[-1], ruling))
            # A cubic's first leg is a third of its rate.
            along += CUBIC / max(norm(ways[-1]), TINY)
            across += CUBIC * norm(ruling) / max(norm(normals[-1]), TINY)
        a, b = float(angle_between(ways[0], ways[1])), float(angle_between(normals[0], normals[1]))
        return _Across(a, b, (along, across))


class Difference(Enum):
    """What two cuts differ by whose poses agree within a nanometre or two."""

    NONE = "none"
    ROUNDING = "rounding"  # of the program's decimals
    KINK = "kink"  # the axis or the normal turns at quite another rate: that is how the surfaces are meant


def difference(before: Cut, after: Cut, allowed: Tolerance) -> Difference:
    """Of poses and rates; a kink is one only where the poses agree to the last digit."""
    if allowed is EXACT:
        return Difference.NONE
    if max(apart(before.end.contact, after.start.contact), apart(before.end.tip, after.start.tip)) > MEANT_MM:
        return Difference.ROUNDING
    with np.errstate(all="ignore"):
        one, other = End.of(before.motion, False), End.of(after.motion, True)
    if not (one.sound and other.sound):
        return Difference.NONE
    step = np.abs(other.rows[1:] - one.rows[1:])
    turns = np.maximum(step[:, 3:].max(axis=1), step[:, :3].max(axis=1) / max(after.tool.radius_mm, 1.0))
    if turns.max() <= SMOOTH:
        return Difference.NONE
    alike = turns[0] * USEFUL_MM[0] <= ALIKE * allowed.rad
    return Difference.ROUNDING if alike else Difference.KINK


# ---- two motions -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Pair:
    """Both motions with a blend, and what it adds to the deviation from the surfaces."""

    before: SurfaceCut
    after: SurfaceCut
    reach_mm: float
    deviates_mm: float
    axis_too: bool


class _Choice(NamedTuple):
    """How long a blend is on either side, how it is rounded, whether the axis is, too, and what it costs."""

    reaches_mm: tuple[float, float]
    rounding: Rounding
    axis_too: bool
    deviates_mm: float

    @property
    def reach_mm(self) -> float:
        return max(self.reaches_mm)


_chosen: dict[str, _Choice | None] = {}  # a check comes to every joint twice: of a thousand not one is kept


@remembered(REMEMBERED)
def _shortened(
    before: SurfaceCut,
    after: SurfaceCut,
    reach_mm: float,
    allowed: Tolerance,
    gap_mm: float,
    kinematics: Kinematics,
) -> _Pair | None:
    """The longest blend of the two, up to ``reach_mm``, that adds no more than is ``allowed``.

    Beside a pole, where no blend of the axis is short enough, of the tip alone.
    """
    with np.errstate(all="ignore"):
        ends = End.of(before, False), End.of(after, True)
    if allowed.mm <= 0.0 or not all(end.sound for end in ends):
        return None
    rest = (before.offset_mm, before.part, after.part, reach_mm, allowed, gap_mm, kinematics.work_frame())
    name = name_of(before.surface, after.surface, after.offset_mm, *rest)
    if name not in _chosen:
        if len(_chosen) >= MAX_KNOWN:
            _chosen.clear()
        _chosen[name] = _sought(*ends, reach_mm, allowed, gap_mm, kinematics)
    choice = _chosen[name]
    if choice is None:
        return None
    pair = led_over(*ends, choice.reaches_mm, choice.rounding, choice.axis_too)
    return _Pair(*pair, choice.reach_mm, choice.deviates_mm, choice.axis_too)


def _sought(
    one: End, other: End, reach_mm: float, allowed: Tolerance, gap_mm: float, kinematics: Kinematics
) -> _Choice | None:
    creased = crease(one.motion, other.motion) > allowed.rad
    for axis_too in (True, False):
        search = _Search(one, other, reach_mm, allowed, gap_mm, kinematics, axis_too, creased)
        best = search.longest(Rounding.of(ROUNDINGS[0]))
        for rounding in map(Rounding.of, ROUNDINGS[1:]):
            if best is not None and min(best.reaches_mm) < reach_mm:
                best = search.better(best, rounding)
        if best is not None:
            return best
    return None


@dataclass(frozen=True, slots=True)
class _Search:
    """For the blend of two ends that bends least, reaches no further and adds no more than is allowed."""

    one: End
    other: End
    wanted_mm: float
    allowed: Tolerance
    gap_mm: float  # between both surfaces, across them
    kinematics: Kinematics
    axis_too: bool
    creased: bool

    @property
    def most_mm(self) -> float:
        """As far as it reaches, or as the cuts are long enough for."""
        return max(self._reaches(self.wanted_mm))

    def better(self, best: _Choice, rounding: Rounding) -> _Choice:
        """As ``rounding`` has it if that bends less, else ``best``."""
        as_good = best.reach_mm * math.sqrt(rounding.third / best.rounding.third)
        if as_good >= self.most_mm or self._added(as_good, rounding) > self.allowed.mm:
            return best
        return self.longest(rounding, as_good) or best

    def longest(self, rounding: Rounding, kept_mm: float = 0.0) -> _Choice | None:
        """The longest within the tolerance; that one of ``kept_mm`` is, is known."""
        found, short, long, reach = None, kept_mm, math.inf, self.most_mm
        for _ in range(TRIES):
            added = self._added(reach, rounding)
            if added <= self.allowed.mm:
                found, short = _Choice(self._reaches(reach), rounding, self.axis_too, added), reach
            else:
                long = reach
            if max(short, SHORTEST_MM) > CLOSE * long or math.isinf(long):
                break
            share = min(0.8, max(0.3, 0.95 * self.allowed.mm / added))
            reach = math.sqrt(short * long) if short else share * long
        return found

    def _reaches(self, reach_mm: float) -> tuple[float, float]:
        a, b = (min(reach_mm, SHARE * end.motion.end) for end in (self.one, self.other))
        return a, b

    def _added(self, reach_mm: float, rounding: Rounding) -> float:
        """What a blend adds to the deviation (mm); inf where the axis may not be led so."""
        one, other, reaches = self.one, self.other, self._reaches(reach_mm)
        blends = between(one, other, reaches, rounding)
        if not _is_clear(one.motion, other.motion, blends, self.axis_too, self.allowed.rad, self.kinematics):
            return math.inf
        looked = Looked.at(one.motion, other.motion, blends, reaches, self.creased)
        return looked.added(*led_over(one, other, reaches, rounding, self.axis_too), self.gap_mm)


def _is_clear(
    before: SurfaceCut,
    after: SurfaceCut,
    blends: tuple[Blend, Blend],
    axis_too: bool,
    allowed_rad: float,
    kinematics: Kinematics,
) -> bool:
    """Whether the axis may be changed or, without ``axis_too``, need not be.

    Beside a pole a rotary turns by far more than the axis, and whatever shifts the axis by a little
    might lead it past the pole instead of through it. There only the tip is blended, if the axes agree.
    """
    seen = [_axes(*one) for one in zip((before, after), blends, strict=True)]
    if not axis_too:
        return float(np.abs(seen[0][0][:, 0] - seen[1][0][:, 0]).max()) <= SAME_RAD
    change = max(float(np.abs(changed - plain).max()) for plain, changed in seen)
    clear = min(float(np.min(kinematics.off_pole(tuple(plain), np))) for plain, _ in seen)
    return clear > CLEAR_OF_POLE * change and change <= allowed_rad


def _axes(motion: SurfaceCut, blend: Blend) -> tuple[Array, Array]:
    """The axis from the joint as far as the blend reaches, without and with it, table frame, (3, N) each."""
    away = np.linspace(0.0, 1.0, 33) / blend.per_u
    u = away if blend.at_start else 1.0 - away
    pose = placed(motion).pose(u, motion.offset_mm, np)
    both = (pose.axis, blend.onto(pose, u, np).axis)
    plain, changed = (np.array([np.broadcast_to(c, u.shape) for c in motion.part.turn(a)]) for a in both)
    return plain, changed
