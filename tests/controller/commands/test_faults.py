"""``directrix faults``: the table of a machine."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from controller.__main__ import app
from controller.state import FAULTS, Fault

ASK = CliRunner()


def test_every_fault_is_listed_with_class_trust_remedy_and_promise() -> None:
    told = json.loads(ASK.invoke(app, ["faults", "trunnion", "--json"]).stdout)
    assert [row["fault"] for row in told["faults"]] == [fault.name for fault in Fault if fault]
    by_name = {row["fault"]: row for row in told["faults"]}
    assert by_name["DOOR_OPEN"]["class"] == "hold on the path"
    assert by_name["BUS_OFF"]["stands_within_s"] == pytest.approx(0.2 + 2 * 0.002 + 0.12)
    assert by_name["NODE_RESET"]["recovery"] == "commission"
    for row in told["faults"]:
        assert row["position_trusted"] is FAULTS[Fault[row["fault"]]].position_trusted


def test_the_table_shows_each_fault_once() -> None:
    shown = ASK.invoke(app, ["faults"]).stdout
    assert "Faults of trunnion" in shown
    for fault in (Fault.FOLLOWING_ERROR, Fault.CONTROLLER_GONE):
        assert shown.count(fault.name[:9]) >= 1
