"""Hears every frame of the buses of a live machine, and keeps the last seconds of them.

A port of its own on each bus and a thread of the parent's process: the tick has no time
for it, and it must outlive the tick. Frames carry the kernel's time stamp, or that of the virtual
bus, so that a thread that is woken late still writes when they came.
"""

from __future__ import annotations

import os
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Sequence

from drives import bus
from drives.log.frame_log import FrameLog
from drives.ports.hub_protocol import MAX_FRAMES, TIMED, TIMES_FRAME
from drives.settings import BusSettings

EVERYTHING = ((0, 0),)  # identifier, mask
SO_TIMESTAMPNS = 35
STAMP = struct.Struct("qq")
PACKET_BYTES = MAX_FRAMES * TIMED.size
LOOK_MS = 50
GATHERED_MS = 200  # where hubs alone are heard, which gather frames themselves
GATHER_S = 0.010  # frames come in bursts; to be woken for each would cost the machine's processes time


class Listener:
    """``logs`` by bus name, filled from now until ``close``."""

    def __init__(self, buses: Sequence[BusSettings], make: Callable[[], FrameLog] = FrameLog) -> None:
        """``make`` makes what keeps the frames of one bus. Raises BusError."""
        self.logs = {one.name: make() for one in buses}
        self._heard: dict[int, tuple[socket.socket, FrameLog]] = {}  # sockets that tell the times
        self._ports = []
        for one in buses:
            log = self.logs[one.name]
            if one.interface in bus.HUBS:
                own = bus.joined(one, TIMES_FRAME)
                own.setblocking(False)
                self._heard[own.fileno()] = own, log
                continue
            port = bus.open(one, EVERYTHING)
            self._ports.append((port, log))
            if isinstance(port, bus.FrameSocket):
                self._heard[port.fileno()] = (_stamped(port.fileno()), log)
        self._ending = False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leaves the buses; what was heard stays."""
        self._ending = True
        self._thread.join()
        for own, _ in self._heard.values():
            own.close()
        for port, _ in self._ports:
            port.close()

    def _listen(self) -> None:
        poll = select.poll()
        for fileno in self._heard:
            poll.register(fileno, select.POLLIN)
        while not self._ending:
            for fileno, event in poll.poll(LOOK_MS if self._ports else GATHERED_MS):
                if not _drain(*self._heard[fileno]) or event & ~select.POLLIN:
                    poll.unregister(fileno)  # the hub is gone; it would wake us for ever
            for port, log in self._ports:
                if not isinstance(port, bus.FrameSocket):
                    log.drain(port, time.time())  # an adapter: its packets are its own affair
            if self._ports:
                time.sleep(GATHER_S)


def _stamped(fileno: int) -> socket.socket:
    """The same socket, as one that tells when its packets came."""
    own = socket.socket(fileno=os.dup(fileno))
    own.setblocking(False)
    own.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    return own


def _drain(own: socket.socket, log: FrameLog) -> bool:
    """Keeps what has come, one frame or what the hub has gathered; False when nothing will come any more."""
    while True:
        try:
            packet, notes, _, _ = own.recvmsg(PACKET_BYTES, 64)
        except BlockingIOError:
            return True
        except OSError:
            return False
        if not packet:
            return False
        if len(packet) % TIMED.size == 0:
            offset_s = time.time() - time.monotonic()
            log.extend([(left_s + offset_s, frame) for left_s, frame in TIMED.iter_unpack(packet)])
            continue
        at_s = time.time()
        for _, kind, data in notes:
            if kind == SO_TIMESTAMPNS:
                seconds, nanoseconds = STAMP.unpack(data)
                at_s = seconds + nanoseconds * 1e-9
        log(packet, at_s)
