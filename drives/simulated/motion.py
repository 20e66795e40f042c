"""Motion that a simulated drive makes by itself, as demand period by period: homing and ramps.

Homing (CiA 402-2, mode 6), methods

    17 / 18   to the negative / positive limit switch, back off slowly, zero at its edge
    35 / 37   here and now

At the homed point the actual position becomes 607Ch. (Vendors differ in the sign of
607Ch; this is the reading of maxon, Elmo and others: the value is the position.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drives.simulated.servo import Servo

HERE = (35, 37)
SWITCH_SIDE = {17: -1, 18: +1}
METHODS = (*HERE, *SWITCH_SIDE)
# An axis that finds no switch within this many counts has none.
LONGEST_SEARCH = 2.0**32


@dataclass(frozen=True, slots=True)
class Search:
    """How a homing run moves: counts, counts/s, counts/s^2."""

    side: int
    switch: float  # edge of the limit switch in the drive's present counting
    fast: float
    slow: float
    acceleration: float


def search(servo: Servo, how: Search, period_s: float, found: Callable[[float], None]) -> Callable[[], float]:
    """The demand of a switch homing, one value per call; ``found(edge)`` is called once at the end.

    fast towards the switch ---> slowly off it ---> stand still, edge known
    """
    speed = 0.0
    phase = 0
    begun = servo.position

    def demand() -> float:
        nonlocal speed, phase
        pressed = (servo.position - how.switch) * how.side >= 0.0
        if phase == 0 and pressed:
            phase = 1
        elif phase == 1 and not pressed and speed * how.side < 0.0:
            phase = 2
        elif phase == 2 and speed == 0.0 and abs(servo.end - servo.position) < 1.0:
            phase = 3
            found(how.switch)
        wanted = (how.fast, -how.slow, 0.0, 0.0)[phase] * how.side
        change = how.acceleration * period_s
        speed += max(-change, min(change, wanted - speed))
        if abs(servo.position - begun) > LONGEST_SEARCH:
            phase = 2
        return servo.end + speed * period_s

    return demand


def ramp_down(
    servo: Servo, deceleration: float, period_s: float, stopped: Callable[[], None]
) -> Callable[[], float]:
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
