"""Motor, load and encoder with friction, backlash and increments, against what each must do."""

from __future__ import annotations

import math

import pytest

from drives.bench.simulated.plant import Plant, PlantParameters
from drives.bench.simulated.servo import Servo

PERIOD_S = 0.002


def tuned(servo: Servo) -> Servo:
    servo.tune(PERIOD_S, 60.0, math.sqrt(0.5), 0.0)
    return servo


def plant(**nature: float) -> Plant:
    made = Plant(0.0, PlantParameters(increment=1e-6, **nature))  # type: ignore[arg-type]
    tuned(made)
    return made


def test_an_ideal_plant_moves_as_the_exact_servo() -> None:
    """Steps of 125 us stand for the exact solution within 3 % of the lag at full speed."""
    fastest = 50_000.0 * 0.02 / PERIOD_S
    lag = fastest * math.sqrt(2.0) / (2.0 * math.pi * 60.0)
    ideal, exact = plant(), tuned(Servo())
    worst = 0.0
    for k in range(300):
        target = 50_000.0 * math.sin(0.02 * k)
        ideal.step(target)
        exact.step(target)
        worst = max(worst, abs(ideal.position - exact.position))
    assert worst < 0.03 * lag


def test_coulomb_friction_leaves_a_standing_error_no_larger_than_it_can_hold() -> None:
    coulomb = 2e6
    rubbed = plant(coulomb=coulomb)
    for _ in range(500):
        rubbed.step(1_000.0)
    error = abs(1_000.0 - rubbed.position)
    assert 0.0 < error <= coulomb / (2.0 * math.pi * 60.0) ** 2
    assert rubbed.velocity == 0.0


def test_viscous_friction_adds_to_the_lag() -> None:
    lags = []
    for viscous in (0.0, 50.0):
        rubbed = plant(viscous=viscous)
        for k in range(500):
            rubbed.step(20.0 * k)
        lags.append(rubbed.start - rubbed.position)
    extra = 50.0 * 20.0 / PERIOD_S / (2.0 * math.pi * 60.0) ** 2
    assert lags[1] - lags[0] == pytest.approx(extra, rel=0.02)


@pytest.mark.parametrize("encoder_on_load", [False, True])
def test_backlash_shows_when_the_direction_turns(encoder_on_load: bool) -> None:
    gap = 40.0
    made = Plant(0.0, PlantParameters(backlash=gap, encoder_on_load=encoder_on_load, increment=1e-6))
    tuned(made)
    loads = []
    for target in (1_000.0, 0.0):
        for k in range(400):
            made.step(target if k > 100 else made.end + (target - made.end) * k / 100.0)
        loads.append(made.load)
    if encoder_on_load:
        assert loads == pytest.approx([1_000.0, 0.0], abs=1.0)
    else:
        assert loads == pytest.approx([1_000.0 - gap / 2, gap / 2], abs=1.0)


def test_the_encoder_tells_whole_increments() -> None:
    made = Plant(0.0, PlantParameters(increment=25.0))
    tuned(made)
    seen = set()
    for k in range(200):
        made.step(7.0 * k)
        seen.add(made.position % 25.0)
    assert seen == {0.0}


def test_the_motor_gives_no_more_than_it_can() -> None:
    weak = plant(strongest=1e5)
    before = 0.0
    for _ in range(50):
        weak.step(1e6)
        assert abs(weak.velocity - before) <= 1e5 * PERIOD_S * 1.001
        before = weak.velocity


def test_homing_moves_the_counting_of_motor_and_load() -> None:
    made = plant(backlash=10.0)
    made.shift(500.0)
    assert (made.motor, made.load, made.position) == (500.0, 500.0, 500.0)
