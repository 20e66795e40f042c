"""Rational B-splines over 0 <= u <= 1.

A B-spline is kept as what it is between its knots: a row of Bezier spans. So an
evaluation costs a search for the span and one Bezier, however many control points
there are, and ``at`` and ``derivative`` serve floats, arrays and series alike.

Knots and weights follow Piegl and Tiller, The NURBS Book: n control points of order k
(degree k - 1) take n + k knots that never fall; here the first k and the last k are
equal, so that the curve begins and ends on its first and last control points.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from types import ModuleType
from typing import Any

from controller.geometry.curves import Bezier, Curve, Points
from controller.geometry.vectors import ZERO, Number, Vector, add, scale, subtract
from controller.messages import Message, message, text

Weights = tuple[float, ...]
Rows = tuple[tuple[float, ...], ...]
ORDERS = range(2, 9)
ONE_KNOT = 1e-7  # share of the whole range: knots that differ by less are a slip of the pen
ONE_BREAK = 1e-9  # breaks of two curves nearer than this are one: 1e-7 mm on a curve of 100 mm
_HIGHEST = 3  # derivative kept as control points; series make what lies above


class BadSpline(ValueError):
    """Why order, knots, points and weights make no curve; ``what`` and ``index`` name the culprit."""

    def __init__(self, why: Message, what: str, index: int = 0) -> None:
        super().__init__(text(why))
        self.said, self.what, self.index = (
            why,
            what,
            index,
        )  # 'order', 'points', 'knots', 'weights'; into them


@dataclass(frozen=True, slots=True)
class BSpline:
    """A row of Bezier spans of one degree, mm; rational where there are weights.

    Shares of a span are taken from both of its ends, so that next to u = 0 and to
    u = 1 small parts keep their relative precision, as with ``Bezier``.
    """

    breaks: tuple[float, ...]  # 0.0, inner knots, 1.0
    spans: tuple[Points, ...]  # control points of each span
    weights: tuple[Weights, ...] = ()  # of the same, or nothing where all are 1
    smooth: tuple[int, ...] = ()  # at each inner break: how many derivatives go through it for sure
    # [order of the derivative][span]: x y z of the control points (times weight, and the
    # weight) times their binomials.
    _rows: tuple[tuple[Rows, ...], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        widths = [b - a for a, b in pairwise(self.breaks)]
        rows: list[Rows] = list(self.spans)
        if self.weights:
            rows = [
                tuple((*scale(p, w), w) for p, w in zip(points, weights, strict=True))
                for points, weights in zip(self.spans, self.weights, strict=True)
            ]
        orders = [tuple(map(_with_binomials, rows))]
        for _ in range(min(_HIGHEST, len(rows[0]) - 1)):
            rows = [_hodograph(row, width) for row, width in zip(rows, widths, strict=True)]
            orders.append(tuple(map(_with_binomials, rows)))
        object.__setattr__(self, "_rows", tuple(orders))

    @staticmethod
    def of(
        order: int, knots: Sequence[float], points: Sequence[Vector], weights: Sequence[float] = ()
    ) -> BSpline:
        """The curve of ``points`` with ``knots`` and ``weights`` (none: all 1); else BadSpline."""
        check(order, knots, points, weights)
        low, high = knots[0], knots[-1]
        inner = [(knot, len(list(same))) for knot, same in groupby(knots[order:-order])]
        even = not weights or min(weights) == max(weights)
        row = _Row(order - 1, list(knots), list(points), [1.0] * len(points) if even else list(weights))
        for knot, times in inner:
            for _ in range(order - 1 - times):
                row.insert(knot)
        starts = range(0, len(row.points) - 1, order - 1)
        return BSpline(
            (0.0, *((knot - low) / (high - low) for knot, _ in inner), 1.0),
            tuple(tuple(row.points[i : i + order]) for i in starts),
            () if even else tuple(tuple(row.weights[i : i + order]) for i in starts),
            tuple(order - 1 - times for _, times in inner),
        )

    def at(self, u: Number, m: ModuleType = math) -> Vector:
        place = self._place(u)
        if not self.weights:
            return _sum_of_three(self._control(0, place), *place[1:])
        x, y, z, w = _sum_of_four(self._control(0, place), *place[1:])
        return x / w, y / w, z / w

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector:
        place = self._place(u)
        if not self.weights:
            if order >= len(self._rows):
                return ZERO
            return _sum_of_three(self._control(order, place), *place[1:])
        if order == 1:  # written out, for the tick
            x, y, z, w = _sum_of_four(self._control(0, place), *place[1:])
            dx, dy, dz, dw = _sum_of_four(self._control(1, place), *place[1:])
            per = 1.0 / w
            share = dw * per
            return (dx - x * share) * per, (dy - y * share) * per, (dz - z * share) * per
        sums = [
            _sum_of_four(self._control(k, place), *place[1:]) if k < len(self._rows) else (0.0,) * 4
            for k in range(order + 1)
        ]
        return _quotient(sums)

    def between(self, start: float, end: float) -> Curve:
        """The part over start <= u <= end as a curve over 0 .. 1."""
        cut = self.refined((start, end))
        first, last = cut.breaks.index(start), cut.breaks.index(end)
        inner = cut.breaks[first + 1 : last]
        breaks = (0.0, *((b - start) / (end - start) for b in inner), 1.0)
        return simplest(BSpline(breaks, cut.spans[first:last], cut.weights[first:last]))

    def refined(self, at: Sequence[float]) -> BSpline:
        """The same curve with breaks also at the parameters ``at`` (``smooth`` is not kept)."""
        breaks = sorted({*self.breaks, *at})
        if len(breaks) == len(self.breaks):
            return self
        parts: list[tuple[Points, Weights]] = []
        for (a, b), points, weights in zip(pairwise(self.breaks), *self.weighted(), strict=True):
            left = a
            for cut in (at for at in breaks if a < at < b):
                before, (points, weights) = _halves(points, weights, (cut - left) / (b - left))
                parts.append(before)
                left = cut
            parts.append((points, weights))
        spans, made = (tuple(column) for column in zip(*parts, strict=True))
        return BSpline(tuple(breaks), spans, made if self.weights else ())

    def weighted(self) -> tuple[tuple[Points, ...], tuple[Weights, ...]]:
        """Control points and weights of each span, also where all weights are 1."""
        return self.spans, self.weights or ((1.0,) * len(self.spans[0]),) * len(self.spans)

    def snapped(self, to: Sequence[float]) -> BSpline:
        """With every break that is one with a break of ``to`` at just that value."""
        near = {b: a for b in self.breaks for a in to if abs(a - b) <= ONE_BREAK}
        if all(b == a for b, a in near.items()):
            return self
        return BSpline(tuple(near.get(b, b) for b in self.breaks), self.spans, self.weights, self.smooth)

    def _place(self, u: Any) -> tuple[Any, Any, Any]:
        """Span (int, or one for each sample), share of it from its start, share to its end."""
        breaks = self.breaks
        if isinstance(u, float | int):
            i = bisect_right(breaks, u, 1, len(breaks) - 1) - 1
            a, b = breaks[i], breaks[i + 1]
            return i, (u - a) / (b - a), (b - u) / (b - a)
        import numpy as np

        table = np.array(breaks)
        index = np.searchsorted(table[1:-1], u.c[0] if hasattr(u, "c") else u, side="right")
        a, b = table[index], table[index + 1]
        return index, (u - a) / (b - a), (b - u) / (b - a)

    def _control(self, order: int, place: tuple[Any, Any, Any]) -> Any:
        """The rows of the span of a place; of many places, with an array for each number."""
        rows, span = self._rows[order], place[0]
        if isinstance(span, int):
            return rows[span]
        import numpy as np

        return tuple(tuple(np.moveaxis(p, -1, 0)) for p in np.moveaxis(np.array(rows)[span], -2, 0))


def _sum_of_three(rows: Any, t: Any, w: Any) -> Vector:
    """Sum of the rows, binomials in them, times the powers of t and w = 1 - t."""
    if len(rows) == 4:  # a cubic written out, for the tick
        (ax, ay, az), (bx, by, bz), (cx, cy, cz), (dx, dy, dz) = rows
        tt, ww = t * t, w * w
        a, b, c, d = ww * w, ww * t, tt * w, tt * t
        return (
            ax * a + bx * b + cx * c + dx * d,
            ay * a + by * b + cy * c + dy * d,
            az * a + bz * b + cz * c + dz * d,
        )
    x, y, z = rows[0]
    power = 1.0
    for px, py, pz in rows[1:]:
        power = power * t
        x, y, z = x * w + px * power, y * w + py * power, z * w + pz * power
    return x, y, z


def _sum_of_four(rows: Any, t: Any, w: Any) -> tuple[Any, Any, Any, Any]:
    if len(rows) == 4:  # a cubic written out, for the tick
        (ax, ay, az, av), (bx, by, bz, bv), (cx, cy, cz, cv), (dx, dy, dz, dv) = rows
        tt, ww = t * t, w * w
        a, b, c, d = ww * w, ww * t, tt * w, tt * t
        return (
            ax * a + bx * b + cx * c + dx * d,
            ay * a + by * b + cy * c + dy * d,
            az * a + bz * b + cz * c + dz * d,
            av * a + bv * b + cv * c + dv * d,
        )
    x, y, z, v = rows[0]
    power = 1.0
    for px, py, pz, pv in rows[1:]:
        power = power * t
        x, y, z, v = x * w + px * power, y * w + py * power, z * w + pz * power, v * w + pv * power
    return x, y, z, v


def _quotient(sums: Sequence[tuple[Any, Any, Any, Any]]) -> Vector:
    """The highest derivative of C from those of (w C, w): (w C)^(k) = sum of binomials w^(i) C^(k-i)."""
    per = 1.0 / sums[0][3]
    found = [scale(sums[0][:3], per)]
    for k, (x, y, z, _) in enumerate(sums[1:], start=1):
        for i in range(1, k + 1):
            share = sums[i][3] if i == k else sums[i][3] * float(math.comb(k, i))
            cx, cy, cz = found[k - i]
            x, y, z = x - share * cx, y - share * cy, z - share * cz
        found.append((x * per, y * per, z * per))
    return found[-1]


def _hodograph(rows: Rows, width: float) -> Rows:
    factor = (len(rows) - 1) / width
    return tuple(tuple((q - p) * factor for p, q in zip(a, b, strict=True)) for a, b in pairwise(rows))


def _with_binomials(rows: Rows) -> Rows:
    degree = len(rows) - 1
    return tuple(tuple(p * math.comb(degree, i) for p in row) for i, row in enumerate(rows))


def simplest(spline: BSpline) -> Curve:
    """A single span without weights is a Bezier: cheaper by the search for the span."""
    return spline if spline.weights or len(spline.spans) > 1 else Bezier(spline.spans[0])


def splined(curve: Curve) -> BSpline:
    """A curve that ``simplest`` has made, as a B-spline again."""
    if isinstance(curve, Bezier):
        return BSpline((0.0, 1.0), (curve.points,))
    assert isinstance(curve, BSpline)
    return curve


def check(order: int, knots: Sequence[float], points: Sequence[Vector], weights: Sequence[float]) -> None:
    """Raise BadSpline for the first of order, counts, weights and knots that makes no curve."""
    if order not in ORDERS:
        raise BadSpline(message("spline.order", order=order, least=ORDERS[0], most=ORDERS[-1]), "order")
    n = len(points)
    if n < order:
        raise BadSpline(message("spline.few_points", count=n, order=order), "points")
    if len(knots) != n + order:
        why = message("spline.count_of_knots", count=n, order=order, needed=n + order, found=len(knots))
        raise BadSpline(why, "knots", min(len(knots), n + order) - 1)
    if weights and len(weights) != n:
        raise BadSpline(message("spline.count_of_weights", count=n, found=len(weights)), "weights")
    for i, weight in enumerate(weights):
        if not weight > 0.0:
            raise BadSpline(message("spline.weight", weight=weight), "weights", i)
    _check_knots(order, knots)


def _check_knots(order: int, knots: Sequence[float]) -> None:
    span, index = knots[-1] - knots[0], 0
    for i, (a, b) in enumerate(pairwise(knots), start=1):
        if a > b:
            raise BadSpline(message("spline.falling", a=a, b=b), "knots", i)
        if 0.0 < b - a < ONE_KNOT * span:
            raise BadSpline(message("spline.near", a=a, b=b), "knots", i)
    if span == 0.0:
        raise BadSpline(message("spline.all_alike", knot=knots[0]), "knots", len(knots) - 1)
    for knot, same in groupby(knots):
        times = len(list(same))
        index += times
        at_end = knot in (knots[0], knots[-1])
        if at_end and times != order:
            key = "spline.first_knot" if index == times else "spline.last_knot"
            place = index if times < order and index == times else index - 1  # what stands there instead
            raise BadSpline(message(key, knot=knot, times=times, order=order), "knots", place)
        if not at_end and times >= order:
            why = message("spline.inner_knot", knot=knot, times=times, order=order, most=order - 1)
            raise BadSpline(why, "knots", index - 1)


def _mixed(p: Vector, q: Vector, w: float, v: float, share: float) -> tuple[Vector, float]:
    """The point at ``share`` of the way from p (weight w) to q (weight v), and its weight.

    Written as a step from p, so that equal coordinates stay equal to the last bit.
    """
    weight = w + share * (v - w)
    return add(p, scale(subtract(q, p), share * v / weight)), weight


def _halves(
    points: Points, weights: Weights, t: float
) -> tuple[tuple[Points, Weights], tuple[Points, Weights]]:
    """A Bezier span cut at ``t`` (de Casteljau): its part before and its part behind."""
    row, left, right = list(zip(points, weights, strict=True)), [], []
    while row:
        left.append(row[0])
        right.append(row[-1])
        row = [_mixed(p, q, w, v, t) for (p, w), (q, v) in pairwise(row)]
    (a, wa), (b, wb) = zip(*left, strict=True), zip(*reversed(right), strict=True)
    return (tuple(a), tuple(wa)), (tuple(b), tuple(wb))


@dataclass(slots=True)
class _Row:
    """Knots, points and weights while knots are inserted."""

    degree: int
    knots: list[float]
    points: list[Vector]
    weights: list[float]

    def insert(self, knot: float) -> None:
        """One more of an inner knot; the curve stays (Boehm)."""
        p, knots = self.degree, self.knots
        k = bisect_right(knots, knot) - 1
        times = knots.count(knot)
        made = []
        for i in range(k - p + 1, k - times + 1):
            share = (knot - knots[i]) / (knots[i + p] - knots[i])
            (a, b), (w, v) = self.points[i - 1 : i + 1], self.weights[i - 1 : i + 1]
            made.append(_mixed(a, b, w, v, share))
        self.points[k - p + 1 : k - times] = [point for point, _ in made]
        self.weights[k - p + 1 : k - times] = [weight for _, weight in made]
        knots.insert(k + 1, knot)
