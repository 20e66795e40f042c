"""A supply that fails: what a device still knows when it comes back."""

from __future__ import annotations

import struct

import pytest
from support.drives.lone_drive import START, Lone, Refused

from drives.bench.simulated import Parameters

SAVE = int.from_bytes(b"save", "little")


def cycle(lone: Lone) -> None:
    lone.drive.power_cycle(lone.bus.now_s)
    lone.wait(0.05)


def lss(lone: Lone, *data: int) -> None:
    lone.put(0x7E5, bytes(data).ljust(8, b"\0"))


def test_it_says_nothing_until_it_boots() -> None:
    lone = Lone()
    lone.write(0x1017, 0, 5, 2)
    lone.nmt(START)
    before = len(lone.heard)
    cycle(lone)
    assert lone.heard[before:] == [(0x705, b"\0")], "no farewell, and no heartbeat any more"
    assert lone.drive.node_id == 5


def test_parameters_are_the_saved_ones() -> None:
    lone = Lone()
    lone.write(0x6085, 0, 777, 4)
    lone.write(0x1010, 1, SAVE, 4)
    lone.write(0x6084, 0, 888, 4)
    cycle(lone)
    assert lone.read(0x6085) == 777 and lone.read(0x6084) != 888


def test_a_powered_motor_loses_its_current() -> None:
    lone = Lone()
    lone.enable()
    cycle(lone)
    assert lone.status & 0x4F == 0x40


def moved(absolute: bool) -> Lone:
    lone = Lone(Parameters(absolute_encoder=absolute, position_counts=123_456))
    cycle(lone)
    return lone


def test_an_incremental_encoder_counts_from_zero_again() -> None:
    assert moved(absolute=False).read(0x6064, signed=True) == 0


def test_an_absolute_encoder_knows_where_it_is() -> None:
    assert moved(absolute=True).read(0x6064, signed=True) == 123_456


def test_switches_stay_where_they_are_whatever_the_counting_does() -> None:
    lone = Lone(Parameters(position_counts=5000, switches=(-1e8, 4000)))
    cycle(lone)
    assert lone.read(0x60FD) & 2, "it still stands on the positive limit switch"


def test_a_node_id_that_was_not_stored_is_forgotten() -> None:
    lone = Lone()
    lss(lone, 0x04, 1)
    lss(lone, 0x11, 9)
    cycle(lone)
    assert lone.drive.node_id == 5


def test_a_stored_node_id_is_used() -> None:
    lone = Lone()
    lss(lone, 0x04, 1)
    lss(lone, 0x11, 9)
    lss(lone, 0x17)
    cycle(lone)
    assert lone.drive.node_id == 9 and lone.heard[-1] == (0x709, b"\0")


def change_rate(lone: Lone, index: int) -> None:
    lss(lone, 0x04, 1)
    lss(lone, 0x13, 0, index)


def test_another_bit_rate_makes_it_deaf_until_power_comes_back() -> None:
    lone = Lone()
    change_rate(lone, 3)
    assert lone.read(0x1000) == 0x20192, "not before it is activated"
    lss(lone, 0x15, *struct.pack("<H", 10))
    lone.wait(0.05)
    before = len(lone.heard)
    assert lone.sdo(b"\x40\x00\x10") == []
    assert lone.heard[before:] == []
    cycle(lone)
    assert lone.read(0x1000) == 0x20192


def test_the_bus_s_own_rate_is_back_after_the_switch_delay() -> None:
    lone = Lone()
    change_rate(lone, 0)
    lss(lone, 0x15, *struct.pack("<H", 50))
    lone.wait(0.03)
    assert lone.sdo(b"\x40\x00\x10") == []
    lone.wait(0.08)
    assert lone.read(0x1000) == 0x20192


def test_a_stored_wrong_bit_rate_outlives_the_supply() -> None:
    lone = Lone()
    change_rate(lone, 3)
    lss(lone, 0x17)
    cycle(lone)
    assert lone.sdo(b"\x40\x00\x10") == []


def test_a_transfer_under_way_is_forgotten() -> None:
    lone = Lone()
    lone.ask(b"\x40\x08\x10")
    cycle(lone)
    with pytest.raises(Refused, match="05040001"):
        lone.ask(b"\x60")
