"""The axis that leaves a row of joined surfaces least off: free of their rulings, normals and knots.

The axis goes through two curves (``axis_curves``). What its flank leaves of a point of the surface is known
to the first order in their control points:

    deviation at point i  ~  y_i + J_i x

for a nearest position is nearest: its own shift along the path counts in the second. Steps by Gauss and
Newton make the sum of squares least first, then the largest deviation, with a small price on bends; a step
counts only if the true deviation falls. The search goes from few spans to as many as still gain, from several
starts: the axes that the other placements have, and those of thinner cutters, which follow the ruling and
grow. A result whose axis lies on the other side of the surface anywhere is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags, rows
from controller.geometry.placement import Barrel, Placed
from controller.geometry.vectors import Pose
from controller.plan.surfaces import deviation
from controller.plan.surfaces.axis_curves import Basis, turn_of
from controller.plan.surfaces.banded_rows import Banded, Rows, least_largest, least_squares

Index = npt.NDArray[np.intp]

SPANS, PER_RAD = 8, 3.0  # the first, and those for a radian by which an edge or the ruling turns, if more
FINER = (2, 4)  # times as many are tried in turn
MAX_SPANS = 64
REACH_SPANS = 8  # so far along from its own ruling a point may be cut
GAIN = 0.05  # share of the deviation that more spans must gain, or there are no more
PER_SPAN, ACROSS = 5, 13  # points of the surface that are looked at
ALONG = 65  # at least
FITTED = 7  # poses a span to which a start is fitted
FIT_PRICE = 1e-14  # of the same in the fit of a start, against squared distances
BEND_PRICE = 1e-11  # of the third derivatives squared (over t of 0 to 1), against squared deviations
MAX_START_PRICE = 1e-6  # mm^2: of the start that bends least; edges that bend more are no fault of the axis
DRIFT_PRICE = 1e-12  # of a step squared
SQUARES, LARGEST = 25, 40  # steps at most
WITHIN_MM = 0.5  # other contacts that leave more are not looked at
END = 0.02  # share of t at either end that is not inside
FINE = (161, 25)  # points along and across at which a result is judged
EXCHANGES, BETWEEN = 5, 0.01  # share of the largest deviation that may be more between the points
FAR = 4.0  # times the least mean square: a start that has come to more is left
ALIKE = 0.02  # share of the mean square by which starts differ that have come to another place
MAX_DAMPING = 1e3
SETTLED = 2e-4  # gain of a step, as a share, below which steps end
UNKNOWNS = 4  # of a control point of either curve: two ways across the axis each
EDGE = 161  # points of C1 of each surface, where the height of the tip is seen
LEVEL_SPANS = (2, 4, 8)  # times as many spans for the curves that also keep it
LEVEL_PRICE = 1e-7  # of bends of that height
SAME_MM = 2e-5
MIN_COSINE = 0.3  # of the way from a point to the axis and its normal
BELOW_UPPER = 0.02  # of the ruling: at C0 itself there may be no normal
GROWN = (0.25, 0.5, 0.75, 1.0)  # of the cutter's radius


_ALL = slice(None)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points of a row of surfaces at which placements of it are compared."""

    at: Array  # (3, N)
    normals: Array  # (3, N), to the cutter's side
    t: Array  # (N,) of their own rulings

    @staticmethod
    def of(placed: Sequence[Placed], tops: Array, along: int, across: int = ACROSS) -> Points:
        """About ``along`` rulings of all, closer at the ends of each surface; ``tops``: t at those ends."""
        found: list[tuple[Array, Array, Array]] = []
        for k, one in enumerate(placed):
            share = float(tops[k + 1] - tops[k])
            grid = np.meshgrid(_cosine(max(9, round(along * share))), _cosine(across), indexing="ij")
            u, v = (each.ravel() for each in grid)
            found.append((deviation.points(one, u, v), deviation.normals(one, u, v), tops[k] + share * u))
        return Points(*(np.concatenate(each, axis=-1) for each in zip(*found, strict=True)))

    def per_normal(self, seen: deviation.Deviation, of: Index | slice = _ALL) -> Array:
        """What a millimetre to the axis is along the normals of these points, or of those ``of``: (M,)."""
        cosine = np.abs((seen.away * self.normals[:, of]).sum(axis=0))
        return np.asarray(1.0 / np.maximum(cosine, MIN_COSINE))

    def with_those(self, other: Points, which: Flags) -> Points:
        """These, and some others'."""
        both = zip((self.at, self.normals, self.t), (other.at, other.normals, other.t), strict=True)
        return Points(*(np.concatenate((own, more[..., which]), axis=-1) for own, more in both))


