"""The service's plan on a stepped machine, and the record of its runs, as the service keeps it."""

from __future__ import annotations

import copy
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from support.machines.planning_bench import FITTED, Bench

from controller.ipc.handoff import Jog, send_jog
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.runtime.plan_messages import Answer, Program
from controller.service.engine import SentRequest
from controller.service.runs import RunRecord
from controller.state.modes import Mode, Request


class RecordedBench(Bench):
    """``record`` is that of the run under way, or of the last one."""

    record: RunRecord

    def __init__(self, folder: Path, *more: Any) -> None:
        self.asked: deque[SentRequest] = deque()
        self._is_on, self._heard = False, 0
        super().__init__(folder, *more)
        self._rows = copy.copy(self.stepped.recorder)  # with its own place in the ring
        self._state = folder / "state"

    # -- a run

    def armed(self, text: str, in_spindle: int = 2, **more: Any) -> Answer:
        """Planned; nothing is started yet."""
        self._rows.drain()
        self.asked.clear()
        self.record, self._is_on = RunRecord(self._state, self.machine, {"name": "part.ngc"}), True
        self.text = text
        program = Program(text.encode(), "part.ngc", self.machine, in_spindle=in_spindle, **more)
        answer = self.order("arm", program=program)
        assert answer.error is None, answer.error
        self.start = answer.facts["start"]
        self.record.begins(self.start, program, self.fitted)
        return answer

    def started(self, text: str, **more: Any) -> None:
        self.armed(text, **more)
        self.request(Request.START)

    def ended(self, result: str = "completed") -> Path:
        """The folder of the record."""
        self.rows.append(self.stepped.go(5))
        self._look()
        self._is_on = False
        self.record.end(result)
        return self.record.folder

    def request(self, request: Request, value: float = 0.0) -> None:
        self.asked.append(SentRequest(request, value, None, self.stepped.request(request, value)))
        self.rows.append(self.stepped.go(10))

    def jog(self, line: Jog) -> None:
        number = next(self.stepped._numbers)
        self.asked.append(SentRequest(Request.JOG, 0.0, line, number))
        send_jog(self.stepped._operator, line, number)
        self.rows.append(self.stepped.go(10))

    def jogged_to_rest(self, line: Jog) -> None:
        self.jog(line)
        self.until(Mode.HOLD)

    def led(self, verb: str, **more: Any) -> None:
        answer = self.order(verb, **more)
        assert answer.error is None, answer.error
        self.request(Request.RESUME)
        self.until(Mode.HOLD)

    def held(self, line: int) -> None:
        self.until_line(line)
        self.request(Request.HOLD)
        self.until(Mode.HOLD)

    def refitted(self, **tool: Any) -> Program:
        """The program with another tool 2, which is fitted from now on."""
        base = setup_data.applied(_built(self.machine), FITTED)
        values = {"name": "another", "radius_mm": 1.5, "flute_mm": 15.0, "length_mm": 0.0, **tool}
        made = setup_data.with_tool(base, 2, values)
        self.fitted = {**FITTED, "tools": {"2": values}}
        return Program(self.text.encode(), "part.ngc", made, start=self.start.joints)

    # -- what the service does

    def _turn(self) -> None:
        super()._turn()
        self._look()

    def _look(self) -> None:
        if self._is_on:
            for news in self.news[self._heard :]:
                self.record.planned(news.turns, self.fitted)
            self.record.take(self._rows.drain(), self.asked, self.snapshot())
        self._heard = len(self.news)


def _built(machine: Machine) -> Machine:
    from support.machines.stepped_runs import shipped

    return shipped()


def sent(folder: Path) -> np.ndarray:
    """Setpoints of a record."""
    from controller.state.setpoints import SETPOINTS

    found = SETPOINTS.read(folder)
    assert found is not None
    return found
