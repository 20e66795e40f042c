"""The plan's process of the service: carries out orders, and keeps the tick's queue full meanwhile.

It owns SDO and the planner. Nothing that a machine needs lives here alone: killed, it is
started anew by its parent, finds the tick where it stands, and waits for orders.
"""

from __future__ import annotations

import multiprocessing.connection as connections
import pickle
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from controller.handoff import Snapshot
from controller.machine import five
from controller.plan.aside import NotPossible
from controller.plan.report.stored import Stored
from controller.plan.report.survey import BlockUse
from controller.plan.route.restart import Rest
from controller.plan.route.stretch import Chain, Pause, Stretch
from controller.plan.text.program import Act, ProgramError
from controller.service.orders import Answer, News, Order, Program, Turn, Way
from controller.session import checked, children
from controller.session.plan_end import PLAN_TURN_S, PlanEnd
from controller.session.processes import EXPECTED, own_error
from controller.session.startup import SessionError

SAME_PLACE = 1e-9  # mm or rad
ARM_S = 120.0  # for the first piece to be taken
NEWS_S = 0.1


@dataclass(frozen=True, slots=True)
class PlanJob:
    """What the process is given: descriptors of its ends of sockets, and paths."""

    machine: Any  # Machine, with the channels of its hubs
    pieces: int
    requests: int
    orders: int
    snapshot_path: str
    checks: Path


class GivenUp(Exception):
    """The operator does not want the check any more."""


def run(job_file: Path) -> int:
    """Until the parent ends it; the exit code. Whatever ends it too early is one sentence beside the job."""
    job: PlanJob = pickle.loads(job_file.read_bytes())
    try:
        Planning(job).run()
    except EXPECTED as error:
        children.words_of(job_file).write_text(str(error))
    except Exception as error:  # the top of a process: its parent tells the operator
        children.words_of(job_file).write_text(own_error("plan", error))
    else:
        return 0
    return 1


