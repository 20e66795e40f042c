"""The service: everything of one machine that outlives a client, a program, the plan and the tick.

Three threads use it: the door's (``Desk``), the sequencer's (what takes long) and the main
one, which looks at the newest snapshot some fifty times a second (``look``) and draws
conclusions: faults to alarms and recordings, rows to run records, ends of programs.
The door's thread takes no lock of these, so that a hold waits for no disk.
"""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller import config, fitting, journal
from controller.door import DoorError
from controller.handoff import Snapshot
from controller.journal import Journal
from controller.machine import Joints, Machine, five
from controller.service import alarms as alarm_values
from controller.service.alarms import Alarms
from controller.service.engine import Engine
from controller.service.hearing import LastFrames
from controller.service.jobs import Job
from controller.service.orders import News
from controller.service.runs import RunRecord
from controller.service.sequencer import Sequencer
from controller.session.bus_load import overload
from controller.session.listener import Listener
from controller.session.recording import Keeper
from controller.session.startup import SessionError
from controller.state import Fault, Mode, Request
from drives.bus import BusError

CHECKS = "checks"  # folders of the state folder
RECORDINGS = "recordings"
JOURNAL = "journal.json"
LOOK_S = 0.02
WAIT_S = 0.004
FIRST_TICK_S = 30.0


