"""What comes of the codes that no other file of tests is about."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.oracles import reference_interpreter

from controller.geometry.vectors import Frame
from controller.machine.model import OFFSETS, Machine
from controller.program import blocks
from controller.program.program import Act, Action, Block, JointLine, ProgramError, TipLine


def machine(dialect: str = "rs274") -> Machine:
    """Nine work offsets, each with an origin of its own along X."""
    on = reference_interpreter.machine(dialect)
    return replace(on, offsets=tuple(Frame((float(i), 0.0, 0.0)) for i in range(9)), without_point="unit")


def made(text: str, dialect: str = "rs274") -> list[Block]:
    return list(blocks.read(text.encode(), machine(dialect), "p.ngc").blocks)


def last(text: str, dialect: str = "rs274") -> JointLine:
    block = made(text, dialect)[-1]
    assert isinstance(block, JointLine)
    return block


@pytest.mark.parametrize("code", ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"])
def test_a_work_offset_is_the_one_of_its_number(code: str) -> None:
    block = last(f"{code}\nG0 X5\n")
    assert OFFSETS[block.modal.offset] == code
    assert block.modal.frame(machine()).origin == (float(OFFSETS.index(code)), 0.0, 0.0)


def test_g92_1_cancels_a_shift_and_g92_2_suspends_it_for_g92_3() -> None:
    shifted = "G0 X10\nG92 X4\n"  # program X is 6 less

    def origin(text: str) -> float:
        return last(shifted + text + "G0 X0\n").modal.frame(machine()).origin[0]

    assert origin("") == 6.0
    assert origin("G92.1\n") == origin("G92.2\n") == 0.0
    assert origin("G92.2\nG92.3\n") == 6.0
    assert origin("G92.1\nG92.3\n") == 0.0


def test_g70_and_g71_are_units_where_fanuc_has_them() -> None:
    assert last("G70 G0 X1.\n", "fanuc").targets[0] == 25.4
    assert last("G70\nG71 G0 X1.\n", "fanuc").targets[0] == 1.0


def test_g49_takes_the_length_away() -> None:
    lengths = [last(f"G43 H1\n{line}G0 Z1\n").modal.length_mm for line in ("", "G49\n")]
    assert lengths == [10.0, 0.0]


def test_g43_5_takes_the_tool_axis_as_a_vector() -> None:
    (line,) = made("G43.5 H1\nG1 X1 I0 J1 K1 F100\n")[-1:]
    assert isinstance(line, TipLine) and line.axis == (0.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("code", "exact"), [("G61", True), ("G61.1", True), ("G64", False), ("G64 P0.1", False)]
)
def test_g61_1_is_as_exact_as_g61(code: str, exact: bool) -> None:
    assert last(f"G64 P1\n{code}\nG0 X1\n").modal.exact is exact


def test_g91_1_takes_centres_from_the_start_again() -> None:
    told = reference_interpreter.ours("G0 X10\nG90.1\nG91.1\nG2 X20 I5 J0 F100\n", machine())
    assert told.refused == "" and told.moves[-1].axes[0] == 20.0


def test_g97_is_turns_a_minute_and_g96_is_for_lathes() -> None:
    assert last("G97 S1500 M3\nG0 X1\n").modal.spindle_rev_min == 1500.0
    with pytest.raises(ProgramError, match="no lathe axis"):
        made("G96 D2500 S250 M3\n")


def acts(text: str) -> list[Act]:
    return [block.act for block in made(text) if isinstance(block, Action)]


def test_m0_m1_and_m60_stop_and_m2_ends() -> None:
    assert acts("M0\nM60\nM1\nG0 X1\nM2\n") == [Act.STOP, Act.STOP, Act.OPTIONAL_STOP, Act.END]
    assert len(made("G0 X1\nM2\nG0 X2\n")) == len(made("G0 X1\nM2\n"))


def test_m7_and_m8_flow_together_until_m9() -> None:
    found = [block.modal.coolant for block in made("M7\nM8\nM9\nM8\n") if isinstance(block, Action)]
    assert found == [1, 3, 0, 2]


def test_m71_forgets_what_m70_kept() -> None:
    kept = "G20\nM70\nG21\n{}M72\nG0 X1\n"
    assert last(kept.format("")).targets[0] == 25.4
    with pytest.raises(ProgramError, match="M70"):
        made(kept.format("M71\n"))


def test_an_inch_is_an_inch_in_every_word() -> None:
    assert math.isclose(last("G20 G0 X[1/3]\n").targets[0] or 0.0, 25.4 / 3.0)
