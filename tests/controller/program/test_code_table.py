"""The one table of codes: what it says is so, and what the README of the programs shows is made from it."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.traced_programs import mill

from controller.machine.model import AnalogueOut, Io, Orient
from controller.program import blocks, code_table
from controller.program.code_rows import Code, Fate
from controller.program.code_table import BY_DIALECT, ROWS
from controller.program.program import ProgramError, Remark

README = Path(__file__).parents[3] / "config/programs/README.md"
SAYS = {
    "G52": "X0",
    "G4": "P0",
    "G43.1": "Z1",
    "G43.2": "H1",
    "G53": "G0 X0",
    "G54.1": "P1",
    "G154": "P1",
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


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
def test_a_code_stands_once_in_a_dialect(dialect: str) -> None:
    names = Counter(row.name for row in ROWS if row.dialect in ("", dialect))
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.name}-{row.dialect or 'both'}")
def test_what_the_table_says_of_a_code_comes_of_it(row: Code) -> None:
    dialect = row.dialect or "rs274"
    on = replace(
        mill(unset=()), dialect=dialect, offsets=mill().offsets + mill().offsets[:4], without_point="unit"
    )
    on = replace(on, io=IO)
    line = f"{row.name} {SAYS.get(row.name, row.only)}\nG0 X1.\n"
    if row.fate is Fate.REFUSED:
        with pytest.raises(ProgramError) as refused:
            blocks.read(line.encode(), on, "p.ngc")
        assert refused.value.sentence == f"{row.name} ({row.meaning}) is not done here: {row.told}"
        assert refused.value.line == 1
        return
    moves = row.group == "motion" and row.name not in ("G0", "G1", "G80", "G52")
    if moves or row.name in ("M72", "M98", "M99", "G68.4", "G53.1", "G53.3", "G53.6"):
        with pytest.raises(ProgramError):  # it is known, and has nothing to work on here
            blocks.read(f"{row.name} X1. B1.\n".encode(), on, "p.ngc")
        return
    made = blocks.read(line.encode(), on, "p.ngc").blocks
    notes = [block.sentence for block in made if isinstance(block, Remark)]
    if row.fate is Fate.NOTED:
        assert notes == [f"{row.name} ({row.meaning}) needs no action here. {row.told}"]
        assert len(blocks.read((line * 3).encode(), on, "p.ngc").blocks) == 4  # told once


def test_the_readme_has_the_table() -> None:
    text = README.read_text(encoding="utf-8")
    begin, end = (text.index(mark) for mark in ("<!-- codes -->\n", "<!-- end of codes -->"))
    assert text[begin:end].split("\n", 1)[1] == code_table.markdown()


def test_every_row_has_words_for_people() -> None:
    for row in ROWS:
        assert row.meaning and (row.told or row.fate is Fate.DONE), row.name
        assert re.fullmatch(r"[GM]\d+(\.\d)?", row.name)
        assert row.dialect in ("", *BY_DIALECT)


TESTS = Path(__file__).parents[1]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.name}-{row.dialect or 'both'}")
def test_the_file_of_tests_that_the_table_names_is_there_and_tries_the_code(row: Code) -> None:
    letter, number = row.name[0], re.escape(row.name[1:])
    said = re.compile(
        rf"(?:(?<![A-Za-z0-9.])|(?<=\\n))[{letter}{letter.lower()}]0?{number}(?![0-9]|[.][0-9])"
    )
    assert said.search((TESTS / code_table.test_of(row)).read_text(encoding="utf-8"))


def test_no_code_is_named_for_a_test_that_the_table_does_not_have() -> None:
    assert set(code_table.TEST_OF) <= {row.name for row in ROWS}
