"""Events for pages and scripts: what changes is sent to every listener, as JSON texts.

    {"event": "status", "data": {...}}    20 times a second, as GET /api/v1/status; 5 where no axis moves
    {"event": "job", "data": {...}}       another program, or another state of it; null = none
    {"event": "alarm", "data": {...}}     a fault is there; null = it was reset
    {"event": "alarms", "data": {...}}    the list of alarms changed: the newest number
    {"event": "control", "data": {...}}   somebody took or gave the control token
    {"event": "programs", "data": {...}}  the store changed, or a check ended: name and what was done
    {"event": "service", "data": {...}}   whether the controller's service answers

Who asks for ``changes`` gets the status whole only once, and then what of it is another value, by its path:

    {"event": "changes", "data": {"tick/number": 4711, "joints/X/work": 12.5}}

A text is made once for all listeners of a language. One who reads slowly misses statuses, never the others,
until too many wait: then it is let go. Nothing is asked of the machine while nobody listens.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from controller import messages
from controller.api.answers import Refusal
from controller.api.past import Past
from controller.api.roles import Principal, Role
from controller.api.service_client import Watch

INTERVAL_S = 0.05
REST_S = 0.2  # from one status to the next of a machine at rest, of which nobody has asked anything
SPOKEN_S = 1.0  # after a request something is about to move
STORE_EVERY_S = 1.0  # from one look at the list of alarms to the next
MAX_WAITING = 500
MAX_LISTENERS = 100
FOR_OPERATORS = 20  # of them: who may only look cannot keep out who may operate
MAX_OF_ONE = 20  # of a user at one address
RESTS = ("OFF", "READY")  # modes in which no axis moves before somebody asks for it
TOPICS = ("status", "job", "alarm", "alarms", "control", "programs", "service")


@dataclass(slots=True)
class Listener:
    """One who listens."""

    topics: frozenset[str]
    owner: tuple[str, str] = ("", "")  # name and address
    language: str = messages.DEFAULT
    changes: bool = False  # of the status what is new
    lost: bool = False  # did not read for too long
    _status: str = ""
    _now: Any = None  # the status as data ...
    _before: Any = None  # ... and as it was when it was sent last
    _waiting: deque[str] = field(default_factory=deque)
    _there: asyncio.Event = field(default_factory=asyncio.Event)

    def tell(self, topic: str, text: str, data: Any = None) -> None:
        if topic not in self.topics:
            return
        if topic == "status":
            self._status, self._now = text, data  # the older one is of no use any more
        elif len(self._waiting) < MAX_WAITING:
            self._waiting.append(text)
        else:
            self.lost = True
        self._there.set()

    async def next(self) -> list[str]:
        """What came since, at least one text; the status last."""
        await self._there.wait()
        self._there.clear()
        texts = [*self._waiting, *([self._newest()] if self._status else [])]
        self._waiting.clear()
        self._status = ""
        return texts

    def _newest(self) -> str:
        if not self.changes:
            return self._status
        before, self._before = self._before, self._now
        found = None if before is None else changed(before, self._now)
        return self._status if found is None else _text("changes", found)


class Events:
    """Watches the machine while anybody listens."""

    def __init__(self, watch: Watch, past: Past) -> None:
        self._watch, self._past = watch, past
        self._listeners: list[Listener] = []
        self._wanted = asyncio.Event()
        self._told: dict[str, Any] = {}  # by topic: what was sent last of what is sent on change

    @property
    def listeners(self) -> int:
        return len(self._listeners)

    @contextmanager
    def listening(
        self,
        topics: frozenset[str],
        who: Principal,
        address: str = "",
        language: str = messages.DEFAULT,
        changes: bool = False,
    ) -> Iterator[Listener]:
        """A listener, which gets at once what holds now. Raises Refusal."""
        self._check_room(who, address)
        listener = Listener(topics, (who.name, address), language, changes)
        for topic, data in self._told.items() if self._listeners else ():
            listener.tell(topic, _text(topic, messages.with_sentences(data, language)))
        self._listeners.append(listener)
        self._wanted.set()
        self._watch.asked.set()
        try:
            yield listener
        finally:
            self._listeners.remove(listener)

    def _check_room(self, who: Principal, address: str) -> None:
        """Raises Refusal where the asker, or all of its role, have as many listeners as they may."""
        own = sum(one.owner == (who.name, address) for one in self._listeners)
        if own >= MAX_OF_ONE:
            raise Refusal.of(429, "too_often", "many_listeners_of_one", name=who.name, most=MAX_OF_ONE)
        most = MAX_LISTENERS - (0 if who.role >= Role.OPERATE else FOR_OPERATORS)
        if len(self._listeners) >= most:
            raise Refusal.of(429, "too_often", "many_listeners", most=most)

    def tell(self, topic: str, data: Any) -> None:
        """Tell all listeners of the topic."""
        told: dict[str, tuple[str, Any]] = {}
        for listener in self._listeners:
            if listener.language not in told:
                words = messages.with_sentences(data, listener.language)
                told[listener.language] = _text(topic, words), words
            listener.tell(topic, *told[listener.language])

    async def run(self) -> None:
        """Never ends."""
        alarms_s = 0.0  # when they were looked at
        while True:
            if not self._listeners:
                self._wanted.clear()
                self._told.clear()
                await self._wanted.wait()
            self._watch.asked.clear()
            rests = await self._look()
            if time.monotonic() - alarms_s >= STORE_EVERY_S:
                alarms_s = time.monotonic()
                await self._look_at_alarms()
            looked_s = time.monotonic()
            if rests and self._watch.silent_s > SPOKEN_S:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._watch.asked.wait(), REST_S)
            await asyncio.sleep(max(0.0, looked_s + INTERVAL_S - time.monotonic()))

    async def _look(self) -> bool:
        """Whether the machine is at rest."""
        try:
            status = await self._watch.status()
        except Refusal as refusal:
            self._changed("service", {"answers": False, **refusal.said})
            return False
        self._changed("service", {"answers": True})
        self.tell("status", status)
        self._changed("alarm", status.get("fault"))
        job = status.get("job") or {}
        self._changed("job", {key: job.get(key) for key in ("name", "sha256", "state")} if job else None)
        under_way = (status.get("sequence") or {}).get("state") == "running"
        return bool(status.get("at_rest")) and status.get("mode") in RESTS and not under_way

    async def _look_at_alarms(self) -> None:
        newest = await self._past.ask_if_there(lambda past: past.alarms(1))
        if newest is not None:
            self._changed("alarms", {"newest": newest[0].id if newest else None})

    def _changed(self, topic: str, data: Any) -> None:
        if topic not in self._told or self._told[topic] != data:
            self._told[topic] = data
            self.tell(topic, data)


def _text(topic: str, data: Any) -> str:
    return json.dumps({"event": topic, "data": data}, separators=(",", ":"))


def changed(before: dict[str, Any], after: dict[str, Any]) -> dict[str, Any] | None:
    """What is another value, by its path through the objects; None where the objects have other keys."""
    if before.keys() != after.keys():
        return None
    found: dict[str, Any] = {}
    for key, value in after.items():
        was = before[key]
        if value == was and type(value) is type(was):
            continue
        inner = None
        if isinstance(value, dict) and isinstance(was, dict) and not any("/" in name for name in value):
            inner = changed(was, value)
        found |= {key: value} if inner is None else {f"{key}/{path}": one for path, one in inner.items()}
    return found
