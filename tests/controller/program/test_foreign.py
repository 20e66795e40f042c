"""Programs for Siemens and Heidenhain are known as such, by any of their lines; ours never are."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.oracles import reference_interpreter

from controller.machine.model import Machine
from controller.program import blocks, foreign, refusals
from controller.program.program import ProgramError

SIEMENS_HEAD = ";$PATH=/_N_WKS_DIR/_N_BLADE_WPD\nN10 G17 G71 G90 G94\n"
SIEMENS = {
    "path": (SIEMENS_HEAD + "N20 T1 D1 M6\n", 1),
    "archive": ("%_N_BLADE_MPF\nN10 G0 X1\n", 1),
    "message": ('N10 G17 G90 G54\nN20 MSG("ROUGHING (1)")\nN30 G0 X1\n', 2),
    "tool by name": ('N10 G90 G54\nN20 T="MILL 6"\nN30 M6\n', 2),
    "radius": ("N10 G17 G90 G54 G64\nN20 T1 D1\nN30 G0 X10 Y10\nN40 G2 X20 Y0 CR=10\n", 4),
    "swivel": ('G54\nCYCLE800(1,"TC1",200000,57,0,0,0,0,30,0,0,0,0,-1,100,1)\nG0 X1\n', 2),
    "high speed": ("G0 X1\nCYCLE832(0.02,_ORI_FINISH,0.5)\n", 2),
    "orientation": ("G0 G90 G54 X0 Y0\nN20 TRAORI\nN30 G1 X1 Y1 Z1 A3=0 B3=0.5 C3=0.8 F500\n", 2),
    "vectors": ("G1 X1 Y1 Z1 A3=0 B3=0.5 C3=0.8 F500\n", 1),
    "parameter": ("R1=5\nG0 X=R1\n", 1),
    "increment": ("N5 G0 X0 Y0\nN6 G1 X=IC(5) F100\n", 2),
    "no datum": ("N10 G500 G0 Z100\nN20 G0 X1 G642\n", 1),
    "machine position": ("N10 G0 SUPA Z0 D0\n", 1),
    "blend": ("N10 G642 ADIS=0.02\n", 1),
    "shift": ("G54\nTRANS X10 Y5\nAROT Z30\nG0 X0\n", 2),
    "drilling": ("N10 G0 X1 Y1\nN20 MCALL CYCLE83(10,0,2,-20,,3)\n", 2),
    "jump": ("ANF: G0 X1\nGOTOB ANF\n", 2),
    "declaration": ("DEF REAL DEPTH\nDEPTH=5\n", 1),
    "spindle": ("S1=3000 M1=3\n", 1),
    "older": ("%MPF  90\n( HEAD )\nL100 (OFFSETS)\nN40 G0 X-54. Y120.\n", 1),
    "modal call": (
        "N10 G0 X1 Y1\nN20 MCALL CYCLE81(DEPTH+20,DEPTH,2,,12.5)\nN30 HOLES2(0,92.07,53.9,45,90,4)\n",
        2,
    ),
}
HEIDENHAIN = {
    "head": ("0  BEGIN PGM PLATE MM\n1  BLK FORM 0.1 Z X+0 Y+0 Z-20\n", 1),
    "no head": ("L X+10 Y+5 R0 FMAX M3\nL Z-5 F500\n", 1),
    "numbers alone": ("12 L  Z+100 R0 FMAX\n", 1),
    "tool": ("TOOL CALL 5 Z S5000\nL X+1 F100\n", 1),
    "cycle": ("1 CYCL DEF 200 DRILLING ~\n  Q200=+2 ;SET-UP CLEARANCE ~\n", 1),
    "arc": ("CC X+5 Y+5\nC X+10 Y+5 DR-\n", 1),
    "polar": ("LP PR+10 PA+45 F200\n", 1),
    "plane": ("PLANE SPATIAL SPA+0 SPB+30 SPC+0 TURN FMAX\n", 1),
    "function": ("FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS\n", 1),
    "label": ("LBL 1\nCALL LBL 1 REP 3\n", 1),
    "q": ("5 Q1 = +12.5\n", 1),
    "fn": ("FN 0: Q5 = +3\n", 1),
    "approach": ("APPR LCT X+10 Y+20 R5 RL F100\n", 1),
    "iso": ("%PLATE G71 *\nN10 G30 G17 X+0 Y+0 Z-20*\n", 1),
    "iso without head": ("N10 T1 G17 S5000*\nN20 G00 G40 G90 Z+250*\n", 1),
}
OURS = (
    "G0 X1 (CR=0.5 R1=3 T=1 CYCLE800(\nG99.9\n",
    "G21 ; CYCLE832(0.01) SUPA\nM97 ; L X+10\n",
    "(BEGIN PGM A MM)\n(TOOL CALL 5 Z)\n/L X+10 R0 FMAX\nG99.9\n",
    "#<r1>=5\n#<supa> = 7\n#<x>=1\no<trans> call\nG99.9 X#<x>\n",
    "o100 sub\no101 repeat [2]\nG1 X1 F100\no101 endrepeat\no100 endsub\no100 call\nG99.9\n",
    "IF[#1EQ2]GOTO10\nG99.9\n",
    "VC1=5\nX=VC1+5\n",
    "G15 H=VC32\nG0 X=XPOS Y=YPOS\nIF [VC1 EQ 20] NDTM8\nGOTO NDTM\n",
    "T1 M6\nG65 P9810 Z5. F100\nG05.1 Q1\n",
    # One thing that Siemens' programs have makes none of them.
    "G0 X1.\nG500\nX2.\n",
    "G0 X1.\nG1 X=5. F100.\nX=6.\n",
    "G0 X1.\nSCALE X2.\n",
    "R1=5\nG99.9\n",
    "G0 X1.\nRET\n",
)


def machine(dialect: str) -> Machine:
    return reference_interpreter.machine(dialect, without_point="unit")


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
@pytest.mark.parametrize("control", ["Siemens", "Heidenhain"])
def test_a_program_of_another_control_is_one_refusal_with_the_post_to_take(
    control: str, dialect: str
) -> None:
    for what, (text, line) in {"Siemens": SIEMENS, "Heidenhain": HEIDENHAIN}[control].items():
        found = refusals.of(f"{text}M30\n".encode(), machine(dialect), "p")
        assert [(one.about, one.line) for one in found] == [(control, line)], (what, found)
        assert control in found[0].sentence and 'dialect = "fanuc"' in found[0].sentence
        with pytest.raises(ProgramError) as error:
            blocks.read(f"{text}M30\n".encode(), machine(dialect), "p")
        assert error.value.about == control, what


@pytest.mark.parametrize("text", OURS)
def test_ours_is_refused_for_what_is_wrong_with_it(text: str) -> None:
    for dialect in ("rs274", "fanuc"):
        found = refusals.of(text.encode(), machine(dialect), "p")
        assert found and not {one.about for one in found} & {"Siemens", "Heidenhain"}, found


def test_a_program_that_reads_well_is_never_asked_about(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foreign, "program", None)
    for post in (Path(__file__).parents[2] / "programs/posts").glob("*.nc"):
        assert refusals.of(post.read_bytes(), machine("fanuc"), "p") == [], post.name


@pytest.mark.parametrize(
    ("line", "column", "instead"),
    [
        ("N10 IF [#1 GT 5] GOTO 100", 5, "write o100 if"),
        ("WHILE[#1LT5]DO1", 1, "write o100 if"),
        ("GOTO 100", 1, "write o100 if"),
        ("N40 IF [ #5405 GE 6000 ] THEN #3000= 15 (TOOL LIFE)", 5, "write o100 if"),
        ("GOTO NDTM", 1, "write o100 if"),
        ("END1", 1, "write o100 if"),
        ("BPRNT[X#100[53]]", 1, "(PRINT, ...)"),
        ("CALL O100", 1, "write M98"),
        ("N5 VC1=VC1+1", 4, "write a parameter"),
        ("VZOFZ[1]=100", 1, "write a parameter"),
        ("RTS", 1, "write M99"),
    ],
)
def test_a_line_of_a_control_that_is_read_else_says_what_to_write(
    line: str, column: int, instead: str
) -> None:
    dialect = "rs274" if "o100" in instead else "fanuc"
    (found,) = refusals.of(f"G0 X1.\n{line}\nX2.\n".encode(), machine(dialect), "p")
    assert (found.line, found.column) == (2, column) and instead in found.sentence


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("$PART-1.MIN%\nG0 X1.\n", "head of a program for Okuma"),
        ("G1 X5,5 F100.\n", "cannot stand here"),
    ],
)
def test_what_other_controls_write_on_lines_is_named(text: str, why: str) -> None:
    found = refusals.of(text.encode(), reference_interpreter.machine("fanuc", without_point="unit"), "p")
    assert why in found[0].sentence
