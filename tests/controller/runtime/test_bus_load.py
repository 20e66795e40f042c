"""Nothing is started on a bus that has no room for the tick."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.machines.stepped_runs import shipped

from controller.messages import text
from controller.runtime.bus_load import budgets, overload
from controller.runtime.startup import SessionError
from controller.service.folders import Folders
from controller.service.service import Service


def test_a_machine_with_a_tick_too_short_for_its_bus_is_not_started(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="2 buses with at most 3 drives"):
        Service(shipped(period_s=0.001), Folders.within(tmp_path))


def test_the_allowed_share_is_the_machine_files() -> None:
    assert overload(shipped()) is None
    assert "allowed are 50%" in text(overload(shipped(max_bus_share=0.5)))


def test_there_is_a_budget_for_each_bus_in_the_order_of_the_file() -> None:
    found = budgets(shipped("trunnion_five_buses"))
    assert [one.bus for one in found] == ["can0", "can1", "can2", "can3", "can4"]
