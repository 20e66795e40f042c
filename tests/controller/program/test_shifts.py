"""G52: a ruled surface here, a shift of coordinates on other controls; never a guess which."""

from __future__ import annotations

import itertools

import pytest
from support.machines.traced_programs import mill, segments, sentences, trace
from support.suite.cases import each

from controller.motion.motions import ToolSpline
from controller.program import blocks
from controller.program.program import Block, CutRuled, JointLine, ProgramError, Remark

MILL = mill()
FIRST, *OTHERS = (f"X{10 * k}. Y{y}. Z{z}." for y, z in ((5, 10), (0, 0)) for k in range(4))
POINTS = "\n".join(OTHERS) + "\n"
SURFACE = f"G52 {FIRST} F600.\n{POINTS}"


def kinds(text: str) -> list[type[Block]]:
    return [type(block) for block in blocks.read(text.encode(), MILL, "part.ngc").blocks]


@pytest.mark.parametrize(
    "before", ["", "G1 X5. F100.\n", "G0 Z50.\n", "G3 X10. Y0. I5. F9.\n", "G91\nG0 Z1.\nG90\n"]
)
def test_a_surface_with_its_feed_is_one_whatever_was_before(before: str) -> None:
    assert kinds(before + SURFACE)[-1] is CutRuled


@pytest.mark.parametrize(
    "before",
    [
        "F600.\n",
        SURFACE,
        "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D90. F100.\n",
        "G1 X5. F6\nG80\n",
        f"{SURFACE}G0 Z50.\nG80\n",
    ],
)
def test_without_it_where_bare_coordinates_can_be_nothing_but_points(before: str) -> None:
    assert kinds(f"{before}M8\nN5 G52 {FIRST}\n{POINTS}G52 {OTHERS[2]}\n{POINTS}")[-2:] == [
        CutRuled,
        CutRuled,
    ]


@pytest.mark.parametrize(
    "before", ["G0 Z50.\n", "G1 X5. F100.\n", "G2 X10. Y0. I5. F9.\n", f"{SURFACE}G0 Z50.\n"]
)
@each("count", [1, 6, 7, 8, 15])
@each("shift", ["X0 Y0 Z0", "X0. Y0. Z0.", "X10. Y0 Z0", "Z0", "X10."])
def test_with_a_modal_motion_no_line_after_a_shift_is_swallowed_and_none_moves(
    before: str, count: int, shift: str
) -> None:
    rows = "\n".join(itertools.islice(itertools.cycle(OTHERS), count))
    made = []
    with pytest.raises(ProgramError, match="without F may be a local shift") as refused:
        made.extend(blocks.stream(f"{before}G52 {shift}\n{rows}\nG0 Z50.\n".encode(), MILL, "part.ngc"))
    line = before.count("\n") + 1
    assert (refused.value.line, refused.value.column, len(made)) == (line, 1, len(kinds(before)))


@pytest.mark.parametrize(
    "after", ["G0 Z50.\nX1.\n", "M8\n", "F100.\n", "T1\n", "X5. F100.\n", "G54\n", "", "M30\n"]
)
def test_zeros_before_anything_else_cancel_nothing_and_are_told(after: str) -> None:
    """The motion mode stays as well: on other controls G52 holds for its line alone."""
    for place in ("X0 Y0 Z0", "X0. Y0.", "Z-0", "X0 Y0 Z0 A0 C0"):
        traced = trace(f"G1 X5. F100.\nG52 {place}\n{after}", MILL)
        assert "none is in force here" in sentences(traced)
        plain = trace(f"G1 X5. F100.\n{after}", MILL)
        assert [s.end for s in segments(traced)] == [s.end for s in segments(plain)]


def test_a_cancel_does_not_interrupt_a_row_of_lines() -> None:
    text = "G64 P0.01 G1 X10. F600.\nX20. Y1.\n{}G1 X30. Y3.\nX40. Y6.\n"
    found = [segments(trace(text.format(cancel), MILL)) for cancel in ("", "G52 X0 Y0 Z0\n")]
    assert [[s.motion.end for s in row] for row in found[:1]] == [
        [s.motion.end for s in row] for row in found[1:]
    ]
    assert any(isinstance(s.motion, ToolSpline) for s in found[1])


def test_what_stands_beside_a_cancel_still_counts() -> None:
    read = blocks.read(b"G20 G52 X0 Y0 M8\nG1 X1. F10.\n", MILL, "p").blocks
    line = read[-1]
    assert isinstance(line, JointLine) and line.targets[0] == 25.4 and line.modal.coolant == 2
    assert isinstance(read[1], Remark)
    assert kinds("G52 X0 Y0 M30\nno program") == [Remark, *kinds("M30")]
    with pytest.raises(ProgramError, match="takes H1"):
        kinds("G52 X0 H1\nM30\n")


def test_an_unreadable_line_after_a_cancel_is_refused_as_itself() -> None:
    with pytest.raises(ProgramError) as refused:
        kinds("G1 X1. F9\nG52 X0\nX1,5\n")
    assert refused.value.line == 3
