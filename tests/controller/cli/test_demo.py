"""``directrix demo`` is the service with simulated drives, asked at its door."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.live.served_machine import calm_machine
from support.machines.stepped_runs import program

from controller.cli import demo
from controller.ipc.handoff import COLUMN
from controller.machine.model import Machine
from controller.runtime import checked
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault, Mode
from controller.verify.console import Refused

HEAVY = {"fastapi", "uvicorn", "nicegui", "pydantic", "starlette"}
FIRST = COLUMN["setpoint_0"]
LINES = "G21 G90 G54 G43.4\nG0 X0 Y0 Z60. A0 C0\nG1 X20. A4. F3000\nG1 X-10. Y5.\nG4 P0.2\nG0 X0\nM30\n"


def test_it_needs_nothing_of_the_panels_packages() -> None:
    told = "import sys, controller.cli.demo; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert not HEAVY & set(done.stdout.split())


def by_path_clock(rows: np.ndarray, machine: Machine) -> dict[int, tuple[float, ...]]:
    """Setpoints by periods of the path clock, which a late tick leaves standing."""
    going = (rows[:, COLUMN["mode"]] == Mode.RUNNING) & (rows[:, COLUMN["sync_sent"]] != 0.0)
    return {
        round(row[COLUMN["plan_time_s"]] / machine.period_s): tuple(row[FIRST : FIRST + 5])
        for row in rows[going]
    }


def simulated(text: str, machine: Machine, unchecked: bool) -> np.ndarray:
    task = checked.task(text.encode(), "part.ngc", machine)
    bench = SteppedMachine(machine)
    bench.come_up()
    return bench.run(checked.walk_of(task, None, unchecked)).rows


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize(
    ("text", "unchecked"), [(program("example1_ready", "3000."), False), (LINES, False), (LINES, True)]
)
def test_its_setpoints_are_those_of_simulate(text: str, unchecked: bool, tmp_path: Path) -> None:
    machine, part = calm_machine(), tmp_path / "part.ngc"
    part.write_text(text)
    cut = demo.cut(machine, part, tmp_path / "checks", unchecked, quiet=True)
    assert (cut.result, cut.fault, cut.sentence) == ("completed", Fault.NONE, "")
    found = by_path_clock(cut.rows, machine)
    assert len(found) > 100
    found.pop(0, None)  # it stood there until the spindle was switched on
    assert found == by_path_clock(simulated(text, machine, unchecked), machine)
    (stamps_s,) = cut.sync_stamps_s.values()
    assert len(stamps_s) >= len(found)
    assert bool(list((tmp_path / "checks").iterdir())) is not unchecked


@pytest.mark.slow
@pytest.mark.live
def test_what_the_service_refuses_it_tells_as_it_was_told(tmp_path: Path) -> None:
    part = tmp_path / "part.ngc"
    part.write_text("G87 X5 Y0\nM30\n")
    with pytest.raises(Refused, match=r"^part\.ngc:1:\d+: G87 \(back boring\) is not done here"):
        demo.cut(calm_machine(), part, tmp_path / "checks", False, quiet=True)
