"""The number that a serial line puts before a program: a name, not a word."""

from __future__ import annotations

import random

import pytest
from support.suite.cases import each

from controller.program import words
from controller.program.program import ProgramError
from controller.program.source_text import text_of


def lines(text: str) -> list[int]:
    return [line.number for line in words.read(text_of(text.encode(), "p.ngc")[0], "p.ngc")]


@pytest.mark.parametrize("number", ["O1234", "o 12", ":0777", "O1234 (PART)", "(PART) :5 ; red"])
@pytest.mark.parametrize("frame", ["%\n", ""])
def test_a_number_before_the_first_block_is_skipped(frame: str, number: str) -> None:
    assert lines(f"{frame}\n{number}\nG0 X1\nM2\n{frame}") == [len(frame) // 2 + 3, len(frame) // 2 + 4]


@pytest.mark.parametrize(
    "text", ["G0 X1\nO5\n", "O5\nO6\nM2\n", "O5 G0\n", "O5.5\nM2\n", "O\nM2\n", "O123456789\n"]
)
def test_a_number_elsewhere_or_with_words_is_refused(text: str) -> None:
    with pytest.raises(ProgramError):
        lines(text)


def test_a_number_alone_is_no_program() -> None:
    with pytest.raises(ProgramError, match="needs at least one word"):
        lines("%\nO1234\n%\n")


@each("seed", range(200))
def test_words_of_plain_numbers_are_read_as_any_other(seed: int) -> None:
    """The short way of a line against the long one, which a comment behind it asks for."""
    rng = random.Random(seed)
    numbers = (
        "0",
        "1",
        "007",
        "-3",
        "+2.50",
        ".5",
        "-.25",
        "12.",
        "1e3",
        "999999999",
        "1000000001",
        "3.14159",
    )
    line = "".join(
        f"{rng.choice('GMXYZABCFSTPHDRIJKLEUVWxyzgmn')}{rng.choice(('', '', ' '))}{rng.choice(numbers)}"
        f"{rng.choice(('', ' ', '  '))}"
        for _ in range(rng.randrange(1, 6))
    )
    line = rng.choice(("", "N10 ", " n7", "/")) + line

    def read(text: str) -> object:
        try:
            return [found.words for found in words.read(text_of(text.encode(), "p")[0], "p")]
        except ProgramError as error:
            return str(error)

    assert read(line) == read(f"{line}()"), line
