r"""A speed along a line, with bounded acceleration and jerk, that can always still stop before its end.

All figures are differences of one tick to the next: ``v`` = p - p', ``a`` = v - v', and the
jerk is a - a'. So the limits hold for the differences of what is sent, exactly, and not only
for a curve through them.

**To a speed.** Taking ``a`` away by the largest jerk adds f(a) = a + (a - J) + (a - 2J) + ... to
the speed, as far as the terms are positive. Choosing the ``a`` with f(a) = what is missing, as near as
the limits let us come to it, reaches every speed in the least number of ticks, without overshoot, and
stands exactly: the next choice is then a - J by itself.

**To the end.** A step is taken only if the stop after it still ends before the end of the line. The
first one that does not is where the landing begins:

```
   speed  ______ .             A  stops now: short of the end by less than a tick's way
                \ \  B         B  takes the step and stops then: beyond the end
               A \ \           A + share (B - A) ends on the end itself
                  \_\_
```
Both begin in the same state and keep all limits, and limits on differences are convex: so does
whatever lies between the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

_ROUNDED = 1.0 + 1e-9
_SPARE_TICKS = 3  # by which the quick estimate of a stop is too long


class _Stop(NamedTuple):
    """One of the two stops that a landing is mixed of."""

    p: float
    v: float
    a: float


class Ramp:
    """Read ``p``, ``v`` and ``a``: place, speed (never below 0) and acceleration, in units and ticks."""

    def __init__(self, acceleration: float, jerk: float, end: float) -> None:
        """Limits per tick^2 and tick^3; ``end`` >= 0 is where ``p``, which begins at 0, must stop at last."""
        self.p = self.v = self.a = 0.0
        self._most_a, self._most_j, self._end = acceleration, jerk, end
        self._change = jerk * _ROUNDED  # or a stop would hang on by a rounding
        self._landing: tuple[_Stop, _Stop] | None = None
        self._share = 0.0

    @property
    def at_rest(self) -> bool:
        return self.v == 0.0 and self.a == 0.0

    def stand(self, back: bool) -> None:
        """At rest at once, with the last step taken back if ``back``."""
        if back:
            self.p -= self.v
        self.v = self.a = 0.0
        self._landing = None

    def step(self, speed: float) -> None:
        """One tick on, towards ``speed`` (>= 0, per tick)."""
        if self._landing is not None:
            now, later = self._landing
            self._mix(self._stop(now), self._stop(later))
            return
        a = self._towards(self.v, self.a, speed)
        v = _sum(self.v, a, speed)
        if speed == 0.0 or self._fits(v, a):
            self.p, self.v, self.a = self.p + v, v, a
        else:
            self._begin_landing(v, a)

    def _towards(self, v: float, a: float, speed: float) -> float:
        """The acceleration of the next tick."""
        most_j, most_a = self._most_j, self._most_a
        missing = speed - v
        size = missing if missing >= 0.0 else -missing
        m = int((math.sqrt(1.0 + 8.0 * size / most_j) - 1.0) / 2.0)  # f(m J) = J m (m + 1) / 2
        wanted = size / (m + 1) + 0.5 * most_j * m
        if missing < 0.0:
            wanted = -wanted
        wanted = min(max(wanted, a - self._change), a + self._change)
        return min(max(wanted, -most_a), most_a)

    # -- the end of the line

    def _fits(self, v: float, a: float) -> bool:
        """Whether a stop from (v, a), reached by the next step, ends before the end."""
        left = self._end - self.p - v
        return self._longest_stop(v, a) <= left or self._stop_length(v, a) <= left

    def _longest_stop(self, v: float, a: float) -> float:
        """A stop's length, never too short: without a look at each of its ticks."""
        most_a, most_j = self._most_a, self._most_j
        rise = a / most_j + 1.0 if a > 0.0 else 0.0
        v += 0.5 * max(a, 0.0) * rise
        flat = v > most_a * most_a / most_j
        ticks = v / most_a + most_a / most_j if flat else 2.0 * math.sqrt(v / most_j)
        return v * (rise + 0.5 * (ticks + _SPARE_TICKS))

    def _stop_length(self, v: float, a: float) -> float:
        length = 0.0
        while v > 0.0:
            a = self._towards(v, a, 0.0)
            v = _sum(v, a, 0.0)
            length += v
        return length

    def _begin_landing(self, v: float, a: float) -> None:
        """A stops from here, B from (v, a) one tick later; both have this tick behind them then."""
        now, later = _Stop(self.p, self.v, self.a), _Stop(self.p + v, v, a)
        short = self.p + self._stop_length(self.v, self.a)
        far = later.p + self._stop_length(v, a)
        self._share = min(max(0.0, (self._end - short) / (far - short)), 1.0)
        self._mix(self._stop(now), later)

    def _mix(self, now: _Stop, later: _Stop) -> None:
        share, self._landing = self._share, (now, later)
        self.p = now.p + share * (later.p - now.p)
        self.v = now.v + share * (later.v - now.v)
        self.a = now.a + share * (later.a - now.a)
        if self.at_rest:
            self._landing = None

    def _stop(self, one: _Stop) -> _Stop:
        """One tick on."""
        a = self._towards(one.v, one.a, 0.0)
        v = _sum(one.v, a, 0.0)
        return _Stop(one.p + v, v, a)


def _sum(v: float, a: float, speed: float) -> float:
    """``v`` + ``a``; ``speed`` itself where only rounding is between them."""
    found = v + a
    return speed if abs(found - speed) < 1e-12 * (abs(v) + abs(a)) else found
