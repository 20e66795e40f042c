"""The program that is loaded, the one that runs, from arming to its end, and what the run changes.

Whoever looks on and the plan's thread both have their say in it: ``lock`` is of the job that runs and of its
record. What it sets of offsets and tools is changed under the lock of ``SetUp``, which is taken first.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from controller.ipc.control_socket import Values
from controller.ipc.handoff import Snapshot
from controller.machine.changes import Change
from controller.messages import Message, facts, message
from controller.program import modal
from controller.program.modal import State
from controller.runtime.plan_messages import News, Program
from controller.runtime.starts import Start
from controller.service.contour_guard import ContourGuard
from controller.service.job_status import ended_early
from controller.service.jobs import Job, bars_the_next, journalled, whole_from
from controller.service.journal import Entry
from controller.service.modal_state import ModalState
from controller.service.owners import Owners
from controller.service.run_recorder import RunRecorder

NOT_STARTED = "not_started"  # result of a run that was being prepared, and moved nothing
GIVEN_UP = ("stopped", "given_up")  # keys of why a start went no further


class LastRun(NamedTuple):
    """The run under way, or the last; whoever started it waits for its end by its id.

    ``result``: None while it is under way, else as of a record; ``said``: why it ended early.
    """

    id: str  # the name of its record
    program: str
    result: str | None = None
    line: int | None = None
    said: Message | None = None

    def to_json(self) -> Values:
        return {"id": self.id, "program": self.program, "result": self.result, "line": self.line} | facts(
            self.said
        )


class JobRun:
    """One at a time; what it leaves in force is what the next begins with."""

    def __init__(self, service: Owners, recorder: RunRecorder, interrupted: Entry | None) -> None:
        """``interrupted``: by the end of a service before this one."""
        self._service, self.recorder = service, recorder
        self.loaded: Job | None = None
        self.job: Job | None = None  # that one, or an MDI line, from start to end
        self.interrupted = interrupted  # until a program is loaded
        self.ended_early: Message | None = (
            None  # of the last run, until somebody has seen it or another begins
        )
        self.last: LastRun | None = None  # that under way, or the last; of this service
        self.modal = ModalState(service.set_up.machine)
        self._contour = ContourGuard(service.alarms, service.engine)
        self.lock = threading.RLock()  # the door's thread never takes it

    # -- what is

    @property
    def aside(self) -> bool:
        """Whether the tool stands off the path of a held program."""
        return self.job is not None and self.job.news.aside

    @property
    def returning(self) -> bool:
        """Whether the tool is on its way back to the path, as far as the plan has seen it."""
        return self.job is not None and self.job.news.returning

    @property
    def no_resume(self) -> str:
        """Why a held program cannot go on from where the tool is, as the refusal's key; "" where it can."""
        if self.aside:
            return "aside"
        job = self.job
        return "other_tools" if job is not None and job.tools != self._service.set_up.machine.tools else ""

    def in_force(self, now: Snapshot) -> State:
        """The modal state: of the motion under way, else as the last block or line has left it."""
        job, set_up = self.job, self._service.set_up
        way = job.motions.under_way(now.motion_id) if job is not None and job.active else None
        if way is not None:
            return way.state_at(now.s)
        if job is not None and job.taken:
            return self.modal.left
        return self.modal.at(now, set_up.machine, set_up.tool)

    def begins_with(self, job: Job, now: Snapshot) -> State | None:
        """The modal state in which a job begins; None: that of power-on."""
        set_up = self._service.set_up
        return self.modal.begin_of(job, now, set_up.machine, set_up.tool)

    # -- from load to end

    def load(self, job: Job | None) -> None:
        """Another program instead of the one that is loaded, or none."""
        self.loaded, self.interrupted = job, None

    def seen(self) -> None:
        """Somebody has read how the last run ended."""
        self.ended_early = None

    def arm(self, job: Job) -> None:
        """What the plan reports from now on is of this job."""
        service, engine = self._service, self._service.engine
        with self.lock:
            now = engine.snapshot()
            machine = service.set_up.machine
            job.arm(now.tick if now is not None else -1, machine.tools, self.modal.left)
            self.job, self.ended_early = job, None
            self._contour.begin(machine)
            if service.changer is not None:
                service.changer.arm()
            self.last = LastRun(self.recorder.begin(job, machine, engine, now), job.program.name)

    def begin(self, job: Job, facts: dict[str, Any], now: Snapshot) -> None:
        """The start goes out next."""
        service = self._service
        with self.lock:
            start: Start = facts["start"]
            job.begin(facts, service.durations, now)
            self.modal.see(start.begin or modal.begun(job.program.machine))
            if not job.is_mdi:
                set_up = service.set_up
                service.journal.begin(journalled(job, set_up.machine), set_up.tool, job.program.spot)
            self.recorder.started(start, job)
            self.job = job

    def not_started(self, job: Job, why: Message) -> None:
        """It is as it was loaded, and what it was to run with is in force no more.

        Where the operator would not have it started, nothing is to be put right before the next start.
        """
        with self.lock:
            job.become("loaded", None if why["key"] in GIVEN_UP else why)
            if self.job is job:
                self.job = None
                if job.state_before is not None:
                    self.modal.see(job.state_before)
            if self.last is not None and self.last.result is None:
                self.last = self.last._replace(result=NOT_STARTED, said=why)
            record = self.recorder.release()
        if record is not None:
            record.throw_away()

    def end(self, result: str, why: Message | None = None) -> None:
        """Nothing where none runs."""
        service, set_up = self._service, self._service.set_up
        with self.lock:
            job = self.job
            if job is None:
                return
            self.modal.end(job, result, set_up.machine)
            self.ended_early = early = ended_early(job, result, why)
            if service.changer is not None:
                service.changer.ended()
                self.change_tool(service.changer.whereabouts.spindle)
            elif job.news.tool is not None and (result == "completed" or job.news.tool != set_up.tool):
                set_up.put_in(job.news.tool if result == "completed" else 0)  # it may be in the hand
            self.job = None
            if self.last is not None:
                line = job.last.line if job.last is not None else None
                self.last = self.last._replace(result=result, line=line, said=early)
            self.recorder.end(result, job.duration_s, why or early, self._contour.end())
            service.usage.ended(result == "completed" and not job.is_mdi)
            service.troubles.run_over()
            # Last of all: who hears that it has ended may do at once what a run forbids.
            job.become(result, why or bars_the_next(job, result))
        service.writer.submit(service.durations.save)

    # -- what the plan and the tick say of it

    def hear(self, news: News) -> None:
        """From the plan's thread."""
        service = self._service
        with self.lock:
            job = self.job or self.loaded
            if job is not None:
                job.hear(news)
                self._contour.hear(news.ways, service.set_up.machine)
            if service.changer is not None:
                service.changer.hear(news.marks)
            if news.touches:
                service.probed.touch(news.touches, service.set_up.machine)
                service.writer.submit(service.probed.save_touches)
            if news.turns and not (job is not None and job.lost):
                self.recorder.planned(news.turns, self._fitted(job))

    def _fitted(self, job: Job | None) -> dict[str, Any]:
        """What a job was started with, and the tools that the operator has changed since."""
        set_up = self._service.set_up
        return set_up.fitted if job is None else set_up.with_tools(job.fitted, job.tools)

    def take_rows(self, now: Snapshot) -> None:
        """The rows of the newest ticks: of the run, of its record, and of what wears."""
        engine, set_up, usage = self._service.engine, self._service.set_up, self._service.usage
        if engine.recorder is None:
            return
        with self.lock:
            rows = engine.recorder.drain()
            fed = self.job.take_rows(rows, set_up.machine.period_s) if self.job is not None else ()
            usage.take(rows, set_up.tool, now.spindle_actual_rev_min != 0.0, fed)
            for key, values in usage.due():
                self._service.alarms.add(key.upper(), message(key, **values))
            self._contour.take(rows, set_up.machine, now)
            self.recorder.take(rows, engine, engine.snapshot())

    def lose_plan(self) -> None:
        """Nobody knows the rest of the path any more."""
        if self.job is not None:
            self.job.lose_plan()

    # -- what it changes

    def refitted(self) -> Program | None:
        """The held program with the tools that were fitted meanwhile; None where they are the same."""
        job, set_up = self.job, self._service.set_up
        if job is None or job.tools == set_up.machine.tools:
            return None
        program = replace(job.program, machine=set_up.applied(self._fitted(job)))
        return program if job.start is None else replace(program, start=whole_from(job.start))

    def refit(self, program: Program) -> None:
        """Other tools were fitted while it was held; the rest of it is as they cut it."""
        with self.lock:
            job, machine = self.job, self._service.set_up.machine
            if job is None:
                return
            job.fit(replace(job.program, machine=program.machine), self._fitted(job))
            job.take_tools(machine.tools)
            if not job.is_mdi:
                self._service.journal.go_on_as(journalled(job, machine))

    def lay(self, job: Job, changes: Sequence[Change], now: Snapshot) -> None:
        """What it has set by now is so from now on, for whatever comes after it; found, too."""
        service, set_up = self._service, self._service.set_up
        if service.changer is not None and (tool := job.announced.take_named()) is not None:
            service.changer.beside.name(tool)
        if found := job.announced.take_found():
            service.probed.add(job.program.name, found)
            self.recorder.find(found)
            service.writer.submit(service.probed.save)
        if not changes:
            return
        with set_up.lock:
            fitted = set_up.laid(changes)
            if fitted is None:
                return
            if not job.is_mdi:
                service.journal.fitted(fitted.machine, now)
            with self.lock:
                job.take_tools(fitted.machine.tools)
                set_up.take(fitted)
            set_up.keep()

    def change_tool(self, tool: int) -> None:
        """That one is in the spindle by now; 0: none, or nobody knows."""
        if tool != self._service.set_up.tool:
            self._service.set_up.put_in(tool)
            self._service.journal.in_spindle(tool)
