"""The time stamp object: who is told to listen to it knows the time."""

from __future__ import annotations

import struct

import pytest
from support.drives.lone_drive import STOP, Lone, Refused

NOON = struct.pack("<IH", 12 * 3_600_000, 15_000)
SINCE_1984_S = 15_000 * 86400.0 + 12 * 3600.0


def test_it_listens_only_when_told() -> None:
    lone = Lone()
    lone.put(0x100, NOON)
    assert lone.drive.time_of_day.since_1984_s(lone.bus.now_s) is None
    lone.write(0x1012, 0, 0x8000_0100, 4)
    lone.put(0x100, NOON)
    lone.wait(2.0)
    assert lone.drive.time_of_day.since_1984_s(lone.bus.now_s) == pytest.approx(SINCE_1984_S + 2.0, abs=0.01)


def test_it_takes_no_time_from_a_short_frame_or_while_stopped() -> None:
    lone = Lone()
    lone.write(0x1012, 0, 0x8000_0100, 4)
    lone.put(0x100, NOON[:5])
    lone.nmt(STOP)
    lone.put(0x100, NOON)
    assert lone.drive.time_of_day.since_1984_s(lone.bus.now_s) is None


@pytest.mark.parametrize("value", [0x4000_0100, 0xC000_0100, 0xA000_0100, 0x8000_0000, 0x8000_0601])
def test_it_does_not_produce_it_nor_take_an_impossible_identifier(value: int) -> None:
    with pytest.raises(Refused, match="06090030"):
        Lone().write(0x1012, 0, value, 4)


def test_the_identifier_changes_while_nobody_listens() -> None:
    lone = Lone()
    lone.write(0x1012, 0, 0x8000_0100, 4)
    with pytest.raises(Refused, match="06090030"):
        lone.write(0x1012, 0, 0x8000_00FF, 4)
    lone.write(0x1012, 0, 0x0000_00FF, 4)
    lone.write(0x1012, 0, 0x8000_00FF, 4)
    lone.put(0x0FF, NOON)
    assert lone.drive.time_of_day.since_1984_s(lone.bus.now_s) is not None
