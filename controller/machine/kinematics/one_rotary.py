"""Machines of four axes: X, Y, Z and a rotary, on the table or in the head.

R(w, t) O = z turns the tool axis O of the table frame onto the spindle's z: t = q of a table, -q of a head.
It does so where O has z's height along w, and then t is the angle from O to z about w. A rotary along z, such
as a round table that lies flat, tilts nothing: O is z, and it stands wherever the program has put it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType

from controller.geometry.touches import Seen
from controller.geometry.vectors import Number, Pose, Vector, Z, add, cross, dot, norm, unit
from controller.machine.kinematics.protocol import Kinematics
from controller.machine.kinematics.rotary import Line, spun, turned
from controller.machine.model import STILL, Kind, Machine
from controller.messages import Key

LEANS = 1e-6  # mm per mm by which an axis may miss what the rotary reaches


class OneRotary(Kinematics):
    """X, Y, Z and a rotary."""

    turning = 1
    axes = Key("file.axes.four")
    unreached = "reach.none_of_one"

    def __init__(self, machine: Machine) -> None:
        super().__init__(machine)
        (index,) = machine.rotary()
        axis = machine.axes[index]
        self._line = Line(unit(axis.direction), axis.point_mm)
        self._in_head = axis.kind is Kind.HEAD
        self._height = dot(self._line.direction, Z)
        self._tilts = norm(cross(self._line.direction, Z)) > LEANS

    def branches(
        self,
        axis: Vector,
        m: ModuleType = math,
        inside: Vector | None = None,
        keep: tuple[Number, Number] = STILL,
        seen: Seen | None = None,
    ) -> list[tuple[Number, Number]]:
        """The one position, twice; nan out of reach. A rotary that tilts nothing stays in ``keep``."""
        w, zero = self._line.direction, 0.0 * (axis[0] + axis[1] + axis[2])
        height = dot(axis, w)
        out = self._misses(axis, height)
        if m is math:
            zero = math.nan if out else zero
        else:
            import numpy as np

            if np.any(out):
                zero = zero + np.where(out, math.nan, 0.0)
        if not self._tilts:
            return [(zero + keep[0], zero)] * 2
        angle = m.atan2(dot(w, cross(axis, Z)), axis[2] - height * self._height) + zero
        return [(-angle if self._in_head else angle, zero)] * 2

    def _misses(self, axis: Vector, height: Number) -> Number:
        """Whether the rotary cannot give ``axis``: it is on another cone about it, or the wrong way up."""
        height, up = (v.c[0] if hasattr(v, "c") else v for v in (height, axis[2]))
        return (abs(height - self._height) > LEANS) | ((not self._tilts) & (up < 0.0))

    def linear(
        self, tip: Vector, rotaries: tuple[Number, Number], length_mm: float, m: ModuleType = math
    ) -> Vector:
        (hx, hy, hz), (x, y, z) = self._head_vector(rotaries[0], length_mm, m), tip
        if not self._in_head:
            x, y, z = turned(self._line, rotaries[0], tip, m)
        return x - hx, y - hy, z - hz

    def _head_vector(self, angle: Number, length_mm: float, m: ModuleType) -> Vector:
        """From the gauge point to the tip."""
        vector: Vector = (0.0, 0.0, -length_mm)
        return turned(self._line, angle, vector, m) if self._in_head else vector

    def forward(self, joints: Sequence[Number], length_mm: float, m: ModuleType = math) -> Pose:
        x, y, z, angle, _ = self.spread(joints)
        tip = add((x, y, z), self._head_vector(angle, length_mm, m))
        if self._in_head:
            return Pose(tip, spun(self._line.direction, angle, Z, m))
        return Pose(turned(self._line, -angle, tip, m), spun(self._line.direction, -angle, Z, m))
