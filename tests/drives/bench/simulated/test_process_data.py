"""Transmission types, times and rules of change of the four RPDOs and four TPDOs."""

from __future__ import annotations

from itertools import pairwise

import pytest
from support.drives.lone_drive import PRE_OPERATIONAL, START, STOP, Lone, Refused

from drives import pdo
from drives.bench.simulated import Parameters

TPDO2, RPDO2 = 0x285, 0x305
PERIOD_S = 0.002


def sending(kind: int, entries: list[int] | None = None, **times: int) -> Lone:
    """An operational drive with TPDO 2 of one transmission type and no other TPDO."""
    lone = Lone()
    lone.write(0x1800, 1, 0x8000_0185, 4)
    lone.map(0x1801, 0x1A01, entries or [0x6041_0010], kind, TPDO2, **times)
    lone.nmt(START)
    return lone


@pytest.mark.parametrize("every", [1, 2, 7, 240])
def test_a_cyclic_tpdo_comes_with_every_so_many_syncs(every: int) -> None:
    lone = sending(every)
    for _ in range(500):
        lone.sync(wait_s=0.0005)
    assert len(lone.of(TPDO2)) == 500 // every


def test_an_acyclic_tpdo_comes_with_the_sync_after_a_change() -> None:
    lone = sending(0)
    lone.run(0.02)
    assert len(lone.of(TPDO2)) == 1, "the state at the start is news"
    lone.write(0x6040, 0, 0x06, 2)
    assert len(lone.of(TPDO2)) == 1, "not before SYNC"
    lone.run(0.02)
    assert len(lone.of(TPDO2)) == 2


def test_an_event_driven_tpdo_comes_at_once_and_only_on_a_change() -> None:
    lone = sending(255)
    lone.run(0.02)
    before = len(lone.of(TPDO2))
    assert before == 1
    lone.write(0x6040, 0, 0x06, 2)
    assert lone.of(TPDO2)[1:] == [(0x231).to_bytes(2, "little")]


def test_the_event_timer_sends_without_a_change() -> None:
    lone = sending(254, event=10)
    lone.wait(1.0)
    times = lone.times(TPDO2)
    assert len(times) == pytest.approx(102, abs=2)
    assert times[-1] - times[-2] == pytest.approx(0.01)


def test_the_inhibit_time_keeps_changes_apart_and_loses_none() -> None:
    lone = sending(255, [0x6061_0008, 0x6041_0010], inhibit=200)
    for mode in (1, 3, 6, 7, 8):
        lone.write(0x6060, 0, mode, 1)
        lone.wait(0.004)
    lone.wait(0.05)
    times = lone.times(TPDO2)
    stuffing_s = 15e-6  # times are of the frames' ends, and one has fewer stuff bits than another
    assert min(b - a for a, b in pairwise(times)) >= 0.02 - stuffing_s
    assert lone.of(TPDO2)[-1][0] == 8


@pytest.mark.parametrize(("kind", "sampled"), [(252, True), (253, False)])
def test_a_remote_request_is_answered(kind: int, sampled: bool) -> None:
    lone = sending(kind)
    ask = TPDO2 | pdo.REMOTE_FLAG
    assert bool(lone.put(ask)) is not sampled, "252 has nothing before the first SYNC"
    lone.sync()
    assert len(lone.of(TPDO2)) == (0 if sampled else 1)
    lone.write(0x6040, 0, 0x06, 2)
    ((_, data),) = lone.put(ask)
    assert data[0] == (0x50 if sampled else 0x31), "252 tells the state at SYNC"


def test_remote_requests_are_refused_where_the_identifier_says_so() -> None:
    lone = sending(253)
    lone.write(0x1801, 1, 0xC000_0285, 4)
    lone.write(0x1801, 1, 0x4000_0285, 4)
    assert lone.put(TPDO2 | pdo.REMOTE_FLAG) == []


def test_the_controllers_own_tpdo_answers_a_remote_request_too() -> None:
    lone = Lone()
    lone.map(0x1800, 0x1A00, [0x6041_0010, 0x6064_0020], 1, 0x185)
    lone.nmt(START)
    ((can_id, data),) = lone.put(0x185 | pdo.REMOTE_FLAG)
    assert (can_id, len(data)) == (0x185, 6)


