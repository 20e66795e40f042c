"""The holding brake of a simulated drive, and what gravity does without it.

    release   ordered when operation is to be enabled; enabled when it is open
    close     ordered when the current is to go; it holds after its closing time

Current without brake holds, brake without current holds; with neither the axis falls,
or coasts on at the speed it had until friction and the brake have stopped it. Orderly ways
out (605Bh, 605Ch, quick stop) keep the current until the brake holds; disabling the
voltage and STO do not. 60FEh bit 0 (with its mask) sets the brake by hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.servo import Servo
from drives.bench.simulated.station import Station

OUTPUTS_AT, MASK_AT = key(0x60FE, 1), key(0x60FE, 2)
SET = 1  # bit 0
FALL_STEP_S = 0.001
HOLDS = 2.0  # times gravity


class Brake:
    """``closed`` is whether it holds, whatever has been ordered."""

    def __init__(self, station: Station, servo: Servo) -> None:
        self._station = station
        self._servo = servo
        self._nature = station.parameters
        self.closed = True
        self.stuck = False  # injected: does not open
        self.current = False  # the motor holds
        self.scale = 1.0  # increments per count of the parameters
        self._fallen_s = 0.0
        values = station.dictionary.values
        readers = station.dictionary.readers
        readers[key(0x2003, 1)] = lambda: round(self._nature.enable_delay_s * 1e3)
        readers[key(0x2003, 2)] = lambda: round(self._nature.brake_close_s * 1e3)
        readers[key(0x2003, 3)] = lambda: int(self.holds)
        readers[OUTPUTS_AT] = lambda: values[OUTPUTS_AT] & ~SET | int(self.holds)

    @property
    def holds(self) -> bool:
        if not self._nature.brake:
            return False
        values = self._station.dictionary.values
        if values[MASK_AT] & SET:
            return self.stuck or bool(values[OUTPUTS_AT] & SET)
        return self.stuck or self.closed

    def release(self, now_s: float, done: Callable[[float], None]) -> None:
        """Order it open; ``done`` when it is."""

        def opened(at_s: float) -> None:
            self.closed = False
            done(at_s)

        self._station.cancel("brake")
        self._station.alarm("enable", now_s + self._nature.enable_delay_s, opened)

    def close(self, now_s: float, done: Callable[[float], None] | None = None) -> None:
        """Order it shut; ``done`` when it holds. At once where it takes no time."""

        def shut(at_s: float) -> None:
            self.closed = True
            if done is not None:
                done(at_s)

        if self._nature.brake_close_s > 0.0 and not self.closed:
            self._station.alarm("brake", now_s + self._nature.brake_close_s, shut)
        else:
            shut(now_s)

    def current_comes(self) -> None:
        """From now on the motor holds."""
        self.current = True
        self._station.cancel("fall")

    def current_gone(self, now_s: float, speed: float) -> None:
        """From now on only friction and the brake hold; the motor turned at ``speed`` (counts/s)."""
        self.current = False
        self.close(now_s)
        self._servo.velocity = speed
        self.fall(now_s)

    def fall(self, now_s: float) -> None:
        """Let a motor without current go on, as far as friction and the brake let it."""
        moves = self._servo.velocity or (self._nature.gravity and not self.holds)
        if moves and not self.current:
            self._fallen_s = now_s
            self._station.alarm("fall", now_s + FALL_STEP_S, self._fall)

    def power_on(self, now_s: float) -> None:
        """After a loss of the supply, which forgets what was under way."""
        if not self.current:
            self.close(now_s)
            self.fall(now_s)

    def _fall(self, now_s: float) -> None:
        servo = self._servo
        taken_s = now_s - self._fallen_s
        if self.current or servo.jammed:
            servo.rest()
            return
        pull = self.scale * self._nature.gravity
        friction = self._friction
        slowing = math.copysign(friction, servo.velocity or pull)
        gained = abs(slowing - pull) * taken_s
        if abs(servo.velocity) <= gained and friction >= abs(pull):
            servo.drop(pull - slowing, abs(servo.velocity) / abs(slowing - pull) if gained else 0.0)
            servo.rest()
            return
        servo.drop(pull - slowing, taken_s)
        self.fall(now_s)

    @property
    def _friction(self) -> float:
        """What slows a motor down that has no current, counts/s^2; a brake that holds outdoes gravity.

        Friction is already taken off the acceleration at which an axis falls.
        """
        nature = self._nature
        brake = max(nature.brake_counts_s2, HOLDS * abs(nature.gravity)) if self.holds else 0.0
        falls = nature.gravity and self._servo.velocity * nature.gravity >= 0.0
        return self.scale * (brake if falls else nature.coast_counts_s2 + brake)
