"""The plan's process of the service: carries out orders, and keeps the tick's queue full meanwhile.

It owns SDO and the planner. Nothing that a machine needs lives here alone: killed, it is
started anew by its parent, finds the tick where it stands, and waits for orders.
"""

from __future__ import annotations

import multiprocessing.connection as connections
import select
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.messages import message, of_error, text
from controller.plan import waits
from controller.plan.foresight import Foresight, twice
from controller.plan.off_path import Back
from controller.plan.restart.path_offset import beside
from controller.plan.restart.program_position import FORMER, Spot
from controller.plan.restart.reentry import NotPossible, WayOnto
from controller.plan.restart.restart import Rest
from controller.program.program import ProgramError
from controller.runtime import children, cores, starts
from controller.runtime.plan_end import EXPECTED, PLAN_TURN_S, REST_TURN_S, PlanEnd
from controller.runtime.plan_messages import Answer, Awaited, News, Order, Program, Turn
from controller.runtime.plan_news import Foreseen, PathNotes, Reporter
from controller.runtime.program_checks import UNCHECKED, ProgramChecks, figures_of, start_of
from controller.runtime.startup import SessionError
from controller.state.modes import Mode


@dataclass(frozen=True, slots=True)
class PlanJob:
    """What the process is given: descriptors of its ends of sockets, and paths."""

    machine: Any  # Machine, with the channels of its hubs
    pieces: int
    requests: int
    orders: int
    snapshot_path: str
    checks: Path  # folder of checks of programs
    arranged: Path  # of how the drives were found


class GivenUp(Exception):
    """The operator does not want it any more: a check, or a start that is still being prepared."""


def main(job: PlanJob) -> None:
    """The plan's process, until its parent ends it. Raises what ``plan_end.EXPECTED`` lists."""
    cores.leave()
    end = PlanEnd(job.machine, job.pieces, job.requests, job.snapshot_path, job.arranged)
    Planning(end, job.checks, connections.Connection(job.orders), job.machine).run()


