"""What the plan's process reports while it works: where it is with the path, and how long the rest takes."""

from __future__ import annotations

import multiprocessing.connection as connections
import sys
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.plan.foresight import FIRST, Foresight
from controller.plan.planner import Planner
from controller.plan.restart.program_position import ENTRY_ID, LinePart, Spot, lines_along
from controller.plan.segment import ContinuousPath, PathItem, Pause, Segment
from controller.plan.timetable import Timetable
from controller.program.carried import InForce
from controller.program.modal import State
from controller.program.program import Act, Aside, Block, Changing, OperatorMessage, Select
from controller.runtime import children
from controller.runtime.plan_messages import POWER_ON, Announcement, MotionFacts, News, Turn

FORESEES_S = 0.5  # of queue: with less the planner is about to be asked, and nothing else is done
MAX_KNOWN = 100_000  # segments whose tool is remembered: more than are ever read ahead


class PathNotes:
    """Of the path that is armed; ``watched`` notes, ``taken`` gives what is new."""

    def __init__(self, machine: Machine) -> None:
        """``machine``: with which the path is made."""
        self._with_changer = machine.changer is not None
        self.tool: int | None = None  # to which it has changed, as far as it is read
        self.in_force = InForce()  # the modal state at each line
        # By identity of a segment: with which tool it is moved, and of which lines it is.
        self._known: dict[int, tuple[int | None, tuple[LinePart, ...]]] = {}
        self._heard: deque[Aside] = deque()  # messages and settings that no motion has come to
        self._changes: dict[int, tuple[int, ...]] = {}  # to which tools, by line; until it is reported
        self._marks: list[Changing] = []  # of a tool changer, until they are reported
        self._said: list[Announcement] = []  # until it is reported

    def hear(self, block: Block) -> None:
        """What is said and set aside of motions is noted."""
        if isinstance(block, Aside):
            self._heard.append(block)

    def watched(self, items: Iterable[PathItem], spot: Spot | None) -> Iterator[PathItem]:
        """The same path; what it changes the tool to and says is noted as it is read.

        ``spot``: it begins inside of the program; what was said before that is not said again, but what
        was set before it is in force.
        """
        number = 0  # of the motion that comes next, as the planner counts
        inside = spot is not None
        begun = spot.fraction if spot is not None and spot.motion_id >= 0 else 0.0
        for item in items:
            if inside:
                self._heard = deque(one for one in self._heard if not isinstance(one, OperatorMessage))
                inside = isinstance(item, Pause) or (item.first_id or 0) >= ENTRY_ID
            if isinstance(item, ContinuousPath):
                number = number if item.first_id is None else item.first_id
                for segment in item.segments:
                    self._say(segment.order_at(segment.motion.end), number, None, segment.place.order)
                    number += 1
                self._note_lines(item, 0.0 if inside else begun)
                begun = begun if inside else 0.0
            else:
                self._say(item.place.order, number, item.place.line)
                self._note_change(item)
                if item.turns:
                    asked = item.modal.spindle_rev_min
                    self._said.append(Announcement("", number, item.place.line, rev_min=asked))
            yield item
        self._say(sys.maxsize, number, None)

    def _note_change(self, pause: Pause) -> None:
        if pause.changing is not None:
            self._marks.append(pause.changing)
        if pause.act is Act.TOOL and not self._with_changer:
            self.tool, line = pause.modal.tool, pause.place.line
            self._changes[line] = (*self._changes.get(line, ()), self.tool)

    def lines_noted(self, items: Iterable[PathItem], begun: float) -> Iterator[PathItem]:
        """The same path, which begins inside of a line."""
        for item in items:
            if isinstance(item, ContinuousPath):
                self._note_lines(item, begun)
                begun = 0.0
            yield item

    def _note_lines(self, path: ContinuousPath, begun: float) -> None:
        for segment, lines in zip(path.segments, lines_along(path, begun), strict=True):
            self._known[id(segment)] = self.tool, lines

    def _say(self, order: int, motion_id: int, line: int | None, first: int = sys.maxsize) -> None:
        """What the program says up to that order is due at that motion, or at the pause before it.

        What it sets after the ``first`` of the motion's blocks is due when the motion is over.
        """
        while self._heard and self._heard[0].place.order <= order:
            one = self._heard.popleft()
            if isinstance(one, OperatorMessage):
                self._said.append(Announcement(one.text, motion_id, line))
            elif isinstance(one, Select):
                self._said.append(Announcement("", motion_id, line, tool=one.tool))
            else:
                due = motion_id + (one.place.order > first)
                self._said.append(Announcement("", due, line, one.changes))

    def note_modal_anew(self) -> InForce:
        """For another path in the place of the rest; it is to be filled."""
        self.in_force = InForce()
        return self.in_force

    # -- until it is reported

    @property
    def has_news(self) -> bool:
        """Whether there is something that was not taken."""
        return bool(self._changes or self._said or self._marks)

    def taken(self) -> dict[str, Any]:
        """As fields of ``News``, each once."""
        fresh = {"changes": self._changes, "messages": tuple(self._said), "marks": tuple(self._marks)}
        self._changes, self._said, self._marks = {}, [], []
        while len(self._known) > MAX_KNOWN:  # of segments that were reported long ago
            del self._known[next(iter(self._known))]
        return fresh

    def way(self, segment: Segment) -> MotionFacts:
        """For those who look on."""
        motion = segment.motion
        tool, lines = self._known.get(id(segment), (None, ()))
        state = self.in_force.at(segment.place.order) or POWER_ON
        shown = (segment.end, segment.feed_mm_s, segment.name, tool, state)
        arc = motion.arc if isinstance(motion, SurfaceCut) and segment.cutting else None
        steps, states = segment.feed_steps, self._states(lines)
        return MotionFacts(*shown, motion.end, arc, steps, lines, states, segment.share)

    def _states(self, lines: Sequence[LinePart]) -> tuple[tuple[float, State], ...]:
        """Of a motion of several lines: from which s on which modal state is in force."""
        found: list[tuple[float, State]] = []
        for part in lines if len(lines) > 1 else ():
            state = self.in_force.at(part.order) or POWER_ON
            if not found or state != found[-1][1]:
                found.append((part.from_s, state))
        return tuple(found) if len(found) > 1 else ()


