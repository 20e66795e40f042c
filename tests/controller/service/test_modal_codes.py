"""The modal codes that an operator reads are those that the program has said."""

from __future__ import annotations

import pytest

from controller.machine import machine_file
from controller.program import blocks
from controller.service import modal_codes

START = "G17 G49 G54 G61"


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("", f"{START} T1 M5 M9"),
        ("G64 P0.01", "G17 G49 G54 G64 P0.01 T1 M5 M9"),
        ("G18\nT2 M6\nS800 M4\nM8", "G18 G49 G54 G61 T2 S800 M4 M8"),
        ("S1200 M3\nM7\nM8", f"{START} T1 S1200 M3 M7 M8"),
        ("S1200 M3\nM8\nM5 M9", f"{START} T1 M5 M9"),
        ("G43.4 H1", "G17 G43.4 G54 G61 T1 M5 M9"),
    ],
)
def test_the_codes_in_force_are_those_of_the_program(said: str, shown: str) -> None:
    text = f"G21 G90\n{said}\nG1 X1. F100.\nM30\n"
    program = blocks.read(text.encode(), machine_file.load("trunnion"), "a")
    moves = [
        block for block in program.blocks if block.place.line == text[: text.index("G1 ")].count("\n") + 1
    ]
    assert [" ".join(modal_codes.of(block.modal)) for block in moves] == [shown]
