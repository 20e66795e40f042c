"""One small class per way onto a bus: 16-byte frames out and in, never blocking, never raising.

    virtual     the hub's UNIX SEQPACKET socket (virtual_bus.py)
    socketcan   a raw CAN socket of Linux, opened with the standard library alone
    otherwise   any python-can adapter, by its interface name: slower, for long periods

Opening raises BusError with a sentence. After that the tick owns the descriptor and
gets booleans: whatever the socket has to say (queue full, interface down, peer
gone) is False, and the group's supervision makes a fault of it.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from drives import pdo, virtual_bus
from drives.settings import BusSettings

if TYPE_CHECKING:
    import can

Buffer = bytes | bytearray | memoryview

# Room for what arrives while the tick is late; the kernel's default held 278 frames.
RECEIVE_BYTES = 1 << 20

# Error classes that end a motion (linux/can/error.h): controller problems, bus-off, restarted.
ERROR_CLASSES = 0x004 | 0x040 | 0x100

CAN_RAW_ERR_FILTER = 2  # linux/can/raw.h; the standard library's name is not everywhere

HUB_PACKET_BYTES = 256 * pdo.FRAME_BYTES


class BusError(Exception):
    """A bus cannot be opened or used as configured; the text says which and what to do."""


class Port(Protocol):
    """What the tick needs of a bus; the stepped clock's bus is one too."""

    def send(self, frame: Buffer, /) -> bool:
        """Queues one frame; False if it did not go out."""
        ...

    def receive_into(self, buffer: bytearray, /) -> bool:
        """Puts the next frame into the first 16 bytes of ``buffer``; False if there is none."""
        ...

    def start_cyclic_sync(self, period_s: float, /) -> None:
        """Has SYNC sent every ``period_s`` without us; BusError where nobody can do that."""
        ...

    def stop_cyclic_sync(self) -> None:
        """Ends what ``start_cyclic_sync`` began; the next SYNC does not go out."""
        ...

    def close(self) -> None:
        """Leaves the bus."""
        ...


class FrameSocket:
    """A non-blocking descriptor that carries one 16-byte frame per packet."""

    packs = False  # whether `send` takes several frames in one packet

    def __init__(self, sock: socket.socket, name: str) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
        self.name = name
        self._socket = sock
        self._send = sock.send
        self._receive_into = sock.recv_into

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, frame: Buffer) -> bool:
        try:
            return self._send(frame) == len(frame)
        except OSError:
            return False

    def receive_into(self, buffer: bytearray) -> bool:
        try:
            return self._receive_into(buffer, pdo.FRAME_BYTES) == pdo.FRAME_BYTES
        except OSError:
            return False

    def start_cyclic_sync(self, period_s: float) -> None:
        """Has SYNC sent every ``period_s`` without us; BusError where nobody can do that."""
        raise BusError(
            f'bus {self.name}: sync = "kernel" needs socketcan or the virtual bus; use sync = "tick"'
        )

    def stop_cyclic_sync(self) -> None:
        """Ends what ``start_cyclic_sync`` began; the next SYNC does not go out."""

    def close(self) -> None:
        self.stop_cyclic_sync()
        self._socket.close()


class HubSocket(FrameSocket):
    """A client of the virtual bus: a packet holds one or more frames, both ways."""

    packs = True

    def __init__(self, sock: socket.socket, name: str) -> None:
        super().__init__(sock, name)
        self._packet = bytearray(HUB_PACKET_BYTES)
        self._view = memoryview(self._packet)
        self._at = 0
        self._end = 0
        self._cyclic_sync = False

    def receive_into(self, buffer: bytearray) -> bool:
        at = self._at
        if at >= self._end:
            try:
                self._end = self._receive_into(self._packet) & ~(pdo.FRAME_BYTES - 1)
            except OSError:
                return False
            at = 0
            if not self._end:  # the hub is gone
                return False
        self._at = end = at + pdo.FRAME_BYTES
        buffer[: pdo.FRAME_BYTES] = self._view[at:end]
        return True

    def start_cyclic_sync(self, period_s: float) -> None:
        if not self.send(virtual_bus.cyclic_sync_frame(period_s)):
            raise BusError(
                f"bus {self.name}: the hub does not take the request for cyclic SYNC; is it running?"
            )
        self._cyclic_sync = True

    def stop_cyclic_sync(self) -> None:
        if self._cyclic_sync:
            self._cyclic_sync = False
            self.send(virtual_bus.cyclic_sync_frame(0.0))


class CanSocket(FrameSocket):
    """A raw CAN socket; cyclic SYNC comes from the kernel's broadcast manager.

    The broadcast manager's timer runs in the kernel and goes on when we hang: the
    drives would hold a stale target under a healthy SYNC. Closing its socket ends it,
    which the kernel does for us when the process dies.
    """

    def __init__(self, sock: socket.socket, name: str, channel: str) -> None:
        super().__init__(sock, name)
        self._channel = channel
        self._manager: socket.socket | None = None

    def start_cyclic_sync(self, period_s: float) -> None:
        self.stop_cyclic_sync()
        manager = socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_BCM)
        try:
            manager.connect((self._channel,))
            manager.send(cyclic_sync_request(period_s))
        except OSError as error:
            manager.close()
            raise BusError(
                f"bus {self.name}: the kernel refuses cyclic SYNC on {self._channel}: {error}"
            ) from error
        self._manager = manager

    def stop_cyclic_sync(self) -> None:
        if self._manager is not None:
            self._manager.close()
            self._manager = None


