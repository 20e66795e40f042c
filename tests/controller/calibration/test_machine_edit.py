"""Machine files with what was found in them: comments stay, the old file is kept beside the new one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from controller.calibration import machine_edit
from controller.machine import machine_file
from controller.machine.toml_table import ConfigError

SHIPPED = machine_file.SHIPPED / "trunnion.toml"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(SHIPPED.read_text())
    return path


def moved():
    machine = machine_file.load("trunnion")
    axes = list(machine.axes)
    axes[3] = replace(axes[3], point_mm=(0.0, 0.0123456, -0.2), direction=(0.9999995, 0.0, 0.001))
    axes[4] = replace(axes[4], point_mm=(0.1, 96.0, 120.0))
    return replace(machine, axes=tuple(axes))


def test_rotaries_are_written_where_they_stood_and_everything_else_is_as_it_was(file):
    text = machine_edit.rotaries(file.read_text(), moved())
    old, new = file.read_text().splitlines(), text.splitlines()
    changed = [(a, b) for a, b in zip(old, new, strict=True) if a != b]
    assert [b.split(" =")[0] for _, b in changed] == ["direction", "point_mm", "direction", "point_mm"]
    found = machine_file.read(text + "\n" + (machine_file.SHIPPED / "tools.toml").read_text(), "own.toml")
    assert found.axes[3].point_mm == (0.0, 0.012346, -0.2) and found.axes[4].point_mm[0] == 0.1


def test_a_comment_behind_a_value_stays(file):
    text = file.read_text().replace("point_mm = [0.0, 96.0, 120.0]", "point_mm = [0.0, 96.0, 120.0]  # W")
    assert "point_mm = [0.1, 96.0, 120.0]  # W" in machine_edit.rotaries(text, moved())


def test_writing_keeps_the_file_as_it_was_beside_the_new_one(file):
    before = file.read_text()
    kept = machine_edit.write(file, machine_edit.rotaries(before, moved()), "20261125-160000")
    assert kept.name == "own.before-20261125-160000.toml" and kept.read_text() == before
    assert machine_file.load(file).axes[4].point_mm == (0.1, 96.0, 120.0)
    assert sorted(p.name for p in file.parent.iterdir()) == ["own.before-20261125-160000.toml", "own.toml"]


def test_a_text_that_is_no_machine_is_not_written(file):
    before = file.read_text()
    with pytest.raises(ConfigError):
        machine_edit.write(file, before.replace("period_s = 0.002", "period_s = 2"), "x")
    assert file.read_text() == before and [p.name for p in file.parent.iterdir()] == ["own.toml"]


def test_tables_and_offsets_are_written_so_that_they_are_read_again(file):
    text = file.read_text()
    table = {"at_mm": [-300, 300], "up_mm": [0.01, -0.01], "down_mm": [0.015, -0.005]}
    text = machine_edit.pitch(text, machine_file.load(file).axes[0], table)
    text = machine_edit.offset(text, "G55", {"origin_mm": (1, 2, 3), "turned_deg": (0, 0, 30)})
    machine_edit.write(file, text, "x")
    found = machine_file.load(file)
    assert found.axes[0].pitch.down == (0.015, -0.005)
    assert found.offsets[1].origin == (1.0, 2.0, 3.0) and found.offsets[1].x[1] == pytest.approx(0.5)
