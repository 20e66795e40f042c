"""A machine with sheets and profiles beside it travels as one sealed file, and comes back the same."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from controller.cli.machine_bundle import app
from controller.machine import machine_file

CONFIG = Path(__file__).parents[3] / "config"


def asked(*words: str) -> dict[str, Any]:
    done = CliRunner().invoke(app, [*words, "--json"])
    return {**json.loads(done.stdout), "exit": done.exit_code}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A machine with tools, a sheet and a profile of its own beside it, in folders."""
    (tmp_path / "in" / "sheets").mkdir(parents=True)
    shutil.copy(CONFIG / "tools.toml", tmp_path / "in")
    sheet = (CONFIG / "eds" / "simulated_drive.eds").read_text("latin-1")
    (tmp_path / "in" / "sheets" / "x.eds").write_text(sheet.replace("Simulated", "Gesch\u00e4tzt"), "latin-1")
    profile = (
        (CONFIG / "drives" / "generic.toml").read_text("utf-8").replace("[drive]", '[drive]\neds = "x.eds"')
    )
    (tmp_path / "in" / "sheets" / "own.toml").write_text(profile, "utf-8")
    text = (CONFIG / "trunnion.toml").read_text("utf-8")
    own = text.replace('profile = "simulated"', 'profile = "sheets/own.toml"\neds = "sheets/x.eds"', 1)
    (tmp_path / "in" / "mine.toml").write_text(own, "utf-8")
    return tmp_path


def test_it_is_packed_unpacked_and_the_same(folder: Path) -> None:
    mine, packed, out = folder / "in" / "mine.toml", folder / "p.toml", folder / "out" / "new"
    assert asked("pack", str(mine), "--output", str(packed))["files"] == ["sheets/own.toml", "sheets/x.eds"]
    assert machine_file.load(packed).axes == machine_file.load(mine).axes
    assert asked("unpack", str(packed), str(out))["ok"]
    for name in ("sheets/x.eds", "sheets/own.toml"):
        assert (out / name).read_bytes() == (folder / "in" / name).read_bytes()
    assert asked("diff", str(mine), str(out / "machine.toml")) == {"ok": True, "differences": [], "exit": 0}
    again = folder / "q.toml"
    assert asked("pack", str(out / "machine.toml"), "--output", str(again))["ok"]
    assert asked("diff", str(packed), str(again))["ok"]


def test_what_differs_is_named_by_axis_tool_and_file(folder: Path) -> None:
    mine = folder / "in" / "mine.toml"
    shutil.copytree(folder / "in", folder / "other")
    other = folder / "other" / "mine.toml"
    other.write_text(other.read_text().replace("velocity_mm_s = 200.0", "velocity_mm_s = 150.0", 1))
    (folder / "other" / "sheets" / "own.toml").write_text(
        (folder / "other" / "sheets" / "own.toml").read_text().replace("rpdo = 1", "rpdo = 2", 1)
    )
    found = asked("diff", str(mine), str(other))
    assert found["exit"] == 1
    places = [row["key"] for row in found["differences"]]
    assert places == ["[[axis]] X: velocity_mm_s", "[[file]] sheets/own.toml: text"]


@pytest.mark.parametrize("flipped", [10, 2000, -100])
def test_a_spoilt_file_is_not_unpacked(folder: Path, flipped: int) -> None:
    packed = folder / "p.toml"
    assert asked("pack", str(folder / "in" / "mine.toml"), "--output", str(packed))["ok"]
    bytes_ = bytearray(packed.read_bytes())
    bytes_[flipped] ^= 1
    packed.write_bytes(bytes_)
    refused = asked("unpack", str(packed), str(folder / "out"))
    assert not refused["ok"] and refused["exit"] == 1 and not (folder / "out").exists()


def test_no_file_lands_outside_of_the_folder_and_nothing_is_overwritten(folder: Path) -> None:
    packed, mine = folder / "p.toml", folder / "in" / "mine.toml"
    assert asked("pack", str(mine), "--output", str(packed))["ok"]
    assert "is there already" in asked("pack", str(mine), "--output", str(packed))["error"]
    assert "not an empty folder" in asked("unpack", str(packed), str(folder / "in"))["error"]
    mine.write_text(mine.read_text().replace("sheets/x.eds", "../in/sheets/x.eds"))
    assert asked("pack", str(mine), "--output", str(packed), "--overwrite")["ok"]
    refused = asked("unpack", str(packed), str(folder / "out"))
    assert "outside of the folder" in refused["error"] and not (folder / "out").exists()


def test_a_sheet_named_as_the_machine_file_does_not_replace_it(folder: Path) -> None:
    packed, mine = folder / "p.toml", folder / "in" / "mine.toml"
    (folder / "in" / "sheets" / "x.eds").rename(folder / "in" / "machine.toml")
    mine.write_text(mine.read_text().replace("sheets/x.eds", "machine.toml"))
    (folder / "in" / "sheets" / "own.toml").write_text(
        (CONFIG / "drives" / "generic.toml")
        .read_text()
        .replace("[drive]", '[drive]\neds = "../machine.toml"')
    )
    assert asked("pack", str(mine), "--output", str(packed))["ok"]
    refused = asked("unpack", str(packed), str(folder / "out"))
    assert "where the machine file goes" in refused["error"] and not (folder / "out").exists()
