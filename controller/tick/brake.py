"""A stop under way: it leaves the plan where a stop begins, and comes to rest along the path."""

from __future__ import annotations

from typing import Any, Final

from controller.ipc.handoff import StopTable
from controller.tick.changes import Changes
from controller.tick.queue import Queue
from drives.pump.braking import moved_by
from drives.pump.plan_memory import Stop

_CHANGES: Final = Changes("left_at", "s", "v", "a", "_jerks", "_k", "_last", "_held", "_n")


class Brake:
    """Jerk after jerk, from the plan's own s, v and a to rest."""

    __slots__ = ("_held", "_jerks", "_k", "_last", "_n", "_period_s", "a", "active", "left_at", "s", "v")

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._jerks = StopTable.of(0.0, 1.0, 1.0, ()).jerks
        self._k = self._last = self._n = 0
        self._held = 1  # ticks for which each jerk holds
        self.active = False
        self.left_at = 0.0  # speed at which the plan was left
        self.s = self.v = self.a = 0.0

    def begin(self, table: StopTable, row: int, state: tuple[float, float, float]) -> None:
        """Leave the plan at ``state`` (s, v, a)."""
        self.s, self.v, self.a = state
        self.left_at = self.v
        self._jerks, self._k, self._last = table.jerks, table.first[row], table.first[row + 1]
        self._held = max(1, round(table.jerk_step_s / self._period_s))
        self._n = 0
        self.active = True

    def come_to(self, queue: Queue, now: int) -> int:
        """Number of the entry in which it is now; its s runs on from motion to motion, but past no rest."""
        entry, last = queue[now], queue.last
        while entry.motion is not None and self.s > entry.motion.end:
            i = now + 1
            while i <= last and queue[i].piece.motion_id == entry.piece.motion_id:
                i += 1
            if i > last or queue[i - 1].rests_at(queue[i - 1].end_s):
                self.s = entry.motion.end  # by rounding
                break
            self.s += queue[i].begins_at - entry.motion.end
            now, entry = i, queue[i]
        return now

    def stand(self, s: float) -> None:
        """At rest at ``s`` already, without a way to it."""
        self.s, self.v, self.a, self.left_at = s, 0.0, 0.0, 0.0
        self._k = self._last = self._n = 0
        self.active = True

    @property
    def over(self) -> bool:
        """At rest."""
        return self._k >= self._last

    def step(self) -> None:
        """One period on; with the last one speed and acceleration are nothing."""
        now = self.s, self.v, self.a
        self.s, self.v, self.a = moved_by(self._jerks[self._k], self._period_s, *now)
        self._n += 1
        if self._n == self._held:
            self._n = 0
            self._k += 1
            if self._k == self._last:
                self.v = self.a = 0.0

    @property
    def rest(self) -> Stop:
        """What is left of it, for the pump."""
        return Stop(self._jerks[self._k : self._last], self._held, self._n, self.v, self.a)

    def save(self) -> tuple[Any, ...] | None:
        """None where it is not under way."""
        return _CHANGES.of(self) if self.active else None

    def restore(self, saved: tuple[Any, ...] | None) -> None:
        self.active = saved is not None
        if saved is not None:
            _CHANGES.put(self, saved)
