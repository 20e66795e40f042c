"""The virtual bus for other processes: a UNIX SEQPACKET server around a ``SteppedBus``.

What its packets hold is in ``hub_protocol``.
A frame counts as handed to the bus when the kernel took it from its sender (the
socket's time stamp), so a hub that wakes late delays deliveries but does not move
frames on the modelled wire, just as a CAN adapter takes a frame whatever its driver
does. A frame for which its client's queue has no room is refused by an error frame, as the
tick wants it; a client that calls itself patient is not read until there is room again.
SYNC is stamped where it leaves the wire; the stamps are saved at the end.

Being woken costs this computer more than what is done then. Where SYNC comes in a rhythm and nobody else
speaks, the hub is awake once per period, in its middle: what has come by then is taken as of when it was
sent, and feedback is there before the tick looks for it.

    SYNC, setpoints                              SYNC, setpoints
    |------------- wire: SYNC, TPDOs, RPDOs ---->|
                            | awake, TPDOs out   | the tick reads

Where nothing is said that was not said before, and nothing else waits, it is awake after ``STILL_LOOK_S``
only: the machine stands, and what its drives have to say then may come so late. Where SYNC was said ahead
of its time, nobody speaks until that is over: it is awake then, and misses no motion that begins.
"""

from __future__ import annotations

import contextlib
import math
import os
import socket
import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drives import pdo
from drives.bench.virtual.fault_script import FaultScript
from drives.bench.virtual.intake import Intake
from drives.bench.virtual.kernel_time import NOTE_BYTES, KernelTime, woken
from drives.bench.virtual.virtual_bus import STANDARD_MASK, SteppedBus
from drives.pdo import FRAME_BYTES
from drives.ports import hub_protocol
from drives.ports.error_frames import overflow_frame
from drives.ports.hub_protocol import FILTERED, GATHER_S, MAX_FRAMES, TIMED, lost_frame

PACKET_BYTES = hub_protocol.MAX_SENT * FRAME_BYTES
# Deliveries may be this late in favour of fewer wake-ups: a tick reads its frames once per
# period, and modelled times are not touched by it.
TIMEOUT_S = 100e-6
STILL_S = 0.2  # nothing new for so long: nothing moves
STILL_LOOK_S = 0.02  # being woken, with cold caches, costs as much as some four periods of five drives
SAID_AHEAD_LOOK = 2.5  # periods behind the last SYNC said ahead: the next ones are there by then
STOP_LOOK_S = 0.1  # a hub that nobody speaks to asks whether it is to go on
MAX_AHEAD_S = 1.0  # that a client may say what is to be sent
SLOWEST_S = 0.02  # rhythm of SYNC for which a client may wait
ALERT_S = 0.02  # after somebody besides the sender of SYNC has spoken, everybody is served at once


class SyncLog:
    """Times at which SYNC left the wire (CLOCK_MONOTONIC, s), preallocated; full = no more."""

    def __init__(self, capacity: int = 1_000_000) -> None:
        self._times_s = np.zeros(capacity)
        self._count = 0

    def __call__(self, _frame: bytes, at_s: float) -> None:
        if self._count < len(self._times_s):
            self._times_s[self._count] = at_s
            self._count += 1

    def times_s(self) -> NDArray[np.float64]:
        """Shape (number of SYNCs,)."""
        return self._times_s[: self._count]

    def save(self, path: str) -> None:
        """Write the times as .npy, whole or not at all."""
        unfinished = f"{path}.part"
        with open(unfinished, "wb") as file:
            np.save(file, self.times_s())
        os.replace(unfinished, path)


class Gateway(Protocol):
    """A further way onto the hub's bus."""

    def restart(self) -> None:
        """A client wants to leave bus-off, and the bus behind this gateway may be where it is that."""

    def close(self) -> None: ...


