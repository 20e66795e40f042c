"""The ramp of a spindle's speed beside any thread: a drive in cyclic velocity has none of its own."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

REPEATS: Final = 1  # periods that tell the speed once more when it is reached: a frame can be lost


class SpeedRamp(NamedTuple):
    """From one speed to another, by ``step_rev_s`` in each period; without a step nobody is led."""

    begin: int = 0  # the period before its first step
    from_rev_s: float = 0.0
    to_rev_s: float = 0.0
    step_rev_s: float = 0.0

    def value(self, period: int) -> float:
        """The speed in a period (rev/s)."""
        most, gap = max(0, period - self.begin) * self.step_rev_s, self.to_rev_s - self.from_rev_s
        return self.to_rev_s if abs(gap) <= most else self.from_rev_s + math.copysign(most, gap)

    def at(self, period: int) -> float | None:
        """The speed that a period tells the drive; None: nothing, for it has long been reached."""
        if not self.step_rev_s or period <= self.begin:
            return None
        before = max(self.begin, period - 1 - REPEATS)
        return None if self.value(before) == self.to_rev_s else self.value(period)


NO_RAMP: Final = SpeedRamp()
