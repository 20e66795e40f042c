"""What leads one cut over into the next: corrections beside a joint, and what they leave on the surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from controller.geometry import series
from controller.geometry.arrays import Array, Flags, rows
from controller.geometry.curves import Curve
from controller.geometry.placement import Blend, Blended, Placed
from controller.geometry.vectors import Vector, add, dot, rotate, subtract, unit
from controller.memory import remembered
from controller.motion.motions import SurfaceCut
from controller.plan.surfaces import deviation

Reaches = tuple[float, float]  # of the blends before and behind the joint, mm

BESIDE = 1.25  # times the blend's own reach is looked at
_ALONG, _ACROSS = np.linspace(0.0, 1.0, 17), np.linspace(0.0, 1.0, 5)
_SIDE = np.linspace(0.0, 1.0, 41)
EVEN = 0.97  # blends whose reaches differ by less are alike
MIN_RATIO = 0.02  # of the shorter reach to the longer one
_FURTHER, _FURTHER_IN_CORNER, _FURTHER_AT_CREASE = (
    np.linspace(0.0, 1.0, count)[1:] ** 2 for count in (13, 41, 97)
)
_IN_CORNER = np.linspace(0.0, 2.0, 9)  # times the angle and the radius: at 1 a flat surface is cut deepest


class Rounding(NamedTuple):
    """A corner's rounding, (1 - x)^4 (a + (4 a - 1) x - 0.85 x^2), of slope -1 over x at the corner."""

    away: float  # a: how far it stays away from the corner
    bend: float  # its second derivative there
    third: float  # its largest third derivative

    @staticmethod
    @lru_cache
    def of(away: float) -> Rounding:
        """The one of these forms whose third derivative is least for what it deviates by.

        With a = 0.0594 it swings past the corner by as much as it stays away from it: the least of all.
        Where a corner costs nothing on its inner side more is better.
        """
        shape = Polynomial([1.0, -1.0]) ** 4 * Polynomial([away, 4.0 * away - 1.0, -0.85])
        third = np.abs(shape.deriv(3)(np.linspace(0.0, 1.0, 101))).max()
        return Rounding(away, float(shape.deriv(2)(0.0)), float(third))


class Uneven(NamedTuple):
    """A corner whose two sides reach differently far: for a step of the rate of 1, over the longer reach."""

    share: float  # of the step, that the longer side takes
    away: float
    bend: float

    @staticmethod
    @lru_cache
    def of(shorter: float, away: float) -> Uneven:
        """That of the least third derivative which deviates no more than the even rounding, ``away``.

        ``shorter``: of both reaches, over the longer one. Both sides are (1 - x)^4 (a + b x + c x^2) with one
        place and one bend at the corner: linear in these and in the share, so a linear program finds them.
        """
        from scipy.optimize import linprog  # takes as long to import as a small program to plan

        none, rows, most = np.zeros(3), list[Array](), list[Array]()
        for reach, rate in ((1.0, np.array([0.0, -1.0])), (shorter, np.array([-1.0, 1.0]))):
            fixed = _side(reach, np.append(rate[0], none[:2]))
            parts = [_side(reach, one) for one in (np.append(rate[1], none[:2]), *np.eye(3)[1:])]
            for order, size in ((3, reach**3), (0, 1.0)):
                values = np.array([one.deriv(order)(_SIDE) / size for one in (fixed, *parts)])
                bound = np.full(len(_SIDE), -1.0 if order else 0.0)
                for sign in (1.0, -1.0):
                    rows.append(np.column_stack([*(sign * values[1:]), bound]))
                    most.append((0.0 if order else 0.5 * away) - sign * values[0])
        bounds = [(0.0, 1.0), (None, None), (None, None), (0.0, None)]
        found = linprog([0.0, 0.0, 0.0, 1.0], np.vstack(rows), np.concatenate(most), bounds=bounds).x
        return Uneven(*(float(value) for value in found[:3]))


