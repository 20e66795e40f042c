"""A service without processes: its tick keeps to the table of modes, and its plan answers as it is told.

service = served(folder)           # homed and enabled
engine = engine_of(service)
engine.answers["arm"] = ...        # a function that is called while the plan has the order
CommandHandlers(service)("hold", {})
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN, ROW, Jog, Snapshot, blank
from controller.machine.model import Machine
from controller.runtime.plan_messages import News
from controller.runtime.starts import Start
from controller.service.command_handlers import CommandHandlers
from controller.service.folders import Folders
from controller.service.jobs import homed_position
from controller.service.service import Service
from controller.state.modes import ALL_AXES, ALWAYS, TRANSITIONS, Fault, Mode, Request
from controller.state.requests import Outcome, answer

HANGS_S = 60.0  # no test is meant to come near
Plan = Callable[..., dict[str, Any]]
CHECKED = {
    **{"duration_s": 1.0, "blocks": 2, "notes": [], "restart": [], "verdict": None},
    **{"marks": (), "events": (), "timetable": None, "passed_s": 0.0},
}


class FakeEngine:
    """Tick and plan; every look at the snapshot is a tick."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.tick_alive = self.plan_alive = True
        self.inverter = None
        self.recorder: FakeRecorder | None = None
        self.pids: dict[str, int] = {}
        self.requests: list[Request] = []  # as they came to the tick
        self.taken: list[Request] = []  # those of them that its table took
        self.orders: list[str] = []
        self.number = 0  # of the last request
        self.asked: deque[object] = deque()
        self.answers: dict[str, Plan] = {"arm": self._arm, "check": lambda **_: dict(CHECKED)}
        self.answers["beside"] = lambda **_: {"said": None}
        self.given_up = 0
        self.short = self.ran = False  # what is started is over before anybody looks; it has run
        self.aside = False  # a resume leads along a way beside the path, which ends at once
        self.jogged: list[Jog] = []
        self.jog_ends_mm = math.inf  # after which something ends it
        self.before_request: Callable[[Request], None] = lambda _: None
        joints = homed_position(machine)
        more = {"joints": joints, "actual": joints, "override": 1.0, "rapid_override": 1.0}
        self.now: Snapshot = blank()._replace(mode=Mode.READY, homed=ALL_AXES, at_rest=True, **more)  # type: ignore[arg-type]

    # -- as Engine

    def tell_tool(self, number: int) -> None: ...

    @property
    def line(self) -> FakeEngine:
        return self

    def snapshot(self) -> Snapshot:
        self.now = self.now._replace(tick=self.now.tick + 1)
        return self.now

    def request(self, request: Request, value: float = 0.0) -> int:
        self.before_request(request)
        self.requests.append(request)
        if request is Request.PLAN_LOST and self.now.mode in (Mode.RUNNING, Mode.HOLD):
            self.now = self.now._replace(mode=Mode.FAULT, fault=Fault.PLANNER_GONE, fault_axis=-1)
        after = TRANSITIONS.get((self.now.mode, request))
        if after is not None:
            self.taken.append(request)
            self.now = self.now._replace(mode=Mode.READY if after is Mode.STOPPING else after)
            self.ran |= request is Request.START
            if request is Request.START and self.short:
                self.now = self.now._replace(mode=Mode.READY)
            if request is Request.RESUME and self.aside:
                self.now = self.now._replace(mode=Mode.HOLD)
            if request is Request.STOP:
                self.now = self.now._replace(queue_end_s=self.now.plan_time_s)
        refuses = after is None and request not in ALWAYS
        return self._answer(Outcome.REFUSED if refuses else Outcome.DONE)

    def _answer(self, came: Outcome) -> int:
        self.number += 1
        ring = (*self.now.answers[1:], answer(self.number, came))
        self.now = self.now._replace(answers=ring)
        return self.number

    def jog(self, line: Jog) -> int:
        """A line with a length: it stands at its end at the next look."""
        self.jogged.append(line)
        length = min(line.length, self.jog_ends_mm)
        joints = tuple([q + length * d for q, d in zip(self.now.joints, line.direction, strict=True)])
        self.now = self.now._replace(joints=joints, actual=joints)
        return self._answer(Outcome.DONE)

    def mend(self) -> None:
        """Another plan is there at once."""
        self.plan_alive = True

    def last_words(self) -> str:
        return ""

    def end_run(self) -> None:
        self.tick_alive = False

    def end_tick(self) -> None:
        self.tick_alive = False

    def end(self) -> None:
        self.end_run()

    # -- as Line

    def order(self, verb: str, *args: Any, **more: Any) -> dict[str, Any]:
        self.orders.append(verb)
        return self.answers.get(verb, lambda **_: {})(**more)

    def give_up(self) -> None:
        self.given_up += 1

    def _arm(self, program: Any, **_: Any) -> dict[str, Any]:
        start = Start(self.now.joints, self.now.plan_time_s, program.spot, program.start)
        return {"start": start, "duration_s": 1.0, "blocks": 1, "marks": (), "events": ()}


class FakeRecorder:
    """Rows of the ticks, each with what the snapshot showed then."""

    def __init__(self, engine: FakeEngine) -> None:
        self._engine = engine
        self.rows = 100

    def drain(self) -> np.ndarray:
        return self.last(1)

    def last(self, _: int) -> np.ndarray:
        row = np.zeros((1, len(ROW)))
        row[0, COLUMN["tick"]], row[0, COLUMN["mode"]] = self._engine.now.tick, self._engine.now.mode
        row[0, COLUMN["sync_sent"]], row[0, COLUMN["rate"]] = 1.0, float(self._engine.ran)
        return row


def served(folder: Path, machine: Machine | None = None) -> Service:
    """A service whose machine is homed and enabled; nothing is loaded."""
    machine = machine or shipped()
    engine = FakeEngine(machine)
    engine.recorder = FakeRecorder(engine)
    service = Service(machine, Folders.within(folder / "state"), engine)  # type: ignore[arg-type]
    service.processes.commissioned = True
    return service


def engine_of(service: Service) -> FakeEngine:
    assert isinstance(service.engine, FakeEngine)
    return service.engine


def heard(service: Service, **news: Any) -> None:
    """The plan tells something."""
    service.run.hear(News(**news))


def done(desk: CommandHandlers, verb: str, **args: Any) -> dict[str, Any]:
    """What comes of a verb. Raises CommandRefused."""
    answer = desk(verb, args)
    return answer.result(HANGS_S) if isinstance(answer, Future) else answer
