"""The exact step of the servo against fine numerical integration, and what it does to a path."""

from __future__ import annotations

import math
import random

import pytest

from drives.bench.simulated.servo import Servo


def integrated(targets: list[float], period_s: float, frequency_hz: float, damping: float) -> float:
    """Position after the targets, by many small steps of the differential equation."""
    w, x, v, start, end, parts = 2 * math.pi * frequency_hz, 0.0, 0.0, 0.0, 0.0, 4000
    for target in targets:
        h, slope = period_s / parts, (end - start) / period_s
        for part in range(parts):
            r = start + slope * (part + 0.5) * h
            middle_x, middle_v = x + v * h / 2, v + (w * w * (r - x) - 2 * damping * w * v) * h / 2
            x, v = x + middle_v * h, v + (w * w * (r - middle_x) - 2 * damping * w * middle_v) * h
        start, end = end, target
    return x


@pytest.mark.parametrize("damping", [0.3, 0.7071, 0.99])
def test_one_step_is_the_solution_of_the_differential_equation(damping: float) -> None:
    targets = [0.0, 100.0, 250.0, 250.0, -40.0, 7.0, 7.0]
    servo = Servo()
    servo.tune(0.002, 60.0, damping, 0.0)
    for target in targets:
        servo.step(target)
    assert servo.position == pytest.approx(integrated(targets, 0.002, 60.0, damping), abs=1e-3)


def test_at_constant_speed_the_lag_is_constant_and_feed_forward_removes_it() -> None:
    for feed_forward, lag_s in ((0.0, math.sqrt(2.0) / (2 * math.pi * 60.0)), (1.0, 0.0)):
        servo = Servo()
        servo.tune(0.002, 60.0, math.sqrt(0.5), feed_forward)
        for k in range(2000):
            servo.step(20.0 * k)
        assert servo.start - servo.position == pytest.approx(10000.0 * lag_s, abs=1e-6)


def test_equal_lags_bend_a_path_by_micrometres_only() -> None:
    """A circle of radius 0.4 mm at 1000 mm/s^2 (counts: 200000 per mm) stays round within 2 um."""
    radius, acceleration, scale = 0.4, 1000.0, 200000.0
    turn = math.sqrt(acceleration / radius)
    x, y = Servo(), Servo()
    for servo in (x, y):
        servo.tune(0.002, 60.0, math.sqrt(0.5), 0.0)
    worst = 0.0
    for k in range(1000):
        x.step(radius * scale * math.cos(turn * k * 0.002))
        y.step(radius * scale * math.sin(turn * k * 0.002))
        if k > 200:
            worst = max(worst, abs(math.hypot(x.position, y.position) / scale - radius))
    assert worst < 0.002


def test_a_damping_of_one_or_more_is_refused() -> None:
    with pytest.raises(ValueError, match="damping"):
        Servo().tune(0.002, 60.0, 1.0, 0.0)


@pytest.mark.parametrize(("strongest", "fastest"), [(math.inf, math.inf), (4e5, 3e4), (5e4, 3e3)])
def test_an_axis_at_rest_is_the_law_to_the_last_bit(strongest: float, fastest: float) -> None:
    quick, whole = Servo(), Servo()
    for servo in (quick, whole):
        servo.tune(0.002, 60.0, math.sqrt(0.5), 0.0)
        servo.limit(strongest, fastest)
    whole._calm = -1.0  # never taken to be at rest
    rng, target, rests = random.Random(4), 0.0, 0
    for n in range(20_000):
        if n % 400 < 40:
            target += round(rng.uniform(-30.0, 30.0))
        rests += quick.start == quick.end == quick.position and quick.velocity != 0.0
        quick.step(target)
        whole.step(target)
        found = quick.position, quick.velocity, quick.start, quick.end, quick.limited
        assert found == (whole.position, whole.velocity, whole.start, whole.end, whole.limited)
    assert rests > 1000
