"""A CAN bus without hardware: arbitration by the bits on the wire, and the time every frame takes.

``SteppedBus`` is the bus itself, advanced by whoever owns the clock: the stepped
clock of tests and simulations calls ``advance`` once per tick, ``drives.bench.virtual.hub`` calls
it from the wall clock and lets other processes join. Frames are 16 bytes as in
Linux' ``struct can_frame``. One frame at a time is on the wire, for as long as this very
frame takes with its check sum and stuff bits (``drives.load.stuffing``); when it ends, the
one that wins the arbitration (``arbitration``) goes next, so a period that overloads a
real bus overloads this one. Every sender is taken to have a mailbox for each of its
waiting frames (arbitration among all of them), which is what the budget assumes too.

Nodes are objects in the same process (simulated drives); ports are for the
controller and look like its frame sockets. Every device has error counters, and
those of the controller's ports on one bus are shared, for they stand for one CAN
interface. Faults come from outside: ``fault_injector`` judges each frame as it
begins, and takes devices off the bus.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
from functools import partial
from heapq import heapify, heappop, heappush, heappushpop
from struct import Struct
from typing import Final, Protocol

from drives import pdo
from drives.bench.virtual.error_counters import Confinement, Controller, Level
from drives.bench.virtual.nodes import Agenda, Handler, Link, Node
from drives.load import stuffing
from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, FRAME_BYTES, REMOTE_FLAG

# Who goes first on a CAN bus: the bits on the wire, of which the dominant one (0) wins (ISO 11898-1, 10.4).
#
#     standard   identifier 11 | RTR | IDE 0 |
#     extended   base       11 | SRR 1 | IDE 1 | identifier's other 18 | RTR
#
# As one number of 32 bits, highest first, the lowest of which wins: of one base identifier the standard
# data frame, then the standard remote frame, then the extended frames. Linux's flags in front of an
# identifier would put every extended and every remote frame behind all others.

BASE_AT: Final = 21  # the shift of an 11-bit identifier, which is all that a standard data frame needs
SUBSTITUTE, EXTENSION = 1 << 20, 1 << 19  # RTR or SRR, IDE
STANDARD_MASK, EXTENSION_MASK = 0x7FF, 0x3FFFF
LAST = 1 << 32  # behind everything: an error frame is a word to ports, and no frame on a wire


def rank(can_id: int) -> int:
    """The number of an identifier with Linux's flags; the lower one wins the arbitration."""
    last = LAST if can_id & ERROR_FLAG else 0
    asks = bool(can_id & REMOTE_FLAG)
    if can_id & EXTENDED_FLAG:
        base = (can_id >> 18 & STANDARD_MASK) << BASE_AT
        return last | base | SUBSTITUTE | EXTENSION | (can_id & EXTENSION_MASK) << 1 | asks
    return last | (can_id & STANDARD_MASK) << BASE_AT | asks * SUBSTITUTE


__all__ = ["PORT_LIMIT", "QUEUE_LIMIT", "Fate", "Filters", "Handler", "Link", "Node", "Port", "SteppedBus"]

ERROR_FRAME_BITS = 23  # error flags of all (12 at most), delimiter 8, intermission 3
PORT_LIMIT: Final = 1024  # received frames kept for a port that does not read; the oldest go first
QUEUE_LIMIT: Final = 256  # frames one sender may have waiting; SocketCAN's txqueuelen plays this part
# Who may not send has so many frames "waiting": the queue's limit, looked at anyway, refuses more.
MUTED: Final = 1 << 30

Log = Callable[[tuple[float, bytes]], object]
Filters = Sequence[tuple[int, int]]
Tamper = Callable[[float, int, bytes], Sequence[float]]
_IDENTIFIER: Final = Struct("<I").unpack_from
_IDENTIFIERS: Final = Struct("<I12x").iter_unpack
_Ready = tuple[int, int, int, int, bytes]  # rank, sequence, source, id, frame
_NOT_YET: Final = (b"", 0.0)  # carried
MAX_CARRIED = 4096  # identifiers of which the last frame is known
_Pending = tuple[float, _Ready]  # from when on it may take part in the arbitration


class Fate(Enum):
    """What becomes of a frame that is about to begin, if it is not carried as usual."""

    LOST = "lost"  # it takes its time on the wire, and nobody hears it
    WITHHELD = "withheld"  # it does not begin; who withheld it may submit it later
    SPOILT = "spoilt"  # an error frame ends it, both sides count, its sender tries again


class Faults(Protocol):
    """Judges frames: see ``drives.bench.virtual.fault_injector``."""

    def judge(self, start_s: float, can_id: int, sequence: int, source: int, frame: bytes) -> bytes | Fate:
        """The frame to carry (the same, or falsified), or another fate."""


