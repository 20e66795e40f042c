"""Machines of builders as ``machine new`` writes them, drives by makers' sheets, from file to first part.

Where DIRECTRIX_EDS names no folder of makers' sheets, sheets of the simulated families are in their place.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
import typer
from support.drives.makers_sheets import SHEETS
from typer.testing import CliRunner

from controller.cli import bring_up
from controller.cli.machine_bundle import app as machines
from controller.cli.speech import Verbs
from controller.machine import drive_profiles, machine_file
from controller.machine.named_files import SHIPPED
from controller.runtime import checked, drive_sheets, simulation
from controller.runtime.stepped import SteppedMachine

bring_ups = Verbs()
bring_ups.command()(bring_up.bring_up)

INCREMENTS = (
    'override = [{object="60A8", default=0x00B50000, reason="set"},'
    ' {object="608F:01", default=%d, reason="set"}]'
)
# kind, profile, spindle with what belongs to it, and what the sheet's refusals say to write of each axis
MACHINES = {
    "fork_head": ("head_head", "nanotec_c5e", ("inverter", "--with", "io"), 2_000_000),
    "trunnion": ("trunnion", "trinamic_tmcm1636", ("modbus",), 0),
    "head_and_table": ("table_head", "technosoft_ipos", ("hand",), 0),
}
PROGRAM = "example2_ready.ngc"
PARTS = ("inputs switches sto brake scale spindle", "response.X", "response.C", "circle", "dry_run")


def asked(app: typer.Typer, *words: str) -> dict[str, Any]:
    done = CliRunner().invoke(app, [*words, "--json"])
    return dict(json.loads(done.stdout.splitlines()[-1]))


def sheet_of(profile: str, folder: Path) -> Path:
    if eds := os.environ.get("DIRECTRIX_EDS"):
        return Path(eds) / {**SHEETS, "nanotec_c5e": "nanotec_c5e.eds"}[profile]
    return simulation.family_sheet.write(folder / f"{profile}.eds", drive_profiles.load(profile))


def built(name: str, folder: Path) -> Path:
    """Homed by switches; each drive is set up as the refusal of its sheet asks for."""
    kind, profile, spindle, turn = MACHINES[name]
    file, axes = folder / f"{name}.toml", machine_file.load(kind).axes
    own = [f"axis.{axis.name}.homing.method=24" for axis in axes]
    own += [f"axis.{axis.name}.{INCREMENTS % turn}" for axis in axes if turn]
    words = [word for one in own for word in ("--set", one)]
    drives = ("--profile", profile, "--eds", str(sheet_of(profile, folder)))
    made = asked(machines, "new", str(file), "--kind", kind, *drives, "--spindle", *spindle, *words)
    assert made["ok"], made
    return file


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_that_was_just_written_is_homed_by_its_switches(name: str, tmp_path: Path) -> None:
    machine = machine_file.load(built(name, tmp_path))
    assert drive_sheets.look(machine)[0] == []
    bench = SteppedMachine(machine)
    bench.come_up()
    for axis, at in zip(machine.axes, bench.joints, strict=True):
        assert (at - axis.homing.position) * axis.shown_per_unit == pytest.approx(0.0, abs=0.05), axis.name


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("name", ["fork_head", "trunnion"])
def test_its_bring_up_finds_it_good(name: str, part: str, tmp_path: Path) -> None:
    file = built(name, tmp_path)
    steps = [word for one in part.split() for word in ("--step", one)]
    gauge = [f"scale.{axis.name}={10 if axis.name in 'XYZ' else 90}" for axis in machine_file.load(file).axes]
    values = [word for one in gauge for word in ("--value", one)]
    where = (str(tmp_path / "protocol"), "--machine", str(file), "--simulate", "--part", PROGRAM)
    found = asked(bring_ups, *where, *steps, "--yes", "all", *values)
    kinds = [row for row in found["steps"] if {row["step"], row["step"].partition(".")[0]} & {*part.split()}]
    assert kinds and all(row["verdict"] == "good" for row in kinds), kinds


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
def test_it_cuts_the_second_example(name: str, tmp_path: Path) -> None:
    machine = machine_file.load(built(name, tmp_path))
    bench = SteppedMachine(machine)
    bench.come_up()
    task = checked.task((SHIPPED / "programs" / PROGRAM).read_bytes(), PROGRAM, machine)
    assert bench.run(checked.path_of(checked.standing(task, bench.joints))).result == "completed"
