"""Of which line a place is and how much of that line is done, without a look at the chain again."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator

import numpy as np
import pytest
from support.machines.interrupted_runs import EXAMPLE_2, LINES, TIPS, rest_of, source
from support.machines.stepped_runs import shipped

from controller.plan.path import path
from controller.plan.restart.program_position import (
    BESIDE,
    ENTRY_ID,
    FORMER,
    LinePart,
    Spot,
    fraction_at,
    lines_along,
)
from controller.plan.segment import ContinuousPath

PROGRAMS = {"surfaces": EXAMPLE_2, "lines": LINES, "blended": LINES.replace("G61", "G64 P0.05"), "tips": TIPS}
SHARES = np.linspace(0.0, 1.0, 23)


def chains(text: str) -> Iterator[ContinuousPath]:
    asked = source(text, shipped())
    tracer = path.PathBuilder(asked.name, asked.machine, asked.kinematics, asked.start, asked.chosen or {})
    yield from (item for item in tracer.items(asked.blocks) if isinstance(item, ContinuousPath))


def at(parts: tuple[LinePart, ...], s: float) -> tuple[int, float]:
    part = parts[max(0, bisect_right(parts, s, key=lambda one: one.from_s) - 1)]
    return part.line, part.fraction + (s - part.from_s) * part.per_s


@pytest.mark.parametrize("name", PROGRAMS)
def test_line_and_fraction_are_those_of_a_look_at_the_whole_chain(name: str) -> None:
    looked = 0
    for chain in chains(PROGRAMS[name]):
        for k, (segment, parts) in enumerate(zip(chain.segments, lines_along(chain), strict=True)):
            for s in SHARES * segment.motion.end * 0.9999:
                line, fraction = at(parts, s)
                true = 1.0 if segment.name == "lift" else fraction_at(chain, k, s)
                assert (line, fraction) == (segment.line_at(s), pytest.approx(true, abs=1e-9)), segment.name
                looked += 1
    assert looked > 60


@pytest.mark.parametrize("name", ["surfaces", "blended", "tips"])
def test_what_is_told_in_a_rest_is_what_was_told_in_the_whole(name: str) -> None:
    """A chain that begins inside of a line knows nothing of what was before, but for the fraction there."""
    number = 0
    for chain in list(chains(PROGRAMS[name])):
        for k, (segment, parts) in enumerate(zip(chain.segments, lines_along(chain), strict=True)):
            if segment.feed_mm_s is not None and segment.name not in BESIDE:
                begin, later = 0.31 * segment.motion.end, 0.62 * segment.motion.end
                rest = rest_of(
                    PROGRAMS[name], Spot(segment.line_at(begin), 0.0, number + k, begin), shipped()
                )
                first = next(item for item in rest.items if isinstance(item, ContinuousPath))
                assert first.from_s == begin and (first.first_id or 0) == number + k < ENTRY_ID
                told = at(lines_along(first, rest.spot.fraction)[0], later)
                assert told == (segment.line_at(later), pytest.approx(at(parts, later)[1], abs=1e-9))
        number += len(chain.segments)
        if number > 12:
            break


@pytest.mark.parametrize("share", [0.001, 0.2, 0.5, 0.808, 0.999])
def test_a_restart_by_line_and_fraction_is_at_that_very_place(share: float) -> None:
    """As after a tool correction: neither material left nor any cut twice."""
    number = 0
    for chain in chains(EXAMPLE_2):
        for k, (segment, parts) in enumerate(zip(chain.segments, lines_along(chain), strict=True)):
            if segment.cutting:
                s = share * segment.motion.end
                line, fraction = at(parts, s)
                spot = rest_of(EXAMPLE_2, Spot(line, fraction, FORMER), shipped()).spot
                assert (spot.motion_id, spot.s) == (number + k, pytest.approx(s, abs=1e-6))
        number += len(chain.segments)
