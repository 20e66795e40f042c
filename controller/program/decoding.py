"""From the bytes of a file to the text of a program, and its lines.

Bytes that a punched tape or a serial line left before and behind a program are no part of it:
NUL, DEL, DC1 to DC4, STX before it, and behind it ETX, EOT and the ^Z with which DOS ended texts.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass
from mmap import mmap

from controller.messages import Message, message
from controller.program.program import Place, ProgramError

_AROUND = bytes([0x00, 0x11, 0x12, 0x13, 0x14, 0x7F])
_BEFORE = _AROUND + b"\x02"
_BEHIND = frozenset(_AROUND + b"\x03\x04\x1a \t\r\n")
_LEADER = re.compile(rb"[\x00\x02\x11-\x14\x7f \t\r\n]*")
NEWLINE = re.compile(r"\r\n|\r|\n")
_NEWLINE = re.compile(rb"\r\n|\r|\n")
PART = 65_536  # bytes that are decoded at once, and what is left of their last line
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
Bytes = bytes | mmap  # of a file: read, or mapped


@dataclass(frozen=True, slots=True)
class Text:
    """A text that is decoded part by part: a file that is mapped takes no memory of ours."""

    leader: str  # the blank lines before the program
    body: memoryview
    encoding: str

    def parts(self) -> Iterator[str]:
        """The text in pieces of whole lines, without the line ends between them."""
        start, before = 0, self.leader
        while (end := _NEWLINE.search(self.body, self._not_inside(start + PART))) is not None:
            yield before + str(self.body[start : end.start()], self.encoding)
            start, before = end.end(), ""
        yield before + str(self.body[start:], self.encoding)

    def _not_inside(self, at: int) -> int:
        """A place that is not between CR and LF."""
        return at - 1 if bytes(self.body[at - 1 : at + 1]) == b"\r\n" else at

    def lines(self) -> Iterator[str]:
        """Its lines."""
        for part in self.parts():
            yield from NEWLINE.split(part) if "\r" in part else part.split("\n")

    def whole(self) -> str:
        """All of it, held in memory."""
        return self.leader + str(self.body, self.encoding)


def text_of(data: Bytes, name: str) -> tuple[Text, tuple[Place, Message] | None]:
    """The text, and what to tell of it where it is not UTF-8; ProgramError for what is no text."""
    text, remark = _decoded(*_without_tape(data), name)
    if control := _CONTROL.search(text.body):
        place, byte = _place(text, control.start()), control.group()[0]
        raise ProgramError(name, place.line, place.column, message("text.control_character", byte=byte))
    return text, remark


def _decoded(leader: str, body: memoryview, name: str) -> tuple[Text, tuple[Place, Message] | None]:
    text = Text(leader, body, "utf-8")
    at = _first_undecoded(text)
    if at is None:
        return text, None
    place, byte = _place(text, at), body[at]
    windows = Text(leader, body, "cp1252")
    if bytes(body[:2]) not in _UTF_16 and _first_undecoded(windows) is None:
        return windows, (place, message("note.windows", byte=byte))
    raise ProgramError(name, place.line, place.column, message("text.unreadable", byte=byte))


def _first_undecoded(text: Text) -> int | None:
    """Offset of the first byte that is not of the encoding; None where all are."""
    decoder = codecs.getincrementaldecoder(text.encoding)()
    for start in range(0, len(text.body) + 1, PART):
        kept = len(decoder.getstate()[0])  # of a character that the part before has begun
        try:
            decoder.decode(text.body[start : start + PART], start + PART > len(text.body))
        except UnicodeDecodeError as error:
            return start - kept + error.start
    return None


def _without_tape(data: Bytes) -> tuple[str, memoryview]:
    """The blank lines before the program, and the program without its byte order mark."""
    view, end = memoryview(data), len(data)
    while end and view[end - 1] in _BEHIND:
        end -= 1
    leader = _LEADER.match(data, 0, end)
    begin = leader.end() if leader else 0
    blank = str(bytes(view[:begin]).translate(None, _BEFORE), "ascii")
    return blank, view[begin + 3 if bytes(view[begin : begin + 3]) == codecs.BOM_UTF8 else begin : end]


def _place(text: Text, at: int) -> Place:
    """Where the byte ``at`` of the body stands."""
    blank = NEWLINE.split(text.leader)
    line, start, before = len(blank), 0, blank[-1]
    for newline in _NEWLINE.finditer(text.body, 0, at):
        line, start, before = line + 1, newline.end(), ""
    return Place(line, len(before + str(text.body[start:at], text.encoding)) + 1)