def _cosine(n: int) -> Array:
    return np.asarray(0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, n)))


@dataclass(frozen=True, slots=True, eq=False)
class _Axis:
    """Both curves by their control points, and what their flank leaves of some points."""

    single: Placed  # offset, taper and shift
    basis: Basis
    upper: Array  # (size, 3)
    lower: Array
    per_bend: float  # of the price of bends

    @property
    def offset_mm(self) -> float:
        return self.single.offset_mm

    @property
    def taper_rad(self) -> float:
        return self.single.taper_rad

    @property
    def shift_mm(self) -> float:
        return self.single.shift_mm

    @property
    def barrel(self) -> Barrel | None:
        return self.single.barrel

    def pose(self, t: Array, offset_mm: float, m: ModuleType) -> Pose:
        """As ``Placed.pose``, over t of the whole row."""
        upper, lower = self.at(t)
        axis = _unit(upper - lower)
        tip = lower - self.shift_mm * axis
        return Pose((tip[:, 0], tip[:, 1], tip[:, 2]), (axis[:, 0], axis[:, 1], axis[:, 2]))

    def at(self, t: Array) -> tuple[Array, Array]:
        """Points of the upper and of the lower curve, (N, 3) each."""
        both = self.basis.at(t, np.concatenate((self.upper, self.lower), axis=1))
        return both[:, :3], both[:, 3:]

    def moved(self, x: Array, ways: Array) -> _Axis:
        """By ``x`` (4 size,) along ``ways`` (size, 2, 3)."""
        steps = x.reshape(-1, UNKNOWNS)
        upper = self.upper + np.einsum("gk,gkc->gc", steps[:, :2], ways)
        lower = self.lower + np.einsum("gk,gkc->gc", steps[:, 2:], ways)
        return replace(self, upper=upper, lower=lower)

    def ways(self) -> Array:
        """Two unit vectors across the axis at each control point: (size, 2, 3)."""
        basis = self.basis
        axis = _unit(basis.at(basis.places, self.upper - self.lower))
        inside = np.clip(basis.places, 1e-9, 1.0 - 1e-9)
        travel = basis.at(inside, self.upper + self.lower, 1)
        out = _unit(np.cross(travel, axis))
        return np.stack([out, np.cross(axis, out)], axis=1)

    def slopes(self, now: _Seen, ways: Array) -> Rows:
        """How the deviation at each contact changes with the control points."""
        basis, seen = self.basis, now.found.seen
        values, first = basis.values(seen.at_u)
        at = first[:, None] + np.arange(basis.width)
        between = np.einsum("nw,nwc->nc", values, (self.upper - self.lower)[at])
        long = np.sqrt((between * between).sum(axis=1))
        height = seen.height - self.shift_mm
        across, cosine, tangent = self._leans(seen)
        high, away = (height / long)[:, None], seen.away.T
        leans = tangent * across[:, None] / long[:, None] * away
        by_upper = cosine * (high * away + leans)
        by_lower = cosine * ((1.0 - high) * away - leans + tangent * between / long[:, None])
        ways = ways[at]
        each = [np.einsum("nc,nwkc->nwk", by, ways) for by in (by_upper, by_lower)]
        made = (now.per[:, None] * values)[:, :, None] * np.concatenate(each, axis=2)
        return Rows.of(made.reshape(len(made), -1), UNKNOWNS * first, UNKNOWNS * basis.size)

    def _leans(self, seen: deviation.Deviation) -> tuple[Array, Array | float, Array | float]:
        """Distance (N,) of contacts from the axis; cosine and tangent of the flank's lean there.

        Of a barrel they are those of its arc, (N, 1); else those of the cone.
        """
        cosine, tangent = math.cos(self.taper_rad), math.tan(self.taper_rad)
        out = abs(self.offset_mm) - self.shift_mm * tangent  # of the cone, at the tip
        if self.barrel is None:
            return seen.left / cosine + out + seen.height * tangent, cosine, tangent
        radius, middle = self.barrel
        away = radius + seen.left
        sine = (middle - seen.height + radius * math.sin(self.taper_rad)) / away
        there = np.sqrt(1.0 - sine * sine)
        across = out + middle * tangent - radius * cosine + away * there
        return across, there[:, None], (sine / there)[:, None]

    def price(self, ways: Array) -> tuple[Banded, Array]:
        """What bends cost, and its pull on the curves as they are."""
        basis = self.basis
        values, first, weights = basis.bending()
        at = first[:, None] + np.arange(basis.width)
        made = np.zeros((2, 3, len(values), basis.width, UNKNOWNS))
        for k in (0, 1):
            each = values[:, :, None, None] * ways[at]
            made[k, ..., 2 * k : 2 * k + 2] = np.moveaxis(each, -1, 0)
        third = [np.einsum("nw,nwc->cn", values, points[at]) for points in (self.upper, self.lower)]
        rows = made.reshape(6 * len(values), -1)
        bends = Rows.of(rows, np.tile(UNKNOWNS * first, 6), UNKNOWNS * basis.size)
        weights = BEND_PRICE * self.per_bend * np.tile(weights, 6)
        pull = bends.transposed(weights * np.concatenate(third).ravel())
        return bends.squares(weights).scaled(1.0, DRIFT_PRICE), pull

    @property
    def bends(self) -> float:
        """The integral of both third derivatives squared, over t of the whole row."""
        values, first, weights = self.basis.bending()
        at = first[:, None] + np.arange(self.basis.width)
        thirds = (np.einsum("nw,nwc->nc", values, points[at]) for points in (self.upper, self.lower))
        return float(sum((weights[:, None] * third * third).sum() for third in thirds))


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.sqrt((v * v).sum(axis=-1, keepdims=True)), 1e-300))


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """All contacts of an axis with some points."""

    found: deviation.Contacts
    per: Array  # (M,) see ``Points.per_normal``

    @staticmethod
    def of(axis: _Axis, points: Points) -> _Seen:
        reach = REACH_SPANS / len(axis.basis.starts)
        found = deviation.contacts(axis, points.at, WITHIN_MM, points.t, reach)
        return _Seen(found, points.per_normal(found.seen, found.of))

    @property
    def left(self) -> Array:
        """(M,) mm, along the normals."""
        return self.found.seen.left * self.per

    @property
    def of_points(self) -> Array:
        """(N,) where the flank comes nearest."""
        nearest = self.found.nearest
        found = np.empty(int(nearest.sum()))
        found[self.found.of[nearest]] = self.left[nearest]
        return found


