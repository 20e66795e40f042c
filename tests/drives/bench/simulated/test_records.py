"""Interpolated position: the newest record, or one per period out of the buffer."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import START, Lone, Refused

IP = 7
PERIOD_S = 0.05  # long, so that several SDO transfers fit into it


@pytest.fixture
def lone() -> Lone:
    """Enabled in mode 7 with 60C1h:01 by RPDO 1, interpolation on."""
    made = Lone()
    made.map(0x1400, 0x1600, [0x6040_0010, 0x60C1_0120], 1, 0x205)
    made.nmt(START)
    made.write(0x60C2, 1, round(PERIOD_S * 1e3), 1)
    made.enable(IP)
    made.command(0x1F)
    made.sync()
    assert made.status & 1 << 12
    return made


def sync(lone: Lone, count: int = 1) -> None:
    for _ in range(count):
        lone.sync(wait_s=PERIOD_S)


def send(lone: Lone, position: int) -> None:
    lone.put(0x205, b"\x1f\0" + position.to_bytes(4, "little", signed=True))


def position(lone: Lone) -> int:
    return lone.read(0x6064, signed=True)


def test_without_a_buffer_the_newest_record_counts(lone: Lone) -> None:
    for k in range(1, 11):
        send(lone, 10 * k)
        lone.sync(wait_s=PERIOD_S - 0.001)
    sync(lone, 5)
    assert position(lone) == pytest.approx(100, abs=1)


def test_a_buffer_gives_one_record_a_period(lone: Lone) -> None:
    lone.write(0x60C4, 2, 8, 4)
    for k in range(1, 9):
        lone.write(0x60C1, 1, 10 * k, 4)
    assert lone.read(0x60C4, 4) == 8
    lone.wait(PERIOD_S - 0.022)
    for left in (7, 6, 5):
        lone.sync(wait_s=0.005)
        assert lone.read(0x60C4, 4) == left
        lone.wait(PERIOD_S - 0.007)
    sync(lone, 9)
    assert position(lone) == pytest.approx(80, abs=1)


def test_a_full_buffer_takes_no_more(lone: Lone) -> None:
    lone.write(0x60C4, 2, 2, 4)
    lone.write(0x60C1, 1, 1, 4)
    lone.write(0x60C1, 1, 2, 4)
    with pytest.raises(Refused, match="060a0023"):
        lone.write(0x60C1, 1, 3, 4)


def test_an_empty_buffer_holds_the_axis(lone: Lone) -> None:
    lone.write(0x60C4, 2, 4, 4)
    lone.write(0x60C1, 1, 50, 4)
    sync(lone, 6)
    assert position(lone) == pytest.approx(50, abs=1)
    assert lone.status & 0x6F == 0x27


def test_clearing_throws_the_records_away_and_shuts_the_door(lone: Lone) -> None:
    lone.write(0x60C4, 2, 4, 4)
    lone.write(0x60C1, 1, 5000, 4)
    lone.write(0x60C4, 6, 0, 1)
    assert lone.read(0x60C4, 4) == 0
    with pytest.raises(Refused, match="060a0023"):
        lone.write(0x60C1, 1, 5000, 4)
    lone.write(0x60C4, 6, 1, 1)
    lone.write(0x60C1, 1, 60, 4)
    sync(lone, 4)
    assert position(lone) == pytest.approx(60, abs=1)


def test_a_ring_or_a_larger_buffer_is_refused(lone: Lone) -> None:
    for sub, value, size in ((2, 17, 4), (3, 1, 1)):
        with pytest.raises(Refused, match="06090031"):
            lone.write(0x60C4, sub, value, size)
