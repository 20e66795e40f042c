import math
import random

import pytest

from drives import scale


def test_a_value_goes_to_its_nearest_count():
    assert scale.to_counts(1.23456, 1000.0) == 1235
    assert scale.to_counts(-1.23456, 1000.0) == -1235
    assert scale.to_counts(1.0, -200000.0) == -200000


def test_the_whole_range_of_int32_is_used_and_not_one_count_more():
    assert scale.to_counts(2**31 - 1, 1.0) == 2**31 - 1
    assert scale.to_counts(-(2**31), 1.0) == -(2**31)
    assert scale.to_counts(2**31, 1.0) is None
    assert scale.to_counts(-(2**31) - 1, 1.0) is None


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_no_setpoint(value):
    assert scale.to_counts(value, 1000.0) is None


def test_there_and_back_is_half_a_count_off_at_most():
    seed = random.randrange(2**32)
    source = random.Random(seed)
    for _ in range(1000):
        per_unit = source.choice([-1, 1]) * 10 ** source.uniform(1, 7)
        value = source.uniform(-1, 1) * scale.reach(per_unit)
        counts = scale.to_counts(value, per_unit)
        assert counts is not None, f"seed {seed}"
        assert abs(scale.to_value(counts, per_unit) - value) <= 0.5000001 / abs(per_unit), f"seed {seed}"


def test_rounding_alone_makes_four_counts_of_third_difference():
    worst = [0.5, -0.5, 0.5, -0.5]
    third = worst[3] - 3 * worst[2] + 3 * worst[1] - worst[0]
    assert scale.rounding_jerk(200_000.0, 0.002) == pytest.approx(abs(third) / 200_000.0 / 0.002**3)
