"""Command against position: how far a drive may be from where it was told to be, the bus counted.

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

A drive cannot be ahead of what SYNC has given it. One that takes setpoints as they come, and not with
SYNC, is: by what is left of the period then, so by up to one SYNC of its speed. That is seen of a drive that
lags by less, as those do which are given the velocity, too, and whose setpoint is not among the last of the
period; of a slower one only its parameters tell (1400h:02, which commissioning reads back). One that measures
its position some time after SYNC seems to be ahead as well, so that ``AHEAD`` leaves room for it.

What is within the part at rest costs the tick one comparison (``drive.py``); only what is beyond it is
looked at here, and every so many SYNCs the speed.
"""

from __future__ import annotations

import math
from typing import Final

from drives.settings import FollowingWindow

OUTLIVES = 3.0  # times the window's own time: how slowly the speed that counts is let down
MEASURE_EVERY = 4  # SYNCs
LEARN_S = 1.0  # of motion at speed, until the default is tightened
AT_SPEED = 0.02  # share of the largest speed
MARGIN = 2.0  # what is allowed beside what was measured
FORGETS = 0.995  # of what was measured, from one measurement in motion to the next
AHEAD: Final = 1.0 / 3.0  # SYNCs
AHEAD_S = 0.2  # of motion at speed, without a break
AHEAD_COUNTS: Final = 20  # in one SYNC, or the lead is too small to be known
MIN_SYNCS = 2.0  # the part by speed is never less: setpoints that come one SYNC late, and one more


class FollowingError:
    """One drive's following error, in counts.

    Read: ``actual`` (commanded less actual as 60F4h, when it was last beyond the part at rest), ``window``
    (allowed then), ``early`` (it is ahead of what SYNC has given it, since it was enabled).
    """

    def __init__(self, window: FollowingWindow, period_s: float) -> None:
        self.actual = 0
        self.window = 0.0
        self._rest = window.rest_counts
        self._given = window.speed_s / period_s  # SYNCs of the present speed
        self._ticks = window.ticks
        let_down_s = OUTLIVES * window.speed_s
        self._decay = math.exp(-MEASURE_EVERY * period_s / let_down_s) if let_down_s > 0.0 else 0.0
        self._at_speed = AT_SPEED * window.velocity_counts_s * period_s
        learns = window.tightens and self._at_speed > 0.0
        self._to_learn = round(LEARN_S / period_s / MEASURE_EVERY) if learns else 0
        self._speed = 0.0  # counts per SYNC, the largest of late
        self._beyond = 0  # feedbacks in a row
        self._by_speed = self._given
        self._learning = self._to_learn
        self._largest = 0.0  # lag by speed, SYNCs
        self._lagged = self._squared = 0.0  # sums over what was measured of late, see ``lag_s``
        self._period_s = period_s
        self.early = False
        self._ahead = 0  # measurements in a row
        self._most_ahead = round(AHEAD_S / period_s / MEASURE_EVERY)

    @property
    def lag_s(self) -> float:
        """How far the drive is behind its speed, beside the bus: the best line through what was measured."""
        return self._period_s * self._lagged / self._squared if self._squared > 0.0 else 0.0

    def forget(self) -> None:
        """Enabled anew: what was measured belongs to another day's load."""
        self._beyond = self._ahead = 0
        self.early = False
        self._by_speed, self._learning, self._largest = self._given, self._to_learn, 0.0

    def beyond(self, lag: int, moved: int) -> bool:
        """A feedback beyond the part at rest; True where it is beyond the window too often in a row.

        ``moved``: counts of the command in one SYNC.
        """
        speed = float(moved if moved >= 0 else -moved)
        if speed > self._speed:
            self._speed = speed
        self.actual = lag
        self.window = window = self._rest + self._by_speed * self._speed
        if -window <= lag <= window:
            self._beyond = 0
            return False
        self._beyond += 1
        return self._beyond >= self._ticks

    def measure(self, lag: int, moved: int) -> None:
        """Every ``MEASURE_EVERY`` SYNCs: the speed that counts, and what the drive lags by it."""
        if moved:
            lagged, squared = lag * moved, moved * moved
            self._lagged = FORGETS * self._lagged + lagged
            self._squared = FORGETS * self._squared + squared
            if squared >= AHEAD_COUNTS * AHEAD_COUNTS:
                self._look_ahead(lagged, squared)
        speed = float(moved if moved >= 0 else -moved)
        late = self._speed * self._decay
        self._speed = speed = speed if speed > late else late
        if -self._rest <= lag <= self._rest:
            self._beyond = 0
        if self._learning and speed > self._at_speed and not self._beyond:
            self._learn((lag if lag >= 0 else -lag) / speed)

    def _look_ahead(self, lagged: int, squared: int) -> None:
        """Both by the command's way in one SYNC."""
        self._ahead = self._ahead + 1 if lagged < -AHEAD * squared else 0
        if self._ahead >= self._most_ahead:
            self.early = True

    def _learn(self, lag: float) -> None:
        if lag > self._largest:
            self._largest = lag
        self._learning -= 1
        if not self._learning:
            self._by_speed = min(self._given, max(MIN_SYNCS, MARGIN * self._largest))
