"""What one block does along its own length: a distance in, five joints out.

A motion knows nothing of time. ``plan`` puts a motion law on it, ``tick`` evaluates
it at every period, and both call the same ``joints``; a piece carries the motion
itself, so the tool follows the surface and not points of it.
"""

from __future__ import annotations

from dataclasses import dataclass

from controller.curves import ArcLength, Curve
from controller.geometry import Frame, Pose, scale
from controller.kinematics import Kinematics
from controller.machine import Joints
from controller.surfaces import Surface

Rotaries = tuple[float, float]


@dataclass(frozen=True, slots=True)
class SurfaceCut:
    """The cutter flank along a ruled surface; ``s`` is the arc length of the contact on C1 (mm)."""

    surface: Surface
    arc: ArcLength  # of the surface's lower directrix
    offset_mm: float  # cutter radius, positive on Eq. 5's side (right), negative on the left
    length_mm: float  # of the tool
    part: Frame  # the part frame seen from the table frame

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
        if kinematics.near_pole(axis):
            # The limit from inside the block: ahead at its start, behind at its end.
            rate = self.part.turn(self.surface.axis_rate(u))
            inside = rate if u < 0.5 else scale(rate, -1.0)
        return kinematics.inverse(Pose(self.part.to_parent(tip), axis), near, self.length_mm, inside)


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
    order: tuple[int, int, int, int, int]  # joint i takes value order[i] of (x, y, z, first, second rotary)

    def joints(self, s: float, near: Rotaries, kinematics: Kinematics) -> Joints | None:
        share = s / self.end if self.end > 0.0 else 0.0
        (a0, b0), (a1, b1) = self.start_rotaries, self.end_rotaries
        x, y, z = self.curve.at(share)
        values = (x, y, z, a0 + (a1 - a0) * share, b0 + (b1 - b0) * share)
        order = self.order
        return (values[order[0]], values[order[1]], values[order[2]], values[order[3]], values[order[4]])


Motion = SurfaceCut | JointMove
