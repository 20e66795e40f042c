"""A modal state as JSON: without loss, and what an earlier version has written is read."""

from __future__ import annotations

import json
from typing import Any

import pytest

from controller.program import carried
from controller.program.modal import Cycle, State, power_on


def state() -> State:
    """In the middle of a row of holes in inches."""
    return power_on()._replace(
        motion="G83", mm_per_unit=25.4, cycle=Cycle("G83", -25.4, 2.54, 50.0, 5.08, mm_per_unit=25.4)
    )


def written() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(json.dumps(carried.to_json(state())))
    return found


def test_a_cycle_goes_on_in_the_unit_in_which_it_was_written() -> None:
    assert carried.from_json(written()).cycle == state().cycle


def test_of_a_state_that_an_earlier_version_has_written_the_cycle_is_in_millimetres() -> None:
    values = written()
    del values["cycle"]["mm_per_unit"]
    assert carried.from_json(values).cycle == Cycle("G83", -25.4, 2.54, 50.0, 5.08)


@pytest.mark.parametrize(("room", "name"), [("cycle", "clearance"), ("modal", "tool")])
def test_a_state_that_lacks_anything_else_is_none(room: str, name: str) -> None:
    values = written()
    del values[room][name]
    with pytest.raises(KeyError):
        carried.from_json(values)
