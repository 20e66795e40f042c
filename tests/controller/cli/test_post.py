"""``directrix post``: two files that run through the check, and the table beside the program itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from controller.__main__ import app

CONE = "T1 M6\nS8000 M3\nG41\nG51 X0. Y10. Z0. I0. J0. K0. H6. R8. D-90. F600.\nM5\nM30\n"


def run(*words: object) -> tuple[int, dict[str, Any]]:
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    return result.exit_code, json.loads(result.stdout)


@pytest.fixture(scope="module")
def posted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    program = tmp_path_factory.mktemp("post") / "cone.ngc"
    program.write_text(CONE)
    code, told = run("post", program, "--chord", "0.01")
    assert code == 0, told
    return program, told


def test_the_table_has_lines_bytes_time_and_error_of_all_three(posted: tuple[Path, dict[str, Any]]) -> None:
    program, told = posted
    ours, tip, joints = told["rows"]
    assert [row["form"] for row in told["rows"]] == ["rulings", "tip", "joints"]
    assert (ours["lines"], ours["size"]) == (6, len(CONE))
    assert max(ours["overcut_mm"], ours["undercut_mm"]) < 1e-4
    for row in (tip, joints):
        assert row["lines"] > 2 * ours["lines"]
        assert row["size"] == Path(row["file"]).stat().st_size
        assert 1e-3 < max(row["overcut_mm"], row["undercut_mm"]) < 0.025
        assert row["duration_s"] == pytest.approx(ours["duration_s"], rel=0.1)
    assert {path.name for path in program.parent.iterdir()} == {
        "cone.ngc",
        "cone_tip.ngc",
        "cone_joints.ngc",
    }


@pytest.mark.parametrize("form", ["tip", "joints"])
def test_what_was_written_runs_through_the_check(
    posted: tuple[Path, dict[str, Any]], tmp_path: Path, form: str
) -> None:
    file = posted[0].with_name(f"cone_{form}.ngc")
    code, found = run("check", file, "--store", tmp_path)
    assert code == 0, found
    row = next(row for row in posted[1]["rows"] if row["form"] == form)
    stop_s = 0.002  # a tick: somebody has to switch the spindle on
    assert found["duration_s"] == pytest.approx(row["duration_s"] + stop_s, abs=1e-9)


def test_files_that_are_there_are_left_alone(posted: tuple[Path, dict[str, Any]]) -> None:
    code, told = run("post", posted[0])
    assert code == 1
    assert "cone_tip.ngc: is there already" in told["error"]


@pytest.mark.parametrize("chord", ["0", "-1", "nan", "inf"])
def test_a_chord_that_is_no_length_is_refused(tmp_path: Path, chord: str) -> None:
    program = tmp_path / "cone.ngc"
    program.write_text(CONE)
    code, told = run("post", program, f"--chord={chord}")
    assert code == 1
    assert "must be greater than 0" in told["error"]
    assert [path.name for path in tmp_path.iterdir()] == ["cone.ngc"]
