"""Where the cutter stands on a twisted ruled surface: the paper's place, and better ones.

The paper (Eq. 5) stands the cutter's axis beside the ruling, off by the radius along the
normal at C1. Where the surface is twisted its normal turns along the ruling, so the flank
that is right at C1 is wrong above it: Example 2 with r = 3 mm is cut 0.18 and 0.31 mm too
deep. A straight axis can do better, as it need not be parallel to the ruling:

        v = 0  --o-------------  C0            the axis goes through two points, each off the
                  \\  . upper point            surface along the surface's own normal there
                   \\
                    \\ . lower point           (Liu 1995: offset at two ruling parameters)
        v = 1  ------o---------  C1

``single`` is the paper's, ``double`` hangs the axis on two such points: one formula of the surface
(``Placed.pose``). ``optimal`` is free of both: the axis goes through two smooth curves that the plan
has found, whatever knots the surface is written with. All are evaluated on every tick: nothing is
interpolated between poses.

A tapered flank is tangent at v where its axis is off by rho(v) along the normal,

    rho(v) = (r + (1 - v) |C0 - C1| sin t) / cos t,     r: radius beside C1, t: half angle,

for the normal of a cone meets its axis so far away; t = 0 gives r everywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from enum import Enum
from itertools import pairwise
from types import ModuleType
from typing import NamedTuple

from controller.geometry.curves import Curve, Line
from controller.geometry.surfaces import Surface, end_tangent
from controller.geometry.vectors import (
    ZERO,
    Number,
    Pose,
    Vector,
    add,
    angle_between,
    norm,
    rotate,
    scale,
    subtract,
    unit,
)

ENDS = (0.0, 1.0)
AT_LOWER = (1.0, 1.0)
DEG_PER_MM = 10.0  # as motions
SHORTEST_MM = 0.05  # of a turn: its derivatives want some room beside its ends


class Strategy(Enum):
    """How the cutter is placed on G51, G52 and G6.2; the values are P of G41 and G42."""

    SINGLE = 1
    DOUBLE = 2
    OPTIMAL = 3
    AUTO = 4  # the one of these that is least off


class Barrel(NamedTuple):
    """The arc of a flank that bows outward."""

    radius_mm: float
    middle_mm: float  # of the height above the tip


@dataclass(frozen=True, slots=True)
class Placed(Surface):
    """A surface with the cutter placed on it: all of ``base`` but for pose and axis.

    ``offset_mm`` is the radius of the flank across the tool axis beside C1, with the
    allowance, positive on Eq. 5's side. The axis goes through S + rho n at the ruling
    parameters ``points_v``, with the normals of ``normals_v`` (upper, lower).
    """

    base: Surface
    offset_mm: float
    points_v: tuple[float, float] = ENDS
    normals_v: tuple[float, float] = AT_LOWER
    taper_rad: float = 0.0
    shift_mm: float = 0.0  # so far the tip lies below the foot of the contact, along the axis
    # The axis goes through the same u of both (upper, lower; mm), the tip ``shift_mm`` below the lower one.
    through: tuple[Curve, Curve] | None = None
    name: str = field(default="", repr=False, compare=False)  # under which a check keeps it
    barrel: Barrel | None = None  # of the flank, which then touches the cone of all this in its middle
    lower: Curve = field(init=False, repr=False, compare=False)
    upper: Curve = field(init=False, repr=False, compare=False)
    ruling_curve: Curve = field(init=False, repr=False, compare=False)
    # What the pose takes of all this: shares of the ruling's turn in both normals, growth of both
    # offsets with the ruling, the offset, the lower point's share of the ruling, and that between both.
    _numbers: tuple[float, ...] = field(init=False, repr=False, compare=False)

    @property
    def nominal(self) -> Surface:
        return self.base

    def __post_init__(self) -> None:
        for name in ("lower", "upper", "ruling_curve"):
            object.__setattr__(self, name, getattr(self.base, name))
        (va, vb), (na, nb) = self.points_v, self.normals_v
        lean = math.copysign(math.tan(self.taper_rad), self.offset_mm)
        offset = self.offset_mm / math.cos(self.taper_rad)
        numbers = (1.0 - na, 1.0 - nb, (1.0 - va) * lean, (1.0 - vb) * lean, offset, 1.0 - vb, vb - va)
        object.__setattr__(self, "_numbers", numbers)

    def axis(self, u: Number, m: ModuleType = math) -> Vector:
        """Unit vector along the placed tool axis, upward; not along the ruling where that is twisted."""
        return self.pose(u, self.offset_mm, m).axis

    def pose(self, u: Number, offset_mm: float, m: ModuleType = math) -> Pose:
        """Tip and axis as placed; ``offset_mm`` is the surface's own (the argument of ``Surface.pose``).

        Written out in components: the tick calls it in every period.
        """
        if self.through is not None:
            return self._led(*self.through, u, m)
        dx, dy, dz = self.ruling_curve.at(u, m)
        if m is math and 0.0 < u < 1.0:
            (tx, ty, tz), (rx, ry, rz) = self.lower.derivative(u), self.ruling_curve.derivative(u)
        else:
            (tx, ty, tz), (rx, ry, rz) = self.rates(u, m)
        turn_a, turn_b, lean_a, lean_b, offset, beside, span = self._numbers
        length = m.sqrt(dx * dx + dy * dy + dz * dz)
        high, low = offset + lean_a * length, offset + lean_b * length
        # Normals (C1 - C0) x ((1 - v) C0' + v C1') above and below, not of unit length yet.
        ax, ay, az = tx + turn_a * rx, ty + turn_a * ry, tz + turn_a * rz
        ax, ay, az = ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx
        bx, by, bz = tx + turn_b * rx, ty + turn_b * ry, tz + turn_b * rz
        bx, by, bz = by * dz - bz * dy, bz * dx - bx * dz, bx * dy - by * dx
        size = 1.0 / m.sqrt(ax * ax + ay * ay + az * az)
        per = m.sqrt(bx * bx + by * by + bz * bz)
        f = low / per
        bx, by, bz = bx * f, by * f, bz * f
        # The axis: from the lower point to the upper one.
        f = high * size
        wx, wy, wz = span * dx + ax * f - bx, span * dy + ay * f - by, span * dz + az * f - bz
        per = 1.0 / m.sqrt(wx * wx + wy * wy + wz * wz)
        wx, wy, wz = wx * per, wy * per, wz * per
        # From the contact to the lower point, without what is along the axis: the foot of the contact.
        bx, by, bz = bx + beside * dx, by + beside * dy, bz + beside * dz
        along = bx * wx + by * wy + bz * wz + self.shift_mm
        x, y, z = self.lower.at(u, m)
        return Pose((x + bx - along * wx, y + by - along * wy, z + bz - along * wz), (wx, wy, wz))

    def _led(self, upper: Curve, lower: Curve, u: Number, m: ModuleType) -> Pose:
        (ax, ay, az), (bx, by, bz) = upper.at(u, m), lower.at(u, m)
        wx, wy, wz = ax - bx, ay - by, az - bz
        per = 1.0 / m.sqrt(wx * wx + wy * wy + wz * wz)
        wx, wy, wz = wx * per, wy * per, wz * per
        down = self.shift_mm
        return Pose((bx - down * wx, by - down * wy, bz - down * wz), (wx, wy, wz))

    def axis_rate(self, u: float) -> Vector:
        """As ``Surface.axis_rate``, of the placed axis."""
        return _axis_rate(self, u)

    def rates(self, u: Number, m: ModuleType) -> tuple[Vector, Vector]:
        """C1' and (C0 - C1)'; where C1' is 0 at an end, what stands for it there."""
        tangent, turn = self.lower.derivative(u, 1, m), self.ruling_curve.derivative(u, 1, m)
        if m is math:
            if u <= 0.0 or u >= 1.0:
                return self._end_rates(u, tangent, turn)
        elif not hasattr(u, "c"):  # samples, no series
            return self._rates_with_ends(u, tangent, turn)
        return tangent, turn

    def _end_rates(self, u: float, tangent: Vector, turn: Vector) -> tuple[Vector, Vector]:
        rate = tangent
        for order in (2, 3):
            bend, turn_bend = (curve.derivative(u, order) for curve in (self.lower, self.ruling_curve))
            if norm(rate) > 1e-12 * norm(bend):
                return rate, turn
            if norm(turn) > 1e-12 * norm(turn_bend):
                # C1 alone stands still. Above it the ruling's turn gives the normals; at C1 itself the limit,
                # of which so small a share does not show above.
                limit = end_tangent(self.lower, u, tangent)
                return scale(limit, 1e-12 * norm(turn) / norm(limit)), turn
            # Both directrices stand still: just inside both rates go like the next derivatives.
            sign = -1.0 if u >= 1.0 and order == 2 else 1.0
            rate, turn = scale(bend, sign), scale(turn_bend, sign)
        return rate, turn

    def _rates_with_ends(self, u: Number, tangent: Vector, turn: Vector) -> tuple[Vector, Vector]:
        """As ``_end_rates`` for samples; only those at the ends are touched."""
        import numpy as np

        from controller.geometry.arrays import distinct

        at = np.asarray(u, dtype=float)
        ends = np.flatnonzero((at <= 0.0) | (at >= 1.0))
        if not len(ends) or at.ndim == 0:
            return tangent, turn
        t, r = (np.array([np.broadcast_to(c, at.shape) for c in v]) for v in (tangent, turn))
        for end in distinct(at[ends]):
            same = at == end
            rates = self._end_rates(float(end), *(tuple(one[:, same][:, 0]) for one in (t, r)))
            t[:, same], r[:, same] = (np.array(one)[:, None] for one in rates)
        return (t[0], t[1], t[2]), (r[0], r[1], r[2])


