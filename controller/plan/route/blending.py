"""Joints of surfaces within a tolerance: the poses on both sides are led over into each other.

Programs have three to five decimals, so the rulings that two surfaces share agree but their normals
differ by hundredths of a degree. There the cutter would have to pivot, or would cut a nanometre into
one of the two. Instead both cuts are corrected next to the joint (``placement.Blend``) by half of what
their poses, and the first two derivatives of these over the length of the contact, differ by: they
come to the same pose at the same rates. What this leaves on the surfaces, or takes off them, is
computed point by point, and the blend made shorter until it is within the tolerance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial

from controller import jets
from controller.curves import Curve
from controller.geometry import Vector, add, angle_between, cross, dot, norm, scale, subtract, unit
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.motions import SurfaceCut
from controller.placement import Blend, Blended, Placed
from controller.plan.route import deviation
from controller.plan.route.cuts import MOST_KNOWN, REMEMBERED, SAME_RAD, Cut, apart, edge, turned
from controller.plan.route.placements import name_of
from controller.plan.text.program import Modal

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

USEFUL_S = 0.1  # a blend takes so long at the feed, on either side; longer ones ask less of no joint
USEFUL_MM = (1.0, 10.0)
SHARE = 0.45  # of a cut: both its ends may be blended
SHORTEST_MM = 0.02
TRIES = 10
USED = 0.9  # of what the tolerance leaves, for what lies between the points that are looked at
CLOSE = 0.85  # of the shortest blend that is too long: so near to it one is long enough
ROUNDINGS = (0.0594, 0.09, 0.12, 0.16)  # how far each stays away from a corner of slope 1 over its reach
CLEAR_OF_POLE = 10.0  # times the change of the axis: so far from the pole it hardly turns a rotary
NEARLY_UPPER = 0.99  # of the ruling
BESIDE = 1.25  # times the blend's own reach is looked at
MEANT_MM = 1e-9  # poses nearer than this are meant to be one
SMOOTH, ALIKE = 1e-9, 3.0  # rad within a millimetre; times the tolerance, within the same
_ALONG, _ACROSS = np.linspace(0.0, 1.0, 17), np.linspace(0.0, 1.0, 5)
_FURTHER = np.linspace(0.0, 1.0, 13)[1:] ** 2


class Tolerance(NamedTuple):
    """How far two surfaces may be apart and the blend may leave them (mm), and their turn (rad)."""

    mm: float
    rad: float


EXACT = Tolerance(1e-5, math.radians(1e-3))  # G61: the rounding of the program's own numbers


class Joint(NamedTuple):
    """Two cuts, blended: what they differed by, and what the blend costs."""

    before: Cut
    after: Cut
    angle_rad: float  # of the normals, at the contact
    crease_rad: float  # the same at the upper end of the ruling
    gap_mm: float
    reach_mm: float  # of the longer of both blends
    deviates_mm: float
    shortened: bool  # by the tolerance


def tolerance(before: Cut, after: Cut, machine: Machine) -> Tolerance:
    """What holds at the joint of two blocks: the tighter of both."""
    a, b = (_told(cut.block.modal, machine) for cut in (before, after))
    return EXACT if EXACT in (a, b) else Tolerance(min(a.mm, b.mm), min(a.rad, b.rad))


def _told(modal: Modal, machine: Machine) -> Tolerance:
    if modal.exact_joints:
        return EXACT
    degrees = modal.blend_deg or machine.joint_tolerance_deg
    return Tolerance(modal.blend_mm or machine.joint_tolerance_mm, math.radians(degrees))


def joined(before: Cut, after: Cut, allowed: Tolerance, kinematics: Kinematics) -> Joint | None:
    """The two cuts run through, if they meet within the tolerance and a blend keeps it."""
    end, start = before.end, after.start
    angle, gap = turned(end, start), apart(end.contact, start.contact)
    longest = max(norm(before.motion.surface.ruling(1.0)), norm(after.motion.surface.ruling(0.0)))
    tilt = apart(end.ruling, start.ruling)
    if max(abs(angle), tilt) > allowed.rad or max(gap, tilt * longest) > allowed.mm:
        return None
    step = subtract(start.contact, end.contact)
    upper = add(step, scale(subtract(start.ruling, end.ruling), longest))
    left = allowed.mm - max(abs(dot(step, end.out)), abs(dot(upper, end.out)))
    if after.side * angle < 0.0:  # a hollow: each of the two is cut by the other one's flank
        left -= after.tool.radius_mm * (1.0 - math.cos(angle))
    reach = min(max(USEFUL_S * after.block.feed_mm_s, USEFUL_MM[0]), USEFUL_MM[1])
    within = Tolerance(USED * left, allowed.rad)
    found = _shortened(before.motion, after.motion, reach, within, kinematics)
    if found is None:
        return None
    deviates = allowed.mm - left + found.deviates_mm
    first = replace(before, motion=found.before, end=edge(found.before, 1.0))
    second = replace(after, motion=found.after, start=edge(found.after, 0.0))
    most = max(min(reach, SHARE * cut.motion.end) for cut in (before, after))
    shortened = found.reach_mm < most
    return Joint(first, second, abs(angle), _crease(before, after), gap, found.reach_mm, deviates, shortened)


def _crease(before: Cut, after: Cut) -> float:
    """Angle (rad) of the normals at the upper end of the ruling: just below it, a cone may have a tip."""
    normals = []
    for motion, u in ((before.motion, 1.0), (after.motion, 0.0)):
        surface = _placed(motion)
        tangent, turn = surface.rates(u, math)
        normals.append(unit(cross(add(tangent, scale(turn, NEARLY_UPPER)), surface.ruling(u))))
    return float(angle_between(normals[0], normals[1]))


class Difference(Enum):
    """What two cuts differ by whose poses agree within a nanometre or two."""

    NONE = "none"
    ROUNDING = "of the program's decimals"
    KINK = "the axis or the normal turns at quite another rate: that is how the surfaces are meant"


def difference(before: Cut, after: Cut, allowed: Tolerance) -> Difference:
    """Of poses and rates; a kink is one only where the poses agree to the last digit."""
    if allowed is EXACT:
        return Difference.NONE
    if max(apart(before.end.contact, after.start.contact), apart(before.end.tip, after.start.tip)) > MEANT_MM:
        return Difference.ROUNDING
    with np.errstate(all="ignore"):
        one, other = _End.of(before.motion, False), _End.of(after.motion, True)
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


class _Rounding(NamedTuple):
    """A corner's rounding, (1 - x)^4 (a + (4 a - 1) x - 0.85 x^2), of slope -1 over x at the corner."""

    away: float  # a: how far it stays away from the corner
    bend: float  # its second derivative there
    third: float  # its largest third derivative

    @staticmethod
    @lru_cache
    def of(away: float) -> _Rounding:
        """The one of these forms whose third derivative is least for what it deviates by.

        With a = 0.0594 it swings past the corner by as much as it stays away from it: the least of all.
        Where a corner costs nothing on its inner side more is better.
        """
        shape = Polynomial([1.0, -1.0]) ** 4 * Polynomial([away, 4.0 * away - 1.0, -0.85])
        third = np.abs(shape.deriv(3)(np.linspace(0.0, 1.0, 101))).max()
        return _Rounding(away, float(shape.deriv(2)(0.0)), float(third))


