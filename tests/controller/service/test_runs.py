"""Records of runs whose service did not live to end them."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fakes.written_history import indexed, settled
from support.machines.stepped_runs import shipped

from controller import sealed_file
from controller.ipc.handoff import COLUMN, ROW
from controller.runtime.plan_messages import Program, Turn
from controller.runtime.starts import Start
from controller.service import runs
from controller.service.runs import RunRecord
from controller.state import record_files
from controller.state.modes import Mode
from controller.state.setpoints import SETPOINTS
from controller.store.history import Run

MACHINE = shipped()
WHAT = {"name": "part.ngc", "sha256": "00", "line": None}
START = Start((0.0, 0.0, 0.0, 0.0, 0.0), 0.0)

NO_SPACE = {"key": "errno.ENOSPC", "values": {}}


def begun(state: Path, ticks: int = 0) -> RunRecord:
    """A run that has been cutting for so many ticks."""
    record = RunRecord(state, MACHINE, WHAT)
    record.begins(START, Program(b"M2\n", "part.ngc", MACHINE), {})
    record.take(running(ticks))
    return record


def running(ticks: int) -> np.ndarray:
    """Rows of a cut at 100 %."""
    rows = np.zeros((ticks, len(ROW)))
    rows[:, COLUMN["tick"]] = range(ticks)
    rows[:, COLUMN["mode"]], rows[:, COLUMN["sync_sent"]] = Mode.RUNNING, 1.0
    rows[:, COLUMN["override"]] = rows[:, COLUMN["rapid_override"]] = 1.0
    rows[:, COLUMN["adaptive_share"]] = 1.0
    return rows


def killed(state: Path, ticks: int = 1000) -> Path:
    """The folder of a run whose service was killed."""
    record = begun(state, ticks)
    assert record._file is not None
    record._file.close()
    return record.folder


def told(state: Path) -> Run:
    (run,) = indexed(state)
    return run


def test_a_run_whose_service_was_killed_is_lost_and_not_forgotten(tmp_path: Path) -> None:
    folder = killed(tmp_path)
    assert indexed(tmp_path) == [], "it may be under way"
    assert settled(tmp_path) == settled(tmp_path) == []
    run = told(tmp_path)
    assert (run.facts["record"], run.program, run.sha256) == (folder.name, "part.ngc", "00")
    assert run.result == "lost" and run.began_s <= run.ended_s
    found = SETPOINTS.read(folder)
    assert found is not None and len(found) == 1000


def test_a_run_ended_when_its_last_setpoints_were_written(tmp_path: Path) -> None:
    folder = killed(tmp_path)
    written_s = folder.stat().st_mtime + 5.0
    os.utime(folder / "setpoints.part", (written_s, written_s))  # no other file of it was written later
    settled(tmp_path)
    assert told(tmp_path).ended_s == written_s


@pytest.mark.parametrize("result", ["completed", "stopped", "fault", "interrupted"])
def test_a_run_that_has_ended_is_not_lost(tmp_path: Path, result: str) -> None:
    begun(tmp_path, 10).end(result)
    assert settled(tmp_path) == []
    assert told(tmp_path).result == result


def test_a_start_that_never_went_out_is_no_run(tmp_path: Path) -> None:
    RunRecord(tmp_path, MACHINE, WHAT)  # the service was killed while it planned
    begun(tmp_path).throw_away()
    assert settled(tmp_path) == [] and indexed(tmp_path) == []


def test_a_service_killed_when_an_end_was_all_but_written_has_ended_it(tmp_path: Path) -> None:
    record = begun(tmp_path, 10)
    kept = (record.folder / "begun.json").read_text()
    record.end("completed")
    (record.folder / "begun.json").write_text(kept)
    assert settled(tmp_path) == [] and told(tmp_path).result == "completed"
    assert not (record.folder / "begun.json").exists()


@pytest.mark.parametrize("text", ["", "{", "[]", "7", "null"])
def test_what_is_no_record_hides_no_other(tmp_path: Path, text: str) -> None:
    folder = killed(tmp_path)
    (tmp_path / "runs" / "a").mkdir()
    (tmp_path / "runs" / "a" / "begun.json").write_text(text)
    (tmp_path / "runs" / "2026-11-21T083120.042-part.ngc").mkdir()
    (tmp_path / "runs" / "2026-11-21T083120.042-part.ngc" / "begun.json").write_text(text)
    assert len(settled(tmp_path)) == 2 and settled(tmp_path) == []
    there = {run.facts["record"]: run for run in indexed(tmp_path)}
    assert folder.name in there and "a" in there
    lost = there["2026-11-21T083120.042-part.ngc"]
    assert lost.program == "part.ngc" and lost.result == "lost" and lost.began_s > 1.7e9
    assert (tmp_path / "runs" / lost.facts["record"] / "begun.json.damaged1").read_text() == text


def test_an_end_that_is_damaged_is_written_anew_of_its_row(tmp_path: Path) -> None:
    record = begun(tmp_path, 10)
    facts = record.end("completed")
    assert told(tmp_path).result == "completed"
    file = record.folder / "run.json"
    file.write_bytes(file.read_bytes()[:-9])
    (loss,) = settled(tmp_path)
    assert loss["key"] == "record_damaged" and settled(tmp_path) == []
    assert record_files.facts(record.folder) == facts


def test_a_disk_that_is_full_costs_the_record_and_not_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(file: Path, text: str, *within: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(runs.atomic_file, "write", full)
    record = begun(tmp_path, 10)
    assert record.began and record.end("completed")["result"] == "completed"


@pytest.mark.parametrize("ticks", [0, 10])
def test_what_a_full_disk_took_by_halves_is_no_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ticks: int
) -> None:
    """Rows that it took whole stay, as those of a run that was lost; of a run without any nothing does."""
    record = begun(tmp_path, ticks)

    def full(file: Any, **_: Any) -> None:
        file.write(b"PK")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    record.end("completed")
    left = [file.name for file in record.folder.glob("*")]
    assert "setpoints.npz" not in left and ("setpoints.part" in left) is bool(ticks)
    assert record.folder.exists() is bool(ticks)
    assert all(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file())


def test_a_beginning_that_the_disk_does_not_take_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(file: Path, text: str, *within: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(runs.atomic_file, "write", full)
    assert begun(tmp_path).problem == NO_SPACE


def test_a_run_under_way_is_told_from_one_that_has_ended_by_its_files(tmp_path: Path) -> None:
    record = begun(tmp_path, 10)
    facts = json.loads((record.folder / "begun.json").read_text())
    assert (facts["id"], facts["name"]) == (record.folder.name, "part.ngc")
    record.end("completed")
    assert sorted(file.name for file in record.folder.iterdir()) == [
        "actual.npz",
        "events.jsonl",
        "machine.toml",
        "process.npz",
        "program.ngc",
        "run.json",
        "setpoints.npz",
    ]


def test_what_was_taken_can_be_read_before_anybody_closes_the_files(tmp_path: Path) -> None:
    """So it outlives a kill at any moment; a loss of power once the disk was told."""
    record = begun(tmp_path, 1000)
    for table in runs.TABLES:
        assert len(table.read(record.folder)) == 1000
    record.planned((Turn(500, 0.05),), {})
    lines = (record.folder / "events.jsonl").read_text().splitlines()
    (begin, plan) = [sealed_file.of_line(line, number=number) for number, line in enumerate(lines, 1)]
    assert begin["request"] == "begin" and begin["value"]["machine_sha256"]
    assert plan == {"tick": 501, "at": 501, "request": "plan", "value": 0.05}


def test_the_disk_is_told_of_all_that_was_written_and_not_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    name = lambda handle: Path(os.readlink(f"/proc/self/fd/{handle}")).name  # noqa: E731
    monkeypatch.setattr(os, "fdatasync", lambda handle: told.append(name(handle)))
    record = begun(tmp_path, 0)
    assert told == ["events.jsonl"], "before the start goes out"
    record.take(running(3))
    record.sync()
    record.sync()
    assert told == ["events.jsonl", "setpoints.part", "actual.part", "process.part"]
    record.planned((Turn(1, 0.05),), {})
    record.sync()
    assert told[4:] == ["events.jsonl"]


def test_a_turn_that_is_told_late_is_of_the_tick_that_it_was_made_before(tmp_path: Path) -> None:
    """A long plan is told when it is made; ticks without SYNC are named, missed ones are the next."""
    record = begun(tmp_path)
    rows = running(100)
    rows[:, COLUMN["tick"]] = [n if n < 60 else n + 5 for n in range(100)]
    rows[40:50, COLUMN["sync_sent"]] = 0.0
    for part in np.array_split(rows, 7):
        record.take(part)
    record.planned(tuple(Turn(tick, 0.1) for tick in (20, 43, 61)), {})
    lines = [json.loads(line) for line in (record.folder / "events.jsonl").read_text().splitlines()[1:]]
    assert [(line["tick"], line["at"], line.get("late", False)) for line in lines] == [
        (21, 21, False),
        (40, 44, True),
        (50, 65, False),
    ]


def test_what_a_full_disk_took_in_part_is_the_last_of_a_record(tmp_path: Path) -> None:
    """Room that comes later is not written behind half a row: what there is stays whole."""
    record = begun(tmp_path, 100)
    assert record._file is not None and not record.problem
    growing = record._file._growing[SETPOINTS]
    file = growing.file

    class Short:
        closed = False
        fileno, close = file.fileno, file.close

        def write(self, data: bytes) -> int:
            return int(file.write(data[: len(data) // 2 + 1]))

    growing.file = Short()  # type: ignore[assignment]
    record.take(running(101)[100:])
    assert record.problem == NO_SPACE
    growing.file = file
    record.take(running(200)[101:])
    found = SETPOINTS.read(record.folder)
    assert found is not None and len(found) == 100
