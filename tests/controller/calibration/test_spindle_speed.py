"""What a tachometer reads tells scale and offset of an inverter's output, which the machine file then has."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
from support.machines.spindle_machine import IO, text
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.calibration import spindle_speed
from controller.calibration.refusal import Refusal
from controller.machine import machine_file

SPINDLE = "[spindle]\nmax_rev_min = 12000\n\n[spindle.inverter]\nchannel = 1  # terminal 13\n"
TEXT = text(SPINDLE, IO.replace("coolant", "spindle_run = 7, coolant"))
MACHINE = machine_file.read(TEXT, "ours.toml", machine_file.SHIPPED)
FILE = machine_file.alone(MACHINE)


def readings(zero: float, full: float, noise: float = 0.0, sign: float = 1.0) -> str:
    """Of an inverter that stands at so many counts and turns so fast at the largest, at six S."""
    rng, inverter = random.Random(3), spindle_speed.inverter_of(MACHINE)
    rows = ["s,rev_min"]
    for s in (500, 1000, 3000, 6000, 9000, 12000):
        turned = (inverter.counts(s) - zero) / (inverter.full_counts - zero) * full
        rows.append(f"{s},{sign * turned + rng.uniform(-noise, noise):.1f}")
    return "\n".join(rows)


@pytest.mark.parametrize(("zero", "full"), [(0, 12000.0), (250, 11320.0), (-400, 14100.0)])
def test_the_line_is_found_that_the_inverter_has(zero: float, full: float) -> None:
    found = spindle_speed.fit(readings(zero, full, noise=5.0), "r.csv", MACHINE)
    assert abs(found.zero_counts - zero) < 30 and found.full_rev_min == pytest.approx(full, abs=20.0)
    assert found.worst_rev_min < 12.0 and found.readings == 6


def test_with_what_was_found_the_spindle_turns_as_s_says(tmp_path: Path) -> None:
    file, table = tmp_path / "ours.toml", tmp_path / "r.csv"
    file.write_text(FILE)
    table.write_text(readings(250, 12600.0))
    words = ["calibrate", "spindle", table, "--machine", file, "--json"]
    told = json.loads(CliRunner().invoke(command_line.app, [*map(str, words)]).stdout)
    assert told["ok"] and told["written"] is None and file.read_text() == FILE
    CliRunner().invoke(command_line.app, [*map(str, words), "--write"])
    assert "channel = 1  # terminal 13" in file.read_text() and len(list(tmp_path.glob("ours.before-*"))) == 1
    inverter = spindle_speed.inverter_of(machine_file.load(file))
    turned = (inverter.counts(6000.0) - 250) / (inverter.full_counts - 250) * 12600.0
    assert turned == pytest.approx(6000.0, abs=2.0)


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("s,rev_min\n500,500\n600,600\n", "few_speeds"),
        ("s,rev_min\n500,500\n510,510\n520,520\n", "few_speeds"),
        (readings(0, 12000.0, sign=-1.0), "speed_falls"),
        ("s\n500\n", "no_column"),
        ("s,rev_min\n500,fast\n", "no_number"),
    ],
)
def test_readings_that_tell_nothing_are_refused(table: str, key: str) -> None:
    with pytest.raises(Refusal) as why:
        spindle_speed.fit(table, "r.csv", MACHINE)
    assert why.value.said["key"] == f"calibration.{key}"


def test_a_machine_without_an_inverter_is_refused() -> None:
    with pytest.raises(Refusal) as why:
        spindle_speed.fit(readings(0, 12000.0), "r.csv", machine_file.load("trunnion"))
    assert why.value.said["key"] == "calibration.no_inverter"
