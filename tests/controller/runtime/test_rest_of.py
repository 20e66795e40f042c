"""A program by its text: all of it dry, and what is left of it from a place on."""

from __future__ import annotations

import numpy as np
import pytest
from support.machines.interrupted_runs import EXAMPLE_2
from support.machines.stepped_runs import shipped

from controller.plan.restart.program_position import Spot
from controller.plan.segment import ContinuousPath, Pause
from controller.program.program import ProgramError
from controller.runtime import checked


def task(text: str = EXAMPLE_2) -> checked.Task:
    return checked.task(text.encode(), "part.ngc", shipped())


def test_a_dry_run_of_the_whole_program_is_its_path_with_every_cut_off_the_part() -> None:
    plain, dry = (list(checked.path_of(task(), {}, by_mm).items) for by_mm in (0.0, 20.0))
    assert len(plain) == len(dry)
    for a, b in zip(plain, dry, strict=True):
        if isinstance(b, Pause):
            assert b.modal.spindle_rev_min == 0.0 and b.modal.coolant == 0
            continue
        assert isinstance(a, ContinuousPath)
        for one, other in zip(a.segments, b.segments, strict=True):
            if one.cutting:
                way = np.subtract(other.start, one.start)
                assert np.abs(way - [0.0, 0.0, 20.0, 0.0, 0.0]).max() < 1e-9, "this machine's tool axis is Z"


@pytest.mark.parametrize("by_mm", [-1.0, float("nan"), 1e6])
def test_an_impossible_offset_of_a_dry_run_is_refused(by_mm: float) -> None:
    with pytest.raises(ProgramError, match="0 to 10000 mm"):
        checked.path_of(task(), {}, by_mm)


def test_the_rest_of_a_program_begins_at_the_place_with_the_choices_of_its_check() -> None:
    asked = task()
    rest = checked.rest_of(asked, checked.chosen_for(asked), Spot(19, 0.5))
    whole = checked.segments(checked.path_of(asked, checked.chosen_for(asked)))
    first = next(item for item in rest.items if isinstance(item, ContinuousPath))
    assert first.first_id == rest.spot.motion_id and first.from_s == rest.spot.s
    assert first.segments[0].start == whole[rest.spot.motion_id].start
