"""The path ahead, for the stock of setpoints: what the next ticks will send if nothing changes.

A second follower of the same queue runs ahead of the first by so many periods that the pump can go on
without a tick, and by so many more that it has a way to brake on. It computes one period a tick; where
something has changed (a hold, an override of 0, another plan) it begins anew from where the first one is.
It passes no mark: what comes after one nobody knows yet.

Along a thread it goes by the law alone. What leads beside it is laid over the rows of the stock, where it is
another than before: mostly over the farthest of them. The rows behind those are led by whoever plays them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

from controller.geometry.vectors import ROUNDING
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints, Machine
from controller.motion.motions import ThreadMove
from controller.state.modes import Fault
from controller.tick.check import Check
from controller.tick.coupling import Law
from controller.tick.follow import NOWHERE, Follow, Foreseen, Step
from controller.tick.jog import Jogging
from controller.tick.joints import INT32, Encoder
from controller.tick.law_alone import LawAlone
from controller.tick.queue import Entry
from drives.pump.lead import Correction, Lead
from drives.pump.plan_memory import Stop

EXTRA: Final = 8  # periods of a jog that are looked ahead beyond the stock, so that it need not be each tick
MAX_ROWS: Final = 1200  # of the path ahead
SPARE: Final = 3  # rows beyond those that a stop needs
_NONE: Final = Fault.NONE
_LOST: Final = Step.LOST
_NEVER: Final = -2  # row: before the one that is here


class Row(NamedTuple):
    """One period ahead."""

    joints: Joints
    counts: tuple[float, ...]
    s: float  # along the path, from wherever it began to be counted
    motion: int  # the motion it is on, ...
    place: tuple[float, float, float]  # ... how far along it, with speed and acceleration ...
    end: float  # ... and its length
    tau: float
    now: int  # number in the queue
    stop: Stop | None  # what is left of one that is under way
    rests: bool  # at rest, and nothing goes on by itself
    ends: bool  # likewise, or the plan itself stands there: it can simply end with this row
    over: bool = False  # a stop is
    law: Law | None = None  # of a thread; without ``by`` joints and counts are at its own place
    by: Correction | None = None  # what leads beside it ...
    rev_s: float = 0.0  # ... the spindle, and ...
    ahead_mm: float = 0.0  # ... the axes, since their drives lag
    of: tuple[int, float] = NOWHERE  # motion and place of the joints; by rounding it is not ``place``

    def columns(self, thread: bool) -> tuple[float, ...]:
        """As a plan has them."""
        row, law = (self.s, *self.counts), self.law
        if not thread:
            return row
        if law is None:
            return (*row, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if self.by is None:
            return (*row, law.rev_s, law.move.rev_per_mm, 0.0, law.rev_s2, law.v, law.a)
        return (*row, self.rev_s, law.move.rev_per_mm, self.ahead_mm, 0.0, 0.0, 0.0)


class Conditions(NamedTuple):
    """What the path ahead depends on besides the queue."""

    running: bool = False
    feed: bool = False  # the override is not 0
    rapid: bool = False
    optional_stop: bool = False
    single_block: bool = False
    jog_speed: float = 0.0  # per tick; then all others are nothing
    by_hand: bool = False

    @property
    def marks(self) -> tuple[bool, bool]:
        """Which of them count."""
        return self.optional_stop, self.single_block


STANDING: Final = Conditions()


class Ghost(Follow):
    """Runs ahead of ``follow`` on its queue."""

    def __init__(self, machine: Machine, follow: Follow) -> None:
        self.tie = LawAlone(machine, follow.coupling)
        super().__init__(machine, kinematics_of(machine), self.tie, follow.queue)

    def step(self, go: bool, foreseen: Foreseen | None = None) -> Step:
        if self._brake.active and self._brake.over:  # what comes after a stop is the first one's to say
            self._take(self.joints, 0.0)
            return Step.MOVED
        return super().step(go, foreseen)

    def _arrive(self, wanted: bool) -> Step:
        return super()._arrive(False)

    def _remember(self) -> None:
        """Nothing: its steps are not taken back."""

    def _passes(self, i: int) -> bool:
        return not self._queue[i].leaves_thread

    def _describe_as(self, entry: Entry, place: tuple[float, float, float]) -> None:
        self.piece, (self.s, _, _) = entry.piece, place

    @property
    def is_in_queue(self) -> bool:
        """Whether the entry that it is in is still there."""
        return self._queue.first <= self._now <= self._queue.last

    def row(self, counts: tuple[float, ...], before: Row) -> Row:
        """Where it is now, after ``before``."""
        queue, now = self._queue, self._now
        stands = self.joints == self.last
        stop = self._brake.rest if self._brake.active and not self._brake.over else None
        tau = self._clock.tau
        if queue.is_empty or queue[now].motion is None:
            rests = stands and (queue.is_empty or tau >= queue[now].end_s - ROUNDING or not self._goes)
            stays = before.s, before.motion, before.place, before.end
            return Row(self.joints, counts, *stays, tau, now, None, rests, True, False, self.tie.law)
        entry = queue[now]
        assert entry.motion is not None
        motion, end, (_, v, a) = entry.piece.motion_id, entry.motion.end, entry.at(tau)
        far = self.s - before.place[0]
        if motion != before.motion:
            while now > queue.first and queue[now - 1].piece.motion_id == motion:
                now -= 1
            far = max(0.0, before.end - before.place[0]) + self.s - queue[now].begins_at
        halted = not self._goes or tau == before.tau
        stopped = self._brake.active and self._brake.over
        rests = stopped or (stands and stop is None and halted)
        goes = before.s + far, motion, (self.s, v, a), end
        ends = rests or (stop is None and entry.rests_at(tau))
        law, of = self.tie.law, self._of
        return Row(self.joints, counts, *goes, tau, self._now, stop, rests, ends, stopped, law, of=of)

    def by_law(self) -> None:
        """From where the law is."""
        law = self.tie.law
        if law is not None:
            self.joints = self.at(law.move, law.s)

    def at(self, move: ThreadMove, s: float) -> Joints:
        """The joints at a place of a thread, on which the rotaries stand."""
        found = move.joints(s, self._rotaries(self.joints), self._kinematics)
        return self.joints if found is None else found

    def stop_at(self, row: Row) -> Stop | None:
        """The stop of the law that begins at a row; None: none does."""
        if row.stop is not None:
            return row.stop
        found = self._queue.stop_at(row.tau)
        if found is None or row.now > self._queue.last:
            return None
        table, i = found
        _, v, a = row.place
        held = max(1, round(table.jerk_step_s / self._clock.period_s))
        return Stop(table.jerks[table.first[i] : table.first[i + 1]], held, 0, v, a)


class Lookahead:
    """Read ``rows``: of the next tick, and so on. ``path``: further rows to brake along."""

    def __init__(self, machine: Machine, follow: Follow, encoder: Encoder, periods: int) -> None:
        """``periods`` that the pump is to bridge."""
        self._follow, self._real_encoder, self._periods = follow, encoder, periods
        self._encoder = Encoder(machine)  # of the rows, where setpoints depend on those before them ...
        self._encoder_led = Encoder(machine)  # ... and, on a thread, of those that are led
        self._ghost = Ghost(machine, follow)
        self._check = Check(machine)
        self._period_s = machine.period_s
        self._conditions: Conditions | None = None
        self.rows: deque[Row] = deque()
        self.path: list[Row] = []
        self.here = self._standing()
        self.before_stop: int | None = None  # rows of a jog before its stop begins
        self._covered = -math.inf  # s up to which the stop needs the path that was looked at last
        self._endless = 0, 0  # from that row to this one the plan neither rests nor has a stop
        self._known_stop: tuple[Row | None, Stop | None] = (None, None)  # of the row that was looked at last
        self._jog_speed = 0.0  # per tick, that the rows of a jog are towards; 0: all are those of its stop
        self.renewed = False  # rows of a jog are others than in the last plan; set back by who writes them
        self._ended = False
        self._chain: tuple[Correction, ...] = ()  # on a thread: of the row here and of those of the stock
        self._led_until = _NEVER  # the last row that is led on by its correction
        self._led_last: Row | None = None  # that was laid over
        self._per_mm: tuple[ThreadMove | None, Sequence[float]] = (None, ())  # counts, along a thread

    def foreseen(self, conditions: Conditions, replaced_s: float, last: Joints) -> Row | None:
        """What the next step of the path comes to; None where it was looked ahead of another one.

        ``replaced_s``: as in ``go_on``; ``last``: joints of the tick before the last one.
        """
        if not self.rows or conditions != self._conditions:
            return None
        follow, here, row = self._follow, self.here, self.rows[0]
        same = here.tau == follow.tau and here.joints == follow.joints and last == follow.last
        return row if same and row.tau < replaced_s - ROUNDING else None

    def _standing(self) -> Row:
        joints = self._follow.joints
        exact, tau = self._real_encoder.exact, self._follow.tau
        return Row(joints, exact, 0.0, -1, (0.0, 0.0, 0.0), 0.0, tau, 0, None, True, True)

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
        rows, old = self.rows, self._conditions
        known = bool(rows) and self._ghost.is_in_queue and self._came_to(rows[0])
        if known and conditions == old:
            self.here = self._as_sent(rows.popleft())
            first, end = self._endless
            self._endless = (0, 0) if math.isfinite(replaced_s) else (first - 1, end - 1)
            last = rows[-1] if rows else self.here
            behind = replaced_s > last.tau - ROUNDING and not (last.rests or self.path)
            if math.isinf(replaced_s) or behind:
                return True
            known = False
        # A hold for which no stop begins yet goes on along the same path, up to where one does.
        same_path = known and old is not None and old.marks == conditions.marks and math.isinf(replaced_s)
        self._begin(conditions, same_path or self._follow.stopping)
        return False

    def _came_to(self, row: Row) -> bool:
        """Whether the tick has come to a row; in a dwell all stand."""
        follow, law = self._follow, row.law
        tie = follow.coupling
        if row.tau != follow.tau or not tie.active:
            if law is not None and not self._encoder.plain:  # how far a reversal has come hangs on what led
                return False
            return row.tau == follow.tau and row.joints == follow.joints
        same = law is not None and law.move is tie.move and law.s == tie.s  # joints are laid over anew
        return same and not self._ended and self._ghost.stopping == follow.stopping

    def _as_sent(self, row: Row) -> Row:
        """A row of a thread as the tick has led it."""
        follow, tie = self._follow, self._follow.coupling
        if not tie.active or row.law is None or row.by is tie.now:
            return row
        counts, now, rev_s, ahead_mm = self._real_encoder.exact, tie.now, tie.rev_s, tie.ahead_mm
        return row._replace(joints=follow.joints, counts=counts, by=now, rev_s=rev_s, ahead_mm=ahead_mm)

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
            s = before.s + 1.0
            rows.append(before._replace(joints=joints, counts=counts, s=s, rests=False, ends=False))
        self.renewed, self._jog_speed = True, jogging.speed
        self.before_stop = self._periods + EXTRA if jogging.goes else len(rows)
        return same and jogging.goes

    def _begin(self, conditions: Conditions, same_path: bool) -> None:
        """Anew from where the tick is; with ``same_path`` what was seen of it stays to brake along."""
        ghost, before = self._ghost, self.here
        if same_path:
            s = self.rows[-1].s if self.rows else before.s
            rows = [self._by_law(row) for row in self.rows]
            self.path = [*rows, *(row for row in self.path if row.s > s)]
        else:
            self.path = []
        self.rows.clear()
        ghost.go_on_as(self._follow)
        self._conditions, self._ended, self.before_stop = conditions, False, None
        self._known_stop, self._endless = (None, None), (0, 0)
        self._encoder.go_on_as(self._real_encoder)
        self.here = self._as_sent(ghost.row(self._real_encoder.exact, before))
        ghost.by_law()

    def further(self) -> list[Row]:
        """Rows to brake along behind ``rows``; on a thread the axes stay ahead as in the last of those."""
        if self._rests(len(self.rows) - 1):
            return []
        last = self._row(len(self.rows) - 1)
        found, law = [row for row in self.path if row.s > last.s], last.law
        if law is None:
            return found
        return [row._replace(law=law) for row in found]

    def fill(self) -> tuple[int, Stop | None]:
        """Looks as far ahead as the stock needs it: rows that may be played, and the stop after them.

        A tick that needs no new row computes one all the same, if one of the next will need two: stops begin
        in every second period, or more seldom, and one takes a longer way than another.
        """
        seen = len(self.rows)
        found = self._fill()
        if seen == len(self.rows) > SPARE and self.rows[-1 - SPARE].s < self._covered:
            self._extend()
        return found

    def _fill(self) -> tuple[int, Stop | None]:
        rows, n = self.rows, self._periods
        if self._chain or self._follow.coupling.active:
            self._take_corrections()
        if self._conditions is None:
            return len(rows), None
        while len(rows) < n and self._extend():
            pass
        if self._chain or self._ghost.tie.active:
            self._lead()
        if self._led_until > _NEVER:
            n = max(n, min(self._led_until + 2, len(rows)))
        first, end = self._endless
        if first < n < end:
            n = min(end, len(rows))
        while 0 < n <= len(rows):
            if self._rests_at(n - 1):
                return n, None
            if (stop := self._stop_at(n - 1)) is not None:
                return n, stop
            if n == len(rows) and not self._extend():
                break
            n += 1  # where the plan itself is as quick as any stop, no stop begins: up to its rest
        # The last place before where it can end: nowhere, and the motors stand at once.
        for i in range(min(self._periods, len(rows)) - 1, -1, -1):
            if self._rests_at(i):
                return i + 1, None
            if (stop := self._stop_at(i)) is not None:
                return i + 1, stop
        return 0, None if self._rests_at(-1) else self._stop_at(-1)

    def _row(self, i: int) -> Row:
        """The i-th ahead; -1: of the last tick."""
        return self.rows[i] if i >= 0 else self.here

    def _rests_at(self, i: int) -> bool:
        """Whether the plan can end with a row, since it stands there."""
        return i > self._led_until and (self._row(i).ends or self._ghost.queue.is_empty)

    def _rests(self, i: int) -> bool:
        """Whether nothing goes on behind a row."""
        row = self._row(i)
        return row.rests and (row.over or i > self._led_until)

    def _stop_at(self, i: int) -> Stop | None:
        """The stop that begins at a row, if the path is known as far as it goes."""
        row = self._row(i)
        if i <= self._led_until:
            return None
        known, stop = self._known_stop
        if known is not row:
            stop = self._ghost.stop_at(row)
            self._known_stop = row, stop
            if stop is not None and stop.jerks:
                self._covered = row.s + self._at_most(stop)
        if stop is None or not stop.jerks:
            first, end = self._endless
            self._endless = (first if first <= i <= end else i, i + 1)
            return None
        if not self._covers(self._covered):
            return None
        by = row.by or (self._chain[-1] if self._chain else None)
        return stop if row.law is None or by is None else row.law.stop(stop, by)

    def _covers(self, s: float) -> bool:
        """Whether the path ahead is known up to there, or to a rest before it."""
        rows = self.rows
        if self.path and self.path[-1].s >= s:
            return True
        while not rows or (rows[-1].s < s and not self._rests(len(rows) - 1)):
            if not self._extend():
                last = len(rows) - 1
                return bool(rows) and (self._rests(last) or self._rests_at(last))
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
        if self._rests(len(rows) - 1):
            return False
        before = rows[-1] if rows else self.here
        go = ghost.goes(conditions.running, conditions.feed, conditions.rapid)
        lost = ghost.step(go) is _LOST
        law = ghost.tie.law
        if law is not None:  # it is judged as it is led
            counts = self._encoder.counts(ghost.joints) if self._encoder.plain else self._counts_by_law(law)
            rows.append(ghost.row(counts, before))
            return True
        counts = self._encoder.counts(ghost.joints)
        if lost or not self._is_fine(counts, ghost.joints, ghost.last, ghost.before):
            self._ended = True
            return False
        rows.append(ghost.row(counts, before))
        return True

    def _is_fine(self, counts: Sequence[float], new: Joints, last: Joints, before: Joints) -> bool:
        fault, _ = self._check.judge(new, last, before)
        return fault is _NONE and -INT32 < min(counts) <= max(counts) < INT32 - 1

    # -- what leads beside the law of a thread

    def _take_corrections(self) -> None:
        """As the tick foresees them now."""
        tie, ghost, rows = self._follow.coupling, self._ghost.tie, self.rows
        self._chain, self._led_until = (), _NEVER
        if not tie.active or ghost.move is None:
            return
        self._chain = tie.foreseen
        for i, by in enumerate(self._chain, -1):
            if by.step_rev:
                self._led_until = i
        step, bend = abs(self._chain[-1].step_rev), ghost.bend_rev(ghost.move)
        while (step := step - bend) > 0.0 and self._led_until < MAX_ROWS:
            self._led_until += 1
        while rows and self._rests(len(rows) - 2):
            rows.pop()

    @property
    def is_led(self) -> bool:
        """Whether the tick is on a thread: then its plans differ from one another from their first row on."""
        return self._follow.coupling.active

    @property
    def lead(self) -> Lead | None:
        """How the rows behind those of the stock are led; None: on no thread."""
        move = self._ghost.tie.move if self._chain else None
        if move is None:
            return None
        known = min(self._periods, len(self.rows))
        return Lead(known, self._ghost.tie.bend_rev(move), self._chain[known], self._counts_per_mm(move))

    def _lead(self) -> None:
        """Lays the corrections over the rows of the stock: over the farthest alone, if only that is new."""
        rows, follow, tie = self.rows, self._follow, self._ghost.tie
        if not self._chain and tie.active:
            self._chain = (tie.begun,) * (1 + self._periods)
        known, chain = min(self._periods, len(rows)) if self._chain else 0, self._chain
        if known == 0 or rows[known - 1].law is None or rows[known - 1].by is chain[known]:
            return  # the farthest one is new, if any is
        alone = known > 1 and rows[known - 2].by is chain[known - 1] and rows[known - 2] is self._led_last
        first = known - 1 if alone else 0
        if not alone:
            self._encoder_led.go_on_as(self._real_encoder)
        for i in range(first, known):
            row = rows[i]
            last = rows[i - 1].joints if i > 0 else follow.joints
            before = rows[i - 2].joints if i > 1 else follow.joints if i > 0 else follow.last
            if row.law is not None:
                row = rows[i] = self._led(row, row.law, chain[i + 1])
            else:
                self._encoder_led.counts(row.joints)
            if not self._is_fine(row.counts, row.joints, last, before):
                self._ended = True
                while len(rows) > i:
                    rows.pop()
                return
        self._led_last = rows[known - 1]

    def _led(self, row: Row, law: Law, by: Correction) -> Row:
        """A row as a correction leads it."""
        joints = self._ghost.at(law.move, law.s + _led_mm(law, by))
        counts, rev_s = self._encoder_led.counts(joints), by.rev_s(law.rev_s, law.rev_s2)
        ahead_mm = by.ahead_mm(law.v, law.a)
        return row._replace(joints=joints, counts=counts, by=by, rev_s=rev_s, ahead_mm=ahead_mm)

    def _by_law(self, row: Row) -> Row:
        """A row as it is without its correction."""
        law, by = row.law, row.by
        if law is None or by is None:
            return row
        return row._replace(counts=self._back(row.counts, law, by), by=None)

    def _counts_by_law(self, law: Law) -> tuple[float, ...]:
        """The counts of a place of the law; what axes miss is by where they were led when this began."""
        by = self._ghost.tie.begun
        joints = self._ghost.at(law.move, law.s + _led_mm(law, by))
        return self._back(self._encoder.counts(joints), law, by)

    def _back(self, counts: Sequence[float], law: Law, by: Correction) -> tuple[float, ...]:
        led_mm = _led_mm(law, by)
        per_mm = self._counts_per_mm(law.move)
        return tuple([count - led_mm * one for count, one in zip(counts, per_mm, strict=True)])

    def _counts_per_mm(self, move: ThreadMove) -> Sequence[float]:
        known, per_mm = self._per_mm
        if known is not move:
            per_mm = self._encoder.per_mm(move.direction)
            self._per_mm = move, per_mm
        return per_mm


def _led_mm(law: Law, by: Correction) -> float:
    """From the law's place to that of the axes."""
    return by.ahead_mm(law.v, law.a) - by.off_rev / law.move.rev_per_mm
