"""A spindle's motor with its load: inertia, slip and a speed controller that lags.

    speed   v' = (v* (1 - slip) - v) / lag      within the torque over the inertia
    cut     takes torque away while it turns

All in counts and seconds. In a velocity mode the drive hands in a demand that is the integral of the
speed it was told; a motor that slips never closes the gap to it, so the demand is laid anew where the
motor is, period by period: only its speed counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drives.bench.simulated.servo import STEP_S, Servo

MIN_REV_S = 0.5  # slower than this it does not cut


@dataclass(frozen=True, slots=True)
class MotorParameters:
    """How a spindle turns; the defaults are those of a small servo spindle under a light cut."""

    lag_s: float = 0.010  # of the speed controller, first order
    slip: float = 0.01  # share of the speed that is lost under load
    strongest_rev_s2: float = 200.0  # torque over inertia


class SpindleMotor(Servo):
    """Takes the servo's place in a drive that turns on and on."""

    __slots__ = ("_lag", "_slip", "cutting")

    def __init__(self, position: float, nature: MotorParameters) -> None:
        super().__init__(position)
        self._lag, self._slip = nature.lag_s, nature.slip
        self.cutting = 0.0  # counts/s^2 that the cut takes away; somebody at the bench sets it

    def feel(self, power_rev_s: float, rated_counts_s2: float, counts_per_rev: float) -> None:
        """A chip that takes power, in rated torques times rev/s: the slower it turns, the more torque."""
        rev_s = abs(self.velocity) / counts_per_rev
        self.cutting = rated_counts_s2 * power_rev_s / rev_s if rev_s > MIN_REV_S else 0.0

    def step(self, next_end: float) -> None:
        """One period at the demand's speed, in the short steps of the controller."""
        ahead, speed = next_end - self.end, (self.end - self.start) * self._per_s
        parts = max(1, round(1.0 / (self._per_s * STEP_S)))
        h = 1.0 / (self._per_s * parts)
        for _ in range(parts):
            self._turn(speed, h)
        self.start, self.end = self.position, self.position + ahead

    def _turn(self, speed: float, h: float) -> None:
        if self._jammed:
            self.velocity = 0.0
            return
        strongest = self.strongest
        wanted = (speed * (1.0 - self._slip) - self.velocity) / self._lag
        taken = math.copysign(self.cutting, self.velocity) if self.velocity else 0.0
        self.limited = abs(wanted + taken) > strongest
        pushed = max(-strongest, min(strongest, wanted + taken)) - taken
        before, self.velocity = self.velocity, self.velocity + pushed * h
        self.position += 0.5 * (before + self.velocity) * h

    @property
    def acceleration(self) -> float:
        """What the law asks of the motor now, counts/s^2: its load."""
        speed = (self.end - self.start) * self._per_s
        taken = math.copysign(self.cutting, self.velocity) if self.velocity else 0.0
        return (speed * (1.0 - self._slip) - self.velocity) / self._lag + taken
