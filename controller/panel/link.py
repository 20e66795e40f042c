"""The panel's end of the door: asks the controller's service, and keeps the last status for all.

Quick verbs and slow ones have threads of their own, so that a hold never waits behind loads.
The status is asked at most every ``FRESH_S``, however many want to know it: neither 20
listeners nor a script that asks without pause load the machine.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from anyio import CapacityLimiter, to_thread

from controller.door import Client, DoorError
from controller.panel.answers import Refusal

FRESH_S = 0.025  # half of the interval of the events
QUICK_S = 5.0
SLOW_S = 600.0  # a whole program may have to be read
QUICK_AT_ONCE, SLOW_AT_ONCE = 32, 8  # together fewer than the door has places
SLOW = frozenset(
    {"load", "unload", "mdi", "enable", "home", "reset", "retract", "return", "set_offset", "set_tool"}
)
# "bad" is no 422: what the schema cannot say (a word of a program, an axis that this machine
# has not) depends on the machine, and so does whether it is refused.
STATUSES = {"refused": 409, "busy": 409, "bad": 409, "gone": 503}


class Door(Protocol):
    """Whatever answers the verbs of the local protocol."""

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        """The result. Raises Refusal."""
        ...


class SocketDoor:
    """The service behind its socket."""

    def __init__(self, path: Path) -> None:
        self._clients = {False: Client(path, QUICK_S), True: Client(path, SLOW_S)}
        self._limiters: dict[bool, CapacityLimiter] = {}

    async def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        """The result of a verb. Raises Refusal with the service's own sentence."""
        slow = verb in SLOW
        asked = partial(self._clients[slow].ask, verb, **args)
        try:
            return await to_thread.run_sync(asked, abandon_on_cancel=True, limiter=self._limiter(slow))
        except DoorError as error:
            raise refusal(error) from error

    def _limiter(self, slow: bool) -> CapacityLimiter:
        """Made within the event loop that uses it."""
        most = SLOW_AT_ONCE if slow else QUICK_AT_ONCE
        return self._limiters.setdefault(slow, CapacityLimiter(most))

    def close(self) -> None:
        for client in self._clients.values():
            client.close()


def refusal(error: DoorError) -> Refusal:
    """What the service said, as an answer."""
    return Refusal(
        STATUSES.get(error.code, 503),
        error.code,
        error.sentence or "The controller's service refused without a reason; see its log.",
        mode=error.mode or None,
        request=error.request or None,
        sentence_de=error.sentence_de or None,
    )


class Watch:
    """The machine's status, asked once for all who want it at about the same time."""

    def __init__(self, door: Door) -> None:
        self._door = door
        self._asking = asyncio.Lock()
        self._last: dict[str, Any] = {}
        self._at_s = -1e9

    async def status(self) -> dict[str, Any]:
        """At most ``FRESH_S`` old. Raises Refusal."""
        async with self._asking:
            if time.monotonic() - self._at_s > FRESH_S:
                self._last = await self._door.ask("status")
                self._at_s = time.monotonic()
            return self._last

    async def in_use(self) -> frozenset[str]:
        """Name and sha256 of the loaded program: its file must stay as it is.

        A service that is gone uses nothing.
        """
        try:
            job = (await self._door.ask("status")).get("job")
        except Refusal:
            return frozenset()
        return _named(job) if isinstance(job, Mapping) else frozenset()


def _named(job: Mapping[str, Any]) -> frozenset[str]:
    return frozenset(str(job[key]) for key in ("name", "sha256") if job.get(key))
