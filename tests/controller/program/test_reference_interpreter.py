"""Random programs beside LinuxCNC's own interpreter, where it is installed: no different motion."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from support.oracles import reference_interpreter
from support.oracles.reference_interpreter import Move
from support.parts import random_codes, random_cycles, random_grammar, random_planar
from support.suite import seed

NO_ROOM = ("leaves standing", "vanishes behind the cutter", "cannot be reached")
SLIGHT_MM = (
    1e-3  # an arc about a corner that leads no further: rs274 makes one where the words' rounding bends
)
PROGRAMS = 20  # here; a thousand and more outside of the fast tests, each part with others
PARTS = [(PROGRAMS, 0), *(pytest.param(250, part, marks=pytest.mark.slow) for part in range(1, 5))]


def without_slight_corners(moves: Sequence[Move]) -> list[Move]:
    """All moves but arcs that end where they begin, but for ``SLIGHT_MM``."""
    kept: list[Move] = []
    for move in moves:
        if move.kind != "arc" or not kept or math.dist(move.axes, kept[-1].axes) > SLIGHT_MM:
            kept.append(move)
    return kept


@pytest.mark.skipif(
    reference_interpreter.program() is None, reason="rs274 (linuxcnc-uspace) is not installed"
)
@pytest.mark.parametrize("make", [random_codes.program, random_grammar.program, random_cycles.program])
@pytest.mark.parametrize(("count", "part"), PARTS)
def test_random_programs_lead_where_the_reference_interpreter_leads(
    make: Callable[[random.Random], str], count: int, part: int, tmp_path: Path
) -> None:
    machine = reference_interpreter.machine()
    print(f"seed {seed.SEED}")
    rng = random.Random(f"{seed.SEED} {part}")
    for _ in range(count):
        text = make(rng)
        ours = reference_interpreter.ours(text, machine)
        theirs = reference_interpreter.reference(text, tmp_path, machine)
        assert (ours.refused, theirs.refused) == ("", ""), text
        assert len(ours.moves) == len(theirs.moves), text
        for mine, other in zip(ours.moves, theirs.moves, strict=True):
            assert mine.near(other), f"{mine}\n{other}\n{text}"


@pytest.mark.skipif(
    reference_interpreter.program() is None, reason="rs274 (linuxcnc-uspace) is not installed"
)
@pytest.mark.parametrize(("count", "part"), PARTS)
def test_a_cutter_beside_a_contour_goes_where_the_reference_interpreter_leads(
    count: int, part: int, tmp_path: Path
) -> None:
    """What both cut is the same; what it refuses is refused; where the part is cut into only we refuse."""
    machine = reference_interpreter.machine()
    tools = (replace(tool, radius_mm=mm) for tool, mm in zip(machine.tools, (3.175, 6.35), strict=False))
    machine = replace(machine, tools=tuple(tools))
    print(f"seed {seed.SEED}")
    rng, cut = random.Random(f"{seed.SEED} {part}"), 0
    for _ in range(count):
        text = random_planar.program(rng)
        ours = reference_interpreter.ours(text, machine)
        theirs = reference_interpreter.reference(text, tmp_path, machine)
        cuts, others = without_slight_corners(ours.moves), without_slight_corners(theirs.moves)
        for mine, other in zip(cuts, others, strict=False):
            assert mine.near(other), f"{mine}\n{other}\n{text}"
        if ours.refused:
            assert theirs.refused or any(why in ours.refused for why in NO_ROOM), f"{ours.refused}\n{text}"
        else:
            assert not theirs.refused and len(cuts) == len(others), f"{theirs.refused}\n{text}"
            cut += 1
    assert cut > count // 3
