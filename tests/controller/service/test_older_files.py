"""What versions before kept in files of their own is in the store, once; what is lost of it is reported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import served

from controller import sealed_file
from controller.service import older_files
from controller.store.service_store import ServiceStore

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
    (state / "alarms.jsonl").write_text("".join(sealed_file.line(one) for one in alarms or (ALARM,)))


def of(service: Any) -> tuple[Any, ...]:
    used = service.usage.told()
    motion = next(one["value"] for one in used["counters"] if one["name"] == "motion")
    return service.alarms.list(), service.probed.told(), used["tools"][0]["cut_s"], used["items"][0], motion


def test_a_folder_of_before_opens_with_all_of_it_and_then_without_its_files(tmp_path: Path) -> None:
    state = tmp_path / "state"
    write(state, ALARM, {**ALARM, "id": 2}, {**ALARM, "acknowledged_s": 1003.0})
    service = served(tmp_path)
    alarms, probed, cut_s, item, motion = found = of(service)
    assert [(one["id"], one["acknowledged_s"]) for one in alarms] == [(2, None), (1, 1003.0)]
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
    assert not store.rows("SELECT 1 FROM documents") and older_files.take_over(store, tmp_path) == []


def test_of_a_damaged_file_of_before_the_generation_before_it_counts(tmp_path: Path) -> None:
    write(tmp_path)
    sealed_file.write(tmp_path / "usage.json", {**USED, "hours": {"motion": 9.0}})
    text = (tmp_path / "usage.json").read_text()
    (tmp_path / "usage.json").write_text(text.replace("9.0", "8.0"))
    store = ServiceStore(tmp_path)
    (loss,) = older_files.take_over(store, tmp_path)
    assert loss["key"] == "file_before"
    assert store.document("usage", lambda found: found, None) == USED


def test_an_alarm_of_before_that_cannot_be_read_costs_no_other(tmp_path: Path) -> None:
    whole = json.dumps(ALARM).encode() + b"\n"
    for text, lost in ((whole + b'{"id": 8, "ti', False), (b'{"id": 7, \xfe}\n' + whole, True)):
        (tmp_path / "alarms.jsonl").write_bytes(text)
        found, loss = older_files.alarms(tmp_path / "alarms.jsonl")
        assert found == [ALARM] and (loss is not None) is lost


def test_no_flip_of_a_bit_changes_what_an_alarm_of_before_says(tmp_path: Path) -> None:
    write(tmp_path)
    sealed_file.adopt(tmp_path, ["alarms.jsonl"])
    file = tmp_path / "alarms.jsonl"
    whole = file.read_bytes()
    for at in range(8 * len(whole)):
        flipped = bytearray(whole)
        flipped[at // 8] ^= 1 << at % 8
        file.write_bytes(flipped)
        found, loss = older_files.alarms(file)
        assert loss is not None or found == [ALARM], bytes(flipped)
