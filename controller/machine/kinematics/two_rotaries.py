"""Two-rotary machines in closed form: joints from a pose and a pose from joints.

Every such machine, whatever its axis directions, turns the tool axis O of the table
frame onto the spindle's z by two rotations in a row (DESIGN section 1):

    R(w1, t1) R(w2, t2) O = z        w2 next to the work, w1 next to the tool

    two tables     w1 = base,            t1 = q_base     w2 = work,           t2 = q_work
    table, head    w1 = head,            t1 = -q_head    w2 = table,          t2 = q_table
    two heads      w1 = the tool's head, t1 = -q_tool    w2 = the base's head, t2 = -q_base

This is Paden-Kahan subproblem 2: c = R(w2, t2) O keeps O's height along w2 and, for
R(w1, t1) c = z, has z's height along w1. Two heights and the length leave two
points, c = (A, +-G) in the plane across w2, or one, or none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType

from controller.geometry.touches import Seen
from controller.geometry.vectors import (
    ZERO,
    Frame,
    Number,
    Pose,
    Vector,
    Z,
    add,
    angle_between,
    cross,
    dot,
    norm,
    rotate,
    scale,
    subtract,
    unit,
)
from controller.machine.kinematics.protocol import TURN, Kinematics, Pair
from controller.machine.kinematics.rotary import Line, spun, turned
from controller.machine.model import Kind, Machine
from controller.messages import Key

NEAR_POLE = 1e-9  # sine of the angle between tool axis and w2 below which w2's angle is a limit
CLEAR_OF_POLE = 1e-3  # the same sine above which third derivatives keep nine digits
STILL = 1e-12  # an axis that leaves the pole slower than this (1/u) does not leave it
# A pair of rotaries as it was measured misses its pole by a hair. There the tool axis gives way, by what is
# missed at most: no rotary could make up for it, and beside a limit of reach both would have to jump.
HAIR = 0.004  # sine by which a pole may be missed and still be one: 0.23 degrees, both rotaries together
SOFT = 1e-3  # sine of the angle to it at which half is made up for, or what is missed where that is more
SPILL = 1e-13  # square of a reach overshot by rounding


class TwoRotaries(Kinematics):
    """X, Y, Z and two rotaries that tilt the tool against the work."""

    turning = 2
    axes = Key("file.axes.five")

    def __init__(self, machine: Machine) -> None:
        super().__init__(machine)
        first, second = machine.rotary()
        self._tables: list[tuple[int, Line]] = []  # (0 or 1 of the rotary pair, line), base to work
        self._heads: list[tuple[int, Line]] = []  # likewise, base to tool
        for i, axis in enumerate((machine.axes[first], machine.axes[second])):
            row = (i, Line(unit(axis.direction), axis.point_mm))
            (self._tables if axis.kind is Kind.TABLE else self._heads).append(row)
        # A point turns with the innermost body first: the work, the tool.
        self._tables_inward, self._heads_inward = tuple(self._tables[::-1]), tuple(self._heads[::-1])
        # From the work to the tool: the last table first, the last head last.
        chain = [(i, line, 1.0) for i, line in self._tables_inward]
        chain += [(i, line, -1.0) for i, line in self._heads]
        (i2, near_work, self._sign2), (_, near_tool, self._sign1) = chain
        self._work_first = i2 == 0
        self._prepare(near_work.direction, near_tool.direction, machine.name)

    def _prepare(self, w2: Vector, w1: Vector, name: str) -> None:
        """The constants of the closed form; ValueError for a pair that has none."""
        across = norm(cross(w1, w2))
        if across < 1e-6 or norm(cross(w1, Z)) < 1e-6:
            what = "the other rotary" if across < 1e-6 else "the spindle"
            raise ValueError(
                f"Machine {name}: the rotary next to the tool is parallel to {what}; "
                "such a pair does not tilt the tool to all sides."
            )
        self._w2, self._cosine, self._across, self._height = w2, dot(w1, w2), across, dot(w1, Z)
        # e1, e2 span the plane across w2, f1, f2 the one across w1; e1 and f1 are what lies
        # of the other axis in it.
        self._e1 = scale(subtract(w1, scale(w2, self._cosine)), 1.0 / across)
        self._e2 = cross(w2, self._e1)
        f1 = scale(subtract(w2, scale(w1, self._cosine)), 1.0 / across)
        self._z1, self._z2 = dot(f1, Z), dot(cross(w1, f1), Z)
        # Where O reaches +-w2, A = (height - cosine (O w2)) / across: what is left of it there.
        # Usually 0, and then it is taken as such: the pole is a pole only on this machine.
        left = [0.0 if abs(x) < 1e-14 else x for x in (self._height - s * self._cosine for s in (1, -1))]
        missed = [x if abs(x) < HAIR else 0.0 for x in left]
        self._missed = tuple((x, max(abs(x) / across, SOFT) ** 8) for x in missed)
        self._left = tuple(0.0 if hair else x for hair, x in zip(missed, left, strict=True))
        self.lean_rad = max(abs(x) for x in missed) / across

    # ---- from the pose to the joints ---------------------------------------------

    def _across_work(self, axis: Vector) -> tuple[Number, Number, Number]:
        """(a, b) of ``axis`` in the plane across w2, and its height along w2."""
        (x, y, z), (ax, ay, az), (bx, by, bz), (hx, hy, hz) = axis, self._e1, self._e2, self._w2
        return x * ax + y * ay + z * az, x * bx + y * by + z * bz, x * hx + y * hy + z * hz

    def seen(self, axis: Vector) -> Seen:
        """``axis`` as the rotary next to the work sees it."""
        return Seen(*self._across_work(axis), 1.0)

    def work_frame(self) -> tuple[Vector, Vector, Vector]:
        """Unit vectors (table frame) that ``Seen`` counts along: two across w2, and w2."""
        return self._e1, self._e2, self._w2

    def reaches_pole(self, side: float) -> bool:
        """Whether the tool axis can stand along w2 (``side`` > 0) or against it."""
        return self._left[0 if side > 0.0 else 1] == 0.0

    def near_pole(self, axis: Vector) -> bool:
        """Whether ``axis`` (floats) is so near +-w2 that the work's rotary takes its limit from inside."""
        a, b, _ = self._across_work(axis)
        return bool(a * a + b * b < NEAR_POLE * NEAR_POLE)

    def is_clear_of_pole(self, axis: Vector) -> bool:
        """Whether the rotaries' derivatives keep their digits where the tool is along ``axis`` (floats)."""
        return bool(self.off_pole(axis) > CLEAR_OF_POLE)

    @property
    def work(self) -> int:
        """Which of the two rotaries (0 or 1) stands next to the work: at a pole it is free."""
        return 0 if self._work_first else 1

    def off_pole(self, axis: Vector, m: ModuleType = math) -> Number:
        """Sine of the angle between the tool axis and the axis of the rotary next to the work."""
        a, b, _ = self._across_work(axis)
        return m.sqrt(a * a + b * b)

    @property
    def is_bounded(self) -> bool:
        """Whether some tool axes are out of reach, as beyond what an oblique rotary tilts the tool."""
        return any(self._left) or abs(self._cosine) > STILL

    def nearest_reached(self, axis: Vector, most_rad: float) -> Vector:
        """``axis`` (floats), or the nearest one in reach where that is no further off than ``most_rad``.

        The tool is as far from w2 as two sides of a triangle of angles let it be: those between w1, w2 and z.
        """
        one, two = math.acos(self._cosine), math.acos(self._height)
        off, across = angle_between(self._w2, axis), cross(self._w2, axis)
        last = one + two if one + two <= math.pi else TURN - one - two
        missed = min(max(off, abs(one - two)), last) - off
        if missed == 0.0 or abs(missed) > most_rad or norm(across) < NEAR_POLE:
            return axis
        return rotate(unit(across), missed, axis)

    def off_limit(self, axis: Vector) -> Number:
        """Sine of the angle from where both branches are one, of axes whose components are (N,).

        0 at the limit of reach and beyond; 1 on machines that reach every axis.
        """
        import numpy as np

        a, b, h = self._across_work(axis)
        square = a * a + b * b
        left, side = self._left_at(h, np)
        c = (left + (square / (1.0 + side * h)) * (self._cosine * side)) / self._across
        off = 1.0 - c * c / np.maximum(square, NEAR_POLE * NEAR_POLE)
        return np.sqrt(np.maximum(off, 0.0))

    def _solve(
        self, axis: Vector, m: ModuleType, inside: Vector | None, seen: Seen | None
    ) -> tuple[tuple[Number, Number], tuple[Number, Number], Number]:
        """(t1, t2) of both branches (nan out of reach), and whether t2 is undetermined.

        a, b, c and r are those of the axis over rho: t2 needs their ratios only, and where
        rho is 0 they stay. With a rho that changes its sign G does, so each branch goes on.
        """
        a, b, h, rho = seen or self.seen(axis)
        square = a * a + b * b
        # A = (height - cosine h) / across; near the pole 1 - |h| = square / (1 + |h|),
        # without the cancellation which would drown A in rounding there.
        left, side = self._left_at(h, m)
        c = (left + (square / (1.0 + side * h)) * (self._cosine * side) * rho) / self._across
        if self.lean_rad:
            c = c + self._made_up(square, rho, side, m)
        a, b, c, r, g, lost = self._limit(a, b, c, square, inside, m)
        g = g * rho
        # Height along w1 is fixed, so along f1 c has what h and that height leave over.
        base = (h - self._cosine * self._height) / self._across
        z1, z2 = self._z1, self._z2
        sine, cosine = base * z2, base * z1
        one = m.atan2(sine + g * z1, cosine - g * z2), m.atan2(a * r - b * c, a * c + b * r)
        other = m.atan2(sine - g * z1, cosine + g * z2), m.atan2(-a * r - b * c, a * c - b * r)
        return one, other, lost

    def _left_at(self, h: Number, m: ModuleType) -> tuple[Number, Number]:
        above, below = self._left
        if m is math:
            return (above, 1.0) if h >= 0.0 else (below, -1.0)
        import numpy as np

        sign = np.where(np.asarray(_value(h)) >= 0.0, 1.0, -1.0)
        return np.where(sign > 0.0, above, below), sign

    def _made_up(self, square: Number, rho: Number, side: Number, m: ModuleType) -> Number:
        """What a pole that is missed by a hair needs of c: all of it far from there, nothing at the pole.

        The axis is r = sqrt(rho^2 square) off w2; c is missed r^8 / (r^8 + soft^8), over rho: at the pole of
        higher order than c is without it, and below 0.7 r everywhere, so within reach.
        """
        (above, above8), (below, below8) = self._missed
        if m is math:
            missed, soft8 = (above, above8) if side > 0.0 else (below, below8)
        else:
            import numpy as np

            missed, soft8 = np.where(side > 0.0, above, below), np.where(side > 0.0, above8, below8)
        off = rho * rho * square
        cube = off * off * off
        return missed * rho * square * cube / ((soft8 + off * cube) * self._across)

    def _limit(
        self, a: Number, b: Number, c: Number, square: Number, inside: Vector | None, m: ModuleType
    ) -> tuple[Number, Number, Number, Number, Number, Number]:
        """(a, b, c, r) that tell t2's direction, G for t1, and whether t2 is undetermined.

        At the pole (a, b) comes from ``inside``; c is of second order there and r, which
        is G elsewhere, stands for its sign.
        """
        tiny = NEAR_POLE * NEAR_POLE
        if m is math:
            g = _root(square - c * c)
            if square >= tiny:
                return a, b, c, g, g, False
            a, b, _ = self._across_work(inside or ZERO)
            return a, b, 0.0, 1.0, g, math.hypot(a, b) <= STILL
        import numpy as np

        pole = np.asarray(_value(square) < tiny)
        if not pole.any():
            g = _roots(square - c * c) if m is np else m.sqrt(square - c * c)
            return a, b, c, g, g, pole
        ia, ib, _ = self._across_work(inside or ZERO)
        if m is not np:
            return _leave_pole(pole, (a, b, c), (ia, ib), inside is not None, m)
        g = _roots(square - c * c)
        limit = (np.where(pole, at, x) for at, x in ((ia, a), (ib, b), (0.0, c), (1.0, g)))
        return (*limit, g, pole & (np.hypot(ia, ib) <= STILL))

    def branches(
        self,
        axis: Vector,
        m: ModuleType = math,
        inside: Vector | None = None,
        keep: tuple[Number, Number] = (0.0, 0.0),
        seen: Seen | None = None,
    ) -> list[tuple[Number, Number]]:
        """Both (first, second) rotary pairs, in the machine's order, that put the spindle along ``axis``.

        Principal values (rad, carried sense); nan where ``axis`` is out of reach. At
        the pole the work's rotary follows ``inside``, a vector towards where the axis
        is just inside the block; without one it keeps its place in ``keep``. Series
        (``m=jets``) that start at a pole leave it ahead, or to ``inside``; the third
        derivative of the work's rotary is not told there. With ``seen``, of a cut that
        touches the pole, nothing is undetermined, and no branch changes its name there.
        """
        *solutions, lost = self._solve(axis, m, inside, seen)
        kept = keep[0] if self._work_first else keep[1]
        pairs = []
        for t1, t2 in solutions:
            q1, q2 = t1 * self._sign1, t2 * self._sign2
            if m is math:
                if lost:  # a pole out of reach, as straight down under an oblique head, has no place at all
                    q2 = t1 if math.isnan(t1) else kept
            elif lost.any():
                out = _value(t1) != _value(t1)  # nan
                q2 = _held_where_undetermined(
                    _held_where_undetermined(q2, lost & ~out, kept), lost & out, math.nan
                )
            pairs.append((q2, q1) if self._work_first else (q1, q2))
        return pairs

    def linear(
        self, tip: Vector, rotaries: tuple[Number, Number], length_mm: float, m: ModuleType = math
    ) -> Vector:
        """X, Y, Z (mm) that bring the tip of a tool to ``tip`` of the table frame."""
        for i, line in self._tables_inward:
            tip = turned(line, rotaries[i], tip, m)
        (x, y, z), (hx, hy, hz) = tip, self._head_vector(rotaries, length_mm, m)
        return x - hx, y - hy, z - hz

    def of_axes(self, frame: Frame, rotaries: Pair, length_mm: float) -> Frame:
        """A frame of the table in which X Y Z of a tip are read, as the linear axes see it.

        While the rotaries stand (floats, rad), positions of X Y Z are places of that frame.
        """
        found = []
        for v in (frame.x, frame.y, frame.z):
            for i, line in self._tables_inward:
                v = spun(line.direction, rotaries[i], v, math)
            found.append(v)
        return Frame(self.linear(frame.origin, rotaries, length_mm), *found)

    def _head_vector(self, rotaries: tuple[Number, Number], length_mm: float, m: ModuleType) -> Vector:
        """From the gauge point, where the heads' lines are given from, to the tip."""
        vector: Vector = (0.0, 0.0, -length_mm)
        for i, line in self._heads_inward:
            vector = turned(line, rotaries[i], vector, m)
        return vector

    # ---- from the joints to the pose ---------------------------------------------

    def forward(self, joints: Sequence[Number], length_mm: float, m: ModuleType = math) -> Pose:
        """Pose in the table frame (rotaries at zero) from joints in the order of ``machine.axes``."""
        x, y, z, *pair = self.spread(joints)
        rotaries = (pair[0], pair[1])
        tip = add((x, y, z), self._head_vector(rotaries, length_mm, m))
        axis: Vector = Z
        for i, line in self._heads_inward:
            axis = spun(line.direction, rotaries[i], axis, m)
        for i, line in self._tables:
            tip = turned(line, -rotaries[i], tip, m)
            axis = spun(line.direction, -rotaries[i], axis, m)
        return Pose(tip, axis)


