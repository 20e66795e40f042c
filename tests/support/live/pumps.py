"""The pump of a live machine in tests: its process, and what is on the bus by it."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Sequence
from pathlib import Path

from drives import pdo
from drives.pump.process import NAME

CUT = "G21 G90 G54 G1 X150. F2400.\nM30\n"  # along X: the same number of counts in every period
DRIVES = 5


def pump_of(tick: int) -> int:
    """Process id of the pump of a tick's process."""
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parent = int(_stat(folder)[1])
            if parent == tick and (folder / "comm").read_text().strip() == NAME:
                return int(folder.name)
    raise AssertionError("there is no pump")


def is_alive(pid: int) -> bool:
    try:
        return _stat(Path(f"/proc/{pid}"))[0] != "Z"
    except OSError:
        return False


def _stat(folder: Path) -> list[str]:
    """Of proc(5), from the state on."""
    return (folder / "stat").read_text().rsplit(")", 1)[1].split()


class Cycles:
    """What was heard, SYNC by SYNC: ``steps`` of X from one to the next, its ``words``.

    ``torn``: SYNCs but for the last that are not followed by the setpoints of all drives, in their order.
    """

    def __init__(self, frames: Sequence[tuple[int, bytes]]) -> None:
        heard: list[list[tuple[int, bytes]]] = []
        for can_id, data in frames:
            if can_id == pdo.SYNC:
                heard.append([])
            elif can_id & ~0xF == pdo.RPDO1 and heard:
                heard[-1].append((can_id, data))
        wanted = [pdo.rpdo(1, node) for node in range(1, DRIVES + 1)]
        self.torn = sum([can_id for can_id, _ in cycle] != wanted for cycle in heard[:-1])
        self.words, places = [], []
        for cycle in heard:
            if cycle:
                word, place = pdo.COMMAND.unpack(cycle[0][1])
                self.words.append(word)
                places.append(place)
        self.steps = [b - a for a, b in itertools.pairwise(places)]


def full_feed(steps: Sequence[int]) -> Sequence[int]:
    """The part of a cut at its feed, without what speeds up and slows down."""
    usual = sorted(steps)[len(steps) * 3 // 4]
    at_feed = [i for i, step in enumerate(steps) if step == usual]
    return steps[at_feed[0] : at_feed[-1] + 1]


def assert_braked(cycles: Cycles) -> None:
    """Full feed, a ramp to rest that never goes back, rest, and nothing of ours any more."""
    steps = cycles.steps
    assert not cycles.torn
    rest = steps.index(0)
    assert steps[0] > 1000
    assert all(b <= a + 1 for a, b in itertools.pairwise(steps)), steps
    assert max(a - b for a, b in itertools.pairwise(steps)) < steps[0] / 4, f"no ramp: {steps}"
    assert steps[rest:] == [0] * len(steps[rest:]) and len(steps) - rest >= 5
