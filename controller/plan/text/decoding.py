"""From the bytes of a file to the text of a program, and its lines.

Bytes that a punched tape or a serial line left before and behind a program are no part of it:
NUL, DEL, DC1 to DC4 and, behind it, the ^Z with which DOS ended texts.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from mmap import mmap

from controller.plan.text.program import Place, ProgramError

_AROUND = bytes([0x00, 0x11, 0x12, 0x13, 0x14, 0x7F])
_BEHIND = frozenset(_AROUND + b"\x1a \t\r\n")
_LEADER = re.compile(rb"[\x00\x11-\x14\x7f \t\r\n]*")
NEWLINE = re.compile(r"\r\n|\r|\n")
PART = 65_536  # characters that are split at once
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
Bytes = bytes | mmap  # of a file: read, or mapped


def text_of(data: Bytes, name: str) -> tuple[str, tuple[Place, str] | None]:
    """The text, and what to tell of it where it is not UTF-8; ProgramError for what is no text."""
    text, remark = _decoded(*_without_tape(data), name)
    if control := _CONTROL.search(text):
        found = f"control character 0x{ord(control.group()):02X}"
        raise _unreadable(_place(text[: control.start()]), name, f"{found} is not program text")
    return text.removeprefix("\ufeff"), remark


def _decoded(leader: str, body: memoryview, name: str) -> tuple[str, tuple[Place, str] | None]:
    try:
        return leader + str(body, "utf-8"), None
    except UnicodeDecodeError as error:
        at = error.start
    place, found = _place(leader + str(body[:at], "utf-8")), f"byte 0x{body[at]:02X} is"
    if bytes(body[:2]) not in _UTF_16:
        with suppress(UnicodeDecodeError):
            told = f"{found} not UTF-8, so the file is read as Windows-1252; it matters in comments only."
            return leader + str(body, "cp1252"), (place, told)
    raise _unreadable(place, name, f"{found} not readable text")


def _without_tape(data: Bytes) -> tuple[str, memoryview]:
    """The blank lines before the program, and the program: a view, so that it is not held twice."""
    view, end = memoryview(data), len(data)
    while end and view[end - 1] in _BEHIND:
        end -= 1
    leader = _LEADER.match(data, 0, end)
    begin = leader.end() if leader else 0
    return str(bytes(view[:begin]).translate(None, _AROUND), "ascii"), view[begin:end]


def _unreadable(place: Place, name: str, found: str) -> ProgramError:
    sentence = f"{found}: a program is plain ASCII or UTF-8 text; save or send the file again as plain text"
    return ProgramError(name, place.line, place.column, sentence)


def _place(before: str) -> Place:
    """Where the text after ``before`` stands."""
    lines = NEWLINE.split(before.removeprefix("\ufeff"))
    return Place(len(lines), len(lines[-1]) + 1)


def lines_of(text: str) -> Iterator[str]:
    """The lines of ``text``, split part by part: a long program is not held twice."""
    start = 0
    while (end := NEWLINE.search(text, _not_inside(text, start + PART))) is not None:
        yield from NEWLINE.split(text[start : end.start()])
        start = end.end()
    yield from NEWLINE.split(text[start:])


def _not_inside(text: str, at: int) -> int:
    """A place that is not between CR and LF."""
    return at - 1 if text[at - 1 : at + 1] == "\r\n" else at
