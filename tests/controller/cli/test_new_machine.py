"""A drafted machine file is one that every command takes, whatever was answered."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from controller.cli.machine_bundle import app
from controller.cli.new_machine import EQUIPMENT, KINDS, SPINDLES
from controller.machine import machine_file
from controller.runtime import drive_sheets

EVERY = [*product(KINDS, SPINDLES, ((), *((one,) for one in EQUIPMENT), EQUIPMENT))]
FEW = EVERY[:: len(EVERY) // 12]


def asked(*words: str, given: str = "") -> dict[str, Any]:
    done = CliRunner().invoke(app, ["new", *words, "--json"], input=given)
    return {**json.loads(done.stdout.splitlines()[-1]), "exit": done.exit_code}


@pytest.mark.parametrize(
    ("kind", "spindle", "equipment"),
    [*FEW, *(pytest.param(*one, marks=pytest.mark.slow) for one in EVERY if one not in FEW)],
)
def test_whatever_is_answered_makes_a_machine(
    kind: str, spindle: str, equipment: tuple[str, ...], tmp_path: Path
) -> None:
    file = tmp_path / "mine.toml"
    with_ = [word for one in equipment for word in ("--with", one)]
    assert asked(str(file), "--kind", kind, "--spindle", spindle, *with_)["ok"]
    made, like = machine_file.load(file), machine_file.load(kind)
    assert made.name == "mine" and [axis.name for axis in made.axes] == [axis.name for axis in like.axes]
    assert (made.spindle is None) == (spindle == "none")
    assert (made.changer is not None, made.probe is not None) == (
        "changer" in equipment,
        "probe" in equipment,
    )
    assert drive_sheets.look(made) == ([], [])


def test_any_key_may_be_set_and_a_wrong_one_is_refused_with_nothing_written(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    own = ("--set", "axis.X.travel_mm=[-100, 90]", "--set", "machine.tolerance_mm=0.02")
    assert asked(str(file), *own)["ok"]
    made = machine_file.load(file)
    assert (made.axes[0].travel_min, made.axes[0].travel_max, made.tolerance_mm) == (-100.0, 90.0, 0.02)
    other = tmp_path / "other.toml"
    for setting, why in (
        ("axis.X.velocity_mm_s=-5", "velocity_mm_s = -5"),
        ("axis.Q.node=3", "names no key"),
        ("lead_mm=3", "names no key"),
        ("machine.led_mm=3", "led_mm"),
    ):
        refused = asked(str(other), "--set", setting)
        assert refused["exit"] == 1 and why in refused["error"] and not other.exists()
    assert "is there already" in asked(str(file))["error"]
    assert "allowed are" in asked(str(other), "--kind", "hexapod")["error"]


def test_who_is_asked_gets_what_he_answers(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    answers = [
        "table_head",
        "socketcan",
        "",
        "",
        "drive",
        "probe, setter",
        "[-200, 200]",
        "100.0",
        *[""] * 30,
    ]
    assert asked(str(file), "--ask", given="\n".join(answers))["ok"]
    made = machine_file.load(file)
    assert (made.axes[0].travel_min, made.axes[0].limits.velocity) == (-200.0, 100.0)
    assert made.spindle is not None and made.probe is not None and made.setter is not None
    assert [bus.channel for bus in made.buses] == ["can0", "can1"]
