"""What the observer sees of motors, against the servo's own law and against what was done to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.machines.stepped_runs import program, shipped

from controller.runtime import checked
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.bench.observer import Observer, latency
from controller.runtime.stepped import Run, SteppedMachine
from controller.state.modes import Fault, Mode
from controller.tick.stock import DELAY
from drives.bench.simulated.servo import DAMPING, NATURAL_FREQUENCY_HZ


def observed(name: str, faults: str = "") -> tuple[Observer, Run, SteppedMachine]:
    """Example 2 under a script of faults."""
    machine = shipped(name)
    stepped = SteppedMachine(machine)
    task = checked.task(program("example2_ready", "3000.").encode(), "part.ngc", machine)
    stepped.come_up()
    observer = stepped.observe()
    MachineScript.read(faults, machine).inject(stepped.rig.buses, machine.period_s)
    observer.begin(machine.period_s)
    return observer, stepped.run(checked.walk_of(task, None, False)), stepped


@pytest.mark.parametrize("name", ["trunnion_two_buses"])
def test_a_healthy_motor_is_its_servos_lag_behind_and_no_more(name: str) -> None:
    observer, run, stepped = observed(name)
    sight = observer.sight
    assert run.result == "completed"
    assert sight.ticks[0].tick == 0 and observer.first_tick == run.first_tick
    assert sight.raised() == () and sight.to_dict()["stood"] is None
    speed = np.gradient(sight.command, axis=0) / stepped.machine.period_s
    lag_s = 2.0 * DAMPING / (2.0 * math.pi * NATURAL_FREQUENCY_HZ)
    moving = np.abs(speed).max(axis=0) > 0.0
    largest = sight.distance.max(axis=0)[moving]
    assert largest == pytest.approx(lag_s * np.abs(speed).max(axis=0)[moving], rel=0.05)
    # At constant speed to the last digit: the latency of the bus is counted, and nothing else.
    y = np.flatnonzero(np.abs(speed[:, 1]) > 0.98 * np.abs(speed[:, 1]).max())[50:]
    assert sight.distance[3:][y, 1].max() < 1.1 * lag_s * np.abs(speed[:, 1]).max()


def test_a_motor_whose_setpoints_are_lost_is_seen_where_it_is() -> None:
    """Whatever the controller says of it: this is the issue's own example."""
    observer, _, stepped = observed("trunnion", "at 2 s: drop rpdo Y x 400")
    sight = observer.sight
    drive = stepped.rig.drives["Y"].axis
    per_unit = stepped.machine.axes[1].counts_per_unit
    assert sight.motors[-1, 1] == pytest.approx(drive.servo.position / per_unit)
    here = [seen.tick for seen in sight.ticks].index(1030)
    # What had gone out before the first loss is all that the motor knows of.
    assert sight.motors[here, 1] == pytest.approx(sight.command[999 - DELAY, 1], abs=0.02)
    then = 1030 - latency(stepped.machine)
    assert sight.distance[here, 1] == pytest.approx(abs(sight.command[then, 1] - sight.motors[here, 1]))


def test_faults_and_standstill_are_told_by_tick() -> None:
    observer, run, stepped = observed("trunnion", "at 0.2 s: node_reset Y")
    sight, told = observer.sight, observer.sight.to_dict()
    assert run.fault is Fault.NODE_RESET and told["mode"] == "FAULT"
    names = [(one.fault, one.axis) for one in sight.raised()]
    assert names[-1] == (Fault.NODE_RESET, 1)
    first = sight.raised()[0].tick
    assert sight.ticks[first].mode is Mode.FAULT and sight.ticks[first - 1].mode is Mode.RUNNING
    stood = told["stood"]
    assert isinstance(stood, dict)
    motors = sight.motors
    by_hand = np.abs(np.diff(motors[:, :3], axis=0)).max(axis=1) / stepped.machine.period_s > 0.5
    assert stood["tick"] == np.flatnonzero(by_hand)[-1] + 2
    assert stood["after_ms"] == pytest.approx(2.0 * (stood["tick"] - first))
    assert len(sight.ticks) >= stood["tick"] + 50
