"""The real-time loop: a deadline, a tick, the next deadline.

```
  deadline:   d0            d1            d2            d3
              |SYNC         |SYNC         | (0.4 T late) |SYNC
              |             |             |    x skipped |
```
Deadlines lie on a grid, start + n T; nothing ever shifts it. A tick more than T/4 behind
its deadline sends neither SYNC nor setpoints, and deadlines slept through are counted and
not made up for: that is what keeps SYNCs at least 3/4 T apart and steps single.

The clock is an object. ``WallClock`` sleeps until shortly before the deadline and spins
the rest, so that the scheduler's wake-up is not in the SYNC; ``SteppedClock`` moves
the simulated world instead and never looks at the time of day. Of that rest a part goes into a rehearsal:
a period of sleep has left the caches to others, and a tick with cold ones takes half as long again.
A tick behind one whose SYNC left late waits the few microseconds that its own would be too close to that.

Drives lock their own clock to SYNC, also while they stand, so on a real bus it is always spun for.
Simulated drives count periods and not their length: where all are (``eased``) a machine at rest
sleeps up to the deadline, and its SYNC is late by the wake-up and the drain of the buses. Where nothing
is asked of it either, a tick is said again for the next 40 ms, and the virtual buses send its frames when
they are due, for to be woken costs more than what is done then:

```
  deadline:   d0   d1   d2   d3   d4   d5
  awake:      |                        |       a request that comes meanwhile waits for d5
  SYNC:       |    |    |    |    |    |
```
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from controller.state.modes import Fault, Request
from controller.tick.cycle import Cycle
from controller.tick.stock import Stock
from controller.tick.sync_watch import LATE_SHARE
from drives.cia402 import State, Wanted
from drives.cyclic.line import MAX_FRAMES

SPIN_S = 300e-6  # woken this long before the deadline: a late wake-up and the drain of the buses fit in
SPIN_SHARE = 0.2  # of the period at most,
MIN_SPIN_S = 150e-6  # but not less than the scheduler is often late by
FORGETS = 0.999  # in each tick, of the longest time that a rehearsal and the drain behind it took
AHEAD_S = 40e-3  # for which a tick stands in which nothing happens; an operator does not feel it
CALM_S = 0.2  # nothing has happened for so long
EASED_PERIOD_S = 2e-3  # of a shorter one a quarter, which is the most that SYNC may be late, is soon gone
PUMP_TAKES_S = 80e-6  # to hand a period over
RETRY_SHARE = 0.125  # of the period, to look again for one that was late
STAND_DOWN_S = 1.0  # for each step of an orderly end
LAST_TICKS_S = 0.5  # after an error of our own the drives are still told to stop for this long


def early_s(period_s: float) -> float:
    """How long before its deadline the loop is woken."""
    return min(SPIN_S, max(SPIN_SHARE * period_s, MIN_SPIN_S))


class Clock(Protocol):
    """What the loop asks of time; seconds since an arbitrary origin, never set back."""

    def now_s(self) -> float: ...
    def wake(self, deadline_s: float, early_s: float) -> None:
        """Returns ``early_s`` before ``deadline_s``, or late."""

    def spin(self, deadline_s: float) -> float:
        """Returns the time, which is ``deadline_s`` or later."""


class WallClock:
    """Monotonic time of this computer."""

    now_s = staticmethod(time.monotonic)

    def wake(self, deadline_s: float, early_s: float) -> None:
        left = deadline_s - early_s - time.monotonic()
        if left > 0.0:
            time.sleep(left)

    def spin(self, deadline_s: float) -> float:
        now = time.monotonic
        t = now()
        while t < deadline_s:
            t = now()
        return t


class SteppedClock:
    """Simulated time: each wait calls the steppers (bus, drives, plan, operator) with the new time.

    ``lateness(n)`` gives the seconds by which the n-th wait ends too late, for tests.
    """

    def __init__(
        self,
        steppers: Sequence[Callable[[float], None]] = (),
        lateness: Callable[[int], float] | None = None,
    ) -> None:
        self.steppers = list(steppers)
        self._lateness = lateness
        self._now_s = 0.0
        self.waits = 0

    def now_s(self) -> float:
        return self._now_s

    def wake(self, deadline_s: float, early_s: float) -> None:
        late = self._lateness(self.waits) if self._lateness is not None else 0.0
        self.waits += 1
        self._now_s = max(deadline_s + late, self._now_s)
        for step in self.steppers:
            step(self._now_s)

    def spin(self, deadline_s: float) -> float:
        return self._now_s


class Keeping(Protocol):
    """A bus that takes frames ahead of their time; see ``drives.ports.port.HubSocket``."""

    def keep(self) -> None: ...
    def later(self, at_s: float) -> None: ...
    def hand_over(self) -> None: ...


class Pump(Protocol):
    """The process that plays what the cycle publishes."""

    starved_s: float  # a record that stands still for so long is a fault

    def ended(self) -> Exception | None:
        """How it has ended, if it has."""


class Loop:
    """Runs a cycle on a clock, one ``tick`` at a time or until told to stop."""

    def __init__(
        self,
        cycle: Cycle,
        clock: Clock,
        eased: bool = False,
        ahead: Sequence[Keeping] = (),
        with_pump: bool = False,
        pump: Pump | None = None,
    ) -> None:
        """``ahead``: the buses that take frames ahead of their time, which all of simulated drives do.

        ``pump``: the process that plays what the cycle publishes, where it is one of its own.
        """
        self._cycle = cycle
        self._with_pump = with_pump
        self._clock = clock
        self._period_s = cycle.machine.period_s
        self._early_s = early_s(self._period_s)
        self._eased = eased and self._period_s >= EASED_PERIOD_S
        self._buses = tuple(ahead)
        self._at_once = _at_once(cycle, self._period_s) if self._eased and ahead else 1
        self._calm = 0  # ticks in a row in which nothing has happened
        self._most_calm = round(CALM_S / self._period_s)
        self._start_s = clock.now_s()
        self._pump = pump
        self._wake_s = self._start_s + self._period_s
        self._n = 0
        self._latest_s = LATE_SHARE * self._period_s
        self._listened = False  # before the last SYNC
        self._longest_s = 0.0  # that a rehearsal and the drain behind it took of late
        self.error: Exception | None = None  # of our own, that ended ``run``

    def tick(self) -> bool:
        """Waits for the next deadline and runs the cycle; True if SYNC went out."""
        if self._with_pump:
            return self._tick_with_pump()
        n = self._n + 1
        deadline_s = self._start_s + n * self._period_s
        if self._eased and self._cycle.at_rest:
            self._clock.wake(deadline_s, 0.0)
            began_s = self._clock.now_s()
            self._cycle.receive(began_s)
            if self._is_calm():
                return self._tick_ahead(n, began_s)
        else:
            self._calm = 0
            self._clock.wake(deadline_s, self._early_s)
            self._prepare(deadline_s)
        earliest_s = self._cycle.sync.earliest_s
        waits = deadline_s < earliest_s <= deadline_s + self._latest_s
        return self._run(n, self._clock.spin(earliest_s if waits else deadline_s))

    def _tick_with_pump(self) -> bool:
        """One tick after the pump's next period, however late; nothing depends on when it comes."""
        clock, cycle, stock, pump = self._clock, self._cycle, self._cycle.stock, self._pump
        assert stock is not None
        clock.wake(self._wake_s, 0.0)
        now_s = clock.now_s()
        if not cycle.run_with_pump(now_s):
            self._wake_s = now_s + RETRY_SHARE * self._period_s
            due_s = stock.due_s or self._start_s
            if pump is not None and now_s - due_s > pump.starved_s:
                if (error := pump.ended()) is not None:
                    raise error
                cycle.starve()
            return False
        stock.memory.at_once = self._at_once_now() if self._eased else 0
        self._wake_s = stock.due_s + (PUMP_TAKES_S if pump is not None else 0.0)
        return True

    def _at_once_now(self) -> int:
        """Periods that the pump may play at once."""
        if not self._cycle.at_rest:
            self._calm = 0
            return 0
        return self._at_once if self._is_calm() else 1

    def _run(self, n: int, now_s: float) -> bool:
        """The tick of the deadline that was reached, which is ``n`` or later."""
        reached = max(n, int((now_s - self._start_s) / self._period_s))
        lateness_s = now_s - (self._start_s + reached * self._period_s)
        self._n = reached
        return self._cycle.run(now_s, max(lateness_s, 0.0), reached - n)

    def _is_calm(self) -> bool:
        """Whether nothing has happened for some time, and nothing can but by a request."""
        self._calm = self._calm + 1 if self._at_once > 1 and self._cycle.idle else 0
        return self._calm > self._most_calm

    def _tick_ahead(self, n: int, now_s: float) -> bool:
        """This tick and, if nothing happens in it, the next ones as well, whose frames the buses keep.

        Its SYNC goes out at once, those of the others when they are due, however long all of that takes.
        """
        buses, cycle = self._buses, self._cycle
        for bus in buses:
            bus.keep()
        try:
            sent = self._run(n, now_s)
            last = n + self._at_once - 1 if cycle.idle else 0
            while self._n < last:
                self._n += 1
                due_s = self._start_s + self._n * self._period_s
                for bus in buses:
                    bus.later(due_s)
                cycle.repeat(due_s)
        finally:
            for bus in buses:
                bus.hand_over()
        return sent

    def _prepare(self, deadline_s: float) -> None:
        """Before the deadline: a rehearsal, where it will be over in time, and what came in on the buses.

        Woken behind it, SYNC comes first: what came in waits for the next tick, though never for two.
        """
        cycle, now_s = self._cycle, self._clock.now_s
        began_s = now_s()
        if self._listened and 0.0 < began_s - deadline_s <= self._latest_s:
            self._listened = False
            return
        self._listened = True
        if deadline_s - began_s <= self._longest_s:
            cycle.receive(began_s)
            self._longest_s *= FORGETS
            return
        cycle.rehearse(began_s)
        cycle.receive(now_s())
        took_s = min(now_s() - began_s, self._early_s)
        self._longest_s = max(took_s, FORGETS * self._longest_s)

    def run(self, go_on: Callable[[], bool]) -> Fault:
        """Ticks while ``go_on()``; INTERNAL if an error of our own ended it, after stopping the drives."""
        try:
            while go_on():
                self.tick()
        except Exception as error:  # the one place: whatever it was, the drives must stop
            self.error = error
            self._stop_drives()
            return Fault.INTERNAL
        return Fault.NONE

    def stand_down(self) -> None:
        """Asked to end, perhaps in a cut: to rest on the path, then the drives off, brakes first."""
        cycle, group = self._cycle, self._cycle.group
        cycle.modes.request(Request.STOP, 0.0, cycle.follow.at_rest)
        self._run_while(lambda: not cycle.follow.at_rest)
        group.want(Wanted.OFF)
        self._run_while(lambda: any(drive.state is State.OPERATION_ENABLED for drive in group.drives))

    def _run_while(self, going: Callable[[], bool]) -> None:
        left = iter(range(round(STAND_DOWN_S / self._period_s)))
        self.run(lambda: going() and next(left, None) is not None)

    def _stop_drives(self) -> None:
        """Quick stop for all, with as little of ours as possible between it and the bus."""
        cycle, group = self._cycle, self._cycle.group
        ended = self._pump is not None and self._pump.ended() is not None
        cycle.modes.fail(Fault.SYNC_LOST if ended else Fault.INTERNAL, -1)
        cycle.modes.quick_stop()
        with contextlib.suppress(Exception):
            cycle.peripherals.coolant_off()
        stock = cycle.stock if self._with_pump else None
        if stock is not None and not ended:
            self._stop_by_pump(stock)
            return
        self._n = max(self._n, int((self._clock.now_s() - self._start_s) / self._period_s))
        for _ in range(round(LAST_TICKS_S / self._period_s)):
            with contextlib.suppress(Exception):
                self._n += 1
                self._clock.wake(self._start_s + self._n * self._period_s, self._early_s)
                now_s = self._clock.spin(self._start_s + self._n * self._period_s)
                group.receive(now_s)
                group.sync(now_s)
                group.command(group.positions, now_s)
                cycle.show_life()

    def _stop_by_pump(self, stock: Stock) -> None:
        """Quick stop for all by the pump, whose last plan brings it to silence."""
        cycle, group = self._cycle, self._cycle.group
        for _ in range(round(LAST_TICKS_S / self._period_s)):
            with contextlib.suppress(Exception):
                self._clock.wake(self._clock.now_s() + self._period_s, 0.0)
                now_s = self._clock.now_s()
                group.receive(now_s)
                group.show(stock.memory)
                group.send_events(now_s)
                cycle.show_life()


def _at_once(cycle: Cycle, period_s: float) -> int:
    """Ticks that may be said at once: what answers to them on one bus is taken in one drain."""
    fullest = max((len(line.drives) + len(line.others) for line in cycle.group.lines), default=0)
    return max(1, min(int(AHEAD_S / period_s + 0.5), MAX_FRAMES // (fullest + 1)))
