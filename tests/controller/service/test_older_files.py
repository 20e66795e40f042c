"""What versions before kept in files of their own is in the store, once; what is lost of it is reported."""

from __future__ import annotations

import contextlib
import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import served
from support.machines.stored_tools import StoredTools

from controller import own_database, sealed_file, sealed_rows
from controller.service import older_files
from controller.service.thread_guard import UNKNOWN, InThread
from controller.store import set_up_store, tool_store
from controller.store.service_store import ServiceStore, document_of
from controller.store.tool_store import Step, ToolStore

ALARM = {"id": 1, "time_s": 1000.5, "name": "ESTOP", "key": "stopped", "values": {}, "acknowledged_s": None}
BORE = {"at_s": 1.0, "program": "a.ngc", "cycle": "bore", "values": {"x_mm": -0.25}}
USED = {
    "travel": {"X": 3.5},
    "hours": {"motion": 0.25},
    "tools": {"2": {"cut_s": 60.0, "most_parts": 7}},
    "items": {"oil": {"counter": "motion", "every": 10.0}},
}


def write(state: Path, *alarms: dict[str, Any]) -> None:
    state.mkdir(exist_ok=True)
    sealed_file.write(state / "usage.json", USED)
    sealed_file.write(state / "probed.json", [BORE])
    sealed_file.write(state / "durations.json", {"Grip": [0.8, 0.9]})
    (state / "alarms.jsonl").write_text("".join(sealed_file.line(one) for one in alarms or (ALARM,)))


def of(service: Any) -> tuple[Any, ...]:
    used = service.usage.to_json()
    motion = next(one["value"] for one in used["counters"] if one["name"] == "motion")
    return (
        service.alarms.list(),
        service.probed.to_json(),
        used["tools"][0]["cut_s"],
        used["items"][0],
        motion,
    )


def test_a_folder_of_before_opens_with_all_of_it_and_then_without_its_files(tmp_path: Path) -> None:
    state = tmp_path / "state"
    write(state, ALARM, {**ALARM, "id": 2}, {**ALARM, "acknowledged_s": 1003.0})
    service = served(tmp_path)
    alarms, probed, cut_s, item, motion = found = of(service)
    assert [(one["id"], one["acknowledged_s"]) for one in alarms] == [(2, None), (1, 1003.0)]
    assert document_of(state, "durations") == {"Grip": [0.8, 0.9]}
    assert probed == [BORE] and (cut_s, item["name"], motion) == (60.0, "oil", 0.25)
    service.close()
    names = {path.name for path in state.iterdir()}
    assert {"usage.json.older", "probed.json.older", "alarms.jsonl.older"} <= names
    assert not {"usage.json", "probed.json", "alarms.jsonl"} & names
    service = served(tmp_path)
    assert of(service) == found
    service.close()


def test_a_file_of_before_that_comes_again_is_not_taken_again(tmp_path: Path) -> None:
    write(tmp_path)
    store = ServiceStore(tmp_path)
    assert older_files.take_over(store, tmp_path) == []
    store.put("usage", {**USED, "hours": {"motion": 9.0}})
    write(tmp_path, {**ALARM, "id": 7})
    assert older_files.take_over(store, tmp_path) == []
    assert store.document("usage", lambda found: found, None)["hours"] == {"motion": 9.0}
    assert store.rows("SELECT id FROM alarms") == [(1,)] and not (tmp_path / "usage.json").exists()


def test_touches_of_each_version_before_are_taken_over(tmp_path: Path) -> None:
    lines = ["line,X", "5,1.0"]
    for name in ("touches.csv", "touches.json"):
        state = tmp_path / name
        state.mkdir()
        if name == "touches.csv":
            (state / name).write_text("line,X\n5,1.0\n")
        else:
            sealed_file.write(state / name, lines)
        store = ServiceStore(state)
        assert older_files.take_over(store, state) == [] and document_of(state, "touches") == lines
        assert (state / f"{name}.older").exists() and not (state / name).exists()


