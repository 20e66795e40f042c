"""A path that two walk along: neither misses an item, and what breaks it stops both at the same place."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from controller.plan.foresight import twice
from controller.plan.stretch import Chain, Pause
from controller.program.modal import power_on
from controller.program.program import Place


def pauses(count: int, error: Exception | None = None) -> Iterator[Chain | Pause]:
    for line in range(count):
        yield Pause(Place(line + 1, 1), power_on().modal)
    if error is not None:
        raise error


def test_both_get_all_of_it_whoever_is_first() -> None:
    planner, foresight = twice(pauses(5))
    assert [next(planner), next(planner)] == [next(foresight), next(foresight)]
    assert len(list(foresight)) == 3 and len(list(planner)) == 3


@pytest.mark.parametrize("error", [ValueError("ours"), RuntimeError("too")])
def test_what_one_meets_first_the_other_meets_in_its_place(error: Exception) -> None:
    planner, foresight = twice(pauses(2, error))
    for walk in (foresight, planner):
        assert len([next(walk), next(walk)]) == 2
        with pytest.raises(type(error)):
            next(walk)
