"""The devices of a live simulated machine are those of the stepped one, as the machine file has them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.stepped_runs import shipped

from controller.machine import drive_profiles, machine_file
from controller.machine.model import Machine
from controller.runtime.bench import surroundings
from drives.bench.simulated import family_sheet
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IoNode
from drives.bench.simulated.parameters import Parameters
from drives.bench.simulated.rig import rig
from drives.bench.simulated.spindle_motor import MotorParameters, SpindleMotor


def live(machine: Machine) -> dict[tuple[str, int], SimulatedDrive | IoNode]:
    """By bus and node id."""
    names = [bus.name for bus in machine.buses]
    return {
        (name, one.node): one for name in names for one in surroundings.devices(machine, name, Parameters())
    }


def drive(machine: Machine, i: int) -> SimulatedDrive:
    """Of the i-th axis."""
    found = live(machine)[machine.axes[i].bus, machine.axes[i].node]
    assert isinstance(found, SimulatedDrive)
    return found


@pytest.mark.parametrize(
    "name", ["trunnion", "trunnion_two_buses", "trunnion_five_buses", "machining_centre"]
)
def test_a_live_drive_has_the_motor_that_its_axis_needs(name: str) -> None:
    machine = shipped(name)
    stepped = rig(machine_file.node_settings(machine), machine_file.bus_settings(machine)).drives
    for i, axis in enumerate(machine.axes):
        ours = drive(machine, i).parameters
        assert ours == stepped[axis.name].parameters, axis.name
        assert ours.strongest_counts_s2 > 2.0 * axis.limits.acceleration * abs(axis.counts_per_unit)


def test_it_is_of_the_family_the_data_sheet_and_the_brake_that_the_machine_file_names(tmp_path: Path) -> None:
    family = drive_profiles.load("maxon_epos4")
    sheet = str(family_sheet.write(tmp_path / "epos4.eds", family))
    machine = shipped()
    first, second, *others = machine.axes
    other = replace(first, profile="maxon_epos4", eds=sheet)
    told = replace(machine, axes=(other, replace(second, brake=False), *others))
    of_family, unbraked, plain = (drive(told, i) for i in range(3))
    assert str(of_family.dictionary.path) == sheet
    assert of_family.axis.homing_methods != plain.axis.homing_methods
    assert plain.parameters.brake and not unbraked.parameters.brake


def test_only_the_spindle_slips() -> None:
    machine = shipped("machining_centre")
    assert machine.spindle is not None
    names = {bus.name for bus in machine.buses}
    made = [one for n in names for one in surroundings.devices(machine, n, Parameters(), MotorParameters())]
    slips = [d.node for d in made if isinstance(d, SimulatedDrive) and isinstance(d.axis.servo, SpindleMotor)]
    assert slips == [machine.spindle.node]
