"""Programs over a serial line: received into the store, or punched out of it.

    dnc.receive(line)                  every program of a transmission, each whole, or TapeError and nothing
    dnc.send(line, tape)

7E2 and 7E1 run as 8 bits without parity, two stop bits or one: on the wire that is the same, and
parity is checked in ``tape``. Pacing is the kernel's where it can be: it stops within a
character, a program in between would be late by a buffer. XON and XOFF of a 7-bit line carry
a parity bit, too, so the kernel is told which bytes they are.
"""

from __future__ import annotations

import contextlib
import fcntl
import struct
import termios
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import serial

from controller.api.dnc_format import DC1, DC2, DC3, DC4, Reader, Tape, TapeError, coded, programs
from controller.messages import Message, chain, message

BAUD_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)
FORMATS = {"7E2": (True, 2), "7E1": (True, 1), "8N1": (False, 1)}  # even parity in 7 bits; stop bits
FLOWS = ("xon", "rts", "none")
CHUNK = 256  # bytes handed to the kernel at once; it keeps up to 4096
TURN_S = 0.1  # of reading, between two looks at the clock
TRAILER_S = 0.5  # of silence after a program: no other one follows it
REPEAT_S = 5.0  # of silence, then the start character is sent again: it may have been lost

_TIOCGICOUNT = 0x545D
_COUNTERS = struct.Struct("20i")  # linux/serial.h: cts dsr rng dcd rx tx frame overrun parity brk buf_overrun
_BAD = {6: "framing", 7: "overruns", 8: "parity", 9: "breaks", 10: "buffer"}


class LineError(TapeError):
    """The port itself failed and would again; of any other TapeError the next tape knows nothing."""


@dataclass(frozen=True, slots=True)
class LineSettings:
    """How both ends are set."""

    port: str
    baud: int = 9600
    format: str = "7E2"
    flow: str = "xon"
    silence_s: float = 20.0  # within a program; longer is a cut line
    wait_s: float = 600.0  # for a program to begin, or for the reader's start character
    control: bool = True  # DC1 starts the other end's sender, DC3 stops it; DC2 and DC4 around a punch

    @property
    def even_parity(self) -> bool:
        return FORMATS[self.format][0]

    def check(self) -> None:
        """Raises TapeError."""
        allowed = [
            ("baud", self.baud, BAUD_RATES),
            ("format", self.format, FORMATS),
            ("flow", self.flow, FLOWS),
        ]
        for what, found, known in allowed:
            if found not in known:
                listed = ", ".join(map(str, known))
                raise TapeError(message("dnc.setting", port=self.port, what=what, found=found, listed=listed))


class Port(Protocol):
    """What is needed of ``serial.Serial``."""

    timeout: float | None

    def read(self, size: int) -> bytes: ...

    def write(self, data: bytes) -> int | None: ...

    def fileno(self) -> int: ...

    @property
    def in_waiting(self) -> int: ...

    @property
    def out_waiting(self) -> int: ...


@dataclass(frozen=True, slots=True)
class Line:
    """An open serial line."""

    settings: LineSettings
    port: Port
    decode: Callable[[bytes], bytes]

    def control(self, character: bytes) -> None:
        if self.settings.control and self.settings.flow != "rts":
            self.port.write(coded(character, self.settings.even_parity))


@contextlib.contextmanager
def opened(settings: LineSettings) -> Iterator[Line]:
    """The line, for this process alone. Raises TapeError, also for errors while it is in use."""
    settings.check()
    try:
        with serial.Serial(
            settings.port,
            settings.baud,
            bytesize=serial.EIGHTBITS,
            parity=serial.PARITY_NONE,
            stopbits=FORMATS[settings.format][1],
            xonxoff=settings.flow == "xon",
            rtscts=settings.flow == "rts",
            timeout=TURN_S,
            write_timeout=settings.silence_s,
            exclusive=True,
        ) as port:
            _mark_errors(port.fileno(), settings)
            yield Line(settings, port, Unmarked(settings.port).plain)
    except serial.SerialTimeoutException as error:
        raise TapeError(message("dnc.not_taken", port=settings.port, silence_s=settings.silence_s)) from error
    except (OSError, termios.error, ValueError) as error:  # SerialException is an OSError
        raise LineError(message("dnc.failed", port=settings.port, why=error)) from error


def _mark_errors(fd: int, settings: LineSettings) -> None:
    """Have the kernel mark bytes with framing errors, and pace by the bytes that come."""
    state = termios.tcgetattr(fd)
    state[0] = (state[0] | termios.PARMRK | termios.INPCK) & ~(
        termios.IGNPAR | termios.IGNBRK | termios.BRKINT
    )
    state[6][termios.VSTART] = coded(DC1, settings.even_parity)
    state[6][termios.VSTOP] = coded(DC3, settings.even_parity)
    termios.tcsetattr(fd, termios.TCSANOW, state)


class Unmarked:
    """Takes the kernel's marks out: 0xFF 0x00 c is a broken byte, 0xFF 0xFF is 0xFF."""

    def __init__(self, port: str) -> None:
        self._port, self._left = port, b""

    def plain(self, chunk: bytes) -> bytes:
        """The bytes as they were sent. Raises TapeError for a broken one."""
        chunk, self._left = self._left + chunk, b""
        first, *pieces = chunk.split(b"\xff")
        plain = [first]
        while pieces:
            piece = pieces.pop(0)
            if piece[:1] == b"\x00":
                raise TapeError(message("dnc.no_stop_bit", port=self._port))
            if piece:
                raise TapeError(message("dnc.marked", port=self._port))
            if not pieces:
                self._left = b"\xff"
                break
            plain += [b"\xff", pieces.pop(0)]
        return b"".join(plain)


