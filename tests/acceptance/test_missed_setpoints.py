"""Setpoints that do not come to their drives are counted by what the drives go by, and told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support.machines.forked_machine import Forkable
from support.machines.stepped_runs import shipped

from controller.machine import machine_file
from controller.machine.model import Demand, Machine
from controller.runtime import checked
from controller.runtime.bench.fault_file import MachineScript
from controller.state import setpoint_counts
from controller.state.modes import Fault
from drives.commissioning import possible, wanted
from drives.commissioning import sheet as sheets
from drives.settings import DEMAND, OFF_DEMAND, MasterSettings

MASTER = MasterSettings()

TEXT = "G21 G90 G54 G61 G94\nT2 M6\nG0 X0 Y0 Z60\nG1 X30 Y20 F1500\nM30\n"
LOST = "at 0.4 s: drop rpdo X x 3\nat 0.6 s: drop rpdo Y x 1\nat 0.7 s: drop rpdo X x 2"


def telling(index: int = DEMAND, every: int = 1, **changes: Any) -> Machine:
    """A mill whose X and Y say what they go by; there is room for it on its bus at 4 ms."""
    made = machine_file.with_period(shipped("three_axes"), 0.004)
    axes = [
        replace(axis, demand=Demand(index, 4, every, 1.0) if axis.name in "XY" else None, **changes)
        for axis in made.axes
    ]
    return replace(made, axes=tuple(axes))


def run(machine: Machine, faults: str, **how: Any) -> tuple[Forkable, Any, dict[str, dict[str, Any]]]:
    bench = Forkable(machine, **how)
    bench.come_up()
    task = replace(checked.task(TEXT.encode(), "part.ngc", machine), start=bench.joints)
    before = bench.board.read()
    if faults:
        MachineScript.read(faults, machine).inject(bench.rig.buses, machine.period_s)
    ended = bench.run(checked.walk_of(task, None, False))
    after = bench.board.read()
    assert before is not None and after is not None
    return bench, ended, setpoint_counts.between([axis.name for axis in machine.axes], before, after)


@pytest.mark.parametrize("index", [DEMAND, OFF_DEMAND])
def test_each_setpoint_that_was_lost_is_counted_at_its_drive(index: int) -> None:
    _, ended, counts = run(telling(index), LOST)
    assert ended.result == "completed"
    assert [(axis, one["missed"]) for axis, one in counts.items()] == [("X", 5), ("Y", 1), ("Z", None)]
    assert all(one["overdue"] == 0 for one in counts.values())


def test_of_a_healthy_run_none_is_missed_nor_of_one_whose_ticks_come_late() -> None:
    for lateness in (None, lambda n: 0.013 if n % 97 == 50 else 0.0):
        _, ended, counts = run(telling(), "", lateness=lateness)
        assert ended.result == "completed" and [one["missed"] for one in counts.values()] == [0, 0, None]


def test_a_drive_that_says_it_seldom_is_held_against_it_then() -> None:
    _, ended, counts = run(telling(every=2), "at 0.4 s: drop rpdo X x 6")
    assert ended.result == "completed" and counts["X"]["missed"] == 3


def test_a_drive_that_cannot_say_it_is_served_without() -> None:
    """The data sheets of makers: where the object is not there, the TPDO stays off."""
    machine = telling()
    node, master = machine_file.node_settings(machine)[0], machine_file.master_settings(machine)
    sheet = sheets.of(node)
    assert _maps(node, master, sheet)
    del sheet.dictionary.indices[DEMAND]
    assert not _maps(node, master, sheet)
    assert any("demand_unseen" in str(one) for one in possible.warnings(node, master, sheet))
    quiet = replace(machine, axes=tuple(replace(axis, demand=None) for axis in machine.axes))
    _, ended, counts = run(quiet, LOST)
    assert ended.result == "completed" and {one["missed"] for one in counts.values()} == {None}


def _maps(node: Any, master: Any, sheet: Any) -> bool:
    writes = [one for step in wanted.steps_of(node, master, sheet) for one in step.settings]
    return DEMAND << 16 | 32 in [one.value for one in writes if (one.index, one.sub) == (0x1A03, 1)]


def test_a_short_deadline_is_the_drives_own_notice_and_counted() -> None:
    """To home the stepped bench talks to its drives with no tick beside it: not as short as on a machine."""
    machine = telling(setpoint_deadline_s=0.1)
    bench, ended, counts = run(machine, "at 1.6 s: drop rpdo Z x 30")
    assert (counts["Z"]["overdue"], counts["X"]["overdue"]) == (1, 0)
    assert ended.fault is Fault.SETPOINTS_LOST
    assert bench.rig.drives["Z"].dictionary.get(0x1400, 5) == 100
    node = machine_file.node_settings(replace(machine, axes=telling(setpoint_deadline_s=0.0102).axes))[0]
    writes = [one for step in wanted.steps_of(node, MASTER, sheets.of(node)) for one in step.settings]
    assert 11 in [one.value for one in writes if (one.index, one.sub) == (0x1400, 5)], "not sooner than asked"
