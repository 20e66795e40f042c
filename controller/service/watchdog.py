"""Whether tick and plan go on: a process that lives may stand still.

The last figures of a tick that stands say nothing. A plan that stands is no danger while the queue lasts,
and the queue ends at rest; but in its last second the operator is told.
"""

from __future__ import annotations

import time
from collections.abc import Callable

STANDS_S = 0.5  # without a tick; the longest period is 5 ms
LAST_S = 1.0  # of the queue
LASTS_S = 0.2  # so long: where a program begins the plan has little more than this to send at first


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


class LastSecond:
    """Whether the queue comes to its end though there is more of the program. The main thread looks."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """``clock`` in seconds."""
        self._clock = clock
        self._since_s: float | None = None
        self.left_s: float | None = None  # of motion, where the operator must know it; None: all is well

    def look(self, left_s: float | None) -> None:
        """``left_s``: of the queue, where the tool moves and the plan has more to send; None otherwise."""
        if left_s is None or left_s >= LAST_S:
            self._since_s = self.left_s = None
            return
        now_s = self._clock()
        self._since_s = now_s if self._since_s is None else self._since_s
        self.left_s = left_s if now_s - self._since_s >= LASTS_S else None
