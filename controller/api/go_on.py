"""The queue goes on by itself: what is next is loaded and started when a run has ended whole.

That is chosen by whoever holds control, the first run is started by a hand, and it ends, with a sentence
that says why, as soon as anything is not as it was then: control went to another, or its page is silent;
a run ended in any other way; somebody pressed hold, stop or e-stop, or switched the drives off; something
else is loaded; the machine refuses. It is not kept: after a restart of the panel nothing starts by itself.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from controller.api import service_client
from controller.api.answers import Refusal
from controller.api.database import StoreError
from controller.api.notices import in_words
from controller.api.past import Past
from controller.api.program_queue import Ended, Entry
from controller.api.roles import Control, Role
from controller.api.service_client import ServiceClient
from controller.api.store import Store
from controller.commands import table
from controller.ipc.asker import Asker, asker
from controller.messages import Message, from_facts, message

POLL_S = 0.5
SILENT_S = 15.0  # a page that holds control is heard of every five seconds
ENDS = table.ENDS - {"jog_stop"}  # a key that goes up stops nothing that the queue has begun

Note = Callable[[str, str, str, str], None]


class GoOn:
    """``choose`` it, ``end`` it; ``run`` looks for ever."""

    def __init__(self, store: Store, past: Past, door: ServiceClient, control: Control, note: Note) -> None:
        self._store, self._past, self._door, self._control, self._note = store, past, door, control, note
        self._since_s: float | None = None  # of the hold of control for which it was chosen; None: it is off
        self.why: Message | None = None  # it ended

    @property
    def on(self) -> bool:
        return self._since_s is not None

    def choose(self, on: bool) -> None:
        """By whoever holds control now."""
        self._since_s = self._control.since_s if on else None
        self.why = None

    def on_command(self, verb: str) -> None:
        """It ends when the machine gets a command of ``ENDS``."""
        if verb in ENDS:
            self.end("queue_stopped")

    def end(self, key: str, **values: Any) -> None:
        """Nothing starts by itself any more."""
        self._end(message(key, **values))

    def _end(self, why: Message) -> None:
        if self.on:
            self._since_s, self.why = None, why

    async def run(self) -> None:
        """Never ends."""
        while True:
            await self.look()
            await asyncio.sleep(POLL_S)

    async def look(self) -> None:
        """Count what has ended, and go on where that is chosen; without a queue nothing is asked. Raises
        StoreError.
        """
        if await asyncio.to_thread(self._store.queue.all):
            for ended in await self._past.ask_if_there(self._store.queue.count_runs) or ():
                await self._after(ended)

    async def _after(self, ended: Ended) -> None:
        if not self._may():
            return
        if ended.result != "completed":
            return self.end("queue_run", program=ended.program, result=in_words(ended.result))
        front = await asyncio.to_thread(self._store.queue.front)
        if ended.counted and front is None:
            self.end("queue_done")
        elif ended.counted and front is not None:
            await self._next(ended.program, front)

    def _may(self) -> bool:
        """Whoever chose it still holds control, and is there."""
        silent_s = self._control.silent_s
        if self.on and (self._control.since_s != self._since_s or silent_s is None or silent_s > SILENT_S):
            self.end("queue_control")
        return self.on

    async def _next(self, last: str, front: Entry) -> None:
        try:
            # By now it is nobody's request: it is for whoever holds control, and may start programs.
            asker.set(Asker(self._control.holder, Role.OPERATE.label))
            if await self._stands(last, "completed"):
                await service_client.load(self._store, self._door, front.program)
                await self._started(front.program)
        except (Refusal, StoreError) as error:
            self._end(error.said)

    async def _started(self, program: str) -> None:
        """Wait until it is read, and start it where all is as it was. Raises Refusal."""
        while _state(await self._door.ask("status"), program) == "loading" and self._may():
            await asyncio.sleep(POLL_S)
        if await self._stands(program, "loaded") and self._may():
            self._note(self._control.holder, "", "queue start", program)
            await self._door.ask("start")

    async def _stands(self, program: str, state: str) -> bool:
        """The machine is ready, and that program is the one and in that state. Raises Refusal."""
        told = await self._door.ask("status")
        if ready := told["mode"] == "READY" and _state(told, program) == state:
            return ready
        job: dict[str, Any] = told.get("job") or {}
        self._end(from_facts(job) or message("queue_other", program=program))
        return False


def _state(told: dict[str, Any], program: str) -> str:
    """Of the job, where it is that program; else "other"."""
    job: dict[str, Any] = told.get("job") or {}
    return str(job.get("state")) if job.get("name") == program else "other"
