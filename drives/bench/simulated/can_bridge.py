"""Simulated devices on a real CAN interface (``vcan0``, ``can0``): their bus, bridged to a raw CAN socket.

The devices hang on a stepped bus in this process, advanced by the wall clock. What
they send goes out by the socket, what the socket hears is put up on their bus. A frame
counts as heard when the kernel took it (the socket's time stamp), so a process that
wakes late does not move SYNC. The interface has its own bit timing; the bus here has
none unless it is given one (for ``vcan``, whose frames take no time).

Standard library only; it does not run without Linux' CAN.
"""

from __future__ import annotations

import socket
import time
from collections import deque
from collections.abc import Callable

from drives import pdo
from drives.bench.virtual.hub import Served
from drives.bench.virtual.kernel_time import NOTE_BYTES, woken
from drives.pdo import FRAME_BYTES
from drives.texts import TextError, message

RECEIVE_BYTES = 1 << 20  # room for what comes while this process sleeps
MAX_WAITING = 1024  # frames that a full transmit queue may keep here; the oldest go first


class InterfaceError(TextError):
    """A CAN interface cannot be used; the text says why and what to do."""


def open_interface(channel: str) -> socket.socket:
    """A raw CAN socket that hears everything but itself. Raises InterfaceError."""
    try:
        raw = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError as error:
        raise InterfaceError(message("bus.bridge_no_can", channel=channel, why=error)) from error
    try:
        raw.bind((channel,))
    except OSError as error:
        raw.close()
        raise InterfaceError(message("bus.bridge_interface", channel=channel, why=error)) from error
    return raw


class CanBridge(Served):
    """Serves the devices that are attached to ``bus``; the same calls as the hub's."""

    def __init__(
        self,
        raw: socket.socket,
        bit_rate: int = 0,
        sync_log: bool = False,
        path: str = "can",
        worst_stuffing: bool = False,
    ) -> None:
        """``raw`` carries one 16-byte frame per packet; ``path`` is the interface's name, for logs."""
        self.path = path
        raw.setblocking(False)
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
        super().__init__(bit_rate, sync_log, worst_stuffing)
        self.lost = 0  # frames that a full transmit queue refused for too long
        self._raw = raw
        self._unsent: deque[bytes] = deque()
        self._source = self.bus.connect(self._put)
        self.listen(raw.fileno(), self._read)
        self._clocks.ask(raw)

    def turn(self, until_s: float) -> None:
        """Wait for a frame or the devices' next event, then let their bus catch up with the clock."""
        wait_s = max(0.0, min(self.bus.next_event_s(), until_s) - time.monotonic())
        # A full queue of a CAN interface does not say when there is room again: look each millisecond.
        wait_s = min(wait_s, 0.001) if self._unsent else wait_s
        now_s, readable = woken(list(self._readers), wait_s)
        self._read_and_advance(readable, now_s)
        self._flush()

    def run(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop()`` says so (looked at ten times a second).

        Raises ScriptError for a fault of a node that is not here.
        """
        self._begin()
        while not stop():
            self._clocks.look()
            until_s = time.monotonic() + 0.1
            while time.monotonic() < until_s:
                self.turn(until_s)

    def close(self) -> None:
        super().close()
        self._raw.close()

    def _put(self, frame: bytes, _at_s: float) -> None:
        """A device's frame. Error frames of the bus here are not the interface's."""
        if int.from_bytes(frame[:4], "little") & pdo.ERROR_FLAG:
            return
        if len(self._unsent) >= MAX_WAITING:
            self._unsent.popleft()
            self.lost += 1
        self._unsent.append(frame)
        self._flush()

    def _flush(self) -> None:
        while self._unsent:
            try:
                self._raw.send(self._unsent[0])
            except OSError:  # the queue is full, or the interface is down for now
                return
            self._unsent.popleft()

    def _read(self) -> None:
        while True:
            try:
                frame, notes, _, _ = self._raw.recvmsg(FRAME_BYTES, NOTE_BYTES)
            except OSError:
                return
            if len(frame) < FRAME_BYTES:
                return
            can_id = int.from_bytes(frame[:4], "little")
            if frame[4] <= 8 and not can_id & pdo.ERROR_FLAG:
                self.bus.submit(self._source, self._clocks.taken_s(notes, self.bus.now_s), can_id, frame)
