"""A CAN bus without hardware: arbitration by identifier and the time every frame takes.

``SteppedBus`` is the bus itself, advanced by whoever owns the clock: the stepped
clock of tests and simulations calls ``advance`` once per tick, ``drives.hub`` calls
it from the wall clock and lets other processes join. Frames are 16 bytes as in
Linux' ``struct can_frame``. One frame at a time is on the wire; when it ends, the
lowest identifier among the waiting ones goes next, so a period that overloads a
real bus overloads this one. Every sender is taken to have a mailbox for each of its
waiting frames (arbitration among all of them), which is what the budget assumes too.

Nodes are objects in the same process (simulated drives); ports are for the
controller and look like its frame sockets.
"""

from __future__ import annotations

import math
import socket
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from heapq import heappop, heappush
from typing import Protocol

from drives import pdo
from drives.budget import worst_bits
from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, FRAME, FRAME_BYTES, REMOTE_FLAG

CYCLIC_SYNC = ERROR_FLAG | 1  # to the hub: data u32 = period in us, 0 = stop

SYNC_FRAME = bytes(pdo.frame(pdo.SYNC))

EXTENDED_BITS = 25  # 20 more in the frame (SRR, IDE, 18 of the identifier) and their stuffing
QUEUE_LIMIT = 256  # frames one sender may have waiting; SocketCAN's txqueuelen plays this part
PORT_LIMIT = 1024  # received frames kept for a port that does not read; the oldest go first

Handler = Callable[[bytes, float], None]
Filters = Sequence[tuple[int, int]]
Tamper = Callable[[float, int, bytes], Sequence[float]]


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

    __slots__ = ("relisten", "send", "wake")

    def __init__(self, bus: SteppedBus, source: int) -> None:
        # send(at_s, can_id, frame) -> bool: at_s may lie ahead (an answer that takes its time)
        self.send: Callable[[float, int, bytes], bool] = partial(bus.submit, source)
        self.wake: Callable[[float], None] = bus.wake  # the node's due_s has come nearer
        self.relisten: Callable[[], None] = bus.forget_routes  # listens() gives something new