class Reporter:
    """To the parent: what is new, and nothing twice."""

    def __init__(self, parent: connections.Connection) -> None:
        self._parent = parent
        self._last = News()
        self._turns: list[Turn] = []

    def begin(self) -> None:
        """Another path is armed."""
        self._turns.clear()
        self._last = News(finished=False)

    def note(self, turn: Turn) -> None:
        """Reported with what is reported next."""
        self._turns.append(turn)

    def report_turn(self, turn: Turn) -> None:
        """Before its message goes out: whatever the tick takes can then be planned again."""
        self._parent.send(replace(self._last, turns=(*self._turns, turn)))
        self._turns.clear()

    def report_progress(self, share: float | None, planner: Planner, notes: PathNotes) -> None:
        """Of a check."""
        self.report(replace(self._last, checking=share), planner, notes)

    def report(self, news: News, planner: Planner, notes: PathNotes) -> None:
        """``news`` with turns, ways, touches and notes, where any of it is new."""
        fresh, touches = planner.fresh, planner.touches
        if news == self._last and not (self._turns or fresh or touches or notes.has_news):
            return
        self._last = news
        ways = {name: notes.way(segment) for name, segment in fresh.items()}
        turns, found = tuple(self._turns), tuple(touches)
        self._parent.send(replace(news, ways=ways, turns=turns, touches=found, **notes.taken()))
        touches.clear()
        self._turns.clear()
        fresh.clear()


class Foreseen:
    """The foresight of what was armed; reported when it is over, on the way from ``FIRST`` windows on, each
    time it is twice as long: what is known of fewer is a worse guess than what was reported before.
    """

    def __init__(self) -> None:
        self._foresight: Foresight | None = None
        self._steps = 0  # since it was begun anew
        self._reported = 0  # of them
        self._begun: object = None

    def drop(self) -> None:
        """Nothing is armed any more."""
        self._foresight = None

    def begin(self, foresight: Foresight) -> None:
        """Another path is armed."""
        self._foresight, self._begun, self._steps, self._reported = foresight, None, 0, 0

    def look(self, planner: Planner, now: Snapshot) -> Timetable | None:
        """One step more, while the queue lasts; the timetable where it is to be reported.

        It moves nothing: no mistake of ours in it may end the plan of a machine in a cut.
        """
        foresight = self._foresight
        if foresight is None or now.queue_end_s - now.plan_time_s <= FORESEES_S:
            return None
        try:
            return self._step(foresight, planner, now)
        except Exception as error:
            self._foresight = None
            print(children.own_error("foresight", error), file=sys.stderr, flush=True)
            return None

    def _step(self, foresight: Foresight, planner: Planner, now: Snapshot) -> Timetable | None:
        if not foresight.look(planner.ahead, now):
            return None
        if foresight.begun is not self._begun:
            self._begun, self._steps, self._reported = foresight.begun, 0, 0
        self._steps += 1
        if not foresight.over and self._steps < max(FIRST, 2 * self._reported):
            return None
        self._reported = self._steps
        return foresight.timetable
