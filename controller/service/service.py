"""The service: everything of one machine that outlives a client, a program, the plan and the tick.

Three threads use it: the door's (``Desk``), the sequencer's (what takes long) and the main
one, which looks at the newest snapshot some fifty times a second (``look``) and draws
conclusions: faults to alarms and recordings, rows to run records, ends of programs.
The door's thread takes no lock of these, so that a hold waits for no disk.
"""

from __future__ import annotations

import contextlib
import sqlite3
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller import messages
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, Snapshot
from controller.machine import machine_file, setup_data, tool_store
from controller.machine.changes import Change, laid
from controller.machine.model import Changer, Machine
from controller.machine.toml_table import ConfigError
from controller.machine.tool_store import ToolStore
from controller.messages import Said, of_error, said, several
from controller.plan.restart.program_position import ENTRY_ID
from controller.program import modal
from controller.program.modal import State
from controller.runtime.bus_load import overload
from controller.runtime.listener import Listener
from controller.runtime.recording import Keeper
from controller.runtime.starts import Start
from controller.runtime.startup import SessionError
from controller.service import alarms as alarm_values
from controller.service import jobs, journal, kept_file, runs
from controller.service.alarms import Alarms
from controller.service.durations import Durations
from controller.service.engine import Engine
from controller.service.fault_reporter import Troubles
from controller.service.folders import Folders
from controller.service.jobs import Job
from controller.service.journal import Journal
from controller.service.last_run import LastRun
from controller.service.modal_state import ModalState
from controller.service.node_status import LastFrames
from controller.service.planner_client import News, Program
from controller.service.probed import Probed
from controller.service.refusals import refused
from controller.service.runs import Rows, RunRecord
from controller.service.sequencer import Sequencer
from controller.service.thread_guard import ThreadGuard
from controller.service.tool_changer import ToolChanger
from controller.service.usage import Usage
from controller.service.watchdog import STANDS_S, LastSecond, Pulse
from controller.state.modes import Mode, Recovery, Request
from drives.bus import BusError

JOURNAL = "journal.json"
NOT_STARTED = "not_started"  # result of a run that was being prepared, and moved nothing
POLL_S = 0.02
ROWS_S = 0.2  # from one look at the tick's rows to the next, where no run is recorded
WAIT_S = 0.004
FIRST_TICK_S = 30.0
USAGE_S = 0.5  # without a record, between two looks whether counters are to be saved
SYNC_S = 0.05  # a loss of power costs so much of a record, and what the disk itself takes


