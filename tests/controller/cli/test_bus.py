"""``directrix bus``: table, JSON, picture, refusal."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.machines.spindle_machine import without_spindle
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.machine import machine_file
from controller.runtime.bus_load import budgets
from drives.texts import english

TRUNNION = machine_file.SHIPPED / "trunnion.toml"


def run(*words: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(command_line.app, ["bus", *map(str, words)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("machine", machine_file.shipped())
def test_every_shipped_machine_fits_its_buses(machine: str) -> None:
    code, out, err = run(machine, "--json")
    found = json.loads(out)
    assert (code, err, found["ok"]) == (0, "", True)
    assert found["machine"] == machine and all(one["fits"] for one in found["buses"])


def test_machine_may_be_an_argument_or_an_option() -> None:
    assert run("trunnion_two_buses", "--json") == run("--machine", "trunnion_two_buses", "--json")


def test_json_has_rows_sums_and_the_timeline_of_each_bus() -> None:
    _, out, _ = run("trunnion_two_buses", "--json")
    three, two = json.loads(out)["buses"]
    assert three["total_us"] == pytest.approx(745.0) and two["total_us"] == pytest.approx(515.0)
    assert [slot["what"] for slot in two["timeline"]] == [
        "SYNC", "feedback of A", "feedback of C", "setpoint of A", "setpoint of C",
    ]  # fmt: skip
    assert two["timeline"][-1]["end_us"] == pytest.approx(515.0)
    assert two["timeline"][1]["sender"] == "A" and two["timeline"][3]["sender"] == "controller"
    for row in three["rows"]:
        assert 0.0 < row["typical_us"] <= row["longest_us"] <= row["worst_us"]
    assert three["sdo_every_ticks"] == 6


@pytest.mark.parametrize("machine", ["trunnion", "trunnion_two_buses", "trunnion_five_buses"])
def test_the_table_fits_80_columns_and_shows_who_sends_when(machine: str) -> None:
    code, out, _ = run(machine)
    assert code == 0 and max(map(len, out.splitlines())) <= 80, out
    for words in ("setpoint of X", "feedback of C", "heartbeat", "SDO", "typical", "%"):
        assert words in out, words
    assert "…" not in out


def test_what_does_not_fit_is_shown_and_refused_with_what_would() -> None:
    code, out, err = run("trunnion", "--period-ms", "1")
    assert code == 1 and "setpoint of C" in out
    assert "a period of 2 ms, or 2 buses with at most 3 drives each (X Y Z | A C)" in " ".join(err.split())
    code, out, err = run("trunnion", "--period-ms", "1", "--json")
    found = json.loads(out)
    assert (code, err, found["ok"]) == (1, "", False)
    assert "2 buses" in found["error"] and not found["buses"][0]["fits"]


def test_a_machine_with_a_spindle_and_inputs_counts_them(tmp_path: Path) -> None:
    text = without_spindle(TRUNNION.read_text())
    spindle = '[spindle]\nmax_rev_min = 24000.0\nbus = "can0"\nnode = 6\ncounts_per_rev = 1000.0\n\n'
    io = '[io]\nbus = "can0"\nnode = 7\ninputs = { estop = 0 }\noutputs = { coolant = 0 }\n\n'
    file = tmp_path / "full.toml"
    file.write_text(f"{text}\n{spindle}{io}")
    (one,) = budgets(machine_file.load(file))
    names = {english(row.text) for row in one.rows}
    assert {"speed of spindle", "feedback of spindle", "inputs of io", "outputs of io"} <= names


@pytest.mark.parametrize("machine", ["trunnion", "trunnion_five_buses"])
def test_the_picture_is_written(machine: str, tmp_path: Path) -> None:
    file = tmp_path / "bus.png"
    code, _, err = run(machine, "--plot", file)
    assert (code, err) == (0, "")
    assert file.read_bytes().startswith(b"\x89PNG") and file.stat().st_size > 10_000


def test_a_picture_is_drawn_of_what_does_not_fit_and_of_buses_without_timing(tmp_path: Path) -> None:
    file = tmp_path / "bus.png"
    assert run("trunnion", "--period-ms", "1", "--plot", file)[0] == 1 and file.exists()
    timeless = tmp_path / "timeless.toml"
    timeless.write_text(TRUNNION.read_text().replace("bit_rate = 1_000_000", "bit_rate = 0"))
    code, out, err = run(timeless, "--plot", file)
    assert (code, err) == (0, "") and "No bit timing" in out


def test_a_picture_that_cannot_be_written_is_refused_in_one_sentence(tmp_path: Path) -> None:
    code, _, err = run("trunnion", "--plot", tmp_path / "missing" / "bus.png")
    assert code == 1 and err.count("\n") == 1 and "missing" in err
