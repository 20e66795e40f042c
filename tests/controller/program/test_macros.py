"""Loops, jumps and conditions as Fanuc's custom macros have them, and parameters that nobody has set."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.oracles import reference_interpreter

from controller.program import blocks
from controller.program.program import JointLine, OperatorMessage, ProgramError, Remark


def ends(text: str, dialect: str = "fanuc", block_delete: bool = False) -> list[float]:
    """X at the end of each line of a program."""
    on = replace(reference_interpreter.machine(dialect, without_point="unit"), program_passes=50)
    read = blocks.read(text.encode(), on, "p.nc", block_delete).blocks
    return [
        block.targets[0] for block in read if isinstance(block, JointLine) and block.targets[0] is not None
    ]


@pytest.mark.parametrize(
    ("text", "x"),
    [
        ("#1=1\nWHILE [#1 LE 3] DO1\nG0 X#1\n#1=#1+1\nEND1\nX9.", [1, 2, 3, 9]),
        ("#1=0\nN10 WHILE[#1LT2]DO2 (TWICE)\nX#1\n#1=[#1+1]\nEND2 (END)", [0, 1]),
        ("#1=5\nWHILE [#1 LT 5] DO1\nX1.\nEND1\nX2.", [2]),
        (
            "#1=0\nWHILE [#1 LT 2] DO1\n#2=0\nWHILE [#2 LT 2] DO2\nX[#1*10+#2]\n#2=#2+1\nEND2\n"
            "#1=#1+1\nEND1\nWHILE [#1 LT 3] DO1\nX#1\n#1=#1+1\nEND1",
            [0, 1, 10, 11, 2],
        ),
        ("#1=0\nDO1\n#1=#1+1\nIF [#1 GT 2] GOTO 20\nX#1\nEND1\nN20 X7.", [1, 2, 7]),
        ("X1.\nGOTO 5\nX2.\nN0005 X3.", [1, 3]),
        ("N1 #1=4 #2=[2+3] GOTO #2 (SET, GO)\nX9.\nN4 X8.\nN5 X#1\n#1=6GO#1\nX9.\nN6 X#1", [4, 6]),
        ("#1=0\nN10 X#1\n#1=#1+1\nIF [#1 LT 3] GOTO 10\nX9.", [0, 1, 2, 9]),
        ("#1=5\nGOTO #1\nX1.\nN5 GOTO [#1+1]\nX2.\nN6 X3.", [3]),
        ("N5 X1.\nGOTO 6\nN6 X2.\nGOTO 7\nN5 X3.\nN7", [1, 2]),
        ("#1=4\nIF [#1 EQ 4] THEN #2=8\nIF [#1 EQ 5] THEN #2=9\nX#2", [8]),
        ("#1=4\nN30 IF [[#1 GT 3] AND [#1 LT 5]] THEN X6.", [6]),
        ("G0 X1.\nM98 P7\nN10 X2.\nM30\nO7\nGOTO 10\nX3.\nN10 X4.\nM99", [1, 4, 2]),
        ("#500=#500+1\nX#500\nX[#1*2+3]\nIF [#2 LT 1] GOTO 9\nX8.\nN9 X[#3-1] Y[ABS[#4]]", [1, 3, -1]),
        ("(GOTO 10)\nX1.\nN10 X2.", [1, 2]),
        ("#1=1\nWH[#1LE3]DO1\nX#1\n#1=#1+1\nEN1\nX9.", [1, 2, 3, 9]),
        ("#1=0\nWH [[#1 GE 0] AN [#1 LT 2]] DO2\nX[#1+SI[90]+CO[90]]\n#1=#1+1\nEND2", [1, 2]),
        ("GO5\nX2.\nN5 X3.\n#1=4\nIF[#1EQ4]GO 7\nX1.\nN7 IF[#1EQ4]TH#1=8\nX#1", [3, 8]),
        ("X[SQ[4]+AB[-1]+AS[1]+AC[1]+AT[1]/[1]+RO[0.6]+FI[1.9]+FU[1.1]+TA[45]+EX[0]+[3XO1]]", [145.6]),
        ("IF [#1 EQ 0] GOTO 10\nX1.\nN10 X2.\nIF [0 NE #1] THEN X3.\nIF [#1 EQ #2] THEN X4.", [1, 2, 3, 4]),
        (
            "IF [#1NE#2] THEN X1.\nIF [#1GE0] THEN X2.\nIF [#1 GT 0] THEN X3.\nIF [[#1+0] EQ 0] THEN X4.",
            [2, 4],
        ),
        ("#100=5\n#100=#0\nIF [#100 EQ #0] THEN X1.\n#1=7\n#1=#100\nIF [#1 NE #0] THEN X2.\nX[#1+3]", [1, 3]),
        ("GOTO 1\r\nX5.\r\nN1 X6.\r\nM30\r\n", [6]),
    ],
)
def test_statements_of_macros_are_carried_out(text: str, x: list[float]) -> None:
    assert ends(f"G21 G90 G0\n{text}") == pytest.approx(x)


def test_the_number_of_the_program_is_no_end_of_it() -> None:
    assert ends("%\nO1234 (PART)\nG21 G90 G0\n#1=1\nIF [#1 EQ 1] GOTO 10\nX1.\nN10 X2.\nM30\n%\n") == [2.0]


def test_a_jump_that_block_delete_leaves_out_is_none() -> None:
    text = "G21 G90 G0\n/GOTO 10\nX1.\nN10 X2."
    assert (ends(text), ends(text, block_delete=True)) == ([2.0], [1.0, 2.0])


@pytest.mark.parametrize(
    ("text", "place", "why"),
    [
        ("GO X1.", "2:1", "is it a zero?"),
        ("#1=1\n  GOTO 30\nN3 X1.", "3:3", "GOTO 30 leads to N30"),
        ("#1=1.5\nGOTO #1\nN1 X1.", "3:1", "leads to N1.5"),
        ("#1=1\nIF [#1 EQ 1] GOTO 30\nX1.", "3:1", "leads to N30"),
        ("#1=1\nWHILE [#1 EQ 1] DO1\nX1.", "3:1", "END1"),
        ("X1.\nEND1", "3:1", "END1"),
        ("#1=0\nWHILE [#1 LT 2] DO1\nDO2\nEND1\nEND2", "5:1", "END1"),
        ("N1 X1.\nGOTO 1", "3:1", "50"),
        ("X#1", "2:1", "#1 has no value yet"),
        ("X[#1]", "2:1", "#1 has no value yet"),
        ("#0=1", "2:1", "#0"),
        ("#2=1\n#2=#1\nX#2", "4:1", "#2 has no value yet"),
        ("M98 P7\nM30\nO7\nGOTO 10\nM99\nO8\nN10 X1.\nM99", "5:1", "leads to N10"),
    ],
)
def test_what_leads_nowhere_is_refused_with_its_place(text: str, place: str, why: str) -> None:
    with pytest.raises(ProgramError) as caught:
        ends(f"G21 G90 G0\n{text}")
    assert str(caught.value).startswith(f"p.nc:{place}: ") and why in caught.value.sentence


def test_what_outlives_the_program_keeps_a_number() -> None:
    on = replace(reference_interpreter.machine("fanuc", without_point="unit"), kept=((500, 999),))
    with pytest.raises(ProgramError, match="#1 has no value yet"):
        blocks.read(b"#500=1\n#500=#1\nM30\n", on, "p.nc")


def test_under_rs274_they_are_another_controls_and_a_number_is_0_until_it_is_set() -> None:
    assert ends("G0 X#1", "rs274") == [0.0]
    with pytest.raises(ProgramError, match="write o100 if"):
        ends("G0 X1.\nIF [#1 GT 5] GOTO 10\nN10 X2.", "rs274")


@pytest.mark.parametrize(
    ("written", "x"),
    [
        ("POW[2,3]", 8.0),
        ("POW[#1,0.5]", 2.0),
        ("ATAN[1,-1]", 135.0),
        ("ATAN[1]/[-1]", 135.0),
        ("[POW[2,2]+1]", 5.0),
    ],
)
def test_functions_of_two_values(written: str, x: float) -> None:
    assert ends(f"G21 G90 G0\n#1=4\nX[{written}]") == pytest.approx([x])


@pytest.mark.parametrize("written", ["POW[2]", "POW[0,-1]", "POW[2,3,4]"])
def test_a_power_of_one_value_is_refused(written: str) -> None:
    with pytest.raises(ProgramError):
        ends(f"G21 G90 G0\nX[{written}]")


def test_percent_and_the_end_of_its_line_begin_and_end_a_text() -> None:
    assert ends("%;\nO1(A);\nG21 G90 G0;\nM98 P7;\nX1.;\nM30;\nO7;\nX2.;\nM99;\n%;\nX3.\n") == [2, 1]
    assert ends("%;\nG21 G90 G0;\nX1.;\n% ;\nX3.\n") == [1]
    with pytest.raises(ProgramError, match="stands alone"):
        ends("% X1.\nX3.\n")


def test_what_dprnt_writes_is_shown_to_the_operator() -> None:
    text = "#1=2.5\nPOPEN\nN5 DPRNT[X#1[44]*#100[30]/A-1] (OUT)\nSETVN#500[HOLE]\nDPRNT[ ]\nG0 X#1\nPCLOS\n"
    on = reference_interpreter.machine("fanuc", without_point="unit")
    made = blocks.read(text.encode(), on, "p.nc").blocks
    assert [one.text for one in made if isinstance(one, OperatorMessage)] == ["X2.5000 0/A-1"]
    assert ["POPEN does nothing" in one.sentence for one in made if isinstance(one, Remark)] == [True]
    assert [one.targets[0] for one in made if isinstance(one, JointLine)] == [2.5]
    with pytest.raises(ProgramError):
        blocks.read(text.encode(), reference_interpreter.machine(), "p.nc")


@pytest.mark.parametrize(
    ("text", "column"), [("WHILE [#1 LT 2] DO1 #1=#1+1\nEND1", 20), ("N1 DO2 X1.\nEND2", 7)]
)
def test_what_follows_do_on_its_line_is_refused_there(text: str, column: int) -> None:
    with pytest.raises(ProgramError, match=r"DO\d ends its line") as refused:
        ends(text)
    assert (refused.value.line, refused.value.column) == (1, column)
