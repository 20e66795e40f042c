"""What came of a request, told to whoever asked for it: the tick's own answer, by the request's number.

The door's thread waits for nothing: one thread looks for all that is asked, and fulfils a promise.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Protocol

from controller.ipc.control_socket import Answer, CommandRefused, Values
from controller.ipc.handoff import Outcome, Snapshot
from controller.machine.model import Machine
from controller.messages import Key, Message
from controller.service.refusals import by_fault, by_now, refused
from controller.state import modes
from controller.state.modes import Fault, Request

LONGEST_S = 5.0  # for the tick to answer: it takes requests in every turn
POLL_S = 0.002


class HasTick(Protocol):
    """Where snapshots come from."""

    @property
    def tick_alive(self) -> bool: ...
    def snapshot(self) -> Snapshot | None: ...


@dataclass(slots=True)
class _Asked:
    """One request that has gone out; ``instead``: what is told where the tick had no use for it."""

    number: int
    request: Request
    told: Values
    instead: Values | None
    give_up_s: float
    promise: Future[Values] = field(default_factory=Future)


class Acknowledged:
    """Promises of answers, fulfilled as the snapshots have them."""

    def __init__(self, machine: Machine, engine: Callable[[], HasTick]) -> None:
        self._machine, self._engine = machine, engine
        self._open: list[_Asked] = []
        self._changed, self._over = threading.Condition(), False
        threading.Thread(target=self._look, name="answers", daemon=True).start()

    def of(self, number: int, request: Request, told: Values, instead: Values | None = None) -> Answer:
        """What came of a request that has just gone out: ``told`` with outcome, mode and tick.

        ``instead`` is told where the tick refuses it, but it was of use here. Raises CommandRefused.
        """
        asked = _Asked(number, request, told, instead, time.monotonic() + LONGEST_S)
        if not self._answered(asked):
            with self._changed:
                self._open.append(asked)
                self._changed.notify()
            return asked.promise
        return asked.promise.result()

    def close(self) -> None:
        """Look for nothing any more."""
        with self._changed:
            self._over = True
            self._changed.notify()

    def _look(self) -> None:
        while not self._over:
            with self._changed:
                self._changed.wait_for(lambda: self._open or self._over)
                waiting = tuple(self._open)
            still = [asked for asked in waiting if not self._answered(asked)]
            with self._changed:
                self._open = still + self._open[len(waiting) :]
            time.sleep(POLL_S)

    def _answered(self, asked: _Asked) -> bool:
        """Whether its promise is fulfilled by now."""
        try:
            now = self._engine().snapshot()
            answer = self._answer(asked, now)
            if answer is None:
                self._see_whether_it_comes(asked, now)
                return False
            asked.promise.set_result(answer)
        except Exception as error:  # whatever it is, somebody waits for it
            asked.promise.set_exception(error)
        return True

    def _see_whether_it_comes(self, asked: _Asked, now: Snapshot | None) -> None:
        """Raises CommandRefused where nobody will answer any more."""
        if not self._engine().tick_alive:
            raise refused("no_tick", code="gone", request=asked.request.name)
        if time.monotonic() > asked.give_up_s:
            mode, what = now.mode.name if now is not None else "", Key("answer")
            raise refused("waited", mode, asked.request.name, "silent", seconds=LONGEST_S, what=what)

    def _answer(self, asked: _Asked, now: Snapshot | None) -> Values | None:
        """None: there is none yet. Raises CommandRefused where the tick refused it."""
        if now is None or (came := now.came_of(asked.number)[0]) is Outcome.NONE:
            return None
        facts = {"mode": now.mode.name, "tick": now.tick}
        if came is not Outcome.REFUSED:
            return {**facts, "outcome": came.name.lower(), **asked.told}
        if asked.instead is not None:
            return {**facts, **asked.instead}
        raise why_refused(self._machine, now, asked.number, asked.request)


def why_refused(machine: Machine, now: Snapshot, number: int, request: Request) -> CommandRefused:
    """The tick's refusal of a request; ``now``: the first snapshot that has it."""
    why = now.came_of(number)[1]
    if why is not Fault.NONE:
        return by_fault(why, now.mode.name, request.name)
    said = refusal(machine, now, request)
    return CommandRefused("refused", said, now.mode.name, request.name) if said else by_now(now, request.name)


def refusal(machine: Machine, now: Snapshot, request: Request) -> Message | None:
    """Why the machine as it is refuses a request; None where it does not."""
    return modes.refusal(
        now.mode,
        request,
        standing=now.at_rest,
        homed=now.homed,
        untrusted=now.untrusted,
        interlock=now.interlock,
        away=now.away,
        axes=[axis.name for axis in machine.axes],
    )
