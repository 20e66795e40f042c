"""Spindle and clamps are waited for beside a program's duration, and no longer than ``check`` says."""

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


def test_a_spindle_may_take_what_it_is_allowed_each_time_its_speed_changes() -> None:
    assert looked_at(mill(SPINDLE, NO_CLAMPS, "")).waits_s == pytest.approx(3 * 1.0)
    by_hand = "[spindle]\nmax_rev_min = 12000\n"
    assert looked_at(mill(by_hand, NO_CLAMPS, "")).waits_s == 0.0


def test_clamps_take_what_they_are_allowed_each_time_they_change() -> None:
    with_clamps = looked_at(mill(SPINDLE, IO, "AC")).waits_s
    # C opens for its turn, shuts, opens again, and shuts at the end
    assert with_clamps == pytest.approx(looked_at(mill(SPINDLE, NO_CLAMPS, "")).waits_s + 4 * 0.1)


def test_a_run_takes_its_duration_and_no_more_than_the_waits() -> None:
    made = Mill()
    found = looked_at(made.machine, made.bench.joints)
    run = made.run(PROGRAM)
    assert run.result == "completed"
    took_s = len(run.rows) * made.machine.period_s
    assert found.duration_s < took_s < found.duration_s + found.waits_s