class Found(NamedTuple):
    """A row of surfaces with their axis, and how far off it leaves them, along their normals."""

    placed: tuple[Placed, ...]
    inner_mm: float  # but for the ends of the row
    whole_mm: float

    @property
    def off_mm(self) -> tuple[float, float]:
        return self.inner_mm, self.whole_mm


def best(singles: Sequence[Placed], starts: Sequence[Sequence[Placed]]) -> Found | None:
    """The best axis that is found for a row of joined surfaces, each placed as the paper does.

    ``starts``: the same as other placements have it. None where no axis is on the right side, or the curves
    cannot be fitted to any.
    """
    try:
        with np.errstate(all="ignore"):
            return _Search(singles).best(starts)
    except np.linalg.LinAlgError:
        return None


class _Search:
    """For the axis of a row of surfaces, each with the paper's placement of the cutter."""

    def __init__(self, singles: Sequence[Placed]) -> None:
        self._singles = singles
        self._surfaces = [one.base for one in singles]
        turned = math.ceil(PER_RAD * turn_of(self._surfaces))
        self._fewest = min(max(SPANS, turned), MAX_SPANS)
        self._per_bend = (SPANS / self._fewest) ** 6  # bends are as steep as the surface is long

    def best(self, starts: Sequence[Sequence[Placed]]) -> Found | None:
        """As ``best``; raises LinAlgError."""
        fewest = self._fewest
        basis = Basis.over(self._surfaces, fewest)
        points = self._points(basis)
        bends = min(self._start(placed, basis).bends for placed in starts)
        self._per_bend = min(self._per_bend, MAX_START_PRICE / max(BEND_PRICE * bends, 1e-30))
        sound = [one for one in self._starts(basis, starts, points) if self._is_right(one[0], points)]
        tried = [self._steps(axis, points, _largest) for axis in _different(sound)]
        right = [one for one in tried if self._is_right(one[0], points)]
        if not right:
            return None
        best, least = self._settled(min(right, key=itemgetter(1))[0], points)
        for spans in (times * fewest for times in FINER if times * fewest <= MAX_SPANS):
            basis = Basis.over(self._surfaces, spans)
            start = _fitted(best.single, basis, _poses_of(best, basis), self._per_bend)
            axis, size = self._settled(start, self._points(basis))
            gained = least - size
            if gained > 0.0 and self._is_right(axis, points):
                best, least = axis, size
            if gained < GAIN * size:
                break
        best = self._levelled(best, least)
        if not self._is_right(best, points):
            return None
        parts = enumerate(self._singles)
        placed = (
            replace(one, through=(best.basis.part(k, best.upper), best.basis.part(k, best.lower)))
            for k, one in parts
        )
        fine, left = self._judging(best)
        inside = np.abs(fine.t - 0.5) <= 0.5 - END
        return Found(tuple(placed), float(left[inside].max()), float(left.max()))

    def _levelled(self, axis: _Axis, size: float) -> _Axis:
        """The same axis, the lower curve where its foot of what it cuts of C1 is: there the tip belongs.

        Not of a taper or a barrel, which would become thicker where it slides along itself.
        """
        if axis.taper_rad != 0.0 or axis.barrel is not None:
            return axis
        u = _cosine(EDGE)
        edges = [deviation.points(one, u, np.ones(u.shape)) for one in self._singles]
        seen = deviation.of(axis, np.concatenate(edges, axis=1))
        height = seen.height - axis.shift_mm
        up = _fit(axis.basis, seen.at_u, height[:, None], LEVEL_PRICE * axis.per_bend)
        for more in LEVEL_SPANS:
            basis = Basis.over(self._surfaces, more * len(axis.basis.starts))
            t, upper, lower = _poses_of(axis, basis)
            along = axis.basis.at(t, up)
            if float(np.abs(along).max()) > 2.0 * float(np.abs(height).max()):
                break  # where nothing of C1 is cut the height runs away
            level = lower + along * _unit(upper - lower)
            made = _fitted(axis.single, basis, (t, upper, level), axis.per_bend)
            if self._judged(made) <= size + SAME_MM:
                return made
        return axis

    def _points(self, basis: Basis) -> Points:
        return Points.of(self._singles, basis.tops, max(ALONG, PER_SPAN * len(basis.starts)))

    def _starts(
        self, basis: Basis, starts: Sequence[Sequence[Placed]], points: Points
    ) -> Iterator[tuple[_Axis, float]]:
        for placed in starts:
            yield self._steps(self._start(placed, basis), points, _squares)
        yield self._grown(basis, points)

    def _start(self, placed: Sequence[Placed], basis: Basis) -> _Axis:
        return _fitted(self._singles[0], basis, _poses_on(placed, basis), self._per_bend)

    def _grown(self, basis: Basis, points: Points) -> tuple[_Axis, float]:
        """From the axis of a thin cutter, which is next to the ruling, to that of the whole one."""
        single = self._singles[0]
        on = [
            replace(
                one,
                points_v=(BELOW_UPPER, 1.0),
                normals_v=(BELOW_UPPER, 1.0),
                offset_mm=GROWN[0] * one.offset_mm,
            )
            for one in self._singles
        ]
        axis = _fitted(on[0], basis, _poses_on(on, basis), self._per_bend)
        for share in GROWN:
            axis = replace(axis, single=replace(single, offset_mm=share * single.offset_mm))
            axis, size = self._steps(axis, points, _squares)
        return axis, size

    def _settled(self, axis: _Axis, points: Points) -> tuple[_Axis, float]:
        """The least largest deviation; where it is larger between the points, these are more of them."""
        best, least = axis, math.inf
        for _ in range(EXCHANGES):
            axis, size = self._steps(axis, points, _largest)
            fine, left = self._judging(axis)
            if float(left.max()) < least:
                best, least = axis, float(left.max())
            if float(left.max()) <= (1.0 + BETWEEN) * size:
                break
            points = points.with_those(fine, left > (1.0 + 0.5 * BETWEEN) * size)
        return best, least

    def _judging(self, axis: _Axis) -> tuple[Points, Array]:
        """Many points, and how far off they are."""
        along, across = FINE
        fine = Points.of(
            self._singles, axis.basis.tops, max(along, PER_SPAN * len(axis.basis.starts)), across
        )
        return fine, np.abs(_Seen.of(axis, fine).of_points)

    def _judged(self, axis: _Axis) -> float:
        return float(self._judging(axis)[1].max())

    def _is_right(self, axis: _Axis, points: Points) -> bool:
        """Whether the axis lies on the cutter's side of every point."""
        seen = deviation.of(axis, points.at)
        return float((seen.away * points.normals).sum(axis=0).min()) > 0.0

    def _steps(self, axis: _Axis, points: Points, kind: _Kind) -> tuple[_Axis, float]:
        """Steps as long as the size of the deviation falls; and that size."""
        now = _Seen.of(axis, points)
        size, damping = kind.size(now.of_points), 1e-6
        for _ in range(kind.most):
            before, ways = size, axis.ways()
            slopes = axis.slopes(now, ways)
            price, pull = axis.price(ways)
            while damping < MAX_DAMPING:
                step = partial(kind.solve, slopes, price=price, pull=pull, damping=damping)
                trial = _tried(axis, now, points, kind, slopes, step, ways)
                if trial is not None:
                    axis, now = trial
                    size = kind.size(now.of_points)
                    damping *= 0.2
                    break
                damping *= 10.0
            if before - size < SETTLED * before or float(np.abs(now.left).max()) < SAME_MM:
                break
        return axis, size