class Client:
    """One joined process; it has a CAN controller of its own."""

    def __init__(self, joined: socket.socket) -> None:
        self.socket = joined
        self.descriptor = joined.fileno()
        self.lost = 0  # frames its full receive queue refused
        self.source = -1
        self.filters: list[tuple[int, int]] = []
        self.many = self.timed = False  # what a packet to it holds
        self.gathers_until_s = 0.0
        self.patient = False
        self.intake: Intake | None = None
        self.held: tuple[bytes, float] | None = None  # what did not fit of its last packet, and its time
        self._told = 0  # of the lost ones, by a frame of their own
        self._heard: list[bytes] = []  # and not sent to it yet

    def put(self, frame: bytes, at_s: float) -> None:
        self._heard.append(TIMED.pack(at_s, frame) if self.timed else frame)

    def flush(self, now_s: float) -> None:
        """Send it what it has heard."""
        heard = self._heard
        if not heard or now_s < self.gathers_until_s:
            return
        if self.timed:
            self.gathers_until_s = now_s + GATHER_S
        most = MAX_FRAMES if self.many or self.timed else 1
        for start in range(0, len(heard), most):
            self._send(heard[start : start + most])
        heard.clear()

    def _send(self, frames: list[bytes]) -> None:
        try:
            if self._told != self.lost and not self.timed:
                self.socket.send(lost_frame(self.lost))
                self._told = self.lost
            self.socket.send(b"".join(frames))
        except BlockingIOError:
            self.lost += len(frames)
        except OSError:
            pass  # gone; the read side notices


def _listening(path: str) -> socket.socket:
    """The hub's socket; ``path`` appears, or changes hands, when it can be joined and not before."""
    own = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    unheard = f"{path}~"
    with contextlib.suppress(FileNotFoundError):
        os.unlink(unheard)
    own.bind(unheard)
    own.listen(16)
    own.setblocking(False)
    os.rename(unheard, path)
    return own


class Served:
    """A bus of simulated devices that is led on by the clock, and whoever reads when something has come."""

    def __init__(self, bit_rate: int, sync_log: bool, worst_stuffing: bool) -> None:
        self.bus = SteppedBus(bit_rate, time.monotonic(), worst_stuffing)
        self.syncs = SyncLog(1_000_000 if sync_log else 0)
        self.bus.watch(pdo.SYNC, self.syncs)
        self._faults: FaultScript | None = None
        self._gateways: list[Gateway] = []
        self._readers: dict[int, Callable[[], None]] = {}  # by file descriptor
        self._clocks = KernelTime()

    def listen(self, descriptor: int, reader: Callable[[], None]) -> None:
        """Call ``reader`` when ``descriptor`` has something to read."""
        self._readers[descriptor] = reader

    def forget(self, descriptor: int) -> None:
        """End ``listen``."""
        self._readers.pop(descriptor, None)

    def open_gateway(self, gateway: Gateway) -> None:
        """Keep a gateway to the devices' bus until ``close``."""
        self._gateways.append(gateway)

    def plan_faults(self, faults: FaultScript) -> None:
        """Have these faults happen from the beginning of ``run``, to frames of the devices' bus."""
        self._faults = faults

    def _begin(self) -> None:
        """Raises ScriptError for a fault of a node that is not here."""
        if self._faults is not None:
            self._faults.inject(self.bus, self.bus.now_s)
            self._faults = None

    def _read_and_advance(self, readable: Sequence[int], now_s: float) -> None:
        """What has come by then, and the bus until then.

        Not beyond: what was handed over since is read next time, and has not begun in the meantime.
        """
        for one in readable:
            reader = self._readers.get(one)  # one reader may have closed another's descriptor
            if reader is not None:
                reader()
        self.bus.advance(max(self.bus.now_s, now_s))

    def close(self) -> None:
        for gateway in self._gateways:
            gateway.close()


