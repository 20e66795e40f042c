"""A serial adapter that speaks slcan (CANable, Lawicel, USBtin) as a port like the others.

The serial line is opened by pyserial and then read in one go: everything the driver
has, split at CR. The tick's frames go out in one write. An adapter has no queue to
ask and no acknowledgement worth waiting for: a frame it refuses (BEL) makes the next
``send`` False.
"""

from __future__ import annotations

import contextlib
import os
import select
import time

from drives import pdo
from drives.ports import slcan
from drives.ports.port import Buffer, BusError
from drives.settings import BusSettings
from drives.texts import message

READ_BYTES = 65536
MAX_UNSENT = 4096  # bytes that may wait for the driver; some 150 frames
BAUD = 115_200  # USB adapters do not mind; a channel may end with @BAUD
SETTLING_S = 0.05  # for the answer to a command; some firmwares give none


class SlcanPort:
    """An open channel of an adapter on a non-blocking descriptor."""

    packs = True  # send takes several frames at once

    def __init__(self, descriptor: int, name: str) -> None:
        self.name = name
        self.overflows = 0  # lines without an end, and what the adapter says it has lost
        self.refused = 0  # BEL
        self.malformed = 0  # lines that are no frame and no answer
        self._descriptor = descriptor
        self._lines: list[bytes] = []  # read, oldest last
        self._rest = b""  # of a line whose end has not come
        self._unsent = b""
        self._told = 0  # of the refusals
        os.set_blocking(descriptor, False)

    def fileno(self) -> int:
        return self._descriptor

    # -- out

    def send(self, frame: Buffer) -> bool:
        """Queues 16-byte frames, one or several; False if the line or the adapter takes no more."""
        lines = [slcan.line(frame[at : at + pdo.FRAME_BYTES]) for at in range(0, len(frame), pdo.FRAME_BYTES)]
        if len(self._unsent) > MAX_UNSENT:
            self._flush()
            if len(self._unsent) > MAX_UNSENT:
                return False
        self._unsent += b"".join(lines)
        self._flush()
        good = self._told == self.refused
        self._told = self.refused
        return good

    def _flush(self) -> None:
        """Hand on what the driver takes; the rest, which may begin within a line, goes first next time."""
        try:
            self._unsent = self._unsent[os.write(self._descriptor, self._unsent) :]
        except BlockingIOError:
            pass
        except OSError:
            self.refused += 1  # the adapter is gone

    # -- in

    def receive_into(self, buffer: bytearray) -> bool:
        """The oldest received frame into ``buffer[:16]``; False when there is none."""
        if self._unsent:
            self._flush()
        while True:
            if not self._lines and not self._read():
                return False
            frame = self._frame(self._lines.pop())
            if frame is not None:
                buffer[: pdo.FRAME_BYTES] = frame
                return True

    def _read(self) -> bool:
        """Take what the driver has; whether there is a whole line."""
        try:
            received = os.read(self._descriptor, READ_BYTES)
        except OSError:
            return False
        if not received:
            return False
        *lines, self._rest = (self._rest + received.replace(b"\a", b"\a\r")).split(b"\r")
        if len(self._rest) > slcan.LONGEST:
            self._rest = b""
            self.overflows += 1
        lines.reverse()
        self._lines = lines
        return bool(lines)

    def _frame(self, line: bytes) -> bytes | None:
        """The frame of a line; an answer or nonsense is counted."""
        first = line[:1]
        if first in (b"t", b"T", b"r", b"R", b"s"):
            frame = slcan.frame(line)
            if frame is None:
                self.malformed += 1
            return frame
        if line.endswith(b"\a"):
            self.refused += 1
        elif first == b"e" and b"o" in line[2:].lower():
            self.overflows += 1  # Linux' extension: an overrun
        elif first not in (b"", b"z", b"Z", b"V", b"v", b"N", b"F", b"e"):
            self.malformed += 1
        return None

    # -- the rest of a port

    def restart(self) -> None:
        """Closes and opens the adapter's channel: slcan knows no other way out of bus-off."""
        self._unsent += b"\rC\rO\r"
        self._flush()

    def close(self) -> None:
        """Closes the adapter's channel and the line."""
        with contextlib.suppress(OSError):
            os.set_blocking(self._descriptor, True)
            os.write(self._descriptor, b"\rC\r")
        with contextlib.suppress(OSError):
            os.close(self._descriptor)


def open_serial(settings: BusSettings) -> SlcanPort:
    """The adapter at the serial port ``settings.channel`` ("/dev/ttyACM0", "/dev/ttyUSB0@1000000").

    Raises BusError.
    """
    if settings.bit_rate not in slcan.BIT_RATES:
        rates = ", ".join(f"{rate}" for rate in slcan.BIT_RATES)
        raise BusError(
            message("bus.serial_bit_rate", name=settings.name, bit_rate=settings.bit_rate, rates=rates)
        )
    path, _, baud = settings.channel.partition("@")
    if baud and not baud.isdecimal():
        raise BusError(message("bus.serial_baud", name=settings.name, baud=baud, path=path))
    port = SlcanPort(_open_line(settings.name, path, int(baud or BAUD)), settings.name)
    try:
        _set_up(port, slcan.BIT_RATES[settings.bit_rate], settings)
    except BusError:
        port.close()
        raise
    return port


def _open_line(name: str, path: str, baud: int) -> int:
    """A descriptor of the serial port, raw and with our speed."""
    import serial

    try:
        with serial.Serial(path, baud, timeout=0, exclusive=True) as line:
            return os.dup(line.fileno())
    except (serial.SerialException, OSError, ValueError) as error:
        raise BusError(message("bus.serial_not_open", name=name, path=path, why=error)) from error


def _set_up(port: SlcanPort, rate: str, settings: BusSettings) -> None:
    """Close, bit rate, no time stamps, open. Only what comes after counts as refused or malformed."""
    for command in ("\r\rC", "Z0"):  # an adapter that is closed already, or has no time stamps, says BEL
        _tell(port, command)
    for command, what in (
        (rate, message("bus.a_bit_rate", bit_rate=settings.bit_rate)),
        ("O", message("bus.opening")),
    ):
        if not _tell(port, command):
            raise BusError(
                message("bus.serial_refuses", name=settings.name, channel=settings.channel, what=what)
            )
    port.overflows = port.malformed = 0


def _tell(port: SlcanPort, command: str) -> bool:
    """Send one command; False if the adapter says BEL. Off the tick: waits for the answer."""
    before, buffer = port.refused, bytearray(pdo.FRAME_BYTES)
    with contextlib.suppress(OSError):
        os.write(port.fileno(), f"{command}\r".encode())
    until_s = time.monotonic() + SETTLING_S
    while (left_s := until_s - time.monotonic()) > 0.0:
        select.select([port.fileno()], [], [], left_s)
        while port.receive_into(buffer):
            pass  # frames from before the channel was closed
    refused = port.refused != before
    port.refused = before
    return not refused
