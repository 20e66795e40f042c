"""Messages of pieces from the plan to the tick: packets of a SEQPACKET socket.

The kernel bounds a packet by the send buffer, and the tick has no time for much of a message at once. So
it goes in packets, each of which costs the tick some 50 us:

```
   (sequence, part, parts, tables) + a pickled StopTable       the first ``tables`` of them
   (sequence, part, parts, tables) + a slice of the pickle     of the message without its tables
```
"""

from __future__ import annotations

import pickle
import select
import socket
import struct
import sys
from dataclasses import replace

from controller.motion.pieces import PieceMessage, StopTable

_PART = struct.Struct("<IHHH")
_PART_BYTES = 60_000
_TABLE_VALUES = 6_000  # of eight bytes each at most, and what a pickle adds
_BUFFER_BYTES = 4 << 20
PACKETS_PER_S = 4000  # that the tick takes


def encode(message: PieceMessage) -> list[bytes]:
    """The packets of a message, in the order in which they must be sent; a keepalive has no parts."""
    if message.is_keepalive:
        return [_PART.pack(message.sequence & 0xFFFFFFFF, 0, 0, 0)]
    tables = [part for table in message.stops for part in table.parts(_TABLE_VALUES)]
    parts = [pickle.dumps(table, protocol=pickle.HIGHEST_PROTOCOL) for table in tables]
    data = pickle.dumps(replace(message, stops=()), protocol=pickle.HIGHEST_PROTOCOL)
    parts += [data[i : i + _PART_BYTES] for i in range(0, len(data), _PART_BYTES)]
    heads = (_PART.pack(message.sequence & 0xFFFFFFFF, i, len(parts), len(tables)) for i in range(len(parts)))
    return [head + part for head, part in zip(heads, parts, strict=True)]


def piece_pair() -> tuple[socket.socket, socket.socket]:
    """(plan's end, tick's end) of a new piece socket, both non-blocking."""
    plan, tick = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end, option in ((plan, socket.SO_SNDBUF), (tick, socket.SO_RCVBUF)):
        end.setsockopt(socket.SOL_SOCKET, option, _BUFFER_BYTES)
        end.setblocking(False)
    return plan, tick


class PieceOutbox:
    """Plan's end of the piece socket; keeps what does not fit into it yet."""

    def __init__(self, plan_end: socket.socket) -> None:
        self._socket = plan_end
        self._waiting: list[bytes] = []

    def send(self, message: PieceMessage) -> bool:
        """Queue and send what fits; False while packets are still waiting.

        A keepalive is dropped when packets wait: they are a sign of life themselves.
        """
        if not (message.is_keepalive and self._waiting):
            self._waiting += encode(message)
        return self.flush()

    def flush(self) -> bool:
        """Send waiting packets; False when some still wait. OSError when the tick is gone."""
        while self._waiting:
            try:
                self._socket.send(self._waiting[0])
            except BlockingIOError:
                return False
            del self._waiting[0]
        return True


class PieceInbox:
    """The tick's end of the piece socket: at most one whole message per ``take``."""

    def __init__(self, tick_end: socket.socket, packets: int = sys.maxsize) -> None:
        """``packets``: taken at once."""
        self._socket = tick_end
        self._poll = select.poll()  # a third of what it costs to receive nothing
        self._poll.register(tick_end, select.POLLIN)
        self._packets = packets
        self._parts: list[memoryview] = []
        self._tables: list[StopTable] = []
        self._heard = False
        self.closed = False

    def take(self) -> PieceMessage | None:
        """The next complete message, or None. Never blocks, never raises on a lost peer."""
        left = self._packets
        while left and not self.closed and self._poll.poll(0):
            left -= 1
            try:
                packet = self._socket.recv(_PART_BYTES + _PART.size)
            except BlockingIOError:
                return None
            except OSError:
                packet = b""
            if not packet:
                self.closed = True  # the plan is gone
                return None
            self._heard = True
            message = self._join(packet)
            if message is not None:
                return message
        return None

    def was_heard(self) -> bool:
        """Whether anything has come in since this was asked last."""
        heard, self._heard = self._heard, False
        return heard

    def _join(self, packet: bytes) -> PieceMessage | None:
        _, part, parts, tables = _PART.unpack_from(packet)
        if parts == 0:
            return None  # a keepalive: it was heard, that is all
        if part == 0:
            self._forget()
        if part != len(self._tables) + len(self._parts):
            return None  # the rest of a message whose beginning was lost
        data = memoryview(packet)[_PART.size :]
        if part < tables:
            self._tables.append(pickle.loads(data))
        else:
            self._parts.append(data)
        if part + 1 < parts:
            return None
        message = pickle.loads(b"".join(self._parts))
        stops = tuple(self._tables)
        self._forget()
        return replace(message, stops=stops) if isinstance(message, PieceMessage) else None

    def _forget(self) -> None:
        self._parts.clear()
        self._tables.clear()
