"""SYNC and TIME: identifier, counter, time-out, a drive that produces SYNC or hears the time of day."""

from __future__ import annotations

import struct

import pytest
from support.drives.lone_drive import RESET_NODE, START, STOP, Lone, Refused

from drives import pdo


def test_syncs_that_stay_away_are_missed_once_and_taken_back_with_the_next() -> None:
    lone = Lone()
    lone.write(0x1006, 0, 10_000, 4)
    lone.wait(0.1)
    assert lone.emergencies() == [], "watching starts with the first one"
    for _ in range(10):
        lone.sync(wait_s=0.01)
    assert lone.emergencies() == []
    lone.wait(0.1)
    assert lone.emergencies() == [0x8100]
    lone.sync()
    assert lone.emergencies() == [0x8100, 0]


def test_a_drive_that_counts_syncs_says_when_the_counter_is_missing_and_the_other_way_round() -> None:
    lone = Lone()
    lone.write(0x1019, 0, 10, 1)
    lone.sync(b"\x01")
    assert lone.emergencies() == []
    lone.sync()
    assert lone.emergencies() == [0x8240]


def test_the_counters_highest_value_is_zero_or_from_2_to_240_and_fixed_while_a_period_is_set() -> None:
    lone = Lone()
    for highest in (1, 241, 255):
        with pytest.raises(Refused, match="06090030"):
            lone.write(0x1019, 0, highest, 1)
    for highest in (2, 240, 0):
        lone.write(0x1019, 0, highest, 1)
    lone.write(0x1006, 0, 1000, 4)
    with pytest.raises(Refused, match="08000022"):
        lone.write(0x1019, 0, 5, 1)


def test_a_drive_produces_sync_with_a_counter_and_obeys_it_itself() -> None:
    lone = Lone()
    lone.write(0x1019, 0, 4, 1)
    lone.write(0x1006, 0, 10_000, 4)
    lone.write(0x1005, 0, 0x4000_0080, 4)
    lone.nmt(START, 0.1)
    counters = [data[0] for data in lone.of(pdo.SYNC)]
    assert counters[:6] == [1, 2, 3, 4, 1, 2]
    assert len(lone.of(0x185)) == pytest.approx(10, abs=1)
    lone.write(0x1005, 0, 0x80, 4)
    before = len(lone.of(pdo.SYNC))
    lone.wait(0.1)
    assert len(lone.of(pdo.SYNC)) == before


def test_the_identifier_may_move_but_not_while_the_drive_produces_sync() -> None:
    lone = Lone()
    lone.write(0x1005, 0, 0x100, 4)
    lone.nmt(START)
    lone.sync()
    assert lone.of(0x185) == []
    lone.put(0x100)
    assert len(lone.of(0x185)) == 1
    lone.write(0x1005, 0, 0x4000_0100, 4)
    with pytest.raises(Refused, match="06090030"):
        lone.write(0x1005, 0, 0x4000_0080, 4)


def test_a_reset_forgets_a_missed_sync() -> None:
    lone = Lone()
    lone.write(0x1006, 0, 10_000, 4)
    lone.sync(wait_s=0.1)
    assert lone.read(0x1001) == 0x11
    lone.nmt(RESET_NODE)
    assert lone.read(0x1001) == 0


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
