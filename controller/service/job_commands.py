"""Commands that take long: programs, lines by hand, ways off the path, drives on, homing, reset."""

from __future__ import annotations

from dataclasses import replace

from controller.commands.table import Request
from controller.ipc.asker import peer
from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.machine.macro_table import MACRO_ROLES
from controller.machine.model import Machine
from controller.plan.restart.reentry import RETRACT_MM_S
from controller.service import jobs, preconditions, restart_preview, sequences, whole_status
from controller.service.handler_context import HandlerContext
from controller.service.preconditions import permitted
from controller.service.refusals import by_fault, refused
from controller.service.sequencer import Going
from controller.service.thread_guard import way_out
from controller.state.modes import Mode, bars


def enable(handlers: HandlerContext, _: Values) -> Answer:
    service, now = handlers.service, handlers.service.processes.now()
    if now.mode is Mode.READY:
        return {"done": True, "mode": now.mode.name}
    permitted(service, Request.ENABLE)
    return handlers.sequence("enable", lambda: sequences.enable(service))


def home(handlers: HandlerContext, values: Values) -> Answer:
    service, going = handlers.service, Going()
    axes = _axis_numbers(service.set_up.machine, values["axes"], service.processes.now().mode)
    return handlers.sequence("home", lambda: sequences.home(service, axes, going), going)


def _axis_numbers(machine: Machine, names: list[str] | None, mode: Mode) -> tuple[int, ...]:
    """Numbers of axes by their names, all of them for None. Raises CommandRefused."""
    known = [axis.name for axis in machine.axes]
    if names is None:
        return tuple(range(len(known)))
    if not all(name in known for name in names):
        raise refused("no_axes", mode.name, "HOME", "bad", axes=repr(names), allowed=" ".join(known))
    return tuple(sorted({known.index(name) for name in names}))


def reset(handlers: HandlerContext, _: Values) -> Answer:
    service = handlers.service
    now = service.engine.snapshot()
    goes_on = service.engine.tick_alive and now is not None and not service.processes.stands(now)
    if goes_on and now is not None and now.mode is not Mode.FAULT and service.processes.commissioned:
        raise refused("no_fault", now.mode.name, "RESET")
    return handlers.sequence("reset", lambda: sequences.reset(service))


# ---- programs and lines


def load(handlers: HandlerContext, values: Values) -> Answer:
    service = handlers.service
    given_up, going = handlers.give_up_load(), handlers.new_load()
    values = {**values, jobs.READER: peer.get()}

    def work() -> Values:
        if going.given_up:
            raise refused("given_up", verb="load")
        if values["restart"] is True:
            job = restart_preview.gone_on_with(service, values)
        else:
            job = jobs.read(values, service.set_up.machine)
        begin = service.run.begins_with(job, service.processes.now())
        job.fit(replace(job.program, begin=begin))
        service.run.load(job)
        try:
            return sequences.load(service, job)
        except CommandRefused as error:
            job.become("refused", error.said)
            raise

    return handlers.sequence("load", work, behind=given_up)


def unload(handlers: HandlerContext, _: Values) -> Answer:
    """A check of it that is under way is given up, and has come to its end with the answer."""

    def work() -> Values:
        handlers.service.run.load(None)
        return {}

    given_up = handlers.give_up_load()
    return handlers.sequence("unload", work, behind=given_up) if given_up else work()


def seen(handlers: HandlerContext, _: Values) -> Answer:
    handlers.service.run.seen()
    return {}


def start(handlers: HandlerContext, values: Values) -> Answer:
    service, going, job = handlers.service, Going(), handlers.service.run.loaded
    assert job is not None
    unrecorded = bool(values["unrecorded"])
    return handlers.sequence("start", lambda: sequences.start(service, job, going, unrecorded), going)


def mdi(handlers: HandlerContext, values: Values) -> Answer:
    return handlers.begin("mdi", jobs.mdi(values["text"], handlers.service.set_up.machine), values["still"])


def macro(handlers: HandlerContext, values: Values) -> Answer:
    """Its lines as if they were typed."""
    machine, name = handlers.service.set_up.machine, values["name"]
    found = next((one for one in machine.macros if one.name == name), None)
    if found is None:
        allowed = ", ".join(one.name for one in machine.macros) or "–"
        raise refused("no_macro", code="missing", name=name, allowed=allowed)
    if values["role"] not in MACRO_ROLES[MACRO_ROLES.index(found.role) :]:
        raise refused("macro_role", code="role", name=name, needs=found.role)
    return handlers.begin("macro", jobs.mdi("\n".join(found.lines), machine), values["still"])


def probe(handlers: HandlerContext, values: Values) -> Answer:
    """A probing cycle, from where the probe is."""
    return handlers.begin(
        "probe", jobs.probing(values, handlers.service.set_up.machine, handlers.service.set_up.tool)
    )


# ---- off the path


def retract(handlers: HandlerContext, values: Values) -> Answer:
    """Off along the tool axis: out of a held program, or from READY, as after a fault."""
    service, now, mm = handlers.service, handlers.service.processes.now(), values["mm"]
    if now.mode not in (Mode.HOLD, Mode.READY) or not now.at_rest:
        raise refused("not_retracted", now.mode.name, "RETRACT")
    room_mm = whole_status.retract_room_mm(service, now)
    if room_mm is not None and not 0.0 < mm <= room_mm:
        raise refused("retract_room", now.mode.name, "RETRACT", mm=mm, room=room_mm)
    if now.mode is Mode.HOLD:
        return _aside(handlers, "retract", mm)
    preconditions.not_running(service, "RETRACT")
    permitted(service, Request.JOG)
    line = handlers.jogging.step(service.set_up.machine, now, handlers.part(), "tool", "Z", mm)
    line, going = line._replace(speed=min(line.speed, RETRACT_MM_S)), Going()
    return handlers.sequence("retract", lambda: sequences.retract(service, line, going), going)


def return_(handlers: HandlerContext, _: Values) -> Answer:
    return _aside(handlers, "return")


def _aside(handlers: HandlerContext, verb: str, distance_mm: float = 0.0) -> Answer:
    service, now = handlers.service, handlers.service.processes.now()
    if now.mode is not Mode.HOLD or not now.at_rest:
        raise refused("not_held", now.mode.name, verb.upper())
    if bars(now.interlock, Request.RESUME):
        raise by_fault(now.interlock, now.mode.name, verb.upper())
    going = Going()
    return handlers.sequence(verb, lambda: sequences.aside(service, verb, distance_mm, going), going)


def withdraw(handlers: HandlerContext, values: Values) -> Answer:
    """Out of a thread along it, by what is known of it or ``mm``; or it ``is_out`` already, by hand."""
    service, now = handlers.service, handlers.service.processes.now()
    machine, found = service.set_up.machine, service.thread.found
    if found is None:
        raise refused("not_in_thread", now.mode.name, "WITHDRAW")
    if values["is_out"]:
        preconditions.not_running(service, "WITHDRAW")
        service.thread.is_out()
        return {}
    if found.pitch_mm == 0.0:
        raise refused("thread_unknown", now.mode.name, "WITHDRAW")
    return handlers.begin("withdraw", jobs.mdi(way_out(machine, found, values["mm"]), machine, is_own=True))
