"""What a stepped bus needs of a node, and the one that every bus has: an agenda."""

from __future__ import annotations

import math
from collections.abc import Callable
from heapq import heappop, heappush
from typing import Protocol

Handler = Callable[[bytes, float], None]  # called with a frame, and the time at which it has arrived


class Node(Protocol):
    """What can be attached to the bus: a device with identifiers it hears and a timer."""

    due_s: float  # when ``timer`` wants to run next; inf = never

    def join(self, link: Link, now_s: float) -> None:
        """Called once with the way to the bus."""

    def listens(self) -> dict[int, Handler]:
        """Handlers by identifier; called again after ``link.relisten()``."""

    def timer(self, now_s: float) -> None:
        """Runs when ``due_s`` is reached."""


class Link:
    """A node's way to the bus."""

    __slots__ = ("bit_rate", "relisten", "send", "wake")

    def __init__(
        self,
        bit_rate: int,
        send: Callable[[float, int, bytes], bool],
        wake: Callable[[float], None],
        relisten: Callable[[], None],
    ) -> None:
        self.bit_rate = bit_rate  # 0 = without bit timing
        self.send = send  # (at_s, can_id, frame) -> bool: at_s may lie ahead (an answer that takes its time)
        self.wake = wake  # the node's due_s has come nearer
        self.relisten = relisten  # listens() gives something new


class Agenda:
    """Things to do at a time, for whoever is no device: restarts of controllers, injected faults."""

    def __init__(self) -> None:
        self.due_s = math.inf
        self._things: list[tuple[float, int, Callable[[float], None]]] = []
        self._sequence = 0
        self._link: Link | None = None

    def join(self, link: Link, _now_s: float) -> None:
        self._link = link

    def listens(self) -> dict[int, Handler]:
        return {}

    def add(self, at_s: float, what: Callable[[float], None]) -> None:
        """Call ``what(now_s)`` at a time; of the same time, in the order of adding."""
        self._sequence += 1
        heappush(self._things, (at_s, self._sequence, what))
        self.due_s = self._things[0][0]
        if self._link is not None:
            self._link.wake(self.due_s)

    def timer(self, now_s: float) -> None:
        while self._things and self._things[0][0] <= now_s:
            heappop(self._things)[2](now_s)
        self.due_s = self._things[0][0] if self._things else math.inf
