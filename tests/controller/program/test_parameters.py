"""Values: operators, functions, parameters by number and name, and those that the control gives.

Figures are those of LinuxCNC's rs274 for the same lines, but where a comment says otherwise.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine
from support.suite.cases import each

from controller.geometry.vectors import Frame
from controller.machine.model import Machine
from controller.program import blocks
from controller.program.program import Action, JointLine, ProgramError

CUT = "F100\nG51 X0. Y15. Z0. I0. J0. K0. H10. R10. D90.\n"


def made() -> Machine:
    built = machine("fig4a")
    return replace(built, offsets=(Frame((0.0, 0.0, 0.0)), Frame((10.0, 20.0, 30.0)), *built.offsets[2:]))


def last_x(text: str) -> float:
    """The X word of the last move, in the active unit if that is mm."""
    (*_, block) = [b for b in blocks.stream(text.encode(), made(), "p") if isinstance(b, JointLine)]
    (x, *_) = block.targets
    assert x is not None
    return x


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("[2 eq 2.00005]", 1.0),
        ("[2 ne 2.00005]", 0.0),
        ("[1+1 eq 2 and 3 lt 4]", 1.0),
        ("[1 gt 1] ", 0.0),
        ("[1 ge 1]", 1.0),
        ("[1 le 0.5]", 0.0),
        ("[5 mod -3]", 2.0),
        ("[-5 mod 3]", 1.0),
        ("[2**3**2]", 64.0),
        ("[-2**2]", 4.0),
        ("[1 or 0 and 0]", 0.0),
        ("[2 * 3 lt 7 + 1]", 1.0),
        ("round[-2.5]", -3.0),
        ("atan[1]/[-1]", 135.0),
        ("#7", 0.0),
        ("exists[#7]", 1.0),
        ("exists[#<nobody>]", 0.0),
        ("exists[#<_metric>]", 1.0),
        ("[10 + exists[#<_nobody>]]", 10.0),
    ],
)
def test_values_are_the_references(value: str, expected: float) -> None:
    assert last_x(f"G0 X{value}\n") == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("#<two words>=4\nG0X#<TwoWords>", 4.0),
        ("#1=5 #2=#1\nG0X#2", 0.0),  # settings of a line take effect together
        ("#1=2\n#2=7\nG0X##1", 7.0),
        ("#<a>=1\n#<a>=[#<a>+1]\nG0X#<a>", 2.0),
        ("G1 F100 X#<_motion_mode>", 800.0),
        ("G1 F100 X1\nG0 X#<_motion_mode>", 10.0),
        ("G1 F100 X1\nX[#<_feed>]", 100.0),
        ("G20 F30 (inch)\nG21\nG0 X#<_feed>", 30.0),
        ("G0X#<_coord_system>", 540.0),
        ("G55\nG0X#<_coord_system>", 550.0),
        ("G55\nG0X#5220", 2.0),
        ("G0X#5242", 20.0),
        ("G0X#5221", 0.0),
        ("G0X#<_plane>", 170.0),
        ("G19\nG0X#<_plane>", 190.0),
        ("G0X#<_metric>", 1.0),
        ("G0X[#<_vmajor>+#<_vminor>]", 2.9),
        ("G91\nG0X#<_incremental>", 1.0),
        ("S500 M4\nG0X[#<_spindle_on>*10+#<_spindle_cw>]", 10.0),
        ("S500 M3\nG0X[#<_rpm>+#<_spindle_cw>]", 501.0),
        ("M8\nG0X[#<_flood>*10+#<_mist>]", 10.0),
        ("G0X#5400", 1.0),  # T1 is in the spindle here
        ("G0X#5410", 6.0),
        # In the unit of the machine file, whatever is active, as rs274 has them in the unit of its own.
        ("G20\nG0X[#5410/25.4]", 6.0),
        ("G20 G10 L2 P1 X1 C30\nG0X[#5221/25.4]", 25.4),
        ("G10 L2 P1 X1 C30\nG0X#5226", 30.0),
        ("G10 L2 P1 R30\nG0X#5230", 30.0),
        ("G0X3\nG92 X0.5\nG0X[#5211+10*#5210]", 12.5),
        ("G0X3\nG92 X0.5\nG92.2\nG0X[#5211+10*#5210]", 2.5),
        ("G0X3\nG92 X0.5\nG92.1\nG0X[#5211+10*#5210]", 0.0),
        ("G0X4\nG28.1\nG0X1\nX#5161", 4.0),
        ("G95\nG0X#<_units_per_rev>", 1.0),
        ("G90.1\nG0X#<_ijk_absolute_mode>", 1.0),
        ("G99\nG0X#<_retract_r_plane>", 1.0),
        ("G0X3\nG0X[#5420+1]", 4.0),
        ("G0X3Z2\nG55\nG0X[#<_x>]", -7.0),
        ("G0X3Z2\nG55\nG0X[#5422]", -28.0),
        ("G0X3\nG55\nG0X[#<_abs_x>]", 3.0),
        ("G0X3\nG91\nX2\nG90\nX[#<_x>]", 5.0),
        ("G0X25.4\nG20\nG0X#<_x>", 25.4),  # 1 inch
        ("G0 A30\nG20 G0X[#<_abs_a>/25.4]", 30.0),  # an angle has no inches
        ("G0A30\nG91 A5\nG90\nG0X#<_a>", 35.0),
        ("G0X#<_u>", 0.0),
        ("G0X1\nG53 G0X5\nG55 G0X#<_x>", 5.0),  # read before G55 takes effect
        ("o1 sub\nG0X#<_call_level>\no1 endsub\no1 call", 1.0),
        ("G43.4\nG0X1Y2Z3A10\nX[#<_y>+#<_a>]", 0.0),
    ],
)
def test_parameters_read_as_the_reference_has_them(text: str, expected: float) -> None:
    if "G43.4" in text:  # a place of the tip: no joint line
        (*_, block) = blocks.stream(text.encode(), made(), "p")
        assert getattr(block, "tip")[0] == pytest.approx(12.0)  # noqa: B009
        return
    assert last_x(text) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "place", "phrase"),
    [
        ("G0X#<nobody>", "1:4", "#<nobody> has no value yet"),
        ("#<_metric>=1", "1:1", "can only be read"),
        ("#5400=1", "1:1", "cannot be set"),
        ("#<_x>=1", "1:1", "can only be read"),
        (CUT + "G0X#<_x>", "3:4", "#<_x> is the position of X, which is not known here"),
        (CUT + "G0Z1\nX#5420", "4:2", "#5420 is the position of X, which is not known here"),
        ("G0X#<a", "1:5", "ends with >"),
        ("G0X[exists[1]]", "1:11", "write EXISTS"),
        ("M72", "1:1", "nothing to give back"),
        ("M70\nM71\nM72", "3:1", "nothing to give back"),
        ("o1 sub\nM72\no1 endsub\nM70\no1 call", "2:1", "nothing to give back"),
    ],
)
def test_what_has_no_value_is_refused(text: str, place: str, phrase: str) -> None:
    with pytest.raises(ProgramError) as caught:
        list(blocks.stream(text.encode(), made(), "p"))
    assert str(caught.value).startswith(f"p:{place}: ") and phrase in caught.value.sentence


@each("name", [a + b for a in "_abcdtxz9" for b in "xyzabcuvw"])
def test_two_letters_are_a_local_name_unless_the_first_is_an_underscore(name: str) -> None:
    if name[0] == "_":
        assert last_x(f"G0 X5\nX[#<{name}>+1]") == (6.0 if name == "_x" else 1.0)
        return
    with pytest.raises(ProgramError, match=f"#<{name}> has no value yet"):
        last_x(f"G0 X[#<{name}>]")
    assert last_x(f"#<{name}>=3\no1 sub\n#<{name}>=4\no1 endsub\no1 call\nG0 X[#<{name}>]") == 3.0


def test_the_state_that_m70_keeps_is_given_back_but_for_the_motion() -> None:
    text = "G20 G91 G1 F3 X1\nS100 M3 M8\nM70\nG21 G90 F100 M5 M9\nG0 X0\nM72\nX1\n"
    read = list(blocks.stream(text.encode(), made(), "p"))
    acts = [block for block in read if isinstance(block, Action)][-2:]
    assert [(act.modal.spindle_rev_min, act.modal.coolant) for act in acts] == [(100.0, 2), (100.0, 2)]
    last = read[-1]
    assert isinstance(last, JointLine) and last.relative and last.feed_mm_s is None
    assert last.targets[0] == 25.4 and last.modal.feed_mm_s == pytest.approx(3.0 * 25.4 / 60.0)


def test_a_sub_with_m73_leaves_the_state_as_it_was() -> None:
    text = "o1 sub\nM73\nG91 G20\nG0X1\no1 endsub\nG21 G90 G1 F9 X0\no1 call\nX3\n"
    *_, inside, after = blocks.stream(text.encode(), made(), "p")
    assert isinstance(inside, JointLine) and inside.relative and inside.targets[0] == 25.4
    assert isinstance(after, JointLine) and not after.relative and after.targets[0] == 3.0


@pytest.mark.parametrize(
    ("settings", "x"),
    [
        ("#100=2.\n#100=#100+1", 3.0),
        ("#100=2 * 3 - #101 / 2 #101=4", 6.0),
        ("#100=-#101 + [1 + 2] MOD 2", 1.0),
        ("#100=10. - 4. - 3.", 3.0),
        ("#100=FIX[-1.2] + 10 * FUP[-1.2] + FUP[0.5]", -20.0),
    ],
)
def test_expressions_of_fanuc_need_no_brackets_behind_an_equals_sign(settings: str, x: float) -> None:
    text = f"{settings}\nG0 X#100\n".encode()
    on = replace(made(), dialect="fanuc", without_point="unit")
    (move,) = blocks.read(text, on, "p").blocks
    assert isinstance(move, JointLine) and move.targets[0] == pytest.approx(x)
    if "+" in settings or "-" in settings[6:]:
        with pytest.raises(ProgramError):
            blocks.read(text, made(), "p")


@pytest.mark.parametrize(
    ("expression", "of_bits", "of_truth"),
    [
        ("[12 AND 10]", 8.0, 1.0),
        ("[12 OR 10]", 14.0, 1.0),
        ("[12 XOR 10]", 6.0, 0.0),
        ("[8 AND 7]", 0.0, 1.0),
        ("[-1 AND 255]", 255.0, 1.0),
        ("[1 + 6 AND 3]", 3.0, 1.0),  # AND binds before +
        ("[2 OR 1 * 4]", 6.0, 1.0),
        ("[[#101 LT 1] AND [3 GT 2]]", 1.0, 1.0),
        ("[[#101 GT 1] OR [3 LT 2]]", 0.0, 0.0),
        ("[[1 LT 2] XOR [3 GT 2]]", 0.0, 0.0),
    ],
)
def test_and_or_xor_are_of_bits_on_fanuc_and_of_truth_else(
    expression: str, of_bits: float, of_truth: float
) -> None:
    text = f"#100={expression}\nG0 X#100\n".encode()
    for dialect, x in (("fanuc", of_bits), ("rs274", of_truth)):
        (move,) = blocks.read(text, replace(made(), dialect=dialect, without_point="unit"), "p").blocks
        assert isinstance(move, JointLine) and move.targets[0] == x, dialect


@pytest.mark.parametrize(
    ("line", "place", "phrase"),
    [
        ("#100=[1.5 AND 2]", "1:11", "AND goes bit by bit"),
        ("#100=[3000000000 OR 1]", "1:18", "OR goes bit by bit"),
        ("#100=[1 EQ 1 AND 2 EQ 2]", "1:20", "write brackets"),
    ],
)
def test_bits_that_are_none_are_refused_on_fanuc(line: str, place: str, phrase: str) -> None:
    with pytest.raises(ProgramError) as caught:
        blocks.read(f"{line}\nG0 X1\n".encode(), replace(made(), dialect="fanuc"), "p")
    assert str(caught.value).startswith(f"p:{place}: ") and phrase in caught.value.sentence


@pytest.mark.parametrize(
    ("text", "x"),
    [
        ("G0 X[ROUND[1.2345] + ROUND[2.3456]]", 3.581),  # the manual's own: X[#1+#2] would be 3.580
        ("G0 X-ROUND[1.2345]", -1.235),
        ("G20 G0 X0\nG0 XROUND[1.23456]", 1.2346 * 25.4),
        ("#1=ROUND[1.6]\nG0 X#1", 2.0),
        ("#1=ROUND[-2.5]\nG0 X#1", -3.0),
        ("G0 Y[ROUND[1.5]] X[2*ROUND[0.4]]", 0.8),
    ],
)
def test_round_in_a_word_is_to_its_least_increment_on_fanuc(text: str, x: float) -> None:
    *_, move = blocks.read(text.encode(), replace(made(), dialect="fanuc", without_point="unit"), "p").blocks
    assert isinstance(move, JointLine) and move.targets[0] == pytest.approx(x)


def test_truth_needs_brackets_on_both() -> None:
    with pytest.raises(ProgramError):
        blocks.read(b"#100=1 GT 2\nG0 X1\n", replace(made(), dialect="fanuc"), "p")