class SteppedBus:
    """The bus in process. ``bit_rate`` 0 switches the bit timing off: frames arrive at once.

    ``worst_stuffing``: every frame takes as long as the rule of stuffing allows, which is what the
    bus budget judges by, in place of its own length.
    """

    def __init__(self, bit_rate: int = 1_000_000, start_s: float = 0.0, worst_stuffing: bool = False) -> None:
        self.now_s = start_s
        self.bit_rate = bit_rate
        self.due_s = math.inf  # earliest timer of all nodes
        self.busy_s = 0.0  # time the wire was taken, for load figures
        self.frames = 0
        self.tamper: Tamper | None = None
        self._bit_s = 1.0 / bit_rate if bit_rate else 0.0
        self._bits: stuffing.Counter = stuffing.worst_case if worst_stuffing else stuffing.counter()
        self._carried: dict[int, tuple[bytes, float]] = {}  # by identifier: the last frame, and its seconds
        self.new_s = start_s  # when a frame began that was not the same as the last one of its identifier
        self._free_s = start_s  # when the wire is idle again
        self._flying: _Ready | None = None  # on the wire
        self._ready: list[_Ready] = []  # heap
        self._pending: deque[_Pending] = deque()  # by time
        self._sequence = 0
        self._waiting: list[int] = []  # frames by source
        self._routes: list[dict[int, tuple[Handler, ...]]] = []  # by source, by identifier
        self._nodes: dict[int, Node] = {}  # by source
        self._ports: dict[int, tuple[Handler, Filters | None]] = {}  # by source
        self._watches: list[tuple[int | None, Handler]] = []
        self._logs: list[Log] = []
        self.errors = Confinement(self)
        self.controller = Controller()  # of all ports: they stand for one CAN interface
        self.faults: Faults | None = None
        self._error_s = ERROR_FRAME_BITS * self._bit_s
        self._nowhere = self._source()  # frames that nobody hears fly as if sent by this one
        self._sync_source = -1
        self.agenda = Agenda()
        self.attach(self.agenda)

    # -- who is on the bus

    def attach(self, node: Node) -> int:
        """Connect a node; its ``join`` is called with its link. Returns the source it sends as."""
        source = self._source()
        self._nodes[source] = node
        self.forget_routes()
        send = partial(self.submit, source)
        node.join(Link(self.bit_rate, send, self.wake, self.forget_routes), self.now_s)
        self.wake(node.due_s)
        return source

    def port(self, filters: Filters | None = None) -> Port:
        """A frame socket on this bus; ``filters`` are (identifier, mask) pairs, None = everything."""
        return Port(self, filters)

    def connect(
        self, handler: Handler, filters: Filters | None = None, controller: Controller | None = None
    ) -> int:
        """Have ``handler`` called with every frame of other senders; returns the source to send as.

        ``controller``: whose error counters are used; without one the connection has its own.
        """
        source = self._source(controller)
        self._ports[source] = (handler, filters)
        self.forget_routes()
        return source

    def disconnect(self, source: int) -> None:
        """Take a connection off the bus; its waiting frames still go out."""
        self._ports.pop(source, None)
        if source == self._sync_source:
            self._sync_source = -1
        self.forget_routes()

    def listen_only_to(self, source: int, filters: Filters) -> None:
        """Another ``filters`` for a connection."""
        self._ports[source] = (self._ports[source][0], filters)
        self.forget_routes()

    def watch(self, can_id: int, handler: Handler) -> None:
        """Have ``handler`` called with every frame of one identifier, whoever sent it."""
        self._watches.append((can_id, handler))
        self.forget_routes()

    def watch_all(self, handler: Handler) -> None:
        """Have ``handler`` called with every frame that is heard at all, whoever sent it."""
        self._watches.append((None, handler))
        self.forget_routes()

    def log(self, keep: Log) -> None:
        """Have every frame that is heard at all kept with its time: as ``watch_all``, at half the cost."""
        self._logs.append(keep)

    def source_of(self, node_id: int) -> int:
        """The source that the device with a CANopen node id sends as. Raises KeyError."""
        for source, node in self._nodes.items():
            if getattr(node, "node_id", None) == node_id:
                return source
        raise KeyError(node_id)

    def device(self, source: int) -> Node:
        """The node behind a source. Raises KeyError."""
        return self._nodes[source]

    @property
    def masters(self) -> Controller:
        """The CAN controller of who sends SYNC; of the ports, as long as nobody has."""
        return self.errors.of(self._sync_source) if self._sync_source >= 0 else self.controller

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
        order = can_id << BASE_AT if can_id < 0x800 else rank(can_id)
        ready = order, self._sequence, source, can_id, frame
        pending = self._pending
        if pending and at_s < pending[-1][0]:
            self._put(at_s, ready)
        else:
            pending.append((at_s, ready))
        return True

    def _put(self, at_s: float, ready: _Ready) -> None:
        """Among those that wait for their time; most are submitted in that order."""
        pending, place = self._pending, 0
        for other_s, _ in pending:
            if other_s > at_s:
                break
            place += 1
        pending.insert(place, (at_s, ready))

    def submit_packet(self, source: int, at_s: float, packet: bytes) -> bool:
        """Put several frames up, one behind the other; False if the queue did not take all of them."""
        waiting, pending, good, at = self._waiting, self._pending, True, 0
        for (can_id,) in _IDENTIFIERS(packet):
            frame = packet[at : at + FRAME_BYTES]
            at += FRAME_BYTES
            if self.tamper is not None or can_id >= 0x800 or (pending and at_s < pending[-1][0]):
                good = self.submit(source, at_s, can_id, frame) and good
            elif waiting[source] < QUEUE_LIMIT:
                waiting[source] += 1
                self._sequence += 1
                pending.append((at_s, (can_id << BASE_AT, self._sequence, source, can_id, frame)))
            else:
                good = False
        return good

    def _tampered(self, source: int, at_s: float, can_id: int, frame: bytes) -> bool:
        """Fault injection: the hook gives one delay per copy; none = lost, two = duplicated."""
        if self.tamper is None or self._waiting[source] >= QUEUE_LIMIT:
            return False
        for delay_s in self.tamper(at_s, can_id, frame):
            self._waiting[source] += 1
            self._sequence += 1
            self._put(at_s + delay_s, (rank(can_id), self._sequence, source, can_id, frame))
        return True

    def submit_again(self, source: int, at_s: float, can_id: int, frame: bytes) -> int:
        """Put a withheld frame, or a copy, up for arbitration; returns the sequence it is judged by."""
        self._sequence += 1
        if self._waiting[source] < MUTED // 2:
            self._waiting[source] += 1
            self._put(at_s, (rank(can_id), self._sequence, source, can_id, frame))
        return self._sequence

    def is_full(self, source: int) -> bool:
        """Whether a frame more of this source has to wait until one of its others has gone out."""
        return QUEUE_LIMIT <= self._waiting[source] < MUTED // 2

    def has_room(self, source: int, frames: int) -> bool:
        """Whether so many frames more of this source can wait."""
        return self._waiting[source] + frames <= QUEUE_LIMIT

    @property
    def repeats(self) -> bool:
        """Whether every frame that waits has been said before: it is the same as its identifier's last."""
        carried, waiting = self._carried, [*self._ready, *(ready for _, ready in self._pending)]
        return all(frame == carried.get(can_id, _NOT_YET)[0] for _, _, _, can_id, frame in waiting)

    def is_only_for(self, source: int) -> bool:
        """Whether nobody but this source has a frame on the wire, or one that waits for it."""
        flying = self._flying
        waiting = len(self._ready) + len(self._pending)
        return (flying is None or flying[2] == source) and waiting == self._waiting[source]

    def wake(self, at_s: float) -> None:
        """Run the timers at ``at_s`` at the latest; a time gone by means now."""
        if at_s < self.due_s:
            self.due_s = max(at_s, self.now_s)

    def frame_s(self, can_id: int, frame: bytes) -> float:
        """Time on the wire of a frame with interframe space; 0 without bit timing."""
        return self._bits(can_id, frame) * self._bit_s

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

        submit ---> pending (by time) ---> ready (by arbitration) ---> wire ---> routes
        """
        pending, ready = self._pending, self._ready
        if self._flying is not None:
            if self._free_s > until_s:
                return
        elif not ready and (not pending or pending[0][0] > until_s):
            return
        waiting, carried, all_routes = self._waiting, self._carried, self._routes
        errors, logs, nowhere = self.errors, self._logs, self._nowhere
        bits, bit_s = self._bits, self._bit_s
        # Nobody whom a frame reaches asks what is on the wire: that is put down at the end.
        free_s, flying, busy_s, frames = self._free_s, self._flying, self.busy_s, self.frames
        start_s = free_s
        if flying is not None:
            _, sequence, source, can_id, frame = flying
        while True:
            if flying is not None:
                if start_s > until_s or start_s > self.due_s:
                    break
                flying = None
                self.now_s = start_s
                if source != nowhere:
                    for keep in logs:
                        keep((start_s, frame))
                routes = all_routes[source].get(can_id)
                if routes is None:
                    routes = self._route(source, can_id)
                for handler in routes:
                    handler(frame, start_s)
            if not ready:
                if not pending:
                    break
                first_s = pending[0][0]
                # A handler may have brought the next timer nearer.
                if first_s > until_s or first_s > self.due_s:
                    break
                if first_s > start_s:
                    start_s = first_s
            if pending and pending[0][0] <= start_s:
                flying = pending.popleft()[1]
                while pending and pending[0][0] <= start_s:
                    heappush(ready, flying)
                    flying = pending.popleft()[1]
                if ready:
                    flying = heappushpop(ready, flying)
            else:
                flying = heappop(ready)
            _, sequence, source, can_id, frame = flying
            waiting[source] -= 1
            before, taken_s = carried.get(can_id, _NOT_YET)
            if frame != before:  # an axis at rest says the same with every SYNC
                if len(carried) > MAX_CARRIED:
                    carried.clear()
                taken_s = bits(can_id, frame) * bit_s
                carried[can_id] = frame, taken_s
                self.new_s = start_s
            if self.faults is not None or errors.troubled:
                fate = self._judged(start_s, can_id, sequence, source, frame)
                if fate is Fate.WITHHELD:
                    start_s, flying = free_s, None
                    continue
                if fate is Fate.SPOILT:
                    taken_s += self._error_s
                if isinstance(fate, Fate):
                    source = nowhere
                else:
                    frame = fate
                flying = flying[0], sequence, source, can_id, frame
            busy_s += taken_s
            frames += 1
            free_s = start_s = start_s + taken_s
        self._free_s, self._flying, self.busy_s, self.frames = free_s, flying, busy_s, frames

    def _run_timers(self, now_s: float) -> None:
        self.now_s = now_s
        for node in self._nodes.values():
            if node.due_s <= now_s:
                node.timer(now_s)
        self.due_s = max(now_s, min([node.due_s for node in self._nodes.values()]))

    def _source(self, controller: Controller | None = None) -> int:
        controller = controller or Controller()
        self.errors.add(controller)
        self._waiting.append(MUTED if controller.level is Level.OFF else 0)
        self._routes.append({})
        return len(self._waiting) - 1

    # -- errors

    def _judged(self, start_s: float, can_id: int, sequence: int, source: int, frame: bytes) -> bytes | Fate:
        """Ask the faults, and count errors and successes of everybody on the bus."""
        fate = self.faults.judge(start_s, can_id, sequence, source, frame) if self.faults else frame
        if fate is Fate.SPOILT:
            self._waiting[source] += 1
            heappush(self._ready, (rank(can_id), sequence, source, can_id, frame))
            self.errors.spoilt(source, start_s)
        elif self.errors.troubled and fate is not Fate.WITHHELD:
            self.errors.carried(source, start_s)
        return fate

    def mute(self, source: int) -> None:
        """Nothing more of this source goes out; what it had waiting is gone."""
        self._waiting[source] = MUTED
        left = [entry for entry in self._pending if entry[1][2] != source]
        self._pending.clear()
        self._pending.extend(left)
        self._ready[:] = [entry for entry in self._ready if entry[2] != source]
        heapify(self._ready)

    def take_no_more(self, source: int) -> None:
        """Refuse what this source wants to send from now on; what it had waiting goes out."""
        if self._waiting[source] < QUEUE_LIMIT:
            self._waiting[source] += MUTED

    def take_again(self, source: int) -> None:
        """End ``mute`` or ``take_no_more``."""
        if self._waiting[source] >= MUTED // 2:
            self._waiting[source] -= MUTED

    # -- routes

    def is_port(self, source: int) -> bool:
        return source in self._ports

    def hand(self, frame: bytes, at_s: float, sources: Sequence[int]) -> None:
        """Give a frame to the ports among some sources, past the wire, and to who watches everything."""
        ports = [self._ports[source][0] for source in sources if source in self._ports]
        logs = [handler for wanted, handler in self._watches if wanted is None] if ports else []
        for handler in ports + logs:
            handler(frame, at_s)
        for keep in self._logs if ports else ():
            keep((at_s, frame))

    def _route(self, source: int, can_id: int) -> tuple[Handler, ...]:
        """Who hears ``can_id`` when ``source`` sends it; error frames reach every port."""
        if source == self._nowhere:
            return ()
        if can_id == pdo.SYNC and self._sync_source < 0:
            self._sync_source = source  # the first stays it: a second producer is a fault
        heard = [handler for wanted, handler in self._watches if wanted is None or wanted == can_id]
        for other, (handler, filters) in self._ports.items():
            wanted = filters is None or can_id & ERROR_FLAG or passes(filters, can_id)
            if other != source and wanted and self.errors.hears(other):
                heard.append(handler)
        for other, node in self._nodes.items():
            node_handler = node.listens().get(can_id)
            if other != source and node_handler is not None and self.errors.hears(other):
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

    def restart(self) -> None:
        """Has a bus-off controller take part again, as 'ip link set can0 type can restart' does."""
        self._bus.errors.restart(self._bus.errors.of(self._source), self._bus.now_s)

    def close(self) -> None:
        self._bus.disconnect(self._source)
