"""What the service wrote becomes rows, once, whatever the files look like."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from support.fakes.panels import Scene

from controller.api.service_sync import Gatherer
from controller.api.store import Store
from controller.store.service_store import FILE, ServiceStore

ALARM = {
    "id": 1,
    "time_s": 1000.5,
    "name": "FOLLOWING_ERROR",
    "axis": "X",
    "key": "of_axis",
    "values": {"axis": "X", "text": "It lags."},
    "acknowledged_s": None,
}
RUN = {
    "id": "r1",
    "name": "part.ngc",
    "sha256": "00",
    "started_s": 1.0,
    "ended_s": 9.0,
    "result": "completed",
    "cut_time_s": 3.0,
    "following_error": {"X": 0.1},
}


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path)


def write_run(store: Store, name: str, text: str) -> None:
    folder = store.folder / "runs" / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "run.json").write_text(text)


def tell(store: Store, *alarms: dict[str, Any]) -> None:
    """The service adds alarms, or has them say something else."""
    with contextlib.closing(ServiceStore(store.folder)) as kept, kept.write() as sql:
        for one in alarms:
            sql.execute("INSERT OR REPLACE INTO alarms VALUES (?, ?)", (one["id"], json.dumps(one)))


def test_alarms_are_taken_in_once_and_completed_by_later_lines(store: Store) -> None:
    gatherer = Gatherer(store.database, store.folder)
    assert not gatherer.gather()
    tell(store, ALARM)
    assert gatherer.gather() and not gatherer.gather()
    tell(store, {**ALARM, "recording": "x.npz"})
    assert gatherer.gather()
    [alarm] = store.alarms.list()
    assert (alarm.at_s, alarm.name, alarm.axis, alarm.key) == (1000.5, "FOLLOWING_ERROR", "X", "of_axis")
    assert alarm.values == ALARM["values"] and alarm.facts == {"recording": "x.npz", "number": 1}
    assert Gatherer(store.database, store.folder).gather()
    assert len(store.alarms.list()) == 1


def test_an_alarm_that_is_not_as_it_was_written_is_not_taken_in_and_the_others_are(store: Store) -> None:
    tell(store, ALARM)
    with contextlib.closing(sqlite3.connect(store.folder / FILE)) as sql:  # which keeps no sums, as a bad bit
        sql.execute("INSERT INTO alarms VALUES (7, '{cut off')")
        sql.execute("INSERT INTO alarms VALUES (8, ?)", (json.dumps({**ALARM, "id": 8}),))
        sql.commit()
    gatherer = Gatherer(store.database, store.folder)
    assert gatherer.gather() and not gatherer.gather()
    assert [alarm.facts["number"] for alarm in store.alarms.list()] == [1]


def test_what_was_kept_as_a_sentence_before_keys_were_is_still_told(tmp_path: Path) -> None:
    """Of the machine's file, and of rows of the store: the sentence as it was, whatever is asked for."""
    scene = Scene(tmp_path)
    old = {name: value for name, value in ALARM.items() if name not in ("key", "values")}
    tell(scene.store, {**old, "sentence": "X lags.", "cause": "A collision."}, {**ALARM, "id": 2})
    run = scene.store.runs.begin("part.ngc", "0" * 64)
    scene.store.runs.end(run, "fault", sentence="The tick was gone.")

    async def story() -> tuple[Any, Any]:
        async with scene.client() as client:
            client.headers["Accept-Language"] = "de"
            alarms = (await client.get("/api/v1/alarms")).json()["alarms"]
            return alarms, (await client.get("/api/v1/runs/1")).json()

    (new, kept), told = asyncio.run(story())
    assert (kept["sentence"], kept["key"], kept["facts"]["cause"]) == ("X lags.", None, "A collision.")
    assert new["sentence"].startswith("Achse X: ") and new["key"] == "of_axis"
    assert told["facts"]["sentence"] == "The tick was gone."


def test_an_acknowledgement_of_either_side_counts_and_is_not_undone(store: Store) -> None:
    tell(store, ALARM, {**ALARM, "id": 2})
    gatherer = Gatherer(store.database, store.folder)
    gatherer.gather()
    store.alarms.acknowledge(1, "anna")
    tell(store, {**ALARM, "acknowledged_s": 1003.0}, {**ALARM, "id": 2, "acknowledged_s": 1004.0})
    gatherer.gather()
    assert [(a.id, a.acknowledged_by) for a in store.alarms.list()] == [(2, "at the machine"), (1, "anna")]


def test_runs_are_taken_in_when_they_have_ended(store: Store) -> None:
    (store.folder / "runs" / "under way").mkdir(parents=True)
    write_run(store, "r1", json.dumps(RUN, indent=1))
    gatherer = Gatherer(store.database, store.folder)
    assert gatherer.gather() and not gatherer.gather()
    [run] = store.runs.list()
    assert (run.program, run.result, run.ended_s) == ("part.ngc", "completed", 9.0)
    assert run.facts == {"cut_time_s": 3.0, "following_error": {"X": 0.1}, "record": "r1"}
    assert not Gatherer(store.database, store.folder).gather()


def test_a_record_that_could_not_be_read_at_first_is_listed_later(store: Store) -> None:
    write_run(store, "r", "{")
    gatherer = Gatherer(store.database, store.folder)
    assert not gatherer.gather()
    write_run(store, "r", json.dumps(RUN, indent=1))
    assert gatherer.gather() and len(store.runs.list()) == 1


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"started_s": "x"}', '{"name": 1}'])
def test_files_that_are_no_records_are_left_out(store: Store, text: str) -> None:
    write_run(store, "r", text)
    Gatherer(store.database, store.folder).gather()
    assert store.runs.list() == []
