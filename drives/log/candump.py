"""Frames as lines of a candump log, which can-utils, python-can and most viewers read.

(1234.567890) can0 183#370610270000     data frame: identifier, data
(1234.567990) can0 703#R1               remote frame asking for 1 byte
(1234.568090) can0 1ABCDEF0#0102        29-bit identifier: eight digits
(1234.568190) can0 20000040#0000...     error frame: the flag is part of the identifier
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator

from drives.pdo import ERROR_FLAG, EXTENDED_FLAG, FRAME, REMOTE_FLAG
from drives.texts import TextError, message

LINE = re.compile(
    r"\((\d+\.\d+)\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(R[0-8]?|(?:[0-9A-Fa-f]{2}){0,8})(?: [RT])?\Z"
)

Logged = tuple[float, str, bytes]  # time (s), bus, frame (16 bytes)


class CandumpError(TextError, ValueError):
    """A line is not of a candump log; the text says which and why."""


def line(at_s: float, bus: str, frame: bytes | bytearray | memoryview) -> str:
    """One frame (16 bytes) as a line without its end; times before 0 are written as 0."""
    can_id, length, data = FRAME.unpack(frame)
    name = f"{can_id & 0x1FFF_FFFF:08X}" if can_id & EXTENDED_FLAG else f"{can_id & 0x7FF:03X}"
    if can_id & ERROR_FLAG:
        name = f"{can_id & 0x3FFF_FFFF:08X}"
    payload = f"R{length}" if can_id & REMOTE_FLAG else data[:length].hex().upper()
    return f"({max(0.0, at_s):.6f}) {bus} {name}#{payload}"


def parse(text: str) -> Logged:
    """The frame of one line. Raises CandumpError."""
    found = LINE.match(text.strip())
    if found is None:
        raise CandumpError(message("candump.no_line", text=text.strip()))
    at_s, bus, name, payload = found.groups()
    can_id = int(name, 16)
    if len(name) == 8 and not can_id & ERROR_FLAG:
        can_id |= EXTENDED_FLAG
    if payload.startswith("R"):
        return float(at_s), bus, FRAME.pack(can_id | REMOTE_FLAG, int(payload[1:] or "0"), b"")
    data = bytes.fromhex(payload)
    return float(at_s), bus, FRAME.pack(can_id, len(data), data)


def read(lines: Iterable[str]) -> Iterator[Logged]:
    """The frames of a log, empty lines left out. Raises CandumpError with the number of the line."""
    for number, text in enumerate(lines, 1):
        if text.strip():
            try:
                yield parse(text)
            except CandumpError as error:
                raise CandumpError(message("candump.line", line=number, why=error)) from None


def save(path: str | os.PathLike[str], frames: Iterable[Logged]) -> None:
    """Write a log, whole or not at all. Raises OSError."""
    unfinished = f"{os.fspath(path)}.part"
    with open(unfinished, "w", encoding="ascii") as file:
        file.writelines(line(*logged) + "\n" for logged in frames)
    os.replace(unfinished, path)


class Writer:
    """A handler that writes every frame it is given to a file, through a buffer. Raises OSError."""

    def __init__(self, path: str | os.PathLike[str], bus: str, offset_s: float = 0.0) -> None:
        """``offset_s`` makes the wall-clock times of the bus' clock that a candump log has."""
        self._file = open(path, "w", encoding="ascii", buffering=1 << 16)  # noqa: SIM115 (kept open)
        self._bus = bus
        self._offset_s = offset_s

    def __call__(self, frame: bytes | bytearray, at_s: float) -> None:
        self._file.write(line(at_s + self._offset_s, self._bus, frame) + "\n")

    def close(self) -> None:
        self._file.close()
