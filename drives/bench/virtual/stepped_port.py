"""What sits on a stepped bus besides the devices: the controller's port, cyclic SYNC, an agenda."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from struct import Struct
from typing import TYPE_CHECKING, Final

from drives import pdo
from drives.pdo import FRAME_BYTES

if TYPE_CHECKING:
    from drives.bench.virtual.virtual_bus import Filters, Handler, Link, SteppedBus

PORT_LIMIT: Final = 1024  # received frames kept for a port that does not read; the oldest go first

SYNC_FRAME = bytes(pdo.frame(pdo.SYNC))
_IDENTIFIER: Final = Struct("<I").unpack_from


class Port:
    """The controller's side of a stepped bus: the same calls as its frame sockets have."""

    packs = True  # send takes several frames at once

    def __init__(self, bus: SteppedBus, filters: Filters | None) -> None:
        self.overflows = 0  # frames lost because nobody read
        self._bus = bus
        self._queue: deque[bytes] = deque(maxlen=PORT_LIMIT)
        self._source = bus.connect(self._put, filters, bus.controller)

    def _put(self, frame: bytes, _at_s: float) -> None:
        queue = self._queue
        if len(queue) == PORT_LIMIT:
            self.overflows += 1
        queue.append(frame)

    def fileno(self) -> int:
        return -1  # nothing to wait for: time passes by ``advance``

    def send(self, frame: bytes | bytearray | memoryview) -> bool:
        """Queue 16-byte frames, one or several, at the bus's present time; False when the queue is full."""
        bus, packet = self._bus, bytes(frame)
        if len(packet) == FRAME_BYTES:
            return bus.submit(self._source, bus.now_s, _IDENTIFIER(packet)[0], packet)
        return bus.submit_packet(self._source, bus.now_s, packet)

    def receive_into(self, buffer: bytearray | memoryview) -> bool:
        """The oldest received frame into ``buffer[:16]``; False when there is none."""
        if not self._queue:
            return False
        buffer[:FRAME_BYTES] = self._queue.popleft()
        return True

    def start_cyclic_sync(self, period_s: float) -> None:
        self._bus.cyclic_sync(self._source, period_s)

    def stop_cyclic_sync(self) -> None:
        self._bus.cyclic_sync(self._source, 0.0)

    def restart(self) -> None:
        """Has a bus-off controller take part again, as 'ip link set can0 type can restart' does."""
        self._bus.errors.restart(self._bus.errors.of(self._source), self._bus.now_s)

    def close(self) -> None:
        self._bus.disconnect(self._source)


class Metronome:
    """The kernel's cyclic SYNC: exact deadlines, stopped when its owner leaves."""

    def __init__(self) -> None:
        self.due_s = math.inf
        self._owner = -1
        self._period_s = 0.0
        self._link: Link | None = None

    def join(self, link: Link, _now_s: float) -> None:
        self._link = link

    def listens(self) -> dict[int, Handler]:
        return {}

    def run(self, owner: int, period_s: float, now_s: float) -> None:
        self._owner, self._period_s = owner, period_s
        self.due_s = now_s + period_s if period_s > 0.0 else math.inf
        if self._link is not None:
            self._link.wake(self.due_s)

    def release(self, owner: int) -> bool:
        """End it if this owner's SYNC is running; whether it was."""
        was_running = owner == self._owner
        if was_running:
            self.run(-1, 0.0, 0.0)
        return was_running

    def timer(self, now_s: float) -> None:
        self.due_s = now_s + self._period_s
        if self._link is not None:
            self._link.send(now_s, pdo.SYNC, SYNC_FRAME)


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
