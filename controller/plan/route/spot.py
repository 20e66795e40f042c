"""Where in a program a motion is: line and fraction of its block, and back again.

The fraction counts along what the block itself asks for; its approach, its leads and the
turns between two blocks are no part of it. A row of lines is one motion with many lines.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from typing import NamedTuple

from controller.motions import ToolSpline
from controller.plan.route.stretch import Chain, Stretch

# What stands beside the blocks of a program: to a surface and off it, and turns between two.
BESIDE = frozenset(
    ("retract", "position", "down", "plunge", "lead in", "pivot", "swivel", "lead out", "lift")
)
ENTRY_ID = 1 << 24  # motion ids of an entry, and of other ways that are no part of the program


class Spot(NamedTuple):
    """A place of a program's path.

    ``motion_id`` and ``s`` are exact and hold for the same program, machine and start;
    ``line`` (1-based) and ``fraction`` (0 to 1) are what an operator reads and writes.
    """

    line: int
    fraction: float
    motion_id: int = -1  # -1: only line and fraction are known
    s: float = 0.0


def line_of(stretch: Stretch, s: float) -> int:
    """The program line at a place of a stretch."""
    motion = stretch.motion
    return motion.line_at(s) if isinstance(motion, ToolSpline) else stretch.place.line


def lines_of(stretch: Stretch) -> tuple[int, int]:
    """The first and the last line of a stretch."""
    return line_of(stretch, 0.0), line_of(stretch, stretch.motion.end)


def fraction_at(chain: Chain, index: int, s: float) -> float:
    """The fraction of its line that is done at ``s`` of the chain's stretch ``index``."""
    line = line_of(chain.stretches[index], s)
    done = whole = 0.0
    for k, low, high in _spans(chain, line):
        whole += high - low
        done += high - low if k < index else max(0.0, min(s, high) - low) if k == index else 0.0
    return done / whole if whole > 0.0 else 0.0


def place_in(chain: Chain, line: int, fraction: float) -> tuple[int, float] | None:
    """(index, s) of a fraction of a line; None where the chain has nothing of the line itself."""
    spans = list(_spans(chain, line))
    left = fraction * sum(high - low for _, low, high in spans)
    for k, low, high in spans:
        if left <= high - low or (k, low, high) == spans[-1]:
            return k, min(low + left, high)
        left -= high - low
    return None


def _spans(chain: Chain, line: int) -> Iterator[tuple[int, float, float]]:
    """(index, from s, to s) of all that a line itself asks for."""
    for k, stretch in enumerate(chain.stretches):
        motion = stretch.motion
        if stretch.name in BESIDE:
            continue
        if not isinstance(motion, ToolSpline):
            if stretch.place.line == line:
                yield k, 0.0, motion.end
            continue
        low, high = bisect_left(motion.lines, line), bisect_right(motion.lines, line)
        if low < high:
            end = motion.lines_s[high] if high < len(motion.lines_s) else motion.end
            yield k, max(motion.lines_s[low], 0.0), end
