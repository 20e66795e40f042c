"""The jog's law of motion: limits in differences, no overshoot, and an end that is met exactly."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest

from controller.tick.ramp import Ramp

ROUNDING = 1.0 + 1e-6


class Watched:
    """A ramp whose every tick is compared with its limits."""

    def __init__(self, acceleration: float, jerk: float, end: float) -> None:
        self.ramp = Ramp(acceleration, jerk, end)
        self.limits = (acceleration, jerk, end)
        self.fastest = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.ramp, name)

    def step(self, speed: float) -> None:
        p, v, a = self.p, self.v, self.a
        most_a, most_j, end = self.limits
        self.ramp.step(speed)
        self.fastest = max(self.fastest, speed)
        assert abs(self.a - a) <= most_j * ROUNDING
        assert abs(self.a) <= most_a * ROUNDING
        assert -1e-15 <= self.v <= self.fastest * ROUNDING
        assert self.v - v == pytest.approx(self.a, abs=1e-9 * self.fastest)
        assert self.p - p == pytest.approx(self.v, abs=1e-9 * max(self.p, self.fastest))
        assert self.p <= end * (1.0 + 1e-12)
        assert self._longest_stop(self.v, self.a) >= self._stop_length(self.v, self.a) * (1.0 - 1e-9)


def any_ramp(rng: random.Random) -> tuple[Watched, float]:
    """With the largest speed to ask it for."""
    jerk = 10 ** rng.uniform(-6, -2)
    acceleration = jerk * rng.uniform(1, 80)
    most = acceleration * rng.uniform(0.5, 40)
    ends = (
        0.0,
        rng.uniform(0, 3) * most,
        rng.uniform(0, 200) * most,
        10 ** rng.uniform(-8, 0) * most,
        math.inf,
    )
    return Watched(acceleration, jerk, rng.choice(ends)), most


def test_an_operator_of_any_kind_never_gets_it_beyond_a_limit_and_always_to_rest() -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for _ in range(60):
        ramp, most = any_ramp(rng)
        speed = rng.uniform(0.0, most)
        for _ in range(rng.randint(10, 800)):
            if rng.random() < 0.02:
                speed = rng.choice((0.0, rng.uniform(0.0, most), most))
            ramp.step(speed)
        for _ in range(3000):
            if ramp.at_rest:
                break
            ramp.step(0.0)
        assert ramp.at_rest, f"seed {seed}"


def test_the_end_is_met_exactly_and_at_rest_from_every_state() -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for _ in range(40):
        ramp, most = any_ramp(rng)
        end = ramp.limits[2]
        if math.isinf(end):
            continue
        for _ in range(rng.randint(0, 300)):
            ramp.step(rng.choice((0.0, 0.3 * most, most)))
        still = 0
        while still < 5:
            ramp.step(most)
            still = still + 1 if ramp.at_rest else 0
        assert ramp.p == pytest.approx(end, rel=1e-9), f"seed {seed}"


def test_a_speed_is_reached_in_the_time_of_the_limits_and_kept_to_the_last_digit() -> None:
    acceleration, jerk, speed = 0.008, 0.0004, 0.4
    ramp = Watched(acceleration, jerk, math.inf)
    ticks = 0
    while ramp.v != speed:
        ramp.step(speed)
        ticks += 1
    assert ticks <= speed / acceleration + acceleration / jerk + 2
    for _ in range(10):
        ramp.step(speed)
        assert ramp.v == speed and ramp.a == pytest.approx(0.0, abs=1e-15)


def test_a_stop_takes_the_time_of_the_limits() -> None:
    acceleration, jerk, speed = 0.008, 0.0004, 0.4
    ramp = Watched(acceleration, jerk, math.inf)
    for _ in range(200):
        ramp.step(speed)
    ticks = 0
    while not ramp.at_rest:
        ramp.step(0.0)
        ticks += 1
    assert ticks <= speed / acceleration + acceleration / jerk + 3


@pytest.mark.parametrize("back", (False, True))
def test_it_stands_at_once_and_takes_its_last_step_back(back: bool) -> None:
    ramp = Ramp(0.01, 0.001, 100.0)
    for _ in range(30):
        ramp.step(0.2)
    p, v = ramp.p, ramp.v
    assert 0.0 < v < p
    ramp.stand(back)
    assert ramp.p == (p - v if back else p) and ramp.v == ramp.a == 0.0 and ramp.at_rest
    for _ in range(5):
        ramp.step(0.0)
    assert ramp.p == (p - v if back else p)


def test_a_landing_that_was_ended_is_forgotten() -> None:
    ramp = Ramp(0.01, 0.001, 2.0)
    while ramp._landing is None:
        ramp.step(0.2)
    ramp.stand(False)
    before = ramp.p
    ramp.step(0.2)
    assert ramp._landing is None or ramp.p > before
    assert ramp.v == ramp.a == pytest.approx(0.001)
