"""Where in a program a motion is: line and fraction of its block, and back again.

The fraction counts along what the block itself asks for; its approach, its leads and the
turns between two blocks are no part of it. A row of lines is one motion with many lines.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from controller.plan.segment import ContinuousPath, Segment

# What stands beside the blocks of a program: to a surface and off it, and turns between two.
BESIDE = frozenset(
    ("retract", "position", "down", "plunge", "lead in", "pivot", "swivel", "link", "lead out", "lift")
)
FORMER = -2  # the id of a motion under way that is not known any more: which time a line ran is not told
AFTER_CHANGE = -3  # the id of the place after the tool change of a line: what is left of the line comes next
ENTRY_ID = 1 << 24  # motion ids of an entry, and of other ways that are no part of the program


class Spot(NamedTuple):
    """A place of a program's path.

    ``motion_id`` and ``s`` are exact and hold for the same program, machine and start;
    ``line`` (1-based) and ``fraction`` (0 to 1) are what an operator reads and writes: of a line that
    is carried out more than once, the first time.
    """

    line: int
    fraction: float
    motion_id: int = -1  # -1: only line and fraction are known; FORMER, AFTER_CHANGE
    s: float = 0.0


def fraction_at(chain: ContinuousPath, index: int, s: float) -> float:
    """The fraction of its line that is done at ``s`` of the chain's segment ``index``."""
    order = chain.segments[index].order_at(s)
    done = whole = 0.0
    for k, low, high in _spans(chain, order):
        whole += high - low
        done += high - low if k < index else max(0.0, min(s, high) - low) if k == index else 0.0
    return done / whole if whole > 0.0 else 0.0


class LinePart(NamedTuple):
    """From where on a motion is of a line: the fraction of the line there, and how it grows."""

    from_s: float
    line: int
    fraction: float
    per_s: float  # per unit of s; 0 beside the block
    order: int = 0  # ``Place.order``


def part_at(parts: Sequence[LinePart], s: float) -> tuple[LinePart, float]:
    """The part that a place is in, and the fraction of its line there."""
    part = parts[max(0, bisect_right(parts, s, key=lambda one: one.from_s) - 1)]
    return part, min(1.0, max(0.0, part.fraction + (s - part.from_s) * part.per_s))


def lines_along(chain: ContinuousPath, begun: float = 0.0) -> list[tuple[LinePart, ...]]:
    """Of each segment of a chain, in the order of s: what ``line_at`` and ``fraction_at`` say of it.

    ``begun``: of a chain that is the rest of another, the fraction of its first line at ``chain.from_s``.
    """
    spans = [list(_parts(segment)) for segment in chain.segments]
    whole: dict[int, float] = {}
    for segment, parts in zip(chain.segments, spans, strict=True):
        if segment.name not in BESIDE:
            for order, _, low, high in parts:
                whole[order] = whole.get(order, 0.0) + high - low
    done: dict[int, float] = {}
    first = chain.segments[0].order_at(chain.from_s)
    if begun >= 1.0:
        done[first] = whole[first] = 1.0
    elif begun > 0.0 and first in whole:
        passed = sum(
            max(0.0, min(chain.from_s, high) - low) for order, _, low, high in spans[0] if order == first
        )
        done[first] = (whole[first] - passed) / (1.0 - begun) - whole[first]
        whole[first] += done[first]
    return [
        tuple(_line_part(segment, part, done, whole) for part in parts)
        for segment, parts in zip(chain.segments, spans, strict=True)
    ]


def _line_part(
    segment: Segment, part: tuple[int, int, float, float], done: dict[int, float], whole: dict[int, float]
) -> LinePart:
    """Counts what is done of the part's line."""
    order, line, low, high = part
    length, before = whole.get(order, 0.0), done.get(order, 0.0)
    fraction = before / length if length > 0.0 else 0.0
    if segment.name in BESIDE:
        return LinePart(low, line, 1.0 if segment.name == "lift" else fraction, 0.0, order)
    done[order] = before + high - low
    return LinePart(low, line, fraction, 1.0 / length if length > 0.0 else 0.0, order)


def _parts(segment: Segment) -> Iterator[tuple[int, int, float, float]]:
    """(order, line, from s, to s) of each line of a segment."""
    lines = segment.lines
    begins = [max(0.0, s) for s in segment.lines_s[: len(lines)]]
    ends = [*begins[1:], segment.motion.end]
    yield from zip(segment.line_orders, lines, begins, ends, strict=True)


def place_in(chain: ContinuousPath, line: int, fraction: float) -> tuple[int, float] | None:
    """(index, s) of a fraction of a line, the first time that it runs; None where the chain has nothing of
    the line itself."""
    spans = list(_spans(chain, _first_order(chain, line)))
    left = fraction * sum(high - low for _, low, high in spans)
    for k, low, high in spans:
        if left <= high - low or (k, low, high) == spans[-1]:
            return k, min(low + left, high)
        left -= high - low
    return None


def _first_order(chain: ContinuousPath, line: int) -> int:
    """``Place.order`` of a line, the first time that it runs in a chain."""
    if not chain.place.step:
        return line
    for segment in chain.segments:
        if line in segment.lines:
            return segment.line_orders[segment.lines.index(line)]
    return -1


def _spans(chain: ContinuousPath, order: int) -> Iterator[tuple[int, float, float]]:
    """(index, from s, to s) of all that a line itself asks for."""
    for k, segment in enumerate(chain.segments):
        if segment.name in BESIDE:
            continue
        orders, begins = segment.line_orders, segment.lines_s
        low, high = bisect_left(orders, order), bisect_right(orders, order)
        if low < high:
            yield k, max(begins[low], 0.0), begins[high] if high < len(begins) else segment.motion.end
