"""Random programs beside LinuxCNC's own interpreter, where it is installed: no different motion."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from support.oracles import reference_interpreter
from support.parts import random_codes
from support.suite import seed

PROGRAMS = 20  # here; a thousand and more outside of the fast tests


@pytest.mark.skipif(
    reference_interpreter.program() is None, reason="rs274 (linuxcnc-uspace) is not installed"
)
@pytest.mark.parametrize("count", [PROGRAMS, pytest.param(1000, marks=pytest.mark.slow)])
def test_random_programs_lead_where_the_reference_interpreter_leads(count: int, tmp_path: Path) -> None:
    machine = reference_interpreter.machine()
    print(f"seed {seed.SEED}")
    rng = random.Random(seed.SEED)
    for _ in range(count):
        text = random_codes.program(rng)
        ours = reference_interpreter.ours(text, machine)
        theirs = reference_interpreter.reference(text, tmp_path, machine)
        assert (ours.refused, theirs.refused) == ("", ""), text
        assert len(ours.moves) == len(theirs.moves), text
        for mine, other in zip(ours.moves, theirs.moves, strict=True):
            assert mine.near(other), f"{mine}\n{other}\n{text}"
