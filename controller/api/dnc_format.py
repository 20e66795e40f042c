"""A part program as it travels over a serial line: what the punched tape has left of its own.

    leader    NUL, DEL and text that the reader skips
    %         start; the rest of its line belongs to it
    O1234     or :1234, the number of the program, its name here
    ...       blocks, each ended by LF, CR, CR LF or LF CR CR
    %         end; what follows is trailer, or another program with its own % and %

Between % and % there may be several programs, each with its number, as controls punch their whole
memory. NUL and DEL are tape feed and rubbed-out characters, legal anywhere; but within a line one may
stand for a character that was damaged, so there what was left out is told with its place, device
controls likewise.

``Reader`` takes bytes as they come; ``punched`` makes them. Bytes of 7-bit formats carry an even
parity bit, which is made and checked here: the port itself is run with 8 bits, as a byte of 7
bits and parity has on the wire, because not every adapter knows or tells parity.

What Directrix punches has a checksum in its leader, which other controls skip. With it a program
reads back identical to the byte, whether or not it had % of its own, and whatever its line
ends were; and what lost a character on a line without parity is found out.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

from controller.messages import Message, TextError, message

NUL, DC1, DC2, DC3, DC4, DEL = b"\x00", b"\x11", b"\x12", b"\x13", b"\x14", b"\x7f"
LEADER = 32  # NULs before and after, enough for a reader to start up
MAX_BYTES = 32 << 20
SKIPPED = bytes([0, 0x11, 0x12, 0x13, 0x14, 0x7F])  # anywhere: tape feed, rubbed out, device control
SIGNS = {0: "NUL", 0x11: "DC1", 0x12: "DC2", 0x13: "DC3", 0x14: "DC4", 0x7F: "DEL"}
MAX_TOLD = 20  # places of what was left out

_EVEN = bytes(c | 0x80 if c.bit_count() % 2 else c for c in range(128))  # with its parity bit
_ODD_ONES = bytes(c.bit_count() % 2 for c in range(256))
_SEVEN = bytes(c & 0x7F for c in range(256))
_LINE_END = re.compile(rb"\r\n|\n\r\r|\r|\n")
# A % in a comment is text; everywhere else it is the end.
_STOP = re.compile(rb"\([^)\r\n]*(?:[)\r\n]|\Z)|;[^\r\n]*(?:[\r\n]|\Z)|%")
_SUM = re.compile(rb"\(SHA256 ([0-9a-f]{64})\)")
_NUMBER = re.compile(rb"\s*(?:[O:]\s*(\d{1,8}))(?![\d.])", re.IGNORECASE)
_TAILS = (b"", b"\n", b"\r\n", b"\n\n", b"\r\n\r\n")  # after a program's own last %
_LEFT_OUT = re.compile(rb"[\x00\x11-\x14\x7f]")
_COMMENT = re.compile(rb"\([^)]*\)?|;.*")
_LAST_BLOCK = re.compile(rb"M\s*0*(?:2|30|99)(?![\d.])", re.IGNORECASE)
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")


class TapeError(TextError):
    """Where, what was found, what is allowed, what to do."""


@dataclass(frozen=True, slots=True)
class Tape:
    """What was read: the program, and its number as a name ("O1234", or "" without one)."""

    text: bytes
    name: str
    told: tuple[Message, ...] = ()  # what of it was left out, a sentence each
    is_one: bool = False  # by the checksum in its leader


class Reader:
    """Reads from % to %. With an error, nothing of it is to be kept."""

    def __init__(self, even_parity: bool, most_bytes: int = MAX_BYTES) -> None:
        self._even, self._most = even_parity, most_bytes
        self._leader = bytearray()
        self._body: bytearray | None = None  # what follows the first %
        self._looked = 0  # of the body, for its end
        self._left_out: list[tuple[int, int]] = []  # (place in the body, what), within lines
        self.tape: Tape | None = None
        self.rest = b""  # what came after the end, as it came

    @property
    def began(self) -> bool:
        return self._body is not None

    @property
    def holds_text(self) -> bool:
        """Whether something of a program has come; a % alone may be trailer."""
        return bool(self._body and self._body.strip())

    @property
    def line(self) -> int:
        """Line of the transmission that is being read, from 1 at the %."""
        return len(_LINE_END.findall(self._body or b"")) + 1

    def feed(self, chunk: bytes) -> bool:
        """The next bytes; whether the tape is at its end. Raises TapeError."""
        mark = coded(b"%", self._even)
        while chunk and self.tape is None:  # not beyond the end: what follows is not of this tape
            before, found, chunk = chunk.partition(mark)
            self._feed(before + found)
        if self.tape is not None:
            self.rest += chunk
        return self.tape is not None

    def _feed(self, chunk: bytes) -> None:
        if self._body is None:
            chunk = self._past_leader(chunk)
        if self._body is not None:
            self._take(self._body, self._seven(chunk) if self._even else chunk)
            self._look_for_end()

    def _take(self, body: bytearray, plain: bytes) -> None:
        """All but what is skipped; within a line that is noted."""
        at = 0
        for found in _LEFT_OUT.finditer(plain):
            body += plain[at : found.start()]
            at = found.end()
            if body and body[-1] not in b"\r\n" and len(self._left_out) <= MAX_TOLD:
                self._left_out.append((len(body), plain[found.start()]))
        body += plain[at:]

    def _past_leader(self, chunk: bytes) -> bytes:
        """What follows the first %. Parity does not count before: cables are plugged in there."""
        before, start, rest = chunk.partition(coded(b"%", self._even))
        plain = before.translate(_SEVEN) if self._even else before
        self._leader += plain.translate(None, SKIPPED)
        del self._leader[: -(1 << 16)]
        if start:
            self._body = bytearray()
        return rest

    def _seven(self, chunk: bytes) -> bytes:
        if (at := chunk.translate(_ODD_ONES).find(1)) >= 0:
            line = self.line + len(_LINE_END.findall(chunk[:at].translate(_SEVEN)))
            raise TapeError(message("dnc.parity", line=line, byte=chunk[at]))
        return chunk.translate(_SEVEN)

    def _look_for_end(self) -> None:
        body = self._body or bytearray()
        if len(body) > self._most:
            raise TapeError(message("dnc.no_end", line=self.line, most=self._most))
        for found in _STOP.finditer(body, self._looked):
            if found.group() == b"%":
                inside = bytes(body[: found.start()])
                told = tuple(_left_out_messages(inside, self._left_out))
                self.tape = replace(_tape(bytes(self._leader), inside), told=told)
                return
            if found.end() == len(body):  # a comment that may go on
                self._looked = found.start()
                return
            self._looked = found.end()
        self._looked = len(body)


def _tape(leader: bytes, body: bytes) -> Tape:
    """The program between the marks. Raises TapeError."""
    first = _LINE_END.search(body)
    text = body[first.end() :] if first else b""
    if _NUMBER.match(body[: first.start()] if first else body):  # %O1234, all in one line
        text = body.lstrip()
    text = _identical(leader, body, text) if (found := _SUM.search(leader)) else _LINE_END.sub(b"\n", text)
    if found and hashlib.sha256(text).hexdigest().encode() != found.group(1):
        raise TapeError(message("dnc.sum", line=len(_LINE_END.findall(body)) + 1))
    _sound(text)
    return Tape(text, _name(text), is_one=bool(found))


def _left_out_messages(body: bytes, left_out: list[tuple[int, int]]) -> Iterator[Message]:
    for at, sign in left_out[:MAX_TOLD]:
        line = len(_LINE_END.findall(body[:at])) + 1
        yield (message("dnc.left_out", line=line, name=SIGNS[sign], sign=sign))
    if len(left_out) > MAX_TOLD:
        yield message("dnc.more_left_out", max_told=MAX_TOLD)


def programs(tape: Tape) -> list[Tape]:
    """The programs of a tape: a number after a last block (M2, M30, M99) begins another one.

    What is told goes with the first of them. Raises TapeError for two of one number.
    """
    if tape.is_one:
        return [tape]
    parts, ended = [bytearray()], False
    for line in tape.text.splitlines(keepends=True):
        if ended and _NUMBER.match(line):
            parts.append(bytearray())
            ended = False
        parts[-1] += line
        ended = ended or bool(_LAST_BLOCK.search(_COMMENT.sub(b"", line)))
    found = [Tape(bytes(text), _name(text)) for text in parts]
    numbers = [one.name for one in found]
    if twice := [name for name in numbers if numbers.count(name) > 1]:
        raise TapeError(message("dnc.twice", name=twice[0]))
    return [replace(found[0], name=tape.name, told=tape.told), *found[1:]]


def _name(text: bytes | bytearray) -> str:
    number = _NUMBER.match(text.lstrip(b"%"))
    return f"O{number.group(1).decode()}" if number else ""


def _identical(leader: bytes, body: bytes, text: bytes) -> bytes:
    """What may have been punched so, until one has the sum; else the plain text."""
    found = _SUM.search(leader)
    for candidate in _candidates(body, text):
        if found and hashlib.sha256(candidate).hexdigest().encode() == found.group(1):
            return candidate
    return text


def _candidates(body: bytes, text: bytes) -> Iterator[bytes]:
    for raw in (text, _LINE_END.sub(b"\n", text)):
        yield raw
        yield raw.removesuffix(b"\n")
        yield raw.removesuffix(b"\r\n")
    for framed in (b"%" + body + b"%", b"%" + _LINE_END.sub(b"\n", body) + b"%"):
        yield from (framed + tail for tail in _TAILS)


def _sound(text: bytes) -> None:
    """Raises TapeError for what no program holds."""
    if not text.strip():
        raise TapeError(message("dnc.empty"))
    if found := _CONTROL.search(text):
        raise TapeError(_strange(text, found.start(), "dnc.control_character"))
    try:
        text.decode("utf-8")
    except UnicodeDecodeError as error:
        raise TapeError(_strange(text, error.start, "dnc.no_text")) from error


def _strange(text: bytes, at: int, key: str) -> Message:
    return message(key, line=len(_LINE_END.findall(text[:at])) + 1, byte=text[at])


def punched(
    text: bytes, even_parity: bool, line_end: bytes | None = None, leader: int = LEADER, with_sum: bool = True
) -> bytes:
    """The bytes of a tape with that program; ``line_end``: instead of the program's own.

    Raises TapeError for a program that could not be read back.
    """
    _sound(text)
    body = _framed(text) if line_end is None else _LINE_END.sub(line_end, _framed(text))
    end = line_end or (b"\r\n" if b"\r\n" in text else b"\n")
    head = b"(SHA256 " + hashlib.sha256(text).hexdigest().encode() + b")" + end
    # A sum that its reader could not meet would only make it refuse the program.
    if not with_sum or not _meets(head + body, text):
        head = b""
    tape = NUL * leader + head + body + NUL * leader
    if not even_parity:
        return tape
    if (at := next((i for i, c in enumerate(text) if c > 127), -1)) >= 0:
        raise TapeError(_strange(text, at, "dnc.eight_bits"))
    return tape.translate(_EVEN + bytes(128))


def _meets(tape: bytes, text: bytes) -> bool:
    """Whether a tape reads back identical."""
    reader = Reader(even_parity=False)
    try:
        return reader.feed(tape) and reader.tape is not None and reader.tape.text == text
    except TapeError:
        return False


def _framed(text: bytes) -> bytes:
    """The program between % and %: its own, or added."""
    marks = [found.start() for found in _STOP.finditer(text) if found.group() == b"%"]
    if not marks:
        end = b"\r\n" if b"\r\n" in text else b"\n"
        return b"%" + end + text + (b"" if text.endswith((b"\n", b"\r")) else end) + b"%" + end
    if len(marks) == 2 and not text[: marks[0]].strip() and not text[marks[1] + 1 :].strip():
        return text
    line = len(_LINE_END.findall(text[: marks[0]])) + 1
    raise TapeError(message("dnc.percent", line=line))


def coded(control: bytes, even_parity: bool) -> bytes:
    """Device control characters as they are on the wire."""
    return control.translate(_EVEN + bytes(128)) if even_parity else control
