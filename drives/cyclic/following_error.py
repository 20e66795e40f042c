"""Command against position: whether a drive is where it was told to be, with the bus counted.

A setpoint is sent in tick k, latched by SYNC k + 1, and reached at SYNC k + 2, for the drive
interpolates over one period; the position sampled there is read in tick k + 3. So what a feedback
is held against is the setpoint that was latched one SYNC before the one it answers:

```
    SYNC k         SYNC k + 1          SYNC k + 2          SYNC k + 3
      | send s_k     | latches s_k       | has reached s_k   |
      |              |                   | samples position  | read, held against s_k
```
A drive may lag by a part that is there at rest and a part in proportion to its speed (LinuxCNC's
MIN_FERROR and FERROR are such a pair; a position loop of gain Kv lags by v / Kv). The lag outlives
the speed that made it: it dies away with 1 / Kv. Behind a ramp that ends in rest it is larger
than the present speed explains, so the speed that counts is the largest of late, let down with three
times the window's own time: a first-order loop that takes half of the window at speed stays within it.

Where the part by speed is a default, and nobody's word, it is tightened by what is measured: over the
first second of motion at speed since the drive was enabled, to twice the lag that was seen there.
"""

from __future__ import annotations

import math

from drives.settings import FollowingWindow

OUTLIVES = 3.0  # times the window's own time: how slowly the speed that counts is let down
LEARN_S = 1.0  # of motion at speed, until the default is tightened
AT_SPEED = 0.02  # share of the largest speed
MARGIN = 2.0  # what is allowed beside what was measured
LEAST_SYNCS = 2.0  # the part by speed is never less: setpoints that come one SYNC late, and one more
FILLED = 3  # SYNCs until what was sent while it followed has been reached


class FollowingError:
    """One drive's following error, in counts.

    Read: ``actual`` (commanded less actual at the last feedback, as 60F4h), ``window`` (allowed at it),
    ``in_position``.
    """

    def __init__(self, window: FollowingWindow, period_s: float) -> None:
        self.actual = 0
        self.window = 0.0
        self._at_rest = True  # nothing that was commanded is still to be reached
        self._rest = window.rest_counts
        self._given = window.speed_s / period_s  # SYNCs of the present speed
        self._in_position = window.in_position_counts
        self._ticks = window.ticks
        self._decay = math.exp(-period_s / (OUTLIVES * window.speed_s)) if window.speed_s > 0.0 else 0.0
        self._at_speed = AT_SPEED * window.velocity_counts_s * period_s
        self._to_learn = round(LEARN_S / period_s) if window.tightens and self._at_speed > 0.0 else 0
        self._latched = self._reached = 0
        self._speed = 0.0  # counts per SYNC, the largest of late
        self._syncs = 0  # since it follows
        self._beyond = 0  # feedbacks in a row
        self._by_speed = self._given
        self._learning = self._to_learn
        self._largest = 0.0  # lag by speed, SYNCs

    def forget(self) -> None:
        """Enabled anew: what was measured belongs to another day's load."""
        self._syncs = self._beyond = 0
        self._by_speed, self._learning, self._largest = self._given, self._to_learn, 0.0

    def sync(self, sent: int, follows: bool) -> None:
        """A SYNC has gone out: the drive latches ``sent`` and has come to what it latched before."""
        before, reached = self._reached, self._latched
        self._reached, self._latched = reached, sent
        self._at_rest = sent == reached == before
        if not follows:
            self._syncs, self._speed = 0, 0.0
            return
        self._syncs += 1
        moved = reached - before
        speed = self._speed * self._decay
        self._speed = moved if moved > speed else -moved if -moved > speed else speed

    def judge(self, position: int) -> bool:
        """The feedback of the last SYNC; True where it has been beyond the window too often in a row."""
        self.actual = lag = self._reached - position
        if self._syncs < FILLED:
            return False
        self.window = window = self._rest + self._by_speed * self._speed
        off = lag if lag > 0 else -lag
        if off > window:
            self._beyond += 1
            return self._beyond >= self._ticks
        self._beyond = 0
        if self._learning and self._speed > self._at_speed:
            self._learn(off)
        return False

    @property
    def in_position(self) -> bool:
        """Whether it stands where motion has led it."""
        return self._at_rest and -self._in_position <= self.actual <= self._in_position

    def _learn(self, off: int) -> None:
        lag = off / self._speed
        if lag > self._largest:
            self._largest = lag
        self._learning -= 1
        if not self._learning:
            self._by_speed = min(self._given, max(LEAST_SYNCS, MARGIN * self._largest))