class Hub(Served):
    """The server; ``turn`` does everything that is due and waits at most until ``until_s``.

    ``faults`` happen by the bus' clock from the beginning of ``run``; ``log`` gets every
    frame (a ``FrameLog``, a ``candump.Writer``). Gateways (``drives.bench.options``) add their
    descriptors by ``listen``.
    """

    def __init__(
        self,
        path: str,
        bit_rate: int = 1_000_000,
        sync_log: bool = True,
        faults: FaultScript | None = None,
        log: Callable[[bytes, float], None] | None = None,
        worst_stuffing: bool = False,
    ) -> None:
        """Raises OSError when the path cannot be bound."""
        self.path = path
        super().__init__(bit_rate, sync_log, worst_stuffing)
        if log is not None:
            self.bus.watch_all(log)
        self._faults = faults
        self._clients: dict[int, Client] = {}  # by file descriptor
        self.watchers: list[Callable[[float], None]] = []  # of what the devices do: told the time
        self._server = _listening(path)
        self.listen(self._server.fileno(), self._accept)
        self._master: Client | None = None  # who sends SYNC, and when it last did
        self._sync_s, self._gap_s, self._period_s = 0.0, math.inf, math.inf
        self._alert_until_s = 0.0

    # -- time

    def turn(self, until_s: float) -> None:
        """Wait for a frame or the next event, then let the bus catch up with the clock."""
        now_s = time.monotonic()
        looks_s = self._looks_s(now_s)
        looked_for = list(self._readers)
        if looks_s and self._master is not None and self._master.descriptor in looked_for:
            looked_for.remove(self._master.descriptor)
        event_s = looks_s or self.bus.next_event_s() + TIMEOUT_S
        now_s, readable = woken(looked_for, max(0.0, min(event_s, until_s) - now_s))
        if looks_s and self._master is not None:
            if readable:
                self._alert_until_s = now_s + ALERT_S
            readable.append(self._master.descriptor)
        self._read_and_advance(readable, now_s)
        for client in self._clients.values():
            client.flush(self.bus.now_s)
        for watch in self.watchers:
            watch(self.bus.now_s)

    def _looks_s(self, now_s: float) -> float:
        """When the next look at what the sender of SYNC has sent is early enough; 0 = look at once."""
        master, period_s = self._master, self._period_s
        late_s = now_s - self._sync_s
        if master is None or period_s > SLOWEST_S or late_s >= 1.5 * period_s or now_s < self._alert_until_s:
            return 0.0
        alone = all(client.many or client.timed for client in self._clients.values()) and not self._gateways
        if not alone:
            return 0.0
        if now_s - self.bus.new_s > STILL_S and self.bus.repeats:
            quiet = max(1, round(STILL_LOOK_S / period_s)) + 0.5 if late_s >= 0.0 else SAID_AHEAD_LOOK
            return self._sync_s + quiet * period_s
        if not self.bus.is_only_for(master.source):
            return 0.0
        return self._sync_s + (0.5 if late_s < 0.5 * period_s else 1.5) * period_s

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop()`` says so, which is asked after each turn.

        Raises ScriptError for a fault of a node that is not here.
        """
        self._begin()
        while not stop():
            self._clocks.look()
            self.turn(time.monotonic() + STOP_LOOK_S)

    def close(self) -> None:
        super().close()
        for client in self._clients.values():
            client.flush(math.inf)
            client.socket.close()
        self._clients.clear()
        self._server.close()
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.path)

    # -- clients

    def _accept(self) -> None:
        joined, _ = self._server.accept()
        joined.setblocking(False)
        self._clocks.ask(joined)
        client = Client(joined)
        client.source = self.bus.connect(client.put)
        self._clients[client.descriptor] = client
        client.intake = Intake(self, client.descriptor, lambda: self._read(client))

    def _read(self, client: Client) -> bool:
        """Everything a client has sent, up to its last packet; False if it has to wait with some of it."""
        if client.held is not None:
            packet, at_s = client.held
            client.held = None
            if not self._submit(client, packet, max(at_s, self.bus.now_s)):
                return False
        while True:
            try:
                packet, notes, _, _ = client.socket.recvmsg(PACKET_BYTES, NOTE_BYTES)
            except BlockingIOError:
                return True
            except OSError:
                packet, notes = b"", []
            if not packet:
                self._drop(client)
                return True
            if not self._submit(client, packet, self._clocks.taken_s(notes, self.bus.now_s)):
                return False

    def _submit(self, client: Client, packet: bytes, at_s: float) -> bool:
        """Hand a packet on; False if the rest of it is held until a queue has room."""
        if self._are_setpoints(client, packet):
            self.bus.submit_packet(client.source, at_s, packet)
            return True
        begins_s = at_s
        for start in range(0, len(packet) - FRAME_BYTES + 1, FRAME_BYTES):
            frame = packet[start : start + FRAME_BYTES]
            can_id = int.from_bytes(frame[:4], "little")
            if can_id == hub_protocol.AHEAD:
                due_s = int.from_bytes(frame[8:16], "little") * 1e-9
                begins_s = min(max(due_s, at_s), at_s + MAX_AHEAD_S)
                continue
            if can_id & pdo.ERROR_FLAG and self._order(client, can_id, frame):
                continue
            if can_id == pdo.SYNC:
                self._keep_time(client, begins_s)
            if frame[4] > 8 or self.bus.submit(client.source, begins_s, can_id, frame):
                continue
            if client.patient and self.bus.is_full(client.source):
                client.held = (packet[start:], at_s)
                return False
            self.bus.advance(at_s)  # it was full then only if it is full now
            if not self.bus.submit(client.source, at_s, can_id, frame):
                self._refuse(client, at_s)
        return True

    def _are_setpoints(self, client: Client, packet: bytes) -> bool:
        """Whether these are several plain frames for which there is room: nobody need look at each."""
        if len(packet) <= FRAME_BYTES or len(packet) % FRAME_BYTES:
            return False
        for can_id, length in pdo.HEADERS(packet):
            if not pdo.SYNC < can_id <= STANDARD_MASK or length > 8:
                return False
        return self.bus.has_room(client.source, len(packet) // FRAME_BYTES)

    def _order(self, client: Client, can_id: int, frame: bytes) -> bool:
        """What a control frame asks for; False where it is none."""
        if can_id == hub_protocol.RESTART:
            self._restart(client)
        elif can_id == hub_protocol.PATIENT:
            client.patient = True
        elif can_id == hub_protocol.MANY:
            client.many = True
        elif can_id == hub_protocol.TIMES:
            client.flush(math.inf)
            client.timed = True
        elif can_id == hub_protocol.FILTER:
            client.filters.append(FILTERED.unpack_from(frame, pdo.DATA_AT))
            self.bus.listen_only_to(client.source, client.filters)
        else:
            return False
        return True

    def _keep_time(self, client: Client, at_s: float) -> None:
        """The rhythm of SYNC: the shorter of the last two gaps, for after a late one comes one in time.

        ``at_s``: its own, which may be still to come.
        """
        gap_s = at_s - self._sync_s if client is self._master else math.inf
        self._period_s, self._gap_s = min(gap_s, self._gap_s), gap_s
        self._master, self._sync_s = client, at_s

    def _refuse(self, client: Client, at_s: float) -> None:
        """The client believes its frame to be sent: an error frame tells what ENOBUFS would have told."""
        if self.bus.errors.hears(client.source):
            client.put(overflow_frame(), at_s)

    def _restart(self, client: Client) -> None:
        self.bus.errors.restart(self.bus.errors.of(client.source), self.bus.now_s)
        for gateway in self._gateways:
            gateway.restart()

    def _drop(self, client: Client) -> None:
        self._clients.pop(client.descriptor, None)
        if client is self._master:
            self._master = None
        if client.intake is not None:
            client.intake.close()
        self.bus.disconnect(client.source)
        client.socket.close()
