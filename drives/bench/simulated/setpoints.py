"""Where a simulated axis is told to go: its target, what limits it, and what comes when no target comes."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Final

from drives.bench.simulated.plant import Plant
from drives.bench.simulated.servo import Servo
from drives.bench.simulated.spindle_motor import SpindleMotor
from drives.bench.simulated.station import Station
from drives.bench.simulated.units import Units

LIMIT: Final = 1 << 11  # statusword
NO_LIMIT: Final = 0xFFFF_FFFF  # 6065h: no check; 607Fh and 6080h: no limit
SPEED_LIMITS = (0x607F, 0x6080)
NO_TARGET_YET = -(10**9)  # of a drive that waits for its first one


class Setpoints(ABC):
    """The part of an axis that every target passes; all in increments."""

    def __init__(self, station: Station) -> None:
        self.station = station
        self.dictionary = station.dictionary
        self.parameters = nature = station.parameters
        self.units = Units(self.dictionary, nature.counts_per_metre, nature.counts_per_radian)
        plant = nature.plant
        self.servo = Servo(nature.position_counts)
        if nature.motor is not None:
            self.servo = SpindleMotor(nature.position_counts, nature.motor)
        elif plant is not None:
            self.servo = Plant(nature.position_counts, plant)
        self.period_s = 0.0
        self.target: int | float = nature.position_counts  # whole, but where a mode works it out
        self.low: float = -math.inf
        self.high: float = math.inf
        self.limit = self.clamped = 0  # statusword bit 11, for the target and for the demand
        self.guesses = NO_TARGET_YET  # periods in a row without a target

    @abstractmethod
    def refresh(self) -> None:
        """The statusword has to be made anew."""

    @abstractmethod
    def time_out(self, now_s: float) -> None:
        """Interpolation time-out: a drive that follows setpoints stops by itself."""

    def speed_limit(self) -> float:
        """The motor's speed limit: its own, or that of 607Fh or 6080h (0 and FFFFFFFFh: nothing)."""
        told = [self.units.speed_at(index) for index in SPEED_LIMITS]
        limits = [speed for speed in told if speed not in (0, NO_LIMIT)]
        return min(self.parameters.fastest_counts_s * self.units.scale, *limits, math.inf)

    def aim(self, target: float) -> None:
        """A new target position; outside of 607Dh it is held there and bit 11 says so."""
        self.target = self.within(target) if self.units.plain else max(self.low, min(self.high, target))
        limit = 0 if self.target == target else LIMIT
        if limit != self.limit:
            self.limit = limit
            self.refresh()
        self.guesses = 0

    def within(self, target: float) -> int:
        """A position inside of the software limits."""
        if self.low <= target <= self.high:
            return round(target)
        return round(max(self.low, min(self.high, target)))

    def bounded(self, demand: float) -> float:
        """A demand inside of the software limits; bit 11 says when it was not."""
        inside = max(self.low, min(self.high, demand))
        self.say_limit(inside != demand)
        return inside

    def say_limit(self, active: bool) -> None:
        """Statusword bit 11 for a limit that the demand, not the target, meets."""
        clamped = LIMIT if active else 0
        if clamped != self.clamped:
            self.clamped = clamped
            self.refresh()

    def guess(self, now_s: float) -> None:
        """No new target came for the next period; what that leads to is the maker's choice."""
        self.guesses += 1
        nature = self.parameters
        if 0 < self.guesses <= nature.guessed_periods:
            self.target = round(2.0 * self.servo.end - self.servo.start)
        elif nature.times_out and self.guesses > nature.guessed_periods + nature.patient_periods:
            self.time_out(now_s)
