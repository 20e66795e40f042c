"""The plan's process of the service: carries out orders, and keeps the tick's queue full meanwhile.

It owns SDO and the planner. Nothing that a machine needs lives here alone: killed, it is
started anew by its parent, finds the tick where it stands, and waits for orders.
"""

from __future__ import annotations

import multiprocessing.connection as connections
import select
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from controller import memory
from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.messages import of_error, said
from controller.motion.motions import SurfaceCut
from controller.plan import waits
from controller.plan.foresight import Foresight, foreseen, twice
from controller.plan.off_path import Back
from controller.plan.planner import Ahead
from controller.plan.report.passing import passed_s, place_of
from controller.plan.report.stored import Stored
from controller.plan.restart import reentry
from controller.plan.restart.path_offset import beside
from controller.plan.restart.program_position import ENTRY_ID, FORMER, LinePart, Spot, lines_along, order_of
from controller.plan.restart.restart import Rest
from controller.plan.retract import NotPossible
from controller.plan.stretch import Chain, Pause, Stretch
from controller.plan.timetable import Timetable
from controller.program.carried import InForce
from controller.program.program import Act, Aside, Block, Changing, Message, ProgramError, Select
from controller.runtime import checked, children, cores, starts
from controller.runtime.checked import Task
from controller.runtime.plan_end import EXPECTED, PLAN_TURN_S, REST_TURN_S, PlanEnd
from controller.runtime.starts import Start
from controller.runtime.startup import SessionError
from controller.service import entry_state
from controller.service.folders import Folders
from controller.service.planner_client import POWER_ON, Answer, Awaited, News, Order, Program, Said, Turn, Way
from controller.state.modes import Mode
from controller.values import dataclass

NEWS_S = 0.1
FORESEES_S = 0.5  # of queue: with less the planner is about to be asked, and nothing else is done
MAX_NOTES = 100  # every status has them; all of them stand with the check
MAX_KNOWN = 100_000  # stretches whose tool is remembered: more than are ever read ahead
# What is told of a program that nobody has looked at as a whole.
UNCHECKED: dict[str, Any] = {
    "duration_s": None,
    "blocks": None,
    "restart": [],
    "notes": [],
    "verdict": None,
    "marks": (),
    "passed_s": 0.0,
    "events": (),
    "timetable": None,
}


@dataclass(frozen=True, slots=True)
class PlanJob:
    """What the process is given: descriptors of its ends of sockets, and paths."""

    machine: Any  # Machine, with the channels of its hubs
    pieces: int
    requests: int
    orders: int
    snapshot_path: str
    kept: Folders


class GivenUp(Exception):
    """The operator does not want it any more: a check, or a start that is still being prepared."""


def main(job: PlanJob) -> None:
    """The plan's process, until its parent ends it. Raises what ``plan_end.EXPECTED`` lists."""
    cores.leave()
    end = PlanEnd(job.machine, job.pieces, job.requests, job.snapshot_path, job.kept.arranged)
    Planning(end, job.kept.checks, connections.Connection(job.orders), job.machine).run()


class _Foreseen:
    """What is to be told of a foresight: all when it is over, on the way each time twice as much."""

    def __init__(self) -> None:
        self._steps = 0  # since it was begun anew
        self._told = 0  # of them
        self._begun: object = None

    def look(self, foresight: Foresight, ahead: Ahead, now: Snapshot) -> Timetable | None:
        """One step more; the timetable where it is to be told."""
        if not foresight.look(ahead, now):
            return None
        if foresight.begun is not self._begun:
            self._begun, self._steps, self._told = foresight.begun, 0, 0
        self._steps += 1
        if not foresight.over and self._steps < 2 * self._told:
            return None
        self._told = self._steps
        return foresight.timetable


