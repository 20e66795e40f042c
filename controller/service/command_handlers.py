"""The commands of the socket: each is read, then refused in a sentence or carried out, as the table says.

What must not wait (hold, stop, e-stop, overrides, jog) is a datagram that leaves in the socket's own thread;
what takes long goes to the sequencer, and what waits for a disk to the threads of the errands.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from controller.commands.arguments import ArgumentError
from controller.commands.command import Command
from controller.commands.table import COMMANDS, ENDS, Request
from controller.geometry.vectors import Frame
from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.messages import said
from controller.service import (
    at_once,
    diagnostics,
    fitting,
    job_commands,
    preconditions,
    restart_preview,
    runs,
    sequences,
    tool_places,
    usage,
    whole_status,
)
from controller.service.acknowledged import Acknowledged
from controller.service.jobs import Job
from controller.service.jogging import Jogging, Presses
from controller.service.refusals import refused
from controller.service.sequencer import Going
from controller.service.service import Service
from controller.state.modes import MOVES, Mode


class CommandHandlers:
    """Call it with a verb and its arguments."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self.jogging, self.presses = Jogging(), Presses()
        self._answers = Acknowledged(service.set_up.machine, lambda: service.engine)
        self._errands = ThreadPoolExecutor(2, "errands")  # what waits for a disk
        self._loading = Going()  # the last program that is loaded or let go of: only that counts

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
            return self._errands.submit(errand, self.service, values)
        if (handler := AT_ONCE.get(command.name)) is not None:
            return handler(self, values)
        assert command.request is not None  # the tick alone does it
        return self.ask(command.request, float(next(iter(values.values()), 0.0)), **values)

    def _instead(self, command: Command, values: Values) -> Command | None:
        """What is meant: a start in a hold goes on with the program, a jog at speed 0 ends."""
        if command.name == "jog" and values["speed"] == 0.0:
            return COMMANDS["jog_stop"]
        if command.name == "start" and self.service.processes.now().mode is Mode.HOLD:
            return COMMANDS["resume"]
        return None

    def close(self) -> None:
        """Nobody asks any more; what waits for a disk is done first."""
        self._answers.close()
        self._errands.shutdown(wait=True)

    # -- what the handlers do it with

    def ask(self, request: Request, value: float = 0.0, instead: Values | None = None, **told: Any) -> Answer:
        """A datagram to the tick, and what it answers; see ``Acknowledged``. Raises CommandRefused."""
        now = self.service.processes.now()
        if request in MOVES:
            preconditions.tick_goes_on(self.service, now, request.name)
        return self._answers.of(self.service.engine.request(request, value), request, told, instead)

    def answer_of(self, number: int, request: Request) -> Answer:
        """What the tick answers to a request that has gone out. Raises CommandRefused."""
        return self._answers.of(number, request, {})

    def part(self) -> Frame:
        """The frame of the program's positions that is active."""
        service = self.service
        found = service.engine.snapshot()
        if found is None:
            return service.set_up.machine.part()
        return service.run.in_force(found).modal.frame(service.set_up.machine)

    def sequence(
        self, name: str, work: Callable[[], Values], going: Going | None = None, behind: str = ""
    ) -> Answer:
        """What takes long. Raises CommandRefused where something else does."""
        found = self.service.engine.snapshot()
        mode = found.mode.name if found is not None else "OFF"
        return self.service.sequencer.do(name, work, mode, going, behind)

    def begin(self, name: str, job: Job) -> Answer:
        """Start a job that is no loaded program. Raises CommandRefused."""
        service, going = self.service, Going()
        preconditions.permitted(service, Request.START)
        preconditions.not_running(service, name.upper())
        preconditions.changer_is_sure(service, name.upper())
        return self.sequence(name, lambda: sequences.start(service, job, going), going)

    def new_load(self) -> Going:
        self._loading = Going()
        return self._loading

    def give_up_load(self) -> str:
        """Whoever stops, unloads or loads something else has no use for a check that goes on; its verb."""
        self._loading.give_up()
        if self.service.sequencer.busy != "load":
            return ""
        self.plan_gives_up()
        return "load"

    def plan_gives_up(self) -> None:
        with contextlib.suppress(CommandRefused):  # a plan that is gone has given it up
            self.service.engine.line.give_up()


def _read(command: Command, args: Values) -> Values:
    """Raises CommandRefused."""
    try:
        return command.read(args)
    except ArgumentError as error:
        raise CommandRefused("bad", said(error.key, **error.values)) from error


# ---- what a command does. One that is in neither table is a request to the tick, its argument the value


def _drives(service: Service) -> Values:
    return {"drives": service.processes.drives(service.set_up.machine, service.processes.now())}


def _buses(service: Service, _: Values) -> Values:
    return diagnostics.buses(service.set_up.machine, service.processes.logs, service.engine.recorder)


AT_ONCE: dict[str, Callable[[CommandHandlers, Values], Answer]] = {
    "status": lambda handlers, _: whole_status.status(handlers.service),
    "facts": lambda handlers, _: whole_status.facts(handlers.service),
    "probed": lambda handlers, _: {"found": handlers.service.probed.told()},
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
    "acknowledge": lambda service, values: {"acknowledged": service.alarms.acknowledge(values["id"])},
    "runs": lambda service, _: {"runs": runs.list_runs(service.state)},
    "rows": lambda service, values: diagnostics.rows(service.engine.recorder, values),
    "buses": _buses,
    "usage": lambda service, _: service.usage.told(),
    "tool_life": lambda service, values: usage.tool_life(service.usage, values),
    "tool_renewed": lambda service, values: usage.tool_renewed(service.usage, values),
    "maintenance": lambda service, values: usage.maintenance(service.usage, values),
    "maintained": lambda service, values: usage.maintained(service.usage, values),
    "changer": lambda service, _: tool_places.told(service),
    "changer_confirm": tool_places.confirm,
    "changer_pocket": tool_places.give_pocket,
}
