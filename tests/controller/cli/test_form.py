"""Form tolerance from the files on: refused or told by check, start, verify and the service's own check."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from support.machines.stepped_runs import program
from typer.testing import CliRunner

from controller.__main__ import app
from controller.cli import check_worker
from controller.machine import machine_file, setup_data
from controller.messages import text

TWO = program("example2_ready").replace("G41 R1.", "G41")  # the paper's placement, cutter of 3 mm
BEFORE, _, FROM_FIRST = TWO.partition("N50 G52")
# Its second surface alone: off by 0.25 mm, the first by more.
TWISTED = BEFORE + "N130 F100. G52" + FROM_FIRST.partition("N130 G52")[2]
READY = ("example1_ready", "example2_ready")


@pytest.fixture
def part(tmp_path: Path) -> Path:
    file = tmp_path / "part.ngc"
    file.write_text(TWISTED)
    return file


def run(*words: object) -> tuple[int, dict[str, Any]]:
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    return result.exit_code, json.loads(result.stdout)


def mill(folder: Path, machine: str, tool: str) -> Path:
    """The shipped machine with other lines for the tolerance: of the machine, and of T2."""
    shipped = machine_file.SHIPPED
    text = (shipped / "trunnion.toml").read_text()
    kept = [line for line in text.splitlines() if not line.startswith("tolerance_mm")]
    kept.insert(kept.index("[machine]") + 1, machine)
    (folder / "mill.toml").write_text("\n".join(kept))
    tools = (shipped / "tools.toml").read_text()
    (folder / "tools.toml").write_text(tools.replace("radius_mm = 1.500\n", f"radius_mm = 1.500\n{tool}\n"))
    return folder / "mill.toml"


def test_check_refuses_with_amount_place_and_what_helps(part: Path, tmp_path: Path) -> None:
    part.write_text(TWO)
    code, told = run("check", part, "--store", tmp_path)
    assert code == 1 and not told["ok"] and not told["verdict"]["within"]
    for words in ("exceeds its form tolerance of 0.05 mm by 0.4", "u = ", "above its lower edge", "P2"):
        assert words in told["sentence"], words
    assert "gouge" in told["sentence"] and told["line"] in (10, 19)
    assert told["verdict"]["largest_mm"] > 0.25, "the ends are in it"


def test_with_gouge_warn_it_is_told_and_never_as_within(part: Path, tmp_path: Path) -> None:
    part.write_text(TWO)
    code, told = run("check", part, "--store", tmp_path, "--gouge", "warn")
    assert code == 0 and not told["verdict"]["within"]
    assert sum("exceeds its form tolerance" in one["note"] for one in told["notes"]) == 2
    shown = CliRunner().invoke(app, ["check", str(part), "--store", str(tmp_path), "--gouge", "warn"])
    assert "exceeds" in shown.stdout and "keeps its tolerance" not in shown.stdout


def test_check_tells_the_verdict_in_the_language_that_is_spoken(part: Path, tmp_path: Path) -> None:
    words = ["check", str(part), "--store", str(tmp_path), "--gouge", "warn", "--language", "de"]
    shown = CliRunner().invoke(app, words).stdout
    assert "Formtoleranz" in shown and "exceeds" not in shown


def test_a_start_without_a_check_refuses_it_as_well(part: Path, tmp_path: Path) -> None:
    code, told = run("simulate", part, "--store", tmp_path)
    assert code == 1 and "exceeds its form tolerance" in told["error"]


@pytest.mark.parametrize(
    ("word", "tool", "machine", "code"),
    [
        ("R1.", "", "tolerance_mm = 0.05", 0),
        ("", "tolerance_mm = 1.0", "tolerance_mm = 0.05", 0),
        ("R0.1", "tolerance_mm = 1.0", "tolerance_mm = 0.05", 1),
        ("", "", "tolerance_mm = 1.0", 0),
        ("", "", "", 0),
    ],
)
def test_the_programs_word_comes_before_the_tool_and_the_tool_before_the_machine(
    word: str, tool: str, machine: str, code: int, part: Path, tmp_path: Path
) -> None:
    part.write_text(TWISTED.replace("G41\n", f"G41 {word}\n"))
    file = mill(tmp_path, machine, tool)
    found, told = run("check", part, "--machine", file, "--store", tmp_path / "checks")
    assert found == code, told.get("error")
    if not machine:
        assert told["verdict"] is None


def test_auto_takes_the_first_placement_that_keeps_the_tolerance(part: Path, tmp_path: Path) -> None:
    part.write_text(TWISTED.replace("G41\n", "G41 P4 R0.06\n"))
    code, told = run("check", part, "--store", tmp_path)
    assert code == 0 and told["verdict"]["within"], told.get("error")


def test_auto_without_a_tolerance_is_refused(part: Path, tmp_path: Path) -> None:
    part.write_text(TWISTED.replace("G41\n", "G41 P4\n"))
    code, told = run("check", part, "--machine", mill(tmp_path, "", ""), "--store", tmp_path)
    assert code == 1 and "no form tolerance to be kept" in told["error"]


@pytest.mark.parametrize("name", READY)
def test_the_ready_programs_keep_20_micrometres_everywhere(name: str, tmp_path: Path) -> None:
    file = machine_file.shipped_program(name)
    code, told = run("check", file, "--store", tmp_path)
    assert code == 0 and told["verdict"]["within"] and told["verdict"]["largest_mm"] <= 0.02
    code, told = run("verify", file)
    assert code == 0 and all(one["whole"]["largest_mm"] <= 0.02 for one in told["surfaces"])


def test_verify_ends_with_1_where_a_surface_exceeds_its_tolerance(part: Path) -> None:
    code, told = run("verify", part)
    assert code == 1 and "exceeds" in told["error"] and not told["verdict"]["within"]
    whole = max(one["whole"]["largest_mm"] for one in told["surfaces"])
    assert told["verdict"]["largest_mm"] == pytest.approx(whole, abs=1e-3)


@pytest.mark.parametrize(("gouge", "state"), [("refuse", "refused"), ("warn", "passed")])
def test_the_services_check_tells_it_in_both_languages(
    gouge: str, state: str, part: Path, tmp_path: Path
) -> None:
    machine = machine_file.load("trunnion").text.replace('gouge = "refuse"', f'gouge = "{gouge}"')
    setup_data.note(tmp_path, machine_file.read(machine, "trunnion"))
    job = {"name": "part", "program": str(part), "lines": 20, "state": str(tmp_path)}
    found, result = check_worker.check(job, lambda _: None)
    assert found == state and not result["verdict"]["within"]
    assert "exceeds its form tolerance" in text(result["verdict"])
    assert "überschreitet ihre Formtoleranz" in text(result["verdict"], "de")