def _tried(
    axis: _Axis,
    now: _Seen,
    points: Points,
    kind: _Kind,
    slopes: Rows,
    step: Callable[[Array, Flags], Array],
    ways: Array,
) -> tuple[_Axis, _Seen] | None:
    """The axis after a step, and what it leaves, if that is less; what one misses counts in the next try."""
    nearest, size, y = now.found.nearest, kind.size(now.of_points), now.left
    for _ in range(kind.tries):
        try:
            x = step(y, nearest)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(x).all():
            return None
        trial = axis.moved(x, ways)
        there = _Seen.of(trial, points)
        if kind.size(there.of_points) < size:
            return trial, there
        y = y.copy()
        y[nearest] = (there.of_points[now.found.of] - slopes.times(x))[nearest]
    return None


@dataclass(frozen=True, slots=True)
class _Kind:
    """What steps make least."""

    most: int
    tries: int
    size: Callable[[Array], float]
    solve: Callable[..., Array]


def _solve_squares(slopes: Rows, y: Array, both: Flags, price: Banded, pull: Array, damping: float) -> Array:
    n = len(y)
    return least_squares(slopes, y, both, price.scaled(n, n * damping), n * pull)


def _solve_largest(slopes: Rows, y: Array, both: Flags, price: Banded, pull: Array, damping: float) -> Array:
    """Prices are against the square of the largest deviation."""
    size = float(np.abs(y[both]).max())
    per = 1.0 / size**2
    return least_largest(
        slopes.scaled(1.0 / size), y / size, both, price.scaled(per, per * damping), per * pull
    )