class SteppedBus:
    """The bus in process. ``bit_rate`` 0 switches the bit timing off: frames arrive at once."""

    def __init__(self, bit_rate: int = 1_000_000, start_s: float = 0.0) -> None:
        self.now_s = start_s
        self.due_s = math.inf  # earliest timer of all nodes
        self.busy_s = 0.0  # time the wire was taken, for load figures
        self.frames = 0
        self.tamper: Tamper | None = None
        bit_s = 1.0 / bit_rate if bit_rate else 0.0
        self._time_s = [worst_bits(n) * bit_s for n in range(9)]
        self._extended_s = [(worst_bits(n) + EXTENDED_BITS) * bit_s for n in range(9)]
        self._free_s = start_s  # when the wire is idle again
        self._flying: tuple[int, int, bytes] | None = None  # on the wire: id, source, frame
        self._ready: list[tuple[int, int, int, bytes]] = []  # heap: id, sequence, source, frame
        self._pending: list[tuple[float, int, int, int, bytes]] = []  # heap: time, id, ...
        self._sequence = 0
        self._waiting: list[int] = []  # frames by source
        self._routes: list[dict[int, tuple[Handler, ...]]] = []  # by source, by identifier
        self._nodes: dict[int, Node] = {}  # by source
        self._ports: dict[int, tuple[Handler, Filters | None]] = {}  # by source
        self._watches: list[tuple[int, Handler]] = []
        self._metronome = Metronome()
        self.attach(self._metronome)

    # -- who is on the bus

    def attach(self, node: Node) -> None:
        """Connect a node; its ``join`` is called with its link."""
        source = self._source()
        self._nodes[source] = node
        self.forget_routes()
        node.join(Link(self, source), self.now_s)
        self.wake(node.due_s)

    def port(self, filters: Filters | None = None) -> Port:
        """A frame socket on this bus; ``filters`` are (identifier, mask) pairs, None = everything."""
        return Port(self, filters)

    def connect(self, handler: Handler, filters: Filters | None = None) -> int:
        """Have ``handler`` called with every frame of other senders; returns the source to send as."""
        source = self._source()
        self._ports[source] = (handler, filters)
        self.forget_routes()
        return source

    def disconnect(self, source: int) -> None:
        """Take a connection off the bus; its waiting frames still go out."""
        self._ports.pop(source, None)
        self._metronome.release(source)
        self.forget_routes()

    def watch(self, can_id: int, handler: Handler) -> None:
        """Have ``handler`` called with every frame of one identifier, whoever sent it."""
        self._watches.append((can_id, handler))
        self.forget_routes()

    def cyclic_sync(self, source: int, period_s: float) -> None:
        """Send SYNC every ``period_s`` from now on, as SocketCAN's broadcast manager does; 0 stops it."""
        self._metronome.run(source, period_s, self.now_s)

    # -- frames

    def submit(self, source: int, at_s: float, can_id: int, frame: bytes) -> bool:
        """Put a frame (16 bytes) up for arbitration from ``at_s`` on; False if the queue is full."""
        if self.tamper is not None:
            return self._tampered(source, at_s, can_id, frame)
        waiting = self._waiting
        if waiting[source] >= QUEUE_LIMIT:
            return False
        waiting[source] += 1
        self._sequence += 1
        heappush(self._pending, (at_s, can_id, self._sequence, source, frame))
        return True

    def _tampered(self, source: int, at_s: float, can_id: int, frame: bytes) -> bool:
        """Fault injection: the hook gives one delay per copy; none = lost, two = duplicated."""
        if self.tamper is None or self._waiting[source] >= QUEUE_LIMIT:
            return False
        for delay_s in self.tamper(at_s, can_id, frame):
            self._waiting[source] += 1
            self._sequence += 1
            heappush(self._pending, (at_s + delay_s, can_id, self._sequence, source, frame))
        return True

    def wake(self, at_s: float) -> None:
        """Run the timers at ``at_s`` at the latest; a time gone by means now."""
        if at_s < self.due_s:
            self.due_s = max(at_s, self.now_s)

    def forget_routes(self) -> None:
        for routes in self._routes:
            routes.clear()

    def next_event_s(self) -> float:
        """When something will happen next if nobody sends: a delivery, a start or a timer; inf = never."""
        if self._flying is not None or self._ready:
            return min(self._free_s, self.due_s)
        return min(self._pending[0][0] if self._pending else math.inf, self.due_s)

    def advance(self, now_s: float) -> None:
        """Let everything happen that happens up to ``now_s``: deliveries and timers in their order."""
        self._carry(now_s)
        while self.due_s <= now_s:
            self._run_timers(self.due_s)
            self._carry(now_s)
        self.now_s = now_s

    def _carry(self, until_s: float) -> None:
        """Carry frames that end by ``until_s`` and before the next timer.

        submit ---> pending (by time) ---> ready (by identifier) ---> wire ---> routes
        """
        pending, ready, waiting = self._pending, self._ready, self._waiting
        while True:
            limit_s = until_s if until_s < self.due_s else self.due_s
            if self._flying is not None:
                if self._free_s > limit_s:
                    return
                can_id, source, frame = self._flying
                self._flying = None
                self.now_s = self._free_s
                routes = self._routes[source].get(can_id)
                if routes is None:
                    routes = self._route(source, can_id)
                for handler in routes:
                    handler(frame, self._free_s)
                continue  # a handler may have brought the next timer nearer
            start_s = self._free_s
            if not ready:
                if not pending or pending[0][0] > limit_s:
                    return
                start_s = max(start_s, pending[0][0])
            while pending and pending[0][0] <= start_s:
                _, can_id, sequence, source, frame = heappop(pending)
                heappush(ready, (can_id, sequence, source, frame))
            can_id, _, source, frame = heappop(ready)
            waiting[source] -= 1
            taken_s = self._time_s[frame[4]] if can_id < 0x800 else self._odd_time(can_id, frame[4])
            self.busy_s += taken_s
            self.frames += 1
            self._free_s = start_s + taken_s
            self._flying = (can_id, source, frame)

    def _odd_time(self, can_id: int, length: int) -> float:
        """Wire time of all but plain data frames; a remote frame carries no data, an error frame is short."""
        table = self._extended_s if can_id & EXTENDED_FLAG else self._time_s
        return table[0 if can_id & (REMOTE_FLAG | ERROR_FLAG) else length]

    def _run_timers(self, now_s: float) -> None:
        self.now_s = now_s
        for node in self._nodes.values():
            if node.due_s <= now_s:
                node.timer(now_s)
        self.due_s = max(now_s, min(node.due_s for node in self._nodes.values()))

    def _source(self) -> int:
        self._waiting.append(0)
        self._routes.append({})
        return len(self._waiting) - 1

    def _route(self, source: int, can_id: int) -> tuple[Handler, ...]:
        """Who hears ``can_id`` when ``source`` sends it; error frames reach every port."""
        heard = [handler for wanted, handler in self._watches if wanted == can_id]
        for other, (handler, filters) in self._ports.items():
            if other != source and (filters is None or can_id & ERROR_FLAG or passes(filters, can_id)):
                heard.append(handler)
        for other, node in self._nodes.items():
            node_handler = node.listens().get(can_id)
            if other != source and node_handler is not None:
                heard.append(node_handler)
        self._routes[source][can_id] = tuple(heard)
        return self._routes[source][can_id]


