"""Stored checks: found again for the same program and machine only, and never believed when damaged."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine

from controller import sealed_file
from controller.geometry.vectors import Frame
from controller.machine.model import Tool
from controller.messages import message, text
from controller.plan.report import stored
from controller.plan.report.stored import Overcut, Stored
from controller.plan.report.verdict import Verdict
from controller.plan.segment import Note
from controller.program.program import Place

HOME = (0.0, 0.0, 200.0, 0.0, 0.0)
CHECK = Stored(
    1234,
    2.468,
    3,
    {8: (0.1, -7.25)},
    (Note(Place(3, 5), message("row.departs", line=2, why=message("row.short", room=0.5))),),
    (Overcut(8, 0.1, 0.5, 0.0),),
    verdicts=(
        Verdict(8, 1, 0.05, 0.1, 0.0, 0.5, 0.0, 10.0, (1.0, 2.0, 3.0), "cut", 8, ("double", "radius"), 1.5),
    ),
)


def test_a_check_comes_back_as_it_was_stored(tmp_path):
    name = stored.key(b"G0 X1\n", machine(), HOME)
    file = stored.save(CHECK, name, tmp_path / "new" / "folder")
    assert stored.load(name, file.parent) == (CHECK, "")
    assert [one.name for one in file.parent.iterdir()] == [f"{name}.json"]


def test_without_a_check_nothing_is_warned_of(tmp_path):
    assert stored.load("0" * 64, tmp_path) == (None, "")


def changes():
    built = machine()
    axis = built.axes[0]
    yield "program", b"G0 X2\n", built, HOME
    yield "machine text", b"G0 X1\n", replace(built, text="other"), HOME
    yield "tool", b"G0 X1\n", replace(built, tools=(Tool(1, "end mill 6", 2.9, 0.0, 15.0),)), HOME
    yield "offset", b"G0 X1\n", replace(built, offsets=(Frame((1.0, 0.0, 0.0)),) * 6), HOME
    yield "gouge", b"G0 X1\n", replace(built, gouge="warn"), HOME
    yield "period", b"G0 X1\n", replace(built, period_s=0.004), HOME
    yield "limit", b"G0 X1\n", replace(built, axes=(replace(axis, travel_min=-1.0), *built.axes[1:])), HOME
    yield "start", b"G0 X1\n", built, (0.0, 0.0, 200.0, 0.0, 0.1)


@pytest.mark.parametrize(
    "what, program, built, start", list(changes()), ids=lambda x: x if isinstance(x, str) else ""
)
def test_any_change_of_program_machine_tools_offsets_or_start_asks_for_a_new_check(
    what, program, built, start
):
    assert stored.key(program, built, start) != stored.key(b"G0 X1\n", machine(), HOME)


def test_another_version_asks_for_a_new_check(monkeypatch):
    before = stored.key(b"", machine(), HOME)
    monkeypatch.setattr(stored, "VERSION", "9.9")
    assert stored.key(b"", machine(), HOME) != before


DAMAGED = ["", "{", "[]", "3", '{"key": 1}', "[" * 100_000, '{"key": "K"}', "\x00\xff"]


@pytest.mark.parametrize("content", DAMAGED, ids=[content[:12] for content in DAMAGED])
def test_a_damaged_file_is_one_warning_and_no_check(tmp_path, content):
    (tmp_path / "K.json").write_text(content, encoding="latin-1")
    found, warning = stored.load("K", tmp_path)
    assert found is None and text(warning).endswith("checked again.") and text(warning).count("\n") == 0


def test_a_file_under_a_foreign_name_is_no_check(tmp_path):
    file = stored.save(CHECK, "A", tmp_path)
    file.rename(tmp_path / "B.json")
    found, warning = stored.load("B", tmp_path)
    assert found is None and "the program is checked again" in text(warning)


@pytest.mark.parametrize(
    "field, value", [("choices", {"x": [0, 0]}), ("choices", {"1": [0]}), ("ticks", None)]
)
def test_a_field_that_makes_no_sense_is_no_check(tmp_path, field, value):
    file = stored.save(CHECK, "A", tmp_path)
    file.write_text(sealed_file.text(sealed_file.read(file) | {field: value}, file.name))
    assert stored.load("A", tmp_path)[0] is None


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(stored.os, "replace", full)
    with pytest.raises(OSError):
        stored.save(CHECK, "A", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_the_oldest_checks_go(tmp_path, monkeypatch):
    monkeypatch.setattr(stored, "KEPT", 2)
    for name in "ABC":
        stored.save(CHECK, name, tmp_path)
    assert len(list(tmp_path.glob("*.json"))) == 2


def test_the_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert stored.folder() == tmp_path / "directrix" / "checks"
    monkeypatch.setenv("XDG_STATE_HOME", "")
    assert stored.folder().parts[-4:] == (".local", "state", "directrix", "checks")
