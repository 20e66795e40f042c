"""Whether the tick goes on: a process that lives may stand still, and its last figures then say nothing."""

from __future__ import annotations

import time
from collections.abc import Callable

STANDS_S = 0.5  # without a tick; the longest period is 5 ms


class Pulse:
    """The main thread looks (``stands_now``); any other may ask how old a tick is."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """``clock`` in seconds."""
        self._clock = clock
        self._seen = (-1, clock())  # the newest tick, and when it was new
        self._told = False

    def begin(self) -> None:
        """Another tick is on its way; before its first one nothing stands."""
        self._seen, self._told = (-1, self._clock()), False

    def stands_now(self, tick: int) -> bool:
        """Whether it is seen just now, and for the first time, that the tick stands still."""
        if tick != self._seen[0]:
            self._seen, self._told = (tick, self._clock()), False
        stands = tick >= 0 and self.age_s(tick) >= STANDS_S and not self._told
        self._told = self._told or stands
        return stands

    def age_s(self, tick: int) -> float:
        """How long (s) this has been the newest tick."""
        newest, at_s = self._seen
        return self._clock() - at_s if tick == newest else 0.0
