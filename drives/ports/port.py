"""What the tick needs of a bus, and the two kinds of sockets that carry one 16-byte frame per packet.

A port never blocks and never raises after it has been opened: the tick gets booleans.
Whatever the socket has to say (queue full, interface down, peer gone) is False, and
the group's supervision makes a fault of it.
"""

from __future__ import annotations

import select
import socket
from collections.abc import Callable
from typing import Protocol

from drives import pdo
from drives.ports import hub_protocol
from drives.texts import TextError

Buffer = bytes | bytearray | memoryview

# Room for what arrives while the tick is late; the kernel's default held 278 frames.
RECEIVE_BYTES = 1 << 20

LOST_FRAMES_BYTE = hub_protocol.LOST_FRAMES >> 24  # tells that frame from every other

HUB_PACKET_BYTES = hub_protocol.MAX_FRAMES * pdo.FRAME_BYTES
SENT_BYTES = hub_protocol.MAX_SENT * pdo.FRAME_BYTES


class BusError(TextError):
    """A bus cannot be opened or used as configured; the text says which and what to do."""


class Port(Protocol):
    """What the tick needs of a bus; the stepped clock's bus is one too."""

    @property
    def overflows(self) -> int:
        """Frames lost since the opening because they were not read in time; 0 where nobody can tell."""
        ...

    def send(self, frame: Buffer, /) -> bool:
        """Queues one frame; False if it did not go out."""
        ...

    def receive_into(self, buffer: bytearray, /) -> bool:
        """Puts the next frame into the first 16 bytes of ``buffer``; False if there is none."""
        ...

    def restart(self) -> None:
        """Asks a CAN controller that is bus-off to take part again; nothing where nobody can be asked."""
        ...

    def close(self) -> None:
        """Leaves the bus."""
        ...


class FrameSocket:
    """A non-blocking descriptor that carries one 16-byte frame per packet."""

    packs = False  # whether `send` takes several frames in one packet

    def __init__(self, sock: socket.socket, name: str) -> None:
        self.name = name
        self.take(sock)

    def take(self, sock: socket.socket) -> None:
        """Goes by this socket from now on."""
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
        self._socket = sock
        self._send: Callable[[Buffer], int] = sock.send
        self._receive_into = sock.recv_into

    @property
    def overflows(self) -> int:
        """Frames lost since the opening because they were not read in time."""
        return 0

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

    def restart(self) -> None:
        """Nothing: that of a SocketCAN interface is its administrator's, who gives it a ``restart-ms``."""

    def close(self) -> None:
        self._socket.close()


class HubSocket(FrameSocket):
    """A client of the virtual bus: a packet holds one or more frames, both ways (``receive_packet``).

    Where the hub has ended, ``gone`` says so, and ``restart`` joins one that has taken its place.

    What nothing can change any more may be said ahead of its time: ``keep``, frames, ``later``, frames ...,
    ``hand_over``. The first of them, a SYNC, goes out at once.
    """

    packs = True

    def __init__(self, sock: socket.socket, name: str, place: str = "", wishes: bytes = b"") -> None:
        """``place``: the hub's socket in the file system, where `restart` joins the next one and says
        its ``wishes`` again.
        """
        super().__init__(sock, name)
        self._packet = bytearray(HUB_PACKET_BYTES)
        self._view = memoryview(self._packet)
        self._at = 0
        self._end = 0
        self._lost = self._lost_before = 0  # frames, of every hub joined so far, and of those before this one
        self._place = place  # not the peer's name: a hub binds elsewhere and moves its socket
        self._wishes = wishes
        self.joined_anew: Callable[[int], None] = _nobody_shares  # called with the descriptor
        self.gone = False
        self._kept = bytearray()  # for one packet
        self._refused = False
        self._later = b""  # stands before what is kept now

    def take(self, sock: socket.socket) -> None:
        super().take(sock)
        poll = select.poll()
        poll.register(sock, select.POLLIN)
        self._ready = poll.poll  # a third of what it costs to receive nothing

    @property
    def overflows(self) -> int:
        """Frames lost since the opening because they were not read in time; the hub counts them."""
        return self._lost

    def keep(self) -> None:
        """What is sent from now on is kept for one packet, but for what is sent next."""
        self._send, self._later = self._first, b""

    def _first(self, frame: Buffer) -> int:
        """In place of the socket's ``send``, as ``_keep``."""
        self._send = self._keep
        return self._socket.send(frame)

    def _keep(self, frame: Buffer) -> int:
        if len(self._kept) + len(frame) > SENT_BYTES:
            self._hand_over()
            self._kept += self._later
        self._kept += frame
        return 0 if self._refused else len(frame)

    def later(self, at_s: float) -> None:
        """What is sent from now on is to begin at that time (CLOCK_MONOTONIC)."""
        self._send, self._later = self._keep, hub_protocol.ahead_frame(at_s)
        self._keep(self._later)

    def hand_over(self) -> None:
        """What is kept goes out; where it does not, the next to be kept is refused."""
        self._send, self._refused = self._socket.send, False
        self._hand_over()

    def _hand_over(self) -> None:
        try:
            if self._kept:
                self._socket.send(self._kept)
        except OSError:
            self._refused = True
        self._kept.clear()

    def receive_into(self, buffer: bytearray) -> bool:
        frame = self.receive_packet(1)
        if frame is None:
            return False
        buffer[: pdo.FRAME_BYTES] = frame
        return True

    def receive_packet(self, most: int) -> memoryview | None:
        """The next frames of one packet, at most so many, where they lie until the next call; None: none."""
        while self._at >= self._end:
            if not self._ready(0):
                return None
            try:
                self._end = self._receive_into(self._packet) & ~(pdo.FRAME_BYTES - 1)
            except OSError:
                return None
            self._at = 0
            if not self._end:
                self.gone = True
                return None
            if self._packet[3] == LOST_FRAMES_BYTE:  # the hub's own word, no frame
                self._lost = self._lost_before + int.from_bytes(self._packet[8:12], "little")
                self._at = pdo.FRAME_BYTES
        at = self._at
        self._at = end = min(self._end, at + most * pdo.FRAME_BYTES)
        return self._view[at:end]

    def restart(self) -> None:
        if not self.gone:
            self.send(hub_protocol.RESTART_FRAME)
            return
        try:
            joined = hub_protocol.connect(self._place, self._wishes)
        except OSError:
            return  # the next reset may find one
        self._socket.close()
        self.take(joined)
        self._lost_before, self.gone = self._lost, False
        self.joined_anew(self.fileno())


def _nobody_shares(_descriptor: int) -> None:
    """The port has its bus for itself."""