@pytest.mark.parametrize("state", [STOP, PRE_OPERATIONAL])
def test_process_data_flow_in_operational_only(state: int) -> None:
    lone = sending(1)
    lone.map(0x1401, 0x1601, [0x6060_0008], 255, RPDO2)
    lone.nmt(state)
    lone.run(0.02)
    lone.put(TPDO2 | pdo.REMOTE_FLAG)
    lone.put(RPDO2, b"\x06", 0.02)
    assert lone.of(TPDO2) == []
    assert lone.drive.axis.mode == 0


@pytest.mark.parametrize(
    ("kind", "at_once"), [(0, False), (1, False), (240, False), (254, True), (255, True)]
)
def test_an_rpdo_acts_at_the_next_sync_or_at_once(kind: int, at_once: bool) -> None:
    lone = Lone()
    lone.map(0x1401, 0x1601, [0x60FF_0020], kind, RPDO2)
    lone.nmt(START)
    lone.put(RPDO2, (77).to_bytes(4, "little"))
    assert lone.drive.dictionary.get(0x60FF) == (77 if at_once else 0)
    lone.sync()
    assert lone.drive.dictionary.get(0x60FF) == 77


def test_eight_objects_of_one_byte_and_dummies_between_them() -> None:
    lone = Lone()
    lone.map(0x1401, 0x1601, [0x0005_0008] * 4 + [0x60FF_0020], 255, RPDO2)
    lone.nmt(START)
    lone.put(RPDO2, b"\1\2\3\4" + (5).to_bytes(4, "little"))
    assert lone.drive.dictionary.get(0x60FF) == 5
    lone.map(0x1801, 0x1A01, [0x1001_0008] * 8, 1, TPDO2)
    lone.sync()
    assert lone.of(TPDO2) == [bytes(8)]


def test_a_dummy_is_no_source() -> None:
    lone = Lone()
    lone.write(0x1A01, 0, 0, 1)
    with pytest.raises(Refused, match="06040041"):
        lone.write(0x1A01, 1, 0x0005_0008, 4)


def test_an_rpdo_too_short_is_not_used_and_of_one_too_long_the_mapped_part_is() -> None:
    lone = Lone()
    lone.map(0x1401, 0x1601, [0x60FF_0020], 255, RPDO2)
    lone.nmt(START)
    lone.put(RPDO2, b"\x01")
    assert lone.drive.dictionary.get(0x60FF) == 0
    lone.put(RPDO2, (9).to_bytes(4, "little") + b"\xff\xff")
    assert lone.drive.dictionary.get(0x60FF) == 9
    assert lone.emergencies() == [0x8210, 0x8220]
    assert lone.read(0x1001) == 0, "both have passed"


def test_an_rpdo_that_stays_away_is_an_error_until_it_comes_again() -> None:
    lone = Lone()
    lone.map(0x1401, 0x1601, [0x60FF_0020], 255, RPDO2, event=50)
    lone.nmt(START)
    lone.wait(0.5)
    assert lone.emergencies() == [], "watching starts with the first one"
    for _ in range(10):
        lone.put(RPDO2, bytes(4), 0.04)
    assert lone.emergencies() == []
    lone.wait(0.1)
    assert lone.emergencies() == [0x8250]
    lone.put(RPDO2, bytes(4))
    assert lone.emergencies() == [0x8250, 0]


def test_outside_of_the_sync_window_synchronous_data_do_not_count() -> None:
    lone = Lone()
    lone.map(0x1401, 0x1601, [0x60FF_0020], 1, RPDO2)
    lone.map(0x1801, 0x1A01, [0x6041_0010], 1, TPDO2)
    lone.write(0x1007, 0, 500, 4)
    lone.nmt(START)
    lone.sync(wait_s=0.0002)
    lone.put(RPDO2, (7).to_bytes(4, "little"))
    lone.sync(wait_s=0.001)
    assert lone.drive.dictionary.get(0x60FF) == 7
    lone.put(RPDO2, (8).to_bytes(4, "little"))
    lone.sync()
    assert lone.drive.dictionary.get(0x60FF) == 7
    assert len(lone.of(TPDO2)) == 3