class Service:
    """Owns the processes and all that is kept; ``state`` is a folder that must be writable."""

    def __init__(self, machine: Machine, state: Path) -> None:
        """Raises SessionError, ConfigError, OSError."""
        if sentence := overload(machine):
            raise SessionError(sentence)
        self.state = state
        for name in (CHECKS, RECORDINGS):
            (state / name).mkdir(parents=True, exist_ok=True)
        self.fitted: dict[str, Any] = fitting.load(state)
        self.file = machine  # as its builder wrote it
        fitting.note(state, machine)
        self.machine = fitting.applied(machine, self.fitted)  # as programs see it
        self.alarms = Alarms(state)
        self.sequencer = Sequencer(self._failed)
        self.job: Job | None = None  # the loaded program
        self.running: Job | None = None  # it, or an MDI line, from start to end
        self.record: RunRecord | None = None
        self.commissioned = False
        self.tool = 1  # number of the one in the spindle, as far as it is known; 0 = not known
        self.stops = 0  # asked for so far: a start that was under way is given up
        self.fault: dict[str, Any] | None = None  # as shown
        self.lock = threading.RLock()  # of jobs and records; the door's thread never takes it
        self._records = ThreadPoolExecutor(1, "records")  # writes what runs leave behind
        self.journal = Journal(state / JOURNAL)
        self._folder = tempfile.TemporaryDirectory(prefix="directrix-")
        self.engine = Engine(machine, Path(self._folder.name), state / CHECKS, self._hear)
        self._listener: Listener | None = None
        self._keeper: Keeper | None = None
        self._last_fault = (Fault.NONE, Mode.OFF, 0)
        self._last_warning = Fault.NONE
        self._tick_died = self._plan_died = False
        self._fault_id = 0

    # -- beginning and end

    def power_up(self) -> None:
        """Tick and plan, then the drives' settings. A drive that does not answer is an alarm, and no end.

        Raises SessionError where there is no tick.
        """
        try:
            self.sequencer.do("power up", self._power_up).result()
        except DoorError as error:
            if not self.engine.tick_alive:
                raise SessionError(error.sentence) from error

    def _power_up(self) -> dict[str, Any]:
        self.start_engine()
        self.commission()
        return {}

    def start_engine(self) -> None:
        """Tick and plan, from nothing. Called by the sequencer's thread alone. Raises DoorError."""
        self.commissioned = False
        with self.lock:
            self._close_listener()
            self.engine.start()
            self._tick_died = self._plan_died = False
            self._last_fault = (Fault.NONE, Mode.OFF, 0)
        self.wait_for(lambda now: now.tick >= 0, FIRST_TICK_S, "the first tick")
        try:
            self._listener = Listener(config.bus_settings(self.engine.machine), LastFrames)
        except BusError as error:
            raise DoorError("gone", str(error)) from error
        recorder = self.engine.recorder
        if recorder is not None:
            self._keeper = Keeper(self.machine, recorder, self._listener.logs, self.state / RECORDINGS)

    def _close_listener(self) -> None:
        listener, self._listener, self._keeper = self._listener, None, None
        if listener is not None:
            listener.close()

    def close(self) -> None:
        """Stop on the path, drives off, brakes first; then everything else."""
        self.engine.end_run()
        self.sequencer.wait()
        self._end_job("interrupted", "The service was ended.")
        self._records.shutdown(wait=True)
        self._close_listener()
        self.engine.end()
        self._folder.cleanup()

    # -- what verbs and sequences need

    def fault_at(self, now: Snapshot) -> dict[str, Any] | None:
        """The fault as it is shown; of this very snapshot, though nobody has drawn conclusions yet."""
        known = self.fault
        if not self.engine.tick_alive:
            return known
        if now.fault is Fault.NONE:
            return None
        if known is not None and known["name"] == now.fault.name:
            return known
        return {**alarm_values.of(self.machine, now.fault, now.fault_axis, now.warning), "recording": None}

    @property
    def logs(self) -> dict[str, Any]:
        listener = self._listener
        return dict(listener.logs) if listener is not None else {}

    def now(self) -> Snapshot:
        """The newest snapshot. Raises DoorError where there is no tick."""
        found = self.engine.snapshot()
        if found is None or not self.engine.tick_alive:
            raise DoorError("gone", "The tick process is not running; ask for a reset.", "OFF")
        return found

    def wait_for(self, done: Callable[[Snapshot], bool], longest_s: float, what: str) -> Snapshot:
        """The first snapshot that is ``done``. Raises DoorError on a dead tick, or when time is over."""
        give_up_s = time.monotonic() + longest_s
        while True:
            now = self.engine.snapshot()
            if now is not None and done(now):
                return now
            if not self.engine.tick_alive:
                words = self.engine.last_words()
                raise DoorError("gone", words or "The tick process is gone; ask for a reset.")
            if time.monotonic() > give_up_s:
                mode = now.mode.name if now is not None else ""
                raise DoorError("refused", f"Waited {longest_s:.0f} s for {what} in vain.", mode)
            time.sleep(WAIT_S)

    def commission(self) -> None:
        """Write and read back every drive's settings. Raises DoorError."""
        self.engine.line.order("commission")
        self.commissioned = True

    def fit(self, machine: Machine, values: dict[str, Any]) -> None:
        """Other offsets or tools from now on. Raises DoorError."""
        try:
            fitting.save(self.state, values)
        except OSError as error:
            raise DoorError("busy", f"{self.state}: cannot be written: {error.strerror}.") from error
        with self.lock:
            self.fitted, self.machine = values, machine
            if self.job is not None and not self.job.active:
                self.job.program = replace(self.job.program, machine=machine)

    # -- jobs

    def begin(self, job: Job, facts: dict[str, Any]) -> None:
        """The start goes out with this."""
        with self.lock:
            job.duration_s, job.blocks = facts["duration_s"], facts["blocks"]
            job.origin_s, job.state, job.sentence = facts["plan_time_s"], "starting", ""
            if not job.is_mdi:
                self.journal.begin(self._journal_job(job), self.tool, job.program.spot)
            self.running = job
            self.engine.request(Request.START)

    def _journal_job(self, job: Job) -> journal.Job:
        """What is run, with where a whole run of it starts."""
        program, start = job.program, five(self.now().joints)
        if program.spot is not None:
            start = program.start or homed_position(program.machine)
        return journal.Job.of(program.name, program.text, program.machine, start, program.dry_run_mm)

    def gone_on_with(self, job: Job) -> Job:
        """The job from where the journal says that it was interrupted. Raises DoorError."""
        entry, why = journal.read(self.state / JOURNAL)
        now, program = self.now(), job.program
        if entry is not None:
            here = journal.Job.of(
                program.name, program.text, self.machine, entry.job.start, entry.job.dry_run_mm
            )
            why = journal.refusal(entry, here, now.homed, now.untrusted, len(self.machine.axes))
            spot, start, dry_run_mm = journal.spot_of(entry, here), entry.job.start, entry.job.dry_run_mm
            job.program = replace(program, spot=spot, start=start, dry_run_mm=dry_run_mm)
        if entry is None or why:
            why = why or journal.refusal(None, self._journal_job(job), 0, 0, 0)
            raise DoorError("refused", why, now.mode.name, "LOAD")
        return job

    def _hear(self, news: News) -> None:
        """From the plan's thread."""
        with self.lock:
            job = self.running or self.job
            if job is not None:
                job.hear(news)
            if self.record is not None and news.turns:
                self.record.planned(news.turns)

    def arming(self, job: Job) -> None:
        """What the plan tells from now on is of this job."""
        with self.lock:
            job.ways.clear()
            job.news = News(finished=False)
            self.running = job
            job.state = "starting"
            spot = job.program.spot
            what = {"name": job.program.name, "sha256": job.sha256, "line": spot.line if spot else None}
            recorder = self.engine.recorder
            with contextlib.suppress(OSError):
                if recorder is not None:
                    recorder.drain()
                self.record = RunRecord(self.state, self.machine, what)

    def not_started(self, job: Job, sentence: str) -> None:
        with self.lock:
            job.state, job.sentence = "loaded", sentence
            if self.running is job:
                self.running = None
            record, self.record = self.record, None
        if record is not None:
            record.throw_away()

    def _end_job(self, result: str, sentence: str = "") -> None:
        with self.lock:
            job, record = self.running, self.record
            if job is None:
                return
            job.state, job.sentence = result, sentence
            if job.news.tool is not None:
                self.tool = job.news.tool if result == "completed" else 0
            self.running = self.record = None
        if record is not None:
            more = {"sentence": sentence or None, "planned_s": job.duration_s}
            self._records.submit(record.end, result, **more)

    # -- looking on

    def look(self) -> Snapshot | None:
        """Draw conclusions from the newest snapshot; called often by the main thread."""
        now = self.engine.snapshot()
        if now is None:
            return None
        self._look_at_processes(now)
        self._look_at_rows()
        self._look_at_faults(now)
        self._write_journal(now)
        self._look_at_job(now)
        return now

    def _write_journal(self, now: Snapshot) -> None:
        """Once a second and at every standstill; a line typed by hand is no part of a program."""
        job, recorder = self.running, self.engine.recorder
        if recorder is not None and self.engine.tick_alive and not (job is not None and job.is_mdi):
            self.journal.look(now, recorder.last, job is not None and job.news.whole)

    def _look_at_processes(self, now: Snapshot) -> None:
        if not self.engine.tick_alive:
            if not self._tick_died:
                self._tick_died = True
                self._tick_gone(now)
        elif not self.engine.plan_alive and not self._plan_died:
            self._plan_died = True
            words = self.engine.last_words()
            shown = alarm_values.of(self.machine, Fault.PLANNER_GONE, -1)
            self.alarms.add(**_alarm(shown, words), **alarm_values.where(now))
            self.sequencer.later(self._mend)

    def _mend(self) -> None:
        """A new plan; the tick, the drives and where they are stay as they were."""
        with contextlib.suppress(OSError, DoorError):
            self.engine.mend()
        self._plan_died = False

    def _tick_gone(self, now: Snapshot) -> None:
        """The drives stop by themselves; what the last ticks were is kept."""
        shown = alarm_values.of(self.machine, Fault.CONTROLLER_GONE, -1)
        recording = None
        if self._keeper is not None:
            self._keeper.keep(now, Fault.CONTROLLER_GONE)
            recording = str(self._keeper.saved) if self._keeper.saved else None
        self.fault = {**shown, "recording": recording}
        entry = _alarm(shown, self.engine.last_words())
        self.alarms.add(**entry, **alarm_values.where(now), recording=recording)
        self.journal.lost(now)
        self._look_at_rows()
        self._end_job("fault", str(shown["sentence"]))

    def _look_at_rows(self) -> None:
        recorder = self.engine.recorder
        if recorder is None:
            return
        with self.lock:
            rows = recorder.drain()
            if self.record is not None and len(rows):
                self.record.take(rows)

    def _look_at_faults(self, now: Snapshot) -> None:
        """A fault is told once, as soon as it is seen; its recording follows when the machine stands."""
        if not self.engine.tick_alive:
            return
        key = (now.fault, now.mode, now.fault_axis)
        if now.fault is not Fault.NONE and now.fault is not self._last_fault[0]:
            self.fault = {
                **alarm_values.of(self.machine, now.fault, now.fault_axis, now.warning),
                "recording": None,
            }
            entry = _alarm(self.fault, "")
            self._fault_id = self.alarms.add(**entry, **alarm_values.where(now))["id"]
        elif now.fault is Fault.NONE:
            self.fault = None
        self._last_fault = key
        if now.warning is not self._last_warning and now.warning is not Fault.NONE:
            shown = alarm_values.of(self.machine, now.warning, -1)
            self.alarms.add(**_alarm(shown, ""), **alarm_values.where(now))
        self._last_warning = now.warning
        self._look_at_recording(now)

    def _look_at_recording(self, now: Snapshot) -> None:
        keeper = self._keeper
        if keeper is None or not keeper.look(now) or self.fault is None:
            return
        told = str(keeper.saved) if keeper.saved else None
        if told != self.fault.get("recording"):
            self.fault = {**self.fault, "recording": told}
            self.alarms.change(self._fault_id, recording=told)

    def _look_at_job(self, now: Snapshot) -> None:
        job, record = self.running, self.record
        if job is None or record is None or not self.engine.tick_alive:
            return
        if now.mode is Mode.FAULT:
            if now.at_rest or now.stopping is False:
                self._end_job("fault", str(self.fault["sentence"]) if self.fault else "")
        elif now.mode in (Mode.RUNNING, Mode.HOLD, Mode.STOPPING, Mode.JOG):
            names = {Mode.RUNNING: "running", Mode.STOPPING: "stopping"}
            job.state = names.get(now.mode, "held")
            self._see_refused(now, job)
        elif record.began and now.tick > record.last_tick - 1:
            whole = job.news.whole and not record.stopped and not job.sentence
            self._end_job("completed" if whole else "refused" if job.sentence else "stopped", job.sentence)

    def _see_refused(self, now: Snapshot, job: Job) -> None:
        """A block was refused on the way: the tool stands before it, and the program ends there."""
        if now.mode is Mode.RUNNING and job.news.refusal and now.at_rest and not job.sentence:
            job.sentence = f"{job.news.refusal} The tool stands on the path before that block."
            self.alarms.add("PROGRAM", job.sentence, **alarm_values.where(now))
            with contextlib.suppress(DoorError):
                self.engine.request(Request.STOP)

    def _failed(self, name: str, error: DoorError) -> None:
        """Work that came to nothing after its answer may have gone out already."""
        if error.code != "busy" and name in ("power up", "home", "enable", "reset"):
            self.alarms.add(f"{name} failed".upper().replace(" ", "_"), error.sentence)


def homed_position(machine: Machine) -> Joints:
    """Where the axes stand when all of them have been homed (mm, rad)."""
    return five(tuple(axis.homing.position for axis in machine.axes))


def _alarm(shown: dict[str, Any], words: str) -> dict[str, Any]:
    """An alarm out of a fault, with the last words of a process."""
    entry = {name: value for name, value in shown.items() if name not in ("name", "sentence", "recording")}
    return {"name": shown["name"], "words": f"{shown['sentence']} {words}".strip(), **entry}
