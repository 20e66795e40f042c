"""The virtual bus as a serial CAN adapter: slcan on a pseudo terminal, for what wants a serial port.

A tool opens LINK (a symbolic link to the terminal) as it would /dev/ttyACM0, says S8
and O, and is on the bus. Bit rates are taken and ignored: the bus has its own. A tool that
sends faster than the bus carries is not read until its queue has room again: its write
waits. BEL, the protocol's only refusal, has no words: what they would be for CAN FD is
said where the hub runs.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tty

from drives.bench.virtual.intake import Host, Intake
from drives.pdo import ERROR_FLAG
from drives.ports import slcan
from drives.ports.hub_protocol import NO_FD
from drives.texts import Key, english, said

VERSION, SERIAL = b"V1013\r", b"NDX01\r"
OK, REFUSED = b"\r", b"\a"
FD = frozenset(b"dDbB")  # the letters of CAN FD frames, as CANable's firmware has them
PLAIN = frozenset(b"SsZMmWXUQ")  # settings: taken, and without effect


class SlcanTerminal:
    """A pseudo terminal with the link ``link`` to it. Raises OSError."""

    def __init__(self, host: Host, link: str) -> None:
        self.lost = 0  # lines that the terminal did not take
        self._host = host
        self._link = link
        self._text = bytearray()
        self._source = -1
        self._told_of_fd = False
        self._master, self._slave = os.openpty()  # the slave stays open: no end of file between guests
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        try:
            _point(link, os.ttyname(self._slave))
        except OSError:
            os.close(self._master)
            os.close(self._slave)
            raise
        self._intake = Intake(host, self._master, self._read)

    def _say(self, text: bytes) -> None:
        try:
            whole = os.write(self._master, text) == len(text)
        except OSError:
            whole = False
        if not whole:
            self.lost += 1  # a line cut short is no frame for the reader, and so is the next

    def _read(self) -> bool:
        """Every line that has come; False if a frame among them has to wait."""
        if not self._answer_all():
            return False
        try:
            self._text += os.read(self._master, 65536)
        except OSError:
            return True
        return self._answer_all()

    def _answer_all(self) -> bool:
        *lines, rest = self._text.split(b"\r")
        for at, text in enumerate(lines):
            answer = self._answer(bytes(text))
            if not answer:
                self._text = bytearray(b"\r").join([*lines[at:], rest])
                return False
            self._say(answer)
        self._text = rest if len(rest) <= slcan.LONGEST else bytearray()
        return True

    def _answer(self, text: bytes) -> bytes:
        """Do one line; nothing if it is a frame that has to wait."""
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
        if text and text[0] in FD:
            self._tell_of_fd()
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
        if bus.submit(self._source, bus.now_s, int.from_bytes(frame[:4], "little"), frame):
            return b"z\r" if text[:1].islower() else b"Z\r"
        return b"" if bus.is_full(self._source) else REFUSED

    def _tell_of_fd(self) -> None:
        if not self._told_of_fd:
            self._told_of_fd = True
            print(english(said("bus.slcan_no_fd", link=self._link, why=Key(NO_FD))), file=sys.stderr)

    def _put(self, frame: bytes, _at_s: float) -> None:
        is_error = int.from_bytes(frame[:4], "little") & ERROR_FLAG
        text = slcan.state_line(frame) if is_error else slcan.line(frame)
        if text:
            self._say(text)

    def restart(self) -> None:
        """Nothing is behind this gateway but guests."""

    def close(self) -> None:
        self._close_channel()
        self._intake.close()
        with contextlib.suppress(OSError):
            os.unlink(self._link)
        os.close(self._master)
        os.close(self._slave)


def _point(link: str, target: str) -> None:
    """Make a symbolic link anew, in place of an older link only."""
    if os.path.islink(link):
        os.unlink(link)
    os.symlink(target, link)
