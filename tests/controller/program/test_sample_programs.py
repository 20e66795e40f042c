"""What sample programs of LinuxCNC write, and what we once refused or fell over."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.traced_programs import mill
from support.oracles import reference_interpreter

from controller.machine.equipment import Io
from controller.program import blocks, refusals
from controller.program.program import Act, Action, Await, JointLine, OperatorMessage, ProgramError

MACHINE = reference_interpreter.machine()


def test_t0_leaves_the_spindle_empty() -> None:
    made = blocks.read(b"T1 M6\nG43 G0 Z1\nT0 M6\nG49\n", MACHINE, "p.ngc").blocks
    changes = [b.modal.tool for b in made if isinstance(b, Action) and b.act is Act.TOOL]
    assert changes == [1, 0] and made[-1].modal.tool_in(MACHINE) is None
    assert blocks.read(b"M61 Q0\nG0 X1\n", MACHINE, "p.ngc").blocks[-1].modal.tool == 0


def test_without_a_tool_no_surface_is_cut() -> None:
    cone = b"T0 M6\nG51 X0. Y15. Z0. I0. J0. K0. H10. R5. D90. F400.\n"
    with pytest.raises(ProgramError, match="T0"):
        blocks.read(cone, mill(), "p.ngc")


def test_return_ends_the_sub_that_it_stands_in_whatever_its_label() -> None:
    text = "o1 sub\no2 if [#1 gt 0]\no2 return [7]\no2 endif\no1 endsub [4]\no1 call [{}]\nG0 X#<_value>\n"
    for argument, value in ((1, 7.0), (0, 4.0)):
        (move,) = blocks.read(text.format(argument).encode(), MACHINE, "p.ngc").blocks
        assert isinstance(move, JointLine) and move.targets[0] == value
    with pytest.raises(ProgramError, match="outside of every sub"):
        blocks.read(b"o2 return\nG0 X1\n", MACHINE, "p.ngc")


def test_5599_silences_debug_and_nothing_else() -> None:
    text = b"(debug, one)\n#5599=0\n(debug, two)\n(print, three)\n#5599=1\n(debug, four)\nG0 X1\n"
    made = blocks.read(text, MACHINE, "p.ngc").blocks
    assert [b.text for b in made if isinstance(b, OperatorMessage)] == ["one", "three", "four"]


def test_a_contour_that_is_wrong_at_the_end_of_the_file_is_refused_with_its_place() -> None:
    text = b"G21 F100 G0 X-20 Y0\nG41.1 D6 G1 X0\nX20\nY10\nX10\nY2\n"
    with pytest.raises(ProgramError) as error:
        blocks.read(text, MACHINE, "p.ngc")
    assert (error.value.line, "narrower than the cutter" in error.value.sentence) == (6, True)
    assert [one.line for one in refusals.of(text, MACHINE, "p.ngc")] == [6]


def test_each_line_knows_its_number() -> None:
    sub = b"o1 sub\nG0 X#<_line> Y#100 Z EXISTS[#<_line>]\no1 endsub\no1 call\n"
    text = b"(debug, #<_line>)\n#100=#<_line>\n" + sub
    said, move = blocks.read(text, MACHINE, "p.ngc").blocks
    assert isinstance(said, OperatorMessage) and said.text == "1.000000"
    assert isinstance(move, JointLine) and move.targets[:3] == (4.0, 2.0, 1.0)


def test_a_number_that_no_parameter_has_does_not_exist() -> None:
    (move,) = blocks.read(
        b"#1=7.5 #2=2\nG0 X EXISTS[#99999] Y EXISTS[##1] Z EXISTS[##2]\n", MACHINE, "p"
    ).blocks
    assert isinstance(move, JointLine) and move.targets[:3] == (0.0, 0.0, 1.0)
    with pytest.raises(ProgramError, match="#99999 is no parameter"):
        blocks.read(b"G0 X#99999\n", MACHINE, "p.ngc")


def test_a_whole_circle_leads_out_no_better_than_another_arc() -> None:
    with pytest.raises(ProgramError, match="first move after G40 is an arc") as error:
        blocks.read(b"G0 X0 Y0 Z0\nG41.1 D.25\nG1 X1 F1\nG1 X2\nG40\nG2 I1\n", MACHINE, "p.ngc")
    assert error.value.line == 6


@pytest.mark.parametrize(
    "text", ["#<_ini[vars]x>=3\nG0 X1\n", "G0 X#<_ini[vars]x>\n", "G0 X#<_hal[a.b-c]>\n"]
)
def test_a_value_of_an_ini_file_or_a_pin_is_refused_as_such(text: str) -> None:
    with pytest.raises(ProgramError, match="INI file or HAL"):
        blocks.read(text.encode(), MACHINE, "p.ngc")


def test_what_the_machine_file_says_of_them_counts() -> None:
    on = replace(MACHINE, named_values=(("_ini[sensor]x", 12.5), ("_hal[probe.latch-mm]", 2.0)))
    move = b"G0 X#<_ini[SENSOR]X> Y[-#<_hal[probe.latch-mm]>*2]"
    text = b"o1 if [#<_hal[ probe.latch-mm ]> EQ 2]\n" + move + b"\no1 endif\n"
    (made,) = blocks.read(text, on, "p.ngc").blocks
    assert isinstance(made, JointLine) and made.targets[:2] == (12.5, -4.0)
    with pytest.raises(ProgramError, match="INI file or HAL"):
        blocks.read(b"#<_ini[sensor]x>=1\nG0 X1\n", on, "p.ngc")


IO = Io(
    "can0",
    9,
    "",
    (("there", 0), ("low", 1)),
    (),
    digital_in=("there", "low", "other"),
    read_on=("there",),
    read_off=("low",),
)


@pytest.mark.parametrize(
    ("wait", "answer"),
    [
        ("P0 L1 Q2", 1),
        ("P2 L2 Q2", 0),
        ("P2 L3 Q2", 1),
        ("P1 L4 Q2", 0),
        ("P0 L0", 1),
        ("P1 L0", 0),
        ("P0", 1),
    ],
)
def test_behind_a_wait_its_answer_is_what_was_waited_for(wait: str, answer: int) -> None:
    text = f"M66 {wait}\no1 if [#5399 LT 0]\n(ABORT, nothing came)\no1 endif\nG0 X#5399\n"
    first, move = blocks.read(text.encode(), replace(MACHINE, io=IO), "p.ngc").blocks
    assert isinstance(first, Await) and isinstance(move, JointLine) and move.targets[0] == answer


@pytest.mark.parametrize("text", ["G0 X#5399", "M66 P2 L0\nG0 X#5399", "M66 P2 L3 Q1\nM66 P2 L0\nG0 X#5399"])
def test_an_answer_that_only_the_run_tells_is_refused(text: str) -> None:
    with pytest.raises(ProgramError, match="when the program runs"):
        blocks.read(text.encode(), replace(MACHINE, io=IO), "p.ngc")
