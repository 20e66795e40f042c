"""What must hold before a command is carried out, by the names that the table of commands has (``needs``)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from controller.commands.command import Command
from controller.commands.table import Request
from controller.ipc.control_socket import CommandRefused, Values
from controller.ipc.handoff import Snapshot
from controller.program import blocks
from controller.program.program import (
    UNSAID,
    Act,
    Action,
    Await,
    Block,
    Dwell,
    OperatorMessage,
    ProgramError,
    Remark,
    Select,
    Setting,
)
from controller.service import alarms, job_status, jobs
from controller.service.acknowledged import refusal
from controller.service.jobs import Job
from controller.service.refusals import refused
from controller.service.service import Service
from controller.service.usage import check_worn
from controller.state.modes import Mode

FEW_PASSES = 100  # of loops and calls in lines typed by hand, that are read before somebody is asked

Need = Callable[[Service, Command, Values], Any]  # raises CommandRefused


def check(service: Service, command: Command, values: Values) -> None:
    """Raises CommandRefused for the first thing that does not hold."""
    for need in command.needs:
        NEEDS[need](service, command, values)


def tick_goes_on(service: Service, now: Snapshot, title: str) -> None:
    """What moves the machine is not left with a tick that hangs. Raises CommandRefused."""
    if service.processes.stands(now):
        raise refused("tick_does_not_answer", Mode.FAULT.name, title, "gone")


def permitted(service: Service, request: Request) -> Snapshot:
    """The newest snapshot. Raises CommandRefused where the tick's table of modes refuses the request."""
    now = service.processes.now()
    tick_goes_on(service, now, request.name)
    if why := refusal(service.set_up.machine, now, request):
        raise CommandRefused("refused", why, now.mode.name, request.name)
    return now


def not_running(service: Service, title: str) -> None:
    """No program and no typed line runs. Raises CommandRefused."""
    running, found = service.run.job, service.engine.snapshot()
    if running is not None:
        mode = found.mode.name if found is not None else "OFF"
        raise refused("running", mode, title, program=running.program.name)


def not_in_thread(service: Service, title: str) -> None:
    """The tool stands in no thread: ``withdraw`` and Resume alone move it there. Raises CommandRefused."""
    if (found := service.thread.found) is not None:
        mode, line = service.processes.now().mode.name, found.line
        depth, pitch = found.depth_mm, found.pitch_mm
        raise refused("in_thread", mode, title, depth=depth, pitch=pitch, line=line)


def changer_is_sure(service: Service, title: str) -> None:
    """No tool is being changed, and where the tools are is confirmed. Raises CommandRefused."""
    changer = service.changer
    if changer is None:
        return
    if changer.under_way:
        raise refused("change_under_way", service.processes.now().mode.name, title)
    if (doubt := changer.doubt) is not None:
        raise CommandRefused("refused", doubt, service.processes.now().mode.name, title)


def damage_is_confirmed(service: Service, title: str) -> None:
    """What was found damaged in the state folder has been looked at. Raises CommandRefused."""
    if (alarm := service.alarms.unconfirmed(alarms.DAMAGE)) is not None:
        what, mode = {"key": alarm["key"], "values": alarm["values"]}, service.processes.now().mode.name
        raise refused("damage_not_confirmed", mode, title, number=alarm["id"], what=what)


def stands_still(service: Service, job: Job, title: str) -> None:
    """Lines typed by hand move nothing. Raises CommandRefused; what is not read to its end may move."""
    now, set_up = service.processes.now(), service.set_up
    changer = set_up.machine.changer
    machine = replace(set_up.machine, program_passes=FEW_PASSES)
    if changer is not None:
        machine = replace(machine, in_spindle=set_up.tool)
    begin, data = service.run.begins_with(job, now), job.program.text
    try:
        found = moves(
            blocks.stream(data, machine, jobs.MDI, start=now.joints, begin=begin),
            bool(changer and changer.prepare),
        )
    except ProgramError:
        found = True
    if found:
        raise refused("line_moves", now.mode.name, title, "moves", lines=job_status.typed_text(job))


def _mode(service: Service, command: Command, _: Values) -> None:
    """The table of modes takes it, or the service itself does more before (``modes`` of the command)."""
    now = service.processes.now()
    tick_goes_on(service, now, command.title)
    if command.request is not None and now.mode.name not in command.modes:
        permitted(service, Request(command.request))


def _loaded(service: Service, command: Command, _: Values) -> None:
    mode, job = service.processes.now().mode.name, service.run.loaded
    if job is None:
        raise refused("not_loaded", mode, command.title)
    if job.state == "loading":
        raise refused("still_loading", mode, command.title, program=job.program.name)
    if job.state == "completed" and job.said is not None:
        raise CommandRefused("refused", job.said, mode, command.title)
    if job.state == "refused":
        raise refused("not_ready", mode, command.title, program=job.program.name, why=job.said)


def _not_worn(service: Service, _: Command, values: Values) -> None:
    """The tool in the spindle has life left, or that is confirmed."""
    job, set_up = service.run.loaded, service.set_up
    if job is not None and not values["worn"]:
        check_worn(service.usage, set_up.tool, job.program.name, set_up.tool_numbers)


def _has_spindle(service: Service, *_: Any) -> None:
    spindle = service.set_up.machine.spindle
    if spindle is None or not spindle.is_driven:
        raise refused("no_spindle", code="bad")


def _has_adaptive(service: Service, *_: Any) -> None:
    """The machine file has a law for it."""
    spindle = service.set_up.machine.spindle
    if spindle is None or spindle.adaptive is None:
        raise refused("no_adaptive", code="bad")


def _tool_in_table(service: Service, _: Command, values: Values) -> None:
    if values["tool"] not in service.set_up.tool_numbers:
        raise refused("not_in_table", code="missing", number=values["tool"])


def _by_title(check: Callable[[Service, str], None]) -> Need:
    return lambda service, command, _: check(service, command.title)


NEEDS: dict[str, Need] = {
    "mode": _mode,
    "loaded": _loaded,
    "not_running": _by_title(not_running),
    "not_in_thread": _by_title(not_in_thread),
    "changer": _by_title(changer_is_sure),
    "damage": _by_title(damage_is_confirmed),
    "not_worn": _not_worn,
    "spindle": _has_spindle,
    "adaptive": _has_adaptive,
    "tool_in_table": _tool_in_table,
}


# They stop, end, or turn coolant on or off.
QUIET_ACTS = frozenset({Act.STOP, Act.OPTIONAL_STOP, Act.END, Act.COOLANT, Act.INPUT})


def moves(blocks: Iterable[Block], prepares: bool = False) -> bool:
    """Whether an axis moves, the spindle turns, a tool is changed or an output switched.

    ``prepares``: T alone makes the tool changer bring a pocket.
    """
    return any(_moves(block, prepares) for block in blocks)


def _moves(block: Block, prepares: bool) -> bool:
    match block:
        case Action(act=Act.SPINDLE):
            return block.modal.spindle_rev_min != 0.0
        case Action():
            return block.act not in QUIET_ACTS
        case Await():
            return block.outputs != UNSAID
        case Select():
            return prepares
        case _:
            return not isinstance(block, Dwell | OperatorMessage | Remark | Setting)
