"""Nothing is started on a bus that has no room for the tick."""

from __future__ import annotations

import pytest
from support.machines.stepped_runs import program, shipped

from controller.session import live
from controller.session.bus_load import budgets, overload
from controller.session.startup import SessionError


def test_a_live_machine_with_a_tick_too_short_for_its_bus_is_not_started() -> None:
    machine = shipped(period_s=0.001)
    text = program("example1_ready.ngc").encode()
    with (
        pytest.raises(SessionError, match="2 buses with at most 3 drives"),
        live.started(machine, text, "a.ngc"),
    ):
        raise AssertionError("it has been started")


def test_the_allowed_share_is_the_machine_files() -> None:
    assert overload(shipped()) == ""
    assert "allowed are 50%" in overload(shipped(max_bus_share=0.5))


def test_there_is_a_budget_for_each_bus_in_the_order_of_the_file() -> None:
    found = budgets(shipped("trunnion_five_buses"))
    assert [one.bus for one in found] == ["can0", "can1", "can2", "can3", "can4"]
