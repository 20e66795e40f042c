"""Codes that are noted or refused, in lines as programs have them: the code is to blame, not its words."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.oracles import reference_interpreter

from controller.machine import Machine
from controller.plan.text import blocks
from controller.plan.text.code_table import BY_DIALECT, Fate
from controller.plan.text.program import JointLine, ProgramError, Remark

NOTED = {
    "fanuc": ("G5 P10000", "G5.1 Q1", "G8 P1", "G187 P3 E0.01", "G15", "G23", "G25", "G50", "G67"),
    "rs274": ("G103 P1", "G187 P2", "G255", "M51 P1", "G15", "G50"),
}
REFUSED = {
    "rs274": (
        *("G7", "G8"),
        *(
            "G17.1",
            "G18.1",
            "G19.1",
            "G33 Z-2. K0.125",
            "G33.1 Z-5. K1.",
            "G76 P0.05 Z-1. I-.075 J.008 K.045",
        ),
        *("G38.2 Z-10. F50.", "G38.3 Z-10. F50.", "G38.4 Z1. F5.", "G38.5 Z1. F5.", "G44 H1"),
        *("G87 X1. Y1. Z-1. R1. I.5 J.5 K-2. F100.", "G88 X1. Z-1. R1. P1. F100.", "G96 D2500 S250"),
    ),
    "fanuc": (
        *(
            "G5.2 P1 X0. Y1. L3",
            "G5.3",
            "G7",
            "G16",
            "G22 X1. Y1. Z1. I0. J0. K0.",
            "G26",
            "G27 X0. Y0.",
            "G29 X1. Y1.",
            "G31 Z-10. F50.",
        ),
        *("G54.2 P1", "G65 P9010 A1. B2.", "G66 P9010 A1.", "M29 S500", "G254", "G53.3 X1. Y1. Z1."),
        "G76 X1. Y1. Z-1. R1. Q.1 F100.",
    ),
}


def machine(dialect: str) -> Machine:
    return replace(reference_interpreter.machine(dialect), without_point="unit")


@pytest.mark.parametrize(("dialect", "line"), [(d, line) for d, lines in REFUSED.items() for line in lines])
def test_the_code_is_refused_with_what_to_write_instead(dialect: str, line: str) -> None:
    code = line.split()[0]
    with pytest.raises(ProgramError) as error:
        blocks.read(f"G21\nN20 {line}\n".encode(), machine(dialect), "p.ngc")
    row = BY_DIALECT[dialect][code]
    assert row.fate is Fate.REFUSED and row.told in error.value.sentence
    assert (error.value.line, error.value.column, error.value.about) == (2, 5, code)


@pytest.mark.parametrize(("dialect", "line"), [(d, line) for d, lines in NOTED.items() for line in lines])
def test_a_noted_code_changes_nothing_and_is_told_once(dialect: str, line: str) -> None:
    told = blocks.read(f"{line}\nG0 X1.\n{line}\nX2.\n".encode(), machine(dialect), "p.ngc").blocks
    plain = blocks.read(b"G0 X1.\nX2.\n", machine(dialect), "p.ngc").blocks
    moves = [[b.targets for b in found if isinstance(b, JointLine)] for found in (told, plain)]
    assert moves[0] == moves[1]
    (remark,) = [block.sentence for block in told if isinstance(block, Remark)]
    assert remark.startswith(line.split()[0])