def _side(reach: float, rate_place_bend: Array) -> Polynomial:
    """What leads a side over, x from the corner, with so much at it; a rate that falls towards x = 1."""
    rate, a, bend = rate_place_bend
    b = reach * rate + 4.0 * a
    return Polynomial([1.0, -1.0]) ** 4 * Polynomial([a, b, 0.5 * reach * reach * bend + 4.0 * b - 6.0 * a])


def between(one: End, other: End, reaches_mm: Reaches, rounding: Rounding) -> tuple[Blend, Blend]:
    """Each of both ends is led over by half of what they differ by; the one that reaches less, by less.

    Where their rates differ the way is rounded as a corner is.
    """
    step, reach, ratio = other.rows - one.rows, max(reaches_mm), min(reaches_mm) / max(reaches_mm)
    corner = Uneven(0.5, 0.5 * rounding.away, 0.5 * rounding.bend)
    if ratio < EVEN:
        corner = Uneven.of(max(round(ratio, 2), MIN_RATIO), rounding.away)
    # A step of the place takes third derivatives as 1 / reach^3, one of the bend as 1 / reach.
    longer = np.array([[1.0 / (1.0 + ratio**3)], [corner.share], [1.0 / (1.0 + ratio)]])
    first = longer if reaches_mm[0] == reach else 1.0 - longer
    rounded = np.outer((corner.away * reach, 0.0, corner.bend / reach), step[1])
    before, after = rounded + first * step, rounded - (1.0 - first) * step
    return one.blend(before, reaches_mm[0]), other.blend(after, reaches_mm[1])


def led_over(
    one: End, other: End, reaches_mm: Reaches, rounding: Rounding, axis_too: bool
) -> tuple[SurfaceCut, SurfaceCut]:
    """Both cuts with their blends, without ``axis_too`` of the tip alone."""
    first, second = (
        blend if axis_too else replace(blend, axis=None)
        for blend in between(one, other, reaches_mm, rounding)
    )
    return with_blend(one.motion, first), with_blend(other.motion, second)


@dataclass(frozen=True, slots=True)
class End:
    """Tip and axis at one end of a cut with two derivatives: ``rows`` (3, 6), over s.

    ``rate`` and ``bend`` are the first two derivatives of u over s there.
    """

    motion: SurfaceCut
    at_start: bool
    rows: Array
    rate: float
    bend: float

    @staticmethod
    def of(motion: SurfaceCut, at_start: bool) -> End:
        u = in_arc_length(motion.surface.lower, np.array([0.0 if at_start else 1.0]))
        tip, axis = motion.surface.pose(u, motion.offset_mm, series)
        parts = [series.jet(value) for value in (*tip, *axis)]
        rows = np.array([[part.derivative(k).item() for part in parts] for k in range(3)])
        return End(motion, at_start, rows, u.derivative(1).item(), u.derivative(2).item())

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


def in_arc_length(lower: Curve, u: Array) -> series.Jet:
    """u as a series in arc length: the reversion of s(u), whose rate is abs(C1')."""
    rate = lower.derivative(series.variable(u), 1, series)
    b = series.sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]).c
    b1, b2, b3 = (np.broadcast_to(b[k] / (k + 1.0), u.shape) for k in range(3))  # a line's rate is one number
    return series.Jet(np.stack([u, 1.0 / b1, -b2 / b1**3, (2.0 * b2 * b2 - b1 * b3) / b1**5]))


def placed(motion: SurfaceCut) -> Placed:
    surface = motion.surface
    return surface if isinstance(surface, Placed) else Placed(surface, motion.offset_mm)


def with_blend(motion: SurfaceCut, blend: Blend) -> SurfaceCut:
    touches = motion.touches
    if blend.axis is not None:  # there it is another axis than the touches tell
        low, high = (1.0 / blend.per_u, 1.0) if blend.at_start else (0.0, 1.0 - 1.0 / blend.per_u)
        shorter = (t._replace(low=max(t.low, low), high=min(t.high, high)) for t in touches)
        touches = tuple(t for t in shorter if t.low < t.high)
    return replace(motion, surface=Blended.of(placed(motion), blend), touches=touches)


