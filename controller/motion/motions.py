"""What one block does along its own length: a distance in, joints out.

A motion knows nothing of time. ``plan`` puts a motion law on it, ``tick`` evaluates
it at every period, and both call the same ``joints``; a piece carries the motion
itself, so the tool follows the surface and not points of it.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from dataclasses import dataclass
from types import ModuleType

from controller.geometry.curves import ArcLength, Curve
from controller.geometry.surfaces import Surface
from controller.geometry.touches import Seen, Touch, seen_along, seen_at
from controller.geometry.vectors import Frame, Number, Pose, Vector, scale
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints

Rotaries = tuple[float, float]

# Lines that turn the tool by more than this per millimetre of the tip are measured by
# their turn: s is then degrees / DEG_PER_MM, so that no rotary's rate over s is beyond it.
DEG_PER_MM = 10.0


@dataclass(frozen=True, slots=True)
class SurfaceCut:
    """The cutter flank along a ruled surface; ``s`` is the arc length of the contact on C1 (mm)."""

    surface: Surface
    arc: ArcLength  # of the surface's lower directrix
    offset_mm: float  # cutter radius, positive on Eq. 5's side (right), negative on the left
    length_mm: float  # of the tool
    part: Frame  # the part frame seen from the table frame
    touches: tuple[Touch, ...] = ()  # where its axis touches the pole of this machine
    beside_pole: tuple[float, ...] = ()  # u where it passes so near by that a rotary turns within little way

    @property
    def end(self) -> float:
        """Length of the motion, in the unit of ``s``."""
        return self.arc.length_mm

    def pose(self, s: float) -> Pose:
        """Tip and axis in the part frame (Eq. 5 and Eq. 8, upward)."""
        return self.surface.pose(self.arc.u_at(s), self.offset_mm)

    def joints(self, s: float, near: Rotaries, kinematics: Kinematics) -> Joints | None:
        """Joints at ``s`` on the branch and turn nearest ``near``; None where it is lost."""
        u = self.arc.u_at(s)
        tip, axis = self.surface.pose(u, self.offset_mm)
        axis = self.part.turn(axis)
        inside = None
        seen = seen_at(self.touches, u)
        if seen is None and kinematics.near_pole(axis):
            # The limit from inside the block: ahead at its start, behind at its end.
            rate = self.part.turn(self.surface.axis_rate(u))
            inside = rate if u < 0.5 else scale(rate, -1.0)
        return kinematics.inverse(Pose(self.part.to_parent(tip), axis), near, self.length_mm, inside, seen)

    def seen_along(self, u: Number, axis: Vector, kinematics: Kinematics, m: ModuleType) -> Seen | None:
        """The ``axis`` (table frame) at samples or series ``u`` with its touches told; None: it has none."""
        return seen_along(self.touches, u, kinematics.seen(axis), m) if self.touches else None


@dataclass(frozen=True, slots=True)
class JointMove:
    """X Y Z along a line or an arc of joint space while the rotaries turn evenly.

    ``s`` runs from 0 to ``end``: millimetres of X Y Z, or, where only rotaries
    move, degrees. Rapids, leads, retracts, pivots and G0 to G3 are all of this kind.
    """

    curve: Curve  # X, Y, Z as machine positions over 0 <= s / end <= 1, evenly
    end: float
    start_rotaries: Rotaries
    end_rotaries: Rotaries

    def joints(self, s: float, near: Rotaries, kinematics: Kinematics) -> Joints | None:
        share = s / self.end if self.end > 0.0 else 0.0
        (a0, b0), (a1, b1) = self.start_rotaries, self.end_rotaries
        x, y, z = self.curve.at(share)
        return kinematics.arrange((x, y, z, a0 + (a1 - a0) * share, b0 + (b1 - b0) * share))


@dataclass(frozen=True, slots=True)
class ThreadMove(JointMove):
    """A straight line of X Y Z that the spindle's angle leads (G33, G33.1, G84, G74); the rotaries stand.

    At ``s`` the spindle has turned ``begin_rev`` + ``rev_per_mm`` s since the thread began, positive as
    M3 turns; where that is 0 the tool is out of the thread.
    """

    rev_per_mm: float = 1.0
    begin_rev: float = 0.0
    spindle_mm_s2: float = math.inf  # along the thread, of the spindle
    give_mm_s: float = 0.0  # of the axes' limits what is left for following a spindle that lags
    give_mm_s2: float = 0.0

    @property
    def direction(self) -> Vector:
        """Unit vector of X Y Z."""
        return scale(self.curve.derivative(0.0), 1.0 / self.end)


@dataclass(frozen=True, slots=True)
class ToolLine:
    """One exact line of the tip in the part frame (G43.4, G43.5) while the tool axis turns evenly.

    The axis runs along the great circle axis cos(angle) + across sin(angle), or, where
    ``even``, both rotaries turn evenly. ``s`` runs from 0 to ``end``: millimetres of the
    tip, or degrees of the turn where the tip stands (see ``DEG_PER_MM`` for what lies between).
    """

    tip: Vector  # at the start, table frame
    way: Vector  # of the tip, from start to end
    axis: Vector  # at the start, table frame
    across: Vector  # unit vector across ``axis``, towards which it turns
    angle_rad: float
    start_rotaries: Rotaries
    end_rotaries: Rotaries
    even: bool
    length_mm: float  # of the tool
    end: float

    @property
    def tip_rate(self) -> float:
        """Millimetres of the tip per unit of s; 1 where the tip stands and s is in degrees."""
        x, y, z = self.way
        return math.sqrt(x * x + y * y + z * z) / self.end or 1.0

    def joints(self, s: float, near: Rotaries, kinematics: Kinematics) -> Joints | None:
        """Joints at ``s`` on the branch and turn nearest ``near``; None where it is lost."""
        share = s / self.end
        (x, y, z), (dx, dy, dz) = self.tip, self.way
        tip = (x + dx * share, y + dy * share, z + dz * share)
        if self.even:
            (a0, b0), (a1, b1) = self.start_rotaries, self.end_rotaries
            a, b = a0 + (a1 - a0) * share, b0 + (b1 - b0) * share
            x, y, z = kinematics.linear(tip, (a, b), self.length_mm)
            return kinematics.arrange((x, y, z, a, b))
        angle = self.angle_rad * share
        c, w = math.cos(angle), math.sin(angle)
        (ax, ay, az), (bx, by, bz) = self.axis, self.across
        axis = (ax * c + bx * w, ay * c + by * w, az * c + bz * w)
        inside = None
        if kinematics.near_pole(axis):
            # The limit from inside the line: ahead at its start, behind at its end.
            rate = (bx * c - ax * w, by * c - ay * w, bz * c - az * w)
            inside = scale(rate, self.angle_rad if share < 0.5 else -self.angle_rad)
        return kinematics.inverse(Pose(tip, axis), near, self.length_mm, inside)


ROW = 20  # numbers of one span of a ToolSpline: c0 .. c3 of X Y Z and of both rotaries


@dataclass(frozen=True, slots=True, eq=False)
class ToolSpline:
    """Many program lines as one smooth path (G64): cubics of X Y Z and both rotaries, C2 in ``s``.

    Span i reaches from ``knots[i]`` to ``knots[i + 1]``; its twenty numbers are c0 to c3
    of X, then Y, Z (mm), first and second rotary (rad), in powers of s - knots[i]. With
    ``tips`` X Y Z are those of the tool's tip in the table frame (G43.4, G43.5), otherwise
    machine positions. ``s`` is the length of the programmed lines, so the tip moves close
    to one millimetre per unit of s, less where a corner is cut.
    """

    knots: array[float]  # "d", n + 1 rising numbers from 0.0
    spans: array[float]  # "d", n x ROW numbers
    tips: bool
    length_mm: float  # of the tool
    lines: array[int]  # "l": program lines, in order of their s
    lines_s: array[float]  # "d": where each begins; the first at 0.0 or before

    @property
    def end(self) -> float:
        return self.knots[-1]

    def line_at(self, s: float) -> int:
        """The program line (1-based) whose motion is at ``s``."""
        return self.lines[self.index_at(s)]

    def index_at(self, s: float) -> int:
        """The place in ``lines`` of the motion at ``s``."""
        return max(0, bisect_right(self.lines_s, s) - 1)

    def joints(self, s: float, near: Rotaries, kinematics: Kinematics) -> Joints | None:
        """Joints at ``s``; the turns of the rotaries are its own, ``near`` is not needed."""
        knots = self.knots
        i = bisect_right(knots, s) - 1
        if i < 0:
            i = 0
        elif i > len(knots) - 2:
            i = len(knots) - 2
        h = s - knots[i]
        i *= ROW
        (x0, x1, x2, x3, y0, y1, y2, y3, z0, z1, z2, z3, a0, a1, a2, a3, b0, b1, b2, b3) = self.spans[
            i : i + ROW
        ]
        x = x0 + h * (x1 + h * (x2 + h * x3))
        y = y0 + h * (y1 + h * (y2 + h * y3))
        z = z0 + h * (z1 + h * (z2 + h * z3))
        a = a0 + h * (a1 + h * (a2 + h * a3))
        b = b0 + h * (b1 + h * (b2 + h * b3))
        if self.tips:
            x, y, z = kinematics.linear((x, y, z), (a, b), self.length_mm)
        return kinematics.arrange((x, y, z, a, b))


Motion = SurfaceCut | JointMove | ToolLine | ToolSpline
