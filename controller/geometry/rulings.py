"""The ruling C0 - C1 of two directrices as a curve of its own, and where a pair is smooth.

Made from differences of control points: what is 0 at an end, as the small parts of a
ruling at a pole are, comes out as 0 and near it with its relative precision.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from types import ModuleType

from controller.geometry.curves import Bezier, Curve, Line, Points, Polynomial
from controller.geometry.splines import BSpline, Weights, simplest
from controller.geometry.vectors import ZERO, Number, Vector, subtract


@dataclass(frozen=True, slots=True)
class Difference:
    """``upper(u) - lower(u)`` of two curves that have no common form."""

    upper: Curve
    lower: Curve

    def at(self, u: Number, m: ModuleType = math) -> Vector:
        return subtract(self.upper.at(u, m), self.lower.at(u, m))

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector:
        return subtract(self.upper.derivative(u, order, m), self.lower.derivative(u, order, m))


def difference(upper: Curve, lower: Curve) -> Curve:
    """The curve ``upper(u) - lower(u)``, from differences of coefficients where there is a common form."""
    if isinstance(upper, Polynomial) and isinstance(lower, Polynomial):
        n = max(len(upper.coefficients), len(lower.coefficients))
        a, b = (c.coefficients + (ZERO,) * (n - len(c.coefficients)) for c in (upper, lower))
        return Polynomial(tuple(map(subtract, a, b)))
    first, second = _as_spline(upper), _as_spline(lower)
    if first is None or second is None:
        return Difference(upper, lower)
    return simplest(_between_splines(*_aligned(first, second)))


def _as_spline(curve: Curve) -> BSpline | None:
    if isinstance(curve, Line):
        return BSpline((0.0, 1.0), ((curve.start, curve.end),))
    if isinstance(curve, Bezier):
        return BSpline((0.0, 1.0), (curve.points,))
    return curve if isinstance(curve, BSpline) else None


def _aligned(first: BSpline, second: BSpline) -> tuple[BSpline, BSpline]:
    """Both with the same breaks."""
    first = first.snapped(second.breaks)
    return first.refined(second.breaks), second.refined(first.breaks)


def _between_splines(upper: BSpline, lower: BSpline) -> BSpline:
    if upper.weights == lower.weights:
        degree = max(len(c.spans[0]) for c in (upper, lower)) - 1
        if not upper.weights:
            rows = [[Bezier(s).raised(degree).points for s in c.spans] for c in (upper, lower)]
            return BSpline(
                upper.breaks, tuple(tuple(map(subtract, a, b)) for a, b in zip(*rows, strict=True))
            )
        pairs = zip(upper.spans, lower.spans, strict=True)
        return BSpline(upper.breaks, tuple(tuple(map(subtract, a, b)) for a, b in pairs), upper.weights)
    made = [_span_between(*rows) for rows in zip(*upper.weighted(), *lower.weighted(), strict=True)]
    return BSpline(upper.breaks, tuple(points for points, _ in made), tuple(weights for _, weights in made))


def _span_between(a: Points, wa: Weights, b: Points, wb: Weights) -> tuple[Points, Weights]:
    """A / wa - B / wb over one denominator: products of Bernstein polynomials.

    Point k is the mean of all a[i] - b[k - i], each with the weight it has in the
    product: differences of points again, so that what is 0 at an end is 0.
    """
    p, q = len(a) - 1, len(b) - 1
    points, weights = [], []
    for k in range(p + q + 1):
        shares = [
            (wa[i] * wb[k - i] * math.comb(p, i) * math.comb(q, k - i), subtract(a[i], b[k - i]))
            for i in range(max(0, k - q), min(p, k) + 1)
        ]
        total = math.fsum(share for share, _ in shares)
        x, y, z = (math.fsum(share * gap[c] for share, gap in shares) / total for c in range(3))
        points.append((x, y, z))
        weights.append(total / math.comb(p + q, k))
    return tuple(points), tuple(weights)


def smooth_parts(
    upper: BSpline, lower: BSpline, of_upper: int = 2, of_lower: int = 3
) -> Iterator[tuple[float, float]]:
    """(start, end) of the parts over which so many derivatives of both curves run through.

    With two and three the joints of a cut change without a jump up to q'': the tool tip stands beside C1
    along a normal made of C1' and so is a derivative less smooth than C1; the tool axis is as smooth as
    both curves. ``upper`` is ``snapped`` to the breaks of ``lower``.
    """
    cuts = {0.0, 1.0}
    cuts |= {b for b, smooth in zip(lower.breaks[1:-1], lower.smooth, strict=True) if smooth < of_lower}
    for b, smooth in zip(upper.breaks[1:-1], upper.smooth, strict=True):
        if smooth < of_upper:
            cuts.add(b)
    yield from pairwise(sorted(cuts))
