"""The fault table: what each row promises and says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.shipped_kinds import machine
from support.suite.cases import each

from controller.machine.model import Stopping
from controller.state import stop_times
from controller.state.fault_table import Sender
from controller.state.modes import (
    FAULTS,
    Fault,
    Reaction,
    Recovery,
    Times,
    Wait,
    sentence,
    stands_within_s,
    waits_s,
)
from drives.arranged import Arranged

TIMES = Times(0.002, 0.2, 5.0, 120.0, 10.0, path_stop_s=0.5, quick_stop_s=0.1)


@pytest.mark.parametrize(
    ("fault", "promised_s", "why"),
    [
        (Fault.NONE, 0.0, "nothing stops"),
        (Fault.DRIVE_WARNING, 0.0, "nothing stops"),
        (Fault.PLANNER_GONE, 2 * 0.002 + 0.5 + 0.1, "from the queue's end on"),
        (Fault.EMCY, 3 * 0.002 + 0.5 + 0.1, "the others stop on the path"),
        (Fault.HEARTBEAT_LOST, 0.2 + 2 * 0.002 + 0.5 + 0.1, "noticed after the silence"),
        (Fault.EMERGENCY_STOP, 2 * 0.002 + 0.1, "every drive's own ramp"),
        (Fault.BUS_OFF, 0.2 + 2 * 0.002 + 0.1, "the drives notice the silence and ramp"),
        (Fault.CONTROLLER_GONE, 0.2 + 2 * 0.002 + 0.1, "likewise"),
    ],
)
def test_a_row_promises_the_sum_of_noticing_and_stopping(fault: Fault, promised_s: float, why: str) -> None:
    assert stands_within_s(fault, TIMES) == pytest.approx(promised_s), why


def test_a_deaf_drive_is_given_the_time_of_its_own_supervision() -> None:
    short = TIMES._replace(path_stop_s=0.05)
    assert stands_within_s(Fault.EMCY, short) == pytest.approx(3 * 0.002 + 0.2 + 0.1)


def test_where_feedback_comes_seldom_it_is_missed_later() -> None:
    seldom = TIMES._replace(feedback_every=4)
    later_s = stands_within_s(Fault.FEEDBACK_LOST, seldom) - stands_within_s(Fault.FEEDBACK_LOST, TIMES)
    assert later_s == pytest.approx(4 * 3 * 0.002)


@pytest.mark.parametrize("wait", Wait)
def test_every_wait_has_its_time(wait: Wait) -> None:
    assert waits_s(wait, TIMES) >= 0.0


@each("fault", Fault)
def test_the_remedy_in_steps_fits_class_and_trust(fault: Fault) -> None:
    row = FAULTS[fault]
    if row.reaction >= Reaction.PATH_STOP:
        assert row.recovery >= Recovery.RESET, "the mode FAULT is left by a reset only"
    if row.reaction in (Reaction.HOLD, Reaction.END_OF_BLOCK):
        assert row.recovery is Recovery.RESUME
    if not row.position_trusted:
        assert row.recovery >= Recovery.HOME, "what is not trusted must be homed"
        assert "hom" in row.remedy, "and the operator must be told"
    if row.recovery is Recovery.COMMISSION:
        assert "commission" in row.remedy


def test_a_sentence_names_the_axis_and_what_came_on_top() -> None:
    said = sentence(Fault.FOLLOWING_ERROR, "C", Fault.NODE_RESET)
    assert said.startswith("Axis C: The axis is not where it was told")
    assert " Also: A drive started anew" in said
    assert " Also" not in sentence(Fault.EMCY, "C", Fault.EMCY)


@pytest.mark.parametrize(
    ("can_id", "begins"),
    [
        (0x083, "Node 3, emergencies (083h), 2400 a second: A node sends"),
        (0x705, "Node 5, heartbeats (705h), 2400 a second: A node sends"),
        (0x281, "Node 1, feedback (281h), 2400 a second: A node sends"),
        (0x301, "Node 1, setpoints (301h), 2400 a second: A node sends"),
        (0x602, "Node 2, SDO (602h), 2400 a second: A node sends"),
        (0x001, "Frames 001h, of no node, 2400 a second: A node sends"),
        (0x8001_2345, "Frames 12345h, of no node, 2400 a second: A node sends"),
        (-1, "A node sends"),
    ],
)
def test_a_sentence_names_who_sends_too_much_which_frames_and_how_many(can_id: int, begins: str) -> None:
    sender = Sender(can_id, 2400.4)
    assert sentence(Fault.NODE_CHATTERS, sender=sender).startswith(begins)
    assert "a second" not in sentence(Fault.DRIVE_WARNING, sender=sender)
    flooded = sentence(Fault.BUS_FLOODED, also=Fault.NODE_CHATTERS, sender=sender)
    assert " Also" not in flooded and flooded.count("a second") == (can_id >= 0)


def test_every_frame_of_a_node_has_a_name() -> None:
    for can_id in range(0x800):
        german = sentence(Fault.NODE_CHATTERS, language="de", sender=Sender(can_id, 1.0))
        assert german.startswith(("Knoten ", "Telegramme ")) and "frames." not in german


def test_a_drive_that_was_read_to_brake_softer_makes_the_promise_longer() -> None:
    made = machine()
    read = [Arranged(axis.name, i, stop_s=0.05) for i, axis in enumerate(made.axes)]
    assert stop_times.of(made, read).quick_stop_s == pytest.approx(0.05)
    read[2] = Arranged(made.axes[2].name, 3, stop_s=10.0)
    found = stop_times.of(made, read)
    assert stands_within_s(Fault.EMERGENCY_STOP, found) == pytest.approx(10.0 + 2 * made.period_s)
    assert stop_times.of(made, read[:2]).quick_stop_s == stop_times.quick_stop_s(made), (
        "the others as the file says"
    )


def test_a_machine_file_that_brakes_harder_promises_less() -> None:
    made = machine()
    axes = tuple(
        replace(axis, stopping=Stopping(quick_stop=2.0 * axis.limits.acceleration)) for axis in made.axes
    )
    assert stop_times.quick_stop_s(replace(made, axes=axes)) == pytest.approx(
        stop_times.quick_stop_s(made) / 2.0
    )


def test_a_machines_times_follow_from_its_axes() -> None:
    made = machine()
    found = stop_times.of(made)
    slowest = max(a.limits.velocity / a.limits.acceleration for a in made.axes)
    assert found.quick_stop_s == pytest.approx(slowest)
    assert found.path_stop_s > slowest and found.period_s == made.period_s
