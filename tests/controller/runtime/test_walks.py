"""The path of a start without a stored check: laid once where that is enough, once more where it is not."""

from __future__ import annotations

import pytest
from support.machines import probing_machine
from support.machines.stepped_runs import program, shipped

from controller.machine.model import Machine
from controller.runtime import checked
from controller.runtime.checked import Task

WALL = program("example2_ready.ngc", "1000.")
PROBED = "G21 G90 G54\nT99 M6\nG38.3 Z-2. F100.\nG1 X#5061 F500.\nM30\n"


def task(source: str, machine: Machine) -> Task:
    return checked.task(source.encode(), "part.ngc", machine)


def test_a_checked_path_is_run_as_it_was_laid() -> None:
    asked = task(WALL, shipped())
    walk = checked.walk_of(asked, None, False)
    laid = list(checked.path_of(asked, walk.choices).items)
    assert isinstance(walk.items, list) and repr(walk.items) == repr(laid)


@pytest.mark.parametrize(
    ("source", "machine", "most"),
    [
        pytest.param(WALL, shipped(), 3, id="long"),
        pytest.param(PROBED, probing_machine.machine("trunnion"), checked.MAX_KEPT, id="probing"),
    ],
)
def test_a_long_path_and_one_that_its_run_decides_on_are_laid_once_more(
    monkeypatch: pytest.MonkeyPatch, source: str, machine: Machine, most: int
) -> None:
    monkeypatch.setattr(checked, "MAX_KEPT", most)
    assert not isinstance(checked.walk_of(task(source, machine), None, False).items, list)
