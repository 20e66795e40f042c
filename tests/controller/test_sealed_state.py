"""Whatever becomes of the bytes of what a state folder keeps, no other values come out without a word.

A word is an error, an alarm, or that nothing is known: never the values of before with one of them changed.
"""

from __future__ import annotations

import contextlib
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from support.fakes.written_history import indexed, settled
from support.faults.harm import PARTS, harmed, times
from support.suite.seed import SEED

from controller import sealed_file
from controller.ipc import control_socket
from controller.machine import arrangement, machine_file, setup_data
from controller.plan.report import stored
from controller.runtime import events
from controller.runtime.starts import Start
from controller.service import owners, runs
from controller.state import record_files
from drives.arranged import Arranged

MACHINE = machine_file.load("trunnion")
RUN = "2026-11-21T083120.042-part.ngc"
FACTS = {
    "id": RUN,
    "name": "part.ngc",
    "started_s": 1.5e9,
    "ended_s": 1.6e9,
    "result": "completed",
    "cut_time_s": 7.25,
}
DRIVE = Arranged("X", (("6085h", 900), ("605Ah", 6)), 0.25, 900.0, 100.0, ("It stops late.",))  # type: ignore[arg-type]
WORDS = (OSError, ValueError, TypeError, events.EventError)


class Kind(NamedTuple):
    """A file as ``make`` leaves it in a state folder, and what ``read`` makes of it: None is a word, too."""

    make: Callable[[Path], Path]
    read: Callable[[Path], Any]


def _noted(state: Path) -> Path:
    setup_data.note(state, MACHINE)
    return state / setup_data.MACHINE


def _last(state: Path) -> Path:
    file = state / control_socket.LAST
    file.write_text(sealed_file.text({"status": {"mode": "OFF", "joints": {"X": 12.5}}}, file.name))
    return file


def _status(state: Path) -> Any:
    found = control_socket.last_known(state, "status")
    found.pop("gone_s", None)
    return found or None


def _arranged(state: Path) -> Path:
    return arrangement.save(state / arrangement.FOLDER, MACHINE, [DRIVE])


def _checked(state: Path) -> Path:
    return stored.save(stored.Stored(700, 1.4, 3, {1: (0.25, 0.5)}), "a" * 64, state / "checks")


def _ended(state: Path) -> Path:
    file = state / record_files.RUNS / RUN / record_files.RUN
    file.parent.mkdir(parents=True)
    runs._write_facts(file, FACTS)
    return file


def _events(state: Path) -> Path:
    file = state / events.FILE
    start = Start((0.0, 1.0, 2.0, 0.0, 0.0), 0.5).to_dict()
    sums = {"program_sha256": "a" * 64, "machine_sha256": "b" * 64}
    begin = {"tick": -1, "request": events.BEGIN, "value": {**start, **sums, "fitted": {}}}
    lines = [
        begin,
        {"tick": 7, "at": 90, "request": "override", "value": 0.8},
        {"tick": 9, "at": 92, "request": "hold"},
    ]
    file.write_text("".join(sealed_file.line(one, n) for n, one in enumerate(lines, 1)))
    return file


def _said(found: events.Recorded | None) -> events.Recorded | None:
    """None where a line is said to be spoilt; what is not said to be lost of the others is as it was."""
    known = {(7, "override", 90), (9, "hold", 92)}
    assert found is None or {(line.tick, line.kind, line.at) for line in found.lines} <= known
    return None if found is None or found.spoilt else found


KINDS = {
    "machine": Kind(_noted, lambda state: setup_data.noted(state).text),
    "status": Kind(_last, _status),
    "arranged": Kind(_arranged, lambda state: arrangement.load(state / arrangement.FOLDER, MACHINE)),
    "check": Kind(_checked, lambda state: stored.load("a" * 64, state / "checks")[0]),
    "run": Kind(_ended, lambda state: record_files.known(state / record_files.RUNS / RUN) or None),
    "events": Kind(_events, lambda state: _said(events.recorded(state / events.FILE))),
}


