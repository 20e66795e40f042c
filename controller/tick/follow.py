"""Following the plan: the queue of pieces, the path clock, and the joints of the next tick.

The clock counts SYNCs sent, never time: ``step`` is called once for each SYNC and moves
plan time by rate x period. A skipped tick therefore never doubles a step, and the same
events give the same setpoints bit for bit.
"""

from __future__ import annotations

from enum import IntEnum

from controller.handoff import STANDSTILL, Piece, PieceMessage, commit_lead_s
from controller.kinematics import Kinematics
from controller.machine import Joints, Machine
from controller.motions import Motion, Rotaries
from controller.tick.slew import LEAST_STEP, Slew

SAME_TIME_S = 1e-9  # plan and tick sum up the same durations; this much is rounding
SAME_PLACE = 1e-6  # mm or rad: a queue that begins elsewhere by more (and by a count) is refused
COAST_TICKS = 4.0  # this close to a standstill of the plan, a hold runs into it ...
COAST_STEADY_TICKS = 12.0  # ... and this close if the rate has not begun to fall
REST_SPEED = 1e-6  # mm/s or deg/s of the law: at rest


class Step(IntEnum):
    """What came of one step."""

    MOVED = 0
    STOP = 1  # reached a program stop (M0)
    END = 2  # reached the end of the program
    LOST = 3  # the rotaries cannot reach the next tool axis; nothing has changed


class Entry:
    """One piece in the queue, with its place in plan time."""

    __slots__ = ("coefficients", "end_s", "index", "knots", "last", "motion", "piece", "start_s")

    def __init__(self, piece: Piece, motion: Motion | None, start_s: float) -> None:
        self.piece = piece
        self.motion = motion
        self.start_s = start_s
        self.end_s = start_s + piece.duration_s
        self.knots = piece.law.knots_s
        self.coefficients = piece.law.coefficients
        self.last = len(self.coefficients) - 1
        self.index = 0  # polynomial of the last look-up: the next is this or a neighbour

    def at(self, tau: float) -> tuple[float, float]:
        """(s, ds/dtau) at plan time ``tau``, clamped to the law."""
        t, knots, i = tau - self.start_s, self.knots, self.index
        if t > knots[-1]:
            t = knots[-1]
        elif t < 0.0:
            t = 0.0
        while i < self.last and t >= knots[i + 1]:
            i += 1
        while i > 0 and t < knots[i]:
            i -= 1
        self.index = i
        x = t - knots[i]
        c0, c1, c2, c3, c4, c5 = self.coefficients[i]
        s = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
        return s, c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))