@dataclass(frozen=True, slots=True)
class Blend:
    r"""What leads the poses beside one end of a cut over into those of the next one.

        (1 - x)^4 (a + b x + c x^2)      x: 0 at the end, 1 so far from it as the blend reaches

    is added to the tip (mm) and, where ``axis`` is not None, to the unit vector along the axis. At
    x = 1 it is gone with three derivatives; a, b and c say what it is at the end, with two of them.
    """

    at_start: bool  # of the cut, otherwise at its end
    per_u: Number  # 1 / share of u over which it reaches; an array where blends stand in a row
    tip: tuple[Vector, Vector, Vector]  # a, b, c
    axis: tuple[Vector, Vector, Vector] | None

    def onto(self, pose: Pose, u: Number, m: ModuleType) -> Pose:
        """``pose`` at ``u`` (floats, arrays or series) with the blend added."""
        x = self.per_u * u if self.at_start else self.per_u * (1.0 - u)
        if m is math:
            within: Number = x < 1.0
            if not within:
                return pose
        else:
            import numpy as np

            within = np.asarray(x.c[0] if hasattr(x, "c") else x) < 1.0
            if not within.any():
                return pose
        w = (1.0 - x) * (1.0 - x)
        w = w * w * within
        tip, axis = add(pose.tip, _added(self.tip, x, w)), pose.axis
        if self.axis is not None:
            axis = unit(add(axis, _added(self.axis, x, w)), m)
        return Pose(tip, axis)


