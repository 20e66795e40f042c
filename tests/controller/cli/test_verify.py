"""``directrix verify``: from the plan and from a trace, refused or told, with its picture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.machines.stepped_runs import program
from support.oracles.placed_cuts import LINE, small
from typer.testing import CliRunner

from controller.__main__ import app
from controller.ipc.handoff import COLUMN, ROW
from controller.machine import machine_file
from controller.plan.rotaries.branch import joints_along
from controller.runtime import checked
from controller.verify import bound

READY = str(machine_file.shipped_program("example2_ready"))
VERBATIM = str(machine_file.shipped_program("example2"))


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Example 2 as the paper places the cutter, one of 3 mm."""
    file = tmp_path_factory.mktemp("ready") / "part.ngc"
    file.write_text(program("example2_ready"))
    return str(file)


def run(*words: object) -> tuple[int, dict]:
    result = CliRunner().invoke(app, ["verify", *map(str, words), "--json"])
    return result.exit_code, json.loads(result.stdout)


def test_the_plan_of_the_ready_example_is_verified(tmp_path: Path, ready: str) -> None:
    code, found = run(ready, "--plot", tmp_path / "cut.png")
    assert code == 0 and found["ok"] and found["of"] == "plan" and found["gouges"] == []
    first, second = found["surfaces"]
    assert first["inside"]["overcut"]["mm"] == pytest.approx(-0.01797, abs=2e-5)
    assert second["inside"]["overcut"]["mm"] == pytest.approx(-0.18831, abs=2e-5)
    assert all(one["inside"]["settled_mm"] < 1e-4 for one in found["surfaces"])
    assert (tmp_path / "cut.png").read_bytes().startswith(b"\x89PNG")


def test_what_gouges_is_shown_and_ends_with_1_unless_told_to_warn() -> None:
    code, refused = run(VERBATIM)
    assert code == 1 and not refused["ok"] and "too deep" in refused["error"]
    warned, told = run(VERBATIM, "--gouge", "warn")
    assert warned == 0 and told["gouges"] == refused["gouges"] != []
    assert {"line", "by_line", "depth_mm", "place", "sentence"} <= told["gouges"][0].keys()


@pytest.fixture(scope="module")
def trace_file(tmp_path_factory: pytest.TempPathFactory, ready: str) -> Path:
    file = tmp_path_factory.mktemp("trace") / "run.npz"
    store = str(file.parent)
    words = ["simulate", ready, "--trace", str(file), "--period-ms", "5", "--json", "--store", store]
    assert CliRunner().invoke(app, words).exit_code == 0
    return file


@pytest.mark.slow
def test_a_trace_of_what_was_commanded_comes_out_as_the_plan(trace_file: Path, ready: str) -> None:
    _, plan = run(ready)
    code, told = run(trace_file, "--program", ready, "--commanded")
    assert code == 0 and told["of"] == "commanded"
    for ours, theirs in zip(told["surfaces"], plan["surfaces"], strict=True):
        assert ours["inside"]["largest_mm"] == pytest.approx(theirs["inside"]["largest_mm"], abs=1e-3)


@pytest.mark.slow
def test_a_trace_of_what_the_drives_did_is_off_by_their_errors(trace_file: Path, ready: str) -> None:
    code, told = run(trace_file, "--program", ready, "--gouge", "warn")
    assert code == 0 and told["of"] == "actual"
    inside = [one["inside"] for one in told["surfaces"]]
    assert all(one["uncut"] == 0.0 and one["largest_mm"] < 0.25 for one in inside)
    assert inside[0]["largest_mm"] != pytest.approx(0.017968, abs=1e-6)