@pytest.mark.parametrize("text", ["", "[]", '{"travel": 1}', '{"travel": {"X": 1e999}, "hours": {}}', "\x00"])
@pytest.mark.parametrize("name", ["usage.json", "probed.json"])
def test_a_file_of_before_that_is_not_sound_is_put_aside_and_reported(
    tmp_path: Path, name: str, text: str
) -> None:
    if name == "probed.json" and text == "[]":
        text = "[1, null]"
    (tmp_path / name).write_text(text)
    store = ServiceStore(tmp_path)
    (loss,) = older_files.take_over(store, tmp_path)
    assert loss["key"] == "file_damaged" and (tmp_path / f"{name}.damaged1").read_text() == text
    assert not store.has(name.removesuffix(".json")) and older_files.take_over(store, tmp_path) == []


def test_an_alarm_of_before_that_cannot_be_read_costs_no_other(tmp_path: Path) -> None:
    whole = json.dumps(ALARM).encode() + b"\n"
    for text, lost in ((whole + b'{"id": 8, "ti', False), (b'{"id": 7, \xfe}\n' + whole, True)):
        (tmp_path / "alarms.jsonl").write_bytes(text)
        found, loss = older_files.alarms(tmp_path / "alarms.jsonl")
        assert found == [ALARM] and (loss is not None) is lost


