"""A motor with its load and encoder, for simulations in which their faults matter.

The control law is the servo's (servo.py), integrated in short steps, because friction
and backlash have no closed form:

    motor   x'' = law - sign(x') coulomb - viscous x'       stuck while |law| < coulomb at rest
    load    follows the motor when the gap of the gear is used up, half of it on either side
    encoder on the motor or on the load, in whole increments

All in counts and seconds; accelerations stand for torques over inertia.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drives.bench.simulated.servo import Servo


@dataclass(frozen=True, slots=True)
class PlantParameters:
    """What is not ideal; the defaults are an ideal plant."""

    coulomb: float = 0.0  # counts/s^2, friction that does not depend on speed
    viscous: float = 0.0  # 1/s
    backlash: float = 0.0  # counts, the whole gap
    increment: float = 1.0  # counts per encoder step
    encoder_on_load: bool = False
    strongest: float = math.inf  # counts/s^2 the motor can give


class Plant(Servo):
    """Takes the servo's place where a drive has plant parameters."""

    __slots__ = ("load", "motor", "nature")

    def __init__(self, position: float, nature: PlantParameters) -> None:
        super().__init__(position)
        self.nature = nature
        self.motor = position
        self.load = position
        self.limit(math.inf, math.inf)

    def limit(self, strongest: float, fastest: float) -> None:
        super().limit(min(strongest, self.nature.strongest), fastest)

    def step(self, next_end: float) -> None:
        """As the servo's; the running period in steps of the controller, whatever it asks for."""
        start, end = self.start, self.end
        leans = -self.acceleration * self._bend_s2
        self.limited = abs(leans) > self._reach or (self.limited and abs(start - self.position) > self._near)
        self._saturate(start, (end - start) * self._per_s)
        self.start, self.end = end, next_end

    def _push(self, demand: float, speed: float, h: float) -> None:
        self.velocity = self._rubbed(self.velocity + self._given(demand, speed) * h, h)
        self.motor += self.velocity * h
        half = self.nature.backlash / 2.0
        self.load = max(self.motor - half, min(self.motor + half, self.load))
        self.position = self._read()

    def _rubbed(self, velocity: float, h: float) -> float:
        """What friction leaves of a velocity: it slows down and holds, it never drives."""
        nature = self.nature
        velocity *= max(0.0, 1.0 - nature.viscous * h)
        most = nature.coulomb * h
        return math.copysign(max(0.0, abs(velocity) - most), velocity) if most else velocity

    def _read(self) -> float:
        """What the encoder says."""
        true = self.load if self.nature.encoder_on_load else self.motor
        return math.floor(true / self.nature.increment + 0.5) * self.nature.increment

    @property
    def shaft(self) -> float:
        return self.motor

    def rest(self) -> None:
        super().rest()
        self.start = self.end = self.position

    def shift(self, counts: float) -> None:
        super().shift(counts)
        self.motor += counts
        self.load += counts

    def drop(self, acceleration: float, taken_s: float) -> None:
        before = self.position
        super().drop(acceleration, taken_s)
        self.motor += self.position - before
        self.load += self.position - before