class Planning:
    """Orders in, answers and news out; between them the planner's turns."""

    def __init__(self, end: PlanEnd, folder: Path, parent: connections.Connection, machine: Machine) -> None:
        """``folder``: of stored checks; ``parent``: where orders come from."""
        self._end, self._parent = end, parent
        self._asked = select.poll()  # a connection of its own makes a selector with every look
        self._asked.register(parent.fileno(), select.POLLIN)
        self._reporter, self._foreseen, self._notes = Reporter(parent), Foreseen(), PathNotes(machine)
        self._checks = ProgramChecks(
            end,
            folder,
            self._look,
            lambda block: self._notes.hear(block),
            lambda share: self._reporter.report_progress(share, end.planner, self._notes),
        )
        self._awaited: Awaited | None = None
        self._facts: dict[str, Any] = {}  # of what is being armed
        self._fitted = machine  # of what was armed
        self._armed: Program | None = None
        self._left: Program | None = None  # that did not come to its end, as it was run last
        self._carrying_out = False
        self._verbs = {
            "commission": self._commission,
            "home": self._home,
            "terminals": lambda order: {"word": self._end.start_up.terminals(order.axes[0])},
            "check": lambda order: self._checks.check(_program(order)),
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
            self._parent.send(Answer(order.number, error=("bad", error.placed)))
        except GivenUp:
            self._parent.send(Answer(order.number, error=("refused", message("given_up", verb=order.verb))))
        except NotPossible as error:
            self._parent.send(Answer(order.number, error=("refused", error.said)))
        except EXPECTED as error:
            self._parent.send(Answer(order.number, error=("refused", of_error(error))))
        except Exception as error:
            self._parent.send(Answer(order.number, error=("busy", children.own_error("plan", error))))
        else:
            if facts is not None:
                self._parent.send(Answer(order.number, facts))
        finally:
            self._carrying_out = False

    def _commission(self, _: Order) -> dict[str, Any]:
        for warning in self._end.start_up.commission():
            print(text(warning), file=sys.stderr, flush=True)
        return {}

    def _home(self, order: Order) -> dict[str, Any]:
        self._end.start_up.home(order.axes, self._look)
        return {}

    def _drop(self, _: Order) -> dict[str, Any]:
        self._end.planner.drop()
        self._foreseen.drop()
        return {}

    def _look(self) -> None:
        """Nothing is ordered while an order is under way, but to give it up."""
        if self._carrying_out and self._asked.poll(0):
            self._parent.recv()
            raise GivenUp

    def _arm(self, order: Order) -> None:
        """From where the machine stands; answered when the first piece has been taken."""
        program = _program(order)
        kept, task = None if program.unchecked else self._checks.stored(program), self._checks.task(program)
        now = self._end.snapshot()
        start = start_of(program, now)
        self._notes = PathNotes(program.machine)
        task = replace(task, in_force=self._notes.in_force)
        rev_min = start.begin.modal.spindle_rev_min if start.begin is not None else 0.0
        path = starts.path_from(task, kept, start, self._cut_with(program)).items
        items, once_more = twice(waits.laid(path, program.machine, rev_min))
        self._end.new_planner(program.machine)
        self._fitted, self._armed = program.machine, program
        self._end.load(self._notes.watched(items, program.spot), now)
        track = self._end.planner.ahead.track
        self._foreseen.begin(Foresight(track, once_more, program.machine, task.kinematics))
        self._reporter.begin()
        known = UNCHECKED if kept is None else figures_of(kept)
        self._facts = {name: known[name] for name in ("duration_s", "blocks", "marks", "events")}
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

    def _beside(self, order: Order) -> dict[str, Any]:
        """How far off the path the drives came to rest by themselves."""
        program, now = _program(order), self._end.snapshot()
        rest = self._checks.rest(program, self._checks.stored(program))
        off = beside(rest, now.actual, kinematics_of(program.machine))
        return {"said": message("beside", **asdict(off)) if off is not None else None}

    def _retract(self, order: Order) -> None:
        """Off along the tool axis; with ``program``, another tool was fitted meanwhile."""
        now = self._end.snapshot()
        if order.program is not None:
            task = self._checks.task(order.program)
            fitted = starts.back(task, order.tool).fitted
            WayOnto(task.machine, task.kinematics, fitted).see_free(now.joints, 0.0)
        self._reporter.note(Turn(now.tick, order.distance_mm, "retract"))
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
            back = starts.back(self._checks.task(replace(self._armed, machine=self._fitted)), order.tool)
        else:
            back = Back()
        now = self._end.snapshot()
        self._reporter.note(Turn(now.tick, float(order.tool), "return", refitted))
        planner.go_back(now, back)
        if order.program is not None:
            self._fitted = order.program.machine
        self._await_taken(order, now)

    def _with_other_tool(self, program: Program, spot: Spot) -> Rest:
        """The rest as the new tool cuts it."""
        program = replace(program, spot=Spot(spot.line, spot.fraction, FORMER))
        kept = self._checks.stored(program)
        rest = self._checks.rest(program, kept, self._notes.note_modal_anew())
        return replace(rest, items=self._notes.lines_noted(rest.items, rest.spot.fraction))

    def _await_taken(self, order: Order, now: Snapshot) -> None:
        """Answered when the tick has the way."""
        self._facts = {}
        self._awaited = Awaited.of(order, now)

    # -- the planner's turns

    def turn(self) -> bool:
        """The planner acts on the newest snapshot, and what is new is told; True: there is nothing to do."""
        now, planner = self._end.snapshot(), self._end.planner
        before, turn = planner.marks, Turn(now.tick, planner.lead_s)
        self._end.before_message = lambda: self._reporter.report_turn(turn)
        sent = planner.work(now)
        if not sent and planner.marks != before:
            self._reporter.note(turn)
        self._end.flush()
        if self._awaited is not None:
            self._see_taken(self._awaited, now)
        news = self._news(now)
        if not sent:
            news = replace(news, timetable=self._foreseen.look(planner, now))
        self._reporter.report(news, planner, self._notes)
        return planner.finished and self._awaited is None and now.mode in (Mode.OFF, Mode.READY)

    def _see_taken(self, awaited: Awaited, now: Snapshot) -> None:
        error, why = self._end.planner.error, awaited.in_vain(now)
        if awaited.taken(now):
            self._parent.send(Answer(awaited.order, self._facts))
        elif error is not None and self._end.planner.finished:
            self._parent.send(Answer(awaited.order, error=("bad", error.placed)))
        elif why is not None:
            self._parent.send(Answer(awaited.order, error=why))
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
        left = self._notes.in_force.last if planner.finished else None
        return News(planner.finished, left, whole, refusal, self._notes.tool, stands_aside, returning)


def _program(order: Order) -> Program:
    if order.program is None:
        raise SessionError(message("startup.no_program"))
    return order.program


def _stands(now: Snapshot, finished: bool) -> bool:
    """Whether a program that is refused on the way has been run up to there."""
    return finished and now.at_rest and now.plan_time_s >= now.queue_end_s
