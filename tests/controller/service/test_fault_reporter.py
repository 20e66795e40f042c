"""Every row of the fault table is told once, with the last ten seconds of every tick."""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN, ROW, Recorder, Snapshot, blank
from controller.runtime.recording import CAUSE_S, KEPT_S, STOP_S, Keeper
from controller.service.alarms import Alarms
from controller.service.fault_reporter import Troubles
from controller.state.modes import FAULTS, Fault, Mode, Reaction
from controller.store.service_store import ServiceStore

MACHINE = shipped()
IDLE = blank()
BEFORE = round(KEPT_S / MACHINE.period_s)
SETTLED = round((CAUSE_S + 0.1) / MACHINE.period_s)
LONG = round((STOP_S + 0.1) / MACHINE.period_s)


class _Writer(Executor):
    """Writes when a test says so."""

    def __init__(self) -> None:
        self._waiting: list[Callable[[], None]] = []

    def submit(self, work: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        promise: Future[Any] = Future()

        def done() -> None:
            try:
                promise.set_result(work(*args, **more))
            except OSError as error:
                promise.set_exception(error)

        self._waiting.append(done)
        return promise

    def write(self) -> None:
        while self._waiting:
            self._waiting.pop(0)()


class Site:
    """Troubles that look at a machine ten seconds after its start; a test moves it on."""

    def __init__(self, folder: Path, recordings: Path | None = None) -> None:
        self.alarms, self.recorder, self.writer = (
            Alarms(ServiceStore(folder)),
            Recorder(rows=16384),
            _Writer(),
        )
        self.troubles = Troubles(MACHINE, self.alarms, self.writer)
        self.troubles.record_by(Keeper(MACHINE, self.recorder, {}, recordings or folder / "recordings"))
        self.now = IDLE._replace(tick=0, mode=Mode.RUNNING, fault_axis=-1)
        self.looks(BEFORE)

    def looks(self, ticks: int = 1, **changes: Any) -> None:
        """So many ticks with the snapshot as it is changed, and a look at the last one."""
        self.now = self.now._replace(**changes)
        for _ in range(ticks):
            self.now = self.now._replace(tick=self.now.tick + 1)
            self.recorder.write(_row(self.now))
        self.troubles.look(self.now)

    def written(self) -> None:
        self.writer.write()
        self.looks()

    def alarm(self) -> dict[str, Any]:
        (alarm,) = self.alarms.list()
        return alarm


def _row(now: Snapshot) -> list[float]:
    row = [0.0] * len(ROW)
    row[COLUMN["tick"]], row[COLUMN["fault"]], row[COLUMN["mode"]] = now.tick, now.fault, now.mode
    return row


def told_by_the_tick(fault: Fault) -> dict[str, Any]:
    """How a snapshot tells a fault that comes in a run (rule 4 of ``state``)."""
    reaction = FAULTS[fault].reaction
    if reaction is Reaction.WARN:
        return {"warning": fault}
    stops = reaction > Reaction.HOLD
    return {"fault": fault, "mode": Mode.FAULT if stops else Mode.HOLD, "at_rest": True}


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault is not Fault.NONE])
def test_every_fault_leaves_its_last_ten_seconds(site: Site, fault: Fault) -> None:
    site.looks(**told_by_the_tick(fault))
    assert site.alarm()["name"] == fault.name, "told at once"
    site.looks(SETTLED)
    site.written()
    folder = Path(site.alarm()["recording"])
    assert json.loads((folder / "fault.json").read_text())["fault"] == fault.name
    with np.load(folder / "trace.npz") as file:
        ticks = file["rows"][:, COLUMN["tick"]]
    assert ticks[0] <= 1 and BEFORE + 1 in ticks


def test_the_fault_that_is_shown_has_number_and_time_of_its_alarm(site: Site) -> None:
    site.looks(**told_by_the_tick(Fault.FOLLOWING_ERROR))
    alarm, shown = site.alarm(), site.troubles.shown
    assert shown is not None
    assert (shown["number"], shown["time_s"]) == (alarm["id"], alarm["time_s"])


def test_a_hold_shows_its_recording_and_goes_on_without_it(site: Site) -> None:
    site.looks(fault=Fault.DOOR_OPEN, mode=Mode.HOLD, at_rest=True)
    site.looks(SETTLED)
    site.written()
    assert site.troubles.shown and site.troubles.shown["recording"] == site.alarm()["recording"]
    site.looks(fault=Fault.NONE, mode=Mode.RUNNING, at_rest=False)
    assert site.troubles.shown is None
    site.looks(LONG)
    site.written()
    assert len(list((Path(site.alarm()["recording"]).parent).iterdir())) == 1


def test_a_hold_that_was_resumed_at_once_is_recorded_all_the_same(site: Site) -> None:
    site.looks(fault=Fault.DOOR_OPEN, mode=Mode.HOLD, at_rest=True)
    site.looks(fault=Fault.NONE, mode=Mode.RUNNING, at_rest=False)
    site.looks(LONG)
    site.written()
    assert site.alarm()["recording"].endswith("-DOOR_OPEN")


def test_a_machine_that_runs_on_does_not_wait_for_the_writing(site: Site) -> None:
    site.looks(warning=Fault.DRIVE_WARNING)
    site.looks(SETTLED)
    assert site.alarm().get("recording") is None
    site.written()
    assert site.alarm()["recording"]


def test_a_hold_that_becomes_a_fault_shares_its_recording(site: Site) -> None:
    site.looks(fault=Fault.DOOR_OPEN, mode=Mode.HOLD)
    site.looks(fault=Fault.FOLLOWING_ERROR, mode=Mode.FAULT, fault_axis=1, at_rest=True)
    site.looks(SETTLED)
    later, first = site.alarms.list()
    assert (first["name"], later["name"]) == ("DOOR_OPEN", "FOLLOWING_ERROR")
    assert first["recording"] == later["recording"] and later["recording"].endswith("-FOLLOWING_ERROR-Y")


def test_a_plan_that_died_at_rest_and_a_tick_that_died_leave_recordings(site: Site) -> None:
    site.looks(mode=Mode.READY, at_rest=True)
    site.troubles.planner_gone(site.now, "It was killed.")
    site.looks(SETTLED)
    site.written()
    assert site.alarm()["recording"].endswith("-PLANNER_GONE")
    site.troubles.tick_gone(site.now, "It was killed.")
    assert site.troubles.shown and site.troubles.shown["recording"] == site.alarms.list()[0]["recording"]
    assert site.alarms.list()[0]["recording"].endswith("-CONTROLLER_GONE")


def test_a_new_tick_has_no_fault_until_it_tells_one(site: Site) -> None:
    site.troubles.tick_gone(site.now, "It was killed.")
    site.troubles.begin()
    assert site.troubles.shown is None
    site.looks(fault=Fault.EMERGENCY_STOP, mode=Mode.FAULT, at_rest=True)
    assert site.troubles.shown and site.troubles.shown["number"] == site.alarms.list()[0]["id"]


@pytest.mark.parametrize("fault", [Fault.DOOR_OPEN, Fault.DRIVE_WARNING, Fault.FOLLOWING_ERROR])
def test_a_recording_that_cannot_be_written_stops_nothing(tmp_path: Path, fault: Fault) -> None:
    (tmp_path / "file").write_text("")
    site = Site(tmp_path, tmp_path / "file")
    site.looks(**told_by_the_tick(fault))
    site.looks(LONG)
    site.written()
    assert site.alarm()["name"] == fault.name and site.alarm()["recording"] is None
