"""The virtual bus as a serial CAN adapter: slcan on a pseudo terminal, for what wants a serial port.

A tool opens LINK (a symbolic link to the terminal) as it would /dev/ttyACM0, says S8
and O, and is on the bus. Bit rates are taken and ignored: the bus has its own.
"""

from __future__ import annotations

import contextlib
import os
import tty

from drives.gateways.host import Host
from drives.pdo import ERROR_FLAG
from drives.ports import slcan

VERSION, SERIAL = b"V1013\r", b"NDX01\r"
OK, REFUSED = b"\r", b"\a"
PLAIN = frozenset(b"SsZMmWXUQ")  # settings: taken, and without effect


class SlcanTerminal:
    """A pseudo terminal with the link ``link`` to it. Raises OSError."""

    def __init__(self, host: Host, link: str) -> None:
        self.lost = 0  # lines that the terminal did not take
        self._host = host
        self._link = link
        self._text = bytearray()
        self._source = -1
        self._master, self._slave = os.openpty()  # the slave stays open: no end of file between guests
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        try:
            _point(link, os.ttyname(self._slave))
        except OSError:
            os.close(self._master)
            os.close(self._slave)
            raise
        host.listen(self._master, self._read)

    def _say(self, text: bytes) -> None:
        try:
            whole = os.write(self._master, text) == len(text)
        except OSError:
            whole = False
        if not whole:
            self.lost += 1  # a line cut short is no frame for the reader, and so is the next

    def _read(self) -> None:
        try:
            self._text += os.read(self._master, 65536)
        except OSError:
            return
        *lines, rest = self._text.split(b"\r")
        for text in lines:
            self._say(self._answer(bytes(text)))
        self._text = rest if len(rest) <= slcan.LONGEST else bytearray()

    def _answer(self, text: bytes) -> bytes:
        command = text[:1]
        if command in (b"O", b"L"):
            return self._open()
        if command == b"C":
            self._close_channel()
            return OK
        if command in (b"V", b"v"):
            return VERSION
        if command == b"N":
            return SERIAL
        if command == b"F":
            return b"F00\r" if self._source >= 0 else REFUSED
        if command in (b"t", b"T", b"r", b"R"):
            return self._submit(text)
        return OK if not text or text[0] in PLAIN else REFUSED

    def _open(self) -> bytes:
        if self._source >= 0:
            return REFUSED
        self._source = self._host.bus.connect(self._put)
        return OK

    def _close_channel(self) -> None:
        if self._source >= 0:
            self._host.bus.disconnect(self._source)
            self._source = -1

    def _submit(self, text: bytes) -> bytes:
        frame = slcan.frame(text)
        if frame is None or self._source < 0:
            return REFUSED
        bus = self._host.bus
        taken = bus.submit(self._source, bus.now_s, int.from_bytes(frame[:4], "little"), frame)
        return (b"z\r" if text[:1].islower() else b"Z\r") if taken else REFUSED

    def _put(self, frame: bytes, _at_s: float) -> None:
        is_error = int.from_bytes(frame[:4], "little") & ERROR_FLAG
        text = slcan.state_line(frame) if is_error else slcan.line(frame)
        if text:
            self._say(text)

    def restart(self) -> None:
        """Nothing is behind this gateway but guests."""

    def close(self) -> None:
        self._close_channel()
        self._host.forget(self._master)
        with contextlib.suppress(OSError):
            os.unlink(self._link)
        os.close(self._master)
        os.close(self._slave)


def _point(link: str, target: str) -> None:
    """Make a symbolic link anew, in place of an older link only."""
    if os.path.islink(link):
        os.unlink(link)
    os.symlink(target, link)
