"""Codes of other controls: what they are is told with what to write instead, never by their number."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.traced_programs import mill

from controller.messages import LANGUAGES
from controller.program import blocks, foreign
from controller.program.code_table import BY_DIALECT
from controller.program.program import ProgramError


def refusal(code: str, dialect: str) -> ProgramError:
    on = replace(mill(unset=()), dialect=dialect, without_point="unit")
    with pytest.raises(ProgramError) as refused:
        blocks.read(f"G0 X5.\n{code}\n".encode(), on, "p.ngc")
    return refused.value


def test_what_a_code_is_is_told_with_who_has_it() -> None:
    said = refusal("M21", "fanuc").sentence
    assert "a relay of the user's that waits for its answer (Haas)" in said
    assert "a mirror image (Makino)" in said and "m_codes of [io]" in said and "G51.1" in said
    assert "M29" not in said and "M61" not in said


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("M428", "G43.4"),
        ("M128", "Heidenhain"),
        ("M130", "G43.4"),
        ("M80", "the door (Haas)"),
        ("M109", "a question to the operator (Haas)"),
        ("G36", "G31 or G38.2"),
        ("G38.6", "by distances in mm (FluidNC)"),
        ("G100", "the end of a mirror image (Haas), or a tool change with moves (Brother)"),
        ("G101", "a mirror image (Haas)"),
        ("G10.6", "leave it out"),
        ("M150", "own_codes of [machine]"),
    ],
)
def test_advice_is_of_the_purpose(code: str, says: str) -> None:
    assert says in refusal(code, "rs274").sentence


def test_every_row_has_its_texts_in_every_language_and_no_row_is_of_a_code_that_is_done_in_both() -> None:
    for code, uses in foreign.USES.items():
        assert not all(code in table for table in BY_DIALECT.values()), code
        for use in uses:
            for language in LANGUAGES.values():
                assert f"foreign_use.{use.purpose}" in language.texts
                assert f"foreign_advice.{use.advice}" in language.texts


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
def test_no_row_is_told_of_a_code_that_the_dialect_has(dialect: str) -> None:
    for code in foreign.USES:
        if code not in BY_DIALECT[dialect]:
            key = refusal(code, dialect).said["key"]
            assert key in ("code.foreign", "code.other_dialect", "code.not_done")
