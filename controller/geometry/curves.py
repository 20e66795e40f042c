"""Directrices as curves over 0 <= u <= 1, and the length along them.

``at`` and ``derivative`` serve floats (``m=math``), arrays (``m=numpy``) and series
(``m=controller.geometry.series``) with the same formula. Lengths are in millimetres.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

from controller.geometry.vectors import ZERO, Number, Vector, add, dot, norm, scale, subtract
from controller.messages import message, text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

Points = tuple[Vector, ...]

DEGREE = 8  # of the polynomials u(s): one more costs the tick 50 ns, one less doubles the panels


class NoLength(ValueError):
    """Why there is no way along a curve."""

    def __init__(self, key: str) -> None:
        self.said = message(key)
        super().__init__(text(self.said))


class Curve(Protocol):
    """A curve in space, mm, over 0 <= u <= 1."""

    def at(self, u: Number, m: ModuleType = math) -> Vector: ...

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector: ...


@dataclass(frozen=True, slots=True)
class Polynomial:
    """Sum of ``coefficients[k] u^k`` of any degree (Eq. 2)."""

    coefficients: Points

    def at(self, u: Number, m: ModuleType = math) -> Vector:
        return _horner(self.coefficients, u)

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector:
        factors = [math.perm(k, order) for k in range(len(self.coefficients))]
        lowered = [scale(c, float(f)) for c, f in zip(self.coefficients, factors, strict=True)]
        return _horner(tuple(lowered[order:]) or (ZERO,), u)


def _horner(coefficients: Points, u: Number) -> Vector:
    x, y, z = coefficients[-1]
    for cx, cy, cz in reversed(coefficients[:-1]):
        x, y, z = x * u + cx, y * u + cy, z * u + cz
    return x, y, z


@dataclass(frozen=True, slots=True)
class Bezier:
    """Bezier curve of any degree >= 1 through the first and the last of its control points.

    Evaluated in Bernstein form, with 1 - u beside u: where a control value is 0 at
    an end, what is left near that end is a multiple of u or of 1 - u and keeps its
    *relative* precision. The direction of a ruling at a pole hangs on that.
    """

    points: Points
    _hodographs: tuple[Points, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if len(self.points) < 2:
            raise ValueError("A Bezier curve needs at least two control points.")
        rows = [self.points]
        while len(rows[-1]) > 1:
            points, degree = rows[-1], float(len(rows[-1]) - 1)
            pairs = pairwise(points)
            rows.append(tuple(scale(subtract(b, a), degree) for a, b in pairs))
        object.__setattr__(self, "_hodographs", tuple(rows))

    def at(self, u: Number, m: ModuleType = math) -> Vector:
        return bernstein(self.points, u, 1.0 - u)

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector:
        if order >= len(self._hodographs):
            return ZERO
        return bernstein(self._hodographs[order], u, 1.0 - u)

    @property
    def hodograph(self) -> Points:
        """Control points of its derivative."""
        return self._hodographs[1]

    def raised(self, degree: int) -> Bezier:
        """The same curve with the control points of a higher degree."""
        points = self.points
        while len(points) - 1 < degree:
            n = len(points)
            inner = (add(scale(points[i - 1], i / n), scale(points[i], 1.0 - i / n)) for i in range(1, n))
            points = (points[0], *inner, points[-1])
        return Bezier(points)


def bernstein(points: Points, u: Number, w: Number) -> Vector:
    """Sum of ``points[i]`` weighted by the Bernstein polynomials of their degree; ``w`` is 1 - u."""
    if len(points) == 4:  # every G52: written out, for the tick
        (ax, ay, az), (bx, by, bz), (cx, cy, cz), (dx, dy, dz) = points
        uu, ww = u * u, w * w
        a, b, c, d = ww * w, 3.0 * ww * u, 3.0 * uu * w, uu * u
        return (
            ax * a + bx * b + cx * c + dx * d,
            ay * a + by * b + cy * c + dy * d,
            az * a + bz * b + cz * c + dz * d,
        )
    if len(points) == 3:  # and its tangent
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = points
        a, b, c = w * w, 2.0 * w * u, u * u
        return ax * a + bx * b + cx * c, ay * a + by * b + cy * c, az * a + bz * b + cz * c
    x, y, z = points[0]
    degree, power = len(points) - 1, 1.0
    for i, (px, py, pz) in enumerate(points[1:], start=1):
        power = power * u
        weight = power * float(math.comb(degree, i))
        x, y, z = x * w + px * weight, y * w + py * weight, z * w + pz * weight
    return x, y, z


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line, run through evenly."""

    start: Vector
    end: Vector

    def at(self, u: Number, m: ModuleType = math) -> Vector:
        (x0, y0, z0), (x1, y1, z1) = self.start, self.end
        w = 1.0 - u
        return x0 * w + x1 * u, y0 * w + y1 * u, z0 * w + z1 * u

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector:
        return subtract(self.end, self.start) if order == 1 else ZERO


