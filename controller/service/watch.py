"""What is concluded from the newest snapshot: alarms, recordings, the journal, how programs end."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.messages import message
from controller.plan.restart.program_position import ENTRY_ID
from controller.service import alarms, journal
from controller.service.job_run import JobRun
from controller.service.jobs import Job
from controller.service.owners import Owners
from controller.service.watchdog import STANDS_S, LastSecond
from controller.state.modes import Mode, Request

POLL_S = 0.02
ROWS_S = 0.2  # from one look at the tick's rows to the next, where no run is recorded


class Watch:
    """Looks some fifty times a second, by the main thread."""

    def __init__(self, service: Owners, run: JobRun) -> None:
        self._service, self._run = service, run
        self.last_second = LastSecond()
        self._rows_s = 0.0  # when the tick's rows were looked at
        self._asked_tool: int | None = None  # that a program waited for at the last look ...
        self._asked_line = 0  # ... and on which line
        self._stance: tuple[object, ...] = ()  # for which it is known how long a start would take

    def look(self) -> Snapshot | None:
        """Draw conclusions from the newest snapshot."""
        service, lock, engine = self._service, self._run.lock, self._service.engine
        if not lock.acquire(timeout=POLL_S):  # a tick is being started: that takes long
            return engine.snapshot()
        try:  # a tick that is gone is followed by another only when all of it was reported
            now = engine.snapshot()  # not before: what is concluded would be of a tick that is gone
            if now is None:
                return None
            self._see_deaths(now)
            if self._run.job is not None or time.monotonic() - self._rows_s >= ROWS_S:
                self._look_at_rows(now)
        finally:
            lock.release()
        if engine.tick_alive:
            if service.changer is not None and (
                self._run.job is not None or service.changer.beside.under_way
            ):
                service.changer.look(now)
                self._run.change_tool(service.changer.whereabouts.spindle)
            self._feel_pulse(now)
            self.last_second.look(self._queue_left_s(now))
            service.troubles.look(now)
            service.thread.look(now, self._run.job.program.name if self._run.job is not None else "")
        self._write_journal(now)
        self._look_at_job(now)
        self._see_moved(now)
        return now

    @contextmanager
    def between_ticks(self) -> Iterator[None]:
        """While the block puts another tick in the place of the last, of which all is reported before."""
        with self._run.lock:
            if (last := self._service.engine.snapshot()) is not None:
                self._see_deaths(last)  # nobody may have drawn conclusions yet
            yield

    # -- the processes

    def _see_deaths(self, now: Snapshot) -> None:
        died = self._service.processes.died()
        if died == "tick":
            self._tick_gone(now)
        elif died == "plan":
            self._plan_gone(now)

    def _tick_gone(self, now: Snapshot) -> None:
        service = self._service
        why = service.troubles.tick_gone(now, service.engine.last_words())
        service.journal.lost(now)
        self._look_at_rows(now)
        self._run.end("fault", why)

    def _plan_gone(self, now: Snapshot) -> None:
        service = self._service
        self._ask(Request.PLAN_LOST)  # its socket stays open, and the next plan is heard soon
        runs = self._run.job is not None and now.mode in (Mode.RUNNING, Mode.HOLD, Mode.JOG)
        service.troubles.planner_gone(now, service.engine.last_words(), runs)
        self._run.lose_plan()
        service.sequencer.later(service.processes.mend)

    def _ask(self, request: Request) -> None:
        with contextlib.suppress(CommandRefused):
            self._service.engine.request(request)

    def _feel_pulse(self, now: Snapshot) -> None:
        """A tick that stands is reported once, as soon as it is seen."""
        if self._service.processes.pulse.stands_now(now.tick):
            stands = message("tick_stands", seconds=STANDS_S)
            self._service.alarms.add("TICK_STANDS", stands, **alarms.where(now))

    def _queue_left_s(self, now: Snapshot) -> float | None:
        """Of a program that moves, and of which the plan has more to send; None otherwise."""
        job = self._run.job
        more = job is not None and job.taken and not job.news.finished
        moves = now.mode is Mode.RUNNING and not (now.at_rest or now.stopping)
        return now.queue_end_s - now.plan_time_s if more and moves else None

    def _look_at_rows(self, now: Snapshot) -> None:
        self._rows_s = time.monotonic()
        self._run.take_rows(now)

    # -- the program

    def _see_moved(self, now: Snapshot) -> None:
        """What is loaded takes another time from another place, with another tool or override."""
        service, job = self._service, self._run.loaded
        rests = now.mode is Mode.READY and now.at_rest and self._run.job is None
        if job is None or job.state != "loaded" or not rests or service.sequencer.busy:
            return
        stance = id(job), now.joints, service.set_up.tool, now.override, now.rapid_override
        known, self._stance = self._stance, stance
        if known[:1] == stance[:1] and known != stance:
            service.sequencer.later(lambda: self._look_ahead(job))

    def _look_ahead(self, job: Job) -> None:
        """How long a start of what is loaded would take as the machine stands by now."""
        program = replace(job.program, in_spindle=self._service.set_up.tool)
        with contextlib.suppress(CommandRefused):  # a start says why
            here = self._service.engine.line.order("check", program=program)["timetable"]
            with self._run.lock:
                if job.state == "loaded":
                    job.time.stands(here)

    def _write_journal(self, now: Snapshot) -> None:
        """Once a second and at every standstill; a line typed by hand is no part of a program."""
        service, job, recorder = self._service, self._run.job, self._service.engine.recorder
        tools = service.changer.tools if service.changer is not None else None
        service.journal.see_change(tools, now.line)
        if recorder is not None and service.engine.tick_alive and not (job is not None and job.is_mdi):
            service.journal.look(now, recorder.last, job.known if job is not None else journal.unknown)

    def _look_at_job(self, now: Snapshot) -> None:
        service, run = self._service, self._run
        job, record = run.job, run.recorder.record
        if job is None or record is None or not service.engine.tick_alive:
            return
        if now.tick < job.armed_tick:
            return  # it took long to report a fault, and meanwhile somebody has begun anew
        if now.mode is Mode.FAULT:
            if now.at_rest or now.stopping is False:
                run.lay(job, job.announced.say(now), now)
                run.end("fault", service.troubles.message)
        elif now.mode in (Mode.RUNNING, Mode.HOLD, Mode.STOPPING, Mode.JOG):
            job.follow(now)
            if (way := job.motions.ways.get(now.motion_id)) is not None and now.motion_id < ENTRY_ID:
                run.modal.see(way.state_at(now.s))
            run.lay(job, job.announced.say(now), now)
            self._see_tool(now, job)
            self._see_refused(now, job)
            self._see_lost(now, job)
        elif record.began and now.tick > record.last_tick - 1:
            run.lay(job, job.announced.say(now, ended=not record.stopped and not job.refused), now)
            whole = job.news.whole and not record.stopped and not job.refused
            if whole and not job.is_mdi:
                service.journal.completed(now)
            run.end("completed" if whole else "refused" if job.refused else "stopped", job.said)

    def _see_tool(self, now: Snapshot, job: Job) -> None:
        """The one in the spindle: the program goes on from where it asked for it, or moves with it."""
        if self._service.changer is not None:
            return
        way, asked = job.motions.ways.get(now.motion_id), job.awaited_tool(now, self._service.set_up.tool)
        put_in = self._asked_tool if now.mode is Mode.RUNNING else None
        if put_in is not None:
            job.announced.put_in(put_in, self._asked_line)
        tool = put_in or (way.tool if way is not None and asked is None else None)
        self._asked_tool, self._asked_line = asked, now.line
        if tool is not None:
            self._run.change_tool(tool)

    def _see_lost(self, now: Snapshot, job: Job) -> None:
        """A program whose plan is gone does not go on: where it moves the tick stops it by itself.

        Where it stands, held or off the path, that is the same fault.
        """
        if job.lost and now.at_rest and now.mode in (Mode.RUNNING, Mode.HOLD):
            self._ask(Request.PLAN_LOST)

    def _see_refused(self, now: Snapshot, job: Job) -> None:
        """A block was refused on the way: the tool stands before it, and the program ends there."""
        if now.mode is Mode.RUNNING and job.news.refusal and now.at_rest and not job.refused:
            self._service.alarms.add("PROGRAM", job.refuse_rest(job.news.refusal), **alarms.where(now))
            self._ask(Request.STOP)
