"""Emergencies: register, history, inhibit time, identifier."""

from __future__ import annotations

import pytest
from support.drives.lone_drive import Lone, Refused

REGISTER = [
    (0x2310, 0x03, "current"),
    (0x3210, 0x05, "voltage"),
    (0x4310, 0x09, "temperature"),
    (0x8130, 0x11, "communication"),
    (0x8611, 0x21, "profile"),
    (0x9000, 0x01, "external"),
    (0xFF01, 0x81, "manufacturer"),
]


@pytest.mark.parametrize(("code", "register", "kind"), REGISTER, ids=[row[2] for row in REGISTER])
def test_an_error_sets_its_bit_of_the_register(code: int, register: int, kind: str) -> None:
    lone = Lone()
    lone.drive.inject(code, lone.bus.now_s)
    lone.wait(0.01)
    assert lone.of(0x85) == [code.to_bytes(2, "little") + bytes([register]) + bytes(5)]
    assert (lone.read(0x1001), lone.read(0x603F)) == (register, code)


def test_two_errors_share_the_register_and_a_reset_takes_both_back() -> None:
    lone = Lone()
    for code in (0x2310, 0x4310):
        lone.drive.inject(code, lone.bus.now_s)
    assert lone.read(0x1001) == 0x0B
    lone.command(0x80)
    assert (lone.read(0x1001), lone.read(0x603F), lone.emergencies()[-1]) == (0, 0, 0)


def test_the_history_has_the_newest_first_and_at_most_eight() -> None:
    lone = Lone()
    for code in range(0xFF01, 0xFF0B):
        lone.drive.inject(code, lone.bus.now_s)
    lone.wait(0.01)
    assert lone.read(0x1003) == 8
    assert [lone.read(0x1003, sub) & 0xFFFF for sub in range(1, 9)] == list(range(0xFF0A, 0xFF02, -1))


def test_writing_zero_clears_the_history_and_nothing_else_may_be_written() -> None:
    lone = Lone()
    lone.drive.inject(0x2310, lone.bus.now_s)
    with pytest.raises(Refused, match="06090030"):
        lone.write(0x1003, 0, 1, 1)
    lone.write(0x1003, 0, 0, 1)
    assert lone.read(0x1003) == 0
    with pytest.raises(Refused, match="08000024"):
        lone.read(0x1003, 1)


def test_the_inhibit_time_keeps_emergencies_apart_and_loses_none() -> None:
    lone = Lone()
    lone.write(0x1015, 0, 500, 2)
    for code in (0xFF01, 0xFF02, 0xFF03):
        lone.drive.inject(code, lone.bus.now_s)
    lone.wait(0.2)
    assert lone.emergencies() == [0xFF01, 0xFF02, 0xFF03]
    times = lone.times(0x85)
    assert times[1] - times[0] == pytest.approx(0.05)
    assert times[2] - times[1] == pytest.approx(0.05)


def test_the_identifier_can_be_moved_and_switched_off() -> None:
    lone = Lone()
    with pytest.raises(Refused, match="06090030"):
        lone.write(0x1014, 0, 0xA5, 4)
    lone.write(0x1014, 0, 0x8000_00A5, 4)
    lone.drive.inject(0xFF01, lone.bus.now_s)
    lone.write(0x1014, 0, 0xA5, 4)
    lone.drive.inject(0xFF02, lone.bus.now_s)
    lone.wait(0.01)
    assert lone.emergencies() == []
    assert [data[:2] for data in lone.of(0xA5)] == [b"\x02\xff"]


def test_an_error_can_be_raised_over_the_bus() -> None:
    lone = Lone()
    lone.write(0x2001, 0, 0x3210, 2)
    lone.wait(0.01)
    assert lone.emergencies() == [0x3210]
    assert lone.status & 0x4F == 0x08