class _Choice(NamedTuple):
    """How long a blend is on either side, how it is rounded, whether the axis is, too, and what it costs."""

    reaches_mm: tuple[float, float]
    rounding: _Rounding
    axis_too: bool
    deviates_mm: float

    @property
    def reach_mm(self) -> float:
        return max(self.reaches_mm)


_chosen: dict[str, _Choice | None] = {}  # a check comes to every joint twice: of a thousand not one is kept


@lru_cache(REMEMBERED)
def _shortened(
    before: SurfaceCut,
    after: SurfaceCut,
    reach_mm: float,
    allowed: Tolerance,
    kinematics: Kinematics,
) -> _Pair | None:
    """The longest blend of the two, up to ``reach_mm``, that adds no more than is ``allowed``.

    Beside a pole, where no blend of the axis is short enough, of the tip alone.
    """
    with np.errstate(all="ignore"):
        ends = _End.of(before, False), _End.of(after, True)
    if allowed.mm <= 0.0 or not all(end.sound for end in ends):
        return None
    rest = (before.offset_mm, before.part, after.part, reach_mm, allowed, kinematics.work_frame())
    name = name_of(before.surface, after.surface, after.offset_mm, *rest)
    if name not in _chosen:
        if len(_chosen) >= MOST_KNOWN:
            _chosen.clear()
        _chosen[name] = _sought(*ends, reach_mm, allowed, kinematics)
    choice = _chosen[name]
    if choice is None:
        return None
    pair = _led_over(*ends, choice.reaches_mm, choice.rounding, choice.axis_too)
    return _Pair(*pair, choice.reach_mm, choice.deviates_mm)


def _sought(
    one: _End, other: _End, reach_mm: float, allowed: Tolerance, kinematics: Kinematics
) -> _Choice | None:
    for axis_too in (True, False):
        search = _Search(one, other, reach_mm, allowed, kinematics, axis_too)
        best = search.longest(_Rounding.of(ROUNDINGS[0]))
        for rounding in map(_Rounding.of, ROUNDINGS[1:]):
            if best is not None and best.reach_mm < search.most_mm:
                best = search.better(best, rounding)
        if best is not None:
            return best
    return None


