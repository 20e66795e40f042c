"""The ramp of a spindle's speed, period by period."""

from __future__ import annotations

import itertools
import random

import pytest

from drives.pump.plan_memory import Memory, PlanReader, PlanWriter
from drives.pump.speed_ramp import NO_RAMP, SpeedRamp


def test_it_goes_by_equal_steps_and_tells_the_last_one_once_more() -> None:
    ramp = SpeedRamp(10, 1.0, -1.5, 1.0)
    assert [ramp.at(n) for n in range(9, 17)] == [None, None, 0.0, -1.0, -1.5, -1.5, None, None]
    assert ramp.value(10) == 1.0 and ramp.value(1000) == -1.5


def test_nobody_is_led_without_one_or_where_the_speed_is_that_already() -> None:
    assert NO_RAMP.at(1) is None
    assert SpeedRamp(10, 2.0, 2.0, 1.0).at(11) is None


@pytest.mark.parametrize("seed", range(20))
def test_no_step_is_longer_and_none_goes_past_the_end(seed: int) -> None:
    rng = random.Random(seed)
    ramp = SpeedRamp(rng.randrange(1000), rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(0.01, 2.0))
    values = [ramp.value(ramp.begin + n) for n in range(12_000)]
    steps = [b - a for a, b in itertools.pairwise(values)]
    up = ramp.to_rev_s > ramp.from_rev_s
    assert all(0.0 <= (step if up else -step) <= ramp.step_rev_s * (1.0 + 1e-9) for step in steps)
    assert values[0] == ramp.from_rev_s and values[-1] == ramp.to_rev_s


def test_it_is_in_a_plan() -> None:
    memory, ramp = Memory(2), SpeedRamp(5, 1.0, 3.0, 0.25)
    writer, reader = PlanWriter(memory), PlanReader(memory)
    for period in range(3):
        writer.put(period, (float(period), 0.0, 0.0))
    writer.publish(0, 0, 3, 10, anew=True, ramp=ramp)
    assert reader.take(0, True) and reader.ramp == ramp
    writer.publish(0, 1, 3, 10)
    assert reader.take(1, False) and reader.ramp == NO_RAMP
