"""Plan time, counted in SYNCs."""

from __future__ import annotations

from controller.geometry.vectors import ROUNDING


class PathClock:
    """An origin and the SYNCs since: no rounding piles up. Read ``tau`` (plan time, s), ``period_s``."""

    __slots__ = ("_origin_s", "_syncs", "period_s", "tau")

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._origin_s, self._syncs = 0.0, 0
        self.tau = 0.0

    def set(self, tau: float) -> None:
        """Counts from there."""
        self._origin_s, self._syncs, self.tau = tau, 0, tau

    def advance(self, reached: float) -> None:
        """One SYNC on, to ``reached``: a period, or a mark before it, from which it counts anew."""
        if reached < self.tau + self.period_s - ROUNDING:
            self.set(reached)
            return
        self._syncs += 1
        self.tau = self._origin_s + self._syncs * self.period_s

    @property
    def next_tau(self) -> float:
        """Where a whole period from here ends."""
        return self._origin_s + (self._syncs + 1) * self.period_s

    def save(self) -> tuple[float, int]:
        return self._origin_s, self._syncs

    def restore(self, saved: tuple[float, int]) -> None:
        self._origin_s, self._syncs = saved
        self.tau = self._origin_s + self._syncs * self.period_s
