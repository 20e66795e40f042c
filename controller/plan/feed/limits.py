"""What the limits of the joints allow on a path whose derivatives are known (``surfaces.rates``)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.model import Machine
from controller.plan.surfaces.rates import Derivatives


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of the joints as arrays (axes,), in mm or rad."""

    velocity: Array
    acceleration: Array
    jerk: Array

    @staticmethod
    def of(machine: Machine, share: float = 1.0) -> JointLimits:
        limits = [axis.limits for axis in machine.axes]
        return JointLimits(
            np.array([x.velocity for x in limits]) * share,
            np.array([x.acceleration for x in limits]) * share,
            np.array([x.jerk for x in limits]) * share,
        )

    def path_speed(self, d: Derivatives) -> Array:
        """Largest speed along the path that the velocity limits and, at a = 0, the others allow (N,)."""
        return d.even_speed(self.velocity, self.acceleration, self.jerk)

    def braking_s(self, rates: Array) -> Array:
        """Seconds in which each joint alone comes to rest from its ``rates`` (N, axes), either way.

        At the rest of a law c1 + x (2 c2 + 3 c3 x) leaves a rounding of some 1e-14 of either sign.
        """
        speed = np.abs(rates)
        by_jerk = 2.0 * np.sqrt(speed / self.jerk)
        by_acceleration = speed / self.acceleration + self.acceleration / self.jerk
        return np.where(speed * self.jerk > self.acceleration**2, by_acceleration, by_jerk)


def ramp_length(speed: float, jerk: float) -> float:
    """Length of a start from rest to ``speed`` with jerk +j then -j: v t / 2 with t = 2 sqrt(v / j)."""
    return speed * math.sqrt(speed / jerk)