class Planning:
    """Orders in, answers and news out; between them the planner's turns."""

    def __init__(self, end: PlanEnd, checks: Path, parent: connections.Connection, machine: Machine) -> None:
        """``checks``: folder of stored checks; ``parent``: where orders come from."""
        self._end, self._checks, self._parent = end, checks, parent
        self._asked = select.poll()  # a connection of its own makes a selector with every look
        self._asked.register(parent.fileno(), select.POLLIN)
        self._awaited: Awaited | None = None
        self._tool: int | None = None
        # By identity of a stretch: with which tool it is moved, and of which lines it is.
        self._known: dict[int, tuple[int | None, tuple[LinePart, ...]]] = {}
        self._changes: dict[int, tuple[int, ...]] = {}  # to which tools, by line; until it is told
        self._marks: list[Changing] = []  # of a tool changer, until they are told
        self._heard: deque[Aside] = deque()  # messages and settings that no motion has come to
        self._said: list[Said] = []  # until it is told
        self._in_force = InForce()  # the modal state at each line of what is armed
        self._fitted = machine  # of what was armed
        self._armed: Program | None = None
        self._left: Program | None = None  # that did not come to its end, as it was run last
        self._text = b""  # of the program that was checked or armed last
        self._carrying_out = False
        self._facts: dict[str, Any] = {}  # of what is being armed
        self._foresight: Foresight | None = None  # of what was armed
        self._foreseen = _Foreseen()
        self._turns: list[Turn] = []
        self._told = News()
        self._told_s = 0.0
        self._verbs = {
            "commission": self._commission,
            "home": self._home,
            "check": self._check,
            "arm": self._arm,
            "drop": self._drop,
            "retract": self._retract,
            "return": self._return,
            "beside": self._beside,
        }

    def run(self) -> None:
        """Until the parent is gone. Raises what ``plan_end.EXPECTED`` lists."""
        rests = False
        while True:
            while self._asked.poll(1e3 * (REST_TURN_S if rests else PLAN_TURN_S)):
                try:
                    order: Order = self._parent.recv()
                except EOFError:
                    return
                self.carry_out(order)
                rests = False
            if not self._end.alone:
                rests = self.turn()

    # -- orders

    def carry_out(self, order: Order) -> None:
        """Every order is answered once; arming later, when its first piece is taken."""
        if order.verb not in self._verbs:
            return  # "give up", too late
        self._carrying_out = True
        try:
            facts = self._verbs[order.verb](order)
        except ProgramError as error:
            self._answer(Answer(order.number, error=("bad", error.placed)))
        except GivenUp:
            self._answer(Answer(order.number, error=("refused", said("given_up", verb=order.verb))))
        except NotPossible as error:
            self._answer(Answer(order.number, error=("refused", error.said)))
        except EXPECTED as error:
            self._answer(Answer(order.number, error=("refused", of_error(error))))
        except Exception as error:
            self._answer(Answer(order.number, error=("busy", children.own_error("plan", error))))
        else:
            if facts is not None:
                self._answer(Answer(order.number, facts))
        finally:
            self._carrying_out = False

    def _answer(self, answer: Answer) -> None:
        self._parent.send(answer)

    def _commission(self, _: Order) -> dict[str, Any]:
        for sentence in self._end.start_up.commission():
            print(sentence, file=sys.stderr, flush=True)
        return {}

    def _home(self, order: Order) -> dict[str, Any]:
        self._end.start_up.home(order.axes, self._look)
        return {}

    def _drop(self, _: Order) -> dict[str, Any]:
        self._end.planner.drop()
        self._foresight = None
        return {}

    def _check(self, order: Order) -> dict[str, Any]:
        """Read, planned and audited as a whole, or found as it was kept."""
        program = _program(order)
        if program.unchecked:
            return dict(UNCHECKED)
        kept = self._kept(program)
        rest = self._rest(program, kept) if program.spot is not None else None
        here = place_of(rest.what, rest.order, rest.spot.fraction, rest.spot.s) if rest else None
        return {
            **_found(kept),
            "passed_s": passed_s(kept.marks, here) if here else 0.0,
            "timetable": self._timetable_from_here(program, kept),
            "restart": entry_state.told(rest) if rest else [],
            "notes": [note.facts for note in kept.notes[:MAX_NOTES]],
            "verdict": checked.verdict_of(kept, most=0),  # the job is told many times a second
        }

    def _timetable_from_here(self, program: Program, kept: Stored) -> Timetable | None:
        """Of a run from where the machine stands, with the way to the program or to its place.

        None where the check is that of such a run, and where nobody knows where the machine stands.
        """
        now = self._end.snapshot()
        start = _start(program, now)
        task = replace(self._task(program), look=lambda _: self._look())
        homed = now.homed == program.machine.every_axis and not now.untrusted
        as_checked = program.spot is None and program.in_spindle == program.machine.in_spindle
        if not homed or (as_checked and checked.standing(task, start.joints) is task):
            return None
        begun = replace(start, in_spindle=program.in_spindle)
        walk = starts.path_from(task, kept, begun, program.cut_with)
        rev_min = program.begin.modal.spindle_rev_min if program.begin is not None else 0.0
        return foreseen(waits.laid(walk.items, program.machine, rev_min), program.machine, task.kinematics)

    def _task(self, program: Program) -> Task:
        """What was remembered of another program is forgotten."""
        if not program.typed and program.text != self._text:
            self._text = program.text
            memory.forget()
        machine = program.machine
        if program.typed and machine.changer is not None:  # which knows its tool before the line says any
            machine = replace(machine, in_spindle=program.in_spindle)
        task = replace(
            checked.task(program.text, program.name, machine), begin=program.begin, typed=program.typed
        )
        if program.typed:  # from where the tool stands: a line may ask for that
            task = replace(task, start=_start(program, self._end.snapshot()).joints)
        return replace(task, look=self._read)

    def _read(self, block: Block) -> None:
        """What is said and set aside of motions is noted."""
        self._look()
        if isinstance(block, Aside):
            self._heard.append(block)

    def _kept(self, program: Program) -> Stored:
        """Raises ProgramError, GivenUp."""
        task = self._task(program)
        kept, _ = checked.find(task, self._checks)
        if kept is not None:
            return kept
        lines = max(1, program.text.count(b"\n"))
        with self._telling():
            tell, progress = (lambda _: self._look()), (lambda line: self._checked(line / lines))
            return checked.check(task, self._checks, tell, progress)[1]

    @contextmanager
    def _telling(self) -> Iterator[None]:
        try:
            yield
        finally:
            self._tell(replace(self._told, checking=None))

    def _look(self) -> None:
        """Nothing is ordered while an order is under way, but to give it up."""
        if self._carrying_out and self._asked.poll(0):
            self._parent.recv()
            raise GivenUp

    def _checked(self, share: float) -> None:
        now_s = time.monotonic()
        if now_s - self._told_s >= NEWS_S:
            self._told_s = now_s
            self._tell(replace(self._told, checking=min(share, 1.0)))

    def _arm(self, order: Order) -> None:
        """From where the machine stands; answered when the first piece has been taken."""
        program = _program(order)
        kept, task = None if program.unchecked else self._kept(program), self._task(program)
        now = self._end.snapshot()
        start = _start(program, now)
        task = self._noting(task)
        self._heard.clear()
        self._marks.clear()
        rev_min = start.begin.modal.spindle_rev_min if start.begin is not None else 0.0
        path = starts.path_from(task, kept, start, self._cut_with(program)).items
        items, once_more = twice(waits.laid(path, program.machine, rev_min))
        self._end.new_planner(program.machine)
        self._tool, self._fitted, self._armed = None, program.machine, program
        self._known.clear()
        self._end.load(self._watched(items, program.spot), now)
        track, kinematics = self._end.planner.ahead.track, task.kinematics
        self._foresight = Foresight(track, once_more, program.machine, kinematics)
        self._foreseen = _Foreseen()
        self._turns.clear()
        self._told = News(finished=False)
        found = UNCHECKED if kept is None else _found(kept)
        self._facts = {name: found[name] for name in ("duration_s", "blocks", "marks", "events")}
        self._facts["start"] = start
        self._awaited = Awaited.of(order, now)

    def _cut_with(self, program: Program) -> Machine | None:
        """What has cut a program up to where it is gone on with; None where that is not known."""
        if self._armed is not None and not self._armed.typed:
            done = self._end.planner.finished_path
            self._left = None if done else replace(self._armed, machine=self._fitted)
        if program.cut_with is not None or program.spot is None or self._left is None:
            return program.cut_with
        return self._left.machine if self._left.text == program.text else None

    def _noting(self, task: Task) -> Task:
        """The same, of which the modal state of each line is noted from now on."""
        self._in_force = InForce()
        return replace(task, in_force=self._in_force)

    def _rest(self, program: Program, kept: Stored, noted: bool = False) -> Rest:
        """What is left of a program from its spot on. Raises ProgramError."""
        task = self._task(program)
        task = self._noting(task) if noted else task
        return starts.rest(task, kept.choices, _start(program, self._end.snapshot()))

    def _beside(self, order: Order) -> dict[str, Any]:
        """How far off the path the drives came to rest by themselves."""
        program, now = _program(order), self._end.snapshot()
        found = beside(self._rest(program, self._kept(program)), now.actual, kinematics_of(program.machine))
        return {"said": said("beside", **asdict(found)) if found is not None else None}

    def _watched(self, items: Iterable[Chain | Pause], spot: Spot | None) -> Iterator[Chain | Pause]:
        """The same path; what it changes the tool to and says is noted as it is read.

        ``spot``: it begins inside of the program; what was said before that is not said again, but what
        was set before it is in force.
        """
        number = 0  # of the motion that comes next, as the planner counts
        inside = spot is not None
        begun = spot.fraction if spot is not None and spot.motion_id >= 0 else 0.0
        for item in items:
            if inside:
                self._heard = deque(one for one in self._heard if not isinstance(one, Message))
                inside = isinstance(item, Pause) or (item.first_id or 0) >= ENTRY_ID
            if isinstance(item, Chain):
                number = number if item.first_id is None else item.first_id
                for stretch in item.stretches:
                    self._say(order_of(stretch, stretch.motion.end), number, None, stretch.place.order)
                    number += 1
                self._note_lines(item, 0.0 if inside else begun)
                begun = begun if inside else 0.0
            else:
                self._say(item.place.order, number, item.place.line)
            if isinstance(item, Pause) and item.changing is not None:
                self._marks.append(item.changing)
            if isinstance(item, Pause) and item.act is Act.TOOL and self._fitted.changer is None:
                self._tool, line = item.modal.tool, item.place.line
                self._changes[line] = (*self._changes.get(line, ()), self._tool)
            yield item
        self._say(sys.maxsize, number, None)

    def _note_lines(self, chain: Chain, begun: float = 0.0) -> None:
        for stretch, lines in zip(chain.stretches, lines_along(chain, begun), strict=True):
            self._known[id(stretch)] = self._tool, lines

    def _say(self, order: int, motion_id: int, line: int | None, first: int = sys.maxsize) -> None:
        """What the program says up to that order is due at that motion, or at the pause before it.

        What it sets behind the ``first`` of the motion's blocks is due when the motion is over.
        """
        while self._heard and self._heard[0].place.order <= order:
            one = self._heard.popleft()
            if isinstance(one, Message):
                self._said.append(Said(one.text, motion_id, line))
            elif isinstance(one, Select):
                self._said.append(Said("", motion_id, line, tool=one.tool))
            else:
                due = motion_id + (one.place.order > first)
                self._said.append(Said("", due, line, one.changes))

    def _retract(self, order: Order) -> None:
        """Off along the tool axis; with ``program``, another tool was fitted meanwhile."""
        now = self._end.snapshot()
        if order.program is not None:
            task = self._task(order.program)
            fitted = starts.back(task, order.tool).fitted
            reentry.see_free(now.joints, 0.0, fitted, task.kinematics)
        self._turns.append(Turn(now.tick, order.distance_mm, "retract"))
        self._end.planner.retract(now, order.distance_mm)
        self._await_taken(order, now)

    def _return(self, order: Order) -> None:
        """With ``program``, another tool was fitted meanwhile, and cuts the rest."""
        planner, refitted = self._end.planner, order.program is not None
        spot = planner.spot(self._end.snapshot())
        if order.program is not None and spot is not None:
            rest = self._with_other_tool(order.program, spot)
            back = starts.back_with(rest, self._fitted)
        elif self._armed is not None:
            back = starts.back(self._task(replace(self._armed, machine=self._fitted)), order.tool)
        else:
            back = Back()
        now = self._end.snapshot()
        self._turns.append(Turn(now.tick, float(order.tool), "return", refitted))
        planner.go_back(now, back)
        if order.program is not None:
            self._fitted = order.program.machine
        self._await_taken(order, now)

    def _with_other_tool(self, program: Program, spot: Spot) -> Rest:
        """The rest as the new tool cuts it."""
        program = replace(program, spot=Spot(spot.line, spot.fraction, FORMER))
        rest = self._rest(program, self._kept(program), noted=True)
        return replace(rest, items=self._lines_noted(rest.items, rest.spot.fraction))

    def _lines_noted(self, items: Iterable[Chain | Pause], begun: float) -> Iterator[Chain | Pause]:
        """The same path, which begins inside of a line."""
        for item in items:
            if isinstance(item, Chain):
                self._note_lines(item, begun)
                begun = 0.0
            yield item

    def _await_taken(self, order: Order, now: Snapshot) -> None:
        """Answered when the tick has the way."""
        self._facts = {}
        self._awaited = Awaited.of(order, now)

    # -- the planner's turns

    def turn(self) -> bool:
        """The planner acts on the newest snapshot, and what is new is told; True: there is nothing to do."""
        now, planner = self._end.snapshot(), self._end.planner
        before, turn = planner.marks, Turn(now.tick, planner.lead_s)
        self._end.before_message = lambda: self._tell_turn(turn)
        sent = planner.work(now)
        if not sent and planner.marks != before:
            self._turns.append(turn)
        self._end.flush()
        if self._awaited is not None:
            self._see_taken(self._awaited, now)
        news = self._news(now)
        if not sent and self._foresight is not None and now.queue_end_s - now.plan_time_s > FORESEES_S:
            news = replace(news, timetable=self._foreseen_now(self._foresight, now))
        self._tell(news)
        return planner.finished and self._awaited is None and now.mode in (Mode.OFF, Mode.READY)

    def _foreseen_now(self, foresight: Foresight, now: Snapshot) -> Timetable | None:
        """A step of it. It moves nothing: no mistake of ours in it may end the plan of a machine in a cut."""
        try:
            return self._foreseen.look(foresight, self._end.planner.ahead, now)
        except Exception as error:
            self._foresight = None
            print(children.own_error("foresight", error), file=sys.stderr, flush=True)
            return None

    def _see_taken(self, awaited: Awaited, now: Snapshot) -> None:
        error, why = self._end.planner.error, awaited.in_vain(now)
        if awaited.taken(now):
            self._answer(Answer(awaited.order, self._facts))
        elif error is not None and self._end.planner.finished:
            self._answer(Answer(awaited.order, error=("bad", error.placed)))
        elif why is not None:
            self._answer(Answer(awaited.order, error=why))
        else:
            return
        self._awaited = None

    def _news(self, now: Snapshot) -> News:
        planner = self._end.planner
        error = planner.error if _stands(now, planner.finished) else None
        refusal = error.placed if error is not None else None
        away = planner.aside
        returning = away is not None and away.returning
        stands_aside = away is not None and away.off and not returning
        whole = planner.finished_path
        left = self._in_force.last if planner.finished else None
        return News(planner.finished, left, whole, refusal, self._tool, stands_aside, returning)

    def _tell_turn(self, turn: Turn) -> None:
        """Before its message goes out: whatever the tick takes can then be planned again."""
        self._parent.send(replace(self._told, turns=(*self._turns, turn)))
        self._turns.clear()

    def _tell(self, news: News) -> None:
        """What is new, and nothing twice."""
        fresh = self._end.planner.fresh
        touches = self._end.planner.touches
        also = self._turns or fresh or self._changes or self._said or self._marks or touches
        if news == self._told and not also:
            return
        self._told = news
        ways = {name: self._way(stretch) for name, stretch in fresh.items()}
        self._forget_known()
        self._parent.send(
            replace(
                news,
                ways=ways,
                turns=tuple(self._turns),
                changes=self._changes,
                messages=tuple(self._said),
                marks=tuple(self._marks),
                touches=tuple(touches),
            )
        )
        touches.clear()
        self._marks.clear()
        self._changes = {}
        self._said.clear()
        self._turns.clear()
        fresh.clear()

    def _way(self, stretch: Stretch) -> Way:
        motion = stretch.motion
        tool, lines = self._known.get(id(stretch), (None, ()))
        state = self._in_force.at(stretch.place.order) or POWER_ON
        shown = (stretch.end, stretch.feed_mm_s, stretch.name, tool, state)
        arc = motion.arc if isinstance(motion, SurfaceCut) else None
        return Way(*shown, motion.end, arc, stretch.feed_steps, lines)

    def _forget_known(self) -> None:
        """What is known of stretches that were told long ago."""
        while len(self._known) > MAX_KNOWN:
            del self._known[next(iter(self._known))]


def _found(kept: Stored) -> dict[str, Any]:
    """What the check says of length and time."""
    return {name: getattr(kept, name) for name in ("marks", "events", "duration_s", "blocks")}


def _start(program: Program, now: Snapshot) -> Start:
    """From where the machine stands."""
    return Start(
        now.joints,
        now.queue_end_s,
        program.spot,
        program.start,
        program.dry_run_mm,
        program.in_spindle,
        program.typed,
        program.unchecked,
        program.begin,
    )


def _program(order: Order) -> Program:
    if order.program is None:
        raise SessionError("There is no program to be run; load one.")
    return order.program


def _stands(now: Snapshot, finished: bool) -> bool:
    """Whether a program that is refused on the way has been run up to there."""
    return finished and now.at_rest and now.plan_time_s >= now.queue_end_s
