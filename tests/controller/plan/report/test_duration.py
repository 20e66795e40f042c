"""Spindle and clamps are waited for beside a program's duration, as long as ``check`` says."""

from __future__ import annotations

import pytest
from support.machines.spindle_machine import IO, SPINDLE, Mill, mill
from support.machines.stepped_runs import shipped
from support.machines.traced_programs import HOME, trace

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints, Machine
from controller.plan.report.survey import Survey, survey

NO_CLAMPS = '[io]\nbus = "can1"\nnode = 11\ninputs = { door = 1 }\noutputs = { coolant = 0 }\n'
PROGRAM = "G21 G90 G54 G40\nS6000 M3 M8\nG0 X5.\nG1 C10. F2000\nS3000\nG1 X6.\nM5\nG0 X0 C0\nM30\n"


def looked_at(machine: Machine, start: Joints = HOME) -> Survey:
    return survey(trace(PROGRAM, machine, start).items, machine, kinematics_of(machine))


def test_a_machine_without_spindle_and_clamps_waits_for_nothing() -> None:
    assert looked_at(shipped("trunnion")).waits_s == 0.0


def ramps_s(acceleration_rev_s2: float) -> float:
    """0 to 6000, to 3000 and to 0 rev/min: to within 5 % of the new speed, or a tenth of a turn a second."""
    return ((100.0 - 5.0) + (50.0 - 2.5) + (50.0 - 0.1)) / acceleration_rev_s2


def test_a_spindle_takes_its_ramp_each_time_its_speed_changes() -> None:
    told_s = looked_at(mill(SPINDLE, NO_CLAMPS, "")).waits_s
    slow_s = looked_at(mill(SPINDLE.replace("400.0", "200.0"), NO_CLAMPS, "")).waits_s
    assert slow_s - told_s == pytest.approx(ramps_s(200.0) - ramps_s(400.0))
    assert told_s == pytest.approx(ramps_s(400.0), abs=0.05)
    by_hand = "[spindle]\nmax_rev_min = 12000\n"
    assert looked_at(mill(by_hand, NO_CLAMPS, "")).waits_s < 0.05


def test_a_spindle_is_not_expected_to_take_longer_than_it_may() -> None:
    heavy = SPINDLE.replace("400.0", "10.0")
    assert looked_at(mill(heavy, NO_CLAMPS, "")).waits_s == pytest.approx(3 * 1.0, abs=0.05)


def test_clamps_take_half_of_what_they_may_each_time_they_change() -> None:
    with_clamps = looked_at(mill(SPINDLE, IO, "AC")).waits_s
    # C opens for its turn, shuts, opens again, and shuts at the end
    without = looked_at(mill(SPINDLE, NO_CLAMPS, "")).waits_s
    assert with_clamps == pytest.approx(without + 4 * 0.05, abs=0.05)


def test_a_run_takes_its_duration_and_the_waits() -> None:
    made = Mill(mill(SPINDLE.replace("400.0", "200.0")))  # as the simulated drive does
    found = looked_at(made.machine, made.bench.joints)
    run = made.run(PROGRAM)
    assert run.result == "completed"
    took_s = len(run.rows) * made.machine.period_s
    assert took_s - found.duration_s == pytest.approx(found.waits_s, rel=0.1)
