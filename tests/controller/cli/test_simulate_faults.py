"""``directrix simulate --faults``: what it says, how it ends, and that it says the same again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines.stepped_runs import program
from typer.testing import CliRunner

from controller import __main__ as command_line

Told = dict[str, Any]


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    (tmp_path / "part.ngc").write_text(program("example2_ready", "3000."))
    return tmp_path


def run(*words: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(
        command_line.app, ["simulate", "part.ngc", "--gouge", "warn", *map(str, words)]
    )
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


def under(faults: str, *words: object) -> tuple[int, Told]:
    """Exit code and JSON of a run under a script."""
    Path("faults.txt").write_text(faults)
    code, out, err = run("--faults", "faults.txt", *words, "--json")
    assert err == ""
    return code, json.loads(out)


def test_a_fault_ends_the_run_with_its_sentence_and_all_that_was_seen(part: Path) -> None:
    code, told = under("at 0.5 s: silence Y for 900 ms\nat 100 s: drop sync")
    assert code == 4 and told["result"] == "fault_as_asked" and told["fault"] == "FEEDBACK_LOST"
    assert told["error"].startswith("Axis Y: A drive did not report")
    faults = told["faults"]
    assert faults["from"] == "program"
    assert [(one["line"], one["tick"]) for one in faults["injected"]] == [
        ("on can0: at 0.5 s: silence 2 for 0.9 s", 250)
    ]
    assert faults["not_reached"] == ["on can0: at 100 s: drop 080 x 1"]
    raised = faults["raised"][0]
    assert (raised["fault"], raised["axis"], raised["class"]) == ("FEEDBACK_LOST", "Y", "LOST_DRIVE")
    assert raised["tick"] == 252 and raised["time_s"] == pytest.approx(0.504)
    stood = faults["stood"]
    assert stood["tick"] == max(axis["tick"] for axis in stood["axes"].values())
    assert stood["after_ms"] == pytest.approx(2.0 * (stood["tick"] - raised["tick"]))
    assert faults["mode"] == "FAULT"
    assert set(faults["distance"]) == {"X", "Y", "Z", "A", "C"}
    assert [one["unit"] for one in faults["distance"].values()] == ["mm", "mm", "mm", "deg", "deg"]


def test_people_get_it_in_80_columns(part: Path) -> None:
    Path("faults.txt").write_text("at 0.5 s: silence Y for 900 ms\n")
    code, out, err = run("--faults", "faults.txt")
    assert code == 4 and "Axis Y: A drive did not report" in err
    assert "FEEDBACK_LOST of Y: LOST_DRIVE" in out and "All motors stood " in out
    assert max(map(len, out.splitlines())) <= 80


def test_a_run_that_takes_no_harm_completes(part: Path) -> None:
    code, told = under("at sync 251: drop rpdo Y")
    assert code == 0 and told["result"] == "completed"
    assert told["faults"]["raised"] == [] and told["faults"]["stood"] is None
    assert told["faults"]["mode"] == "READY"
    assert [one["times"] for one in told["faults"]["injected"]] == [1]


@pytest.mark.parametrize("machine", ["trunnion_five_buses"])
def test_the_same_script_gives_the_same_run_bit_for_bit(part: Path, machine: str) -> None:
    """With odds in it, requests beside it, and on every bus."""
    events = [
        {"tick": 100, "request": "override", "value": 60},
        {"tick": 200, "request": "hold"},
        {"tick": 400, "request": "resume"},
    ]
    Path("events.jsonl").write_text("\n".join(map(json.dumps, events)))
    script = "seed 5\nat 0.1 s: drop rpdo Y for 2 s odds 0.4\nat sync 600: node_reset Z\n"
    runs = []
    for name in ("first.npz", "second.npz"):
        code, told = under(script, "--machine", machine, "--events", "events.jsonl", "--trace", name)
        for key in ("wall_time_s", "times_real_time", "error"):
            told.pop(key)
        runs.append((code, told))
    assert runs[0] == runs[1] and runs[0][1]["faults"]["raised"]
    first, second = np.load("first.npz"), np.load("second.npz")
    assert set(first.files) == set(second.files)
    assert all(first[name].tobytes() == second[name].tobytes() for name in first.files)


def test_faults_may_begin_with_homing(part: Path) -> None:
    """A drive that falls silent before it is enabled: the program never begins."""
    code, told = under("at 20 ms: silence X", "--faults-from", "home")
    assert code == 4 and told["result"] == "fault_as_asked"
    assert "did not become" in told["error"]
    assert told["faults"]["from"] == "home" and told["faults"]["raised"][0]["axis"] == "X"


def test_a_drive_that_answers_no_more_while_it_is_homed_ends_the_run_with_its_facts(part: Path) -> None:
    code, told = under("at 70 ms: node_reset Y", "--faults-from", "home", "--machine", "fig4b")
    assert code == 4 and told["result"] == "fault_as_asked"
    assert "drive Y" in told["error"] and "no answer to SDO" in told["error"]
    assert told["faults"]["from"] == "home"


def test_what_cannot_be_understood_ends_with_2_before_anything_runs(part: Path) -> None:
    for script, words, said in (
        ("at 1 s: drop rpdo Y\nat 1 s: explode 3\n", (), "faults.txt: line 2: 'explode' is no fault"),
        ("at 1 s: silence 9\n", (), "faults.txt: line 1: node 9 is not on this machine"),
        ("at 1 s: drop sync\n", ("--machine", "trunnion_two_buses"), "several buses"),
    ):
        code, told = under(script, *words)
        assert code == 2 and not told["ok"] and said in told["error"]
        assert set(told) == {"ok", "error"}
    code, out, err = run("--faults", "nowhere.txt")
    assert (code, out) == (1, "") and err.startswith("nowhere.txt: No such file")


@pytest.mark.parametrize(
    ("line", "origin"),
    [
        ("silence master", "program"),
        ("silence master", "home"),
        ("drop sync for 100 s", "program"),
        ("bus_off master", "program"),
        ("queue_full master for 1000 s", "program"),
        ("babble 000 for 300 ms", "program"),
        ("node_reset Y", "home"),
    ],
)
def test_a_run_ends_and_stands_whatever_is_taken_from_it(part: Path, line: str, origin: str) -> None:
    at_s = 0.25 if origin == "program" else 0.27  # not while SDO has the word
    code, told = under(f"at {at_s} s: {line}", "--faults-from", origin, "--period-ms", "5")
    assert code == 4 and told["faults"]["mode"] == "FAULT"
    assert told["faults"]["stood"]["after_ms"] is not None


def test_a_fault_that_came_before_the_script_began_is_none_of_the_scripts(part: Path) -> None:
    """X 3000 under G53 has no place, so the tool stops by itself while the script waits."""
    Path("part.ngc").write_text("G0 X1\nG53 G0 X3000\n")
    code, told = under("at 100 s: drop sync", "--unchecked")
    assert (code, told["result"]) == (1, "refused")