def _added(terms: tuple[Vector, Vector, Vector], x: Number, w: Number) -> Vector:
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = terms
    return w * (ax + x * (bx + x * cx)), w * (ay + x * (by + x * cy)), w * (az + x * (bz + x * cz))


@dataclass(frozen=True, slots=True)
class Blended(Placed):
    """A placed surface whose poses are led over into those of its neighbours."""

    blends: tuple[Blend, ...] = ()
    _bare: bool = field(init=False, repr=False, compare=False)  # placed as the surface itself has it

    def __post_init__(self) -> None:
        Placed.__post_init__(self)
        single = self.normals_v == AT_LOWER and self.points_v == ENDS
        bare = single and self.through is None and self.taper_rad == self.shift_mm == 0.0
        object.__setattr__(self, "_bare", bare)

    @staticmethod
    def of(placed: Placed, blend: Blend) -> Blended:
        """``placed`` with one more blend."""
        parts = {one.name: getattr(placed, one.name) for one in fields(Placed) if one.init}
        before = placed.blends if isinstance(placed, Blended) else ()
        return Blended(**parts, blends=(*before, blend))

    def pose(self, u: Number, offset_mm: float, m: ModuleType = math) -> Pose:
        """As placed, with the blends."""
        pose = self.base.pose(u, self.offset_mm, m) if self._bare else Placed.pose(self, u, offset_mm, m)
        for blend in self.blends:
            pose = blend.onto(pose, u, m)
        return pose


