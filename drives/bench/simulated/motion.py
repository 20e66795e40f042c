"""Motion that a simulated drive makes by itself, as demand period by period: ramps and profiles.

A demand function gives the position demand for the end of the next period at each call.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from drives.bench.simulated.servo import Servo

Demand = Callable[[], float]


@dataclass(frozen=True, slots=True)
class Profile:
    """Limits of a motion, counts and seconds."""

    speed: float
    acceleration: float
    deceleration: float


def ramp_down(servo: Servo, deceleration: float, period_s: float, stopped: Callable[[], None]) -> Demand:
    """Demand that brings the present demand speed to zero; ``stopped()`` is called once when it is there."""
    speed = (servo.end - servo.start) / period_s
    standing = False

    def demand() -> float:
        nonlocal speed, standing
        change = deceleration * period_s
        speed -= max(-change, min(change, speed))
        if speed == 0.0 and not standing and abs(servo.velocity * period_s) < 1.0:
            standing = True
            stopped()
        return servo.end + speed * period_s

    return demand


class Speed:
    """A speed that follows a wish within acceleration and deceleration."""

    def __init__(self, servo: Servo, period_s: float) -> None:
        self._servo = servo
        self._period_s = period_s
        self.now = (servo.end - servo.start) / period_s

    def towards(self, wanted: float, profile: Profile) -> float:
        """One period on: the new speed. Away from zero is acceleration, back to it deceleration."""
        most = self._change(wanted, profile)
        self.now += max(-most, min(most, wanted - self.now))
        return self.now

    def _change(self, wanted: float, profile: Profile) -> float:
        """The most that the speed changes in one period."""
        speeds_up = abs(wanted) > abs(self.now) and wanted * self.now >= 0.0
        return (profile.acceleration if speeds_up else profile.deceleration) * self._period_s

    def after(self, speed: float, own: float, distance: float, profile: Profile) -> float:
        """One period on after a target that moves at ``own`` speed and is ``distance`` away: the new speed.

        ``speed`` reaches it at once, and is what comes where the profile allows it. If not, the
        target is closed in on no faster than the profile can brake down to its speed.
        """
        most = profile.speed
        at_once = profile.acceleration == profile.deceleration == math.inf
        if -most <= speed <= most and (at_once or self._is_near(speed, own, profile)):
            self.now = speed
            return speed
        allowed = max(-most, min(most, speed))
        t, d = self._period_s, profile.deceleration
        if d != math.inf:
            closes = d * (math.sqrt(t * t + 2.0 * abs(distance) / d) - t)
            own = max(-most, min(most, own))
            allowed = max(own - closes, min(own + closes, allowed))
            allowed = max(-most, min(most, allowed))
        return self.towards(allowed, profile)

    def _is_near(self, speed: float, own: float, profile: Profile) -> bool:
        change = self._change(speed, profile)
        return -change <= speed - self.now <= change and -change <= speed - own <= change

    def to_position(self, target: float, profile: Profile) -> float:
        """One period on the way to a target; the demand for its end.

        The speed from which the rest can be braked, one period from now:
        v T + v^2 / 2 d = distance.
        """
        t, d = self._period_s, profile.deceleration
        distance = target - self._servo.end
        possible = d * (math.sqrt(t * t + 2.0 * abs(distance) / d) - t)
        self.towards(math.copysign(min(profile.speed, possible), distance), profile)
        if abs(distance) <= max(1.0, abs(self.now) * t) and abs(self.now) <= d * t + possible:
            self.now = 0.0
            return target
        return self._servo.end + self.now * t
