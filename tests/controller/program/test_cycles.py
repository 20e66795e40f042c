"""Canned cycles: the moves of RS-274/NGC 3.5.16 and of LinuxCNC's documentation, written by hand."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from support.machines.traced_programs import mill, sentences, trace
from support.oracles import reference_interpreter

from controller.plan.report import explained
from controller.program import blocks, code_table
from controller.program.code_rows import Fate
from controller.program.linked import SHIPPED as PROBING
from controller.program.position import homed
from controller.program.program import ProgramError

SHIPPED_PROGRAMS = PROBING.parent
START = "G21 G90 G0 X0 Y0 Z10\nF60 S100 M3\n"
UP1, UP4 = "-0.746", "-3.746"  # 0.254 mm above the last depth


def told(text: str, dialect: str = "rs274") -> list[str]:
    """What happens behind START: r, f with the place of each motion, d with seconds, s with the speed."""
    on = reference_interpreter.machine(dialect, without_point="unit")
    made, here = [], ""
    for step in explained.steps(blocks.stream((START + text).encode(), on, "p"), on, "p", homed(on)):
        place = " ".join(f"{step.axes[name]:g}" for name in "XYZ")
        moves = step.kind in ("rapid", *explained.LINES)
        if moves and place != here:
            made.append(f"{'r' if step.kind == 'rapid' else 'f'} {place}")
        elif step.kind == "dwell":
            made.append(f"d {step.facts['seconds']:g}")
        elif step.kind == "spindle":
            made.append(f"s {step.facts['rev_min']:g}")
        here = place if moves else here
    return made[2:]


@pytest.mark.parametrize(
    ("text", "moves"),
    [
        ("G98 G81 X1 Y2 Z-5 R2", "r 1 2 10, r 1 2 2, f 1 2 -5, r 1 2 10"),
        ("G99 G81 X1 Y2 Z-5 R2\nX3", "r 1 2 10, r 1 2 2, f 1 2 -5, r 1 2 2, r 3 2 2, f 3 2 -5, r 3 2 2"),
        (
            "G98 G81 X1 Z-5 R2\nX3 Z-4",
            "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 10, r 3 0 10, r 3 0 2, f 3 0 -4, r 3 0 10",
        ),
        # from below the clearance first straight up
        ("G0 Z1\nG98 G81 X1 Z-5 R2", "r 0 0 1, r 0 0 2, r 1 0 2, f 1 0 -5, r 1 0 2"),
        # G98 after G99 goes back to where the series began
        (
            "G99 G81 X1 Z-5 R2\nG98 X3",
            "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 2, r 3 0 10, r 3 0 2, f 3 0 -5, r 3 0 10",
        ),
        # another cycle goes on with the series
        (
            "G99 G81 X1 Z-5 R2\nG98 G82 X3 Z-5 R2 P1",
            "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 2, r 3 0 10, r 3 0 2, f 3 0 -5, d 1, r 3 0 10",
        ),
        # over to the next hole where the last one was left, then down to a lower R, and back to the level
        (
            "G99 G81 X1 Z-5 R2\nG98 X3 R1",
            "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 2, r 3 0 2, r 3 0 1, f 3 0 -5, r 3 0 10",
        ),
        # the same where the series began below R, with a lower R ...
        (
            "G0 Z1\nG98 G81 X1 Z-5 R6\nX3 R1",
            "r 0 0 1, r 0 0 6, r 1 0 6, f 1 0 -5, r 1 0 6, r 3 0 6, r 3 0 1, f 3 0 -5, r 3 0 1",
        ),
        # ... and where a shift of Z has put the axis at another figure
        (
            "G98 G81 X1 Z-5 R2\nG92 Z3\nX3",
            "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 10, r 3 0 10, r 3 0 9, f 3 0 2, r 3 0 17",
        ),
        # in steps, R from the level and Z from R; L times
        ("G99 G91 G81 X1 Y1 Z-3 R-8 L2", "r 1 1 10, r 1 1 2, f 1 1 -1, r 1 1 2, r 2 2 2, f 2 2 -1, r 2 2 2"),
        ("G99 G82 X1 Z-5 R2 P.5", "r 1 0 10, r 1 0 2, f 1 0 -5, d 0.5, r 1 0 2"),
        (
            "G99 G83 X1 Z-5 R2 Q3",
            f"r 1 0 10, r 1 0 2, f 1 0 -1, r 1 0 2, r 1 0 {UP1}, f 1 0 -4, r 1 0 2, r 1 0 {UP4}, "
            "f 1 0 -5, r 1 0 2",
        ),
        (
            "G99 G73 X1 Z-5 R2 Q3",
            f"r 1 0 10, r 1 0 2, f 1 0 -1, r 1 0 {UP1}, f 1 0 -4, r 1 0 {UP4}, f 1 0 -5, r 1 0 2",
        ),
        ("G99 G84 X1 Z-5 R2", "r 1 0 10, r 1 0 2, f 1 0 -5, s -100, f 1 0 2, s 100"),
        ("M4\nG99 G74 X1 Z-5 R2", "s -100, r 1 0 10, r 1 0 2, f 1 0 -5, s 100, f 1 0 2, s -100"),
        ("G98 G85 X1 Z-5 R2", "r 1 0 10, r 1 0 2, f 1 0 -5, f 1 0 2, r 1 0 10"),
        ("G98 G86 X1 Z-5 R2 P1", "r 1 0 10, r 1 0 2, f 1 0 -5, d 1, s 0, r 1 0 10, s 100"),
        ("G98 G89 X1 Z-5 R2 P1", "r 1 0 10, r 1 0 2, f 1 0 -5, d 1, f 1 0 10"),
        ("G18 G99 G81 X1 Z7 Y-5 R2", "r 0 2 10, r 1 2 7, f 1 -5 7, r 1 2 7"),
        ("G19 G99 G81 Y1 Z7 X-5 R2", "r 2 0 10, r 2 1 7, f -5 1 7, r 2 1 7"),
        ("G99 G81 X1 Z-5 R2\nG80\nG0 X4", "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 2, r 4 0 2"),
        ("G99 G81 X1 Z-5 R2\nG1 X4", "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 2, f 4 0 2"),
    ],
)
def test_the_moves_of_each_cycle(text: str, moves: str) -> None:
    assert told(text) == moves.split(", ")


@pytest.mark.parametrize(
    ("text", "moves"),
    [
        ("G99 G81 X1. Z-5. R2. K2", "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 2, f 1 0 -5, r 1 0 2"),
        ("G99 G81 X1. Z-5. R2. K0\nX2.", "r 2 0 10, r 2 0 2, f 2 0 -5, r 2 0 2"),
        ("G99 G82 X1. Z-5. R2. P500", "r 1 0 10, r 1 0 2, f 1 0 -5, d 0.5, r 1 0 2"),
        # words stay from cycle to cycle
        ("G99 G81 X1. Z-5. R2.\nG85 X2.", "r 1 0 10, r 1 0 2, f 1 0 -5, r 1 0 2, r 2 0 2, f 2 0 -5, f 2 0 2"),
        ("G98 G89 X1. Z-5. R2.", "r 1 0 10, r 1 0 2, f 1 0 -5, f 1 0 2, r 1 0 10"),
    ],
)
def test_what_fanuc_has_its_own_way(text: str, moves: str) -> None:
    assert told(text, "fanuc") == moves.split(", ")


def test_a_rotary_turns_with_the_way_over_the_hole_under_fanuc() -> None:
    on = reference_interpreter.machine("fanuc", without_point="unit")
    text = START + "G99 G81 X1. C30. Z-5. R2.\nC60."
    found = list(explained.steps(blocks.stream(text.encode(), on, "p"), on, "p", homed(on)))
    assert [step.axes["C"] for step in found if step.axes["Z"] == -5.0] == pytest.approx([30.0, 60.0])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("G81 X1 R2", "G81 has no Z, the bottom"),
        ("G81 X1 Z-5", "G81 has no R"),
        ("G18 G81 X1 R2", "G81 has no Y, the bottom"),
        ("G81 X1 Z-5 R2\nG82 X2 P1", "G82 has no Z"),
        ("G81 X1 Z5 R2", "below its bottom"),
        ("G83 X1 Z-5 R2", "G83 has no Q"),
        ("G83 X1 Z-5 R2 Q-1", "Q-1"),
        ("G83 X1 Z-5 R2 Q.0001", "would peck 70000 times"),
        ("G83 X1 Z-5 R2 Q.1 L200", "would peck 14000 times"),
        ("G82 X1 Z-5 R2", "G82 has no P"),
        ("G81 X1 Z-5 R2 L0", "L0 repeats a cycle 1 to"),
        ("G81 X1 Z-5 R2 L1.5", "L1.5 is not a count"),
        ("G81 X1 Z-5 R2 A5", "no code on this line takes A5"),
        ("G81 X1 Z-5 R2 P1", "no code on this line takes P1"),
        ("G93 F2 G81 X1 Z-5 R2", "G81 stands under G93"),
        ("G41 G81 X1 Z-5 R2", "G81 stands under G41"),
        ("G43.4 G81 X1 Z-5 R2", "under tool-centre control"),
        ("M4\nG84 X1 Z-5 R2", "does not turn clockwise"),
        ("M5\nG86 X1 Z-5 R2 P1", "while the spindle stands"),
        ("G87 X1 Z-5 R2", "G87 (back boring) is not done here"),
        ("G76 X1", "G76 (threading) is not done here"),
        ("G81 X1 Z-5 R2\nR3", "no code on this line takes R3"),
        ("G81 X1 Z-5 R2\nG20 X2", "write Z and R anew"),
        ("G81 X1 Z-5 R2\nG20\nX2 R1", "write Z anew"),
        ("G83 X1 Z-5 R2 Q1\nG20 X2 Z-1 R1", "write Q anew"),
    ],
)
def test_what_is_refused_says_why(text: str, sentence: str) -> None:
    with pytest.raises(ProgramError) as error:
        told(text)
    assert sentence in error.value.sentence


def test_tapping_is_told_once_to_need_a_floating_holder() -> None:
    text = "G0 Z50\nS100 M3 F60\nG84 X1 Z30 R40\nX2\nX3\nG80\n"
    assert sentences(trace(text, mill())).count("floating holder") == 1


def test_every_canned_cycle_has_its_picture_in_the_description() -> None:
    description = (SHIPPED_PROGRAMS / "README.md").read_text()
    cycles = {row.name for row in code_table.ROWS if row.fate is Fate.DONE and {*"RLK"} <= {*row.letters}}
    drawn = {file.stem.upper(): file for file in (SHIPPED_PROGRAMS / "cycles").glob("*.svg")}
    assert {*drawn} == cycles | {"G33.1"}
    for code, file in drawn.items():
        ElementTree.parse(file)
        assert f"![{file.stem}](cycles/{file.name})" in description, code
