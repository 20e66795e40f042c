"""A second encoder at the load: told beside the motor's, recorded, and a fault where the two part."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.machines.forked_machine import Forkable
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN
from controller.machine import machine_file
from controller.machine.axes import LoadEncoder
from controller.machine.model import Machine
from controller.runtime import checked
from controller.runtime.bench.fault_file import MachineScript
from controller.service import node_status
from controller.state.modes import Fault, Request
from drives import pdo
from drives.cia402 import Wanted
from drives.commissioning import possible, sheet, wanted
from drives.cyclic.drive import Drive
from drives.cyclic.drive_fault import DriveFault

TEXT = "G21 G90 G54 G61 G94\nT2 M6\nG0 X0 Y0 Z60\nG1 X30 Y20 F1500\nX0\nM30\n"
MOST_MM = 0.2


def encoded(**changes: Any) -> Machine:
    """A mill whose X has one, on a bus with room for it."""
    made = machine_file.with_period(shipped("three_axes"), 0.004)
    own = made.axes[0].counts_per_unit
    usual = {"index": 0x60E4, "sub": 1, "tpdo": 3, "every": 1}
    encoder = LoadEncoder(**{**usual, "counts_per_unit": own, "most_off": MOST_MM, **changes})
    return replace(made, axes=(replace(made.axes[0], load_encoder=encoder), *made.axes[1:]))


def come_up(machine: Machine, slipped_mm: float = 0.0) -> Forkable:
    """Homed; then the load slips."""
    bench = Forkable(machine)
    bench.come_up()
    axis = bench.rig.drives["X"].axis
    axis.slipped = slipped_mm * machine.axes[0].counts_per_unit * axis.units.scale
    return bench


def run(bench: Forkable) -> Any:
    machine = bench.machine
    task = replace(checked.task(TEXT.encode(), "part.ngc", machine), start=bench.joints)
    return bench.run(checked.walk_of(task, None, False))


@pytest.mark.parametrize("slipped_mm", [0.0, 0.15, -0.15])
def test_what_lies_between_motor_and_load_is_in_the_record_and_in_the_status(slipped_mm: float) -> None:
    bench = come_up(encoded(), slipped_mm)
    ended = run(bench)
    assert ended.result == "completed"
    off = ended.rows[5:, COLUMN["load_off_0"]]
    assert np.abs(off + slipped_mm).max() < 0.002 and not ended.rows[:, COLUMN["load_off_1"]].any()
    now = bench.board.read()
    assert now is not None
    rows = node_status.drives(bench.machine, now, {})
    assert rows[0]["load_off"] == pytest.approx(-slipped_mm, abs=0.002) and "load_off" not in rows[1]


def test_a_load_that_parts_from_its_motor_stops_the_axis_until_it_is_homed() -> None:
    bench = come_up(encoded(), 1.5 * MOST_MM)
    ended = run(bench)
    assert ended.fault is Fault.LOAD_OFF and bench.cycle.modes.fault_axis == 0
    assert bench.cycle.modes.untrusted == 1
    bench.request(Request.RESET)
    bench.go(20)
    bench.come_up()
    assert bench.cycle.modes.untrusted == 0
    assert run(bench).result == "completed"


def test_an_encoder_that_falls_silent_is_feedback_that_is_lost() -> None:
    for lost, fault in ((3, Fault.NONE), (30, Fault.FEEDBACK_LOST)):
        bench = come_up(machine := encoded())
        script = MachineScript.read(f"at 0.2 s: drop tpdo3 X x {lost}", machine)
        script.inject(bench.rig.buses, machine.period_s)
        assert run(bench).fault is fault


def test_a_drive_without_the_object_or_with_a_tpdo_that_is_taken_is_refused_on_paper() -> None:
    machine = encoded()
    node, master = machine_file.node_settings(machine)[0], machine_file.master_settings(machine)
    found = sheet.of(node)
    assert not possible.problems(node, master, found)
    del found.dictionary.indices[0x60E4]
    assert possible.problems(node, master, found)
    for taken in (replace(node, load_tpdo=1), replace(node, demand_tpdo=3)):
        assert any(
            "load_encoder_taken" in str(one) for one in possible.problems(taken, master, sheet.of(taken))
        )


def test_an_encoder_with_a_node_of_its_own_is_heard_and_left_as_it_is_set_up() -> None:
    machine = encoded(node=60, tpdo=1)
    (node, *_) = machine_file.node_settings(machine)
    assert node.load_can_id == 0x1BC and not any(one.number == 3 for one in wanted.pdos_of(node))
    assert not possible.problems(node, machine_file.master_settings(machine), sheet.of(node))
    drive = Drive(node)
    drive.want(Wanted.ENABLED)
    for k in range(12):
        drive.expect()
        drive.receive(0x181, memoryview(pdo.FEEDBACK.pack(0x1637, 1000 * k)), 0.0)
        assert drive.receive(0x1BC, memoryview(pdo.DEMAND.pack(1000 * k - (k > 5) * 10**6)), 0.0)
        drive.settle()
    assert drive.load is not None and drive.load.fault is DriveFault.LOAD_OFF
    assert drive.fault(0.0, 1.0) is DriveFault.LOAD_OFF


def test_the_counts_of_the_encoder_are_its_own() -> None:
    """Of another resolution, and turned round."""
    machine = encoded(counts_per_unit=-250.0, every=2)
    (node, *_) = machine_file.node_settings(machine)
    own = machine.axes[0].counts_per_unit
    assert node.load_per_count == -250.0 / own and node.load_every == 2
    assert node.most_load_off_counts == pytest.approx(MOST_MM * own) and math.isinf(
        machine_file.node_settings(machine)[1].most_load_off_counts
    )
