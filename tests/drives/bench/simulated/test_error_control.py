"""Heartbeats both ways, node guarding, NMT states, and what a drive does when its master is gone."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import (
    PRE_OPERATIONAL,
    RESET_COMMUNICATION,
    RESET_NODE,
    START,
    STOP,
    Lone,
    Refused,
)

from drives import pdo
from drives.bench.simulated.machine402 import Power

BEAT, GUARD = 0x705, 0x705 | pdo.REMOTE_FLAG
STATES = {START: 5, STOP: 4, PRE_OPERATIONAL: 127}


@pytest.mark.parametrize("to_all", [False, True])
def test_every_nmt_command_leads_to_its_state_from_every_other(to_all: bool) -> None:
    lone = Lone()
    for first in STATES:
        for second, state in STATES.items():
            for command in (first, second):
                lone.put(pdo.NMT, bytes([command, 0 if to_all else 5]))
            assert lone.drive.nmt == state
    for command in (RESET_NODE, RESET_COMMUNICATION):
        lone.nmt(START)
        lone.put(pdo.NMT, bytes([command, 0 if to_all else 5]), 0.03)
        assert (lone.drive.nmt, lone.heard[-1]) == (127, (BEAT, b"\0"))


def test_a_command_to_another_node_is_not_ours() -> None:
    lone = Lone()
    lone.put(pdo.NMT, bytes([START, 6]))
    lone.put(pdo.NMT, bytes([START]))
    assert lone.drive.nmt == 127


def test_sdo_is_dead_when_stopped() -> None:
    lone = Lone()
    lone.nmt(STOP)
    assert lone.sdo(bytes.fromhex("40001000")) == []


def test_the_heartbeat_tells_the_state_every_period() -> None:
    lone = Lone()
    lone.write(0x1017, 0, 100, 2)
    for command, state in STATES.items():
        lone.nmt(command, 0.0)
        before = len(lone.of(BEAT))
        lone.wait(1.0)
        assert lone.of(BEAT)[before:] == [bytes([state])] * 10
    lone.nmt(PRE_OPERATIONAL)
    lone.write(0x1017, 0, 0, 2)
    before = len(lone.of(BEAT))
    lone.wait(1.0)
    assert len(lone.of(BEAT)) == before


def test_eight_producers_are_watched_and_each_is_missed() -> None:
    lone = Lone()
    for sub in range(1, 9):
        lone.write(0x1016, sub, (0x10 + sub) << 16 | 100, 4)
    lone.wait(1.0)
    assert lone.emergencies() == [], "watching starts with the first heartbeat"
    for sub in range(1, 9):
        lone.put(0x710 + sub, b"\x05", 0.0)
    lone.wait(0.05)
    for sub in range(1, 8):
        lone.put(0x710 + sub, b"\x05", 0.0)
    lone.wait(0.06)
    assert lone.emergencies() == [0x8130], "number eight is missing"
    lone.put(0x718, b"\x05", 0.01)
    assert lone.emergencies() == [0x8130, 0], "and is back"


def test_the_same_producer_cannot_be_watched_twice_but_moved() -> None:
    lone = Lone()
    lone.write(0x1016, 1, 0x20_0064, 4)
    with pytest.raises(Refused, match="06040043"):
        lone.write(0x1016, 2, 0x20_00C8, 4)
    lone.write(0x1016, 1, 0, 4)
    lone.write(0x1016, 2, 0x20_00C8, 4)


def test_guarding_answers_with_the_state_and_a_toggle() -> None:
    lone = Lone()
    answers = [lone.put(GUARD)[0][1][0] for _ in range(4)]
    assert answers == [127, 127 | 0x80, 127, 127 | 0x80]
    lone.nmt(START)
    assert lone.put(GUARD)[0][1][0] == 5
    lone.nmt(STOP)
    assert lone.put(GUARD)[0][1][0] == 4 | 0x80
    lone.nmt(RESET_COMMUNICATION)
    assert lone.put(GUARD)[0][1][0] == 127, "the toggle starts at zero again"


def test_a_drive_with_a_heartbeat_does_not_answer_guarding() -> None:
    lone = Lone()
    lone.write(0x1017, 0, 1000, 2)
    lone.wait(0.1)
    assert lone.put(GUARD) == []


def test_guarding_that_stays_away_is_missed_after_its_life_time() -> None:
    lone = Lone()
    lone.write(0x100C, 0, 50, 2)
    lone.write(0x100D, 0, 3, 1)
    lone.nmt(START)
    lone.wait(1.0)
    assert lone.emergencies() == [], "watching starts with the first request"
    for _ in range(5):
        lone.put(GUARD, wait_s=0.14)
    assert lone.emergencies() == []
    lone.wait(0.02)
    assert lone.emergencies() == [0x8130]
    assert lone.drive.nmt == 127
    lone.put(GUARD)
    assert lone.emergencies() == [0x8130, 0]


@pytest.mark.parametrize(("option", "state"), [(0, 127), (1, 5), (2, 4)])
def test_1029_says_where_a_lost_master_leads(option: int, state: int) -> None:
    lone = Lone()
    lone.write(0x1016, 1, 0x7F_0064, 4)
    lone.write(0x1029, 1, option, 1)
    lone.nmt(START)
    lone.put(0x77F, b"\x05", 0.2)
    assert lone.drive.nmt == state


@pytest.mark.parametrize(("option", "state"), [(0, 127), (1, 5), (2, 4)])
def test_1029_says_where_a_fault_of_the_drive_leads(option: int, state: int) -> None:
    lone = Lone()
    lone.write(0x1029, 2, option, 1)
    lone.nmt(START)
    lone.drive.inject(0x2310, lone.bus.now_s)
    assert lone.drive.nmt == state


@pytest.mark.parametrize(
    ("option", "power"),
    [(0, Power.ENABLED), (1, Power.FAULT), (2, Power.DISABLED), (3, Power.DISABLED)],
)
def test_6007_says_what_a_lost_connection_does_to_the_motor(option: int, power: Power) -> None:
    lone = Lone()
    lone.write(0x6007, 0, option, 2)
    lone.write(0x1016, 1, 0x7F_0064, 4)
    lone.nmt(START)
    lone.enable(3)
    lone.write(0x60FF, 0, 200_000, 4)
    lone.put(0x77F, b"\x05", 0.09)
    assert lone.drive.axis.servo.velocity > 100_000
    lone.wait(0.5)
    assert lone.drive.axis.power is power
    assert (lone.drive.axis.servo.velocity == 0.0) is (option != 0)
