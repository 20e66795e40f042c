"""@ and ^: the ends that LinuxCNC's interpreter gives for the same lines."""

from __future__ import annotations

import math

import pytest
from support.oracles import reference_interpreter

from controller.program import blocks
from controller.program.program import ProgramError

HEAD = "G21 G90 F100\nG0 X3 Y4 Z5\n"


def ends(text: str) -> list[tuple[float, float]]:
    read = reference_interpreter.ours(text, reference_interpreter.machine())
    assert read.refused == ""
    return [(move.axes[0], move.axes[1]) for move in read.moves][1:]


def test_a_word_that_is_left_out_stays() -> None:
    found = ends(HEAD + "G1 @10 ^90\n^0\n@2\n")
    assert found == [pytest.approx(p, abs=1e-9) for p in ((0.0, 10.0), (10.0, 0.0), (2.0, 0.0))]


def test_under_g91_both_are_steps() -> None:
    found = ends(HEAD + "G1 @2 ^0\nG91 @3\n^45\nG20 @1\n")
    r = 5.0 * math.sqrt(0.5)
    far = 30.4 * math.sqrt(0.5)
    assert found == [pytest.approx(p, abs=1e-9) for p in ((2.0, 0.0), (5.0, 0.0), (r, r), (far, far))]


def test_holes_go_round_a_circle() -> None:
    found = ends(HEAD + "G0 X10 Y0\nG91 G81 ^90 R1 Z-2 L3\n")
    holes = list(dict.fromkeys((round(x, 6) + 0.0, round(y, 6) + 0.0) for x, y in found))
    assert holes == [(10.0, 0.0), (0.0, 10.0), (-10.0, 0.0), (0.0, -10.0)]


def test_an_arc_may_end_there() -> None:
    assert ends(HEAD + "G2 @5 ^90 R30\n") == [pytest.approx((0.0, 5.0), abs=1e-9)]


@pytest.mark.parametrize(
    ("dialect", "text", "why"),
    [
        ("rs274", "G0 @5 X1\n", "@5 stands beside X or Y"),
        ("rs274", "G0 X0 Y0\nG91 @5\n", "from the origin, where no direction is"),
        ("rs274", "G0 X0 Y0\n@5\n", "keeps the angle, and at the origin there is none"),
        ("rs274", "G18\nG0 X3 Y4\n@5\n", "distance and angle in X and Y"),
        ("rs274", "G92 @5 ^3\n", "stands beside G92"),
        ("fanuc", "G0 @5.\n", 'is a word of dialect = "rs274"'),
    ],
)
def test_what_has_no_meaning_is_refused(dialect: str, text: str, why: str) -> None:
    with pytest.raises(ProgramError, match=why) as error:
        blocks.read(text.encode(), reference_interpreter.machine(dialect), "p.ngc")
    assert error.value.line == text.count("\n")
