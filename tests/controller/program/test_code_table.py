"""The one table of codes: what it says is so, and what the README of the programs shows is made from it."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.traced_programs import mill
from support.oracles import reference_interpreter
from support.suite.cases import each

from controller.machine.model import AnalogueOut, Io, Machine, Orient
from controller.program import blocks
from controller.program.code_rows import Code, Fate
from controller.program.code_table import BY_DIALECT, ROWS
from controller.program.program import JointLine, ProgramError, Remark

README = Path(__file__).parents[3] / "config/programs/README.md"
SAYS = {
    "G52": "X0",
    "G4": "P0",
    "G43.1": "Z1",
    "G43.2": "H1",
    "G53": "G0 X0",
    "G54.1": "P1",
    "G154": "P1",
    "G54.2": "P0",
    "G51.1": "X0",
    "G68": "R1",
}
SAYS |= {
    "M62": "P0",
    "M63": "P0",
    "M64": "P0",
    "M65": "P0",
    "M66": "P0 L3 Q1",
    "M67": "E0 Q1",
    "M68": "E0 Q1",
}
IO = Io(
    "can0",
    9,
    "",
    (("there", 0), ("feed_stop", 1)),
    (("air", 0),),
    digital_in=("there",),
    digital_out=("air",),
    analogue_out=(AnalogueOut("laser", 1, 0.0, 100.0, 0, 32767),),
    orient=Orient("orient", "oriented", 0.0, 5.0),
)
SAYS |= {"M52": "P0"}
SAYS |= {"G41.1": "D6", "G42.1": "D6"}
SAYS |= {"M6": "T1", "M61": "Q1", "G10": "L2 P1 X0", "G92": "X0", "G95": "", "M3": "S0", "M4": "S0"}


NEEDS_MORE = (
    *("G12", "G13", "M72", "M97", "M98", "M198", "M99", "G65", "G66", "G68.4", "G53.1", "G53.3", "G53.6"),
)  # lines before, or subs


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
def test_a_code_stands_once_in_a_dialect(dialect: str) -> None:
    names = Counter(row.name for row in ROWS if row.dialect in ("", dialect))
    assert [name for name, count in names.items() if count > 1] == []


@each("row", ROWS)
def test_what_the_table_says_of_a_code_comes_of_it(row: Code) -> None:
    dialect = row.dialect or "rs274"
    on = replace(mill(unset=()), dialect=dialect, offsets=mill().offsets * 6, without_point="unit")
    on = replace(on, io=IO)
    line = f"{row.name} {SAYS.get(row.name, row.only)}\nG0 X1.\n"
    if row.fate is Fate.REFUSED:
        with pytest.raises(ProgramError) as refused:
            blocks.read(line.encode(), on, "p.ngc")
        assert refused.value.sentence == f"{row.name} ({row.meaning}) is not done here: {row.told}"
        assert refused.value.line == 1
        return
    moves = row.group == "motion" and row.name not in ("G0", "G1", "G80", "G52")
    if moves or row.name in NEEDS_MORE:
        with pytest.raises(ProgramError):  # it is known, and has nothing to work on here
            blocks.read(f"{row.name} X1. B1.\n".encode(), on, "p.ngc")
        return
    made = blocks.read(line.encode(), on, "p.ngc").blocks
    notes = [block.sentence for block in made if isinstance(block, Remark)]
    if row.fate is Fate.NOTED:
        assert notes == [f"{row.name} ({row.meaning}) needs no action here. {row.told}"]
        assert len(blocks.read((line * 3).encode(), on, "p.ngc").blocks) == 4  # told once


# Where a code is tried; those that are not named here, in ``test_each_code`` and ``test_code_table``.
_EACH, _NOT_DONE = "program/test_each_code.py", "program/test_code_table.py"
_TESTS = {
    "program/test_plain.py": "G0 G1 G2 G3 G4 G17 G20 G21 G93 G94 M3 M8",
    "program/test_plane_words.py": "G18 G53 G68.2 G68.3 G53.1 G53.3 G53.6",
    "program/test_tilted_planes.py": "G68.4 G69",
    "program/test_cycles.py": "G73 G74 G81 G82 G83 G84 G85 G86 G89 G98 G99 G19 M4 M5",
    "program/test_boring.py": "G76 G87",
    "program/test_threads.py": "G33 G33.1 M29",
    "program/test_blocks.py": "G51 G61 G64 M6 M30",
    "program/test_shifts.py": "G52",
    "program/test_nurbs.py": "G6.2",
    "program/test_spline_words.py": "G5 G5.1 G5.2 G5.3",
    "program/test_offset_words.py": "G10 G28 G28.1 G30 G43 G43.1 G43.2 G44 G54.1 G68 G91 G92 M61",
    "program/test_compensation.py": "G40 G41 G42 G41.1 G42.1 G43.4 G54 G55 G90",
    "program/test_pocket_words.py": "G12 G13",
    "program/test_lenient_words.py": " ".join(["G60", *(f"G{110 + i}" for i in range(20))]),
    "program/test_mirror_and_polar.py": "G51.1 G50.1 G15 G16",
    "program/test_dynamic_offset.py": "G254 G255 G54.2",
    "program/test_posts.py": "G80 G154 G234",
    "program/test_parameters.py": "G90.1 G95 M70 M72 M73",
    "program/test_modal.py": "M48 M49 M50 M51 M52 M53",
    "program/test_line_words.py": "G38.2 G38.3 G38.4 G38.5 G31",
    "program/test_flow.py": "M98 M99",
    "program/test_own_codes.py": "M97 M198",
    "program/test_macro_calls.py": "G65 G66 G67",
    "tick/test_outputs.py": "M10 M11 M62 M63 M64 M65 M66",
    "tick/test_analogue_outputs.py": "M19 M67 M68",
    "machine/test_changes.py": "G30.1 G92.3",
}
TEST_OF = {name: file for file, names in _TESTS.items() for name in names.split()}


def _test_of(row: Code) -> str:
    """The file of tests, in tests/controller, that shows what comes of a code."""
    return TEST_OF.get(row.name, _NOT_DONE if row.fate is not Fate.DONE else _EACH)


def _markdown_table() -> str:
    """The table as the README of the programs shows it."""
    head = ["| code | dialect | from | what it is | here | test |", "|---|---|---|---|---|---|"]
    return "\n".join([*head, *(_markdown(row) for row in sorted(ROWS, key=_order)), ""])


def _order(row: Code) -> tuple[str, float, str]:
    return row.name[0], float(row.name[1:]), row.dialect


def _markdown(row: Code) -> str:
    here = {Fate.DONE: "", Fate.NOTED: "noted: ", Fate.REFUSED: "refused: "}[row.fate] + (row.told or "done")
    if row.only:
        here = f"with {row.only} {here} Else refused: {row.instead}"
    told = (row.name, row.dialect or "both", row.source, row.meaning, here, f"`{_test_of(row)}`")
    return f"| {' | '.join(told)} |"


def test_the_readme_has_the_table() -> None:
    text = README.read_text(encoding="utf-8")
    begin, end = (text.index(mark) for mark in ("<!-- codes -->\n", "<!-- end of codes -->"))
    assert text[begin:end].split("\n", 1)[1] == _markdown_table()


def test_every_row_has_words_for_people() -> None:
    for row in ROWS:
        assert row.meaning and (row.told or row.fate is Fate.DONE), row.name
        assert re.fullmatch(r"[GM]\d+(\.\d)?", row.name)
        assert row.dialect in ("", *BY_DIALECT)


TESTS = Path(__file__).parents[1]


@each("row", ROWS)
def test_the_file_of_tests_that_the_table_names_is_there_and_tries_the_code(row: Code) -> None:
    letter, number = row.name[0], re.escape(row.name[1:])
    said = re.compile(
        rf"(?:(?<![A-Za-z0-9.])|(?<=\\n))[{letter}{letter.lower()}]0?{number}(?![0-9]|[.][0-9])"
    )
    assert said.search((TESTS / _test_of(row)).read_text(encoding="utf-8"))


def test_no_code_is_named_for_a_test_that_the_table_does_not_have() -> None:
    assert set(TEST_OF) <= {row.name for row in ROWS}


# Codes that are noted or refused, in lines as programs have them: the code is to blame, not its words.

NOTED = {
    "fanuc": re.split(
        "; ",
        "G5 P10000; G5.1 Q1 R5; G5.1 Q2 X0. Y0. Z0.; G5.3 P50; G8 P1; G9; G10.9 X0.; G11; G13.1; "
        "G23; G25; G50; G54.4 P0; G62; G187 P3 E0.01; G269; M12; M13; M31; M32; M33; M41; M42; "
        "M43; M84; M89; M138 P500 E300; M139; M298 L3",
    ),
    "rs274": re.split(
        "; ",
        "G103 P1; G187 P2; M51 P1; G15; G50; G67",
    ),
}
REFUSED = {
    "rs274": re.split(
        "; ",
        "G7; G8; G70 Q100 X1. Z1.; G71 Q100 X0. Z0. D1. R1. I0.2; G71.1 Q100 D1. R1.; "
        "G71.2 Q100 D1.; G72 Q100 X0. Z0. D1. R1. I0.2; G72.1 Q100 D1. R1.; G72.2 Q100 D1. R1.; "
        "G17.1; G18.1; G19.1; G44 H1; G88 X1. Z-1. R1. P1. F100.; G96 D2500 S250",
    ),
    "fanuc": re.split(
        "; ",
        "G5.2 P1 X0. Y1. L3; G7; G22 X1. Y1. Z1. I0. J0. K0.; G26; G27 X0. Y0.; G29 X1. Y1.; "
        "G12.1; G43.3 H1; G45 X1. D1; G46 X1. D1; G47 X1. D1; G48 X1. D1; G63; G107 C20.; "
        "G150 X0. Y0.; G253; G268 X0. Y0. Z0. I0. J30. K0.; M83; M88; G53.3 X1. Y1. Z1.",
    ),
}


def machine(dialect: str) -> Machine:
    return reference_interpreter.machine(dialect, without_point="unit")


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


@pytest.mark.parametrize(
    ("line", "only"),
    [("G54.4 P1", "P0"), ("G10.9 X1.", "X0")],
)
def test_what_is_noted_with_one_word_is_refused_with_others(line: str, only: str) -> None:
    row = BY_DIALECT["fanuc"][line.split()[0]]
    with pytest.raises(ProgramError) as error:
        blocks.read(f"G0 X5.\n{line}\n".encode(), machine("fanuc"), "p.ngc")
    assert row.only == only and row.instead in error.value.sentence


def test_words_of_a_noted_code_do_not_move_and_a_motion_beside_it_does() -> None:
    told = blocks.read(b"G0 X5.\nG05.1 Q2 X0. Y0. Z0.\nG5.1 Q1 G0 X7.\n", machine("fanuc"), "p.ngc").blocks
    assert [b.targets[0] for b in told if isinstance(b, JointLine)] == [5.0, 7.0]


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
@pytest.mark.parametrize("code", ["M222", "G8.1", "M888", "G142", "M47", "G29.5", "G43.7", "G1.1"])
def test_a_code_that_there_is_not_is_not_taken_for_one_that_looks_like_it(dialect: str, code: str) -> None:
    with pytest.raises(ProgramError) as error:
        blocks.read(f"G0 X5.\n{code}\n".encode(), machine(dialect), "p.ngc")
    done = [
        row.name for row in BY_DIALECT[dialect].values() if row.fate is Fate.DONE and row.name[0] == code[0]
    ]
    said = error.value.sentence
    assert said.startswith(f"{code} is not known here") and (error.value.line, error.value.column) == (2, 1)
    assert all(f" {name}" in said for name in done) and "use " not in said and "instead" not in said


def test_a_noted_code_beside_a_motion_leaves_its_words_to_count_as_ever() -> None:
    on = replace(machine("fanuc"), without_point="thousandth")
    for code in ("M31", "M10", "G9", "G187 P3 E1"):
        told = blocks.read(f"{code} G0 X5000\n".encode(), on, "p.ngc").blocks
        assert [b.targets[0] for b in told if isinstance(b, JointLine)] == [5.0]
