"""SYNC of this tick: whether it may still leave, how many did not, and from when on that is a fault.

The drives latch what the last tick sent when SYNC comes. One that comes late by more than ``LATE_SHARE``
of the period would shift their interpolation, so it is left out and counted, never doubled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from controller.geometry.vectors import ROUNDING
from controller.machine.model import Machine
from controller.state import stop_times
from controller.state.modes import Fault, Mode
from controller.tick.drives import Drives
from controller.tick.mode import Modes
from drives.cyclic.drive_fault import DriveFault
from drives.pump.player import LATE_SHARE as LATE_SHARE
from drives.pump.player import LONG_GAP as LONG_GAP

NEAREST_SHARE = 0.75  # of the period: no two SYNCs are closer
# More SYNCs than ``LONG_GAP`` are a dip, too, where no motor can have stopped meanwhile: an axis at speed v
# that may be accelerated by a is given some 3 a by its motor, has lost half of v after v / 6a, and to stand
# is the smaller step only from then on.
STOPS_SHARE: Final = 1.0 / 6.0
_RUNNING: Final = Mode.RUNNING  # an enum's members are slow to look up
BLAMED_TICKS = 3  # the silence may have begun after the buses were drained

# A setpoint of tick k is latched by SYNC k + 1 and reached at SYNC k + 2; its position is read in tick k + 3.
FEEDBACK_TICKS: Final = 3


class SyncWatch:
    """Sends SYNC, and counts what did not come or came late. Names faults; moves nothing."""

    def __init__(
        self, machine: Machine, group: Drives, modes: Modes, now: Callable[[], float], delay: int = 0
    ) -> None:
        """``delay``: ticks until a setpoint is sent."""
        self._group, self._modes, self._now = group, modes, now
        self._period_s = machine.period_s
        self._latest_s = LATE_SHARE * machine.period_s - ROUNDING
        self._nearest_s = NEAREST_SHARE * machine.period_s - ROUNDING
        self._synced_s = float("-inf")  # when the last SYNC had left, on the last of the buses
        self._takes_s = math.inf  # what that takes at least, from the first bus to the last
        self._synced_tick = 0  # the last tick that sent SYNC
        self._unsent = 0  # SYNCs in a row that the bus did not take
        self._most_unsent = round(stop_times.LOST_BUS_S / machine.period_s)
        self._skip_level = 0.0  # a bucket that skips fill and ticks drain
        self._skip_limit = max(machine.skip_limit_per_s, 1.0) if machine.late == "stop" else math.inf
        self._deaf_s = stop_times.deaf_s(machine)
        self._blamed = 0  # ticks in which what the drives have to say is of our silence
        self.latency = FEEDBACK_TICKS + delay
        self.skips = 0
        self.played = self.braked = 0
        self.late_max_s = 0.0
        self.lateness_s = 0.0  # of this tick

    def is_after_a_gap(self, tick: int, stops_within: Callable[[], float]) -> bool:
        """Whether the drives had so long no SYNC that they stand, or are closer to it than to their speed.

        ``stops_within``: ticks in which the axes could be at rest; asked where that matters.
        """
        gap = tick - self._synced_tick
        return gap > LONG_GAP and gap > STOPS_SHARE * stops_within()

    @property
    def earliest_s(self) -> float:
        """From when on a SYNC is not too close to the last one."""
        return self._synced_s + self._nearest_s + ROUNDING

    @property
    def is_unheard(self) -> bool:
        """The bus takes nothing any more."""
        return self._unsent > self._most_unsent

    def send(self, tick: int, now_s: float, lateness_s: float) -> bool:
        """SYNC, unless this tick is too late for one; whether it left."""
        if lateness_s > self._latest_s or now_s - self._synced_s < self._nearest_s:
            return False
        sent = self._group.sync(now_s)
        left_s = self._now()
        # The next one takes as long from bus to bus, so on each of them they are as far apart.
        if 0.0 <= left_s - now_s < self._takes_s:
            self._takes_s = left_s - now_s
        self._synced_s = left_s - self._takes_s
        if sent:
            self._synced_tick = tick
        self._unsent = 0 if sent else self._unsent + 1
        return sent

    def pass_over(self) -> None:
        """In a run that is made again a SYNC was left out; whether that was a gap its record says."""
        self._synced_tick += 1

    def count(self, sent: bool, ticks: int, lateness_s: float, kept_back: bool) -> None:
        """Skips and lateness. Too many skips while moving: a stop on the path.

        ``kept_back``: it was we who left SYNC out in this tick.
        """
        skips = ticks - 1 + (not sent)
        self.skips += skips
        self._measure(lateness_s, ticks, skips - kept_back)

    def count_with_pump(self, sent: bool, heard: bool, periods: int, lateness_s: float, felt: bool) -> None:
        """The tick of the last of so many periods: the pump has ``sent`` SYNC in it, and all buses took it.

        ``lateness_s`` of that SYNC; ``felt``: the tick was so late that the axes have braked. That is counted
        as one late tick, and one that nobody has felt as none.
        """
        self._unsent = 0 if heard else self._unsent + periods
        self.skips += not sent
        self._measure(lateness_s, periods, felt + (not sent))

    def count_played(self, braked: bool) -> None:
        """A period whose tick was not run; ``braked``: with it the axes have begun to brake."""
        self.played += 1
        self.braked += braked

    def _measure(self, lateness_s: float, ticks: int, late: int) -> None:
        self.lateness_s = lateness_s
        if lateness_s > self.late_max_s:
            self.late_max_s = lateness_s
        if self._modes.mode is not _RUNNING:
            self._skip_level = 0.0  # what came late at rest does no harm, now or later
            return
        drained = self._skip_level - self._skip_limit * self._period_s * ticks
        self._skip_level = (drained if drained > 0.0 else 0.0) + late
        if self._skip_level > self._skip_limit:
            self._modes.fail(Fault.TOO_MANY_SKIPS, -1)

    def look_for_our_silence(self, now_s: float, missed: int) -> None:
        """Drives that went by our heartbeat, and have none, are not what is at fault."""
        if missed * self._period_s > self._deaf_s:
            self._blamed = BLAMED_TICKS
        if self._blamed:
            self._blamed -= 1
            if self._modes.mode is not Mode.FAULT and self._group.fault(now_s)[0] is not DriveFault.NONE:
                self._modes.fail(Fault.TOO_MANY_SKIPS, -1)