class Follow:
    """The queue and the clock. Read: ``tau``, ``rate``, ``joints``, ``s``, ``piece``, ``feed``."""

    def __init__(self, machine: Machine, kinematics: Kinematics) -> None:
        self._period_s = machine.period_s
        self._lead_s = commit_lead_s(machine.period_s)
        self._kinematics = kinematics
        self._rotary = machine.rotary()
        self._same = tuple(max(SAME_PLACE, 1.0 / abs(a.counts_per_unit)) for a in machine.axes)
        self._motions: dict[int, Motion] = {}
        self._queue: list[Entry] = []
        self._now = 0  # index in the queue of the entry under the clock
        self._rest_s = -1.0  # the plan's next standstill, while the clock is being stopped
        self._horizon_s = 0.0  # the clock goes no further: a program stop, or the queue's end
        self._slew = Slew([a.limits for a in machine.axes], machine.period_s, self._rotary, self._evaluate)
        self._base: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)  # where the queue begins
        self.joints = self._base
        self._before = (self._base, self._base)
        self._saved = (self._base, self._before, 0.0, 0.0, 0.0, 0)
        self.tau = 0.0
        self.queue_end_s = 0.0
        self.rate = 0.0
        self.s = 0.0
        self.feed = 0.0  # ds/dt, mm/s while cutting
        self.piece: Piece | None = None

    # -- state

    @property
    def commit_s(self) -> float:
        """From here on the queue may be replaced (plan time, s)."""
        return min(self.queue_end_s, self.tau + self._lead_s)

    @property
    def at_rest(self) -> bool:
        """Whether the commanded joints stand, with no motion left over from the last ticks."""
        return self.joints == self._before[0] == self._before[1]

    @property
    def last(self) -> tuple[Joints, Joints]:
        """The joints of the tick before, and of the one before that."""
        return self._before

    @property
    def pending(self) -> bool:
        """Whether planned motion lies ahead of the clock."""
        return self.tau < self.queue_end_s

    def set_joints(self, joints: Joints) -> None:
        """Takes a position over (drives enabled, homed): no motion, no queue."""
        self.joints = joints
        self.clear()

    def clear(self) -> None:
        """Drops the queue where the clock stands; only at standstill."""
        self._queue.clear()
        self._motions.clear()
        self._slew.forget()
        self._slew.slope = 0.0
        self._rest_s = -1.0
        self._now = 0
        self._base = self.joints
        self._before = (self.joints, self.joints)
        self.queue_end_s = self._horizon_s = self.tau
        self.rate = self.feed = self.s = 0.0
        self.piece = None

    # -- taking pieces

    def accept(self, message: PieceMessage) -> bool:
        """Takes a message whole, or not at all (False).

        It must begin between the commit point and the queue's end, know its motions, and
        go on where the queue is.
        """
        start = message.replace_from_s
        appended = start >= self.queue_end_s - SAME_TIME_S
        if start < self.commit_s - SAME_TIME_S or start > self.queue_end_s + SAME_TIME_S:
            return False
        entries = self._entries(message, self.queue_end_s if appended else start)
        if entries is None or not self._continues(entries[0], appended):
            return False
        if not appended:
            self._truncate(start)
        self._queue += entries
        self.queue_end_s = entries[-1].end_s
        self._motions.update(message.motions)
        self._slew.forget()
        self._rest_s = -1.0
        self._prune()
        self._set_horizon()
        return True

    def _entries(self, message: PieceMessage, start_s: float) -> list[Entry] | None:
        entries = []
        for piece in message.pieces:
            motion = message.motions.get(piece.motion_id, self._motions.get(piece.motion_id))
            if motion is None and piece.motion_id != STANDSTILL:
                return None
            entries.append(Entry(piece, motion, start_s))
            start_s = entries[-1].end_s
        return entries or None

    def _continues(self, first: Entry, appended: bool) -> bool:
        """Whether the first new piece begins where the queue is at that time."""
        if first.motion is None:
            return True
        near = self._rotaries(self.joints)
        if appended and not self.pending:
            new = first.motion.joints(first.at(first.start_s)[0], near, self._kinematics)
            return new is not None and self._same_place(new, self.joints)
        old = self._entry_at(first.start_s)
        if old is None or old.piece.motion_id != first.piece.motion_id:
            return True  # a boundary of two motions far ahead: the check of each setpoint stands behind
        return abs(old.at(first.start_s)[0] - first.at(first.start_s)[0]) <= SAME_PLACE

    def _same_place(self, a: Joints, b: Joints) -> bool:
        return all(abs(x - y) <= most for x, y, most in zip(a, b, self._same, strict=True))

    def _entry_at(self, tau: float) -> Entry | None:
        return next((e for e in self._queue[self._now :] if e.start_s <= tau < e.end_s), None)

    def _truncate(self, start_s: float) -> None:
        """Drops what begins at ``start_s`` or later and cuts the piece that lies across it."""
        queue = self._queue
        while queue and queue[-1].start_s > start_s - SAME_TIME_S and len(queue) - 1 > self._now:
            queue.pop()
        if queue and queue[-1].end_s > start_s:
            cut = queue[-1]
            cut.end_s = start_s
            cut.piece = cut.piece._replace(stop=False, end=False)

    def _prune(self) -> None:
        """Forgets entries behind the clock; a dwell keeps the motion before it, where it stands."""
        keep = self._now
        while keep > 0 and self._queue[keep].motion is None:
            keep -= 1
        del self._queue[:keep]
        self._now -= keep
        used = {entry.piece.motion_id for entry in self._queue}
        for identity in [i for i in self._motions if i not in used]:
            del self._motions[identity]

    # -- where the plan is at a plan time

    def _rotaries(self, q: Joints) -> Rotaries:
        return q[self._rotary[0]], q[self._rotary[1]]

    def _evaluate(self, tau: float, near: Rotaries) -> Joints | None:
        """Joints of the plan at ``tau`` (clamped to the horizon), on the branch near ``near``."""
        queue, i = self._queue, self._now
        if tau > self._horizon_s:
            tau = self._horizon_s
        while i < len(queue) - 1 and tau >= queue[i].end_s and queue[i].end_s < self._horizon_s:
            i += 1
        while i > 0 and tau < queue[i].start_s:
            i -= 1
        while i >= 0 and queue[i].motion is None:
            i -= 1  # a dwell stands where the motion before it ended
        if i < 0:
            return self._base
        entry = queue[i]
        motion = entry.motion
        if motion is None:
            return self._base
        s, _ = entry.at(tau if tau < entry.end_s else entry.end_s)
        return motion.joints(s, near, self._kinematics)

    # -- one tick

    def target(self, running: bool, override: float, rapid_override: float) -> float:
        """The rate that is wanted now: 0 on a hold, else wanted over planned override, never above 1."""
        if not running:
            return 0.0
        if not self._queue:
            return 1.0
        piece = self._queue[self._now].piece
        if piece.motion_id == STANDSTILL:
            return 1.0
        wanted = rapid_override if piece.rapid else override
        return min(1.0, wanted / piece.override) if piece.override > 0.0 else 1.0

    def step(self, target: float) -> Step:
        """Moves the clock by one tick toward the rate ``target``; joints, s and feed are new."""
        slope = self._slew.slope
        self._stay_before_rest(target)
        rate, joints = self._next(target)
        if joints is None:
            return Step.LOST
        self._saved = (self.joints, self._before, self.tau, self.rate, slope, self._now)
        self._before = (self.joints, self._before[0])
        self.joints = joints
        self.rate = rate
        self.tau = min(self.tau + rate * self._period_s, self._horizon_s)
        return self._arrive(target > 0.0)

    def revert(self) -> None:
        """Takes the last step back: its joints must not be sent."""
        self.joints, self._before, self.tau, self.rate, self._slew.slope, self._now = self._saved

    def _set_horizon(self) -> None:
        """The clock does not pass the queue's end, nor a program stop before it is resumed."""
        horizon_s = self.queue_end_s
        for entry in self._queue[self._now :]:
            if entry.piece.stop or entry.piece.end:
                horizon_s = entry.end_s
                break
        if horizon_s != self._horizon_s:
            self._slew.forget()
        self._horizon_s = horizon_s

    def _stay_before_rest(self, target: float) -> None:
        """A hold does not pass the next standstill of the plan: there the clock stops for nothing."""
        if target == 0.0 and self.rate > 0.0:
            if self._rest_s < self.tau:
                self._rest_s = self._next_rest()
            if self._rest_s < self._horizon_s:
                self._slew.forget()
                self._horizon_s = self._rest_s
        elif self._rest_s >= 0.0:
            self._rest_s = -1.0
            self._set_horizon()

    def _next_rest(self) -> float:
        for entry in self._queue[self._now :]:
            if entry.end_s >= self.tau and abs(entry.at(entry.end_s)[1]) < REST_SPEED:
                return entry.end_s
        return self.queue_end_s

    def _coasts(self) -> bool:
        """Whether the plan stands so soon that slowing it down would only disturb its own end."""
        ticks = COAST_TICKS if abs(self._slew.slope) * self._period_s > LEAST_STEP else COAST_STEADY_TICKS
        return self._rest_s - self.tau <= ticks * self.rate * self._period_s

    def _next(self, target: float) -> tuple[float, Joints | None]:
        if not self._queue or (self.rate == target == 0.0):
            return target, self.joints
        if self.rate == target:
            self._slew.slope = 0.0
            tau = self.tau + target * self._period_s
            return target, self._evaluate(tau, self._rotaries(self.joints))
        if target == 0.0 and self._coasts():
            self._slew.slope = 0.0  # the plan itself is about to stand: its own end is the smoothest
            rate = min(self.rate, 1.0 - LEAST_STEP) if self.tau < self._rest_s else 0.0
            return rate, self._evaluate(self.tau + rate * self._period_s, self._rotaries(self.joints))
        rate, joints = self._slew.step(self.tau, self.rate, target, (self.joints, *self._before))
        if rate == target:
            self._slew.forget()
        return rate, joints

    def _arrive(self, wanted: bool) -> Step:
        """Moves the pointer to the entry under the clock; says which mark was passed.

        A mark is passed only when motion is ``wanted``: a machine that is not started yet, or
        is held, finds it when it goes on.
        """
        queue, result = self._queue, Step.MOVED
        while self._now < len(queue):
            entry = queue[self._now]
            if self.tau < entry.end_s:
                break
            if entry.piece.stop or entry.piece.end:
                if not wanted:
                    break
                result = Step.END if entry.piece.end else Step.STOP
                entry.piece = entry.piece._replace(stop=False, end=False)
                self._set_horizon()
            if result is not Step.MOVED or self._now == len(queue) - 1:
                break
            self._now += 1
        self._describe()
        return result

    def _describe(self) -> None:
        if not self._queue:
            return
        entry = self._queue[self._now]
        self.piece = entry.piece
        self.s, speed = entry.at(self.tau)
        self.feed = speed * self.rate if self.tau < entry.end_s else 0.0
