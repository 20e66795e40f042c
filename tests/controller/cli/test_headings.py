"""Headings of what commands print stand in the language that is spoken."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from rich.table import Table
from typer.testing import CliRunner

from controller.__main__ import app
from controller.cli import drive_tables, fault_runs, offsets, post, tools
from controller.verify.console import spoken

NOTHING_SET = {
    "offsets": {},
    "shift": {"suspended": False, "origin_mm": [0.0, 0.0, 0.0], "source": "file"},
    "references": {},
    "parameters": {},
}
TABLES: dict[str, Callable[[], Table]] = {
    "offsets": lambda: offsets.table(NOTHING_SET),
    "tools": lambda: tools.table({}),
    "commissioned": lambda: drive_tables.outcomes([]),
    "nodes": lambda: drive_tables.answering([]),
    "drives": lambda: drive_tables.status([]),
    "objects": lambda: drive_tables.dump([]),
    "differences": lambda: drive_tables.differences([], "x.toml"),
    "put back": lambda: drive_tables.restored([]),
    "post": lambda: post._table(Path("p.ngc"), 0.01, False, []),
    "faults": lambda: fault_runs._table({"from": "home", "injected": [], "raised": []}),
}
ALIKE = (
    "Name",
    "Radius",
    "NMT",
    "Position",
    "hex",
    "Bus",
    "Revision",
    "Bytes",
    "s",
    "x.toml",
    "X Y Z",
    "None",
)


def heads(made: Table) -> list[str]:
    return [str(made.title), *(str(column.header) for column in made.columns)]


@pytest.mark.parametrize("name", TABLES)
def test_no_heading_is_left_in_english(name: str) -> None:
    english = heads(TABLES[name]())
    before = spoken.set("de")
    german = heads(TABLES[name]())
    spoken.reset(before)
    for before, after in zip(english, german, strict=True):
        assert after.lower() != before.lower() or after in ALIKE, name


def test_the_budget_of_a_bus_is_told_in_german_in_as_many_lines() -> None:
    shown = [
        CliRunner().invoke(app, ["bus", "trunnion", *more]).stdout for more in ([], ["--language", "de"])
    ]
    english, german = (text.splitlines() for text in shown)
    assert max(map(len, english)) <= 80 and max(map(len, german)) <= 80 and "…" not in shown[1]
    assert "Vollster Takt" in shown[1] and "Fullest" not in shown[1]
    assert not {"frame", "worst", "mean", "seldom", "ticks"} & set(shown[1].split())
