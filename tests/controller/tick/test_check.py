"""The last look at a setpoint, and its rounding to counts."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine

from controller.machine.model import Joints
from controller.state.modes import Fault
from controller.tick.check import Check
from controller.tick.joints import Encoder

REST: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)


def moved(axis: int, by: float, base: Joints = REST) -> Joints:
    joints = list(base)
    joints[axis] += by
    return (joints[0], joints[1], joints[2], joints[3], joints[4])


@pytest.mark.parametrize("axis", range(5))
@pytest.mark.parametrize(("share", "fault"), ((0.999, Fault.NONE), (1.01, Fault.ACCELERATION)))
def test_acceleration_is_checked_for_every_axis(axis: int, share: float, fault: Fault) -> None:
    built = machine()
    step = built.axes[axis].limits.acceleration * built.period_s**2 * share
    found = Check(built).judge(moved(axis, step), REST, REST)
    assert found == (fault, axis if fault else -1)


@pytest.mark.parametrize("axis", range(5))
@pytest.mark.parametrize(("share", "fault"), ((0.999, Fault.NONE), (1.01, Fault.VELOCITY)))
def test_velocity_is_checked_for_every_axis(axis: int, share: float, fault: Fault) -> None:
    built = machine()
    step = built.axes[axis].limits.velocity * built.period_s * share
    found = Check(built).judge(moved(axis, step), REST, moved(axis, -step))
    assert found == (fault, axis if fault else -1)


@pytest.mark.parametrize("axis", range(5))
@pytest.mark.parametrize("side", (-1.0, 1.0))
def test_travel_is_checked_for_every_axis_and_a_way_back_is_left_open(axis: int, side: float) -> None:
    built = machine()
    check = Check(built)
    end = built.axes[axis].travel_max if side > 0 else built.axes[axis].travel_min
    outside = moved(axis, end + side * 1e-4)
    assert check.judge(outside, moved(axis, end), moved(axis, end)) == (Fault.TRAVEL, axis)
    far, back = moved(axis, end + side * 5.0), moved(axis, end + side * (5.0 - 1e-6))
    assert check.judge(far, far, far)[0] is Fault.NONE
    assert check.judge(back, far, far)[0] is Fault.NONE
    assert check.judge(moved(axis, end + side * (5.0 + 1e-6)), far, far) == (Fault.TRAVEL, axis)


def test_a_number_that_is_none_never_passes() -> None:
    assert Check(machine()).judge(moved(2, math.nan), REST, REST)[0] is not Fault.NONE


@pytest.mark.parametrize("axes", [3, 4, 5])
def test_counts_there_and_back_are_within_half_a_count(axes: int) -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    built = machine()
    built = replace(built, axes=built.axes[:axes])
    encoder = Encoder(built)
    for _ in range(200):
        joints = tuple(rng.uniform(axis.travel_min, axis.travel_max) for axis in built.axes)
        assert encoder.encode(joints), f"seed {seed}"
        encoder.decode(encoder.setpoints)
        for axis, q, back in zip(built.axes, joints, encoder.actual, strict=True):
            assert abs(back - q) <= 0.5001 / axis.counts_per_unit, f"seed {seed}"


def test_a_setpoint_beyond_int32_is_refused_and_the_last_one_stays() -> None:
    encoder = Encoder(machine())
    assert encoder.encode((1.0, 2.0, 3.0, 0.1, 0.2))
    before = encoder.setpoints
    assert not encoder.encode((1e6, 2.0, 3.0, 0.1, 0.2))
    assert encoder.setpoints == before
