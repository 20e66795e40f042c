"""The plan of the service on a stepped machine, with a journal: killed, followed by another, gone on with."""

from __future__ import annotations

import itertools
import multiprocessing.connection as connections
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from support.machines.interrupted_runs import assert_rest_is_cut, distance, segments
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN, PieceMessage, Snapshot
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.plan.planner import Planner
from controller.plan.restart.program_position import Spot
from controller.plan.segment import PathItem
from controller.runtime.bench import probe
from controller.runtime.plan_messages import Answer, News, Order, Program
from controller.runtime.planning import Planning
from controller.runtime.stepped import SteppedMachine
from controller.service import journal
from controller.service.journal import Entry, Journal
from controller.state.modes import Mode, Request
from controller.store.service_store import ServiceStore

SAME = 1e-6  # mm or rad
PERIOD_S = 0.004
LONGEST = 20_000  # ticks
FITTED = {"offsets": {"G55": [0.0, 0.0, 0.0]}}  # where the machine file has none


class Bench:
    """A stepped machine whose plan is that of the service."""

    def __init__(
        self,
        folder: Path,
        machine: Machine | None = None,
        lateness: Callable[[int], float] | None = None,
        around: probe.Bench | None = None,
    ) -> None:
        """``lateness`` as the stepped clock takes it; ``around``: what the spindle cuts."""
        machine = machine or shipped(period_s=PERIOD_S)
        self.fitted: dict[str, Any] = dict(FITTED) if "G55" in machine.unset else {}
        self.machine = setup_data.applied(machine, self.fitted)
        self._folder, self.before_message = folder, lambda: None
        self.stepped = SteppedMachine(self.machine, lateness=lateness, bench=around)
        self.stepped.come_up()
        self.stepped._plan = self._turn  # type: ignore[method-assign]
        self.alone, self.planner = False, self.stepped.planner
        self.news: list[News] = []
        self.answers: list[Answer] = []
        self.rows: list[np.ndarray] = []
        self.store = ServiceStore(folder)
        self.journal = Journal(self.store, self.stepped.clock.now_s)
        self._numbers = itertools.count(1)
        self.mend()

    def mend(self) -> None:
        """A plan that knows nothing yet."""
        self.dead = False
        self.parent, its = connections.Pipe()
        self.new_planner(self.machine)
        self.planning = Planning(self, self._folder, its, self.machine)  # type: ignore[arg-type]

    def kill(self) -> None:
        """It does nothing any more."""
        self.dead = True

    # -- what Planning needs of its end of the sockets

    def new_planner(self, machine: Machine) -> Planner:
        made = Planner(machine, self.stepped.kinematics, self._send)
        made.go_on_from(max(self.snapshot().accepted, self.snapshot().rejected))
        self.planner = self.stepped.planner = made
        return made

    def _send(self, message: PieceMessage) -> bool:
        if not message.is_keepalive:
            self.before_message()
        return self.stepped.outbox.send(message)

    def load(self, items: Iterable[PathItem], now: Snapshot) -> None:
        self.planner.load(items, now.queue_end_s, now.epoch)

    def snapshot(self) -> Snapshot:
        found = self.stepped.board.read()
        assert found is not None
        return found

    def flush(self) -> None:
        pass

    # -- what the service does

    def _turn(self) -> None:
        self.journal.look(self.snapshot(), self.stepped.recorder.last)
        if self.dead:
            return
        self.planning.turn()
        self.planner.keepalive()
        while self.parent.poll():
            said = self.parent.recv()
            (self.answers if isinstance(said, Answer) else self.news).append(said)

    def order(self, verb: str, **more: Any) -> Answer:
        number = next(self._numbers)
        self.planning.carry_out(Order(number, verb, **more))
        answered = lambda: bool(self.answers) and self.answers[-1].number == number  # noqa: E731
        self._turn()
        self.go(answered)
        assert answered()
        return self.answers[-1]

    def go(self, done: Callable[[], bool]) -> None:
        self.rows.append(self.stepped.go(LONGEST, done))
        assert done(), self.stepped.fault_text

    def request(self, request: Request) -> None:
        self.stepped.request(request)
        self.rows.append(self.stepped.go(10))

    def until(self, mode: Mode) -> None:
        modes, follow = self.stepped.cycle.modes, self.stepped.cycle.follow
        self.go(lambda: modes.mode is mode and follow.at_rest)
        self.rows.append(self.stepped.go(20))

    def until_line(self, line: int) -> None:
        self.go(lambda: self.stepped.cycle.follow.line >= line)
        self.rows.append(self.stepped.go(100))

    def program_rows(self) -> np.ndarray:
        rows = np.concatenate(self.rows)
        return rows[rows[:, COLUMN["motion_id"]] >= 0.0]

    def assert_cut(self, text: str, machine: Machine, spot: Spot, first: int = 0) -> None:
        rows = np.concatenate(self.rows[first:])
        wanted = segments(text, machine)
        assert distance(rows, wanted, self.stepped.kinematics) < SAME
        assert_rest_is_cut(rows, wanted, spot)

    # -- a run

    def armed(self, text: str, in_spindle: int = 2, **more: Any) -> Answer:
        """Planned from where the machine stands, and started; the programs here are cut by T2."""
        program = Program(text.encode(), "part.ngc", self.machine, in_spindle=in_spindle, **more)
        answer = self.order("arm", program=program)
        assert answer.error is None, answer.error
        start = answer.facts["start"]
        whole_from = start.joints if start.spot is None else start.whole_from
        job = journal.Job.of("part.ngc", program.text, self.machine, whole_from, program.dry_run_mm)
        self.journal.begin(job, spot=program.spot)
        self.request(Request.START)
        return answer

    def offered(self, text: str) -> Entry:
        """What the journal offers to go on with."""
        entry = journal.read(self.store)
        assert entry is not None
        now, job = self.snapshot(), entry.job
        same = journal.Job.of("part.ngc", text.encode(), self.machine, job.start, job.dry_run_mm)
        assert journal.refusal(entry, same, now.homed, now.untrusted, 5) is None
        return entry

    def recover(self) -> None:
        """Reset and enabled after a fault that has cost no position."""
        self.request(Request.RESET)
        self.until(Mode.OFF)
        self.request(Request.ENABLE)
        self.until(Mode.READY)
