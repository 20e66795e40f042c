"""Programs on a stepped machine with the service's plan, changer and time: what was told to be left, and was.

told = TimedRun(folder, machine("shop")).run(text)      rows of (ticks since the start, Left)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from support.machines.planning_bench import Bench
from support.machines.stored_tools import StoredTools

from controller.machine.model import Machine
from controller.plan.restart.program_position import Spot
from controller.runtime.plan_messages import Answer, Program
from controller.service.durations import Durations
from controller.service.job_status import _left
from controller.service.jobs import Job, settles_s
from controller.service.time_left import Left
from controller.service.tool_changer import ToolChanger
from controller.state.modes import Mode, Request
from controller.store.tool_store import placed

LOOK_TICKS = 2
MOST_TICKS = 20_000


class Timed(NamedTuple):
    """What was told of a run."""

    loaded: Left  # before it
    rows: list[tuple[float, Left]]  # seconds since the start, and what was told then
    took_s: float
    stops_s: list[float]  # since the start, at which the program stopped
    changes_s: list[float]  # likewise: at which a change began
    job: Job


class TimedRun(Bench):
    """One machine, on which programs are run one after another."""

    def __init__(self, folder: Path, machine: Machine) -> None:
        self.durations = Durations({})
        self.tool_store: StoredTools | None = None
        self.changer: ToolChanger | None = None
        super().__init__(folder, machine)
        if machine.changer is not None:
            self.tool_store = StoredTools(folder)
            self.tool_store.confirm(placed(machine.changer.pockets, 1, ()))
            self.changer = ToolChanger(
                self.tool_store,
                lambda: self.machine.changer,  # type: ignore[arg-type, return-value]
                self.stepped,  # type: ignore[arg-type]
                lambda name, what: None,
                machine.period_s,
                lambda tool: None,
                machine.io,
            )

    def _hear(self, job: Job) -> None:
        for news in self.news:
            job.hear(news)
            if self.changer is not None:
                self.changer.hear(news.marks)
        self.news.clear()

    def _program(self, text: str, spot: Spot | None) -> Program:
        tool = self.tool_store.spindle or 0 if self.tool_store is not None else 1
        return Program(text.encode(), "part.ngc", self.machine, spot, in_spindle=tool)

    def loaded(self, text: str, spot: Spot | None = None) -> Job:
        """As the service loads it."""
        program = self._program(text, spot)
        job = Job(program, "")
        job.checked(self._answered("check", program), self.durations)
        return job

    def _answered(self, verb: str, program: Program) -> dict[str, Any]:
        self.answers.clear()
        answer: Answer = self.order(verb, program=program)
        assert answer.error is None, answer.error
        return answer.facts

    def run(
        self,
        text: str,
        spot: Spot | None = None,
        overrides: Mapping[float, float] | None = None,
        optional: bool = False,
        waits_s: Sequence[float] = (0.1,),
    ) -> Timed:
        """``overrides``: at so many seconds from the start on; ``optional``: M1 stops; ``waits_s``: what the
        operator takes at each stop, in turn."""
        stepped, period_s = self.stepped, self.machine.period_s
        stepped.request(Request.OPTIONAL_STOP, float(optional))
        stepped.go(5)
        job = self.loaded(text, spot)
        loaded = _left(job, self.snapshot())
        if self.changer is not None:
            self.changer.arm()
        self.news.clear()
        facts = self._answered("arm", job.program)
        job.arm(self.snapshot().tick)
        job.origin_s = facts["start"].plan_time_s
        job.time.starts(job.origin_s, settles_s(job, self.snapshot()))
        self._hear(job)
        stepped.recorder.drain()
        stepped.request(Request.START)
        rows, stops_s, changes_s = list[tuple[float, Left]](), list[float](), list[float]()
        first, asked = stepped.cycle.tick, sorted((overrides or {}).items())
        waiting = iter(waits_s)
        resumes = -1
        while stepped.cycle.tick - first < MOST_TICKS:
            at_s = (stepped.cycle.tick - first) * period_s
            while asked and asked[0][0] <= at_s:
                stepped.request(Request.OVERRIDE, asked.pop(0)[1])
            job.time.take(stepped.go(LOOK_TICKS), period_s)
            self._hear(job)
            now = self.snapshot()
            at_s = (now.tick - first) * period_s
            if now.mode is Mode.READY and now.at_rest and rows:
                break
            job.taken, job.state = True, "running"
            job.follow(now)
            job.motions.under_way(now.motion_id)
            before = self.changer.under_way if self.changer is not None else False
            if self.changer is not None:
                self.changer.look(now)
                if self.changer.under_way and not before:
                    changes_s.append(at_s)
            if now.mode is Mode.HOLD and now.at_rest and (self.changer is None or not self.changer.under_way):
                if now.motion_id == -1 and resumes < 0:
                    stops_s.append(at_s)
                    resumes = now.tick + round(next(waiting, 0.1) / period_s)
                elif 0 <= resumes <= now.tick:
                    stepped.request(Request.RESUME)
            elif now.mode is Mode.RUNNING:
                resumes = -1
            rows.append((at_s, _left(job, now)))
        assert self.stepped.cycle.modes.mode is Mode.READY, self.stepped.fault_text
        if self.changer is not None:
            self.changer.ended()
        return Timed(loaded, rows, at_s, stops_s, changes_s, job)
