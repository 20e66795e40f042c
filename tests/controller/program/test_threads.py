"""G33, G33.1, M29 and the rigid G84 and G74: their blocks, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines import tapping

from controller.machine.model import Machine
from controller.program import blocks
from controller.program.program import Action, JointLine, ProgramError

MADE = tapping.machine()
HEAD = "G21 G90 G0 Z10.\nS600 M3 F600\n"


def lines(text: str, made: Machine = MADE) -> list[tuple[float | None, float, float | None]]:
    """Height, turns a millimetre and where they begin, of each line along a thread."""
    program = blocks.read((HEAD + text).encode(), made, "part.ngc")
    threads = [block for block in program.blocks if isinstance(block, JointLine) and block.thread is not None]
    z = made.linear()[2]
    return [(one.targets[z], *one.thread) for one in threads if one.thread is not None]


def speeds(text: str) -> list[float]:
    program = blocks.read((HEAD + text).encode(), MADE, "part.ngc")
    return [block.modal.spindle_rev_min for block in program.blocks if isinstance(block, Action)]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("G33.1 Z2. K0.5", [(2.0, 2.0, 0.0), (10.0, -2.0, None)]),
        ("M4\nG33.1 Z2. K0.5", [(2.0, -2.0, 0.0), (10.0, 2.0, None)]),
        ("G91 G33.1 Z-3. K1.", [(7.0, 1.0, 0.0), (10.0, -1.0, None)]),
        ("G20 G33.1 Z0.2 K0.05", [(5.08, 1.0 / 1.27, 0.0), (10.0, -1.0 / 1.27, None)]),
        ("G33 Z2. K1.", [(2.0, 1.0, 0.0)]),
        ("M4\nG33 Z20. K1.", [(20.0, -1.0, None)]),
        ("G84 Z2. R8.", [(2.0, 1.0, 0.0), (8.0, -1.0, None)]),
        ("G84 Z2. R8. Q4.", [(4.0, 1.0, 0.0), (8.0, -1.0, None), (2.0, 1.0, 0.0), (8.0, -1.0, None)]),
        ("M4\nG74 Z2. R8.", [(2.0, -1.0, 0.0), (8.0, 1.0, None)]),
        ("G95 F1.5\nG84 Z2. R8.", [(2.0, 1.0 / 1.5, 0.0), (8.0, -1.0 / 1.5, None)]),
    ],
)
def test_a_thread_goes_by_the_turns_of_the_spindle(
    text: str, wanted: list[tuple[float, float, float | None]]
) -> None:
    found = lines(text)
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert one[2] == other[2]
        assert one[:2] == pytest.approx(other[:2], rel=1e-9)


@pytest.mark.parametrize("text", ["G33.1 Z2. K1.", "G33 Z2. K1.", "G84 Z2. R8.", "G84 Z2. R8. Q1."])
def test_the_spindle_stands_before_and_turns_again_behind(text: str) -> None:
    assert speeds(text) == [600.0, 0.0, 600.0]


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("G33.1 Z2.", "has no K"),
        ("G33.1 K1.", "without Z"),
        ("M5\nG33.1 Z2. K1.", "the spindle stands"),
        ("G33.1 X1. Z2. K1.", "along Z alone"),
        ("G33.1 Z10. K1.", "goes nowhere"),
        ("G33.1 Z2. K0.", "makes a pitch of 0"),
        ("G33.1 Z2. K200.", "makes a pitch of 200"),
        ("G33.1 Z2. K1. I99.", "how much faster"),
        ("G43.4\nG33.1 Z2. K1.", "G49 before it"),
        ("M4\nG84 Z2. R8.", "does not turn clockwise"),
        ("G84 Z2. R8. Q0.", "is no depth of a peck"),
        ("G84 Z2. R8. F0.01", "makes a pitch"),
    ],
)
def test_what_is_no_thread_is_refused(text: str, phrase: str) -> None:
    with pytest.raises(ProgramError, match=phrase):
        lines(text)


@pytest.mark.parametrize("text", ["G33.1 Z2. K1.", "G33 Z2. K1.", "G84 Z2. R8. Q1."])
def test_without_the_spindles_angle_it_is_refused(text: str) -> None:
    with pytest.raises(ProgramError, match="tells its angle"):
        lines(text, tapping.machine("counts_per_rev = 4096"))


def test_m29_changes_nothing() -> None:
    made = replace(MADE, dialect="fanuc")
    assert lines("M29 S600\nG84 Z2. R8.", made) == lines("G84 Z2. R8.", made)