def _mean_square(left: Array) -> float:
    return float((left * left).mean())


def _largest_of(left: Array) -> float:
    return float(np.abs(left).max())


_squares = _Kind(SQUARES, 1, _mean_square, _solve_squares)
_largest = _Kind(LARGEST, 2, _largest_of, _solve_largest)


def _different(axes: Sequence[tuple[_Axis, float]]) -> list[_Axis]:
    """Those that have come to places of their own."""
    found: list[tuple[_Axis, float]] = []
    for axis, size in sorted(axes, key=itemgetter(1)):
        alike = any(size <= (1.0 + ALIKE) * other for _, other in found)
        if not alike and (not found or size <= FAR * found[0][1]):
            found.append((axis, size))
    return [axis for axis, _ in found]


# ---- starts ------------------------------------------------------------------------

Poses = tuple[Array, Array, Array]  # t (N,), points of the upper and of the lower curve (N, 3)


def _poses_on(placed: Sequence[Placed], basis: Basis) -> Poses:
    """Of axes that are placed: where they pass next to both edges."""
    found = []
    for k, one in enumerate(placed):
        first, last = (0, *basis.ends)[k], basis.ends[k]
        low, high = basis.tops[k], basis.tops[k + 1]
        u = _cosine(FITTED * (last - first) + 2)
        tip, axis = (rows(v, u.shape) for v in one.pose(u, one.offset_mm, np))
        feet = [
            tip + axis * ((rows(c.at(u, np), u.shape) - tip) * axis).sum(axis=0)
            for c in (one.upper, one.lower)
        ]
        found.append((low + (high - low) * u, feet[0].T, feet[1].T))
    t, upper, lower = (np.concatenate(each) for each in zip(*found, strict=True))
    return t, upper, lower


def _poses_of(axis: _Axis, basis: Basis) -> Poses:
    """Of curves, for another basis."""
    t = np.linspace(0.0, 1.0, FITTED * max(len(axis.basis.starts), len(basis.starts)))
    return t, *axis.at(t)


def _fitted(single: Placed, basis: Basis, poses: Poses, per_bend: float) -> _Axis:
    """The curves of a basis that are nearest to some poses."""
    t, upper, lower = poses
    points = _fit(basis, t, np.concatenate((upper, lower), axis=1), FIT_PRICE * per_bend)
    return _Axis(single, basis, points[:, :3], points[:, 3:], per_bend)


def _fit(basis: Basis, t: Array, values: Array, price: float) -> Array:
    """Control points (size, k) of the curves that are nearest to ``values`` (N, k) at ``t`` (N,)."""
    fits, (bends, at, weights) = Rows.of(*basis.values(t), basis.size), basis.bending()
    band = fits.squares(np.ones(len(t))) + Rows.of(bends, at, basis.size).squares(price * weights)
    return band.solve(np.stack([fits.transposed(column) for column in values.T], axis=1))