def _value(number: Number) -> Number:
    """The value a series has at its centre; floats and arrays as they are."""
    return number.c[0] if hasattr(number, "c") else number


def _root(square: float) -> float:
    """Square root that is nan out of reach, forgiving what rounding oversteps."""
    return math.sqrt(square) if square > 0.0 else 0.0 if square > -SPILL else math.nan


def _roots(square: Number) -> Number:
    import numpy as np

    return np.sqrt(np.where(square > -SPILL, np.maximum(square, 0.0), np.nan))


def _held_where_undetermined(angle: Number, lost: Number, kept: Number) -> Number:
    """``kept``, standing still, where the angle is undetermined."""
    import numpy as np

    if not hasattr(angle, "c"):
        return np.where(lost, kept, angle)
    still = np.zeros(np.shape(angle.c))
    still[0] = kept
    return type(angle)(np.where(lost, still, angle.c))


def _leave_pole(
    pole: Number,
    series: tuple[Number, Number, Number],
    inside: tuple[Number, Number],
    known: bool,
    m: ModuleType,
) -> tuple[Number, Number, Number, Number, Number, Number]:
    """As ``TwoRotaries._limit`` for series that start at a pole: (a, b) = h (a', b'), so G = |h| G'.

    |h| is h ahead and -h behind: ``inside`` tells, and the sign stays with G'.
    """
    import numpy as np

    ahead = [np.concatenate((x.c[1:], np.zeros_like(x.c[:1]))) for x in series]
    lost = pole & (np.max(np.abs(ahead[0][:3]) + np.abs(ahead[1][:3]), axis=0) <= STILL)
    side = np.where(ahead[0][0] * inside[0] + ahead[1][0] * inside[1] < 0.0, -1.0, 1.0) if known else 1.0
    ahead[0][0] = np.where(lost, 1.0, ahead[0][0])  # any number: what comes of it is not used
    make = type(series[0])
    a, b, c = (make(np.where(pole, y, x.c)) for x, y in zip(series, ahead, strict=True))
    r = m.sqrt(a * a + b * b - c * c) * np.where(pole, side, 1.0)
    behind = np.concatenate((np.zeros_like(r.c[:1]), r.c[:-1])) * np.where(lost, 0.0, 1.0)
    return a, b, c, r, make(np.where(pole, behind, r.c)), lost
