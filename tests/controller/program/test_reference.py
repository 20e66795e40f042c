"""Random programs beside LinuxCNC's own interpreter; ``DIRECTRIX_PROGRAMS=1000`` for so many."""

from __future__ import annotations

import math
import os
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine
from support.oracles import reference_runs
from support.parts.random_flow import Maker

from controller.geometry.vectors import Frame
from controller.program import blocks
from controller.program.program import JointLine, ProgramError

PROGRAMS = int(os.environ.get("DIRECTRIX_PROGRAMS", "40"))
PRINTED = 6e-5  # the reference prints four decimals

pytestmark = pytest.mark.skipif(
    reference_runs.RS274 is None, reason="rs274 (Debian's linuxcnc-uspace) is not installed"
)


def ours(text: str) -> tuple[list[reference_runs.Row], str]:
    """Ends of all moves, and the refusal that ended them."""
    built = machine("fig4a")
    built = replace(built, offsets=tuple(Frame() for _ in built.offsets))
    now, found = [0.0] * 5, []
    try:
        for block in blocks.stream(text.encode(), built, "p"):
            if isinstance(block, JointLine):
                for i, value in enumerate(block.targets):
                    if value is not None:
                        shown = math.degrees(value) if built.axes[i].is_rotary else value
                        now[i] = now[i] + shown if block.relative else shown
                found.append(("rapid" if block.feed_mm_s is None else "feed", tuple(now)))
    except ProgramError as error:
        return found, str(error)
    return found, ""


def difference(text: str) -> str:
    """What differs from the reference, or ""; what only one of them refuses differs, too."""
    (moves, refused), reference = ours(text), reference_runs.run(text)
    for k, (own, other) in enumerate(zip(moves, reference.moves, strict=False)):
        far = max(abs(a - b) for a, b in zip(own[1], other[1], strict=True))
        if own[0] != other[0] or far > PRINTED:
            return f"move {k + 1}: {own} and {other}"
    if bool(refused) != bool(reference.refused):
        return f"refused: {refused!r} and {reference.refused!r}"
    if len(moves) != len(reference.moves):
        return f"{len(moves)} and {len(reference.moves)} moves ({refused!r}, {reference.refused!r})"
    return ""


@pytest.mark.parametrize("seed", range(PROGRAMS))
def test_a_random_program_does_what_it_does_in_the_reference(seed: int) -> None:
    text = Maker(seed).text()
    assert difference(text) == "", text
