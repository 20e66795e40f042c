"""What a verb needs of the service before it is asked of the tick; otherwise its refusal."""

from __future__ import annotations

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.service.refusals import refused
from controller.service.service import Service
from controller.state.modes import Mode


def tick_goes_on(service: Service, now: Snapshot, request: str) -> None:
    """What moves the machine is not left with a tick that hangs. Raises CommandRefused."""
    if service.stands(now):
        raise refused("tick_does_not_answer", Mode.FAULT.name, request, "gone")


def not_running(service: Service, request: str) -> None:
    """No program and no typed line runs. Raises CommandRefused."""
    running, found = service.running, service.engine.snapshot()
    if running is not None:
        mode = found.mode.name if found is not None else "OFF"
        raise refused("running", mode, request, program=running.program.name)


def not_in_thread(service: Service, request: str) -> None:
    """The tool stands in no thread: ``withdraw`` and Resume alone move it there. Raises CommandRefused."""
    if (found := service.thread.found) is not None:
        mode, line = service.now().mode.name, found.line
        depth, pitch = found.depth_mm, found.pitch_mm
        raise refused("in_thread", mode, request, depth=depth, pitch=pitch, line=line)


def changer_is_sure(service: Service, request: str) -> None:
    """No tool is being changed, and where the tools are is confirmed. Raises CommandRefused."""
    changer = service.changer
    if changer is None:
        return
    if changer.under_way:
        raise refused("change_under_way", service.now().mode.name, request)
    if (doubt := changer.doubt) is not None:
        raise CommandRefused("refused", doubt, service.now().mode.name, request)
