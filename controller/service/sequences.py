"""What takes longer than an answer may: homing, enabling, reset, loading, starting.

Run by the sequencer's thread; all of it raises DoorError with the sentence for the operator.
"""

from __future__ import annotations

from dataclasses import replace

from controller import state, times
from controller.door import DoorError, Values
from controller.handoff import Snapshot
from controller.machine import Joints, Machine
from controller.service import offer
from controller.service.jobs import Job
from controller.service.refused import by_fault, refused
from controller.service.service import Service
from controller.session.starts import Start
from controller.state import FAULTS, Fault, Mode, Recovery, Request
from drives.cia402 import State

MARGIN_S = 2.0  # on top of what the tick itself waits
STAND_S = 15.0  # for a stop after a fault
ASIDE_S = 120.0  # for a way off the path
TAKEN_S = 5.0  # for a datagram to show its effect


def enable(service: Service) -> Values:
    """From OFF to READY; nothing moves. Raises DoorError."""
    _commissioned(service)
    service.engine.request(Request.ENABLE)
    now = service.wait_for(
        lambda now: now.mode in (Mode.READY, Mode.FAULT) or _interlocked(now, Request.ENABLE),
        times.ENABLE_S + MARGIN_S,
        "enabled",
    )
    if now.mode is not Mode.READY:
        fault = now.interlock if now.mode is not Mode.FAULT else now.fault
        raise by_fault(fault, now.mode.name, "ENABLE")
    return {"mode": now.mode.name}


def _interlocked(now: Snapshot, request: Request) -> bool:
    return now.refused_request == request and now.interlock is not Fault.NONE


def _commissioned(service: Service) -> None:
    if not service.commissioned:
        service.commission()


def home(service: Service, axes: tuple[int, ...]) -> Values:
    """Home axes, group by group, and enable. Raises DoorError."""
    machine = service.machine
    _disable(service)
    _commissioned(service)
    wanted = tuple(i for i in axes if not machine.axes[i].homing.absolute)
    try:
        service.engine.line.order("home", wanted)
    except DoorError:
        service.commissioned = False  # a drive may have been left in its homing mode
        raise
    homed = service.now().homed
    missing = [axis.name for i, axis in enumerate(machine.axes) if i in axes and not homed >> i & 1]
    if missing:
        raise refused("not_all_homed", "OFF", "HOME", axes=" ".join(missing))
    return {**enable(service), "homed": [axis.name for i, axis in enumerate(machine.axes) if homed >> i & 1]}


def _disable(service: Service) -> None:
    """A drive changes its mode of operation without torque."""
    if service.now().mode is not Mode.OFF:
        service.engine.request(Request.DISABLE)
    service.wait_for(_off, times.ENABLE_S, "switched_off")


def _off(now: Snapshot) -> bool:
    return now.mode is Mode.OFF and State.OPERATION_ENABLED not in now.drive_states


def reset(service: Service) -> Values:
    """Out of a fault to OFF, as its recovery needs it; a tick that is gone is started anew."""
    if not service.engine.tick_alive:
        service.start_engine()
        service.commission()
        service.troubles.shown = None
        offer.tell_beside(service)
        return {"mode": service.now().mode.name}
    now = service.now()
    if now.mode is Mode.FAULT:
        now = service.wait_for(lambda now: now.at_rest, STAND_S, "standstill")
        needs = max(FAULTS[now.fault].recovery, FAULTS[now.warning].recovery)
        service.engine.request(Request.RESET)
        service.wait_for(lambda now: now.mode is not Mode.FAULT, TAKEN_S, "end_of_fault")
        if needs >= Recovery.COMMISSION:
            service.commissioned = False
    _commissioned(service)
    return {"mode": service.now().mode.name}


def load(service: Service, job: Job) -> Values:
    """Read, plan and audit all of a program; nothing moves, nothing starts. Raises DoorError."""
    facts = service.engine.line.order("check", program=job.program)
    with service.lock:
        job.duration_s, job.blocks, job.notes = facts["duration_s"], facts["blocks"], facts["notes"]
        job.state, job.restart = "loaded", facts["restart"]
    return {"sha256": job.sha256, "name": job.program.name, **facts}


def start(service: Service, job: Job, stops: int) -> Values:
    """Plan from where the machine stands, and cycle start; a stop meanwhile is the end of it."""
    service.arming(job)
    try:
        program = replace(job.program, in_spindle=service.tool)
        facts = service.engine.line.order("arm", program=program)
        _go(service, job, facts, stops)
    except DoorError as error:
        service.not_started(job, error.sentence)
        _drop(service)
        raise
    return {"mode": service.now().mode.name}


def _go(service: Service, job: Job, facts: Values, stops: int) -> None:
    with service.lock:  # a stop is counted before it is sent, so none can slip in between
        now = service.now()
        if service.stops != stops:
            raise refused("stopped", now.mode.name, "START")
        if now.mode is not Mode.READY:
            raise refused("by_now", now.mode.name, "START")
        service.begin(job, facts)
    tick = now.tick

    def taken(now: Snapshot) -> bool:
        return now.mode is not Mode.READY or now.tick > tick + 50

    now = service.wait_for(taken, TAKEN_S, "start_taken")
    job.taken = True
    if now.mode is Mode.READY and _interlocked(now, Request.START):
        raise by_fault(now.interlock, now.mode.name, "START")


def aside(service: Service, verb: str, distance_mm: float = 0.0) -> Values:
    """Off the path along the tool axis, or back to it by the same way; held before and after.

    Held on the way it stays there: a resume then goes on along the way.
    """
    job, stops = service.running, service.stops
    refitted = verb == "return" and job is not None and job.program.machine.tools != service.machine.tools
    program = replace(job.program, machine=service.machine) if job is not None and refitted else None
    if program is not None and job is not None and job.start is not None:
        program = replace(program, start=_whole_from(job.start))
    service.engine.line.order(verb, program=program, distance_mm=distance_mm)
    if refitted and job is not None:
        service.refit(job)
    service.led_aside()
    before = service.now().tick
    service.engine.request(Request.RESUME)

    def over(now: Snapshot) -> bool:
        if now.tick <= before + 5 or now.mode is Mode.RUNNING:
            return False
        if now.mode is not Mode.HOLD:
            return True
        led = service.aside if verb == "retract" else not (service.aside or service.returning)
        return now.at_rest and (led or service.stops != stops)

    now = service.wait_for(over, ASIDE_S, "end_of_way")
    if now.mode is not Mode.HOLD:
        raise refused("ended_in", now.mode.name, verb.upper())
    return {"mode": now.mode.name}


def _whole_from(start: Start) -> Joints | None:
    """Where the whole run starts of which this was a start."""
    return start.joints if start.spot is None else start.whole_from


def _drop(service: Service) -> None:
    """What was planned for a start that did not come is forgotten, here and in the tick."""
    now = service.engine.snapshot()
    if service.engine.plan_alive and now is not None and now.mode is Mode.READY:
        service.engine.line.order("drop")
        service.engine.request(Request.STOP)


def refusal(machine: Machine, now: Snapshot, request: Request, language: str = "en") -> str:
    """Why the machine as it is refuses a request; "" where it does not."""
    return state.refusal(
        now.mode,
        request,
        standing=now.at_rest,
        homed=now.homed,
        untrusted=now.untrusted,
        interlock=now.interlock,
        away=now.away,
        axes=[axis.name for axis in machine.axes],
        language=language,
    )
