"""How a process joins the virtual bus of another: the hub's socket and its control frames.

A client's packet holds one or more 16-byte frames; control frames use error classes
that no CAN controller reports, so that nothing else on a bus can look like one.
"""

from __future__ import annotations

import socket

from drives.pdo import ERROR_FLAG, FRAME

CYCLIC_SYNC = ERROR_FLAG | 1  # to the hub: data u32 = period in us, 0 = stop
RESTART = ERROR_FLAG | 2  # to the hub: the client's CAN controller is to leave bus-off
PATIENT = ERROR_FLAG | 3  # to the hub: leave unread what does not fit into the client's queue, and it waits
LOST_FRAMES = ERROR_FLAG | 0x1000_0000  # from the hub: data u32 = frames the client's queue refused

RESTART_FRAME = FRAME.pack(RESTART, 0, b"")
PATIENT_FRAME = FRAME.pack(PATIENT, 0, b"")

NO_FD = "CAN FD frames are not carried: this bus is classic CAN; send frames of 8 bytes at most"


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


def lost_frame(count: int) -> bytes:
    """The control frame that tells a client how many frames it has lost since it joined."""
    return FRAME.pack(LOST_FRAMES, 4, (count & 0xFFFF_FFFF).to_bytes(4, "little"))