@dataclass(frozen=True, slots=True)
class Received:
    """The programs of one transmission, and why what came after them was not kept (None: nothing came)."""

    tapes: tuple[Tape, ...]
    problem: Message | None = None


def receive(line: Line, tell: Callable[[int], None] = lambda _: None) -> Received:
    """All that is sent in one go; ``tell`` gets the bytes so far.

    Raises TapeError, and then there is nothing.
    """
    settings = line.settings
    before = _counters(line)
    line.control(DC1)
    try:
        reader = Reader(settings.even_parity)
        _until_end(line, reader, tell)
        tapes, problem = _and_others(line, reader, tell)
    finally:
        with contextlib.suppress(OSError):
            line.control(DC3)
    if lost := [message(f"dnc.bad_{name}") for at, name in _BAD.items() if _counters(line)[at] > before[at]]:
        raise TapeError(message("dnc.lost", port=settings.port, lost=chain("and", lost)))
    return Received(tuple(one for tape in tapes for one in programs(tape)), problem)


def _and_others(line: Line, reader: Reader, tell: Callable[[int], None]) -> tuple[list[Tape], Message | None]:
    """The tape that was read, and those that follow it without a pause; why one of them was not kept."""
    assert reader.tape is not None
    tapes = [reader.tape]
    try:
        while True:
            rest, reader = reader.rest, Reader(line.settings.even_parity)
            reader.feed(rest)
            if not _until_end(line, reader, tell, follows=True) or reader.tape is None:
                return tapes, None
            tapes.append(reader.tape)
    except OSError:  # the other end is gone, and its program was whole
        return tapes, None
    except TapeError as error:
        last = tapes[-1].name or message("dnc.the_program")
        return tapes, message("dnc.behind", last=last, why=error)


def _until_end(line: Line, reader: Reader, tell: Callable[[int], None], follows: bool = False) -> bool:
    """Whether a tape came to its end; False: none began, where one may follow another. Raises TapeError."""
    settings, received = line.settings, 0
    begin_s = TRAILER_S if follows else settings.wait_s
    heard_s = asked_s = time.monotonic()
    while reader.tape is None:
        chunk = line.port.read(max(1, min(4096, line.port.in_waiting)))
        now_s = time.monotonic()
        begun = reader.holds_text if follows else reader.began
        if chunk:
            heard_s = asked_s = now_s
            received += len(chunk)
            reader.feed(line.decode(chunk))
            tell(received)
        elif now_s - heard_s > (settings.silence_s if begun else begin_s):
            if follows and not begun:
                return False
            raise _silence(settings, reader, now_s - heard_s)
        elif now_s - asked_s > REPEAT_S:
            asked_s = now_s
            line.control(DC1)
    return True


def _silence(settings: LineSettings, reader: Reader, silent_s: float) -> TapeError:
    if not reader.began:
        return TapeError(message("dnc.none", port=settings.port, silent_s=silent_s))
    return TapeError(message("dnc.silent", port=settings.port, line=reader.line, silent_s=silent_s))


def send(
    line: Line, tape: bytes, tell: Callable[[int], None] = lambda _: None, await_start: bool = False
) -> None:
    """Punch a tape; ``tell`` gets the bytes so far. Raises TapeError.

    ``await_start``: begin when the reader sends DC1, as controls do that ask for a program.
    """
    if await_start:
        _await_start(line)
    line.control(DC2)
    for at in range(0, len(tape), CHUNK):
        line.port.write(tape[at : at + CHUNK])
        tell(min(at + CHUNK, len(tape)))
    line.control(DC4)
    _drain(line)


def _await_start(line: Line) -> None:
    """Wait for DC1; for that the kernel must not take it for itself."""
    fd, ends_s = line.port.fileno(), time.monotonic() + line.settings.wait_s
    state = termios.tcgetattr(fd)
    before = state[0]
    state[0] &= ~termios.IXON
    termios.tcsetattr(fd, termios.TCSANOW, state)
    start = coded(DC1, line.settings.even_parity)
    while start not in line.port.read(1):
        if time.monotonic() > ends_s:
            raise TapeError(message("dnc.no_start", port=line.settings.port, wait_s=line.settings.wait_s))
    state[0] = before
    termios.tcsetattr(fd, termios.TCSANOW, state)


def _drain(line: Line) -> None:
    """Wait until the kernel has sent all; closing earlier would cut the tape."""
    left, moved_s = line.port.out_waiting, time.monotonic()
    while left:
        time.sleep(0.01)
        now, now_s = line.port.out_waiting, time.monotonic()
        if now < left:
            left, moved_s = now, now_s
        elif now_s - moved_s > line.settings.silence_s:
            raise serial.SerialTimeoutException
    # The last character is still in the port's own register.
    time.sleep(20.0 / line.settings.baud + 0.01)


def _counters(line: Line) -> tuple[int, ...]:
    """The driver's counters, or zeros where it has none."""
    kept = bytearray(_COUNTERS.size)
    try:
        fcntl.ioctl(line.port.fileno(), _TIOCGICOUNT, kept)
    except OSError:
        return (0,) * 20
    return tuple(_COUNTERS.unpack(kept))
