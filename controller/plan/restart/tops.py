"""How high the part is, as far as a path says: the highest that its feed moves have been stands for it."""

from __future__ import annotations

import numpy as np

from controller.geometry.arrays import rows
from controller.geometry.vectors import Vector
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment

SIDE = 33  # samples along a motion
MAX_POINTS = 20_000  # points


class Tops:
    """Points of the table frame that are at least as high as what has been cut."""

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        self._points: list[Vector] = []

    def note(self, segment: Segment, length_mm: float) -> None:
        """What a motion cuts with a tool of that length."""
        if segment.feed_mm_s is None:
            return
        self._points += self._of(segment, length_mm)
        if len(self._points) > MAX_POINTS:
            self._points = _extremes(self._points)

    def take(self, other: Tops) -> None:
        """Those of a path before this one."""
        self._points += other._points

    def above(self, joints: Joints, length_mm: float) -> float:
        """How far (mm) the highest is above the tip, along the tool axis; 0 where none is."""
        (x, y, z), (a, b, c) = self._kinematics.forward(joints, length_mm)
        return max((a * (p - x) + b * (q - y) + c * (r - z) for p, q, r in self._points), default=0.0)

    def _of(self, segment: Segment, length_mm: float) -> list[Vector]:
        kinematics = self._kinematics
        if (cut := segment.cut) is not None:
            u = np.linspace(0.0, 1.0, SIDE)
            top, tip = cut.surface.point(u, 0.0 * u, np), cut.surface.contact(u, np)
            return [*_points(cut.part.to_parent(top)), *_points(cut.part.to_parent(tip))]
        if segment.name == "line":
            return [kinematics.forward(joints, length_mm).tip for joints in (segment.start, segment.end)]
        joints = joints_along(segment, np.linspace(0.0, segment.motion.end, SIDE), kinematics)
        return _points(kinematics.forward(tuple(joints.T), length_mm, np).tip)


def _points(xyz: Vector) -> list[Vector]:
    x, y, z = np.broadcast_arrays(*xyz)
    return [(float(a), float(b), float(c)) for a, b, c in zip(x, y, z, strict=True)]


def _extremes(points: list[Vector]) -> list[Vector]:
    """Corners of the box of points: no lower in any direction than they are."""
    found = rows(tuple(zip(*points, strict=True)), (len(points),))
    low, high = found.min(axis=1), found.max(axis=1)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    return [(float(x), float(y), float(z)) for x, y, z in corners]
