"""What the handlers of commands have at hand: service, answers of the tick, sequencer, pressed jog keys."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

from controller.commands.table import Request
from controller.geometry.vectors import Frame
from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.service import preconditions, sequences
from controller.service.acknowledged import Acknowledged
from controller.service.jobs import Job
from controller.service.jogging import Jogging, Presses
from controller.service.sequencer import Going
from controller.service.service import Service
from controller.state.modes import MOVES


class HandlerContext:
    """Of one service; ``close`` it."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self.jogging, self.presses = Jogging(), Presses()
        self._answers = Acknowledged(service.set_up.machine, lambda: service.engine)
        self._loading = Going()  # the last program that is loaded or let go of: only that counts

    def close(self) -> None:
        """Nobody asks any more."""
        self._answers.close()

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

    def begin(self, name: str, job: Job, still: bool = False) -> Answer:
        """Start a job that is no loaded program; ``still``: if nothing moves by it. Raises CommandRefused."""
        service, going = self.service, Going()
        preconditions.permitted(service, Request.START)
        preconditions.not_running(service, name.upper())
        preconditions.changer_is_sure(service, name.upper())
        if still:
            preconditions.stands_still(service, job, name.upper())
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
