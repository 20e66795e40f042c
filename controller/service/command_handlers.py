"""The commands of the socket: each is read, then refused in a sentence or carried out, as the table says.

What must not wait (hold, stop, e-stop, overrides, jog) is a datagram that leaves in the socket's own thread;
what takes long goes to the sequencer, and what waits for a disk to the threads of the errands.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context

from controller.commands.arguments import ArgumentError
from controller.commands.command import Command
from controller.commands.table import COMMANDS, ENDS, Request
from controller.ipc.asker import asker
from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.messages import message
from controller.service import (
    at_once,
    diagnostics,
    fitting,
    job_commands,
    preconditions,
    restart_preview,
    runs,
    tool_places,
    usage,
    whole_status,
)
from controller.service.handler_context import HandlerContext
from controller.service.refusals import refused
from controller.service.service import Service
from controller.state.modes import Mode

PANEL_DAMAGE = "STORE_DAMAGED"  # an alarm


class CommandHandlers(HandlerContext):
    """Call it with a verb and its arguments."""

    def __init__(self, service: Service) -> None:
        super().__init__(service)
        self._errands = ThreadPoolExecutor(2, "errands")  # what waits for a disk

    def __call__(self, verb: str, args: Values) -> Answer:
        """The result, or a future of it. Raises CommandRefused."""
        command = COMMANDS.get(verb)
        if command is None:
            raise refused("no_verb", code="bad", verb=verb, allowed=", ".join(COMMANDS))
        values = _read(command, args)
        if verb in ENDS:  # before it is asked whether the mode takes it: a press may just begin
            self.presses.end(values["press"])
        if instead := self._instead(command, values):
            command, values = instead, {}
        preconditions.check(self.service, command, values)
        if (errand := ERRANDS.get(command.name)) is not None:
            return self._errands.submit(copy_context().run, errand, self.service, values)
        if (handler := AT_ONCE.get(command.name)) is not None:
            return handler(self, values)
        assert command.request is not None  # the tick alone does it
        return self.ask(Request(command.request), float(next(iter(values.values()), 0.0)), **values)

    def _instead(self, command: Command, values: Values) -> Command | None:
        """What is meant: a start in a hold goes on with the program, a jog at speed 0 ends."""
        if command.name == "jog" and values["speed"] == 0.0:
            return COMMANDS["jog_stop"]
        if command.name == "start" and self.service.processes.now().mode is Mode.HOLD:
            return COMMANDS["resume"]
        return None

    def close(self) -> None:
        """Nobody asks any more; what waits for a disk is done first."""
        super().close()
        self._errands.shutdown(wait=True)


def _read(command: Command, args: Values) -> Values:
    """Raises CommandRefused."""
    try:
        return command.read(args)
    except ArgumentError as error:
        raise CommandRefused("bad", message(error.key, **error.values)) from error


# ---- what a command does. One that is in neither table is a request to the tick, its argument the value


def _drives(service: Service) -> Values:
    return {"drives": service.processes.drives(service.set_up.machine, service.processes.now())}


def _buses(service: Service, _: Values) -> Values:
    return diagnostics.buses(service.set_up.machine, service.processes.logs, service.engine.recorder)


def _terminals(service: Service, values: Values) -> Values:
    """Raises CommandRefused where there is no such axis, or its drive does not answer."""
    axes = [axis.name for axis in service.set_up.machine.axes]
    if values["axis"] not in axes:
        raise refused("no_axis", code="bad", axis=values["axis"], allowed=", ".join(axes))
    return service.engine.line.order("terminals", (axes.index(values["axis"]),))


def _keep_run(service: Service, values: Values) -> Values:
    """Raises CommandRefused where there is no such record, or it cannot be marked."""
    try:
        found = runs.keep(service.state, values["record"], bool(values["on"]))
    except OSError as error:
        raise refused("of_place", code="bad", place=values["record"], why=error) from error
    if not found:
        raise refused("no_run_record", code="bad", record=values["record"])
    return {"kept": values["on"]}


def _acknowledge(service: Service, values: Values) -> Values:
    """Raises CommandRefused where there is no such alarm."""
    who = asker.get()
    return {"acknowledged": service.alarms.acknowledge(values["id"], who.user if who is not None else "")}


def _panel_damaged(service: Service, values: Values) -> Values:
    """The panel has no alarms of its own; one that nobody has acknowledged is not raised again."""
    there, said = service.alarms.unconfirmed(PANEL_DAMAGE), message(values["key"], **values["values"])
    if there is None or there["key"] != said["key"]:
        service.alarms.add(PANEL_DAMAGE, said)
    return {}


AT_ONCE: dict[str, Callable[[HandlerContext, Values], Answer]] = {
    "status": lambda handlers, _: whole_status.status(handlers.service),
    "facts": lambda handlers, _: whole_status.facts(handlers.service),
    "probed": lambda handlers, _: {"found": handlers.service.probed.to_json()},
    "drives": lambda handlers, _: _drives(handlers.service),
    "alarms": lambda handlers, _: {"alarms": handlers.service.alarms.list()},
    "load": job_commands.load,
    "unload": job_commands.unload,
    "seen": job_commands.seen,
    "start": job_commands.start,
    "hold": at_once.hold,
    "resume": at_once.resume,
    "stop": at_once.stop,
    "estop": at_once.estop,
    "spindle": at_once.spindle,
    "coolant": at_once.coolant,
    "clamps": at_once.clamps,
    "enable": job_commands.enable,
    "disable": at_once.disable,
    "home": job_commands.home,
    "reset": job_commands.reset,
    "mdi": job_commands.mdi,
    "macro": job_commands.macro,
    "probe": job_commands.probe,
    "retract": job_commands.retract,
    "withdraw": job_commands.withdraw,
    "return": job_commands.return_,
    "jog_stop": lambda handlers, _: handlers.ask(Request.JOG_STOP),
    "jog": at_once.jog,
    "jog_step": at_once.jog_step,
}
ERRANDS: dict[str, Callable[[Service, Values], Values]] = {  # they wait for a disk
    "restart": lambda service, _: restart_preview.restart(service),
    "set_offset": fitting.set_offset,
    "set_tool": fitting.set_tool,
    "forget": fitting.forget,
    "acknowledge": _acknowledge,
    "panel_damaged": _panel_damaged,
    "keep_run": _keep_run,
    "rows": lambda service, values: diagnostics.rows(service.engine.recorder, values),
    "buses": _buses,
    "terminals": _terminals,
    "usage": lambda service, _: service.usage.to_json(),
    "tool_life": lambda service, values: usage.tool_life(service.usage, values),
    "tool_renewed": lambda service, values: usage.tool_renewed(service.usage, values),
    "maintenance": lambda service, values: usage.maintenance(service.usage, values),
    "maintained": lambda service, values: usage.maintained(service.usage, values),
    "changer": lambda service, _: tool_places.to_json(service),
    "changer_confirm": tool_places.confirm,
    "changer_pocket": tool_places.give_pocket,
}