def hurt(kind: Kind, state: Path, count: int, rng: random.Random) -> int:
    """How often something was reported."""
    state.mkdir()
    file = kind.make(state)
    sealed_file.mark(state, owners.SEALED)  # as each start of a service does
    whole, known, words = file.read_bytes(), kind.read(state), 0
    assert known is not None
    for _ in range(count):
        file.write_bytes(data := harmed(whole, rng))
        found = None
        with contextlib.suppress(*WORDS):
            found = kind.read(state)
        assert found is None or found == known or cut_short(found, known), (SEED, file.name, data)
        words += found is None
    return words


def cut_short(found: Any, known: Any) -> bool:
    """Of a record that grows: what was not written yet when all ended."""
    return isinstance(found, events.Recorded) and found.lines == known.lines[: len(found.lines)]


@pytest.mark.parametrize("name", KINDS)
def test_no_damage_of_a_file_changes_what_is_read(name: str, tmp_path: Path) -> None:
    rng = random.Random(f"{SEED}-{name}")
    assert hurt(KINDS[name], tmp_path / "state", 100, rng) > 70


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("name", KINDS)
def test_thousands_of_damages_of_a_file_change_nothing(name: str, part: int, tmp_path: Path) -> None:
    rng = random.Random(f"{SEED}-{name}-{part}")
    assert hurt(KINDS[name], tmp_path / "state", times(100), rng) > times(70)


@pytest.mark.parametrize("name", ["machine", "status", "arranged", "run"])
def test_what_an_older_version_wrote_without_a_seal_is_read(name: str, tmp_path: Path) -> None:
    kind = KINDS[name]
    file = kind.make(tmp_path)
    known, values = kind.read(tmp_path), sealed_file.read(file, within=tmp_path)
    assert sealed_file.is_sealed(file, tmp_path)
    file.write_text(json.dumps(values, indent=1))
    assert kind.read(tmp_path) == known and not sealed_file.is_sealed(file, tmp_path)


def test_lines_of_a_record_that_are_left_out_or_exchanged_are_noticed(tmp_path: Path) -> None:
    file = _events(tmp_path)
    whole = events.recorded(file)
    assert whole is not None
    first, second, third = file.read_text().splitlines(keepends=True)
    for lines, lost in (
        ((first, third), [2]),
        ((first, third, second), []),
        ((first, second, second, third), []),
        ((first, second, "x" + third), [3]),
    ):
        file.write_text("".join(lines))
        found = events.recorded(file)
        assert found is not None and found.spoilt and [one.number for one in found.lost] == lost
        assert found.lines == tuple(line for line in whole.lines if {7: 2, 9: 3}[line.tick] not in lost)
    file.write_text(second + third)
    with pytest.raises(events.EventError, match=r"events\.jsonl:1: this line of the record"):
        events.recorded(file)


def test_a_record_that_was_cut_after_its_end_is_noticed(tmp_path: Path) -> None:
    file = _events(tmp_path)
    assert events.recorded(file, 3) == events.recorded(file)
    for data in (file.read_text()[:-5], "".join(file.read_text().splitlines(keepends=True)[:2])):
        file.write_text(data)
        found = events.recorded(file, 3)
        assert found is not None and [one.number for one in found.lost] == [3]


def test_a_beginning_or_end_of_a_run_that_is_damaged_or_of_another_is_put_aside_and_reported(
    tmp_path: Path,
) -> None:
    file = _ended(tmp_path)
    other = file.parent.parent / "2026-11-22T083120.042-other.ngc" / record_files.RUN
    other.parent.mkdir()
    other.write_bytes(file.read_bytes())  # it stands in another's place
    (found,) = settled(tmp_path)
    assert found["key"] == "record_damaged" and found["values"]["file"] == str(other)
    listed = {run.program: run.result for run in indexed(tmp_path)}
    assert listed == {"part.ngc": "completed", "other.ngc": "lost"}
    other.rename(other.with_name(record_files.BEGUN))  # it was killed: nothing but its beginning is there
    for damaged in (file, other.with_name(record_files.BEGUN)):
        damaged.write_bytes(damaged.read_bytes()[:-30])
    assert len(settled(tmp_path)) == 2 and not settled(tmp_path)
    assert file.with_name("run.json.damaged1").exists() and other.exists()
