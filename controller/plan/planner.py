"""Keeps the tick's queue full: walks along the path, plans it window by window, sends it.

A window is a part of a course with a law that ends at rest. Where the course goes on, the
end of the window is not meant to be reached: from its seam on the next window replaces it.

```
    speed  ____________________
          /          :         \\        the first window ...
         /           :____________________
                     :                    \\      ... and the next one, from the seam on
                    seam
```
So the queue always ends at rest, and an interrupted planner leaves nothing half said.
What the operator changes (overrides, single block, optional stop), and adaptive feed, is
planned from a place a little ahead of the commit point on, out of the motion that is there.
After a stop the tick stands with an empty queue and another ``epoch``, and the path is
planned from there.

What is planned depends on the path, the operator and the tick's plan time alone, never on a clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from controller.geometry.vectors import ROUNDING, Vector
from controller.ipc.handoff import PieceMessage, Snapshot
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.messages import message
from controller.plan.look_ahead import Orders, Sent, TrackPlace, Windows
from controller.plan.off_path import SAME, Aside, Back, Detour
from controller.plan.restart.program_position import Spot
from controller.plan.restart.reentry import NotPossible
from controller.plan.segment import PathItem, Segment
from controller.plan.track import Track
from controller.program.program import Probed, ProgramError
from controller.state.modes import Mode, Request

AHEAD_S = 2.5  # of motion that is not to be replaced, before the tick needs it
BUNDLE_S = 0.5  # short runs and pauses go together, up to this
REPLAN_LEAD_S = 0.05  # ahead of the commit point, where planning takes no time ...
MAX_LEAD_S = 2.0
RETRY_S = 0.1  # where there is no way on from a state of motion, one this much later is tried ...
TIMEOUT_S = 0.05  # ... after so much plan time
TOUCHED, TOUCHING = 1, 3  # of the tick's ``probed`` and ``probing``


class Touch(NamedTuple):
    """A probing move towards the part that has come to its end: measuring starts from a table of them."""

    line: int
    came: Probed
    direction: Vector  # unit, of the linear axes
    tool: int  # number
    feed_mm_s: float


class Ahead(NamedTuple):
    """What has been sent of a path and is not behind the tick yet, and where the path goes on after it."""

    track: Track
    sent: tuple[Sent, ...]
    next: TrackPlace
    queue_end_s: float  # plan time


class _Held(NamedTuple):
    """What holds until the tick has answered a message, and again if it refuses it."""

    sequence: int
    sent: list[Sent]
    next: TrackPlace
    queue_end_s: float
    moving: bool  # the message began in motion: a refusal means that it came too late


def orders_of(now: Snapshot) -> Orders:
    """What the operator's switches say, and the load of the spindle."""
    share = now.adaptive_share
    return Orders(
        override=now.override,
        rapid_override=min(now.rapid_override, 1.0),
        single_block=now.is_on(Request.SINGLE_BLOCK),
        optional_stop=now.is_on(Request.OPTIONAL_STOP),
        adaptive=share,
        everywhere=share if now.is_on(Request.ADAPTIVE_FEED) else 1.0,
    )


