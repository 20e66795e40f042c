"""A budget of bytes for records: which go, which stay, and that the run under way is never one that goes."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from support.fakes.fake_engine import FakeEngine, done
from support.machines.stepped_runs import shipped

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, ROW
from controller.machine.records_table import Records
from controller.messages import text
from controller.runtime import recording
from controller.runtime.plan_messages import Program
from controller.runtime.starts import Start
from controller.service import room, run_file
from controller.service.command_handlers import CommandHandlers
from controller.service.folders import Folders
from controller.service.room import Room
from controller.service.runs import RunRecord
from controller.service.service import Service
from controller.state import record_files, setpoints
from controller.state.modes import Mode

EACH = 100_000  # bytes of a record
GB = 1e9


class Disk(NamedTuple):
    total: int
    used: int
    free: int


def record(folder: Path, name: str, size: int = EACH) -> Path:
    made = folder / name
    made.mkdir(parents=True)
    (made / "setpoints.npz").write_bytes(os.urandom(size))
    return made


def of(state: Path, most_bytes: float, share: float = 0.95) -> Room:
    return Room(Folders.within(state), replace(shipped(), records=Records(most_bytes / GB, share)))


@pytest.fixture
def state(tmp_path: Path) -> Path:
    """Four runs and a fault between them, each of EACH bytes and what a file system adds."""
    for n in (1, 2, 4, 5):
        record(tmp_path / "runs", f"2026-11-2{n}T080000.000-part.ngc")
    record(tmp_path / "recordings", "2026-11-23T080000-FOLLOWING_ERROR-Z")
    return tmp_path


def days(state: Path) -> list[int]:
    return sorted(int(one.name[9]) for kind in ("runs", "recordings") for one in (state / kind).iterdir())


def test_beyond_the_budget_the_oldest_of_runs_and_faults_go_and_no_more_than_needed(state: Path) -> None:
    assert of(state, 6 * EACH).make() and days(state) == [1, 2, 3, 4, 5]
    assert of(state, 2.5 * EACH).make() and days(state) == [4, 5]


def test_what_is_kept_or_under_way_stays_and_others_go_in_its_place(state: Path) -> None:
    (state / "runs" / "2026-11-22T080000.000-part.ngc" / "begun.json").write_text("{}")
    (state / "recordings" / "2026-11-23T080000-FOLLOWING_ERROR-Z" / "kept").touch()
    assert of(state, 2.5 * EACH).make() and days(state) == [2, 3, 5]
    assert of(state, 0.5 * EACH).make() and days(state) == [2, 3, 5]
    (state / "runs" / "2026-11-22T080000.000-part.ngc" / "run.json").write_text("{}")
    assert of(state, 0.5 * EACH).make() and days(state) == [3, 5]
    recording.forget_oldest(state / "recordings", 0)
    assert days(state) == [3, 5]


def test_the_budget_is_a_share_of_the_disk_where_that_is_less(
    state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Disk(10 * EACH, 0, 1 << 40))
    assert of(state, 6 * EACH, share=0.25).make() and days(state) == [4, 5]


def test_a_disk_that_others_have_filled_is_told_once_nothing_more_can_go(
    state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Disk(1 << 40, 0, room.SPARE_BYTES - 1))
    (state / "runs" / "2026-11-24T080000.000-part.ngc" / "kept").touch()
    assert not of(state, 6 * EACH).make() and days(state) == [4, 5]


def test_a_file_that_runs_share_counts_for_each_its_part(state: Path) -> None:
    """A program that is run again and again takes its room once."""
    first, *others = sorted((state / "runs").iterdir())
    (first / "program.ngc").write_bytes(os.urandom(4 * EACH))
    for one in others:
        os.link(first / "program.ngc", one / "program.ngc")
    assert of(state, 10 * EACH).make() and days(state) == [1, 2, 3, 4, 5]


def test_a_day_at_half_a_millisecond_fits_the_budget_whatever_the_axes_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Disk(1 << 36, 0, 1 << 36))
    told = Room(Folders.within(tmp_path), shipped(period_s=0.0005)).facts()
    assert told["budget_bytes"] == 16 * GB and told["hours"] is not None and told["hours"] > 24.0
    assert told["budget_bytes"] >= room.ROW_BYTES * 24 * 3600 / 0.0005


# -- the run under way


def begun(state: Path) -> RunRecord:
    machine = shipped()
    made = RunRecord(state, machine, {"name": "part.ngc", "sha256": "00"})
    made.begins(Start((0.0, 0.0, 0.0, 0.0, 0.0), 0.0), Program(b"M2\n", "part.ngc", machine), {})
    return made


def running(ticks: range) -> np.ndarray:
    rows = np.zeros((len(ticks), len(ROW)))
    rows[:, COLUMN["tick"]] = ticks
    rows[:, COLUMN["mode"]], rows[:, COLUMN["sync_sent"]] = Mode.RUNNING, 1.0
    for name in ("override", "rapid_override", "adaptive_share"):
        rows[:, COLUMN[name]] = 1.0
    rows[:, COLUMN["setpoint_0"]] = ticks
    return rows


def test_no_length_ends_a_record_and_a_disk_that_takes_no_packed_segment_costs_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(setpoints, "SEGMENT_BYTES", 10 * setpoints.SETPOINTS.row_bytes)
    made = begun(tmp_path)
    real, full = np.savez_compressed, [True]

    def save(*args: object, **more: object) -> None:
        if full[0]:
            raise OSError(28, "No space left on device")
        real(*args, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(np, "savez_compressed", save)
    for n in range(0, 95, 5):
        made.take(running(range(n, n + 5)))
        made.pack()
        full[0] = n < 50
    assert not made.problem and not list(made.folder.glob("*.new"))
    found = setpoints.SETPOINTS.read(made.folder)
    assert found is not None and found[:, 0].tolist() == list(range(95))
    full[0] = True
    facts = made.end("completed")
    assert facts["ticks"] == 95 and record_files.facts(made.folder)["result"] == "completed"
    again = setpoints.SETPOINTS.read(made.folder)
    assert again is not None and np.array_equal(again, found)


def test_where_no_next_segment_can_be_begun_the_record_ends_with_what_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(setpoints, "SEGMENT_BYTES", 10 * setpoints.SETPOINTS.row_bytes)
    made = begun(tmp_path)
    made.take(running(range(5)))

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run_file.own_files, "new", full)
    made.take(running(range(5, 25)))
    assert "No space left" in text(made.problem)
    found = setpoints.SETPOINTS.read(made.folder)
    assert found is not None and found[:, 0].tolist() == list(range(10))


def test_a_disk_that_fills_up_ends_the_record_in_time_and_says_so_once(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While there is room for alarms and the journal; until then older records go in its place."""
    monkeypatch.setattr(setpoints, "SEGMENT_BYTES", 10 * setpoints.SETPOINTS.row_bytes)
    record(service.state / "runs", "2026-11-21T080000.000-part.ngc")
    recorder = service.run.recorder
    recorder.record = made = begun(service.state)
    packed = lambda: len(list(made.folder.glob("*.npz")))  # noqa: E731
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Disk(1 << 40, 0, room.SPARE_BYTES - (packed() > 2)))
    for n in range(0, 60, 12):
        recorder.take(running(range(n, n + 12)), service.engine, None)
        service.writer.submit(lambda: None).result()
    assert [one.name for one in (service.state / "runs").iterdir()] == [made.folder.name]
    (alarm,) = service.alarms.list()
    assert alarm["name"] == "NOT_RECORDED" and "less than 64 MB are free on the disk" in text(alarm)
    found = setpoints.SETPOINTS.read(made.folder)
    assert found is not None and found[:, 0].tolist() == list(range(len(found))) and 12 <= len(found) < 60
    recorder.record = None


# -- what an operator keeps


def test_an_operator_keeps_a_run_by_its_name_and_lets_it_go(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    name = "2026-11-21T080000.000-part.ngc"
    record(service.state / "runs", name)
    assert done(desk, "keep_run", record=name, on=True) == {"kept": True}
    assert (service.state / "runs" / name / "kept").exists()
    assert done(desk, "keep_run", record=name, on=False) == {"kept": False}
    assert not (service.state / "runs" / name / "kept").exists()
    for other in ("2026-11-22T080000.000-part.ngc", "../runs", ".."):
        with pytest.raises(CommandRefused, match="there is no such record any more"):
            done(desk, "keep_run", record=other, on=True)