@dataclass(frozen=True, slots=True)
class Turn(Surface):
    """The tool goes about a standing contact, from one placed pose to another on the same ruling.

    It turns by ``angle_rad`` about the ruling, as a pivot does, and meanwhile evenly takes on what
    the second pose has of its own. There is no surface: ``lower`` only measures the way.
    """

    standing: Vector  # the contact, mm
    about: Vector  # unit vector along the ruling
    start: Pose
    end: Pose
    angle_rad: float
    lower: Curve = field(init=False, repr=False, compare=False)
    upper: Curve = field(init=False, repr=False, compare=False)
    ruling_curve: Curve = field(init=False, repr=False, compare=False)
    _tips: tuple[Vector, Vector] = field(init=False, repr=False, compare=False)  # from the contact
    _axes: tuple[Vector, Vector] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        def back(v: Vector) -> Vector:
            return rotate(self.about, -self.angle_rad, v)

        tips = subtract(self.start.tip, self.standing), back(subtract(self.end.tip, self.standing))
        object.__setattr__(self, "_tips", tips)
        object.__setattr__(self, "_axes", (self.start.axis, back(self.end.axis)))
        line = Line(ZERO, (self._way(), 0.0, 0.0))
        for name, curve in (("lower", line), ("upper", line), ("ruling_curve", Line(self.about, self.about))):
            object.__setattr__(self, name, curve)

    def _way(self) -> float:
        """Of the tip, mm; longer where the axis turns much (degrees, see ``motions.DEG_PER_MM``)."""
        poses = [self.pose(i / 32.0, 0.0) for i in range(33)]
        tips = math.fsum(norm(subtract(a.tip, b.tip)) for a, b in pairwise(poses))
        turned = math.fsum(angle_between(a.axis, b.axis) for a, b in pairwise(poses))
        return max(tips, math.degrees(turned) / DEG_PER_MM, SHORTEST_MM)

    def contact(self, u: Number, m: ModuleType = math) -> Vector:
        return self.standing

    def axis(self, u: Number, m: ModuleType = math) -> Vector:
        return self.pose(u, 0.0, m).axis

    def axis_rate(self, u: float) -> Vector:
        return _axis_rate(self, u)

    def pose(self, u: Number, offset_mm: float, m: ModuleType = math) -> Pose:
        """Tip and axis; there is no offset."""
        (a, b), (c, d), w = self._tips, self._axes, 1.0 - u
        tip, axis = add(scale(a, w), scale(b, u)), unit(add(scale(c, w), scale(d, u)), m)
        angle = self.angle_rad * u
        return Pose(add(self.standing, rotate(self.about, angle, tip, m)), rotate(self.about, angle, axis, m))


def _axis_rate(surface: Surface, u: float) -> Vector:
    """d axis / du as ``Surface.axis_rate`` gives it; needed at poles only, so by differences.

    One-sided ones of the second order, into the block; wider where the axis turns so slowly at
    first that nothing shows, and 0 only where it does not turn at all.
    """
    for step in (1e-6, 1e-3):
        h = step if u < 0.5 else -step
        here, near, far = (surface.axis(x) for x in (u, u + h, u + 2.0 * h))
        rate = scale(subtract(scale(subtract(near, here), 4.0), subtract(far, here)), 0.5 / h)
        if norm(rate) > 1e-9:
            return rate
    return ZERO
