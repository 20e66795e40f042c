"""The panel's end of the door: asks the controller's service, and keeps the last status for all.

Commands go in lanes, as their table says, each with threads of its own: a stop never waits for anything
else, a move only for moves, and what waits for a disk or a plan is in nobody's way, however many ask.
The status is asked at most every ``FRESH_S``, however many want to know it: neither 20
listeners nor a script that asks without pause load the machine. But whoever was answered reads a
status of after that answer.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Protocol

from anyio import CapacityLimiter, to_thread

from controller.api.answers import Refusal
from controller.api.store import Store
from controller.commands.command import Access, Lane
from controller.commands.table import ALL, COMMANDS
from controller.ipc.asker import asker
from controller.ipc.control_socket import Client, CommandRefused

FRESH_S = 0.025  # half of the interval of the events
QUICK_S = 5.0
SLOW_S = 600.0  # a whole program may have to be read
TELLS = frozenset(command.name for command in ALL if command.access is Access.LOOK)  # they change nothing
# "bad" is no 422: what the schema cannot say (a word of a program, an axis that this machine
# has not) depends on the machine, and so does whether it is refused.
STATUSES = {
    **dict.fromkeys(("refused", "busy", "bad", "unrecorded", "worn", "moves"), 409),
    "role": 403,
    "missing": 404,
    "gone": 503,
}


class ServiceClient(Protocol):
    """Whatever answers the verbs of the local protocol."""

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        """The result. Raises Refusal."""
        ...


@dataclass
class Way:
    """Commands that may be in each other's way, and how many of them are asked at once."""

    at_once: int
    client: Client

    @cached_property
    def places(self) -> CapacityLimiter:
        """Made within the event loop that uses it."""
        return CapacityLimiter(self.at_once)


class SocketServiceClient:
    """The service behind its socket."""

    def __init__(self, path: Path) -> None:
        # All places together are fewer than the socket has.
        self._ways = {
            Lane.STOP: Way(8, Client(path, QUICK_S)),
            Lane.LOOK: Way(8, Client(path, QUICK_S)),
            Lane.SLOW: Way(8, Client(path, SLOW_S)),
            Lane.QUICK: Way(16, Client(path, QUICK_S)),
        }

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        """The result of a verb. Raises Refusal with the service's own sentence."""
        command = COMMANDS.get(verb)
        way = self._ways[command.way if command is not None else Lane.QUICK]
        asked = partial(way.client.ask_for, asker.get(), verb, args)
        try:
            return await to_thread.run_sync(asked, abandon_on_cancel=True, limiter=way.places)
        except CommandRefused as error:
            raise refusal(error) from error

    def close(self) -> None:
        for way in self._ways.values():
            way.client.close()


def refusal(error: CommandRefused) -> Refusal:
    """What the service said, as an answer."""
    status = STATUSES.get(error.code, 503)
    return Refusal(status, error.code, error.said, mode=error.mode or None, request=error.request or None)


class Watch:
    """The door, and the machine's status asked once for all who want it at about the same time."""

    def __init__(self, door: ServiceClient) -> None:
        self._door = door
        self._asking = asyncio.Lock()
        self._last: dict[str, Any] = {}
        self.asked = asyncio.Event()  # set by whatever may change the machine, and by who wants to know it
        self._asked_s = self._answered_s = self._fresh_to_s = -1e9  # monotonic
        self._heard_s, self._lost_s = -math.inf, math.inf  # likewise: heard last; gone since, or before that

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        """As the door's."""
        try:
            answer = await self._door.ask(verb, **args)
            self._heard_s, self._lost_s = time.monotonic(), math.inf
            return answer
        except Refusal as refused:
            if refused.facts.code == "gone":
                self._lost_s = min(self._lost_s, time.monotonic())
            raise
        finally:
            if verb not in TELLS:
                self._answered_s = time.monotonic()
                self.asked.set()

    @property
    def silent_s(self) -> float:
        """Since something was asked that may change the machine."""
        return time.monotonic() - self._answered_s

    def gone_s(self, by_clock_s: float) -> float:
        """For how long the service is gone: by the wall's clock, which may have been set since, but at least
        since it was missed, and at most since it was heard.
        """
        now_s = time.monotonic()
        return min(max(by_clock_s, now_s - self._lost_s, 0.0), now_s - self._heard_s)

    async def status(self) -> dict[str, Any]:
        """At most ``FRESH_S`` old, and asked for after the last answer. Raises Refusal."""
        async with self._asking:
            asked_s = time.monotonic()
            if asked_s > self._fresh_to_s or self._asked_s < self._answered_s:
                self._last = await self.ask("status")
                self._asked_s, self._fresh_to_s = asked_s, time.monotonic() + FRESH_S
            return self._last

    async def in_use(self) -> frozenset[str]:
        """Name and sha256 of the loaded program: its file must stay as it is.

        A service that is gone uses nothing. One that does not answer may have a tick that cuts: Refusal.
        """
        try:
            job = (await self._door.ask("status")).get("job")
        except Refusal as refused:
            if refused.facts.code != "gone":
                raise
            return frozenset()
        return _named(job) if isinstance(job, Mapping) else frozenset()


def _named(job: Mapping[str, Any]) -> frozenset[str]:
    return frozenset(str(job[key]) for key in ("name", "sha256") if job.get(key))


# A program of the store, given to the service to be loaded.


async def load(store: Store, door: ServiceClient, name: str, **where: Any) -> dict[str, Any]:
    """What the service answers; "done" is false while it is still being read. Raises Refusal, StoreError."""
    program = await asyncio.to_thread(store.programs.get, name)
    if files := await asyncio.to_thread(store.programs.called, program):
        where |= {"files": files}
    path = str(store.programs.path(program.sha256))
    return await door.ask("load", path=path, name=program.name, sha256=program.sha256, **where)
