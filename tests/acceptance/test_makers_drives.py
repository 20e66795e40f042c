"""Five drives of a maker, by the sheet as it is shipped: commissioned, homed, moved, stopped."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from support.drives.makers_sheets import SHEETS, sheet_of
from support.machines.stepped_runs import cut

from controller.ipc.handoff import COLUMN
from controller.machine import drive_profiles, machine_file
from controller.machine.model import Machine
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault, Mode, Request
from drives.bench.simulated import family_sheet
from drives.cia402 import State

PERIOD_S = 0.01
HERE = (37, 35, 0)  # homing methods that need no switch, the best first


def sheet(name: str, folder: Path) -> str:
    """The maker's; of a Gold that is not at hand one of the family, with the slip of its maker's."""
    if name in SHEETS:
        return sheet_of(name)
    made = family_sheet.write(folder / f"{name}.eds", drive_profiles.load(name))
    text = made.read_text("latin-1").replace("[1016sub1]", "[1016sub1]\nHighLimit=65535")
    made.write_text(text, "latin-1")
    return str(made)


def machine(name: str, folder: Path) -> Machine:
    """The trunnion with such drives; 10 ms, as most makers have them."""
    method = next(m for m in HERE if m in drive_profiles.load(name).homing_methods)
    text = (machine_file.SHIPPED / "trunnion.toml").read_text()
    text = text.replace('profile = "simulated"', f'profile = "{name}"\neds = "{sheet(name, folder)}"')
    text = re.sub(r"method = \d+", f"method = {method}", text)
    text = re.sub(r"period_s = [\d.]+", f"period_s = {PERIOD_S}", text)
    text = text.replace("= 200_000", "= 200")  # within the speeds that the makers' sheets begin with
    (folder / "mine.toml").write_text(text)
    return machine_file.load(folder / "mine.toml")


PROGRAM = "G21 G90 G0 X20. Y-10. Z80. A10. C-20.\nG1 X-20. F6000.\nM2\n"


@pytest.mark.parametrize("name", [*SHEETS, "elmo_gold"])
def test_drives_of_a_maker_are_commissioned_homed_moved_and_stopped(name: str, tmp_path: Path) -> None:
    made = machine(name, tmp_path)
    mill = SteppedMachine(made)
    mill.come_up()
    began = mill.joints
    assert mill.cycle.modes.mode is Mode.READY
    done = cut(PROGRAM, made, stepped=mill)
    assert (done.run.result, done.run.fault) == ("completed", Fault.NONE), done.run.fault_text
    row = mill.go(100)[-1]
    there = [float(row[COLUMN[f"actual_{i}"]]) for i in range(5)]
    assert there == pytest.approx(mill.joints, abs=0.02)
    assert all(abs(q - home) > 0.1 for q, home in zip(there, began, strict=True)), there
    mill.request(Request.ESTOP)
    mill.go(round(2.0 / PERIOD_S))
    assert mill.cycle.modes.mode is Mode.FAULT
    assert all(drive.state is not State.OPERATION_ENABLED for drive in mill.cycle.group.drives)
    stands = [drive.position for drive in mill.cycle.group.drives]
    mill.go(round(1.0 / PERIOD_S))
    assert [drive.position for drive in mill.cycle.group.drives] == stands