@dataclass(frozen=True, slots=True)
class _Search:
    """For the blend of two ends that bends least, reaches no further and adds no more than is allowed."""

    one: _End
    other: _End
    wanted_mm: float
    allowed: Tolerance
    kinematics: Kinematics
    axis_too: bool

    @property
    def most_mm(self) -> float:
        """As far as it reaches, or as the cuts are long enough for."""
        return max(self._reaches(self.wanted_mm))

    def better(self, best: _Choice, rounding: _Rounding) -> _Choice:
        """As ``rounding`` has it if that bends less, else ``best``."""
        as_good = best.reach_mm * math.sqrt(rounding.third / best.rounding.third)
        if as_good >= self.most_mm or self._added(as_good, rounding) > self.allowed.mm:
            return best
        return self.longest(rounding, as_good) or best

    def longest(self, rounding: _Rounding, kept_mm: float = 0.0) -> _Choice | None:
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

    def _added(self, reach_mm: float, rounding: _Rounding) -> float:
        """What a blend adds to the deviation (mm); inf where the axis may not be led so."""
        one, other, reaches = self.one, self.other, self._reaches(reach_mm)
        blends = _blends(one, other, reaches, rounding)
        if not _is_clear(one.motion, other.motion, blends, self.axis_too, self.allowed.rad, self.kinematics):
            return math.inf
        looked = _Looked.at(one.motion, other.motion, blends, reaches)
        return looked.added(*_led_over(one, other, reaches, rounding, self.axis_too))


def _blends(
    one: _End, other: _End, reaches_mm: tuple[float, float], rounding: _Rounding
) -> tuple[Blend, Blend]:
    """Each of both ends is led over by half of what they differ by.

    Where their rates differ the way is rounded as a corner is.
    """
    half, reach = 0.5 * (other.rows - one.rows), min(reaches_mm)
    rounded = np.outer((rounding.away * reach, 0.0, rounding.bend / reach), half[1])
    return one.blend(rounded + half, reaches_mm[0]), other.blend(rounded - half, reaches_mm[1])


def _led_over(
    one: _End, other: _End, reaches_mm: tuple[float, float], rounding: _Rounding, axis_too: bool
) -> tuple[SurfaceCut, SurfaceCut]:
    first, second = (
        blend if axis_too else replace(blend, axis=None)
        for blend in _blends(one, other, reaches_mm, rounding)
    )
    return _with(one.motion, first), _with(other.motion, second)


@dataclass(frozen=True, slots=True)
class _End:
    """Tip and axis at one end of a cut with two derivatives: ``rows`` (3, 6), over s.

    ``rate`` and ``bend`` are the first two derivatives of u over s there.
    """

    motion: SurfaceCut
    at_start: bool
    rows: Array
    rate: float
    bend: float

    @staticmethod
    def of(motion: SurfaceCut, at_start: bool) -> _End:
        u = in_arc_length(motion.surface.lower, np.array([0.0 if at_start else 1.0]))
        tip, axis = motion.surface.pose(u, motion.offset_mm, jets)
        parts = [jets.jet(value) for value in (*tip, *axis)]
        rows = np.array([[part.derivative(k).item() for part in parts] for k in range(3)])
        return _End(motion, at_start, rows, u.derivative(1).item(), u.derivative(2).item())

    @property
    def sound(self) -> bool:
        """Whether there are derivatives: not where C1 stands still."""
        return bool(np.isfinite(self.rows).all() and math.isfinite(self.bend) and self.rate > 0.0)

    def blend(self, rows: Array, reach_mm: float) -> Blend:
        """What adds ``rows`` (over s) at this end and is gone ``reach_mm`` from it."""
        arc = self.motion.arc
        width = arc.u_at(reach_mm) if self.at_start else 1.0 - arc.u_at(arc.length_mm - reach_mm)
        per_u = rows[1] / self.rate
        first = (width if self.at_start else -width) * per_u
        second = width * width * (rows[2] - per_u * self.bend) / self.rate**2
        a = rows[0]
        b = first + 4.0 * a
        c = 0.5 * second + 4.0 * b - 6.0 * a
        tip, axis = ((_vector(a[k]), _vector(b[k]), _vector(c[k])) for k in (slice(0, 3), slice(3, 6)))
        return Blend(self.at_start, 1.0 / width, tip, axis)


def _vector(row: Array) -> Vector:
    x, y, z = (float(value) for value in row)
    return x, y, z


