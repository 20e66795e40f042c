"""The last look at a setpoint, and its rounding to counts."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine

from controller.machine.model import Joints
from controller.state.modes import Fault
from controller.tick.check import TOLERANCE, TRAVEL_SLACK, Check
from controller.tick.joints import INT32, Encoder

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


# ---- to the last bit: what a mutation of a limit by one sign, bit or equals would let pass


def beyond(limit: float) -> float:
    """The next number away from 0."""
    return math.nextafter(limit, math.copysign(math.inf, limit))


@pytest.mark.parametrize("side", (-1.0, 1.0))
@pytest.mark.parametrize("axis", range(5))
def test_the_limits_themselves_pass_and_the_next_number_does_not(axis: int, side: float) -> None:
    built = machine()
    limits, T = built.axes[axis].limits, built.period_s
    # As the check itself multiplies: a product in another order is another number.
    step = side * (limits.velocity * T * TOLERANCE)
    check = Check(built)
    assert check.judge(moved(axis, step), REST, moved(axis, -step)) == (Fault.NONE, -1)
    faster = beyond(step)
    assert check.judge(moved(axis, faster), REST, moved(axis, -faster)) == (Fault.VELOCITY, axis)
    bend = side * (limits.acceleration * T * T * TOLERANCE)
    assert check.judge(moved(axis, bend), REST, REST) == (Fault.NONE, -1)
    assert check.judge(moved(axis, beyond(bend)), REST, REST) == (Fault.ACCELERATION, axis)


@pytest.mark.parametrize("side", (-1.0, 1.0))
@pytest.mark.parametrize("axis", range(5))
def test_travel_ends_a_trace_behind_its_end_to_the_last_bit(axis: int, side: float) -> None:
    built = machine()
    check, own = Check(built), built.axes[axis]
    end = own.travel_max + TRAVEL_SLACK if side > 0.0 else own.travel_min - TRAVEL_SLACK
    last, outside = moved(axis, end - side * 1e-7), math.nextafter(end, side * math.inf)
    assert check.judge(moved(axis, end), last, last) == (Fault.NONE, -1)
    assert check.judge(moved(axis, outside), last, last) == (Fault.TRAVEL, axis)


@pytest.mark.parametrize("side", (-1.0, 1.0))
@pytest.mark.parametrize("axis", range(5))
def test_an_axis_without_a_zero_has_no_travel_and_the_others_have(axis: int, side: float) -> None:
    built = machine()
    check = Check(built, 1 << axis)
    for other in range(5):
        end = built.axes[other].travel_max if side > 0.0 else built.axes[other].travel_min
        there, outward = moved(other, end + side * 5.0), moved(other, end + side * (5.0 + 1e-6))
        wanted = (Fault.NONE, -1) if other == axis else (Fault.TRAVEL, other)
        assert check.judge(outward, there, there) == wanted


@pytest.mark.parametrize("side", (-1.0, 1.0))
@pytest.mark.parametrize("axis", range(5))
def test_a_way_back_does_not_lead_out_at_the_other_end(axis: int, side: float) -> None:
    built = machine()
    low, high = built.axes[axis].travel_min - 5.0, built.axes[axis].travel_max + 5.0
    here, there = (low, high) if side > 0.0 else (high, low)
    assert Check(built).judge(moved(axis, there), moved(axis, here), REST) == (Fault.TRAVEL, axis)


def test_counts_fill_an_int32_to_its_ends_and_no_further() -> None:
    built = machine()
    built = replace(built, axes=tuple(replace(axis, counts_per_unit=1.0) for axis in built.axes))
    encoder = Encoder(built)
    ends = (float(-INT32), float(INT32 - 1), 0.0, 0.0, 0.0)
    assert encoder.encode(ends) and list(encoder.setpoints) == [int(q) for q in ends]
    assert not encoder.encode(moved(1, float(INT32))) and not encoder.encode(moved(3, float(-INT32 - 1)))
    assert list(encoder.setpoints) == [int(q) for q in ends]


def test_before_the_first_tick_all_is_zero_and_a_count_is_told_in_units() -> None:
    built = machine()
    encoder = Encoder(built)
    assert tuple(encoder.setpoints) == (0,) * 5 and tuple(encoder.actual) == (0.0,) * 5
    for i, axis in enumerate(built.axes):
        assert encoder.to_units(i, 1000) == pytest.approx(1000 / axis.counts_per_unit, rel=1e-15)


def test_deviations_are_put_on_what_is_told_and_taken_off_what_is_heard() -> None:
    class Shifted:
        def compensated(self, joints: Joints) -> Joints:
            return tuple(q + 1.0 for q in joints)

        def real(self, drives: Joints) -> Joints:
            return tuple(q - 1.0 for q in drives)

    built = machine()
    encoder = Encoder(built)
    encoder._deviations = Shifted()  # type: ignore[assignment]
    assert encoder.encode(moved(0, 2.0))
    assert encoder.setpoints[0] == round(3.0 * built.axes[0].counts_per_unit)
    encoder.decode(encoder.setpoints)
    assert encoder.actual == pytest.approx(moved(0, 2.0), abs=1.0 / built.axes[3].counts_per_unit)
