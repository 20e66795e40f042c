"""``python adapter.py VCAN``: a serial CAN adapter on a pseudo terminal, which the kernel's slcan drives.

It makes the interface ``can0`` and joins it to VCAN, as a cable joins an adapter to a bus. What
happens to the adapter is told on standard input, a word a line:

    warning passive bus_off active    its controller's state, of which the kernel makes error frames

It prints ``ready`` when the interface is there. Ends when standard input ends.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import socket
import struct
import sys
import termios
import tty

from drives.pdo import FRAME, FRAME_BYTES, REMOTE_FLAG

N_SLCAN = 17  # line discipline, linux/tty.h
# "s", state, transmit and receive error counters (drivers/net/can/slcan, 6.x)
STATES = {
    "warning": b"sw000100\r",
    "passive": b"sp000130\r",
    "bus_off": b"sb256256\r",
    "active": b"sa000000\r",
}


class Adapter:
    """The far end of the serial line, and the bus behind it."""

    def __init__(self, vcan: str) -> None:
        self._ours, self._kernels = pty.openpty()
        for end in (self._ours, self._kernels):
            tty.setraw(end)
        fcntl.ioctl(self._kernels, termios.TIOCSETD, struct.pack("i", N_SLCAN))
        self._bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._bus.bind((vcan,))
        self._open = False
        self._unread = b""

    def run(self) -> None:
        """Carry frames both ways until standard input ends."""
        while True:
            readable, _, _ = select.select([self._ours, self._bus, sys.stdin.fileno()], [], [])
            if self._ours in readable:
                self._from_computer(os.read(self._ours, 4096))
            if self._bus in readable:
                self._from_bus(self._bus.recv(FRAME_BYTES))
            if sys.stdin.fileno() in readable and not self._told(os.read(sys.stdin.fileno(), 4096)):
                return

    def _told(self, words: bytes) -> bool:
        for word in words.decode().split():
            self._open = word != "bus_off" and self._open
            os.write(self._ours, STATES[word])
        return bool(words)

    def _from_computer(self, text: bytes) -> None:
        """The commands of an slcan adapter: O and C open and close, t and r are frames."""
        *lines, self._unread = (self._unread + text).split(b"\r")
        for line in lines:
            if line in (b"O", b"C"):
                self._open = line == b"O"
            elif line[:1] in (b"t", b"r") and self._open:
                data = bytes.fromhex(line[5:].decode()) if line[:1] == b"t" else b""
                can_id = int(line[1:4], 16) | (REMOTE_FLAG if line[:1] == b"r" else 0)
                with contextlib.suppress(OSError):
                    self._bus.send(FRAME.pack(can_id, int(line[4:5]), data))

    def _from_bus(self, frame: bytes) -> None:
        can_id, length, data = FRAME.unpack(frame)
        if self._open and can_id < 0x800:
            os.write(self._ours, b"t%03X%d%s\r" % (can_id, length, data[:length].hex().upper().encode()))


if __name__ == "__main__":
    adapter = Adapter(sys.argv[1])
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
    print("ready", flush=True)
    adapter.run()
