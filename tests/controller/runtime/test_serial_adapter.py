"""A live machine behind an adapter that one process owns, and drives at its far end.

A pseudo terminal that speaks slcan, and an interface of python-can.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.live.live_machines import run, session
from support.live.pumps import is_alive, pump_of
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN
from controller.state.modes import Fault, Mode

ROOT = Path(__file__).parents[3]
PERIOD_S = 0.010  # a serial adapter is of the slower class


@pytest.fixture
def far_end(tmp_path: Path) -> Iterator[dict[str, str]]:
    """Five drives on a virtual bus of another process; the channels that lead there."""
    link = tmp_path / "adapter"
    arguments = [sys.executable, "-m", "support.drives.slcan_terminal", str(tmp_path / "far"), str(link)]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    process = subprocess.Popen(arguments, cwd=ROOT, env=environment)
    while not link.exists():
        assert process.poll() is None
        time.sleep(0.01)
    yield {"slcan": str(link), "directrix": str(tmp_path / "far")}
    process.terminate()
    process.wait(20)


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.parametrize("interface", ["slcan", "directrix"])
def test_a_machine_behind_an_adapter_homes_and_runs_a_program(
    interface: str, far_end: dict[str, str]
) -> None:
    machine = replace(shipped(), period_s=PERIOD_S)
    (bus,) = machine.buses
    machine = replace(machine, buses=(replace(bus, interface=interface, channel=far_end[interface]),))
    with session("G21 G90 G54 G0 X5. Y3.\nG0 X0.\nM30\n", machine) as running:
        running.ready()
        assert is_alive(pump_of(running.tick.pid))
        rows, last = run(running)
    assert (last.mode, last.fault) == (Mode.READY, Fault.NONE)
    commanded = rows[:, COLUMN["joint_command_0"]]
    actual = rows[:, COLUMN["actual_0"]]
    assert commanded.max() - commanded.min() > 4.0
    assert np.ptp(actual) == pytest.approx(np.ptp(commanded), abs=0.05), "the drive has moved"
