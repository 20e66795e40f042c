"""``directrix export`` and ``compare``: columns with units for others' tools, and two recordings apart."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.__main__ import app
from controller.machine import machine_file
from controller.messages import LANGUAGES
from controller.runtime import records
from controller.state import record_files
from controller.state.live_state import COLUMN, ROW
from controller.state.setpoints import ACTUAL, SETPOINTS, TABLES
from controller.verify import trace as traces

RUNS = Path(__file__).parents[2] / "data" / "runs"
PROGRAM = "G21 G90 G54\nT2 M6\nG0 X5. Y-3. Z100.\nG1 X0. A4. F2000.\nM30\n"

parquet = pytest.importorskip("pyarrow.parquet")


def told(*words: object) -> tuple[int, dict]:
    done = CliRunner().invoke(app, [*map(str, words), "--json"])
    return done.exit_code, json.loads(done.stdout)


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trace")
    (folder / "part.ngc").write_text(PROGRAM)
    words = ["simulate", folder / "part.ngc", "--trace", folder / "t.npz", "--store", folder]
    assert told(*words)[0] == 0
    return folder / "t.npz"


@pytest.fixture
def fault(tmp_path: Path) -> Path:
    """A folder as a fault leaves it, with rows of the recorder."""
    machine, folder = machine_file.load("trunnion"), tmp_path / "fault"
    rows = np.random.default_rng(1).normal(size=(40, len(ROW)))
    rows[:, COLUMN["tick"]], rows[:, COLUMN["line"]] = np.arange(40.0), 7.0
    rows[:, COLUMN["mode"]] = 2.0
    for name in ROW:
        if name.startswith("setpoint_") or name in ("fault", "motion_id", "limited_by", "switches"):
            rows[:, COLUMN[name]] = np.round(100.0 * rows[:, COLUMN[name]])
        if name in ("cutting", "sync_sent"):
            rows[:, COLUMN[name]] = rows[:, COLUMN[name]] > 0.0
        if name in ("accepted", "request"):
            rows[:, COLUMN[name]] = 0.0
    folder.mkdir()
    with open(folder / "trace.npz", "wb") as file:
        np.savez_compressed(
            file, columns=np.array(ROW), rows=rows, machine=np.array(machine.text), period_s=machine.period_s
        )
    return folder


def test_another_tool_reads_columns_units_and_meanings(trace: Path, tmp_path: Path) -> None:
    out = tmp_path / "t.parquet"
    code, found = told("export", trace, out)
    assert code == 0 and found["kind"] == "trace"
    table, source = parquet.read_table(out), traces.load(trace)
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert units["joint_command.X"] == units["actual.Z"] == "mm" and units["joint_command.A"] == "deg"
    assert units["setpoint.C"] == "counts" and units["feed_mm_s"] == "mm/s" and units["time_s"] == "s"
    assert all(field.metadata[b"meaning"] for field in table.schema)
    assert float(table.schema.metadata[b"directrix.period_s"]) == source.period_s
    for i, axis in enumerate(source.axes):
        assert table[f"joint_command.{axis}"].to_numpy().tobytes() == source.joint_command[:, i].tobytes()
        assert np.array_equal(table[f"setpoint.{axis}"].to_numpy(), source.joint_setpoint[:, i])


def test_meanings_are_in_the_language_that_is_asked_for(trace: Path, fault: Path, tmp_path: Path) -> None:
    out, texts = tmp_path / "m.parquet", LANGUAGES["de"].texts
    for recording in (trace, fault):
        code, found = told("export", recording, out, "--language", "de")
        meanings = {one["name"]: one["meaning"] for one in found["columns"]}
        assert code == 0 and meanings["feed_mm_s"] == texts["column.feed_mm_s"]
        assert meanings["actual.X"].endswith(": X") and meanings["line"] == texts["column.line"]
        metadata = {field.name: field.metadata[b"meaning"].decode() for field in parquet.read_schema(out)}
        assert metadata == meanings


def test_every_column_has_a_meaning_in_the_catalogue_and_none_is_of_one_that_is_gone(
    trace: Path, fault: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    shutil.copytree(RUNS / "tool_changes", run)
    rows = SETPOINTS.read(run)
    assert rows is not None
    with (run / ACTUAL.whole).open("wb") as file:
        ACTUAL.pack(file, 0, rows, str(record_files.known(run)["id"]))
    said = [one.meaning for path in (trace, fault, run) for one in records.read(path).columns.values()]
    parts = [one["values"].get("meaning", one) for one in said]
    found = {one["key"] for one in (*said, *parts)}
    texts = {key for key in LANGUAGES["en"].texts if key.startswith("column.")}
    assert found == texts


def test_simulate_writes_it_itself(trace: Path, tmp_path: Path) -> None:
    out = tmp_path / "t.parquet"
    code, _ = told("simulate", trace.parent / "part.ngc", "--trace", out, "--store", tmp_path)
    assert code == 0
    code, found = told("compare", trace, out)
    assert code == 0 and found["lengths"][0] == found["lengths"][1] > 100
    assert all(one["largest"] == 0.0 for one in found["columns"])


def test_a_recording_of_a_fault_has_the_units_of_the_live_state(fault: Path, tmp_path: Path) -> None:
    code, found = told("export", fault, tmp_path / "f.parquet")
    columns = {one["name"]: one for one in found["columns"]}
    assert code == 0 and found["kind"] == "recording" and found["rows"] == 40
    assert columns["joint_command.X"]["unit"] == "mm" and columns["actual.A"]["unit"] == "rad"
    assert columns["cutting"]["type"] == "bool" and columns["line"]["type"] == "int64"
    clock = {"name": "plan_time_s", "unit": "s", "meaning": "the path clock", "type": "float64"}
    assert columns["plan_time_s"] == clock
    again = records.read(tmp_path / "f.parquet")
    source = records.read(fault)
    assert again.machine == source.machine and again.period_s == source.period_s
    for name, column in source.columns.items():
        assert again.columns[name].values.tobytes() == column.values.tobytes(), name
        assert again.columns[name][1:] == (column.unit, column.meaning_text("en")), name


def test_every_shipped_record_of_a_run_is_read(tmp_path: Path) -> None:
    for folder in sorted(RUNS.iterdir()):
        found = records.read(folder)
        assert found.kind == "run" and found.rows > 10 and "setpoint.X" in found.columns
        records.write(found, tmp_path / "r.parquet")
        assert records.compare(found, records.read(tmp_path / "r.parquet")).is_same


def moved(trace: Path, out: Path, row: int, by: float) -> Path:
    source = traces.load(trace)
    joints = source.joint_actual.copy()
    joints[row:, 1] += by
    replace(source, joint_actual=joints).save(out)
    return out


def test_what_is_apart_is_told_with_row_and_column(trace: Path, tmp_path: Path) -> None:
    other = moved(trace, tmp_path / "o.npz", 123, 0.004)
    code, found = told("compare", trace, other)
    apart = {one["name"]: one for one in found["columns"] if one["first"] >= 0}
    assert code == 1 and set(apart) == {"actual.Y"}
    assert apart["actual.Y"]["first"] == 123 and apart["actual.Y"]["largest"] == pytest.approx(0.004)
    assert "row 123" in found["error"] and "actual.Y" in found["error"] and "line" in found["error"]
    assert told("compare", trace, other, "--tolerance", "0.005")[0] == 0
    assert told("compare", other, other)[0] == 0


def test_a_run_is_held_beside_a_trace_by_its_setpoints(trace: Path, fault: Path) -> None:
    a, b = records.read(trace), records.read(fault)
    found = records.compare(a, b)
    named = {one.name for one in found.columns}
    assert {"setpoint.X", "actual.A", "line"} <= named and "tool_tip.X" in found.only[0]
    x = np.degrees(b.columns["actual.A"].values)
    off = np.abs(a.columns["actual.A"].values[: found.rows] - x)
    assert next(one for one in found.columns if one.name == "actual.A").largest == pytest.approx(off.max())


def test_lengths_periods_and_what_is_no_recording_are_one_sentence(
    trace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = traces.load(trace)
    rows = {n: getattr(source, n)[:-3] for n in source.__dataclass_fields__ if n in records.OF_TRACE}
    replace(source, **rows).save(tmp_path / "short.npz")
    replace(source, period_s=0.004).save(tmp_path / "slow.npz")
    (tmp_path / "text.npz").write_text("no zip")
    code, short = told("compare", trace, tmp_path / "short.npz")
    assert code == 1 and str(len(source.time_s) - 3) in short["error"]
    assert "other periods" in told("compare", trace, tmp_path / "slow.npz")[1]["error"]
    assert "cannot be read" in told("compare", trace, tmp_path / "text.npz")[1]["error"]
    assert "neither" in told("compare", tmp_path, trace)[1]["error"]
    assert "ends with .parquet" in told("export", trace, tmp_path / "t.csv")[1]["error"]
    code, german = told("compare", trace, tmp_path / "slow.npz", "--language", "de")
    assert code == 1 and "verschiedene Takte" in german["error"]
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for words in (("export", trace, tmp_path / "t.parquet"), ("compare", trace, tmp_path / "t.parquet")):
        assert "directrix[recordings]" in told(*words)[1]["error"]


def segmented(folder: Path, each: int) -> list[str]:
    """A record's tables in segments of so many ticks; the names of those of the setpoints."""
    for table in TABLES:
        rows = table.read(folder)
        assert rows is not None
        (folder / table.whole).unlink()
        for first in range(0, len(rows), each):
            with (folder / table.name(first)).open("wb") as file:
                table.pack(file, first, rows[first : first + each], record_files.known(folder)["id"])
    return [segment.file.name for segment in SETPOINTS.segments(folder)]


