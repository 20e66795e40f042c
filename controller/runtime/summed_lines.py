"""Lines of a record that each have a sum (``sealed_file.line``), read as far as they are sound.

A sum says whether a line is as it was written, and so which of the lines that are one bit apart from a spoilt
one it was: a line with one bad bit is mended, and so are two that a bad bit has made one, or one that it has
made two. A line that stands elsewhere is known by its number, which its sum is of, too.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable
from typing import Any

from controller import sealed_file
from controller.messages import Message, message

Values = dict[str, Any]
MAX_MENDED_BYTES = 1 << 14  # of a line: each of its bits is tried
MAX_MENDED = 100  # lines
ELSEWHERE = 1000  # numbers before and after its own, that a line is looked for
END = b"\n"


def read(data: bytes, count: int | None) -> tuple[dict[int, Values], dict[int, Message]]:
    """By number the values of all lines that are known, and why a line is not as it was written; one that is
    in both is mended. ``count``: of the lines, where that is known; else the last one may be cut short.
    """
    found, spoilt = dict[int, Values](), dict[int, Message]()
    lines = data.removesuffix(END).split(END)
    number, i, tries = 1, 0, MAX_MENDED
    while i < len(lines):
        line, taken = lines[i], 1
        try:
            found[number] = sealed_file.of_line(line, number=number)
        except sealed_file.Damaged as error:
            if i == len(lines) - 1 and count is None and not data.endswith(END):
                break  # its writer did not live to write it to its end
            tries -= 1
            known, taken = _mended(lines[i : i + 2], number) if tries > 0 else ({}, 1)
            known = known or (_elsewhere(line, number) if tries > 0 else {})
            spoilt[min(known, default=number)] = error.said
            found |= known
            if known and not _as_written(lines[i + taken : i + taken + 1], number + 1):
                number = max((number - 1, *known))  # some are missing, or one is there twice
        number, i = number + 1, i + taken
    missing = {*range(1, max((count or 0, *found, *spoilt)) + 1)} - {*found, *spoilt}
    return found, spoilt | dict.fromkeys(missing, message("segment.missing"))


def _mended(lines: list[bytes], number: int) -> tuple[dict[int, Values], int]:
    """What the first of these lines was before one of its bits was turned over, and how many of them that
    takes; {} and 1 where it was more than that.
    """
    line = lines[0]
    if len(lines) > 1:
        for joint in _flipped(END):
            if known := _as_written([line + joint + lines[1]], number):
                return known, 2
    if len(line) <= MAX_MENDED_BYTES:
        for flipped in _flipped(line):
            if known := _as_written(flipped.split(END), number):
                return known, 1
    return {}, 1


def _flipped(data: bytes) -> Iterable[bytes]:
    """All that is one bit apart."""
    whole = bytearray(data)
    for at in range(len(whole)):
        for bit in range(8):
            whole[at] ^= 1 << bit
            yield bytes(whole)
            whole[at] ^= 1 << bit


def _as_written(lines: list[bytes], number: int) -> dict[int, Values]:
    """Their values from that number on; {} where one is not as it was written."""
    with contextlib.suppress(sealed_file.Damaged, ValueError, RecursionError):
        for one in lines:
            json.loads(one)  # most are no JSON, which this finds out in no time
        return {n: sealed_file.of_line(one + END, number=n) for n, one in enumerate(lines, number)}
    return {}


def _elsewhere(line: bytes, number: int) -> dict[int, Values]:
    """A line that was written as another one than that number."""
    for other in range(max(1, number - ELSEWHERE), number + ELSEWHERE):
        if known := _as_written([line], other):
            return known
    return {}