def test_no_flip_of_a_bit_changes_what_an_alarm_of_before_says(tmp_path: Path) -> None:
    write(tmp_path)
    sealed_file.mark(tmp_path, ["alarms.jsonl"])
    file = tmp_path / "alarms.jsonl"
    whole = file.read_bytes()
    for at in range(8 * len(whole)):
        flipped = bytearray(whole)
        flipped[at // 8] ^= 1 << at % 8
        file.write_bytes(flipped)
        found, loss = older_files.alarms(file)
        assert loss is not None or found == [ALARM], bytes(flipped)


def write_tools(state: Path, sql_more: str = "") -> None:
    """As a version before has left where the tools are, in the middle of a change."""
    with contextlib.closing(own_database.opened(state / "tools.db")) as sql:
        sql.executescript(
            """
            CREATE TABLE place (tool INTEGER PRIMARY KEY, pocket INTEGER NOT NULL);
            CREATE TABLE known (id INTEGER PRIMARY KEY CHECK (id = 1), time_s REAL NOT NULL);
            CREATE TABLE change (
                id INTEGER PRIMARY KEY CHECK (id = 1), tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL,
                step INTEGER NOT NULL, name TEXT NOT NULL, carries INTEGER NOT NULL,
                goes_to INTEGER NOT NULL);
            CREATE TABLE preparation (
                id INTEGER PRIMARY KEY CHECK (id = 1), tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL,
                step INTEGER NOT NULL, name TEXT NOT NULL);
            CREATE TABLE log (
                id INTEGER PRIMARY KEY AUTOINCREMENT, time_s REAL NOT NULL, what TEXT NOT NULL,
                tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL, step INTEGER NOT NULL,
                name TEXT NOT NULL);
            INSERT INTO place VALUES (1, 1), (2, 0), (3, -1);
            INSERT INTO known VALUES (1, 1.5);
            INSERT INTO change VALUES (1, 2, 1, 4, 'Let it go', 2, 2);
            INSERT INTO log VALUES (7, 1.5, 'begun', 2, 1, 4, 'Let it go');
            """
        )
        sealed_rows.seal(sql)
    with contextlib.closing(sqlite3.connect(state / "tools.db")) as sql:  # which keeps no sums, as a bad bit
        sql.executescript(sql_more)


STEP = Step(2, 1, 4, "Let it go", 2, 2)
PLACES = {1: 1, 2: 0, 3: -1}


def test_where_the_tools_were_and_the_change_under_way_are_known_as_before(tmp_path: Path) -> None:
    write_tools(tmp_path)
    assert tool_store.saved_rows(tmp_path)["places"] == [list(row) for row in PLACES.items()], (
        "for a back-up, too"
    )
    for _ in range(2):
        with contextlib.closing(StoredTools(tmp_path)) as tools:
            assert older_files.take_over(tools.kept, tmp_path) == []
            tools = ToolStore(tools.kept)
            assert (tools.known, tools.spindle, tools.places, tools.step) == (True, 2, PLACES, STEP)
            assert tools.log() == [(1.5, "begun", 2, 1, 4, "Let it go")]
        assert {"tools.db.older"} == {path.name for path in tmp_path.glob("tools.db*")}


def test_after_a_bad_bit_in_where_the_tools_were_somebody_must_look(tmp_path: Path) -> None:
    write_tools(tmp_path, "UPDATE place SET pocket = 3 WHERE tool = 3")
    store = ServiceStore(tmp_path)
    (loss,) = older_files.take_over(store, tmp_path)
    assert loss["key"] == "store_damaged" and loss["values"]["what"] == "place 1"
    assert not ToolStore(store).known and (tmp_path / loss["values"]["aside"]).exists()
    assert older_files.take_over(store, tmp_path) == []


@pytest.mark.parametrize("more", [None, "UPDATE place SET pocket = 'here'", "DROP TABLE place"])
def test_what_is_no_place_of_a_tool_is_put_aside(tmp_path: Path, more: str | None) -> None:
    if more is None:
        (tmp_path / "tools.db").write_bytes(b"no store" * 1000)
    else:
        write_tools(tmp_path, more.replace("'here'", "1e300"))
    store = ServiceStore(tmp_path)
    (loss,) = older_files.take_over(store, tmp_path)
    assert loss["key"] == "file_damaged" and (tmp_path / "tools.db.damaged1").exists()
    assert not ToolStore(store).known and ToolStore(store).places == {}


FITTED = {"offsets": {"G55": {"origin_mm": [1.0, 2.0, 3.0]}}}
TAPPED = {"turns": 7.4, "pitch_mm": 1.0, "line": 12, "program": "plate.ngc"}


def write_set_up(state: Path, *, sound: bool = True) -> None:
    """What was set up; without ``sound`` each of it is damaged."""
    state.mkdir(exist_ok=True)
    sealed_file.write(state / "fitting.json", {**FITTED, "parameters": {"500": 2.0}})
    sealed_file.write(state / "in_spindle", 2)
    sealed_file.write(state / "thread.json", TAPPED)
    for name in () if sound else ("fitting.json", "in_spindle", "thread.json"):
        (state / name).write_bytes((state / name).read_bytes()[:-9])


def test_what_was_set_up_and_a_tool_in_a_thread_are_known_as_before(tmp_path: Path) -> None:
    state = tmp_path / "state"
    write_set_up(state)
    assert set_up_store.load(state)["parameters"] == {"500": 2.0}, "also before a service has taken it over"
    for _ in range(2):
        service = served(tmp_path)
        assert service.set_up.fitted == {**FITTED, "parameters": {"500": 2.0}} == set_up_store.load(state)
        assert service.set_up.tool == 2 and service.thread.found == InThread(*TAPPED.values())
        assert service.alarms.list() == []
        service.close()
    assert not {"fitting.json", "in_spindle", "thread.json"} & {path.name for path in state.iterdir()}


def test_of_what_was_set_up_nothing_damaged_counts_and_the_operator_must_confirm(tmp_path: Path) -> None:
    state = tmp_path / "state"
    write_set_up(state, sound=False)
    service = served(tmp_path)
    assert service.set_up.fitted == {}
    assert service.set_up.tool == 0 and service.thread.found == UNKNOWN
    assert [alarm["key"] for alarm in service.alarms.list()] == ["file_damaged"] * 3
    service.close()
