"""The servo and motor of a simulated drive: a second-order lag, solved exactly per period.

Between two SYNCs the drive interpolates its demand linearly from one setpoint to the
next (60C2h), and position x follows demand r as

    x'' = w^2 (r - x) + 2 d w (f r' - x')        w natural frequency, d damping,
                                                 f share of velocity feed-forward

For a linear demand r = r0 + v t the solution is  x = r - lag v + (decaying part),
lag = 2 d (1 - f) / w, and the decaying part is one constant 2 x 2 matrix per period.
A velocity v' that the controller sends (60B1h) leads: x = r - lag v + 2 d v' / w,
and so does a torque (60B2h) that would accelerate by a': x = r - lag v + a' / w^2.

Why 60 Hz and d = 1/sqrt(2): position loops of machine-tool servos reach some 40 to
80 Hz. Equal lags on all axes only delay a path, they bend it from the second order
on: to x(t) = r(t - lag) + (2 d^2 - 1)/w^2 r'' + ..., a term that vanishes at
d = 1/sqrt(2) (the maximally flat response) and would be 7 um per 1000 mm/s^2 at
d = 1. What is left, sqrt(2)/3 r'''/w^3, is below 1 um at 50000 mm/s^3.
"""

from __future__ import annotations

import math

NATURAL_FREQUENCY_HZ = 60.0
DAMPING = math.sqrt(0.5)


class Servo:
    """Position and velocity (counts, counts/s) of one motor; ``step`` moves it by one period."""

    __slots__ = (
        "_a11",
        "_a12",
        "_a21",
        "_a22",
        "_bend_s2",
        "_lag_s",
        "_lead_s",
        "_per_s",
        "end",
        "lead",
        "position",
        "start",
        "velocity",
    )

    def __init__(self, position: float = 0.0) -> None:
        self.position = position
        self.velocity = 0.0
        self.start = position  # demand now ...
        self.end = position  # ... and at the end of the period that runs
        self.lead = 0.0  # counts by which offsets of velocity and torque lead

    def tune(self, period_s: float, frequency_hz: float, damping: float, feed_forward: float) -> None:
        """Precompute a period. Raises ValueError for a damping outside of 0 < d < 1."""
        if not 0.0 < damping < 1.0:
            raise ValueError(f"damping is {damping}; allowed is 0 < damping < 1")
        w = 2.0 * math.pi * frequency_hz
        decay, swing = damping * w, w * math.sqrt(1.0 - damping * damping)
        gain = math.exp(-decay * period_s)
        cos, sin = math.cos(swing * period_s), math.sin(swing * period_s)
        self._a11 = gain * (cos + decay / swing * sin)
        self._a12 = gain * sin / swing
        self._a21 = -gain * w * w / swing * sin
        self._a22 = gain * (cos - decay / swing * sin)
        self._lead_s = 2.0 * damping / w
        self._bend_s2 = 1.0 / (w * w)
        self._lag_s = self._lead_s * (1.0 - feed_forward)
        self._per_s = 1.0 / period_s

    def step(self, next_end: float) -> None:
        """Follow the running period's demand to its end; the next one leads to ``next_end``."""
        start, end = self.start, self.end
        speed = (end - start) * self._per_s
        behind = self._lag_s * speed - self.lead
        offset = self.position - start + behind
        slip = self.velocity - speed
        self.position = end - behind + self._a11 * offset + self._a12 * slip
        self.velocity = speed + self._a21 * offset + self._a22 * slip
        self.start = end
        self.end = next_end

    @property
    def acceleration(self) -> float:
        """What the law asks of the motor now, counts/s^2."""
        speed = (self.end - self.start) * self._per_s
        behind = self.position - self.start + self._lag_s * speed - self.lead
        return -(behind + self._lead_s * (self.velocity - speed)) / self._bend_s2

    def offset(self, counts_s: float, counts_s2: float) -> None:
        """Velocity offset (60B1h) and the acceleration that a torque offset (60B2h) stands for."""
        self.lead = counts_s * self._lead_s + counts_s2 * self._bend_s2

    def rest(self) -> None:
        """Stand still where the motor is: power off, brake on."""
        self.velocity = self.lead = 0.0
        self.start = self.end = self.position

    def shift(self, counts: float) -> None:
        """Move the origin of the counting, not the motor (homing)."""
        self.position += counts
        self.start += counts
        self.end += counts

    def drop(self, acceleration: float, taken_s: float) -> None:
        """Fall freely for a while; the demand goes along."""
        self.position += self.velocity * taken_s + 0.5 * acceleration * taken_s * taken_s
        self.velocity += acceleration * taken_s
        self.start = self.end = self.position
