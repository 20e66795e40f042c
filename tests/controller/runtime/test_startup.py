"""Homing group by group: whoever gives it up between two of them has the rest stand."""

from __future__ import annotations

import pytest
from support.machines.stepped_runs import shipped

from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Mode


class GivenUp(Exception):
    """By an operator."""


def test_homing_that_is_given_up_moves_no_further_group() -> None:
    bench = SteppedMachine(shipped())
    groups = sorted({axis.homing.group for axis in bench.machine.axes})
    assert len(groups) > 1
    looked: list[int] = []

    def look() -> None:
        looked.append(bench.cycle.modes.homed)
        if len(looked) == 2:
            raise GivenUp

    with pytest.raises(GivenUp):
        bench._start_up.home(range(5), look)
    first = sum(1 << i for i, axis in enumerate(bench.machine.axes) if axis.homing.group == groups[0])
    assert looked == [0, first] and bench.cycle.modes.homed == first
    assert bench.cycle.modes.mode is Mode.OFF
    bench.come_up()
    assert bench.cycle.modes.mode is Mode.READY
