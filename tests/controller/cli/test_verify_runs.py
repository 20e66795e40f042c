"""``directrix verify`` of the record of a run: what the motors have cut, not what the plan wanted."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines.recording_bench import RecordedBench
from support.machines.stepped_runs import shipped
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.ipc.handoff import COLUMN, of_axes
from controller.program import blocks
from controller.runtime import records
from controller.runtime.bench.fault_file import MachineScript
from controller.state.modes import Mode
from controller.state.setpoints import ACTUAL, SETPOINTS
from controller.verify import passes, trace
from controller.verify.judge import judge

CONE = """G21 G90 G54 G61 G94
T2 M6
G42
G51 X10. Y0. Z-8. I0. J0. K-8. H8. R5. D200. F1200.
G40
M30
"""
LOST = "seed 3\nat 2.4 s: drop rpdo X for 0.6 s odds 0.3\nat 2.4 s: drop rpdo Y for 0.6 s odds 0.3"
COUNT_MM = 1e-3  # a recorded position is a whole count


def run(folder: Path, script: str = "") -> RecordedBench:
    bench = RecordedBench(folder, shipped(period_s=0.008))
    bench.started(CONE)
    MachineScript.read(script, bench.machine).inject(bench.stepped.rig.buses, 0.0)
    bench.until(Mode.READY)
    bench.ended()
    return bench


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> RecordedBench:
    return run(tmp_path_factory.mktemp("healthy"))


def verified(*words: str) -> dict[str, Any]:
    done = CliRunner().invoke(command_line.app, ["verify", *words, "--json"])
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_a_run_with_lost_setpoints_is_judged_as_the_drives_have_cut_it(
    tmp_path: Path, healthy: RecordedBench
) -> None:
    bench = run(tmp_path, LOST)
    rows = np.concatenate(bench.rows)
    told = verified(str(bench.record.folder))
    assert told["of"] == "actual" and len(told["surfaces"]) == 1
    overcut = told["surfaces"][0]["inside"]["overcut"]["mm"]
    # The same of the rows that the tick left, by the way of a trace: they know nothing of the record.
    machine, stepped = bench.machine, bench.stepped
    first = int(rows[np.flatnonzero(rows[:, COLUMN["mode"]] == Mode.RUNNING)[0], COLUMN["tick"]])
    driven = trace.from_rows(rows, machine, stepped.kinematics, {}, first_tick=first)
    fitted = passes.Fitted.of(blocks.stream(CONE.encode(), machine, "part.ngc"), machine)
    surfaces = passes.nominals(told_segments(bench), fitted)
    ways = passes.traced(driven, machine, fitted, stepped.kinematics, True)
    (judged,) = judge(surfaces, ways)
    assert judged.inside.overcut is not None
    assert overcut == pytest.approx(judged.inside.overcut.mm, abs=COUNT_MM)
    whole = verified(str(healthy.record.folder))
    assert abs(overcut) > abs(whole["surfaces"][0]["inside"]["overcut"]["mm"]) + 2.0 * COUNT_MM


def told_segments(bench: RecordedBench) -> dict[int, Any]:
    from controller.runtime import checked

    task = checked.task(CONE.encode(), "part.ngc", bench.machine)
    return checked.segments(checked.walk_of(task, None, unchecked=True))


def test_a_record_keeps_where_the_drives_were_in_whole_counts(healthy: RecordedBench) -> None:
    bench = healthy
    setpoints, actual = SETPOINTS.read(bench.record.folder), ACTUAL.read(bench.record.folder)
    assert setpoints is not None and actual is not None and setpoints.shape == actual.shape
    rows = np.concatenate(bench.rows)
    first = bench.record.first_tick
    mine = rows[rows[:, COLUMN["tick"]] >= first][: len(actual)]
    per_unit = [axis.counts_per_unit for axis in bench.machine.axes]
    wanted = mine[:, of_axes("actual", len(per_unit))] * per_unit
    assert np.abs(actual[:, : len(per_unit)] - wanted).max() <= 0.5


def test_a_record_has_following_errors_feed_and_load(healthy: RecordedBench) -> None:
    """As the tick had them, but for what their counts round off; and nothing where no load is told."""
    bench = healthy
    found = records.read(bench.record.folder).columns
    rows = np.concatenate(bench.rows)
    mine = rows[rows[:, COLUMN["tick"]] >= bench.record.first_tick][: len(found["feed_mm_s"].values)]
    assert np.abs(found["feed_mm_s"].values - mine[:, COLUMN["feed_mm_s"]]).max() <= 0.5e-3
    assert found["feed_mm_s"].values.max() > 10.0 and found["feed_mm_s"].unit == "mm/s"
    load = mine[:, COLUMN["spindle_load"]]
    np.testing.assert_allclose(found["spindle_load"].values, load, atol=0.5e-4)
    for i, axis in enumerate(bench.machine.axes):
        error = mine[:, COLUMN[f"setpoint_{i}"]] / axis.counts_per_unit - mine[:, COLUMN[f"actual_{i}"]]
        told = found[f"following_error.{axis.name}"]
        assert np.abs(told.values - error).max() <= 0.6 / abs(axis.counts_per_unit)
        assert told.unit == found[f"actual.{axis.name}"].unit
    assert max(np.abs(found["following_error.X"].values)) > 0.0


def test_a_record_without_positions_says_so(tmp_path: Path, healthy: RecordedBench) -> None:
    folder = tmp_path / healthy.record.folder.name
    shutil.copytree(healthy.record.folder, folder)
    (folder / "actual.npz").unlink()
    told = verified(str(folder))
    assert told["ok"] is False and "holds no positions of the drives" in told["error"]
