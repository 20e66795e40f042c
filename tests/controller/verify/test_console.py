"""Tables for people: on a narrow terminal nothing is cut, as it may be what another command needs."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console
from rich.table import Table

from controller.verify.console import Late
from controller.verify.tables import headed


def printed(table: Table, width: int) -> str:
    late, out = Late(), StringIO()
    late.__dict__["console"] = Console(file=out, width=width, highlight=False)
    late.print(table)
    return out.getvalue()


HEADS = (
    "face",
    "face_kind",
    "cut_as",
    "middle",
    "normal",
    "length",
    "ruling",
    "off_ruled",
    "hollow",
    "twist",
)
ROW = ("12345", "B-spline", "G6.2", "-123.4 123.4 55.6", "0.12 0.13 0.99", "123.45", "22.33", "12.345 µm")


@pytest.mark.parametrize("width", [40, 80, 200])
def test_numbers_of_faces_and_all_figures_are_whole_at_any_width(width: int) -> None:
    table = headed("table.faces", HEADS, file="part.step", unit="mm")
    table.add_row(*ROW, "12.333", "0.25")
    text = printed(table, width)
    assert "…" not in text
    for word in " ".join((*ROW, "12.333", "0.25")).split():
        assert word in text, word


def test_what_fits_is_left_as_it_is_and_long_words_are_folded() -> None:
    table = headed("table.faces", ("face", "face_kind"), file="part.step", unit="mm")
    table.add_row("1", "plane")
    assert printed(table, 80) == printed(table, 200)
    table = Table()
    table.add_column("name")
    table.add_column("path")
    table.add_row("a name that is whole", "x" * 300)
    text = printed(table, 80)
    assert text.count("x") == 300 and "a name that is whole" in text and "…" not in text