class Planning:
    """Orders in, answers and news out; between them the planner's turns."""

    def __init__(self, job: PlanJob) -> None:
        self._end = PlanEnd(job.machine, job.pieces, job.requests, job.snapshot_path)
        self._checks = job.checks
        self._parent: connections.Connection = connections.Connection(job.orders)
        self._arming: tuple[int, int, float] | None = None  # order, message accepted before, deadline
        self._tool: int | None = None
        self._facts: dict[str, Any] = {}  # of what is being armed
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
        }

    def run(self) -> None:
        """Until the parent is gone. Raises what ``EXPECTED`` lists."""
        while True:
            while self._parent.poll(PLAN_TURN_S):
                try:
                    order: Order = self._parent.recv()
                except EOFError:
                    return
                self._carry_out(order)
            if not self._end.alone:
                self._turn()

    # -- orders

    def _carry_out(self, order: Order) -> None:
        """Every order is answered once; arming later, when its first piece is taken."""
        if order.verb not in self._verbs:
            return  # "give up", too late
        try:
            facts = self._verbs[order.verb](order)
        except ProgramError as error:
            self._answer(Answer(order.number, error=("bad", str(error))))
        except GivenUp:
            self._answer(Answer(order.number, error=("refused", "The check was given up.")))
        except (*EXPECTED, NotPossible) as error:
            self._answer(Answer(order.number, error=("refused", str(error))))
        except Exception as error:
            self._answer(Answer(order.number, error=("busy", own_error("plan", error))))
        else:
            if facts is not None:
                self._answer(Answer(order.number, facts))

    def _answer(self, answer: Answer) -> None:
        self._parent.send(answer)

    def _commission(self, _: Order) -> dict[str, Any]:
        self._end.start_up.commission()
        return {}

    def _home(self, order: Order) -> dict[str, Any]:
        self._end.start_up.home(order.axes)
        return {}

    def _drop(self, _: Order) -> dict[str, Any]:
        self._end.planner.drop()
        return {}

    def _check(self, order: Order) -> dict[str, Any]:
        """Read, planned and audited as a whole, or found as it was kept."""
        program = _program(order)
        kept = self._kept(program)
        state = self._rest(program, kept).sentences() if program.spot is not None else ()
        return {
            "duration_s": kept.duration_s,
            "blocks": kept.blocks,
            "restart": list(state),
            "notes": [{"line": note.place.line, "note": note.sentence} for note in kept.notes],
        }

    def _kept(self, program: Program) -> Stored:
        """Raises ProgramError, GivenUp."""
        task = checked.task(program.text, program.name, program.machine)
        kept, _ = checked.find(task, self._checks)
        if kept is not None:
            return kept
        lines = max(1, program.text.count(b"\n"))
        with self._telling():
            return checked.check(task, self._checks, self._look, lambda line: self._checked(line / lines))[1]

    @contextmanager
    def _telling(self) -> Iterator[None]:
        try:
            yield
        finally:
            self._tell(replace(self._told, checking=None))

    def _look(self, _: BlockUse) -> None:
        """Nothing is ordered while an order is under way, but to give it up."""
        if self._parent.poll():
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
        now = self._end.snapshot()
        task = checked.task(program.text, program.name, program.machine)
        kept = self._kept(program)
        if max(abs(a - b) for a, b in zip(now.joints, task.start, strict=True)) > SAME_PLACE:
            task = replace(task, start=five(now.joints))
        items: Iterable[Chain | Pause]
        if program.spot is not None:
            items = self._rest(program, kept).entered(five(now.joints), program.in_spindle)
        elif program.dry_run_mm:
            items = checked.path_of(task, kept.choices, program.dry_run_mm).items
        else:
            items = checked.walk_of(task, kept, False).items
        planner = self._end.new_planner(program.machine)
        self._tool = None
        planner.load(self._watched(items), now.queue_end_s, now.epoch)
        self._turns.clear()
        self._facts = {"duration_s": kept.duration_s, "blocks": kept.blocks, "plan_time_s": now.queue_end_s}
        self._arming = (order.number, now.accepted, time.monotonic() + ARM_S)

    def _rest(self, program: Program, kept: Stored) -> Rest:
        """What is left of a program from its spot on. Raises ProgramError."""
        assert program.spot is not None
        task = checked.task(program.text, program.name, program.machine)
        if program.start is not None:
            task = replace(task, start=program.start)
        return checked.rest_of(task, kept.choices, program.spot, program.dry_run_mm)

    def _watched(self, items: Iterable[Chain | Pause]) -> Iterator[Chain | Pause]:
        """The same path; what it changes the tool to is noted as it is read."""
        for item in items:
            if isinstance(item, Pause) and item.act is Act.TOOL:
                self._tool = item.modal.tool
            yield item

    def _retract(self, order: Order) -> None:
        now = self._end.snapshot()
        self._end.planner.retract(now, order.distance_mm)
        self._await_taken(order, now)

    def _return(self, order: Order) -> None:
        now = self._end.snapshot()
        self._end.planner.go_back(now)
        self._await_taken(order, now)

    def _await_taken(self, order: Order, now: Snapshot) -> None:
        """Answered when the tick has the way."""
        self._facts = {}
        self._arming = (order.number, now.accepted, time.monotonic() + ARM_S)

    # -- the planner's turns

    def _turn(self) -> None:
        now, planner = self._end.snapshot(), self._end.planner
        before = planner.marks
        lead_s = planner.lead_s
        sent = planner.work(now)
        if sent or planner.marks != before:
            self._turns.append(Turn(now.tick, lead_s))
        self._end.flush()
        if self._arming is not None:
            self._see_armed(now)
        self._tell(self._news(now))

    def _see_armed(self, now: Snapshot) -> None:
        assert self._arming is not None
        number, before, give_up_s = self._arming
        error = self._end.planner.error
        if now.accepted > before:
            self._answer(Answer(number, self._facts))
        elif error is not None and self._end.planner.finished:
            self._answer(Answer(number, error=("bad", str(error))))
        elif time.monotonic() > give_up_s:
            sentence = "The tick does not take the program; enable the drives and ask again."
            self._answer(Answer(number, error=("refused", sentence)))
        else:
            return
        self._arming = None

    def _news(self, now: Snapshot) -> News:
        planner = self._end.planner
        refusal = str(planner.error) if planner.error is not None and _stands(now, planner.finished) else ""
        return News(planner.finished, planner.finished_path, refusal, self._tool)

    def _tell(self, news: News) -> None:
        """What is new, and nothing twice."""
        fresh = self._end.planner.fresh
        if news == self._told and not self._turns and not fresh:
            return
        self._told = news
        ways = {name: _way(stretch) for name, stretch in fresh.items()}
        self._parent.send(replace(news, ways=ways, turns=tuple(self._turns)))
        self._turns.clear()
        fresh.clear()


def _program(order: Order) -> Program:
    if order.program is None:
        raise SessionError("There is no program to be run; load one.")
    return order.program


def _way(stretch: Stretch) -> Way:
    length_mm, part = getattr(stretch.motion, "length_mm", 0.0), getattr(stretch.motion, "part", None)
    return Way(stretch.end, stretch.feed_mm_s, length_mm, part, stretch.name)


def _stands(now: Snapshot, finished: bool) -> bool:
    """Whether a program that is refused on the way has been run up to there."""
    return finished and now.at_rest and now.plan_time_s >= now.queue_end_s
