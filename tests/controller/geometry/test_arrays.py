"""Tables of samples."""

from __future__ import annotations

import numpy as np
import pytest

from controller.geometry import arrays


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_a_cross_product_is_that_of_numpy_to_the_last_bit(count: int) -> None:
    a = np.random.default_rng(count).normal(size=(count + 1, 3))
    assert np.array_equal(arrays.cross(a[:-1], a[1:]), np.cross(a[:-1], a[1:]))


def test_places_within_reach_are_all_in_the_part() -> None:
    rng = np.random.default_rng(2)
    places = np.sort(rng.uniform(0.0, 10.0, 300))
    for at, reach in rng.uniform(0.0, 10.0, (200, 2)) * np.array([1.0, 0.2]):
        here = arrays.within(places, at, reach)
        near = np.flatnonzero(np.abs(places - at) <= reach)
        assert set(near) <= set(np.arange(len(places))[here])
        assert len(places[here]) <= len(near) + 2
