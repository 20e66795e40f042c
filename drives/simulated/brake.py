"""The holding brake of a simulated drive, and what gravity does without it.

    release   ordered when operation is to be enabled; enabled when it is open
    close     ordered when the current is to go; it holds after its closing time

Current without brake holds, brake without current holds; with neither the axis falls,
or coasts on at the speed it had until friction or the brake has stopped it. Orderly ways
out (605Bh, 605Ch, quick stop) keep the current until the brake holds; disabling the
voltage and STO do not. 60FEh bit 0 (with its mask) sets the brake by hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from drives.simulated.data_sheet import key
from drives.simulated.servo import Servo
from drives.simulated.station import Station

OUTPUTS_AT, MASK_AT = key(0x60FE, 1), key(0x60FE, 2)
SET = 1  # bit 0
FALL_STEP_S = 0.001


class Brake:
    """``closed`` is whether it holds, whatever has been ordered."""

    def __init__(self, station: Station, servo: Servo) -> None:
        self._station = station
        self._servo = servo
        self._nature = station.parameters
        self.closed = True
        self.stuck = False  # injected: does not open
        self.current = False  # the motor holds
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

    def keep_shut(self) -> None:
        """Take a release back."""
        self._station.cancel("enable")

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
        """From now on only the brake holds; the motor turned at ``speed`` (counts/s)."""
        self.current = False
        self.close(now_s)
        if (self._nature.gravity or speed) and not self.holds:
            self._servo.velocity = speed
            self._fallen_s = now_s
            self._station.alarm("fall", now_s + FALL_STEP_S, self._fall)

    def _fall(self, now_s: float) -> None:
        servo = self._servo
        taken_s = now_s - self._fallen_s
        self._fallen_s = now_s
        if self.current or self.holds or self._stands(taken_s):
            servo.rest()
            return
        friction = math.copysign(self._nature.coast_counts_s2, servo.velocity) if servo.velocity else 0.0
        servo.drop(self._nature.gravity - friction, taken_s)
        self._station.alarm("fall", now_s + FALL_STEP_S, self._fall)

    def _stands(self, taken_s: float) -> bool:
        """Friction has taken the last of the speed, and gravity does not overcome it."""
        friction = self._nature.coast_counts_s2
        return abs(self._nature.gravity) <= friction and abs(self._servo.velocity) <= friction * taken_s