def passes(filters: Filters, can_id: int) -> bool:
    """CAN_RAW_FILTER's rule: one pair whose identifier agrees under its mask is enough."""
    return any(can_id & mask == wanted & mask for wanted, mask in filters)


class Port:
    """The controller's side of a stepped bus: the same calls as its frame sockets have."""

    packs = True  # send takes several frames at once

    def __init__(self, bus: SteppedBus, filters: Filters | None) -> None:
        self._bus = bus
        self._queue: deque[bytes] = deque(maxlen=PORT_LIMIT)
        self._source = bus.connect(self._put, filters)

    def _put(self, frame: bytes, _at_s: float) -> None:
        self._queue.append(frame)

    def fileno(self) -> int:
        return -1  # nothing to wait for: time passes by ``advance``

    def send(self, frame: bytes | bytearray | memoryview) -> bool:
        """Queue 16-byte frames, one or several, at the bus's present time; False when the queue is full."""
        if len(frame) != FRAME_BYTES:
            return all([self.send(frame[at : at + FRAME_BYTES]) for at in range(0, len(frame), FRAME_BYTES)])
        bus = self._bus
        return bus.submit(self._source, bus.now_s, int.from_bytes(frame[:4], "little"), bytes(frame))

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

    def release(self, owner: int) -> None:
        if owner == self._owner:
            self.run(-1, 0.0, 0.0)

    def timer(self, now_s: float) -> None:
        self.due_s = now_s + self._period_s
        if self._link is not None:
            self._link.send(now_s, pdo.SYNC, SYNC_FRAME)


def connect(path: str) -> socket.socket:
    """Join the hub at ``path``: a SEQPACKET socket whose packets are 16-byte frames.

    Raises OSError when there is no hub.
    """
    joined = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        joined.connect(path)
    except OSError:
        joined.close()
        raise
    return joined


def cyclic_sync_frame(period_s: float) -> bytes:
    """The control frame that asks the hub for a cyclic SYNC (0 = stop)."""
    return FRAME.pack(CYCLIC_SYNC, 4, round(period_s * 1e6).to_bytes(4, "little"))
