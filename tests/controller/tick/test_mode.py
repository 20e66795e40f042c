"""Modes: every request in every mode, and the reaction to every fault."""

from __future__ import annotations

import pytest
from ticking import FakeGroup

from controller.state import ALWAYS, FAULTS, TRANSITIONS, Fault, Mode, Reaction, Request, follows
from controller.tick.mode import DRIVE_FAULTS, Modes
from drives.cia402 import Wanted
from drives.drive import DriveFault


def modes_in(mode: Mode) -> tuple[Modes, FakeGroup]:
    group = FakeGroup([0] * 5)
    modes = Modes(group, 0.002)
    modes.mode = mode
    return modes, group


@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("request_", Request)
def test_every_request_in_every_mode_does_what_the_table_says(mode: Mode, request_: Request) -> None:
    modes, _ = modes_in(mode)
    modes.request(request_, 1.0, standing=True)
    if request_ is Request.ESTOP:
        assert modes.mode is Mode.FAULT
        return
    expected = follows(mode, request_)
    assert modes.mode is (mode if expected is None else expected)
    assert (modes.refused == request_) is (expected is None)


def test_the_table_names_only_requests_that_can_be_refused() -> None:
    assert not any(request in ALWAYS for _, request in TRANSITIONS)


@pytest.mark.parametrize("fault", Fault)
def test_every_fault_has_a_text_and_a_remedy_in_whole_sentences(fault: Fault) -> None:
    row = FAULTS[fault]
    assert row.text.endswith(".") and row.remedy.endswith(".")


def test_every_fault_of_a_drive_has_its_own_row() -> None:
    assert set(DRIVE_FAULTS) == set(DriveFault)


@pytest.mark.parametrize("fault", [f for f in Fault if f is not Fault.NONE])
def test_a_fault_while_running_reacts_by_its_row(fault: Fault) -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(fault, 2)
    reaction = FAULTS[fault].reaction
    assert modes.mode is Mode.FAULT and modes.fault is fault
    wanted = [drive.wanted for drive in group.drives]
    if reaction is Reaction.QUICK_STOP:
        assert wanted == [Wanted.QUICK_STOP] * 5 and not modes.on_path
    elif reaction is Reaction.LOST_DRIVE:
        assert wanted[2] is Wanted.QUICK_STOP and wanted.count(Wanted.QUICK_STOP) == 1 and modes.on_path
    else:
        assert Wanted.QUICK_STOP not in wanted and modes.on_path


def test_a_lost_drive_quick_stops_the_group_once_the_others_stand() -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(Fault.STATE_LOST, 1)
    modes.progress(1, standing=False)
    assert group.wanted is not Wanted.QUICK_STOP
    modes.progress(1, standing=True)
    assert group.wanted is Wanted.QUICK_STOP


def test_the_first_fault_stays_shown_and_a_harder_reaction_still_acts() -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(Fault.PLANNER_GONE, -1)
    modes.fail(Fault.BUS_ERROR, 0)
    assert modes.fault is Fault.PLANNER_GONE and group.wanted is Wanted.QUICK_STOP


def test_reset_waits_for_standstill() -> None:
    modes, group = modes_in(Mode.RUNNING)
    modes.fail(Fault.PLANNER_GONE, -1)
    modes.request(Request.RESET, 0.0, standing=False)
    assert modes.mode is Mode.FAULT and modes.refused == Request.RESET
    modes.request(Request.RESET, 0.0, standing=True)
    assert modes.mode is Mode.OFF and modes.fault is Fault.NONE and group.wanted is Wanted.RESET


@pytest.mark.parametrize("value", (-0.1, 2.5, float("nan"), float("inf")))
def test_an_override_out_of_range_changes_nothing(value: float) -> None:
    modes, _ = modes_in(Mode.RUNNING)
    modes.request(Request.OVERRIDE, value, standing=False)
    assert modes.override == 1.0 and modes.refused == Request.OVERRIDE


def test_a_drive_that_does_not_enable_in_time_is_named() -> None:
    modes, group = modes_in(Mode.OFF)
    modes.request(Request.ENABLE, 0.0, standing=True)
    for i in (0, 1, 2, 4):
        group.drives[i].following = True
    for _ in range(2600):
        modes.progress(1, standing=True)
    assert (modes.fault, modes.fault_axis) == (Fault.ENABLE_TIMEOUT, 3)
