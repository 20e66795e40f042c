"""The stock of setpoints that the pump plays: what the tick publishes, and what it learns was played.

The pump sends SYNC and setpoints at t0 + m T, also where the tick is late. What the tick of period n has
computed goes out in period n + ``DELAY``: by then the plan that has it is there, for the next period may be
on its way already. After it stand the periods that ``Lookahead`` sees, and the stop after them.

```
   period      n - 1      n            n + 1          n + 2          n + 3 ...
   the pump               sends n - 2  sends n - 1    sends n        sends what is ahead
   the tick               computes n ---- publishes ---^
```

Where axes miss something, how far a reversal has come is a matter of time: along a stop that the pump has
begun, or at rest where the rows end, it is with those rows, and for the tick it went on. Such a stop is
played to its rest; from there the setpoints are led to the tick's own by a ``Bridge``, as slowly as a
reversal itself, and the path waits for it: what it needs of the limits nothing else uses at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from controller.machine.model import Machine
from controller.tick.drives import Drives
from controller.tick.jog import Jogging
from controller.tick.joints import Encoder
from controller.tick.lookahead import Conditions, Lookahead, Row
from drives.pump.braking import Braking, led_rev_s
from drives.pump.lead import Lead, LedRows
from drives.pump.plan_memory import Memory, Phase, PlanWriter, Played, Stop
from drives.pump.player import beat_every, to_counts
from drives.pump.speed_ramp import NO_RAMP, SpeedRamp

NEVER: Final = 1 << 60  # period
_GAP: Final = Phase.GAP  # looked up every tick, and an enum's members are slow to look up
DELAY: Final = 2  # periods from a tick to the period that sends what it has computed
ANSWERS_S: Final = 250e-6  # after SYNC: its frame, a drive's own time and the answer's take as much
STOPPED_S: Final = 0.1  # a tick that does not run is tolerated for so long at rest; then nothing is sent


class Bridge(NamedTuple):
    """From the counts of a stop, or where rows ended at rest, to those of the path, of each axis."""

    begin: int  # period
    ticks: Sequence[int]  # that it takes
    off: Sequence[float]  # counts, in that period ...
    speed: Sequence[float]  # ... and how fast it grows there

    def is_over(self, period: int) -> bool:
        return period - self.begin >= max(self.ticks)

    def over(self, period: int, counts: Sequence[float]) -> list[float]:
        """The counts of the path, led."""
        t = max(-1, period - self.begin)  # the one before is as the stop had it
        return [
            count + _left(off, speed, t, n)
            for count, n, off, speed in zip(counts, self.ticks, self.off, self.speed, strict=True)
        ]


class Published(NamedTuple):
    """A plan: ``rows`` of the periods from ``first`` on, of which ``nominal`` are played as they are."""

    number: int
    first: int
    nominal: int
    rows: Sequence[Row]
    bridge: Bridge | None  # that leads them
    lead: Lead | None  # likewise, on a thread
    stop: Stop | None
    same_until: int  # up to here the next plan is the same, if nothing changes
    changes: int  # the first period in which it differs from the plan that it was built on
    anew: bool
    by_hand: bool  # the stop is among its rows, from ``same_until`` on
    ramp: SpeedRamp  # of the spindle where no row leads it

    @property
    def newest(self) -> int:
        """The period that has the setpoints of the tick by which it was published."""
        return self.first + 1

    def is_nominal(self, period: int) -> bool:
        return period - self.first < self.nominal


def _left(off: float, speed: float, t: int, ticks: int) -> float:
    """By quintics, to nothing, its speed and its acceleration."""
    if t >= ticks:
        return 0.0
    if t < 0:
        return off + t * speed
    x = t / ticks
    rest = 1.0 - x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    return off * rest + speed * ticks * x * (1.0 - x * x * (6.0 - 8.0 * x + 3.0 * x * x))


class Stock:
    """The tick's end of the plans.

    Read: ``period``, the newest that was played; its ``phase``; ``lateness_s`` of its SYNC; ``due_s``, when
    the next one is due.
    """

    def __init__(
        self, machine: Machine, group: Drives, ahead: Lookahead, encoder: Encoder, memory: Memory
    ) -> None:
        self.ahead = ahead
        self.memory = memory
        self.period = -1
        self.phase = Phase.SILENT
        self.since = -1
        self.lateness_s = 0.0
        self.due_s = 0.0
        self.moved_s = 0.0  # by which the pump itself was late since the last look
        self.unsent = 0  # buses that took nothing of it, bit mask
        self._group, self._encoder = group, encoder
        self._writer = PlanWriter(memory)
        self._period_s = machine.period_s
        self._hold = round(STOPPED_S / machine.period_s)
        self._beat_every = beat_every(machine.period_s, group.master.heartbeat_s)
        self._plan: Published | None = None
        self._before: Published | None = None  # the plan before it
        self._braking: Braking | None = None
        self._braked_at = 0
        self._last: Row = ahead.here  # of the tick before
        self._tail = 0  # first period whose row has not been written yet
        self._written: Sequence[Row] = ()  # of the last plan, also if it was not taken, ...
        self._written_from = 0  # ... and their first period
        self._same = False  # what was ahead of the last plan still holds
        self._bridge: Bridge | None = None
        self._reverses = any(encoder.reversal_ticks)
        self.refused = False  # the step of the tick before was not sent: its plan came too late

    # -- what was played

    def look(self) -> Sequence[int]:
        """The periods that have been handed over since the last look: the drives are held against them."""
        played = self._writer.played()
        if played.period <= self.period:
            return ()
        self.refused = False
        plan = self._plan
        if plan is not None and self._before is not None and _is_refused(plan, played):
            self._plan, self._braking = self._before, None
            self.refused = plan.changes <= plan.newest
        periods = range(self.period + 1, played.period + 1)
        self.period, self.phase, self.since = played.period, played.phase, played.since
        self.lateness_s = played.late_ns * 1e-9
        due_s = played.due_ns * 1e-9
        self.moved_s = due_s - self.due_s - len(periods) * self._period_s if self.due_s else 0.0
        self.due_s = due_s
        self.unsent = played.unsent
        if played.unsent:
            self._group.look_for_unsent(played.unsent)
        return periods

    def account_for(self, period: int) -> None:
        """From now on the drives owe their answers to this period: what came before has been heard."""
        counts, rev_s = self._sent(period)
        self._group.was_played(counts, period % self._beat_every == 0, rev_s)

    def is_late(self, now_s: float) -> bool:
        """Whether the drives may have answered the newest SYNC already."""
        return now_s > self.due_s - self._period_s + ANSWERS_S

    def foreseen(self, conditions: Conditions, replaced_s: float) -> Row | None:
        """What the next step of the path comes to, where all is as it was when that was looked ahead."""
        return self.ahead.foreseen(conditions, replaced_s, self._last.joints)

    @property
    def stood_from(self) -> int:
        """The first period in which the pump repeated the last one, since the motors have stood meanwhile."""
        return self.since if self.phase is _GAP else NEVER

    def counts(self, period: int) -> Sequence[int]:
        """What the pump has sent in a period, or will."""
        return self._sent(period)[0]

    def _sent(self, period: int) -> tuple[Sequence[int], float | None]:
        """Likewise, with how fast it has led the spindle; None: it has not."""
        counts, rev_s = self._exact(period)
        if rev_s is None and self._plan is not None:
            rev_s = self._plan.ramp.at(period)
        return to_counts(counts), rev_s

    def _exact(self, period: int) -> tuple[Sequence[float], float | None]:
        """Likewise, before it is rounded; of a stop, never one before that which was asked for last."""
        plan = self._plan
        if plan is None:
            return self._encoder.setpoints, None
        if self.phase is _GAP and period >= self.since:
            period = self.since - 1
        i, end = period - plan.first, 1 + self.memory.drives
        if i < plan.nominal or plan.stop is None:
            n = max(0, min(i, plan.nominal - 1))
            if plan.bridge is None and plan.rows[n].law is None:  # nothing leads it
                return plan.rows[n].counts, None
            row = self._led(plan)(n)
            rev_s = led_rev_s(row[end:])
            return row[1:end], rev_s if rev_s is None or i < plan.nominal else 0.0
        if self._braking is None:
            at, thread = plan.nominal - 1, self.memory.thread
            self._braking = Braking(plan.stop, self._period_s, self._led(plan), at, len(plan.rows), thread)
            self._braked_at = at
        while self._braked_at < i and not self._braking.over:
            self._braking.step()
            self._braked_at += 1
        return self._braking.counts, self._braking.rev_s

    def _led(self, plan: Published) -> LedRows:
        """The rows of a plan as they are played."""
        first, rows, bridge = plan.first, plan.rows, plan.bridge
        return LedRows(lambda n: self._columns(first + n, rows[n], bridge), plan.lead)

    def is_nominal(self, period: int) -> bool:
        """Whether the plan has it as a row of its own, and not as a part of the stop."""
        return self._plan is None or self._plan.is_nominal(period)

    def brakes_in(self, period: int) -> bool:
        """Whether the plan sends a part of its stop then."""
        plan = self._plan
        return plan is not None and (plan.by_hand or plan.stop is not None) and period >= plan.same_until

    @property
    def is_apart(self) -> bool:
        """Whether what is sent is not where the path has it yet: motion waits for it."""
        behind_rows = self._plan is not None and not self._plan.is_nominal(self.period + DELAY - 1)
        return self._reverses and (self._bridge is not None or behind_rows)

    # -- what is to be played

    def moved(self, conditions: Conditions, replaced_s: float) -> None:
        """After each step along the path; ``replaced_s``: see ``Lookahead.go_on``."""
        self._last = self.ahead.here
        self._same = self.ahead.go_on(conditions, replaced_s) and self._same

    def moved_by_hand(self, jogging: Jogging, played: bool) -> None:
        """After each step of a jog; ``played``: it was one that the pump has played meanwhile."""
        self._last = self.ahead.here
        self._same = self.ahead.go_on_by_hand(jogging, played) and self._same

    def moved_otherwise(self) -> None:
        """After each step that is none along the path."""
        self._last, self._same = self.ahead.here, False
        self.ahead.forget()

    def publish(self, anew: bool) -> None:
        """After the tick of ``period``. ``anew``: the pump has fallen silent, or the motors have stood."""
        ahead, here, writer, old = self.ahead, self.ahead.here, self._writer, self._plan
        if self.is_apart and not anew and self._plays_on():
            self._group.show(self.memory)
            return
        nominal, stop = ahead.fill()
        first = self.period - 1 + DELAY
        rows = [self._last, here, *ahead.rows]
        if self._reverses:
            self._bridge_over(first + 1, anew)
        bridge = self._bridge
        if old is None or anew:
            rows[0] = here
            changes = begin = first
        elif self._same:
            changes = self.period + DELAY if ahead.is_led else old.same_until
            begin = first if ahead.renewed or self._tail < first else self._tail
        else:
            changes, begin = self.period + DELAY, first
        tail, lead = first + len(rows), ahead.lead
        if lead is not None:
            lead = lead._replace(known=DELAY + lead.known)
            for i in range(min(lead.known, begin - first)):
                if rows[i] is not self._written[first + i - self._written_from]:
                    writer.put(first + i, self._columns(first + i, rows[i], bridge))
        for period in range(begin, tail):
            writer.put(period, self._columns(period, rows[period - first], bridge))
        self._tail = tail
        writer.end_at(tail)
        if ahead.path:
            further = ahead.further()
            for period, row in enumerate(further, tail):
                writer.put(period, self._columns(period, row, bridge))
            rows += further
        self._written, self._written_from = rows, first
        spindle = self._group.spindle
        ramp = NO_RAMP if spindle is None else spindle.ramp(self.period, self._period_s)
        writer.publish(first, changes, DELAY + nominal, self._hold, stop, anew, lead, ramp)
        played = DELAY + nominal
        before_stop = played if ahead.before_stop is None else DELAY + ahead.before_stop
        self._before, self._braking = old, None
        by_hand, until = ahead.before_stop is not None, first + before_stop
        self._plan = Published(
            writer.number, first, played, rows, bridge, lead, stop, until, changes, anew, by_hand, ramp
        )
        ahead.renewed, self._same = False, True
        self._group.show(self.memory)

    def _plays_on(self) -> bool:
        """Whether a stop is under way that the pump is to play to its rest; on a thread it is led anew."""
        self._exact(self.period + DELAY - 1)
        return self._braking is not None and not (self._braking.over or self.ahead.is_led)

    def _columns(self, period: int, row: Row, bridge: Bridge | None) -> tuple[float, ...]:
        """A row as the plan has it."""
        found = row.columns(self.memory.thread)
        if bridge is None:
            return found
        end = 1 + self.memory.drives
        return (found[0], *bridge.over(period, found[1:end]), *found[end:])

    def _bridge_over(self, begin: int, anew: bool) -> None:
        """What is new from ``begin`` on goes on from where the pump has gone behind its rows, if it has."""
        bridge, plan, ticks = self._bridge, self._plan, self._encoder.reversal_ticks
        if anew or (bridge is not None and bridge.is_over(begin - 1)):
            self._bridge = None
        if plan is None or plan.is_nominal(begin - 1):
            return
        (before, _), (there, _) = self._exact(begin - 1), self._exact(begin)
        last, here = self._last.counts, self.ahead.here.counts
        off = [a - b if n else 0.0 for a, b, n in zip(there, here, ticks, strict=True)]
        old = [a - b if n else 0.0 for a, b, n in zip(before, last, ticks, strict=True)]
        speed = [a - b for a, b in zip(off, old, strict=True)]
        self._bridge = Bridge(begin, [max(1, n) for n in ticks], off, speed)


def _is_refused(plan: Published, played: Played) -> bool:
    """Whether the pump goes on by the plan before, or will: it takes none that comes too late.

    One that it has not looked at yet it looks at for the next period.
    """
    if played.number == plan.number or plan.anew:
        return False
    if played.seen >= plan.number:
        return True
    begins = played.phase is Phase.SILENT or played.phase is Phase.GAP
    return begins or plan.changes <= played.prepared
