"""The stop at the end of a plan: along its rows, by the jerks of the planner's own stop.

The rows are the path at the speed of the plan: places s with the counts of each drive. The stop is of s: it
was made for the axes' limits where it begins. Between two rows the counts go by a cubic, through both and
their neighbours.

On a thread the rows are ahead of s by what the axes' drives lag at the speed of the plan. Along the stop they
are ahead by what the drives lag at its own speed, and the spindle is led by that speed, its answer counted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drives.pump.plan_memory import THREAD, Stop

SAME_PLACE = 1e-9  # of s: two rows that are nearer to one another are one


def moved_by(jerk: float, t: float, s: float, v: float, a: float) -> tuple[float, float, float]:
    """The place, speed and acceleration after a time ``t`` (s) of one jerk."""
    return s + t * (v + t * (0.5 * a + t * jerk / 6.0)), v + t * (a + 0.5 * t * jerk), a + t * jerk


def led_rev_s(thread: Sequence[float]) -> float | None:
    """How fast a row has the spindle led, by its columns of a thread; None: it does not."""
    return thread[0] if thread and thread[1] else None


class Braking:
    """One stop under way. Read: ``over``, at rest; ``counts``; ``rev_s`` of the spindle where it is led."""

    def __init__(
        self,
        stop: Stop,
        period_s: float,
        row: Callable[[int], Sequence[float]],
        at: int,
        rows: int,
        thread: bool = False,
    ):
        """``row(i)``: s and counts of the i-th of ``rows``, with ``thread`` the columns of one behind them.

        The stop begins at the row ``at``.
        """
        self._stop, self._period_s, self._row = stop, period_s, row
        self._end = len(row(at)) - THREAD * thread  # of the columns that are counts
        self._i, self._last = at, rows - 1
        self._k, self._used = 0, stop.used
        self._s, self._v, self._a = row(at)[0], stop.v, stop.a
        self.counts: Sequence[float] = row(at)[1 : self._end]
        self.rev_s = led_rev_s(row(at)[self._end :])

    @property
    def over(self) -> bool:
        """At rest."""
        return self._k >= len(self._stop.jerks)

    def step(self) -> Sequence[float]:
        """The counts one period on."""
        before, now = self._s, (self._s, self._v, self._a)
        self._s, self._v, self._a = moved_by(self._stop.jerks[self._k], self._period_s, *now)
        self._used += 1
        if self._used == self._stop.held:
            self._used = 0
            self._k += 1
        self.counts = self._at(self._s)
        if self._end < len(self._row(self._i)):
            self._lead((self._s - before) / self._period_s)
        return self.counts

    def _lead(self, speed: float) -> None:
        """Along a thread: the axes by what their drives lag now, the spindle by the ``speed`` of the step."""
        row, i, stop, v, a = self._row, self._i, self._stop, self._v, self._a
        here, after = (row(i), row(i + 1)) if i < self._last else (row(max(0, i - 1)), row(i))
        (_, turn, ahead, *_), (_, _, ahead_after, *_) = here[self._end :], after[self._end :]
        if not turn:
            self.rev_s = None
            return
        self.rev_s = turn * ((1.0 + stop.spindle_slip) * speed + stop.spindle_lag_s * a)
        h = after[0] - here[0]
        if h < SAME_PLACE:
            return
        x = min(1.0, max(0.0, (self._s - here[0]) / h))
        lag_s = stop.axis_lag_s
        by = (lag_s * (v + 0.5 * lag_s * a) - ahead - x * (ahead_after - ahead)) / h
        begin, end = here[1 : self._end], after[1 : self._end]
        self.counts = [count + by * (q - p) for count, p, q in zip(self.counts, begin, end, strict=True)]

    def _at(self, s: float) -> Sequence[float]:
        """The counts at a place, which no stop goes back from."""
        row, i, last = self._row, self._i, self._last
        while i < last and s > row(i + 1)[0]:
            i += 1
        self._i = i
        here = row(i)
        if i == last or row(i + 1)[0] - here[0] < SAME_PLACE:
            return here[1 : self._end]
        after = row(i + 1)
        before = row(i - 1) if i > 0 and here[0] - row(i - 1)[0] > SAME_PLACE else None
        beyond = row(i + 2) if i + 2 <= last and row(i + 2)[0] - after[0] > SAME_PLACE else None
        h = after[0] - here[0]
        x = (s - here[0]) / h
        found = []
        for n in range(1, self._end):
            slope = (after[n] - here[n]) / h
            begin = end = slope
            if before is not None:
                h0 = here[0] - before[0]
                begin = (slope * h0 + (here[n] - before[n]) / h0 * h) / (h0 + h)
            if beyond is not None:
                h2 = beyond[0] - after[0]
                end = (slope * h2 + (beyond[n] - after[n]) / h2 * h) / (h2 + h)
            if before is None:
                begin = 2.0 * slope - end
            if beyond is None:
                end = 2.0 * slope - begin
            c2, c3 = 3.0 * slope - 2.0 * begin - end, begin + end - 2.0 * slope
            found.append(here[n] + h * x * (begin + x * (c2 + x * c3)))
        return found