def in_arc_length(lower: Curve, u: Array) -> jets.Jet:
    """u as a series in arc length: the reversion of s(u), whose rate is abs(C1')."""
    rate = lower.derivative(jets.variable(u), 1, jets)
    b = jets.sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]).c
    b1, b2, b3 = (np.broadcast_to(b[k] / (k + 1.0), u.shape) for k in range(3))  # a line's rate is one number
    return jets.Jet(np.stack([u, 1.0 / b1, -b2 / b1**3, (2.0 * b2 * b2 - b1 * b3) / b1**5]))


def _placed(motion: SurfaceCut) -> Placed:
    surface = motion.surface
    return surface if isinstance(surface, Placed) else Placed(surface, motion.offset_mm)


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
    pose = _placed(motion).pose(u, motion.offset_mm, np)
    both = (pose.axis, blend.onto(pose, u, np).axis)
    plain, changed = (np.array([np.broadcast_to(c, u.shape) for c in motion.part.turn(a)]) for a in both)
    return plain, changed


def _with(motion: SurfaceCut, blend: Blend) -> SurfaceCut:
    touches = motion.touches
    if blend.axis is not None:  # there it is another axis than the touches tell
        low, high = (1.0 / blend.per_u, 1.0) if blend.at_start else (0.0, 1.0 - 1.0 / blend.per_u)
        shorter = (t._replace(low=max(t.low, low), high=min(t.high, high)) for t in touches)
        touches = tuple(t for t in shorter if t.low < t.high)
    return replace(motion, surface=Blended.of(_placed(motion), blend), touches=touches)


# ---- what it costs -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Looked:
    """Points (3, N) of both surfaces beside a joint, and how far each of both flanks is from them."""

    points: Array
    own: tuple[Mask, Mask]  # of each flank: which of the points are on its own surface, (N,)
    flanks: tuple[Placed, Placed]
    seen: tuple[deviation.Deviation, deviation.Deviation]

    @staticmethod
    def at(
        before: SurfaceCut, after: SurfaceCut, blends: tuple[Blend, Blend], reaches_mm: tuple[float, float]
    ) -> _Looked:
        flanks = _placed(before), _placed(after)
        sides = [_beside(*one) for one in zip(flanks, blends, reaches_mm, strict=True)]
        points = np.concatenate(sides, axis=1)
        first = np.arange(points.shape[1]) < sides[0].shape[1]
        seen = deviation.of(flanks[0], points), deviation.of(flanks[1], points)
        return _Looked(points, (first, ~first), flanks, seen)

    def added(self, before: SurfaceCut, after: SurfaceCut) -> float:
        """The most (mm) that is cut deeper, or left, or that the cutter's end leaves the lower edge."""
        flanks = _placed(before), _placed(after)
        now = [_left(*one, self.points) for one in zip(flanks, self.seen, strict=True)]
        left = np.minimum(*now)
        own = np.where(self.own[0], self.seen[0].left, self.seen[1].left)
        deeper = np.minimum(self.seen[0].left, self.seen[1].left) - left
        worst = max(float(deeper.max()), float((left - own).max()))
        for plain, blended, seen, mine in zip(self.flanks, flanks, self.seen, self.own, strict=True):
            worst = max(worst, _off_edge(plain, blended, seen.at_u[mine]))
        return worst


def _left(flank: Placed, seen: deviation.Deviation, points: Array) -> Array:
    """What a blended flank leaves: sought where it was nearest without the blend, and in the blend itself."""
    assert isinstance(flank, Blended)
    blend = flank.blends[-1]
    within = np.full(points.shape[1], 0.3 / blend.per_u if blend.at_start else 1.0 - 0.3 / blend.per_u)
    starts = np.concatenate((seen.at_u, within))
    return np.asarray(deviation.of(flank, np.tile(points, 2), starts).left.reshape(2, -1).min(axis=0))


def _beside(flank: Placed, blend: Blend, reach_mm: float) -> Array:
    """Points (3, N) of a surface at the joint, as far as its blend reaches, and a radius further.

    A twisted surface is touched as far as that beside the ruling at which the cutter stands.
    """
    further = BESIDE + _FURTHER * abs(flank.offset_mm) / reach_mm
    away = np.minimum(np.concatenate((BESIDE * _ALONG, further)) / blend.per_u, 1.0)
    u, v = (one.ravel() for one in np.meshgrid(away if blend.at_start else 1.0 - away, _ACROSS))
    return deviation.points(flank, u, v)


def _off_edge(plain: Placed, blended: Placed, u: Array) -> float:
    """How far (mm) the end of the cutter leaves the lower edge of the surface, along its axis.

    Beside the contact: a cutter that leans more about it goes up on its far side, as the surface has it.
    """
    a, b = (flank.pose(u, flank.offset_mm, np) for flank in (plain, blended))
    contact = plain.contact(u, np)
    heights = [dot(subtract(contact, pose.tip), pose.axis) for pose in (a, b)]
    return float(np.abs(heights[1] - heights[0]).max())