@dataclass(frozen=True, slots=True)
class Arc:
    """Circle or helix: ``centre + first cos(sweep u) + second sin(sweep u) + rise u``.

    ``first`` leads from the centre to u = 0; ``second`` is as long, perpendicular, a
    quarter turn ahead for a positive sweep; ``rise`` stands on both.
    """

    centre: Vector
    first: Vector
    second: Vector
    sweep_rad: float
    rise: Vector = ZERO

    def at(self, u: Number, m: ModuleType = math) -> Vector:
        angle = u * self.sweep_rad
        c, s = m.cos(angle), m.sin(angle)
        (x, y, z), (fx, fy, fz), (sx, sy, sz) = self.centre, self.first, self.second
        rx, ry, rz = self.rise
        return (
            x + fx * c + sx * s + rx * u,
            y + fy * c + sy * s + ry * u,
            z + fz * c + sz * s + rz * u,
        )

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector:
        # Each derivative turns (cos, sin) a quarter on and multiplies by the sweep.
        angle, factor = u * self.sweep_rad, self.sweep_rad**order
        c, s = m.cos(angle) * factor, m.sin(angle) * factor
        c, s = ((c, s), (-s, c), (-c, -s), (s, -c))[order % 4]
        (fx, fy, fz), (sx, sy, sz) = self.first, self.second
        value = (fx * c + sx * s, fy * c + sy * s, fz * c + sz * s)
        return add(value, self.rise) if order == 1 else value


# start of the panel (mm), 1 / its length, then u(x) = c0 + c1 x + ... over 0 <= x <= 1
Panel = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ArcLength:
    """Length along a curve and its inverse u(s), as polynomials over panels of s.

    The fit follows the exact length to 1e-12 mm (times the curve's length beyond
    1 mm), so equal steps of s are equal steps along the curve: no error grows from
    tick to tick as with the first-order step of Eq. 3.
    """

    curve: Curve
    length_mm: float
    knots_mm: tuple[float, ...]  # where the panels begin, and the end
    knots_u: tuple[float, ...]
    panels: tuple[Panel, ...]

    def u_at(self, s: float) -> float:
        """The parameter at length ``s`` (mm) from the start; exactly 0 and 1 at and beyond the ends."""
        if s <= 0.0:
            return 0.0
        if s >= self.length_mm:
            return 1.0
        panel = self.panels[bisect_right(self.knots_mm, s) - 1]
        start, per_mm, c0, c1, c2, c3, c4, c5, c6, c7, c8 = panel
        x = (s - start) * per_mm
        u = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * (c5 + x * (c6 + x * (c7 + x * c8)))))))
        return u if u < 1.0 else 1.0

    def u_along(self, s: Array) -> Array:
        """As ``u_at`` for an array of any shape, to the same last bit."""
        import numpy as np

        s = np.asarray(s, dtype=float)
        index = np.clip(np.searchsorted(self.knots_mm, s, side="right") - 1, 0, len(self.panels) - 1)
        start, per_mm, *coefficients = np.moveaxis(np.array(self.panels)[index], -1, 0)
        x = (s - start) * per_mm
        u = coefficients[-1]
        for c in coefficients[-2::-1]:
            u = c + x * u
        u = np.minimum(u, 1.0)
        return np.where(s <= 0.0, 0.0, np.where(s >= self.length_mm, 1.0, u))


MIN_RATE = 1e-6  # of a curve at an end, as a share of its length: slower there, it stands still
BESIDE_MM = 1e-3  # how far from such an end its derivatives are taken, which are without bound at it


@dataclass(frozen=True, slots=True)
class Even:
    """A curve run through evenly: over 0 <= u <= 1 by the share of its length."""

    arc: ArcLength
    _inside: tuple[float, float] = field(init=False, repr=False, compare=False)  # where derivatives are taken

    def __post_init__(self) -> None:
        length, curve = self.arc.length_mm, self.arc.curve
        stands = [float(norm(curve.derivative(u))) < MIN_RATE * length for u in (0.0, 1.0)]
        first, last = (min(BESIDE_MM / length, 1.0 / 3.0) if stand else 0.0 for stand in stands)
        object.__setattr__(self, "_inside", (first, 1.0 - last))

    def at(self, u: Number, m: ModuleType = math) -> Vector:
        return self.arc.curve.at(self._parameter(u, m), m)

    def derivative(self, u: Number, order: int = 1, m: ModuleType = math) -> Vector:
        low, high = self._inside
        at = self._parameter(min(max(u, low), high) if m is math else m.clip(u, low, high), m)
        first, second, third = (self.arc.curve.derivative(at, k, m) for k in (1, 2, 3))
        # p is the curve's own parameter: dp/ds is one over its speed v, and so on by the chain rule.
        v = norm(first, m)
        v1 = dot(first, second) / v
        v2 = (dot(second, second) + dot(first, third) - v1 * v1) / v
        p1, p2, p3 = 1.0 / v, -v1 / v**3, (3.0 * v1 * v1 - v * v2) / v**5
        value = (
            scale(first, p1),
            add(scale(second, p1 * p1), scale(first, p2)),
            add(add(scale(third, p1**3), scale(second, 3.0 * p1 * p2)), scale(first, p3)),
        )[order - 1]
        return scale(value, self.arc.length_mm**order)

    def _parameter(self, u: Any, m: ModuleType) -> Any:
        s = u * self.arc.length_mm
        return self.arc.u_at(s) if m is math else self.arc.u_along(s)