# ---- what it costs -------------------------------------------------------------------


@remembered(256)  # a check comes to every joint twice
def overcut(before: SurfaceCut, after: SurfaceCut, angle_rad: float) -> float:
    """How deep (mm) each of two cuts gets into the other one's surface, for the normals turn by an angle.

    Beside the joint, as far as the cutter's radius, and beyond what would be taken there if the other one
    ran on without a corner: on a twisted surface that is more than its own cut takes.
    """
    flanks, deepest = (placed(before), placed(after)), 0.0
    edge, ruling = flanks[0].contact(1.0), unit(flanks[0].ruling(1.0))
    for own, other, motion, at_end in ((*flanks, before, True), (*flanks[::-1], after, False)):
        radius = abs(motion.offset_mm)
        s = np.minimum(radius * np.concatenate((_IN_CORNER * abs(angle_rad), _FURTHER_IN_CORNER)), motion.end)
        at = motion.arc.u_along(motion.end - s if at_end else s)
        points = deviation.points(own, *(one.ravel() for one in np.meshgrid(at, _ACROSS)))
        x, y, z = points
        from_edge = subtract((x, y, z), edge)
        run_on = add(edge, rotate(ruling, angle_rad if at_end else -angle_rad, from_edge))
        smooth = np.minimum(
            deviation.of(own, points).left, deviation.of(other, rows(run_on, points.shape[1:])).left
        )
        deepest = max(deepest, float((smooth - deviation.of(other, points).left).max()))
    return deepest


@dataclass(frozen=True, slots=True)
class Looked:
    """Points (3, N) of both surfaces beside a joint, and how far each of both flanks is from them."""

    points: Array
    own: tuple[Flags, Flags]  # of each flank: which of the points are on its own surface, (N,)
    flanks: tuple[Placed, Placed]
    seen: tuple[deviation.Deviation, deviation.Deviation]

    @staticmethod
    def at(
        before: SurfaceCut,
        after: SurfaceCut,
        blends: tuple[Blend, Blend],
        reaches_mm: Reaches,
        creased: bool = False,
    ) -> Looked:
        """``creased``: what the tool's turn there reaches ends abruptly somewhere beside the joint."""
        flanks = placed(before), placed(after)
        spread = _FURTHER_AT_CREASE if creased else _FURTHER
        sides = [_beside(*one, spread) for one in zip(flanks, blends, reaches_mm, strict=True)]
        points = np.concatenate(sides, axis=1)
        first = np.arange(points.shape[1]) < sides[0].shape[1]
        seen = deviation.of(flanks[0], points), deviation.of(flanks[1], points)
        return Looked(points, (first, ~first), flanks, seen)

    def added(self, before: SurfaceCut, after: SurfaceCut, gap_mm: float = 0.0) -> float:
        """The most (mm) that is cut deeper, or left, or that the cutter's end leaves the lower edge.

        What either cut costs the other one's surface as it is counts only where the gap between them does it.
        """
        flanks = placed(before), placed(after)
        now = [_left(*one, self.points) for one in zip(flanks, self.seen, strict=True)]
        left = np.minimum(*now)
        first, second = (seen.left for seen in self.seen)
        own, other = np.where(self.own[0], (first, second), (second, first))
        deeper = np.minimum(own, other + gap_mm) - left
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


def _beside(flank: Placed, blend: Blend, reach_mm: float, spread: Array) -> Array:
    """Points (3, N) of a surface at the joint, as far as its blend reaches, and a radius further.

    A twisted surface is touched as far as that beside the ruling at which the cutter stands.
    """
    further = BESIDE + spread * abs(flank.offset_mm) / reach_mm
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
