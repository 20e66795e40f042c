"""How drives were found, kept from one commissioning to the next command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.shipped_kinds import machine

from controller import sealed_file
from controller.machine import arrangement
from controller.machine.model import Limits
from drives.arranged import Arranged
from drives.texts import plain

X = Arranged("X", 1, 68.25, 68.25, 4e8, 0.1, (("6085h:00", 4000), ("605Ah:00", 2)), (plain("A sentence."),))
Y = Arranged("Y", 2, stop_s=0.2)


def test_what_was_kept_comes_back_the_same(tmp_path: Path) -> None:
    arrangement.save(tmp_path / "new", machine(), [X, Y])
    found = arrangement.load(tmp_path / "new", machine())
    assert found is not None and found.drives == (X, Y) and len(found.at) == len("2026-01-01T00:00:00")


def test_one_bus_of_several_is_added_to_what_is_known(tmp_path: Path) -> None:
    arrangement.save(tmp_path, machine(), [X, Y])
    arrangement.save(tmp_path, machine(), [replace(Y, stop_s=0.7)])
    found = arrangement.load(tmp_path, machine())
    assert found is not None and found.drives == (X, replace(Y, stop_s=0.7))


def test_another_limit_is_another_machine_and_another_tool_is_not(tmp_path: Path) -> None:
    made = machine()
    arrangement.save(tmp_path, made, [X])
    first = replace(made.axes[0], limits=Limits(1.0, 2.0, 3.0))
    assert arrangement.load(tmp_path, replace(made, axes=(first, *made.axes[1:]))) is None
    assert arrangement.load(tmp_path, replace(made, tools=made.tools[:1], text="other")) is not None


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"at": "x", "drives": [{}]}', '{"at": "x", "drives": 3}'])
def test_a_file_that_cannot_be_read_is_none(tmp_path: Path, text: str) -> None:
    arrangement.save(tmp_path, machine(), [X]).write_text(text)
    assert arrangement.load(tmp_path, machine()) is None


def test_notes_of_before_they_had_keys_are_words(tmp_path: Path) -> None:
    made = machine()
    file = arrangement.save(tmp_path / "found", made, [X])
    facts = json.loads(file.read_text())
    del facts[sealed_file.SEAL]
    facts["drives"][0]["notes"] = ["It stops late."]
    file.write_text(json.dumps(facts, indent=1))
    found = arrangement.load(tmp_path / "found", made)
    assert found is not None and found.drives[0].notes == (plain("It stops late."),)
