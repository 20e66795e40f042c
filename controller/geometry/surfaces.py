"""Ruled surfaces between an upper directrix C0 and a lower one C1, and the pose along them.

S(u, v) = (1 - v) C0(u) + v C1(u), Eq. 1. The cutter's bottom edge touches C1, its
axis is parallel to the ruling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from controller.geometry.curves import Arc, Curve
from controller.geometry.rulings import difference
from controller.geometry.vectors import Number, Pose, Vector, add, cross, dot, norm, scale, subtract, unit


class Surface:
    """A ruled surface over 0 <= u, v <= 1: its formulas stand on three curves.

    ``ruling_curve`` is C0 - C1 as a curve of its own, made from differences of
    control points: computed as a difference of two points it would lose, near a pole,
    just the small parts which tell the direction of the tilt.
    """

    __slots__ = ()
    lower: Curve
    upper: Curve
    ruling_curve: Curve

    @property
    def nominal(self) -> Surface:
        """Without a cutter that is placed on it."""
        return self

    def contact(self, u: Number, m: ModuleType = math) -> Vector:
        """The point C1(u), mm (Eq. 4)."""
        return self.lower.at(u, m)

    def point(self, u: Number, v: Number, m: ModuleType = math) -> Vector:
        """S(u, v), mm (Eq. 1)."""
        return add(scale(self.upper.at(u, m), 1.0 - v), scale(self.lower.at(u, m), v))

    def ruling(self, u: Number, m: ModuleType = math) -> Vector:
        """C0(u) - C1(u), upward, mm."""
        return self.ruling_curve.at(u, m)

    def axis(self, u: Number, m: ModuleType = math) -> Vector:
        """Unit vector along the ruling, upward (Eq. 8 with its sign put right)."""
        return unit(self.ruling_curve.at(u, m), m)

    def axis_rate(self, u: float) -> Vector:
        """d axis / du; at an end where it is 0, the direction the axis leaves to with growing u.

        So ``rate`` at the start and ``-rate`` at the end always point to where the
        axis is just inside; 0 only where the axis does not turn at all.
        """
        ruling = self.ruling_curve.at(u)
        length = norm(ruling)
        axis = scale(ruling, 1.0 / length)
        rate = _across(axis, self.ruling_curve.derivative(u), length)
        if 0.0 < u < 1.0 or norm(rate) > 1e-12:
            return rate
        # axis(u) - axis(end) goes like the first derivative k that is not along the
        # axis, times (u - end)^k: at u = 1 an even k turns the sign.
        for order in (2, 3):
            sign = -1.0 if u >= 1.0 and order == 2 else 1.0
            rate = _across(axis, self.ruling_curve.derivative(u, order), sign * length)
            if norm(rate) > 1e-12:
                return rate
        return rate

    def normal(self, u: Number, m: ModuleType = math) -> Vector:
        """Unit normal dS/dv x dS/du at C1 (Eq. 5): right of the travel with C0 up."""
        return unit(cross(self.tangent(u, m), self.ruling_curve.at(u, m)), m)

    def pose(self, u: Number, offset_mm: float, m: ModuleType = math) -> Pose:
        """Tip and axis of a cutter whose axis stands ``offset_mm`` to the right of C1 (Eq. 5, 8).

        Written out in components: the tick calls it in every period.
        """
        dx, dy, dz = self.ruling_curve.at(u, m)
        tx, ty, tz = self.tangent(u, m)
        x, y, z = self.lower.at(u, m)
        # (C1 - C0) x C1' = C1' x (C0 - C1)
        nx, ny, nz = ty * dz - tz * dy, tz * dx - tx * dz, tx * dy - ty * dx
        per = 1.0 / m.sqrt(dx * dx + dy * dy + dz * dz)
        out = offset_mm / m.sqrt(nx * nx + ny * ny + nz * nz)
        return Pose((x + nx * out, y + ny * out, z + nz * out), (dx * per, dy * per, dz * per))

    def tangent(self, u: Number, m: ModuleType) -> Vector:
        """C1', or its limit from inside (up to a factor) where it is 0 at an end."""
        tangent = self.lower.derivative(u, 1, m)
        if m is math:
            if u <= 0.0 or u >= 1.0:
                return end_tangent(self.lower, u, tangent)
        elif not hasattr(u, "c"):  # samples, no series
            return _end_tangents(self.lower, u, tangent)
        return tangent


def _across(axis: Vector, change: Vector, length: float) -> Vector:
    """The part of ``change`` that turns ``axis``, over the length of the vector that changes."""
    return scale(subtract(change, scale(axis, dot(axis, change))), 1.0 / length)


def end_tangent(curve: Curve, u: float, tangent: Vector) -> Vector:
    """``tangent`` = C'(u), or, where it is 0 at an end, the limit of its direction from inside."""
    size = norm(tangent)
    for order in (2, 3):
        higher = curve.derivative(u, order)
        if size > 1e-12 * norm(higher):
            break
        tangent = scale(higher, -1.0) if u >= 1.0 and order == 2 else higher
        size = norm(tangent)
    return tangent


def _end_tangents(curve: Curve, u: Any, tangent: Vector) -> Vector:
    """As ``end_tangent`` for samples; only those at the ends are touched."""
    import numpy as np

    from controller.geometry.arrays import distinct, rows

    at = np.asarray(u, dtype=float)
    ends = np.flatnonzero((at <= 0.0) | (at >= 1.0))
    if not len(ends) or at.ndim == 0:
        return tangent
    table = rows(tangent, at.shape)
    for end in distinct(at[ends]):  # both of them mostly, however many samples there are
        same = at == end
        table[:, same] = np.array(end_tangent(curve, float(end), tuple(table[:, same][:, 0])))[:, None]
    return table[0], table[1], table[2]


@dataclass(frozen=True, slots=True)
class RuledSurface(Surface):
    """The surface between any two directrices (G52: two cubic Beziers)."""

    upper: Curve
    lower: Curve
    ruling_curve: Curve = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "ruling_curve", difference(self.upper, self.lower))


@dataclass(frozen=True, slots=True)
class Cone(Surface):
    """Right circular cone frustum with axis +Z, from its two circles (G51); u = share of the swept angle.

    ``start`` is the first contact on the bottom circle about ``centre``;
    ``sweep_rad`` is positive counter-clockwise seen from +Z and may pass a turn.
    """

    start: Vector
    centre: Vector
    height_mm: float
    upper_radius_mm: float
    sweep_rad: float
    lower: Curve = field(init=False, repr=False, compare=False)
    upper: Curve = field(init=False, repr=False, compare=False)
    ruling_curve: Curve = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        (sx, sy, _), (x, y, z) = self.start, self.centre
        first, second = (sx - x, sy - y, 0.0), (y - sy, sx - x, 0.0)
        radius = math.hypot(sx - x, sy - y)
        if not radius > 0.0:
            raise ValueError("The bottom circle of the cone has no radius.")
        share, rest = self.upper_radius_mm / radius, (self.upper_radius_mm - radius) / radius
        top, height = (x, y, z + self.height_mm), (0.0, 0.0, self.height_mm)
        circles = {
            "lower": Arc(self.centre, first, second, self.sweep_rad),
            "upper": Arc(top, scale(first, share), scale(second, share), self.sweep_rad),
            "ruling_curve": Arc(height, scale(first, rest), scale(second, rest), self.sweep_rad),
        }
        for name, circle in circles.items():
            object.__setattr__(self, name, circle)
