"""When the kernel took a packet from its sender, by the clock that buses run on, and what it has by a time.

The kernel stamps with CLOCK_REALTIME (``SO_TIMESTAMPNS``), a bus runs on CLOCK_MONOTONIC; how far they are
apart is looked at again and again, for the first of them can be set.
"""

from __future__ import annotations

import math
import select
import socket
import time
from collections.abc import Sequence
from struct import Struct
from typing import Final

SO_TIMESTAMPNS = 35  # asm-generic/socket.h; Python has no name for it
NOTE_BYTES: Final = 64  # room for the stamp beside a packet
_STAMP: Final = Struct("qq")  # s, ns
# A busy computer may hold the process of the drives back for so long, and they must not take what they
# did not read for silence.
TRUSTED_S = 2.0
AT_ONCE_S = 50e-6  # three looks at clocks, where nobody else had the processor meanwhile


def woken(descriptors: Sequence[int], wait_s: float) -> tuple[float, list[int]]:
    """After ``wait_s`` at most: the time, and which descriptors have had something to read by then.

    Asked for in this order: before it reads the clock, others may have the processor and say something,
    and a bus that is led on to that time without it would move it.
    """
    # select and not epoll: its time-out is in microseconds, epoll's in milliseconds.
    select.select(descriptors, [], [], wait_s)
    now_s = time.monotonic()
    return now_s, select.select(descriptors, [], [], 0.0)[0]


class KernelTime:
    """The stamps of all sockets of one process."""

    def __init__(self) -> None:
        self._offset_s = 0.0
        self.look(math.inf)

    def ask(self, sock: socket.socket) -> None:
        """Have packets of this socket stamped."""
        sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)

    def look(self, at_once_s: float = AT_ONCE_S) -> None:
        """How far the clocks are apart; as before where somebody else had the processor between two looks."""
        before_s, real_s, after_s = time.monotonic(), time.time(), time.monotonic()
        if after_s - before_s <= at_once_s:
            self._offset_s = real_s - 0.5 * (before_s + after_s)

    def taken_s(self, notes: list[tuple[int, int, bytes]], lived_s: float) -> float:
        """When the packet with these notes was taken: not before ``lived_s``, and not after now.

        So a step of the system's clock since the last look moves it by one turn at most.
        """
        now_s = at_s = time.monotonic()
        for _, _, data in notes:
            seconds, nanoseconds = _STAMP.unpack(data)
            at_s = seconds + nanoseconds * 1e-9 - self._offset_s
        if not now_s - TRUSTED_S <= at_s <= now_s:
            at_s = now_s
        return at_s if at_s > lived_s else lived_s
