"""Machines of three axes: the tool stands along Z, and X Y Z are where its tip is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType

from controller.geometry.touches import Seen
from controller.geometry.vectors import Number, Pose, Vector, Z
from controller.machine.kinematics.protocol import Kinematics
from controller.machine.model import STILL
from controller.messages import Key

LEANS = 1e-6  # sine of the angle to Z: a micron in a metre; what is beyond it is out of reach


class NoRotary(Kinematics):
    """X, Y and Z."""

    turning = 0
    axes = Key("file.axes.three")
    unreached = "reach.stands"

    def branches(
        self,
        axis: Vector,
        m: ModuleType = math,
        inside: Vector | None = None,
        keep: tuple[Number, Number] = STILL,
        seen: Seen | None = None,
    ) -> list[tuple[Number, Number]]:
        """Nothing turns: 0, as floats, samples or series; nan where ``axis`` is not along +Z."""
        x, y, z = (v.c[0] if hasattr(v, "c") else v for v in axis)
        leans = (x * x + y * y > LEANS * LEANS) | (z < 0.0)
        if m is math:
            return [(math.nan, math.nan) if leans else STILL] * 2
        import numpy as np

        still: Number = np.where(leans, math.nan, 0.0)
        if m is not np:
            still = axis[0] * 0.0 + still
        return [(still, still)] * 2

    def linear(
        self, tip: Vector, rotaries: tuple[Number, Number], length_mm: float, m: ModuleType = math
    ) -> Vector:
        x, y, z = tip
        return x, y, z + length_mm

    def forward(self, joints: Sequence[Number], length_mm: float, m: ModuleType = math) -> Pose:
        x, y, z, _, _ = self.spread(joints)
        return Pose((x, y, z - length_mm), Z)