def test_a_spoilt_segment_is_named_and_the_rest_of_the_run_is_written(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(RUNS / "override_before_the_start", tmp_path / "override_before_the_start"))
    whole = records.read(folder)
    spoilt, out = segmented(folder, 300)[1], tmp_path / "r.parquet"
    assert told("compare", folder, RUNS / folder.name)[0] == 0
    (folder / spoilt).write_bytes((folder / spoilt).read_bytes()[:-40])
    (folder / ACTUAL.name(600)).unlink()
    code, found = told("export", folder, out)
    assert code == 0 and found["partial"] and found["rows"] == whole.rows
    where = [(one["file"], one["first_tick"], one["end_tick"]) for one in found["spoilt"]]
    assert where == [(spoilt, 300, 600), (ACTUAL.name(600), 600, 900)]
    assert spoilt in found["spoilt"][0]["sentence"]
    kept, lost = records.read(out).columns, np.arange(whole.rows) // 300
    for name, gaps in (("setpoint.X", [1]), ("actual.X", [2]), ("following_error.X", [1, 2])):
        values, wanted = kept[name].values, whole.columns[name].values
        assert np.array_equal(np.isnan(values), np.isin(lost, gaps)), name
        assert np.array_equal(values[~np.isnan(values)], wanted[~np.isin(lost, gaps)]), name
    code, found = told("compare", folder, RUNS / folder.name)
    assert code == 0 and len(found["spoilt"]) == 2


@pytest.mark.slow
def test_a_run_with_a_spoilt_segment_is_judged_and_called_partial(tmp_path: Path) -> None:
    name = "ruled_surfaces_on_an_oblique_head"
    code, whole = told("verify", RUNS / name)
    folder = Path(shutil.copytree(RUNS / name, tmp_path / name))
    segmented(folder, 400)
    file = folder / ACTUAL.name(800)
    file.write_bytes(file.read_bytes()[:-40])
    again, found = told("verify", folder)
    assert again == code and (whole["partial"], found["partial"]) == (False, True)
    (spoilt,) = found["spoilt"]
    assert (spoilt["file"], spoilt["first_tick"], spoilt["end_tick"]) == (file.name, 800, 1200)
    assert "the commanded positions count" in spoilt["sentence"] and len(found["surfaces"]) == len(
        whole["surfaces"]
    )
