"""``directrix replay``: a record is found, made again, and judged."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fakes.written_history import WrittenHistory
from support.machines.edited_records import rewrite_setpoints
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.service import runs
from controller.state.setpoints import SETPOINTS

RUNS = Path(__file__).resolve().parents[2] / "data" / "runs"
WHOLE, CUT_OFF = RUNS / "restart_behind_a_line", RUNS / "emergency_stop"


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """A copy, in a state folder."""
    folder = tmp_path / "runs" / WHOLE.name
    shutil.copytree(WHOLE, folder)
    return folder


def replayed(*words: str | Path) -> tuple[int, dict[str, Any]]:
    done = CliRunner().invoke(command_line.app, ["replay", *map(str, words), "--json"])
    return done.exit_code, json.loads(done.stdout)


def changed(record: Path, tick: int, axis: int, counts: int) -> None:
    rows = np.array(SETPOINTS.read(record))
    rows[tick, axis] += counts
    rewrite_setpoints(record, rows)


def test_the_same_setpoints_are_said_in_a_sentence_and_every_tick_may_be_kept(tmp_path: Path) -> None:
    trace = tmp_path / "again.npz"
    done = CliRunner().invoke(command_line.app, ["replay", str(WHOLE), "--trace", str(trace)])
    found = SETPOINTS.read(WHOLE)
    assert found is not None
    ticks = len(found)
    said = " ".join(done.stdout.split())
    assert done.exit_code == 0
    assert f"The same setpoints, bit for bit: {ticks} of {ticks} ticks ({ticks * 0.005:.3f} s)." in said
    with np.load(trace) as kept:
        assert "joint_command" in " ".join(kept.files) or len(kept.files) > 3


def test_the_first_difference_is_told_by_tick_time_axis_and_millimetres(record: Path) -> None:
    changed(record, 250, 2, 40)
    changed(record, 300, 0, 40)
    code, told = replayed(record)
    assert (code, told["ok"], told["tick"], told["axis"], told["unit"]) == (1, False, 250, "Z", "mm")
    assert told["time_s"] == pytest.approx(1.25) and told["difference"] > 0.0
    for word in ("in tick 250", "at 1.250 s", "Z was told", "mm apart"):
        assert word in told["error"], told["error"]


def test_where_the_axes_left_their_path_it_says_how_far_it_could_compare() -> None:
    done = CliRunner().invoke(command_line.app, ["replay", str(CUT_OFF)])
    said = " ".join(done.stdout.split())
    assert done.exit_code == 0 and "the axes were off their path" in said
    assert "fault" in json.loads((CUT_OFF / "run.json").read_text())["result"]


def test_a_run_is_found_by_its_number_and_by_its_name(record: Path) -> None:
    state = record.parents[1]
    written = WrittenHistory(state)
    runs.index(written.store, state)
    (run,) = written.runs()
    assert run.facts["record"] == record.name
    for named in (str(run.id), record.name):
        code, told = replayed(named, "--state", state)
        assert (code, told["run"]) == (0, record.name)
    code, told = replayed(str(run.id + 1), "--state", state)
    assert code == 1 and "no record of such a run" in told["error"]


@pytest.mark.parametrize(
    ("gone", "words"),
    [
        ("events.jsonl", "there is no events.jsonl in it"),
        ("program.ngc", "name the file with --program"),
        ("machine.toml", "name the file with --machine"),
        ("setpoints.npz", "nothing of a run was recorded in it"),
    ],
)
def test_what_a_record_lacks_is_said_with_what_to_do(record: Path, gone: str, words: str) -> None:
    (record / gone).unlink()
    code, told = replayed(record)
    assert code == 1 and words in told["error"] and told["error"].endswith("."), told["error"]


@pytest.mark.parametrize("ended", [True, False])
def test_a_record_that_is_spoilt_as_a_whole_is_told_with_the_reason(record: Path, ended: bool) -> None:
    (record / "setpoints.npz").write_bytes(b"nothing")
    if not ended:
        (record / "run.json").unlink()
    code, told = replayed(record)
    assert code == 1 and "its setpoints cannot be read (BadZipFile" in told["error"], told


def flipped(lines: list[bytes]) -> None:
    line = bytearray(lines[9])
    line[30] ^= 4
    lines[9] = bytes(line)


def joined(lines: list[bytes]) -> None:
    lines[9:11] = [lines[9][:-1] + b"\x8a" + lines[10]]


def doubled(lines: list[bytes]) -> None:
    lines.insert(9, lines[9])


def exchanged(lines: list[bytes]) -> None:
    lines[3], lines[9] = lines[9], lines[3]


@pytest.mark.parametrize("hurt", [flipped, joined, doubled, exchanged])
def test_a_spoilt_line_of_the_events_that_its_sum_mends_is_named_and_all_comes_again(
    record: Path, hurt: Callable[[list[bytes]], None]
) -> None:
    lines = (record / "events.jsonl").read_bytes().splitlines(keepends=True)
    hurt(lines)
    (record / "events.jsonl").write_bytes(b"".join(lines))
    code, told = replayed(record)
    assert code == 0 and told["compared_ticks"] == told["recorded_ticks"] > 1000 and not told["partial"]
    assert {one["file"] for one in told["spoilt"]} <= {f"events.jsonl:{n}" for n in (4, 10, 11)}
    assert "is mended by its checksum" in told["spoilt"][0]["sentence"]


@pytest.mark.parametrize("line", [b"", b"xyz\n"])
def test_a_line_of_the_events_that_is_lost_is_named_and_what_comes_again_without_it_is_compared(
    record: Path, line: bytes
) -> None:
    lines = (record / "events.jsonl").read_bytes().splitlines(keepends=True)
    lines[13] = line
    (record / "events.jsonl").write_bytes(b"".join(lines))
    code, told = replayed(record)
    lost = next(one for one in told["spoilt"] if one["file"] == "events.jsonl:14")
    assert code == 0 and told["partial"] and 100 < told["compared_ticks"] == lost["first_tick"]
    assert lost["end_tick"] == told["recorded_ticks"] and "was compared up to there" in lost["sentence"]


def test_a_record_of_an_older_version_takes_program_and_machine_from_files(record: Path) -> None:
    (record / "program.ngc").rename(record.parent / "program.ngc")
    assert replayed(record, "--program", record.parent / "program.ngc")[0] == 0
    code, told = replayed(record, "--program", record.parent / "program.ngc", "--machine", "fig4b")
    assert code == 1 and "another machine file" in told["error"]
    other = record.parent / "other.ngc"
    other.write_text("G21\nM30\n")
    code, told = replayed(record, "--program", other)
    assert code == 1 and "another program" in told["error"]


@pytest.mark.parametrize("run", ["nowhere", "7", "../.."])
def test_a_run_that_is_none_is_refused_in_a_sentence(tmp_path: Path, run: str) -> None:
    code, told = replayed(run, "--state", tmp_path)
    assert code == 1 and told["error"].endswith("."), told
