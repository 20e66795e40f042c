"""What takes longer than an answer may: homing, enabling, reset, loading, starting.

Run by the sequencer's thread; all of it raises CommandRefused with the sentence for the operator.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path

from controller.ipc.control_socket import CommandRefused, Values
from controller.ipc.handoff import Jog, Outcome, Snapshot
from controller.machine import setup_data
from controller.messages import of_error
from controller.runtime.starts import Start
from controller.runtime.startup import SessionError
from controller.service import restart_preview, room
from controller.service.acknowledged import why_refused
from controller.service.jobs import Job
from controller.service.refusals import by_fault, by_now, refused
from controller.service.sequencer import Going
from controller.service.service import Service
from controller.state import stop_times
from controller.state.modes import FAULTS, Mode, Recovery, Request
from drives.cia402 import State

MARGIN_S = 2.0  # on top of what the tick itself waits
STAND_S = 15.0  # for a stop after a fault
ASIDE_S = 120.0  # for a way off the path
TAKEN_TIMEOUT_S = 5.0  # for a datagram to show its effect
SHORT_MM = 1e-3  # less is no shorter way


def power_up(service: Service) -> None:
    """Tick and plan, then the drives' settings. A drive that does not answer is an alarm, and no end.

    Raises SessionError where there is no tick.
    """

    def work() -> Values:
        start_engine(service)
        service.processes.commission()
        return {}

    try:
        service.sequencer.to_its_end("power up", work)
    except CommandRefused as error:
        if not service.engine.tick_alive:
            raise SessionError(error.said) from error


def start_engine(service: Service) -> None:
    """Tick and plan, from nothing. Raises CommandRefused."""
    with service.watch.between_ticks():
        service.processes.start(service.set_up.tool)
    service.processes.listen(service.set_up.machine)


def enable(service: Service) -> Values:
    """From OFF to READY; nothing moves. Raises CommandRefused."""
    service.processes.commission()
    _ask_tick(service, Request.ENABLE)
    now = service.processes.wait_for(
        lambda now: now.mode in (Mode.READY, Mode.FAULT), stop_times.ENABLE_S + MARGIN_S, "enabled"
    )
    if now.mode is not Mode.READY:
        raise by_fault(now.fault, now.mode.name, "ENABLE")
    return {"mode": now.mode.name}


def _see_taken(service: Service, number: int, request: Request) -> Snapshot:
    """The first snapshot in which a request is answered. Raises CommandRefused where the tick refused it."""
    now = service.processes.wait_for(lambda now: now.has_taken(number), TAKEN_TIMEOUT_S, "answer")
    if now.came_of(number)[0] is Outcome.REFUSED:
        raise why_refused(service.set_up.machine, now, number, request)
    return now


def _ask_tick(service: Service, request: Request) -> Snapshot:
    """Ask the tick, and see that it takes it. Raises CommandRefused."""
    return _see_taken(service, service.engine.request(request), request)


def home(service: Service, axes: tuple[int, ...], going: Going) -> Values:
    """Home axes by groups, and enable; a stop ends it also between two groups. Raises CommandRefused."""
    machine = service.set_up.machine
    _disable(service)
    service.processes.commission()
    service.processes.home(tuple(i for i in axes if not machine.axes[i].homing.absolute))
    homed = service.processes.now().homed
    missing = [axis.name for i, axis in enumerate(machine.axes) if i in axes and not homed >> i & 1]
    if missing:
        raise refused("not_all_homed", "OFF", "HOME", axes=" ".join(missing))
    if going.given_up:
        raise refused("stopped", service.processes.now().mode.name, "HOME")
    return {**enable(service), "homed": [axis.name for i, axis in enumerate(machine.axes) if homed >> i & 1]}


def _disable(service: Service) -> None:
    """A drive changes its mode of operation without torque."""
    if service.processes.now().mode is not Mode.OFF:
        _ask_tick(service, Request.DISABLE)
    service.processes.wait_for(_off, stop_times.ENABLE_S, "switched_off")


def _off(now: Snapshot) -> bool:
    return now.mode is Mode.OFF and State.OPERATION_ENABLED not in now.drive_states


def reset(service: Service) -> Values:
    """Out of a fault to OFF, as its recovery needs it; a tick that is gone, or hangs, is started anew."""
    found = service.engine.snapshot()
    if service.engine.tick_alive and found is not None and service.processes.stands(found):
        service.engine.end_tick()
    if not service.engine.tick_alive:
        start_engine(service)
        service.processes.commission()
        restart_preview.tell_beside(service)
        return {"mode": service.processes.now().mode.name}
    now = service.processes.now()
    if now.mode is Mode.FAULT:
        # Nor before the run is told to be over by it: from OFF nobody could tell by what, or start anew.
        service.processes.wait_for(lambda now: now.at_rest, STAND_S, "standstill")
        now = service.processes.wait_for(lambda _: service.run.job is None, STAND_S, "end_of_run")
        needs = max(FAULTS[now.fault].recovery, FAULTS[now.warning].recovery)
        _ask_tick(service, Request.RESET)
        service.run.modal.reset(service.set_up.machine)
        if needs >= Recovery.COMMISSION:
            service.processes.lose_settings()
    service.processes.commission()
    return {"mode": service.processes.now().mode.name}


def load(service: Service, job: Job) -> Values:
    """Read, plan and audit all of a program; nothing moves, nothing starts. Raises CommandRefused."""
    facts = service.engine.line.order("check", program=replace(job.program, in_spindle=service.set_up.tool))
    with service.run.lock:
        return job.checked(facts, service.durations)


def start(service: Service, job: Job, going: Going, unrecorded: bool = False) -> Values:
    """Plan from where the machine stands, and cycle start; a stop meanwhile is the end of it.

    ``unrecorded``: though it cannot be kept.
    """
    try:
        if not (unrecorded or job.is_mdi):
            check_disk(service.state, job)
        _arm(service, job)
        facts = service.engine.line.order("arm", program=replace(job.program, in_spindle=service.set_up.tool))
        _go(service, job, facts, going)
    except Exception as error:  # whatever it was: what did not start must not bar the next start
        service.run.not_started(job, of_error(error))
        _drop(service)
        raise
    last = service.run.last
    return {"mode": service.processes.now().mode.name, "run": last.id if last is not None else None}


def _arm(service: Service, job: Job) -> None:
    """With what is fitted now: while it runs, that does not change.

    What a plan had sent for a start before it died is still in the tick, and would be run first.
    """
    now = service.processes.now()
    if now.queue_end_s > now.plan_time_s + service.set_up.machine.period_s:
        _drop(service)
    with service.set_up.lock:
        machine, fitted = service.set_up.machine, service.set_up.fitted
        if sisters := service.usage.sisters(service.set_up.tool_numbers):
            fitted = {**fitted, "sisters": sisters}
            machine = setup_data.applied(machine, {"sisters": sisters})
        job.fit(replace(job.program, machine=machine, begin=service.run.begins_with(job, now)), fitted)
        if job.entry is not None:
            restart_preview.look_again(service, job)
        service.run.arm(job)


def _go(service: Service, job: Job, facts: Values, going: Going) -> None:
    with service.run.lock:
        now = service.processes.now()
        if now.mode is not Mode.READY:
            raise by_now(now, "START")
        service.run.begin(job, facts, now)
        begun: Start = facts["start"]
        asked = going.send(lambda: service.engine.request(Request.START, float(begun.stays_on)))
    if asked is None:
        raise refused("stopped", now.mode.name, "START")
    _see_taken(service, asked, Request.START)
    job.take()


def aside(service: Service, verb: str, distance_mm: float, going: Going) -> Values:
    """Off the path along the tool axis, or back to where it goes on; held before and after.

    Held on the way it stays there: a resume then goes on along the way. That is also what a hold
    does that comes while the way is planned, which with another tool takes as long as a check.
    """
    with service.set_up.lock:
        program = service.run.refitted()
    service.engine.line.order(verb, program=program, distance_mm=distance_mm, tool=service.set_up.tool)
    if verb == "return" and program is not None:
        service.run.refit(program)
    asked = going.send(lambda: service.engine.request(Request.RESUME))
    if asked is not None:
        _see_taken(service, asked, Request.RESUME)

    def over(now: Snapshot) -> bool:
        if now.mode is Mode.RUNNING:
            return False
        if now.mode is not Mode.HOLD:
            return True
        led = service.run.aside if verb == "retract" else not (service.run.aside or service.run.returning)
        return now.at_rest and (led or going.given_up)

    now = service.processes.wait_for(over, ASIDE_S, "end_of_way")
    if now.mode is not Mode.HOLD:
        raise refused("ended_in", now.mode.name, verb.upper())
    return {"mode": now.mode.name}


def retract(service: Service, line: Jog, going: Going) -> Values:
    """From READY by the length of a line along the tool axis."""
    before = service.processes.now()
    asked = going.send(lambda: service.engine.jog(line))
    if asked is None:
        raise refused("stopped", before.mode.name, "RETRACT")
    _see_taken(service, asked, Request.JOG)
    now = service.processes.wait_for(lambda now: now.mode is not Mode.JOG, ASIDE_S, "end_of_way")
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


def _drop(service: Service) -> None:
    """What was planned for a start that did not come is forgotten, here and in the tick.

    The tick has done so when this returns, or the next start would be planned on what is dropped.
    """
    with contextlib.suppress(CommandRefused):  # a tick or a plan that is gone has forgotten it
        now = service.processes.now()
        if now.mode not in (Mode.READY, Mode.RUNNING):
            return
        if service.engine.plan_alive:
            service.engine.line.order("drop")
        asked = service.engine.request(Request.STOP)
        service.processes.wait_for(lambda later: later.has_taken(asked), TAKEN_TIMEOUT_S, "standstill")


def check_disk(state: Path, job: Job) -> None:
    """Raises CommandRefused "unrecorded" where a run of ``job`` could not be kept."""
    ticks = (job.duration_s or 0.0) / job.program.machine.period_s
    if reason := room.lacking(state, room.needed(ticks) + len(job.program.text)):
        raise refused("unrecorded", "READY", "START", "unrecorded", program=job.program.name, **reason)
