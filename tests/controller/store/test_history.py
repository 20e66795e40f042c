"""Runs and alarms are read where the service writes them, and nowhere else."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from support import older_state
from support.fakes.panels import Scene, sentence
from support.fakes.written_history import WrittenHistory

from controller.api.store import Store
from controller.ipc.control_socket import CommandRefused
from controller.messages import message
from controller.service import older_files, runs
from controller.store import history, service_store
from controller.store.service_store import ServiceStore

RECORD = {"name": "part.ngc", "sha256": "00", "started_s": 1.0, "ended_s": 9.0, "result": "completed"}


@pytest.fixture
def written(tmp_path: Path) -> WrittenHistory:
    return WrittenHistory(tmp_path)


def changed(state: Path, statement: str, *values: object) -> None:
    """By somebody who keeps no sums, as a bad bit."""
    with contextlib.closing(sqlite3.connect(state / service_store.FILE)) as sql:
        sql.execute(statement, values)
        sql.commit()


def test_runs_are_listed_the_latest_first_and_summed(written: WrittenHistory) -> None:
    first, second = written.run("a.ngc", cut_time_s=3.5, record="r1"), written.run("b.ngc", "stopped")
    again = written.run("a.ngc", "stopped", duration_s=2.0)
    with history.reading(written.state) as past:
        assert [(one.id, one.result) for one in past.runs(2)] == [(again, "stopped"), (second, "stopped")]
        assert [one.id for one in past.runs(before=second)] == [first]
        assert [one.id for one in past.runs_since(first)] == [second, again]
        found = past.run(first)
        assert found is not None and found.facts == {"cut_time_s": 3.5, "record": "r1"}
        assert past.run(99) is None
        assert past.sums_of_runs() == {"completed": (1, 0.0, 3.5), "stopped": (2, 2.0, 0.0)}
        last = {name: (run.id, made) for name, (run, made) in past.by_program().items()}
        assert last == {"a.ngc": (again, 1), "b.ngc": (second, 0)}


def test_the_first_acknowledgement_of_an_alarm_counts(written: WrittenHistory) -> None:
    raised, other = written.alarm("FOLLOWING_ERROR", "X lags.", "X"), written.alarm("ESTOP", "Stop.")
    written.acknowledge(raised, "anna")
    written.acknowledge(raised, "ben")
    written.acknowledge(None)
    with history.reading(written.state) as past:
        assert [one.acknowledged_by for one in past.alarms()] == ["at the machine", "anna"]
        assert past.alarms(open_only=True) == [] and past.alarms(before=other)[0].id == raised
        assert past.sums_of_alarms() == {"ESTOP": (1, 0), "FOLLOWING_ERROR": (1, 0)}
    with pytest.raises(CommandRefused):
        written.acknowledge(99, "anna")


@pytest.mark.parametrize("table", ["runs", "alarms"])
def test_a_row_that_is_not_as_it_was_written_is_left_out(written: WrittenHistory, table: str) -> None:
    for name in ("a.ngc", "b.ngc"):
        written.run(name)
        written.alarm(name, "Stop.")
    for facts in ("{cut off", json.dumps({"id": 1, "time_s": 1.0, "name": "other"})):
        changed(written.state, f"UPDATE {table} SET facts = ? WHERE id = 1", facts)
        with history.reading(written.state) as past:
            if table == "runs":
                assert [one.id for one in past.runs()] == [2] and list(past.by_program()) == ["b.ngc"]
                assert past.sums_of_runs()["completed"][0] == 1
            else:
                assert [one.id for one in past.alarms()] == [2] and list(past.sums_of_alarms()) == ["b.ngc"]


def test_what_was_written_as_a_sentence_before_keys_were_is_still_told(tmp_path: Path) -> None:
    """The sentence as it was, in whatever language is asked for."""
    scene = Scene(tmp_path)
    old = {"id": 1, "time_s": 5.0, "name": "ESTOP", "sentence": "X lags.", "cause": "A collision."}
    with scene.history.store.write() as sql:
        sql.execute("INSERT INTO alarms VALUES (1, ?)", (json.dumps(old),))
    scene.history.run("part.ngc", "fault", sentence="The tick was gone.")

    async def story() -> tuple[Any, Any]:
        async with scene.client() as client:
            client.headers["Accept-Language"] = "de"
            alarms = (await client.get("/api/v1/alarms")).json()["alarms"]
            return alarms, (await client.get("/api/v1/runs/1")).json()

    ((alarm,), run) = asyncio.run(story())
    assert (alarm["sentence"], alarm["key"], alarm["facts"]) == ("X lags.", None, {"cause": "A collision."})
    assert run["facts"]["sentence"] == "The tick was gone."


def test_of_a_service_that_is_gone_the_panel_reads_nothing_and_says_so(tmp_path: Path) -> None:
    """Its own it has as before."""
    scene = Scene(tmp_path)
    scene.history.run("part.ngc")
    scene.history.alarm("ESTOP", "Stop.")
    with scene.store.uploads.begin("part.ngc") as upload:
        upload.write(b"M2\n")
        upload.commit()
    asked = ("alarms", "runs", "runs/1", "runs/1/report", "statistics/runs", "runs/1/files/run.json")

    async def story() -> None:
        async with scene.client() as client:
            (known,) = (await client.get("/api/v1/programs")).json()["programs"]
            assert known["completed"] == 1 and known["last_run"]["result"] == "completed"
            assert (await client.post("/api/v1/alarms/2/acknowledge")).status_code == 404
            scene.door.there, scene.panel.watch._fresh_to_s = False, -1e9
            for path in asked:
                answer = await client.get(f"/api/v1/{path}")
                assert answer.status_code == 503 and "service" in sentence(answer), path
            answer = await client.post("/api/v1/alarms/1/acknowledge")
            assert answer.status_code == 503 and scene.history.alarms()[0].acknowledged_s is None
            (known,) = (await client.get("/api/v1/programs")).json()["programs"]
            assert known["completed"] is known["last_run"] is None

    asyncio.run(story())


def test_what_the_panels_own_store_has_lost_becomes_an_alarm_when_the_service_is_there(
    tmp_path: Path,
) -> None:
    scene, lost = Scene(tmp_path), message("store_lost", file="store.sqlite", aside="store.sqlite.damaged1")
    scene.store.report(lost)
    scene.store.report(lost)
    scene.door.there = False

    async def story() -> None:
        async with scene.panel.running():
            await asyncio.sleep(0.05)
            assert scene.store.losses == [lost]
            scene.door.there = True
            while scene.store.losses:
                await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(story(), 20.0))
    assert [args for verb, args in scene.door.asked if verb == "panel_damaged"] == [lost]


# -- what the index is made of


def write_end(state: Path, name: str, text: str) -> None:
    folder = state / "runs" / name
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(text)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"started_s": "x"}', '{"name": 1}'])
def test_records_that_have_no_row_are_given_one_and_what_is_no_record_is_left_out(
    tmp_path: Path, text: str
) -> None:
    write_end(tmp_path, "r1", json.dumps(RECORD, indent=1))
    write_end(tmp_path, "r2", text)
    written = WrittenHistory(tmp_path)
    for _ in range(2):
        runs.index(written.store, tmp_path)
        (run,) = written.runs()
        assert (run.program, run.result, run.ended_s) == ("part.ngc", "completed", 9.0)
        assert run.facts == {"record": "r1"}


FACTS = json.dumps({"cut_time_s": 3.0, "record": "gone", "as_cut": {"gouges": 0}, "kept": True})
COPIES = (  # of a run whose record has gone, one that had no end, and an alarm that somebody has seen
    f"INSERT INTO runs VALUES (7, 'old.ngc', '00', 1.0, 2.0, 'fault', '{FACTS}', 'gone')",
    "INSERT INTO runs VALUES (8, 'open.ngc', '00', 1.0, NULL, 'running', '{}', 'open')",
    "INSERT INTO settings VALUES ('language', '\"de\"', 1.0, 'anna')",
    "INSERT INTO alarms VALUES (3, 5.5, 'ESTOP', '', '', '{}', 6.5, 'anna', '1 5.5')",
)


@pytest.mark.parametrize("version", [5, 6])
@pytest.mark.parametrize("first", ["panel", "service"])
def test_what_a_panel_has_kept_of_runs_and_alarms_is_taken_over_once(
    tmp_path: Path, version: int, first: str
) -> None:
    """Whichever of them starts first; the panel has its verdicts on."""
    older_state.panel_store(tmp_path if version == 5 else tmp_path / "panel", version, *COPIES)
    service = ServiceStore(tmp_path)
    with service.write() as sql:
        alarm = {"id": 1, "time_s": 5.5, "name": "ESTOP", "acknowledged_s": None}
        sql.execute("INSERT INTO alarms VALUES (1, ?)", (json.dumps(alarm),))
    for turn in range(2):
        for who in (first, "service", "panel"):
            if who == "panel":
                with contextlib.closing(Store(tmp_path)) as store:
                    assert store.verdicts.get("gone") == {"gouges": 0}
                    assert store.settings.all() == {"language": "de"}
                    names = {row[0] for row in store.database.rows("SELECT name FROM sqlite_master")}
                    assert not {"offsets", "tools", "runs", "alarms"} & names
            else:
                older_files.take_over(service, tmp_path)
        with history.reading(tmp_path) as past:
            (run,), (seen,) = past.runs(), past.alarms()
        assert (run.id, run.program, run.result) == (7, "old.ngc", "fault")
        assert run.facts == {"cut_time_s": 3.0, "record": "gone"}
        assert (seen.acknowledged_s, seen.acknowledged_by) == (6.5, "anna")
        if turn == 0:  # what is put there later counts no more
            forged = older_state.panel_store(tmp_path / "forged", 6, COPIES[0].replace("(7", "(9"))
            forged.rename(tmp_path / "panel" / "store.schema9.sqlite")
    assert (tmp_path / "panel" / f"store.schema{version}.sqlite").exists()
