"""A path that two walk along: neither misses an item, and what breaks it stops both at the same place."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.machines.stepped_runs import shipped

from controller.machine.kinematics import kinematics_of
from controller.messages import message
from controller.plan.foresight import foreseen, twice
from controller.plan.segment import PathItem, Pause
from controller.program.modal import power_on
from controller.program.program import Place, ProgramError


def pauses(count: int, error: Exception | None = None) -> Iterator[PathItem]:
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


def test_of_a_path_that_is_refused_from_here_no_time_is_foreseen() -> None:
    """The check's own is shown then, and not the time up to where it breaks."""
    machine = shipped()
    why = ProgramError("part.ngc", 3, 1, message("restart.no_motion"))
    assert foreseen(pauses(2, why), machine, kinematics_of(machine)) is None
    assert foreseen(pauses(2), machine, kinematics_of(machine)) is not None
