"""The path ahead, for the stock of setpoints: what the next ticks will send if nothing changes.

A second follower of the same queue runs ahead of the first by so many periods that the pump can go on
without a tick, and by so many more that it has a way to brake on. It computes one period a tick; where
something has changed (a hold, an override of 0, another plan) it begins anew from where the first one is.
It passes no mark: what comes after one nobody knows yet.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from controller.geometry.vectors import ROUNDING
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints, Machine
from controller.state.modes import Fault
from controller.tick.check import Check
from controller.tick.follow import Follow, Step
from controller.tick.jog import Jogging
from controller.tick.joints import INT32, Encoder
from drives.pump.plan_memory import Stop

EXTRA: Final = 8  # periods of a jog that are looked ahead beyond the stock, so that it need not be each tick
MAX_ROWS: Final = 1200  # of the path ahead
_NONE: Final = Fault.NONE
_LOST: Final = Step.LOST


class Row(NamedTuple):
    """One period ahead."""

    joints: Joints
    counts: tuple[float, ...]
    s: float  # along the path, from wherever it began to be counted
    motion: int  # the motion it is on, ...
    place: float  # ... how far along it ...
    end: float  # ... and its length
    tau: float
    now: int  # number in the queue
    stop: Stop | None  # what is left of one that is under way
    rests: bool  # at rest, and nothing goes on by itself
    led_mm: float = 0.0  # along a thread, beyond its law ...
    led_on: bool = False  # ... and still on the move there: no stop begins
    rev_s: float = 0.0  # that the spindle is led at ...
    turn: float = 0.0  # ... its revolutions in one mm, 0: it is not led ...
    ahead_mm: float = 0.0  # ... and how far the axes are ahead of the law, since their drives lag

    def columns(self, thread: bool) -> tuple[float, ...]:
        """As a plan has them."""
        row = (self.s, *self.counts)
        return (*row, self.rev_s, self.turn, self.ahead_mm) if thread else row

    def led_as(self, last: Row, per_mm: Sequence[float]) -> Row:
        """On its thread, with the axes as far from the law as in ``last``; ``per_mm``: counts."""
        by = last.led_mm - self.led_mm
        counts = tuple([count + by * one for count, one in zip(self.counts, per_mm, strict=True)])
        return self._replace(counts=counts, led_mm=last.led_mm, turn=last.turn, ahead_mm=last.ahead_mm)


class Conditions(NamedTuple):
    """What the path ahead depends on besides the queue."""

    running: bool = False
    feed: bool = False  # the override is not 0
    rapid: bool = False
    optional_stop: bool = False
    single_block: bool = False
    jog_speed: float = 0.0  # per tick; then all others are nothing
    by_hand: bool = False


STANDING: Final = Conditions()


class Ghost(Follow):
    """Runs ahead of ``follow`` on its queue."""

    def __init__(self, machine: Machine, follow: Follow) -> None:
        super().__init__(machine, kinematics_of(machine), follow.coupling.unseen_twin(machine), follow.queue)

    def step(self, go: bool) -> Step:
        if self._brake.active and self._brake.over:  # what comes after a stop is the first one's to say
            self._take(self.joints, 0.0)
            return Step.MOVED
        return super().step(go)

    def _arrive(self, wanted: bool) -> Step:
        return super()._arrive(False)

    def _remember(self) -> None:
        """Nothing: its steps are not taken back."""

    def _passes(self, i: int) -> bool:
        return not self._queue[i].leaves_thread

    def _describe(self) -> None:
        entry = self._queue[self._now]
        self.piece = entry.piece
        self.s, _, _ = entry.at(self._clock.tau)

    @property
    def knows_its_place(self) -> bool:
        """Whether the entry that it is in is still there."""
        return self._queue.first <= self._now <= self._queue.last

    def row(self, counts: tuple[float, ...], before: Row) -> Row:
        """Where it is now, after ``before``."""
        queue, now = self._queue, self._now
        stands = self.joints == self.last
        stop = self._brake.rest if self._brake.active and not self._brake.over else None
        tau = self._clock.tau
        if not len(queue) or queue[now].motion is None:
            rests = stands and (not len(queue) or tau >= queue[now].end_s - ROUNDING or not self._goes)
            stands_at = before._replace(joints=self.joints, counts=counts, stop=None)
            led = self._led(False)
            return stands_at._replace(tau=tau, now=now, rests=rests and not self.coupling.goes_on, **led)
        entry = queue[now]
        assert entry.motion is not None
        motion, place, end = entry.piece.motion_id, self.s, entry.motion.end
        far = place - before.place
        if motion != before.motion:
            while now > queue.first and queue[now - 1].piece.motion_id == motion:
                now -= 1
            far = max(0.0, before.end - before.place) + place - queue[now].begins_at
        halted = not self._goes or tau == before.tau
        stopped = self._brake.active and self._brake.over
        rests = stopped or (stands and stop is None and halted and not self.coupling.goes_on)
        led = self._led(self.coupling.dies_away)
        return Row(
            self.joints, counts, before.s + far, motion, place, end, tau, self._now, stop, rests, **led
        )

    def _led(self, led_on: bool) -> dict[str, Any]:
        """What a row has of the tie to a spindle."""
        tie, move = self.coupling, self.coupling.move
        if not tie.active or move is None:
            return {"led_mm": 0.0, "led_on": False, "rev_s": 0.0, "turn": 0.0, "ahead_mm": 0.0}
        led = {"led_mm": tie.led_mm, "led_on": led_on, "rev_s": tie.rev_s}
        return {**led, "turn": move.rev_per_mm, "ahead_mm": tie.ahead_mm}

    def stop_at(self, row: Row) -> Stop | None:
        """The stop that begins at a row; None: none does."""
        if row.stop is not None or row.led_on:
            return None if row.led_on or row.stop is None else self.coupling.stop_of(row.stop)
        found = self._queue.stop_at(row.tau)
        if found is None or row.now > self._queue.last:
            return None
        table, i = found
        _, v, a = self._queue[row.now].at(row.tau)
        held = max(1, round(table.jerk_step_s / self._clock.period_s))
        stop = Stop(table.jerks[table.first[i] : table.first[i + 1]], held, 0, v, a)
        return self.coupling.stop_of(stop)

    def rests_at(self, row: Row) -> bool:
        """Whether the plan itself rests at a row, so that it can simply end there."""
        queue = self._queue
        if row.led_on:
            return False
        return row.rests or not len(queue) or (row.stop is None and queue[row.now].rests_at(row.tau))


class Lookahead:
    """Read ``rows``: of the next tick, and so on. ``path``: further rows to brake along."""

    def __init__(self, machine: Machine, follow: Follow, encoder: Encoder, periods: int) -> None:
        """``periods`` that the pump is to bridge."""
        self._follow, self._real_encoder, self._periods = follow, encoder, periods
        self._encoder = Encoder(machine)  # of the rows, where setpoints depend on those before them
        self._ghost = Ghost(machine, follow)
        self._check = Check(machine)
        self._period_s = machine.period_s
        self._conditions: Conditions | None = None
        self._taken = -1  # messages of pieces, when it began
        self.rows: deque[Row] = deque()
        self.path: list[Row] = []
        self.here = self._standing()
        self.before_stop: int | None = None  # rows of a jog before its stop begins
        self._known_stop: tuple[Row | None, Stop | None] = (None, None)  # of the row that was looked at last
        self._jog_speed = 0.0  # per tick, that the rows of a jog are towards; 0: all are those of its stop
        self.renewed = False  # rows of a jog are others than in the last plan; set back by who writes them
        self._ended = False

    def _standing(self) -> Row:
        joints = self._follow.joints
        return Row(joints, self._real_encoder.exact, 0.0, -1, 0.0, 0.0, self._follow.tau, 0, None, True)

    def forget(self) -> None:
        """The joints are where the drives are: there is no path ahead."""
        self._conditions = None
        self.rows.clear()
        self.path.clear()
        self.here, self.before_stop = self._standing(), None

    def go_on(self, conditions: Conditions, replaced_s: float) -> bool:
        """After a tick: whether what was ahead still holds; from now on it does.

        ``replaced_s``: plan time from which on the queue was replaced in this tick; infinite: it was not.
        """
        follow, rows = self._follow, self.rows
        same = conditions == self._conditions and bool(rows) and self._ghost.knows_its_place
        same = same and not follow.coupling.active  # on a thread the farthest row has been foreseen anew
        if same and rows[0].joints == follow.joints and rows[0].tau == follow.tau:  # in a dwell all stand
            self.here = rows.popleft()
            last = rows[-1] if rows else self.here
            if math.isinf(replaced_s) or (replaced_s > last.tau - ROUNDING and not last.rests):
                return True
        self._begin(conditions)
        return False

    def go_on_by_hand(self, jogging: Jogging, played: bool) -> bool:
        """Likewise for a jog, whose stop is among the rows; ``played``: they have been, as they were."""
        rows, before_stop = self.rows, self.before_stop
        same = before_stop is not None and bool(rows) and rows[0].joints == self._follow.joints
        if same and before_stop is not None:
            self.here = rows.popleft()
            self.before_stop = before_stop = before_stop - 1
            same = jogging.speed == self._jog_speed  # towards two of them it can go alike for a while
            if same and (played or not jogging.goes or before_stop >= self._periods):
                return True
        else:
            self._conditions = None
            self.path.clear()
            self.here = self._standing()
        rows.clear()
        self._encoder.go_on_as(self._real_encoder)
        for joints in jogging.ahead(self._periods + EXTRA):
            before = rows[-1] if rows else self.here
            counts = self._encoder.counts(joints)
            rows.append(before._replace(joints=joints, counts=counts, s=before.s + 1.0, rests=False))
        self.renewed, self._jog_speed = True, jogging.speed
        self.before_stop = self._periods + EXTRA if jogging.goes else len(rows)
        return same and jogging.goes

    def _begin(self, conditions: Conditions) -> None:
        ghost, before = self._ghost, self.here
        if self._follow.stopping:
            s = self.rows[-1].s if self.rows else before.s
            self.path = [*self.rows, *(row for row in self.path if row.s > s)]
        else:
            self.path = []
        self.rows.clear()
        ghost.go_on_as(self._follow)
        self._conditions, self._ended, self.before_stop = conditions, False, None
        self._known_stop = None, None
        self._encoder.go_on_as(self._real_encoder)
        self.here = ghost.row(self._real_encoder.exact, before)

    def further(self) -> list[Row]:
        """Rows to brake along behind ``rows``; on a thread they go on as the last one is led."""
        last, move = self.rows[-1] if self.rows else self.here, self._ghost.coupling.move
        found = [row for row in self.path if row.s > last.s]
        if move is None:
            return found
        per_mm = self._encoder.per_mm(move.direction)
        return [row.led_as(last, per_mm) for row in found]

    def fill(self) -> tuple[int, Stop | None]:
        """Looks as far ahead as the stock needs it: rows that may be played, and the stop after them."""
        rows, ghost = self.rows, self._ghost
        if self._conditions is None:
            return len(rows), None
        n = self._periods
        while len(rows) < n and self._extend():
            pass
        while True:
            row = rows[n - 1] if n and n <= len(rows) else None
            if row is None:
                break
            if ghost.rests_at(row):
                return n, None
            known, stop = self._known_stop
            if known is not row:
                stop = ghost.stop_at(row)
                self._known_stop = row, stop
            if stop is not None and len(stop.jerks) and self._covers(row.s + self._at_most(stop)):
                return n, stop
            if n == len(rows) and not self._extend():
                break
            n += 1  # where the plan itself is as quick as any stop, no stop begins: up to its rest
        return self._shorter(min(self._periods, len(rows)))

    def _shorter(self, n: int) -> tuple[int, Stop | None]:
        """The last place before where it can end: nowhere, and the motors stand at once."""
        ghost = self._ghost
        while n > 0:
            row = self.rows[n - 1]
            if ghost.rests_at(row):
                return n, None
            stop = ghost.stop_at(row)
            if stop is not None and len(stop.jerks) and self._covers(row.s + self._at_most(stop)):
                return n, stop
            n -= 1
        here = self.here
        stop = None if ghost.rests_at(here) else ghost.stop_at(here)
        return 0, stop if stop is not None and self._covers(here.s + self._at_most(stop)) else None

    def _covers(self, s: float) -> bool:
        """Whether the path ahead is known up to there, or to a rest before it."""
        rows = self.rows
        if self.path and self.path[-1].s >= s:
            return True
        while not rows or (rows[-1].s < s and not rows[-1].rests):
            if not self._extend():
                return bool(rows) and (rows[-1].rests or self._ghost.rests_at(rows[-1]))
        return True

    def _at_most(self, stop: Stop) -> float:
        """No stop is longer: at the speed that it has at most, for as long as it takes."""
        h, v, a = stop.held * self._period_s, stop.v, stop.a
        for jerk in stop.jerks:
            if a <= 0.0:
                break
            v += h * (a + 0.5 * h * max(jerk, 0.0))
            a += h * jerk
        return v * h * len(stop.jerks)

    def _extend(self) -> bool:
        """One row more; False where nobody knows what comes."""
        ghost, rows, conditions = self._ghost, self.rows, self._conditions
        if self._ended or conditions is None or len(rows) >= MAX_ROWS:
            return False
        before = rows[-1] if rows else self.here
        if before.rests:
            return False
        go = ghost.goes(conditions.running, float(conditions.feed), float(conditions.rapid))
        lost = ghost.step(go) is _LOST
        fault, _ = self._check.judge(ghost.joints, ghost.last, ghost.before)
        counts = self._encoder.counts(ghost.joints)
        if lost or fault is not _NONE or not -INT32 < min(counts) <= max(counts) < INT32 - 1:
            self._ended = True
            return False
        rows.append(ghost.row(counts, before))
        return True
