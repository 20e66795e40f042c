"""From the bytes of a file to the text of a program, its lines and their comments, and a place in it shown.

Bytes that a punched tape or a serial line left before and behind a program are no part of it:
NUL, DEL, DC1 to DC4, STX before it, and behind it ETX, EOT and the ^Z with which DOS ended texts; behind a
closing % one of these ends all, whatever follows.

Comments of a line are blanked out, but for those that say something to the operator.
``(MSG, text)``, ``(DEBUG, text)``, ``(PRINT, text)`` and ``(LOG, text)`` are shown at their place in the run;
``(ABORT, text)`` ends the program there, in the reader's language where the text is ``cycle.NAME value=...``
and the catalogue has a sentence of that name. In all but MSG parameters such as ``#1`` and ``#<name>``
stand for their values, with six decimals; behind ``%d``, ``%f`` or ``%.2f`` with none, four or so many, to
the end of the comment (as LinuxCNC).
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from mmap import mmap

from controller.messages import DEFAULT, LANGUAGES, Message, message
from controller.program.program import Place, ProgramError

_AROUND = bytes([0x00, 0x11, 0x12, 0x13, 0x14, 0x7F])
_BEFORE = _AROUND + b"\x02"
_BEHIND = frozenset(_AROUND + b"\x03\x04\x1a \t\r\n")
_CLOSED = re.compile(rb"[\r\n][ \t]*%[ \t\r\n]*[\x03\x04\x1a]")
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
    if any(data.find(byte) >= 0 for byte in (b"\x03", b"\x04", b"\x1a")) and (closed := _CLOSED.search(data)):
        end = closed.end()
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


_COMMENT = re.compile(r"[();]")
_SAYS = re.compile(r"\([ \t]*(msg|debug|print|log|abort)[ \t]*,([^()]*)\)", re.IGNORECASE)
_VALUE = re.compile(r"%d|%f|%\.([0-9])f|(##*(?:<[^<>]*>|[0-9]+))")
_OF_CYCLE = re.compile(r"(cycle\.[a-z_]+)((?: [a-z_]+=[-+.0-9#]+)*)")
_PLACE = re.compile(r"\{([a-z_]+)\}")
_PAIR = re.compile(r"([a-z_]+)=(\S+)")
_UNSET = "######"  # shown of what has no value
LONGEST = 200  # characters of what is shown


def without_comments(raw: str, name: str, number: int) -> str:
    """The line with every comment blanked out by marks, so that columns stay."""
    parts: list[str] = []
    start = 0
    while mark := _COMMENT.search(raw, start):
        at = mark.start()
        parts.append(raw[start:at])
        if mark.group() == ";":
            return "".join([*parts, "\0" * (len(raw) - at)])
        close = raw.find(")", at)
        if mark.group() == ")" or close < 0 or raw.find("(", at + 1, close) >= 0:
            raise ProgramError(name, number, at + 1, message("text.parenthesis"))
        start = close + 1
        parts.append("\0" * (start - at))
    return "".join([*parts, raw[start:]]) if parts else raw


def message_text(raw: str, values: Callable[[str], float], debug: bool = True) -> str:
    """What the comments of a line say to the operator, or ""; ``values``: that of a ``#1`` or ``#<name>``.

    ``debug``: DEBUG says something, too.
    """
    silent = ("abort",) if debug else ("abort", "debug")
    shown = [_shown(found, values) for found in _saying(raw) if found[1].lower() not in silent]
    return _short(" ".join(shown))


def aborted(raw: str, values: Callable[[str], float]) -> tuple[int, str] | None:
    """Column and text of what ends the program on a line; None: nothing does."""
    found = next((found for found in _saying(raw) if found[1].lower() == "abort"), None)
    return None if found is None else (found.start() + 1, _short(_shown(found, values)))


def ended(text: str) -> Message:
    """Why a program ends itself by ABORT."""
    found = _OF_CYCLE.fullmatch(text)
    sentence = "" if found is None else LANGUAGES[DEFAULT].texts.get(found[1], "")
    values = {} if found is None else dict(_PAIR.findall(found[2]))
    if found is None or not sentence or not values.keys() >= set(_PLACE.findall(sentence)):
        return message("text.abort", text=text)
    return message(found[1], **values)


def _saying(raw: str) -> Iterator[re.Match[str]]:
    """The comments that say something, up to a ;."""
    for found in _SAYS.finditer(raw):
        if ";" in raw[: found.start()].split(")")[-1]:
            return
        yield found


def _shown(found: re.Match[str], values: Callable[[str], float]) -> str:
    """The text of one of them."""
    if found[1].lower() == "msg":
        return found[2]
    decimals = 6

    def put(at: re.Match[str]) -> str:
        nonlocal decimals
        if at[2] is None:
            decimals = int(at[1]) if at[1] else 4 if at[0] == "%f" else 0
            return ""
        try:
            return f"{round(values(at[2]), decimals) + 0.0:.{decimals}f}"
        except ProgramError:
            return _UNSET

    return _VALUE.sub(put, found[2])


def _short(text: str) -> str:
    return " ".join(text.split())[:LONGEST]


def pointed(lines: Sequence[str], column: int, wide: int) -> list[str]:
    """Lines of which the last is the one of the place, and a caret under its column (1-based; 0: none).

    A column beyond ``wide`` is shown in the middle of as many. A sign that has no width, or another one,
    takes one column as any other: a tab is as wide as it likes.
    """
    first = max(0, column - wide // 2) if column > wide else 0
    even = [
        "".join(sign if sign.isprintable() else " " for sign in line[first : first + wide]) for line in lines
    ]
    return [*even, f"{' ' * (column - 1 - first)}^"] if column > 0 else even


_CODES = re.compile(rb"[gG][ \t]*0*(?:5[12]|6\.2)")


def may_cut(text: bytes) -> bool:
    """Whether G51, G52 or G6.2 is in it, in a comment at least."""
    return _CODES.search(text) is not None