class Service:
    """Owns the processes and all that is kept; its folders must be writable."""

    def __init__(self, machine: Machine, kept: Folders) -> None:
        """Raises SessionError, ConfigError, OSError."""
        if sentence := overload(machine):
            raise SessionError(sentence)
        kept.make()
        self._kept, self.state = kept, kept.state
        state = kept.state
        self.fitted: dict[str, Any] = setup_data.load(state)
        self.file = machine  # as its builder wrote it
        setup_data.note(state, machine)
        self.machine = setup_data.applied(machine, self.fitted)  # as programs see it
        self.alarms = Alarms(state)
        self.usage = Usage(state, machine)
        self.probed = Probed(state)
        self.durations = Durations(state)
        self.thread = ThreadGuard(state)
        self.sequencer = Sequencer(self._failed)
        self.job: Job | None = None  # the loaded program
        self.running: Job | None = None  # it, or an MDI line, from start to end
        self.ended_early: Said | None = None  # of the last run, until somebody has seen it or another begins
        self.last_run: LastRun | None = None
        self.record: RunRecord | None = None
        self._told_of_record: RunRecord | None = None  # whose disk is full
        self.unrecorded: Said | None = None  # why the run, or the last one, has no whole record
        self.commissioned = False
        self.homing: tuple[int, ...] = ()  # axes that were asked to, while they do
        self._asked_tool: int | None = None  # that a program waited for at the last look ...
        self._asked_line = 0  # ... and on which line
        self.tool = setup_data.in_spindle(state)  # number of the one in the spindle; 0 = not known
        self.modal = ModalState(self.machine)
        self.lock = threading.RLock()  # of jobs and records; the door's thread never takes it
        self.fitting = threading.Lock()  # of what is fitted and what begins with it; taken before ``lock``
        self._records = ThreadPoolExecutor(1, "records")  # writes what runs leave behind
        self._over = threading.Event()
        self._recording = threading.Event()  # a record has begun, or all is over
        threading.Thread(target=self._sync_records, name="sync", daemon=True).start()
        self.journal = Journal(state / JOURNAL)
        entry, why = journal.read(state / JOURNAL)
        unread = None if why is None else kept_file.put_aside(state / JOURNAL, messages.text(why))
        for damaged in (
            self.alarms.damaged,
            self.usage.damaged,
            self.probed.damaged,
            self.durations.damaged,
            unread,
        ):
            if damaged is not None:
                self.alarms.add(kept_file.ALARM, damaged)
        self.journal.last = entry
        self.interrupted = entry if entry is not None and not entry.ended else None  # until another is loaded
        self._folder = tempfile.TemporaryDirectory(prefix="directrix-")
        self.engine = Engine(machine, Path(self._folder.name), kept, self._hear)
        self.changer = self._with_changer(state)
        self._listener: Listener | None = None
        self.troubles = Troubles(self.machine, self.alarms, self._records)
        self.pulse, self.last_second = Pulse(), LastSecond()
        self._tick_died = self._plan_died = False
        self._rows_s = 0.0  # when the tick's rows were looked at

    # -- beginning and end

    def _with_changer(self, state: Path) -> ToolChanger | None:
        """Where the machine has one: which tool is in the spindle, its store says."""
        if self.machine.changer is None:
            return None
        store = ToolStore(state / tool_store.FILE)
        add, machine = self.alarms.add, self.machine
        made = ToolChanger(store, self._changer, self.engine, add, machine.period_s, self._worn, machine.io)
        self.tool = _in_spindle(made)
        return made

    def _changer(self) -> Changer:
        """As its pockets are now."""
        changer = self.machine.changer
        assert changer is not None
        return changer

    def power_up(self) -> None:
        """Tick and plan, then the drives' settings. A drive that does not answer is an alarm, and no end.

        Raises SessionError where there is no tick.
        """
        try:
            self.sequencer.to_its_end("power up", self._power_up)
        except CommandRefused as error:
            if not self.engine.tick_alive:
                raise SessionError(error.sentence) from error

    def _power_up(self) -> dict[str, Any]:
        runs.lose(self.state)  # the door is open: no other service works here
        self.start_engine()
        self.commission()
        return {}

    def start_engine(self) -> None:
        """Tick and plan, from nothing. Called by the sequencer's thread alone. Raises CommandRefused."""
        self.commissioned = False
        self.engine.tell_tool(self.tool)
        with self.lock:
            last = self.engine.snapshot()
            if last is not None:
                self._look_at_processes(last)  # of the tick's death nobody may have drawn conclusions yet
            self._close_listener()
            self.engine.start()
            self._tick_died = self._plan_died = False
            self.troubles.begin()
            self.pulse.begin()
        self.wait_for(lambda now: now.tick >= 0, FIRST_TICK_S, "first_tick")
        try:
            self._listener = Listener(machine_file.bus_settings(self.engine.machine), LastFrames)
        except BusError as error:
            raise CommandRefused("gone", str(error)) from error
        recorder = self.engine.recorder
        if recorder is not None:
            logs = self._listener.logs
            self.troubles.keeper = Keeper(self.machine, recorder, logs, self._kept.recordings)

    def _close_listener(self) -> None:
        listener, self._listener, self.troubles.keeper = self._listener, None, None
        if listener is not None:
            listener.close()

    def close(self) -> None:
        """Stop on the path, drives off, brakes first; then everything else."""
        self.engine.end_run()
        self.sequencer.wait()
        self._over.set()
        self._recording.set()
        self._end_job(jobs.INTERRUPTED, said("service_ended"))
        self._records.shutdown(wait=True)
        self._save_usage(at_once=True)
        self._close_listener()
        self.engine.end()
        if self.changer is not None:
            self.changer.store.close()
        self._folder.cleanup()

    # -- what verbs and sequences need

    def fault_at(self, now: Snapshot | None, alive: bool = True) -> dict[str, Any] | None:
        """The fault as it is shown; ``alive``: the tick is."""
        if now is not None and alive and self.stands(now):
            return self._of_hung(now)
        return self.troubles.shown if now is None or now.tick < 0 else self.troubles.at(now, alive)

    def stands(self, now: Snapshot) -> bool:
        """Whether the tick's process is there and does not tick: of the machine nothing is known any more."""
        return now.tick >= 0 and self.pulse.age_s(now.tick) >= STANDS_S

    def _of_hung(self, now: Snapshot) -> dict[str, Any]:
        """As ``alarms.of`` has a fault."""
        return {
            "name": "TICK_STANDS",
            "axis": None,
            **said("tick_stands", seconds=self.pulse.age_s(now.tick)),
            "cause": said("cause.TICK_STANDS"),
            "remedy": said("remedy.TICK_STANDS"),
            "recovery": Recovery.RESTART.name.lower(),
            "position_trusted": False,
            "recording": None,
        }

    @property
    def aside(self) -> bool:
        """Whether the tool stands off the path of a held program."""
        return self.running is not None and self.running.news.aside

    @property
    def returning(self) -> bool:
        """Whether the tool is on its way back to the path, as far as the plan has seen it."""
        return self.running is not None and self.running.news.returning

    @property
    def no_resume(self) -> str:
        """Why a held program cannot go on from where the tool is, as the refusal's key; "" where it can."""
        if self.aside:
            return "aside"
        job = self.running
        if job is not None and job.tools != self.machine.tools:
            return "other_tools"
        return ""

    @property
    def logs(self) -> dict[str, Any]:
        listener = self._listener
        return dict(listener.logs) if listener is not None else {}

    def now(self) -> Snapshot:
        """The newest snapshot. Raises CommandRefused where there is no tick."""
        found = self.engine.snapshot()
        if found is None or not self.engine.tick_alive:
            raise refused("no_tick", "OFF", code="gone")
        return found

    def wait_for(self, done: Callable[[Snapshot], bool], longest_s: float, what: str) -> Snapshot:
        """The first snapshot that is ``done``; ``what`` is a key of the refusals.

        Raises CommandRefused on a dead tick, or when time is over.
        """
        give_up_s = time.monotonic() + longest_s
        while True:
            now = self.engine.snapshot()
            if now is not None and done(now):
                return now
            if not self.engine.tick_alive:
                words = self.engine.last_words()
                raise CommandRefused("gone", words) if words else refused("no_tick", code="gone")
            if time.monotonic() > give_up_s:
                mode = now.mode.name if now is not None else ""
                raise refused("waited", mode, seconds=longest_s, what=messages.Key(what))
            time.sleep(WAIT_S)

    def commission(self) -> None:
        """Write and read back every drive's settings. Raises CommandRefused."""
        self.engine.line.order("commission")
        self.commissioned = True

    def fit(self, machine: Machine, values: dict[str, Any]) -> None:
        """Other offsets or tools from now on. Raises CommandRefused."""
        try:
            setup_data.save(self.state, values)
        except OSError as error:
            raise refused("not_written", code="busy", path=self.state, why=error.strerror) from error
        with self.lock:
            self.fitted, self.machine = values, machine

    # -- jobs

    def begin(self, job: Job, facts: dict[str, Any]) -> None:
        """The start goes out next."""
        with self.lock:
            start: Start = facts["start"]
            job.blocks, job.time.durations = facts["blocks"], self.durations
            job.time.check(facts["duration_s"], facts["marks"], facts["events"])
            job.time.starts(start.plan_time_s)
            job.origin_s, job.said = start.plan_time_s, None
            job.start = start
            self.modal.see(start.begin or modal.begun(job.program.machine))
            if not job.is_mdi:
                self.journal.begin(job.journalled(self.machine), self.tool, job.program.spot)
            if self.record is not None:
                self.record.begins(start, job.program, job.fitted)
            self.running = job

    @property
    def tool_numbers(self) -> list[int]:
        """Of the tool table as it is now."""
        return [tool.number for tool in self.machine.tools]

    def in_force(self, now: Snapshot) -> State:
        """The modal state: of the motion under way, else as the last block or line has left it."""
        job = self.running
        way = job.way(now.motion_id) if job is not None and job.active else None
        if way is not None:
            return way.state
        if job is not None and job.taken:
            return self.modal.left
        return self.modal.at(now, self.machine, self.tool)

    def begins_with(self, job: Job, now: Snapshot) -> State | None:
        """The modal state in which a job begins; None: that of power-on."""
        return self.modal.begin_of(job, now, self.machine, self.tool)

    def with_tools(self, job: Job) -> dict[str, Any]:
        """What the program was started with, and the tools that the operator has changed since."""
        theirs = {str(tool.number) for tool in set(job.tools) ^ set(self.machine.tools)}
        tools = {key: row for key, row in self.fitted.get("tools", {}).items() if key in theirs}
        return {**job.fitted, "tools": {**job.fitted.get("tools", {}), **tools}} if tools else job.fitted

    def refit(self, job: Job, program: Program) -> None:
        """Other tools were fitted while the program was held; the rest of it is as they cut it."""
        with self.lock:
            job.fitted, job.tools = self.with_tools(job), self.machine.tools
            job.program = replace(job.program, machine=program.machine)
            if not job.is_mdi:
                self.journal.go_on_as(job.journalled(self.machine))

    def _hear(self, news: News) -> None:
        """From the plan's thread."""
        with self.lock:
            job = self.running or self.job
            if job is not None:
                job.hear(news)
            if self.changer is not None:
                self.changer.hear(news.marks)
            if news.touches:
                self.probed.touch(news.touches, self.machine)
                self._records.submit(self.probed.save_touches)
            if self.record is not None and news.turns and not (job is not None and job.lost):
                self.record.planned(news.turns, self.with_tools(job) if job is not None else self.fitted)

    def arming(self, job: Job) -> None:
        """What the plan tells from now on is of this job."""
        with self.lock:
            now = self.engine.snapshot()
            job.arm(now.tick if now is not None else -1)
            job.state_before = self.modal.left
            job.tools = self.machine.tools
            self.running, self.ended_early = job, None
            if self.changer is not None:
                self.changer.arm()
            if (recorder := self.engine.recorder) is not None:
                recorder.drain()
            asked = self.engine.asked
            while asked and now is not None and now.has_taken(asked[0].number):
                asked.popleft()  # before this run
            self.record, self.unrecorded = RunRecord(self.state, self.machine, job.told()), None
            self.last_run = LastRun(self.record.folder.name, job.program.name)
            self._recording.set()
            self._tell_of_record(self.record)

    def _tell_of_record(self, record: RunRecord) -> None:
        """Once: nothing of a run is kept, or no more of it than until now."""
        if not record.problem or record is self._told_of_record:
            return
        self._told_of_record = record
        name, key = str(record.what.get("name", "")), "record_ended" if record.began else "not_recorded"
        self.unrecorded = said(key, program=name, why=record.problem)
        self.alarms.add("NOT_RECORDED", self.unrecorded)

    def not_started(self, job: Job, why: Said) -> None:
        with self.lock:
            job.state, job.said = "loaded", why
            if self.running is job:
                self.running = None
                if job.state_before is not None:
                    self.modal.see(job.state_before)
            if self.last_run is not None and self.last_run.result is None:
                self.last_run = self.last_run._replace(result=NOT_STARTED, said=why)
            record, self.record = self.record, None
        if record is not None:
            record.throw_away()

    def _end_job(self, result: str, why: Said | None = None) -> None:
        with self.lock:
            job, record = self.running, self.record
            if job is None:
                return
            self.modal.end(job, result, self.machine)
            self.ended_early = early = job.ended_early(result, why)
            if self.changer is not None:
                self.changer.ended()
                self._see_changer(self.changer)
            elif job.news.tool is not None and (result == "completed" or job.news.tool != self.tool):
                self._put_in(job.news.tool if result == "completed" else 0)  # it may be in the hand
            self.running = self.record = None
            self.usage.ended(result == "completed" and not job.is_mdi)
            self.troubles.run_over()
            if self.last_run is not None:
                line = job.last.line if job.last is not None else None
                self.last_run = self.last_run._replace(result=result, line=line, said=early)
            # Last of all: who is told that it has ended may do at once what a run forbids.
            job.state, job.said = result, why
        self._records.submit(self.durations.save)
        if record is not None:
            self._records.submit(record.end, result, planned_s=job.duration_s, **messages.facts(why or early))

    def _sync_records(self) -> None:
        """Nobody waits for the disk but this thread."""
        while not self._over.is_set():
            if self.record is None:
                self._recording.wait(USAGE_S)
                self._recording.clear()
            elif not self._over.wait(SYNC_S) and (record := self.record) is not None:
                record.sync()
            if not self._over.is_set():
                self._save_usage()

    def _save_usage(self, at_once: bool = False) -> None:
        """Counters that cannot be kept are kept later."""
        with contextlib.suppress(OSError):
            self.usage.save(at_once)

    # -- looking on

    def look(self) -> Snapshot | None:
        """Draw conclusions from the newest snapshot; called often by the main thread."""
        if not self.lock.acquire(timeout=POLL_S):  # a tick is being started: that takes long
            return self.engine.snapshot()
        try:  # a tick that is gone is followed by another only when all of it was told
            now = self.engine.snapshot()  # not before: what is concluded would be of a tick that is gone
            if now is None:
                return None
            self._look_at_processes(now)
            if self.running is not None or time.monotonic() - self._rows_s >= ROWS_S:
                self._look_at_rows(now)
        finally:
            self.lock.release()
        if self.engine.tick_alive:
            if self.changer is not None and (self.running is not None or self.changer.beside.under_way):
                self.changer.look(now)
                self._see_changer(self.changer)
            self._feel_pulse(now)
            self.last_second.look(self._queue_left_s(now))
            self.troubles.look(now)
            self.thread.look(now, self.running.program.name if self.running is not None else "")
        self._write_journal(now)
        self._look_at_job(now)
        return now

    def _feel_pulse(self, now: Snapshot) -> None:
        """A tick that stands is told once, as soon as it is seen."""
        if self.pulse.stands_now(now.tick):
            stands = said("tick_stands", seconds=STANDS_S)
            self.alarms.add("TICK_STANDS", stands, **alarm_values.where(now))

    def _queue_left_s(self, now: Snapshot) -> float | None:
        """Of a program that moves, and of which the plan has more to send; None otherwise."""
        job = self.running
        more = job is not None and job.taken and not job.news.finished
        moves = now.mode is Mode.RUNNING and not (now.at_rest or now.stopping)
        return now.queue_end_s - now.plan_time_s if more and moves else None

    def _write_journal(self, now: Snapshot) -> None:
        """Once a second and at every standstill; a line typed by hand is no part of a program."""
        job, recorder = self.running, self.engine.recorder
        tools = self.changer.tools if self.changer is not None else None
        before = self.journal.change
        self.journal.change = None if tools is None else (*tools, before[2] if before else now.line)
        if recorder is not None and self.engine.tick_alive and not (job is not None and job.is_mdi):
            self.journal.look(now, recorder.last, job.known if job is not None else journal.unknown)

    def _look_at_processes(self, now: Snapshot) -> None:
        if not self.engine.tick_alive:
            if not self._tick_died:
                self._tick_died = True
                self._tick_gone(now)
        elif not self.engine.plan_alive and not self._plan_died:
            self._plan_died = True
            with contextlib.suppress(
                CommandRefused
            ):  # its socket stays open, and the next plan is heard soon
                self.engine.request(Request.PLAN_LOST)
            runs = self.running is not None and now.mode in (Mode.RUNNING, Mode.HOLD, Mode.JOG)
            self.troubles.planner_gone(now, self.engine.last_words(), runs)
            if self.running is not None:
                self.running.lost = True  # nobody knows the rest of its path any more
            self.sequencer.later(self._mend)

    def _mend(self) -> None:
        """A new plan; the tick, the drives and where they are stay as they were."""
        with contextlib.suppress(OSError, CommandRefused):
            self.engine.mend()
        self._plan_died = False

    def _tick_gone(self, now: Snapshot) -> None:
        why = self.troubles.tick_gone(now, self.engine.last_words())
        self.journal.lost(now)
        self._look_at_rows(now)
        self._end_job("fault", why)

    def _look_at_rows(self, now: Snapshot) -> None:
        recorder = self.engine.recorder
        self._rows_s = time.monotonic()
        if recorder is None:
            return
        with self.lock:
            rows, fed = recorder.drain(), set[int]()
            if self.running is not None:
                under_way = rows[:, COLUMN["mode"]] != Mode.READY
                motions = rows[under_way, COLUMN["motion_id"]].astype(int).tolist()
                self.running.pass_rows(motions)
                self.running.time.take(rows, self.machine.period_s)
                fed = self.running.fed_in(set(motions))
            self._count(rows, now.spindle_actual_rev_min != 0.0, fed)
            if self.record is not None:
                self.record.take(rows, self.engine.asked, self.engine.snapshot())
                self._tell_of_record(self.record)

    def _count(self, rows: Rows, turning: bool, fed: Collection[int]) -> None:
        """Travel, hours, the cut of the tool in the spindle; what has come to its end is an alarm, once."""
        self.usage.take(rows, self.tool, turning, fed)
        for key, values in self.usage.due():
            self.alarms.add(key.upper(), said(key, **values))

    def _look_at_job(self, now: Snapshot) -> None:
        job, record = self.running, self.record
        if job is None or record is None or not self.engine.tick_alive:
            return
        if now.tick < job.armed_tick:
            return  # it took long to tell a fault, and meanwhile somebody has begun anew
        if now.mode is Mode.FAULT:
            if now.at_rest or now.stopping is False:
                self._set(job, job.say(now), now)
                self._end_job("fault", self.troubles.said)
        elif now.mode in (Mode.RUNNING, Mode.HOLD, Mode.STOPPING, Mode.JOG):
            job.state = job.state_at(now) if job.taken else job.state
            job.pass_time(now)
            if (way := job.ways.get(now.motion_id)) is not None and now.motion_id < ENTRY_ID:
                self.modal.see(way.state)
            self._set(job, job.say(now), now)
            self._see_tool(now, job)
            self._see_refused(now, job)
            self._see_lost(now, job)
        elif record.began and now.tick > record.last_tick - 1:
            self._set(job, job.say(now, ended=not record.stopped and not job.refused), now)
            whole = job.news.whole and not record.stopped and not job.refused
            if whole and not job.is_mdi:
                self.journal.completed(now)
            self._end_job("completed" if whole else "refused" if job.refused else "stopped", job.said)

    def _set(self, job: Job, changes: list[Change], now: Snapshot) -> None:
        """What the program has set by now is so from now on, for whatever comes after it; found, too."""
        if self.changer is not None and job.next_tool is not None:
            self.changer.beside.name(job.next_tool)
            job.next_tool = None
        if job.found:
            self.probed.add(job.program.name, job.found)
            if self.record is not None:
                self.record.found += job.found
            job.found = []
            self._records.submit(self.probed.save)
        if not changes:
            return
        with self.fitting:
            values = laid(self.fitted, self.machine, changes)
            try:
                machine = setup_data.applied(self.file, values)
            except ConfigError as error:  # what the reader takes the table should, too
                self.alarms.add("NOT_KEPT", of_error(error))
                return
            if not job.is_mdi:
                self.journal.fitted(machine, now)
            with self.lock:
                job.tools = machine.tools
                self.fitted, self.machine = values, machine
            try:
                setup_data.save(self.state, values)
            except OSError as error:
                self._not_written("NOT_KEPT", error)

    def _not_written(self, what: str, error: OSError) -> None:
        self.alarms.add(what, said("not_written", path=self.state, why=error.strerror))

    def _see_tool(self, now: Snapshot, job: Job) -> None:
        """The one in the spindle: the program goes on from where it asked for it, or moves with it."""
        if self.changer is not None:
            return
        way, asked = job.ways.get(now.motion_id), job.asked_tool(now, self.tool)
        put_in = self._asked_tool if now.mode is Mode.RUNNING else None
        if put_in is not None:
            job.put_in(put_in, self._asked_line)
        tool = put_in or (way.tool if way is not None and asked is None else None)
        self._asked_tool, self._asked_line = asked, now.line
        if tool is not None and tool != self.tool:
            self._put_in(tool)
            self.journal.in_spindle(tool)

    def _worn(self, tool: int) -> Said | None:
        """What is told before a tool comes whose life is over; None of any other."""
        return self.usage.said_worn("change_worn", tool, self.tool_numbers)

    def _see_changer(self, changer: ToolChanger) -> None:
        """As its store has it."""
        tool = _in_spindle(changer)
        if tool != self.tool:
            self._put_in(tool)
            self.journal.in_spindle(tool)

    def confirm_tools(self, places: Mapping[int, int]) -> None:
        """An operator has looked where every tool is. Raises CommandRefused."""
        assert self.changer is not None
        try:
            self.changer.store.confirm(places)
        except sqlite3.Error as error:
            raise refused("not_written", code="busy", path=self.state, why=str(error)) from error
        self._see_changer(self.changer)

    def _put_in(self, tool: int) -> None:
        self.tool = tool
        self.engine.tell_tool(tool)
        try:
            setup_data.put_in(self.state, tool)
        except OSError as error:
            self._not_written("TOOL", error)

    def _see_lost(self, now: Snapshot, job: Job) -> None:
        """A program whose plan is gone does not go on: where it moves the tick stops it by itself.

        Where it stands, held or off the path, that is the same fault.
        """
        if job.lost and now.at_rest and now.mode in (Mode.RUNNING, Mode.HOLD):
            with contextlib.suppress(CommandRefused):
                self.engine.request(Request.PLAN_LOST)

    def _see_refused(self, now: Snapshot, job: Job) -> None:
        """A block was refused on the way: the tool stands before it, and the program ends there."""
        if now.mode is Mode.RUNNING and job.news.refusal and now.at_rest and not job.refused:
            job.refused = True
            job.said = several(job.news.refusal or "", said("stands_before"))
            self.alarms.add("PROGRAM", job.said, **alarm_values.where(now))
            with contextlib.suppress(CommandRefused):
                self.engine.request(Request.STOP)

    def _failed(self, name: str, error: CommandRefused) -> None:
        """Work that came to nothing after its answer may have gone out already."""
        if error.code != "busy" and name in ("power up", "home", "enable", "reset"):
            self.alarms.add(f"{name} failed".upper().replace(" ", "_"), error.said)


def _in_spindle(changer: ToolChanger) -> int:
    """Number of the tool; 0 = none, or nobody knows."""
    return 0 if changer.unsure else changer.store.spindle or 0
