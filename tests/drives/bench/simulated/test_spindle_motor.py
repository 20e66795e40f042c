"""A simulated spindle lags, slips and tires as it is told to."""

from __future__ import annotations

import math

import pytest

from drives.bench.simulated.spindle_motor import MotorParameters, SpindleMotor

T = 0.002


def motor(**nature: float) -> SpindleMotor:
    made = SpindleMotor(0.0, MotorParameters(**nature))
    made.tune(T, 60.0, 0.7, 0.0)
    made.limit(4e5, math.inf)
    return made


def turn(one: SpindleMotor, speed: float, seconds: float) -> None:
    for _ in range(round(seconds / T)):
        one.step(one.end + speed * T)


@pytest.mark.parametrize("slip", [0.0, 0.02, 0.05])
def test_it_turns_slower_than_told_by_its_slip(slip: float) -> None:
    one = motor(lag_s=0.01, slip=slip)
    turn(one, 1000.0, 0.5)
    assert one.velocity == pytest.approx(1000.0 * (1.0 - slip), rel=1e-6)


def test_after_a_lag_two_thirds_of_a_step_are_there() -> None:
    one = motor(lag_s=0.05, slip=0.0)
    turn(one, 1000.0, T)  # the first period's demand is still rest
    turn(one, 1000.0, 0.05)
    assert one.velocity == pytest.approx(1000.0 * (1.0 - math.exp(-1.0)), rel=0.01)


def test_a_cut_that_is_too_heavy_brings_it_to_rest() -> None:
    one = motor(lag_s=0.01)
    turn(one, 1000.0, 0.2)
    one.cutting = 5e5
    turn(one, 1000.0, 0.2)
    assert abs(one.velocity) < 300.0
    assert one.limited


def test_its_position_is_what_its_speed_adds_up_to() -> None:
    one = motor(lag_s=0.01, slip=0.0)
    turn(one, 1000.0, 0.3)
    before = one.position
    turn(one, 1000.0, 1.0)
    assert one.position - before == pytest.approx(1000.0, rel=1e-6)
