"""What sample programs of LinuxCNC write, and what we once refused or fell over."""

from __future__ import annotations

import pytest
from support.machines.traced_programs import mill
from support.oracles import reference_interpreter

from controller.program import blocks, refusals
from controller.program.program import Act, Action, JointLine, OperatorMessage, ProgramError

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


@pytest.mark.parametrize("text", [b"#<_ini[vars]x>=3\nG0 X1\n", b"G0 X#<_ini[vars]x>\n"])
def test_a_value_of_an_ini_file_is_refused_as_such(text: bytes) -> None:
    with pytest.raises(ProgramError, match="INI file, and there is none"):
        blocks.read(text, MACHINE, "p.ngc")
