"""How a process joins the virtual bus of another: the hub's socket and its control frames.

A client's packet holds one or more 16-byte frames, up to ``MAX_SENT``. They begin when the packet is sent,
those behind an ``AHEAD`` at its time. A packet to it holds exactly one, unless it has said that it takes
more: ``MANY`` frames, or for a log records of ``TIMED``, gathered for ``GATHER_S``. Control frames use error
classes that no CAN controller reports, so that nothing else on a bus can look like one.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from struct import Struct
from typing import Final

from drives.pdo import ERROR_FLAG, FRAME, plain_mask

RESTART = ERROR_FLAG | 2  # to the hub: the client's CAN controller is to leave bus-off
PATIENT = ERROR_FLAG | 3  # to the hub: leave unread what does not fit into the client's queue, and it waits
LOST_FRAMES = ERROR_FLAG | 0x1000_0000  # from the hub: data u32 = frames the client's queue refused
MANY = ERROR_FLAG | 0x1000_0001  # to the hub: packets of several frames
FILTER = ERROR_FLAG | 0x1000_0002  # to the hub: data u32 identifier, u32 mask; one of them must agree
TIMES = ERROR_FLAG | 0x1000_0003  # to the hub: packets of ``TIMED``
AHEAD = ERROR_FLAG | 0x1000_0004  # to the hub: data u64 ns (CLOCK_MONOTONIC), when what is behind it begins

RESTART_FRAME = FRAME.pack(RESTART, 0, b"")
PATIENT_FRAME = FRAME.pack(PATIENT, 0, b"")
TIMES_FRAME = FRAME.pack(TIMES, 0, b"")

MAX_FRAMES: Final = 256  # of a packet from the hub
MAX_SENT: Final = 64  # of a packet to it
TIMED: Final = Struct("<d16s")  # when it left the wire (CLOCK_MONOTONIC, s), and the frame
FILTERED: Final = Struct("<II")
GATHER_S = 0.05  # a log need not be woken more often

NO_FD: Final = "bus.no_fd"  # the text of it


def wishes(filters: Sequence[tuple[int, int]]) -> bytes:
    """What a port says first: several frames a packet, and only those that it wants to hear.

    A pair asks for data frames with 11 bits, as on SocketCAN; (0, 0) for everything.
    """
    pairs = [FRAME.pack(FILTER, 8, FILTERED.pack(can_id, plain_mask(mask))) for can_id, mask in filters]
    return b"".join((FRAME.pack(MANY, 0, b""), *pairs))


def connect(path: str, first: bytes) -> socket.socket:
    """Join the hub at ``path`` with ``first`` (frames) as the first packet: a SEQPACKET socket.

    Raises OSError when there is no hub.
    """
    joined = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        joined.connect(path)
        joined.send(first)
    except OSError:
        joined.close()
        raise
    return joined


def ahead_frame(at_s: float) -> bytes:
    """The control frame that has those behind it begin at a time (CLOCK_MONOTONIC), if it is to come."""
    return FRAME.pack(AHEAD, 8, round(at_s * 1e9).to_bytes(8, "little"))


def lost_frame(count: int) -> bytes:
    """The control frame that tells a client how many frames it has lost since it joined."""
    return FRAME.pack(LOST_FRAMES, 4, (count & 0xFFFF_FFFF).to_bytes(4, "little"))
