"""Keeps the tick's queue full: takes the traced path run by run, plans it, sends it.

Every message is one chain or pause, complete to a standstill. Normally it is appended at
the queue's end. When the override is raised above what the running piece was planned
for, the rest of its run is planned again at the higher feed and replaces the queue from
a place ahead of the commit point on; lowering needs no plan, the tick's path clock does it.
So the queue always ends at rest and an interrupted planner leaves nothing half said.
What is planned depends on the path and the overrides alone, never on the clock; the
clock only decides when.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from controller.handoff import STILL, Law, Piece, PieceMessage, Snapshot, dwell
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.plan import profile
from controller.plan.path import Chain, Path, Pause, Stretch
from controller.plan.program import Act

AHEAD_S = 4.0  # of motion that is planned before the tick needs it
REPLAN_AHEAD_S = 1.0  # beyond the commit point: the time that planning again may take
REPLAN_MOST_S = 8.0  # after refusals by a tick that was quicker
SAME = 1e-9


@dataclass(frozen=True, slots=True)
class _Sent:
    """A run that the tick has: where it stands in the path and in plan time."""

    item: int
    run: profile.Run
    laws: list[Law]
    first: int  # index of the first stretch that the laws are of
    start_s: float
    override: float

    @property
    def end_s(self) -> float:
        return self.start_s + sum(law.duration_s for law in self.laws)


@dataclass(frozen=True, slots=True)
class _Asked:
    """A replacement that the tick has not answered yet, and what holds if it refuses."""

    sequence: int
    sent: list[_Sent]
    following: int
    queue_end_s: float


class Planner:
    """Plans one path; ``send`` hands a message to the tick and says whether it went out."""

    def __init__(
        self, machine: Machine, kinematics: Kinematics, send: Callable[[PieceMessage], bool]
    ) -> None:
        self._machine, self._kinematics, self._send = machine, kinematics, send
        self._sequence = 0
        self._items: tuple[Chain | Pause, ...] = ()
        self._following = 0  # index of the item that is planned next
        self._queue_end_s = 0.0
        self._dropped = False
        self._sent: list[_Sent] = []
        self._asked: _Asked | None = None
        self._replan_ahead_s = REPLAN_AHEAD_S
        self._motion_ids: dict[int, int] = {}  # id() of a stretch -> motion id
        self.stretches: dict[int, Stretch] = {}  # by motion id, in the order of the path

    @property
    def finished(self) -> bool:
        """Everything of the path has been sent."""
        return self._following >= len(self._items)

    @property
    def finished_path(self) -> bool:
        """Everything has been sent, and not because the rest was dropped."""
        return self.finished and not self._dropped

    def load(self, path: Path, queue_end_s: float) -> None:
        """Take a path; the first message goes out with the next ``work``."""
        self._items, self._following = path.items, 0
        self._dropped, self._asked = False, None
        self._sent.clear()
        self._queue_end_s = queue_end_s
        self._motion_ids.clear()
        self.stretches.clear()
        for item in path.items:
            for stretch in item.stretches if isinstance(item, Chain) else ():
                self._motion_ids[id(stretch)] = len(self.stretches)
                self.stretches[len(self.stretches)] = stretch

    def drop(self) -> None:
        """Forget what has not been sent: the operator stopped the program."""
        self._items, self._following = (), 0
        self._dropped, self._asked = True, None
        self._sent.clear()

    def work(self, now: Snapshot) -> None:
        """Send what the queue lacks; at most one item or one replacement a call."""
        if self._asked is not None and not self._answered(self._asked, now):
            return
        self._sent = [sent for sent in self._sent if sent.end_s > now.plan_time_s]
        if self._replace(now):
            return
        if not self.finished and self._queue_end_s - now.plan_time_s < AHEAD_S:
            self._append(self._following, _planned_for(now))
            self._following += 1

    def keepalive(self) -> None:
        """Tell the tick that the planner lives."""
        self._tell(self._queue_end_s, ())

    # --- appending

    def _append(self, item: int, override: float) -> None:
        begin_s = self._queue_end_s
        self._tell(begin_s, self._pieces_of(item, override))

    def _pieces_of(self, index: int, override: float) -> list[Piece]:
        """Plan one item from rest to rest, at the queue's end."""
        item = self._items[index]
        last = index == len(self._items) - 1
        if isinstance(item, Pause):
            rest = dwell(item.seconds, item.place.line, stop=item.act is Act.STOP, end=last)
            modal = item.modal
            return self._queued([rest._replace(spindle_rev_min=modal.spindle_rev_min, coolant=modal.coolant)])
        pieces: list[Piece] = []
        for run in profile.runs(item, self._machine, self._kinematics, override):
            laws = profile.plan_run(run, self._machine, self._kinematics, override)
            pieces += self._add(_Sent(index, run, laws, 0, self._queue_end_s, override))
        return pieces + self._end(last)

    def _add(self, sent: _Sent) -> list[Piece]:
        """Pieces of a planned run, noted as sent."""
        self._sent.append(sent)
        return self._queued(
            [
                self._piece(stretch, law, sent.override)
                for stretch, law in zip(sent.run[sent.first :], sent.laws, strict=True)
            ]
        )

    def _piece(self, stretch: Stretch, law: Law, override: float) -> Piece:
        rapid = stretch.feed_mm_s is None
        return Piece(
            self._motion_ids[id(stretch)],
            stretch.place.line,
            law,
            law.duration_s,
            cutting=stretch.cutting,
            rapid=rapid,
            override=1.0 if rapid else override,
        )

    def _end(self, last: bool) -> list[Piece]:
        return [Piece(-1, 0, STILL, 0.0, end=True)] if last else []

    def _queued(self, pieces: list[Piece]) -> list[Piece]:
        self._queue_end_s += sum(piece.duration_s for piece in pieces)
        return pieces

    def _tell(self, from_s: float, pieces: Sequence[Piece]) -> None:
        self._sequence += 1
        motions = {p.motion_id: self.stretches[p.motion_id].motion for p in pieces if p.motion_id >= 0}
        self._send(PieceMessage(self._sequence, from_s, motions, tuple(pieces)))

    # --- replacing

    def _answered(self, asked: _Asked, now: Snapshot) -> bool:
        """Whether the tick has taken or refused a replacement; a refusal puts back what was."""
        if now.accepted >= asked.sequence:
            self._asked, self._replan_ahead_s = None, REPLAN_AHEAD_S
            return True
        if now.rejected >= asked.sequence:
            self._sent, self._following, self._queue_end_s = asked.sent, asked.following, asked.queue_end_s
            self._asked = None
            self._replan_ahead_s = min(2.0 * self._replan_ahead_s, REPLAN_MOST_S)
            return True
        return False

    def _replace(self, now: Snapshot) -> bool:
        """Plan again from where the override lies above what was planned; True if a message went out."""
        override = _planned_for(now)
        from_s = now.commit_s + self._replan_ahead_s
        behind = [s for s in self._sent if s.end_s > from_s and _has_feed(s.run)]
        slow = [s for s in behind if s.override < override - SAME]
        if not slow:
            return False
        before = _Asked(self._sequence + 1, list(self._sent), self._following, self._queue_end_s)
        first = slow[0]
        pieces, start_s = self._again(first, max(from_s, first.start_s), override)
        if not pieces:
            self._sent, self._following, self._queue_end_s = before.sent, before.following, before.queue_end_s
            # Nothing faster from there: do not try again before the next run.
            self._sent = [_with(s, override) if s is first else s for s in self._sent]
            return False
        self._tell(start_s, pieces)
        self._asked = before
        return True

    def _again(self, first: _Sent, from_s: float, override: float) -> tuple[list[Piece], float]:
        """The rest of ``first`` from ``from_s`` on, and of its chain; later items are appended again."""
        kept = [s for s in self._sent if s.start_s < first.start_s - SAME]
        item = self._items[first.item]
        assert isinstance(item, Chain)
        after = _position(item, first.run[-1]) + 1
        if from_s <= first.start_s + SAME:
            self._sent, self._queue_end_s = kept, first.start_s
            start_s = first.start_s
            laws = profile.plan_run(first.run, self._machine, self._kinematics, override)
            pieces = self._add(_Sent(first.item, first.run, laws, 0, start_s, override))
        else:
            begun = first.run[first.first :]
            found = profile.faster(
                begun, first.laws, from_s - first.start_s, self._machine, self._kinematics, override
            )
            if found is None:
                return [], from_s
            k, laws = found
            start_s = from_s
            done = _Sent(first.item, first.run, first.laws, first.first, first.start_s, override)
            self._sent, self._queue_end_s = [*kept, done], from_s
            pieces = self._add(_Sent(first.item, first.run, laws, first.first + k, from_s, override))
        if rest := item.stretches[after:]:
            for run in profile.runs(Chain(rest), self._machine, self._kinematics, override):
                laws = profile.plan_run(run, self._machine, self._kinematics, override)
                pieces += self._add(_Sent(first.item, run, laws, 0, self._queue_end_s, override))
        self._following = first.item + 1
        return pieces + self._end(first.item == len(self._items) - 1), start_s


def _planned_for(now: Snapshot) -> float:
    """Below 100 % the path clock slows; the plan stays at 100 %, so that coming back needs none."""
    return max(1.0, now.override)


def _has_feed(run: profile.Run) -> bool:
    return any(stretch.feed_mm_s is not None for stretch in run)


def _position(chain: Chain, stretch: Stretch) -> int:
    return next(i for i, one in enumerate(chain.stretches) if one is stretch)


def _with(sent: _Sent, override: float) -> _Sent:
    return _Sent(sent.item, sent.run, sent.laws, sent.first, sent.start_s, override)