def cyclic_sync_request(period_s: float) -> bytes:
    """The broadcast manager's TX_SETUP (linux/can/bcm.h) for an empty SYNC frame every ``period_s``.

    struct bcm_msg_head: opcode, flags, count, ival1, ival2 (timevals), can_id, nframes; a
    count of 0 goes to ival2 at once and stays there. The frame follows, 8-byte aligned.
    """
    seconds, microseconds = divmod(round(period_s * 1e6), 1_000_000)
    flags = socket.CAN_BCM_SETTIMER | socket.CAN_BCM_STARTTIMER
    setup = socket.CAN_BCM_TX_SETUP
    head = struct.pack("@IIIllllII0q", setup, flags, 0, 0, 0, seconds, microseconds, pdo.SYNC, 1)
    return head + bytes(pdo.frame(pdo.SYNC))


class AdapterSocket:
    """A python-can adapter behind the same methods; costs some 150 us a tick for five drives."""

    packs = False

    def __init__(self, bus: can.BusABC, name: str) -> None:
        import can

        self.name = name
        self._bus = bus
        self._message = can.Message
        self._refusals = (can.CanError, OSError)

    def fileno(self) -> int:
        """The adapter's descriptor, or -1 where it has none to wait on."""
        try:
            return self._bus.fileno()
        except NotImplementedError:
            return -1

    def send(self, frame: Buffer) -> bool:
        can_id, data = pdo.unpack(frame)
        message = self._message(arbitration_id=can_id, data=data, is_extended_id=False, check=False)
        try:
            self._bus.send(message, timeout=0.0)
        except self._refusals:
            return False
        return True

    def receive_into(self, buffer: bytearray) -> bool:
        try:
            message = self._bus.recv(timeout=0.0)
        except self._refusals:
            return False
        if message is None:
            return False
        pdo.FRAME.pack_into(buffer, 0, _flagged_id(message), message.dlc, bytes(message.data))
        return True

    def start_cyclic_sync(self, period_s: float) -> None:
        raise BusError(f'bus {self.name}: a python-can adapter has no kernel timer; use sync = "tick"')

    def stop_cyclic_sync(self) -> None:
        """Nothing runs."""

    def close(self) -> None:
        self._bus.shutdown()


def _flagged_id(message: can.Message) -> int:
    flags = pdo.EXTENDED_FLAG * message.is_extended_id | pdo.REMOTE_FLAG * message.is_remote_frame
    return int(message.arbitration_id | flags | pdo.ERROR_FLAG * message.is_error_frame)


def open(
    settings: BusSettings, filters: Sequence[tuple[int, int]] = pdo.TICK_FILTERS
) -> FrameSocket | AdapterSocket:
    """A port on the bus that ``settings`` name; ``filters`` are (identifier, mask) pairs.

    The kernel or the adapter applies the filters; the hub does not filter, and the tick
    looks identifiers up anyway. Raises BusError.
    """
    if settings.interface == "virtual":
        return _open_virtual(settings)
    if settings.interface == "socketcan":
        return _open_socketcan(settings, filters)
    return _open_adapter(settings, filters)


def _open_virtual(settings: BusSettings) -> HubSocket:
    try:
        return HubSocket(virtual_bus.connect(settings.channel), settings.name)
    except OSError as error:
        raise BusError(
            f"bus {settings.name}: no virtual bus at {settings.channel}: {error.strerror};"
            " start its hub first"
        ) from error


def _open_socketcan(settings: BusSettings, filters: Sequence[tuple[int, int]]) -> CanSocket:
    try:
        sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError as error:
        raise BusError(f"bus {settings.name}: this kernel has no CAN sockets: {error.strerror}") from error
    try:
        sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, kernel_filters(filters))
        sock.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, ERROR_CLASSES)
        sock.bind((settings.channel,))
    except OSError as error:
        sock.close()
        raise BusError(
            f"bus {settings.name}: cannot use {settings.channel}: {error.strerror}; bring it up with"
            f" 'ip link set {settings.channel} up type can bitrate {settings.bit_rate}'"
        ) from error
    return CanSocket(sock, settings.name, settings.channel)


def kernel_filters(filters: Sequence[tuple[int, int]]) -> bytes:
    """CAN_RAW_FILTER's array; each mask also asks for an 11-bit data frame."""
    kind = pdo.EXTENDED_FLAG | pdo.REMOTE_FLAG
    return b"".join(struct.pack("=II", can_id, mask | kind) for can_id, mask in filters)


def _open_adapter(settings: BusSettings, filters: Sequence[tuple[int, int]]) -> AdapterSocket:
    import can

    wanted = [{"can_id": can_id, "can_mask": mask, "extended": False} for can_id, mask in filters]
    try:
        bus = can.Bus(
            interface=settings.interface,
            channel=settings.channel,
            bitrate=settings.bit_rate,
            can_filters=wanted,
        )
    except (can.CanError, OSError, ValueError, ImportError) as error:
        raise BusError(
            f"bus {settings.name}: python-can cannot open interface {settings.interface!r},"
            f" channel {settings.channel!r}: {error}"
        ) from error
    return AdapterSocket(bus, settings.name)