@pytest.mark.slow
def test_the_folder_of_a_recording_is_taken_as_a_trace(tmp_path: Path, ready: str) -> None:
    """Example 2 at an even feed, its setpoints as the recorder keeps them."""
    code, told = run(
        recorded(tmp_path, even_rows(ready)), "--program", ready, "--commanded", "--gouge", "warn"
    )
    assert code == 0 and told["of"] == "commanded"
    first = told["surfaces"][0]["inside"]
    assert first["overcut"]["mm"] == pytest.approx(-0.018, abs=1e-3) and first["uncut"] == 0.0


@pytest.mark.slow
def test_a_surface_that_a_recording_ends_before_is_told_and_not_judged(tmp_path: Path, ready: str) -> None:
    rows = even_rows(ready)
    first, behind = sorted(set(rows[:, COLUMN["line"]].astype(int).tolist()))
    kept = rows[rows[:, COLUMN["line"]] == first]
    code, told = run(recorded(tmp_path, kept), "--program", ready, "--commanded")
    assert [note["line"] for note in told["notes"] if note["key"] == "note.not_cut"] == [behind]
    assert code == 0 and [one["line"] for one in told["verdict"]["surfaces"]] == [first], told


def recorded(folder: Path, rows: np.ndarray) -> Path:
    """The folder of a recording."""
    made = machine_file.load("trunnion")
    np.savez_compressed(
        folder / "trace.npz", columns=np.array(ROW), rows=rows, period_s=made.period_s, machine=made.text
    )
    return folder


def even_rows(ready: str) -> np.ndarray:
    """Rows of both cuts: places at an even feed, their joints as the path has them."""
    made = machine_file.load("trunnion")
    task = checked.task(Path(ready).read_bytes(), ready, made)
    segments = checked.segments(checked.path_of(task, checked.chosen_for(task)))
    parts = []
    for number, segment in segments.items():
        if segment.name == "cut":
            s = np.linspace(0.0, segment.motion.end, 3000)
            part = np.zeros((len(s), len(ROW)))
            first = COLUMN["joint_command_0"]
            part[:, first : first + 5] = joints_along(segment, s, task.kinematics)
            part[:, COLUMN["line"]], part[:, COLUMN["motion_id"]] = segment.place.line, number
            part[:, COLUMN["cutting"]] = 1.0
            parts.append(part)
    rows = np.vstack(parts)
    rows[:, COLUMN["tick"]] = np.arange(len(rows))
    return rows


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["nothing.ngc"], "there is no such file"),
        (["trace.npz"], "give its program with --program"),
        ([READY, "--commanded"], "belong to a trace"),
    ],
)
def test_what_cannot_be_verified_is_said_in_a_sentence(words: list[str], sentence: str) -> None:
    code, told = run(*words)
    assert code == 1 and sentence in told["error"]


def test_a_file_that_is_no_trace_is_said_to_be_none(tmp_path: Path) -> None:
    file = tmp_path / "x.npz"
    file.write_bytes(b"PK no")
    code, told = run(file, "--program", READY)
    assert code == 1 and "cannot be read as a trace" in told["error"]


def test_a_program_without_surfaces_has_nothing_to_verify(tmp_path: Path) -> None:
    file = tmp_path / "lines.ngc"
    file.write_text("G21 G90\nG0 X1. Y1.\nM30\n")
    code, told = run(file)
    assert code == 0 and told["surfaces"] == [] and "cuts no surface" in told["notes"][-1]["note"]


def test_with_bound_each_placed_surface_has_the_best_of_another_search_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bound, "STARTS", 2)
    monkeypatch.setattr(bound, "STEPS", 6)
    part = tmp_path / "part.ngc"
    part.write_text(small(2))
    code, found = run(part, "--bound", "--gouge", "warn")
    assert code == 0
    (one,) = found["bounds"]
    assert one["line"] == LINE and one["placed"] == "double"
    assert one["off_mm"] == pytest.approx(found["surfaces"][0]["inside"]["largest_mm"], abs=2e-5)
    assert 0.0 <= one["best_mm"] < one["off_mm"] and one["sentence"]
    _, without = run(part, "--gouge", "warn")
    assert "bounds" not in without
