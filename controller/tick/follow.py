"""Following the plan: the queue of pieces, the path clock, and the joints of the next tick.

The clock counts SYNCs sent, never time: ``step`` is called once for each SYNC and moves
plan time by one period, or not at all. A skipped tick therefore never doubles a step, and
the same events give the same setpoints bit for bit.

```
   on the plan --- not to go on, a stop begins here ---> stopping ---> at rest, queue empty, epoch + 1
        |                                                                     |
        +--- not to go on, the plan itself rests here ---> standing           +--- new pieces ---> on the plan
```
Where no stop begins, the plan is followed: to the next one, or to the queue's end, which is at rest.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, Final, Protocol

from controller.geometry.vectors import ROUNDING
from controller.ipc.handoff import Piece, PieceMessage
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.motion.motions import Motion
from controller.motion.pieces import commit_lead_s
from controller.state.queue_refusals import QueueRefusal
from controller.tick.brake import Brake
from controller.tick.changes import Changes
from controller.tick.coupling import Coupling, Tie
from controller.tick.path_clock import PathClock
from controller.tick.queue import Entry, Queue

STEPS_BACK: Final = 6  # that can be taken back
SAME_PLACE = 1e-6  # mm or rad: a queue that begins elsewhere by more (and by a count) is refused


class Step(IntEnum):
    """What came of one step."""

    MOVED = 0
    STOP = 1  # reached a program stop (M0), or one that the operator's switches ask for
    END = 2  # reached the end of the program
    LOST = 3  # the rotaries cannot reach the next tool axis; nothing has changed
    SET = 4  # spindle, coolant or clamps are to be as ``setting`` says before motion goes on


_TAKEN: Final = QueueRefusal.NONE
NOWHERE: Final = (-1, math.nan)  # motion and place that no joints are of
_UNKNOWN_MOTION: Final = QueueRefusal.UNKNOWN_MOTION
_MOVED: Final = Step.MOVED  # looked up every tick, and an enum's members are slow to look up


_CHANGES: Final = Changes("_now", "joints", "last", "before", "rate", "piece", "s")
# These, and those of clock, stop and tie.
State = tuple[tuple[Any, ...], tuple[float, int], tuple[Any, ...] | None, Tie | None]


class Foreseen(Protocol):
    """What another follower, that has come to the same state, has found for the next step."""

    @property
    def joints(self) -> Joints: ...
    @property
    def of(self) -> tuple[int, float]: ...
    @property
    def now(self) -> int: ...
    @property
    def tau(self) -> float: ...
    @property
    def place(self) -> tuple[float, float, float]: ...


class Follow:
    """The joints along the queue. Read: ``tau``, ``rate``, ``joints``, ``s``, ``piece``, ``feed``, ``epoch``;
    ``last`` and ``before``, the joints of the tick before, and of the one before that.
    """

    def __init__(
        self,
        machine: Machine,
        kinematics: Kinematics,
        coupling: Coupling | None = None,
        queue: Queue | None = None,
    ) -> None:
        self.coupling = Coupling(machine, None) if coupling is None else coupling
        self._lead_s = commit_lead_s(machine.period_s)
        self._kinematics = kinematics
        self._rotaries = kinematics.rotaries
        self._same = tuple(max(SAME_PLACE, 1.0 / abs(a.counts_per_unit)) for a in machine.axes)
        self._queue = Queue() if queue is None else queue
        self._clock = PathClock(machine.period_s)
        self._brake = Brake(machine.period_s)
        self._now = 0  # number in the queue of the entry under the clock
        self._goes = False  # the clock was to run in the last step
        self._base: Joints = (0.0,) * len(machine.axes)  # where the queue begins
        self.joints = self.last = self.before = self._base
        self.rate = 0.0
        self.s = 0.0
        self.feed = 0.0  # ds/dt, mm/s while cutting
        self.piece: Piece | None = None
        self.setting: Piece | None = None  # at the last Step.SET
        self.line = 0  # of the program
        self.limited_by = 0
        self.epoch = 0  # queues given up so far
        self.refusal = _TAKEN  # of the last message
        self.optional_stop = self.single_block = False  # the operator's switches: which marks count
        self._foreseen: Foreseen | None = None  # of the step that is under way
        self._of = NOWHERE  # motion and place for which that step has asked for joints
        self._undo: deque[State] = deque(maxlen=STEPS_BACK)  # the last steps

    # -- state

    @property
    def queue(self) -> Queue:
        """What it follows."""
        return self._queue

    @property
    def tau(self) -> float:
        """The path clock: plan time (s)."""
        return self._clock.tau

    @property
    def queue_end_s(self) -> float:
        """Plan time at which the queue ends, at rest."""
        return self._queue.end_s

    @property
    def commit_s(self) -> float:
        """From here on the queue may be replaced (plan time, s)."""
        tau = self._clock.tau
        return min(self._queue.end_s, tau + self._lead_s) if self._goes else tau

    @property
    def at_rest(self) -> bool:
        """Whether the commanded joints stand, with no motion left over from the last ticks."""
        return self.joints == self.last == self.before

    @property
    def pending(self) -> bool:
        """Whether planned motion lies ahead of the clock."""
        return self._clock.tau < self._queue.end_s

    @property
    def stopping(self) -> bool:
        """Whether the plan has been left and rest is not reached, or not told yet."""
        return self._brake.active

    def set_joints(self, joints: Joints) -> None:
        """Takes a position over (drives enabled, homed): no motion, no queue, no step to take back."""
        self.joints = joints
        self._undo.clear()
        self.clear()

    def set_clock(self, tau: float) -> None:
        """At standstill without a queue: the clock of a run that is repeated."""
        self._clock.set(tau)
        self._queue.clear(tau)

    def clear(self) -> None:
        """Drops the queue where the clock stands; only at standstill."""
        if not self._queue.is_empty or self.piece is not None:
            self.epoch += 1
        self._empty()
        self.last = self.before = self.joints
        self.piece, self.s, self.line = None, 0.0, 0

    def _empty(self) -> None:
        self._queue.clear(self._clock.tau)
        self._brake.restore(None)
        self._goes = False
        self._now = self._queue.first
        self._base = self.joints
        self.rate = self.feed = 0.0
        self.limited_by = 0

    def give_up(self) -> None:
        """What is queued is void; only at standstill. Where it stands on the path stays known."""
        if not self._queue.is_empty:
            self.epoch += 1
            self._empty()

    def heed(self, optional_stop: bool, single_block: bool) -> None:
        """Which marks of the pieces count from now on."""
        self.optional_stop, self.single_block = optional_stop, single_block

    def go_on_as(self, other: Follow) -> None:
        """Takes over where another one is that follows the same queue."""
        self._go_back_to(other._state())
        self._base, self._goes, self.feed = other._base, other._goes, other.feed
        self.optional_stop, self.single_block = other.optional_stop, other.single_block

    # -- taking pieces

    def accept(self, message: PieceMessage) -> bool:
        """Takes a message whole, or not at all (False, and ``refusal`` says why).

        It must be made for this queue (epoch), begin between the commit point and the queue's end,
        know its motions, and go on where the queue is.
        """
        queue, start = self._queue, message.replace_from_s
        appended = start >= queue.end_s - ROUNDING
        self.refusal = self._refusal_of_time(message)
        if self.refusal is not _TAKEN:
            return False
        entries = queue.entries_of(message, queue.end_s if appended else start)
        self.refusal = _UNKNOWN_MOTION if entries is None else self._refusal_of_place(entries)
        if entries is None or self.refusal is not _TAKEN:
            return False
        if not appended:
            self._now = queue.truncate(start, self._now)
        elif not self._goes and not self.pending:  # a run's clock does not depend on the runs before it
            self._clock.set(self._clock.tau)
        if message.alone:
            self._empty()
        queue.add(message, entries, self._clock.tau)
        queue.forget_before(self._now)
        return True

    def begins_here(self, message: PieceMessage) -> bool:
        """Whether an accepted message leaves nothing of the queue before it, and begins at these joints."""
        piece, *_ = message.pieces
        return piece.motion_id >= 0 and message.replace_from_s <= self.tau + ROUNDING

    def _refusal_of_time(self, message: PieceMessage) -> QueueRefusal:
        """Why a message is not for the queue as it is now."""
        if message.epoch != self.epoch:
            return QueueRefusal.EPOCH
        if self._brake.active:
            return QueueRefusal.STOPPING
        if not message.pieces:
            return QueueRefusal.EMPTY
        if message.replace_from_s < self.commit_s - ROUNDING:
            return QueueRefusal.LATE
        return QueueRefusal.GAP if message.replace_from_s > self.queue_end_s + ROUNDING else _TAKEN

    def _refusal_of_place(self, entries: Sequence[Entry]) -> QueueRefusal:
        """Unless the first new motion, also behind a pause, begins where the queue is at that time."""
        first = next((entry for entry in entries if entry.motion is not None), None)
        if first is None or first.motion is None:
            return _TAKEN
        begins, *_ = entries
        paused, here = begins is not first, begins.start_s <= self.tau + ROUNDING
        if here and not (paused and self.coupling.active):
            near = self._rotaries(self.joints)
            s, _, _ = first.at(first.start_s)
            if first.thread is not None:
                s = self.coupling.place(first.thread, s)
            new = first.motion.joints(s, near, self._kinematics)
            if new is None:
                return QueueRefusal.UNREACHABLE
            return _TAKEN if self.same_place(new, self.joints) else QueueRefusal.ELSEWHERE
        old = self._queue.at(first.start_s, self._now)
        if paused or old is None or old.piece.motion_id != first.piece.motion_id:
            return _TAKEN  # a boundary of two motions far ahead: each setpoint is checked there
        (before, _, _), (after, _, _) = old.at(first.start_s), first.at(first.start_s)
        goes_on = abs(before - after) <= SAME_PLACE
        return _TAKEN if goes_on else QueueRefusal.JUMP

    # -- where the plan is at a plan time

    def _evaluate(self, tau: float) -> Joints | None:
        """Joints of the plan at ``tau``, on the branch of the present joints."""
        queue, i = self._queue, self._now
        while i < queue.last and tau >= queue[i].end_s - ROUNDING:
            if self._halts(queue[i].piece) or not self._passes(i):
                break
            i += 1
        while i >= queue.first and queue[i].motion is None:
            i -= 1  # a dwell stands where the motion before it ended
        if i < queue.first:
            return self.coupling.stay(self._base, self._kinematics) if self.coupling.active else self._base
        entry = queue[i]
        motion = entry.motion
        if motion is None:
            return self._base
        place = entry.at(tau if tau < entry.end_s else entry.end_s)
        return self._joints_at(entry, motion, self._along(entry, place))

    def _joints_at(self, entry: Entry, motion: Motion, s: float) -> Joints | None:
        """On the branch of the present joints; None where the rotaries cannot reach the next tool axis."""
        self._of = of = entry.piece.motion_id, s
        foreseen = None if self.coupling.active else self._foreseen  # on a thread its place is the law's
        if foreseen is not None and foreseen.of == of:
            return foreseen.joints
        return motion.joints(s, self._rotaries(self.joints), self._kinematics)

    def _along(self, entry: Entry, place: tuple[float, float, float]) -> float:
        """Where along its motion the axes are to be when the law is at ``place`` (s, v, a)."""
        coupling = self.coupling
        if entry.thread is not None:
            return coupling.follow(entry.thread, *place)
        if coupling.active:
            coupling.end()
        s, _, _ = place
        return s

    def _plan_rests(self) -> bool:
        """Whether the plan stands where the clock is, so that the clock may just stand, too."""
        return self._queue.is_empty or self._queue[self._now].rests_at(self._clock.tau)

    # -- one tick

    def goes(self, running: bool, override: float, rapid_override: float) -> bool:
        """Whether the clock is to run; an override of 0 stops what it is for."""
        piece = self.piece if self._queue.is_empty else self._queue[self._now].piece
        if not running or piece is None or piece.motion_id < 0:
            return running
        return piece.own_feed or (rapid_override if piece.rapid else override) > 0.0

    @property
    def own_feed(self) -> bool:
        """Whether the override of feeds does not count where the clock is."""
        return self.piece is not None and self.piece.own_feed

    @property
    def heeds_stop(self) -> bool:
        """Whether the input feed_stop does."""
        piece = self.piece if self._queue.is_empty else self._queue[self._now].piece
        return piece is None or piece.heeds_stop

    @property
    def ahead(self) -> Piece | None:
        """The piece under the clock; where that is over, the next."""
        queue, i, tau = self._queue, self._now, self._clock.tau
        while i < queue.last and tau >= queue[i].end_s - ROUNDING:
            i += 1
        return None if queue.is_empty else queue[i].piece

    def step(self, go: bool, foreseen: Foreseen | None = None) -> Step:
        """One tick: along the plan, along a stop, or standing; joints, s and feed are new.

        ``foreseen``: what another follower has found for it, which is then not computed again.
        """
        self._foreseen, self._of = foreseen, NOWHERE
        if self._brake.active and self._brake.over:
            self._settle()
        self._remember()
        self.coupling.look()
        self._goes = go
        if not go and not self._brake.active and not self._plan_rests():
            self._leave()
        if self._brake.active:
            return self._brake_on()
        if (go and not self._queue.is_empty) or not self._plan_rests():
            return self._run(go)
        joints = self.coupling.stay(self.joints, self._kinematics) if self.coupling.active else self.joints
        self._take(joints, 1.0 if go else 0.0)
        self.feed = 0.0
        return _MOVED

    def rehearse(self) -> None:
        """Evaluates the plan where the clock is, for the caches alone: nothing of it changes."""
        if self._queue.is_empty:
            return
        entry, tau = self._queue[self._now], self._clock.tau
        s, _, _ = entry.at(tau)
        if entry.motion is not None:
            entry.motion.joints(s, self._rotaries(self.joints), self._kinematics)
        entry.line_at(s)
        entry.binding_at(tau)
        self._brake.save()
        self.coupling.save()

    def move_to(self, joints: Joints) -> None:
        """One tick by hand, beside the plan: the clock stands, and the queue stays."""
        self._remember()
        self._goes = False
        self._take(joints, 0.0)
        self.feed = 0.0

    def same_place(self, a: Joints, b: Joints) -> bool:
        """Whether two positions are one to the drives, and to a queue that begins there."""
        return all(abs(x - y) <= most for x, y, most in zip(a, b, self._same, strict=True))

    def revert(self) -> None:
        """Takes the last step back: its joints must not be sent."""
        if self._undo:
            self._go_back_to(self._undo.pop())

    def _go_back_to(self, state: State) -> None:
        own, clock, stop, tie = state
        _CHANGES.put(self, own)
        self._clock.restore(clock)
        self._brake.restore(stop)
        self.coupling.restore(tie)

    def stand(self, back: int) -> bool:
        """No SYNC came for so long that the drives stand: so does the path, at once, and goes on from rest.

        ``back``: no drive has used the last so many steps, and they are taken back. False if it stood anyway.
        """
        brake = self._brake
        if brake.over if brake.active else self._plan_rests():
            return False
        for _ in range(min(back, len(self._undo))):
            (now, *_), *_ = self._undo[-1]
            if now >= self._queue.first:  # it is still known
                self.revert()
        if brake.active:
            brake.stand(brake.s)
            self.piece, self.s = self._queue[self._now].piece, brake.s
        else:
            queue, tau = self._queue, self._clock.tau
            ahead = (i for i in queue.numbers_from(queue.first) if tau < queue[i].end_s - ROUNDING)
            self._now = next(ahead, queue.last)
            self._describe()
            if not self._plan_rests():
                brake.stand(self.s)
        self.put(self.joints)
        return True

    def put(self, joints: Joints) -> None:
        """At rest here, at once."""
        self.joints = self.last = self.before = joints
        self.rate = self.feed = 0.0
        self.coupling.stood()

    def _remember(self) -> None:
        """Where it is, so that the next step can be taken back."""
        self._undo.append(self._state())

    def _state(self) -> State:
        return _CHANGES.of(self), self._clock.save(), self._brake.save(), self.coupling.save()

    def _take(self, joints: Joints, rate: float) -> None:
        self.before, self.last, self.joints = self.last, self.joints, joints
        self.rate = rate

    # -- along the plan

    def _run(self, go: bool) -> Step:
        clock, entry = self._clock, self._queue[self._now]
        tau, end_s, motion = clock.tau + clock.period_s, entry.end_s - ROUNDING, entry.motion
        if tau < end_s and motion is not None:  # it ends in the entry where it began
            foreseen = self._foreseen
            on_thread = entry.thread is not None or self.coupling.active
            known = foreseen is not None and foreseen.now == self._now and foreseen.tau == clock.next_tau
            if foreseen is not None and known and not on_thread:
                self._take(foreseen.joints, 1.0)
                clock.advance(tau)
                self._describe_as(entry, foreseen.place)
                return _MOVED
            joints = self._joints_at(entry, motion, self._along(entry, entry.at(tau)))
        else:
            tau = self._reached(tau)
            joints = self._evaluate(tau)
        if joints is None:
            return Step.LOST
        self._take(joints, 1.0)
        clock.advance(tau)
        if clock.tau >= end_s:
            return self._arrive(go)
        self._describe()
        return _MOVED

    def _reached(self, tau: float) -> float:
        """The clock goes to ``tau``, but not past a mark that counts, nor past the queue's end."""
        queue, i = self._queue, self._now
        last = queue.last
        while i <= last and queue[i].end_s < tau - ROUNDING:
            if self._halts(queue[i].piece) or i == last or not self._passes(i):
                return queue[i].end_s
            i += 1
        return tau

    def _passes(self, i: int) -> bool:
        """Whether the clock may go past an entry: past a thread's end only once the spindle is there."""
        queue, coupling = self._queue, self.coupling
        if not (coupling.active and queue[i].leaves_thread):
            return True
        later = (queue[j] for j in queue.numbers_from(i + 1))
        after = (e for e in later if e.motion is not None or e.piece.sets or e.piece.end)
        following = next(after, None)
        coupling.releasing = following is None or following.thread is None
        return coupling.settled

    def _halts(self, piece: Piece) -> bool:
        return (
            piece.stop
            or piece.end
            or piece.sets
            or (piece.optional_stop and self.optional_stop)
            or (piece.block_end and self.single_block)
        )

    def _arrive(self, wanted: bool) -> Step:
        """Moves the pointer to the entry under the clock; says which mark was passed.

        A mark is passed only when motion is ``wanted``: a machine that is not started yet, or
        is held, finds it when it goes on.
        """
        queue, tau, result = self._queue, self._clock.tau, _MOVED
        while self._now <= queue.last:
            entry = queue[self._now]
            if tau < entry.end_s - ROUNDING:
                break
            if not self._passes(self._now):
                break
            if self._halts(entry.piece):
                if not wanted:
                    break
                result = self._pass_mark(entry)
            if result is not _MOVED or self._now == queue.last:
                break
            self._now += 1
        self._describe()
        return result

    def _pass_mark(self, entry: Entry) -> Step:
        """What spindle, coolant and clamps are told comes first, the other marks with the next step."""
        piece = entry.piece
        if piece.sets:
            self.setting = piece
            entry.take_setting()
            return Step.SET
        entry.take_marks()
        return Step.END if piece.end else Step.STOP

    def _describe(self) -> None:
        entry, tau = self._queue[self._now], self._clock.tau
        self._describe_as(entry, entry.at(tau))
        if tau >= entry.end_s - ROUNDING:
            self.feed = 0.0

    def _describe_as(self, entry: Entry, place: tuple[float, float, float]) -> None:
        self.piece, (self.s, self.feed, _) = entry.piece, place
        self.line, self.limited_by = entry.line_at(self.s), entry.binding_at(self._clock.tau)

    # -- along a stop

    def _leave(self) -> None:
        """Leaves the plan, if a stop begins here."""
        tau = self._clock.tau
        found = self._queue.stop_at(tau)
        if found is not None:
            self._brake.begin(*found, self._queue[self._now].at(tau))

    def _brake_on(self) -> Step:
        brake = self._brake
        brake.step()
        self._now = brake.come_to(self._queue, self._now)
        entry = self._queue[self._now]
        if entry.motion is None:
            return Step.LOST
        place = self._along(entry, (brake.s, brake.v, brake.a))
        joints = self._joints_at(entry, entry.motion, place)
        if joints is None:
            self.revert()
            return Step.LOST
        self._take(joints, brake.v / brake.left_at if brake.left_at > 0.0 else 0.0)
        self.piece, self.s, self.feed = entry.piece, brake.s, brake.v
        self.line, self.limited_by = entry.line_at(brake.s), 0
        return Step.MOVED

    def _settle(self) -> None:
        """At rest out of a stop: the queue is void, the plan begins anew from ``piece`` and ``s``."""
        self.epoch += 1
        self._empty()
