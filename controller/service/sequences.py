"""What takes longer than an answer may: homing, enabling, reset, loading, starting.

Run by the sequencer's thread; all of it raises CommandRefused with the sentence for the operator.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller import own_files
from controller.ipc.control_socket import CommandRefused, Values
from controller.ipc.handoff import Jog, Outcome, Snapshot
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.messages import Key, of_error
from controller.runtime.starts import Start
from controller.service import restart_preview
from controller.service.acknowledged import why_refused
from controller.service.jobs import Job, whole_from
from controller.service.planner_client import Program
from controller.service.refusals import by_fault, by_now, refused
from controller.service.sequencer import Going
from controller.service.service import Service
from controller.state import stop_times
from controller.state.modes import FAULTS, Mode, Recovery, Request
from drives.cia402 import State

MARGIN_S = 2.0  # on top of what the tick itself waits
STAND_S = 15.0  # for a stop after a fault
ASIDE_S = 120.0  # for a way off the path
TAKEN_S = 5.0  # for a datagram to show its effect
SHORT_MM = 1e-3  # less is no shorter way


def enable(service: Service) -> Values:
    """From OFF to READY; nothing moves. Raises CommandRefused."""
    _commissioned(service)
    _asked(service, Request.ENABLE)
    now = service.wait_for(
        lambda now: now.mode in (Mode.READY, Mode.FAULT), stop_times.ENABLE_S + MARGIN_S, "enabled"
    )
    if now.mode is not Mode.READY:
        raise by_fault(now.fault, now.mode.name, "ENABLE")
    return {"mode": now.mode.name}


def _see_taken(service: Service, number: int, request: Request) -> Snapshot:
    """The first snapshot in which a request is answered. Raises CommandRefused where the tick refused it."""
    now = service.wait_for(lambda now: now.has_taken(number), TAKEN_S, "answer")
    if now.came_of(number)[0] is Outcome.REFUSED:
        raise why_refused(service.machine, now, number, request)
    return now


def _asked(service: Service, request: Request) -> Snapshot:
    """Ask the tick, and see that it takes it. Raises CommandRefused."""
    return _see_taken(service, service.engine.request(request), request)


def _commissioned(service: Service) -> None:
    if not service.commissioned:
        service.commission()


def home(service: Service, axes: tuple[int, ...], going: Going) -> Values:
    """Home axes by groups, and enable; a stop ends it also between two groups. Raises CommandRefused."""
    machine = service.machine
    _disable(service)
    _commissioned(service)
    wanted = tuple(i for i in axes if not machine.axes[i].homing.absolute)
    service.homing = wanted
    try:
        service.engine.line.order("home", wanted)
    except CommandRefused:
        service.commissioned = False  # a drive may have been left in its homing mode
        raise
    finally:
        service.homing = ()
    homed = service.now().homed
    missing = [axis.name for i, axis in enumerate(machine.axes) if i in axes and not homed >> i & 1]
    if missing:
        raise refused("not_all_homed", "OFF", "HOME", axes=" ".join(missing))
    if going.given_up:
        raise refused("stopped", service.now().mode.name, "HOME")
    return {**enable(service), "homed": [axis.name for i, axis in enumerate(machine.axes) if homed >> i & 1]}


def _disable(service: Service) -> None:
    """A drive changes its mode of operation without torque."""
    if service.now().mode is not Mode.OFF:
        _asked(service, Request.DISABLE)
    service.wait_for(_off, stop_times.ENABLE_S, "switched_off")


def _off(now: Snapshot) -> bool:
    return now.mode is Mode.OFF and State.OPERATION_ENABLED not in now.drive_states


def reset(service: Service) -> Values:
    """Out of a fault to OFF, as its recovery needs it; a tick that is gone, or hangs, is started anew."""
    found = service.engine.snapshot()
    if service.engine.tick_alive and found is not None and service.stands(found):
        service.engine.end_tick()
    if not service.engine.tick_alive:
        service.start_engine()
        service.commission()
        restart_preview.tell_beside(service)
        return {"mode": service.now().mode.name}
    now = service.now()
    if now.mode is Mode.FAULT:
        # Nor before the run is told to be over by it: from OFF nobody could tell by what, or start anew.
        service.wait_for(lambda now: now.at_rest, STAND_S, "standstill")
        now = service.wait_for(lambda _: service.running is None, STAND_S, "end_of_run")
        needs = max(FAULTS[now.fault].recovery, FAULTS[now.warning].recovery)
        _asked(service, Request.RESET)
        service.modal.reset(service.machine)
        if needs >= Recovery.COMMISSION:
            service.commissioned = False
    _commissioned(service)
    return {"mode": service.now().mode.name}


def load(service: Service, job: Job) -> Values:
    """Read, plan and audit all of a program; nothing moves, nothing starts. Raises CommandRefused."""
    facts = service.engine.line.order("check", program=replace(job.program, in_spindle=service.tool))
    with service.lock:
        job.before_s, job.blocks, job.notes = facts.pop("passed_s"), facts["blocks"], facts["notes"]
        job.time.durations = service.durations
        job.time.check(facts["duration_s"], facts.pop("marks"), facts.pop("events"))
        job.time.stands(facts.pop("timetable"))
        facts["duration_s"] = job.duration_s
        job.verdict = facts["verdict"]
        job.state, job.restart = "loaded", facts["restart"]
    return {"sha256": job.sha256, "name": job.program.name, **facts}


def start(service: Service, job: Job, going: Going, unrecorded: bool = False) -> Values:
    """Plan from where the machine stands, and cycle start; a stop meanwhile is the end of it.

    ``unrecorded``: though it cannot be kept.
    """
    try:
        if not (unrecorded or job.is_mdi):
            check_disk(service.state, job)
        _arm(service, job)
        facts = service.engine.line.order("arm", program=replace(job.program, in_spindle=service.tool))
        _go(service, job, facts, going)
    except Exception as error:  # whatever it was: what did not start must not bar the next start
        service.not_started(job, of_error(error))
        _drop(service)
        raise
    run = service.last_run
    return {"mode": service.now().mode.name, "run": run.id if run is not None else None}


def _arm(service: Service, job: Job) -> None:
    """With what is fitted now: while it runs, that does not change.

    What a plan had sent for a start before it died is still in the tick, and would be run first.
    """
    now = service.now()
    if now.queue_end_s > now.plan_time_s + service.machine.period_s:
        _drop(service)
    with service.fitting:
        machine, job.fitted = service.machine, service.fitted
        if sisters := service.usage.sisters(service.tool_numbers):
            job.fitted = {**job.fitted, "sisters": sisters}
            machine = setup_data.applied(machine, {"sisters": sisters})
        job.program = replace(job.program, machine=machine, begin=service.begins_with(job, now))
        if job.entry is not None:
            restart_preview.look_again(service, job)
        service.arming(job)


def _go(service: Service, job: Job, facts: Values, going: Going) -> None:
    with service.lock:
        now = service.now()
        if now.mode is not Mode.READY:
            raise by_now(now, "START")
        service.begin(job, facts)
        begun: Start = facts["start"]
        asked = going.send(lambda: service.engine.request(Request.START, float(begun.stays_on)))
    if asked is None:
        raise refused("stopped", now.mode.name, "START")
    _see_taken(service, asked, Request.START)
    job.taken = True


def aside(service: Service, verb: str, distance_mm: float, going: Going) -> Values:
    """Off the path along the tool axis, or back to where it goes on; held before and after.

    Held on the way it stays there: a resume then goes on along the way. That is also what a hold
    does that comes while the way is planned, which with another tool takes as long as a check.
    """
    job, program = service.running, None
    with service.fitting:
        if job is not None and job.tools != service.machine.tools:
            program = _refitted(job, setup_data.applied(service.file, service.with_tools(job)))
    service.engine.line.order(verb, program=program, distance_mm=distance_mm, tool=service.tool)
    if verb == "return" and program is not None and job is not None:
        service.refit(job, program)
    asked = going.send(lambda: service.engine.request(Request.RESUME))
    if asked is not None:
        _see_taken(service, asked, Request.RESUME)

    def over(now: Snapshot) -> bool:
        if now.mode is Mode.RUNNING:
            return False
        if now.mode is not Mode.HOLD:
            return True
        led = service.aside if verb == "retract" else not (service.aside or service.returning)
        return now.at_rest and (led or going.given_up)

    now = service.wait_for(over, ASIDE_S, "end_of_way")
    if now.mode is not Mode.HOLD:
        raise refused("ended_in", now.mode.name, verb.upper())
    return {"mode": now.mode.name}


def retract(service: Service, line: Jog, going: Going) -> Values:
    """From READY by the length of a line along the tool axis."""
    before = service.now()
    asked = going.send(lambda: service.engine.jog(line))
    if asked is None:
        raise refused("stopped", before.mode.name, "RETRACT")
    _see_taken(service, asked, Request.JOG)
    now = service.wait_for(lambda now: now.mode is not Mode.JOG, ASIDE_S, "end_of_way")
    if now.mode is not Mode.READY:
        raise refused("ended_in", now.mode.name, "RETRACT")
    gone_mm = _along(line, before, now)
    if not going.given_up and gone_mm < line.length - SHORT_MM:
        raise refused("ended_short", now.mode.name, "RETRACT", gone=gone_mm, mm=line.length)
    return {"mode": now.mode.name, "mm": gone_mm}


def _along(line: Jog, before: Snapshot, now: Snapshot) -> float:
    """How far (mm) the joints have gone along a line whose direction has the length 1."""
    rows = zip(line.direction, before.joints, now.joints, strict=True)
    return sum(d * (there - here) for d, here, there in rows)


def _refitted(job: Job, machine: Machine) -> Program:
    """The held program with the tools that were fitted meanwhile."""
    program = replace(job.program, machine=machine)
    return program if job.start is None else replace(program, start=whole_from(job.start))


def _drop(service: Service) -> None:
    """What was planned for a start that did not come is forgotten, here and in the tick.

    The tick has done so when this returns, or the next start would be planned on what is dropped.
    """
    with contextlib.suppress(CommandRefused):  # a tick or a plan that is gone has forgotten it
        now = service.now()
        if now.mode not in (Mode.READY, Mode.RUNNING):
            return
        if service.engine.plan_alive:
            service.engine.line.order("drop")
        asked = service.engine.request(Request.STOP)
        service.wait_for(lambda later: later.has_taken(asked), TAKEN_S, "standstill")


# Whether the disk takes what a run leaves behind: asked before it starts, while nothing is lost yet.
#
# A run that cannot be recorded cannot be made again, nor gone on with after a loss of power; and a fault in
# it leaves no recording. That is for an operator to know before, and to decide.

ROW_BYTES = 24  # of a tick's setpoints
MAX_ROWS_BYTES = 256 << 20  # a longer run is not kept to its end
SPARE_BYTES = 64 << 20  # for events, a fault's recording, alarms and the journal
PROBE_BYTES = 1 << 16
FOLDERS = ("runs", "recordings", "")  # of the state folder, which itself has alarms and journal


def check_disk(state: Path, job: Job) -> None:
    """Raises CommandRefused "unrecorded" where a run of ``job`` could not be kept."""
    period_s = job.program.machine.period_s
    ticks = (job.duration_s or 0.0) / period_s
    rows = min(MAX_ROWS_BYTES, round(ticks * ROW_BYTES))
    if reason := lacking(state, rows + len(job.program.text) + SPARE_BYTES):
        raise refused("unrecorded", "READY", "START", "unrecorded", program=job.program.name, **reason)


def lacking(state: Path, needed: int) -> dict[str, Any]:
    """Why so many bytes cannot be kept, as values of the refusal; nothing where they can."""
    for name in FOLDERS:
        folder = state / name
        try:
            own_files.make_folder(folder, state)
            _probe(folder, state)
            free = shutil.disk_usage(folder).free
        except OSError as error:
            return {"why": f"{folder}: {error.strerror or error}"}
        if free < needed:
            return {
                "why": Key("little_room"),
                "free": free >> 20,
                "needed": -(-needed >> 20),
                "folder": folder,
            }
    return {}


def _probe(folder: Path, state: Path) -> None:
    """Write something, for neither a permission nor a mount tells of itself what will be. Raises OSError."""
    file = folder / ".probe"
    try:
        with own_files.new(file, state) as probe:
            probe.write(bytes(PROBE_BYTES))
            probe.flush()
            os.fsync(probe.fileno())
    finally:
        own_files.remove(file, state)
