"""Windows of a machine that brakes for seconds: put together they are as fast as the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.planned_laws import chains, laws_of
from support.machines.stepped_runs import shipped

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Limits, Machine
from controller.plan.feed import pace, profile
from controller.plan.feed.course import FeedCourse
from controller.plan.report.planned import planned
from controller.plan.segment import ContinuousPath


def heavy(acceleration: float) -> Machine:
    """A machine of which X, Y and Z swing up slowly (mm/s^2)."""
    machine = shipped()
    slow = Limits(100.0, acceleration, 1.5 * acceleration)
    axes = (axis if axis.is_rotary else replace(axis, limits=slow) for axis in machine.axes)
    return replace(machine, axes=tuple(axes))


def long_way(machine: Machine) -> ContinuousPath:
    """Eight circles of 251 mm in one go, faster than they can be run."""
    circles = ["G2 X40. Y0. I-40. F6000."] * 8
    source = "\n".join(["G21 G90 G54 G61", "G0 X40. Y0.", *circles, "M30", ""])
    return max(chains(source, machine), key=lambda chain: len(chain.segments))


@pytest.mark.parametrize("acceleration", [60.0, pytest.param(20.0, marks=pytest.mark.slow)])
def test_windows_of_a_heavy_machine_put_together_are_as_fast_as_the_whole(acceleration: float) -> None:
    """The next window joined 1.5 s before the rest of the last, where such a machine has long braked."""
    machine = heavy(acceleration)
    chain = long_way(machine)
    whole_s = sum(law.duration_s for law in laws_of(chain.segments, machine))
    windows_s = [one.took_s for one in planned([chain], machine, kinematics_of(machine))]
    assert len(windows_s) > 2
    assert sum(windows_s) <= 1.01 * whole_s


@pytest.mark.parametrize("acceleration", [60.0, 20.0])
def test_a_window_ends_before_its_braking_begins(acceleration: float) -> None:
    machine = heavy(acceleration)
    chain = long_way(machine)
    run = profile.split_at_stops(chain.segments, machine, kinematics_of(machine))[0]
    course = FeedCourse(run, machine, kinematics_of(machine))
    found = profile.plan(course, until=0.6 * course.length)
    assert found is not None
    seam_s = pace.seam_s(course, found)
    state = found.at(seam_s)
    rates = np.abs(course.derivatives(np.array([state.s])).first[0]) * state.v
    least_s = max(rate / axis.limits.acceleration for rate, axis in zip(rates, machine.axes, strict=True))
    assert found.duration_s - seam_s > least_s
    assert seam_s >= (1.0 - pace.TAIL_SHARE) * found.duration_s - 1e-9


def test_a_quick_machine_goes_on_a_second_and_a_half_before_its_rest() -> None:
    machine = shipped()
    course = FeedCourse(long_way(machine).segments, machine, kinematics_of(machine))
    found = profile.plan(course)
    assert found is not None and found.duration_s > 4.0
    assert pace.seam_s(course, found) == pytest.approx(found.duration_s - pace.TAIL_S, abs=1e-9)