class Planner:
    """Plans one path; ``send`` hands a message to the tick and says whether it went out."""

    def __init__(
        self,
        machine: Machine,
        kinematics: Kinematics,
        send: Callable[[PieceMessage], bool],
        remember: bool = False,
        clock: Callable[[], float] | None = None,
    ) -> None:
        """``remember`` keeps all motions for traces; ``clock`` measures how long planning takes."""
        self._machine, self._kinematics, self._send = machine, kinematics, send
        self._remember, self._clock = remember, clock
        self._windows = Windows(machine, kinematics)
        self._sequence = 0
        self._epoch = 0
        self._track = Track((), machine, kinematics)
        self.touches: list[Touch] = []  # of all that was loaded
        self._next = TrackPlace(0, 0.0)  # where the path goes on after what was sent
        self._queue_end_s = 0.0
        self._dropped = False
        self._probings: int | None = None  # that had come to their end before the one that is waited for
        self._sent: list[Sent] = []
        self._held: _Held | None = None
        self._lead_s = REPLAN_LEAD_S
        self._retry_s = -math.inf  # plan time of the next state of motion that may be tried ...
        self._wait_s = -math.inf  # ... when the tick has come to this one
        self._detour = Detour(machine, kinematics)
        self._asked = 0  # the last sequence before the way off the path, or back
        self.segments: dict[int, Segment] = {}  # by motion id, in the order of the path
        self.fresh: dict[int, Segment] = {}  # motions sent since its owner emptied it

    # --- what is to be planned

    def load(self, items: Iterable[PathItem], queue_end_s: float, epoch: int = 0) -> None:
        """Take a path; the first message goes out with the next ``work``."""
        track = Track(items, self._machine, self._kinematics, probes=True)
        self._begin(track, TrackPlace(0, 0.0), queue_end_s, epoch)
        self._probings = None
        self._dropped = False
        self._detour.forget()
        self.segments.clear()

    def go_on_from(self, sequence: int) -> None:
        """The tick has seen messages up to ``sequence``, of a planner before this one."""
        self._sequence = max(self._sequence, sequence)

    def drop(self) -> None:
        """Forget what has not been sent: the operator stopped the program."""
        nothing = Track((), self._machine, self._kinematics)
        self._begin(nothing, TrackPlace(0, 0.0), self._queue_end_s, self._epoch)
        self._dropped = True
        self._detour.forget()

    def _begin(self, track: Track, place: TrackPlace, queue_end_s: float, epoch: int) -> None:
        self._track, self._next, self._queue_end_s, self._epoch = track, place, queue_end_s, epoch
        self._sent.clear()
        self._held, self._retry_s, self._wait_s = None, -math.inf, -math.inf

    @property
    def finished(self) -> bool:
        """Everything of the path has been sent."""
        return self.aside is None and self._all_sent

    @property
    def _all_sent(self) -> bool:
        going_on = bool(self._sent) and self._sent[-1].seam_s is not None
        return not going_on and self._track.at(self._next.unit) is None and self._track.waits is None

    @property
    def finished_path(self) -> bool:
        """Everything has been sent, and not because the rest was dropped or refused."""
        return self.finished and not self._dropped and self._track.error is None

    @property
    def error(self) -> ProgramError | None:
        """What ended the path before its end; the queue still ends at rest, on the path."""
        return self._track.error

    @property
    def lead_s(self) -> float:
        """How far ahead of the commit point a change would be planned now: what planning takes."""
        return self._lead_s

    @lead_s.setter
    def lead_s(self, lead_s: float) -> None:
        self._lead_s = lead_s

    @property
    def marks(self) -> tuple[object, ...]:
        """Changes wherever a turn without a message still has an effect on later ones."""
        own = self._lead_s, self._retry_s, self._wait_s, self._sequence, self._epoch
        return *own, *self._detour.marks

    @property
    def ahead(self) -> Ahead:
        """Where the path goes on after what has been sent."""
        return Ahead(self._track, tuple(self._sent), self._next, self._queue_end_s)

    # --- one turn

    def work(self, now: Snapshot) -> bool:
        """Send what the queue lacks, at most one message a call; True if one went out."""
        if self._held is not None and not self._answered(self._held, now):
            return False
        if now.stopping:
            return False
        if not self._watch_aside(now):
            return False
        if not self._see_probed(now):
            return False
        if now.epoch != self._epoch:
            self._restart(now)
        self._forget(now)
        orders = orders_of(now)
        began_s = self._clock() if self._clock else 0.0
        tries = now.plan_time_s >= self._wait_s
        sent = (tries and self._replan(now, orders)) or self._further(now, orders, tries)
        if sent and self._clock:
            took_s = self._clock() - began_s
            self._lead_s = min(max(REPLAN_LEAD_S, 1.5 * took_s, 0.8 * self._lead_s), MAX_LEAD_S)
        return sent

    def _see_probed(self, now: Snapshot) -> bool:
        """Whether there is a way to be planned: between a touch and its outcome there is none."""
        if self._probings is None:
            self._probings = now.probings
        if now.probings > self._probings:
            self._probings = now.probings
            came = Probed(now.probed == TOUCHED, now.touch, now.joints)
            behind = self._track.answer(self._next.unit, came)
            self._note_touch(came, behind)
            self._begin(self._track, TrackPlace(behind, 0.0), now.queue_end_s, now.epoch)
        return now.probing != TOUCHING

    def _note_touch(self, came: Probed, behind: int) -> None:
        """What came of the probing before that unit, for those who measure."""
        way, pause = self._track.at(behind - 2), self._track.at(behind - 1)
        if way is None or pause is None or way.segment is None or pause.pause is None:
            return
        if (probe := pause.pause.probe) is None or probe.away:
            return
        places = [[q[i] for i in self._machine.linear()] for q in (way.segment.start, way.segment.end)]
        length = math.dist(*places)
        x, y, z = ((b - a) / length for a, b in zip(*places, strict=True))
        feed_mm_s = way.segment.feed_mm_s or 0.0
        self.touches.append(Touch(pause.line, came, (x, y, z), pause.pause.modal.tool, feed_mm_s))

    def keepalive(self) -> None:
        """Tell the tick that the planner lives."""
        self._send(PieceMessage(self._sequence, self._queue_end_s))

    def _answered(self, held: _Held, now: Snapshot) -> bool:
        """Whether the tick has taken or refused the last message; a refusal puts back what was."""
        if now.accepted < held.sequence and now.rejected < held.sequence:
            return False
        self._held = None
        if now.accepted < held.sequence:
            self._sent, self._next, self._queue_end_s = held.sent, held.next, held.queue_end_s
            if held.moving:
                self._lead_s = min(2.0 * self._lead_s, MAX_LEAD_S)
        return True

    def _restart(self, now: Snapshot) -> None:
        """The tick gave the queue up. In the middle of a program it goes on from where it stands."""
        number = self._track.number_of(now.motion_id)
        if now.mode not in (Mode.HOLD, Mode.RUNNING) or number is None:
            self.drop()
            self._epoch, self._queue_end_s = now.epoch, now.queue_end_s
        else:
            self._begin(self._track, TrackPlace(number, now.s), now.queue_end_s, now.epoch)

    # --- where the program stands, off the path and back

    @property
    def aside(self) -> Aside | None:
        """Where the tool is while it is off the path: between ``retract`` and the end of the way back."""
        return self._detour.aside

    def spot(self, now: Snapshot) -> Spot | None:
        """Line, fraction of its block and exact place of the program; None where there is none."""
        if self.aside is not None:
            return self.aside.spot
        place = self._place(now)
        if place is None:
            return None
        return self._track.program_spot(*place)

    def _place(self, now: Snapshot) -> TrackPlace | None:
        return place_at(self._track, self._sent, self._next, self._epoch, now)

    def _left(self, now: Snapshot) -> tuple[Track, TrackPlace] | None:
        place = self._place(now)
        return None if place is None else (self._track, place)

    def is_path_accepted(self, now: Snapshot) -> bool:
        """Whether the tick has the way that was asked for last: RESUME then leads along it."""
        return now.accepted > self._asked

    def retract(self, now: Snapshot, by_mm: float) -> None:
        """Out of HOLD at rest: the tool goes off along its axis, or further off, once the tick has the path
        (``is_path_accepted``) and RESUME came. Raises NotPossible.
        """
        if now.probing:
            raise NotPossible(message("aside.probing"))
        self._lead(self._detour.retract(now, self._left(now), self.spot(now), by_mm), now)

    def go_back(self, now: Snapshot, back: Back = SAME) -> None:
        """Back to a place off the part, and to HOLD, once the tick has the path (``is_path_accepted``)
        and RESUME came; RESUME then goes in, and on. Raises NotPossible.
        """
        self._lead(self._detour.go_back(now, self._left(now), self.spot(now), back), now)

    def _lead(self, way: Track, now: Snapshot) -> None:
        """A way of its own takes the place of everything queued."""
        self._begin(way, TrackPlace(0, 0.0), now.plan_time_s, now.epoch)
        self._asked = self._sequence

    def _watch_aside(self, now: Snapshot) -> bool:
        """Whether there is a way to be planned: off the path there is none but the way back."""
        if self.aside is None:
            self._detour.look(now, lambda: (self._left(now), self.spot(now)))
        if self.aside is None:
            return now.mode is not Mode.JOG and not now.away
        # Held at its end, or resumed already, before this has been seen.
        stands = now.mode in (Mode.HOLD, Mode.RUNNING) and now.at_rest and not now.stopping
        arrived = stands and self._all_sent and self.is_path_accepted(now)
        arrived = arrived and now.plan_time_s >= self._queue_end_s - ROUNDING
        left = self._detour.follow(now, arrived)
        if left is not None:
            self._begin(*left, now.queue_end_s, now.epoch)
        return self.aside is None or not self.aside.off or self.aside.returning

    def _forget(self, now: Snapshot) -> None:
        while len(self._sent) > 1 and self._sent[0].end_s < now.plan_time_s - ROUNDING:
            del self._sent[0]
        self._track.forget(self._sent[0].first if self._sent else self._next.unit)

    def _earliest(self, now: Snapshot) -> float:
        """The first tick from which on the queue may still be changed when the message has come."""
        if now.commit_s <= now.plan_time_s + ROUNDING:
            return now.plan_time_s
        period_s = self._machine.period_s
        ahead = math.ceil((now.commit_s - now.plan_time_s + self._lead_s) / period_s - 1e-6)
        return now.plan_time_s + ahead * period_s

    # --- appending

    def _further(self, now: Snapshot, orders: Orders, tries: bool) -> bool:
        """The next window at a seam, or what comes after the queue's end."""
        last = self._sent[-1] if self._sent else None
        if last is not None and last.seam_s is not None:
            if last.seam_s - now.plan_time_s > AHEAD_S:
                return False
            from_s = max(last.seam_s, self._earliest(now), self._retry_s)
            if from_s < last.end_s:
                return tries and self._from_motion(now, len(self._sent) - 1, from_s, orders)
        if self._queue_end_s - now.plan_time_s > AHEAD_S:
            return False
        return self._append(orders)

    def _append(self, orders: Orders) -> bool:
        """Runs and pauses from rest, at the queue's end."""
        held, added = self._hold(False), list[Sent]()
        start_s = self._queue_end_s
        while self._queue_end_s - start_s < (BUNDLE_S if held.sent else ROUNDING) or not added:
            made = self._windows.from_rest(
                self._track, self._next, self._queue_end_s, orders, soon=not held.sent
            )
            if made is None:
                break
            self._note(made, added)
            if made.seam_s is not None:
                break
        return self._tell(held, start_s, added, known=None)

    def _note(self, made: Sent, added: list[Sent]) -> None:
        added.append(made)
        self._sent.append(made)
        self._next, self._queue_end_s = made.after, made.end_s

    # --- replacing

    def _replan(self, now: Snapshot, orders: Orders) -> bool:
        """Plan again, from a little ahead on, what was planned for other orders; True if it was."""
        from_s = max(self._earliest(now), self._retry_s)
        for i, sent in enumerate(self._sent):
            if sent.end_s > from_s + ROUNDING and sent.is_other(orders):
                if sent.is_blocked(orders):
                    return False  # the tick stops there by itself, and then it is planned anew
                return self._from_motion(now, i, max(from_s, sent.start_s), orders, soon=True)
        return False

    def _from_motion(
        self, now: Snapshot, index: int, from_s: float, orders: Orders, soon: bool = False
    ) -> bool:
        """The rest of a window from ``from_s`` on, out of the motion that it has there."""
        sent = self._sent[index]
        made = self._windows.from_motion(self._track, sent, from_s, orders, soon)
        if made is None:
            self._retry_s, self._wait_s = from_s + RETRY_S, now.plan_time_s + TIMEOUT_S
            return False
        held = self._hold(True)
        self._sent = [*self._sent[:index], replace(sent, end_s=from_s, seam_s=None)]
        if from_s <= sent.start_s + ROUNDING:
            del self._sent[-1]
        added: list[Sent] = []
        self._note(made, added)
        return self._tell(held, from_s, added, known=sent.motion_at(from_s))

    # --- sending

    def _hold(self, moving: bool) -> _Held:
        return _Held(self._sequence + 1, list(self._sent), self._next, self._queue_end_s, moving)

    def _tell(self, held: _Held, from_s: float, added: list[Sent], known: int | None) -> bool:
        """Send windows as one message; the motion ``known`` is under the tick's eyes already."""
        if not added:
            return False
        self._sequence += 1
        motions = {name: segment for sent in added for name, segment in sent.segments.items()}
        self.fresh.update(motions)
        if self._remember:
            self.segments.update(motions)
        message = PieceMessage(
            self._sequence,
            from_s,
            {name: segment.motion for name, segment in motions.items() if name != known},
            tuple(piece for sent in added for piece in sent.pieces),
            tuple(sent.stops for sent in added if sent.stops is not None),
            self._epoch,
            alone=self.aside is not None and not held.sent,
        )
        self._held = held
        self._send(message)
        return True


# Where on the path the tick is, out of a snapshot and what it was sent.


def place_at(
    track: Track, queue: Sequence[Sent], after: TrackPlace, epoch: int, now: Snapshot
) -> TrackPlace | None:
    """The place of the path at which the tick is, or stands; None where it is on none.

    ``queue``: what was sent for ``epoch``, and ``after`` it. A pause is begun again, also where
    it has just ended: whether its mark was passed cannot be told, and to set twice is no harm.
    """
    number = track.number_of(now.motion_id) if now.motion_id >= 0 else None
    if now.epoch != epoch or (number is not None and not now.at_rest):
        return None if number is None else TrackPlace(number, now.s)
    for sent in queue:
        unit = track.at(sent.first)
        past_s = now.plan_time_s - sent.end_s
        pauses = unit is not None and unit.pause is not None and past_s < ROUNDING
        if pauses and number is not None and sent.first > number:
            return TrackPlace(sent.first, 0.0)  # still to come: the clock is in a motion before it
        if past_s < -ROUNDING or (pauses and unit is not None and unit.line == now.line):
            return sent.place_at(now.plan_time_s)
    return after if track.at(after.unit) is not None else None
