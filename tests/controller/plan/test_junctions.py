"""How fast a kink may be passed, held against positions as ticks sample them at every phase of a tick."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.plan import junctions

T = 0.002
LOOSE = 1e9
PHASES = np.linspace(0.0, 1.0, 201)  # of a tick, at which the kink is


def passed(rate: float, curve: float, acceleration: float, jerk: float) -> float:
    """By one axis, beside one that hardly moves."""
    rows = (np.array([[value, 1e-9]]) for value in (rate, curve))
    limits = (np.array([limit, limit]) for limit in (acceleration, jerk))
    return float(junctions.passed(*rows, *limits, T)[0])


def largest(rate: float, curve: float, speed: float, order: int) -> float:
    """Largest derivative of that order of an axis about a kink, by differences of its sampled positions."""
    found = 0.0
    for phase in PHASES:
        t = T * np.maximum(np.arange(-6.0, 7.0) + phase, 0.0)
        q = rate * speed * t + 0.5 * curve * (speed * t) ** 2
        found = max(found, float(np.abs(np.diff(q, order)).max()) / T**order)
    return found


@pytest.mark.parametrize(("acceleration", "jerk"), [(2.0, LOOSE), (LOOSE, 3000.0), (2.0, 900.0)])
def test_a_jump_of_rates_takes_its_share_of_the_limits_within_a_tick(
    acceleration: float, jerk: float
) -> None:
    speed = passed(0.3, 0.0, acceleration, jerk)
    assert largest(0.3, 0.0, speed, 2) <= acceleration and largest(0.3, 0.0, speed, 3) <= jerk
    step = 0.3 * speed
    assert max(step / (T * acceleration), step / (T * T * jerk)) == pytest.approx(0.8 * 0.7, rel=1e-6)


def test_a_jump_of_bends_takes_its_share_of_the_jerk_as_three_ticks_see_it() -> None:
    speed = passed(0.0, 0.5, LOOSE, 4000.0)
    assert largest(0.0, 0.5, speed, 3) == pytest.approx(0.8 * 4000.0, rel=1e-3)


@pytest.mark.parametrize(("rate", "curve"), [(0.3, 2.0), (0.01, 3.0), (0.1, 30.0)])
def test_both_jumps_together_take_no_more_than_the_share(rate: float, curve: float) -> None:
    speed = passed(rate, curve, LOOSE, 4000.0)
    taken = rate * speed / (T * T * 0.8 * 4000.0) + 0.75 * curve * speed**2 / (T * 0.8 * 4000.0)
    by_rate = rate * speed / (T * T * 0.8 * 4000.0)
    assert taken == pytest.approx(1.0, rel=1e-6) or by_rate == pytest.approx(0.7, rel=1e-6)
    assert taken <= 1.0 + 1e-9 and by_rate <= 0.7 + 1e-9


def test_the_axis_with_the_least_room_decides_at_each_of_many_boundaries() -> None:
    rates = np.array([[0.1, 0.4], [0.4, 0.1]])
    limits = np.array([1.0, 3.0])
    found = junctions.passed(rates, 0.0 * rates, limits, LOOSE * limits, T)
    assert found == pytest.approx([0.56 * T * 3.0 / 0.4, 0.56 * T * 1.0 / 0.4])
    least = junctions.least(rates, limits, T)
    assert least == pytest.approx([3.0 * T**2 * 3.0 / 0.4, 3.0 * T**2 * 1.0 / 0.4])


def test_a_straight_way_is_passed_at_any_speed_and_is_no_stop() -> None:
    none = np.zeros((1, 2))
    limits = np.array([1.0, 1.0])
    assert junctions.passed(none, none, limits, limits, T)[0] > 1e20
    assert (
        junctions.least(none, limits, T)[0] > 1e20 and junctions.reached(none, 1.0, limits, limits)[0] > 1e9
    )


@pytest.mark.parametrize(("acceleration", "jerk"), [(50.0, LOOSE), (LOOSE, 800.0), (50.0, 900.0)])
def test_a_start_reaches_what_constant_acceleration_or_constant_jerk_lead_to(
    acceleration: float, jerk: float
) -> None:
    rates, length = np.array([[0.5, 0.2]]), 0.7
    limits = np.array([acceleration, acceleration]), np.array([jerk, jerk])
    found = float(junctions.reached(rates, np.array([length]), *limits)[0])
    most, still = acceleration / 0.5, jerk / 0.5
    by_acceleration = most * math.sqrt(2.0 * length / most)
    by_jerk = 0.5 * still * (6.0 * length / still) ** (2.0 / 3.0)
    assert found == pytest.approx(min(by_acceleration, by_jerk), rel=1e-9)
