"""The drives of a live simulated machine are those of the stepped one."""

from __future__ import annotations

import pytest
from support.machines.stepped_runs import shipped

from controller.machine import machine_file
from controller.runtime import simulation
from drives.simulated import __main__ as simulated
from drives.simulated.drive import SimulatedDrive
from drives.simulated.rig import rig


@pytest.mark.parametrize(
    "name", ["trunnion", "trunnion_two_buses", "trunnion_five_buses", "machining_centre"]
)
def test_a_live_drive_has_the_motor_that_its_axis_needs(name: str) -> None:
    machine = shipped(name)
    stepped = rig(machine_file.node_settings(machine), machine_file.bus_settings(machine)).drives
    for bus in machine.buses:
        chosen = simulated._parser().parse_args(["hub", *simulation.options(machine, bus.name)])
        live = {one.node: one for one in simulated._devices(chosen) if isinstance(one, SimulatedDrive)}
        for axis in (axis for axis in machine.axes if axis.bus == bus.name):
            ours, theirs = live[axis.node].parameters, stepped[axis.name].parameters
            assert ours.strongest_counts_s2 == theirs.strongest_counts_s2, axis.name
            assert ours.fastest_counts_s == theirs.fastest_counts_s
            assert ours.strongest_counts_s2 > 2.0 * axis.limits.acceleration * abs(axis.counts_per_unit)
            assert ours.brake_counts_s2 == theirs.brake_counts_s2