def test_a_tpdo_that_would_leave_after_the_window_stays() -> None:
    lone = Lone(Parameters(tpdo_delay_s=0.001))
    lone.map(0x1801, 0x1A01, [0x6041_0010], 1, TPDO2)
    lone.write(0x1007, 0, 500, 4)
    lone.nmt(START)
    lone.run(0.02)
    assert lone.of(TPDO2) == []


def test_the_sync_counter_starts_a_tpdo() -> None:
    """Type 4, start value 3: at counter 3, then 7, then 11 = 1 of the next round of ten."""
    lone = Lone()
    lone.write(0x1800, 1, 0x8000_0185, 4)
    lone.write(0x1019, 0, 10, 1)
    lone.map(0x1801, 0x1A01, [0x6041_0010], 4, TPDO2, start=3)
    lone.nmt(START)
    sent_at = []
    for k in range(12):
        if lone.sync(bytes([k % 10 + 1])):
            sent_at.append(k % 10 + 1)
    assert sent_at == [3, 7, 1]


RULES = [
    ("no entry while the PDO is on", (0x1600, 1, 0x6060_0008, 4), 0x06010000),
    ("no count while the PDO is on", (0x1A00, 0, 0, 1), 0x06010000),
    ("no other identifier while it is on", (0x1400, 1, 0x0000_0206, 4), 0x06090030),
    ("no 29-bit identifier", (0x1401, 1, 0xA000_0305, 4), 0x06090030),
    ("no restricted identifier", (0x1401, 1, 0x8000_0581, 4), 0x06090030),
    ("no reserved type of a TPDO", (0x1801, 2, 241, 1), 0x06090030),
    ("no type on request for an RPDO", (0x1401, 2, 253, 1), 0x06090030),
    ("no inhibit time while it is on", (0x1800, 3, 100, 2), 0x06090030),
    ("no SYNC start value while it is on", (0x1800, 6, 3, 1), 0x06090030),
    ("no nine objects", (0x1601, 0, 9, 1), 0x06040042),
]


@pytest.mark.parametrize(("rule", "written", "code"), RULES, ids=[row[0] for row in RULES])
def test_a_rule_of_change_is_kept(rule: str, written: tuple[int, int, int, int], code: int) -> None:
    with pytest.raises(Refused) as refused:
        Lone().write(*written)
    assert refused.value.code == code, rule


WRONG_WAY = [
    ("an input in an RPDO", 0x1601, 0x6064_0020),
    ("an output in a TPDO", 0x1A01, 0x607A_0020),
    ("half an object", 0x1601, 0x607A_0010),
    ("a parameter", 0x1601, 0x6065_0020),
]


@pytest.mark.parametrize(("what", "mapping", "entry"), WRONG_WAY, ids=[row[0] for row in WRONG_WAY])
def test_what_does_not_go_that_way_is_not_mapped(what: str, mapping: int, entry: int) -> None:
    lone = Lone()
    lone.write(mapping, 0, 0, 1)
    with pytest.raises(Refused, match="06040041"):
        lone.write(mapping, 1, entry, 4)


def test_the_feedback_of_the_controllers_mapping_is_the_same_on_the_slow_way() -> None:
    """A SYNC window takes the drive off its fast way; the frames must not show it."""
    answers = []
    for window_us in (0, 2000):
        lone = Lone()
        lone.map(0x1400, 0x1600, [0x6040_0010, 0x607A_0020], 1, 0x205)
        lone.map(0x1800, 0x1A00, [0x6041_0010, 0x6064_0020], 1, 0x185)
        lone.write(0x60C2, 1, 2, 1)
        lone.write(0x1007, 0, window_us, 4)
        lone.write(0x6060, 0, 8, 1)
        lone.nmt(START)
        for k in range(150):
            word = (0x06, 0x07, 0x0F)[min(k // 15, 2)]
            lone.sync(wait_s=0.0005)
            lone.put(0x205, pdo.COMMAND.pack(word, 100 * max(0, k - 60)), 0.0015)
        answers.append(lone.of(0x185))
    assert answers[0] == answers[1]
    assert answers[0][-1][2:] != bytes(4)
