"""Nodes that send far more than they were set up to, and who is named where others are missed for it."""

from __future__ import annotations

import pytest
from support.drives.group_bench import GroupBench, T, inputs_and_outputs, nodes, spindle

from drives import pdo
from drives.bench.virtual.fault_script import FaultScript
from drives.cia402 import Wanted
from drives.cyclic.chatter import NOBODY, Bucket, Chatter, Strangers
from drives.cyclic.drive_fault import DriveFault

STEP = 50
FULL_PER_S = 7_400  # frames of eight bytes at 1 Mbit/s
FINE = (DriveFault.NONE, -1)
FLOODED = (DriveFault.BUS_FLOODED, -1)


def moving(names: str = "XYZ", **more: object) -> GroupBench:
    bench = GroupBench(nodes(names), **more)  # type: ignore[arg-type]
    bench.enable()
    bench.tick(50, step=STEP)
    return bench


def befall(bench: GroupBench, line: str) -> None:
    FaultScript.read(f"at 0 s: {line}").inject(bench.rig.buses["can"], bench.now_s)


def seen(bench: GroupBench, ticks: int = 150) -> list[tuple[DriveFault, int]]:
    """Every fault in turn; with the first one the drives are stopped, as a controller would."""
    found: list[tuple[DriveFault, int]] = []
    for _ in range(ticks):
        bench.tick(step=0 if found else STEP)
        if bench.fault != FINE and bench.fault not in found:
            found.append(bench.fault)
            bench.group.want(Wanted.QUICK_STOP)
    return found


# ---- a node that only sends too much


@pytest.mark.parametrize(
    ("line", "can_id", "per_s"),
    [
        ("foreign emcy 2 data 0000000000000000 for 250 ms", 0x082, 1000),
        ("foreign heartbeat 2 data 05 for 250 ms", 0x702, 1000),
        ("foreign heartbeat 99 data 05 for 250 ms", None, 0),
        ("foreign emcy 2 data 0000000000000000 x 30", None, 0),
    ],
)
def test_a_node_that_sends_too_often_is_told_and_nothing_else_is_wrong(
    line: str, can_id: int | None, per_s: int
) -> None:
    bench = moving()
    befall(bench, line)
    assert seen(bench, 100) == []
    chatter = bench.group.chatter
    assert chatter.can_id == (NOBODY if can_id is None else can_id)
    assert chatter.per_s == pytest.approx(per_s, rel=0.15)


def test_a_drive_that_answers_each_sync_many_times_is_told_and_is_no_second_node() -> None:
    bench = moving()
    tell, busy = bench.service["can"].send, [False]

    def chatter(at_s: float, can_id: int, frame: bytes) -> tuple[float, ...]:
        return tuple(150e-6 * n for n in range(6)) if can_id == 0x182 and busy[0] else (0.0,)

    bench.rig.buses["can"].tamper = chatter
    bench.tick(50, step=STEP)
    assert tell and bench.group.chatter.can_id == NOBODY
    busy[0] = True
    assert seen(bench, 100) == []
    assert bench.group.chatter.can_id == 0x182
    assert bench.group.chatter.per_s == pytest.approx(6 / T, rel=0.15)


def test_what_was_told_stays_until_reset() -> None:
    bench = moving()
    befall(bench, "foreign emcy 2 data 0000000000000000 for 200 ms")
    assert seen(bench, 300) == [] and bench.group.chatter.can_id == 0x082
    bench.group.want(Wanted.RESET)
    assert bench.group.chatter.can_id == NOBODY
    bench.enable()
    assert seen(bench, 100) == [] and bench.group.chatter.can_id == NOBODY


# ---- one that leaves the others no room


@pytest.mark.parametrize(
    ("words", "can_id"),
    [
        ("001", 0x001),  # nobody's
        ("emcy 2", 0x082),
        ("emcy 77", 0x0CD),  # a node that is not of this machine
        ("100", 0x100),
        ("tpdo 1", 0x181),
    ],
)
def test_a_sender_that_starves_the_others_is_named_and_they_are_not(words: str, can_id: int) -> None:
    bench = moving("XYZAC")
    befall(bench, f"babble {words} for 100 ms")
    found = seen(bench)
    assert found[0] == FLOODED and len(found) == 1
    assert bench.group.chatter.can_id == can_id
    assert bench.group.chatter.per_s == pytest.approx(FULL_PER_S, rel=0.2)


@pytest.mark.parametrize("words", ["6FF", "602", "heartbeat 99"])
def test_heartbeats_that_do_not_get_through_are_not_what_is_wrong(words: str) -> None:
    """Ours is behind those of the drives: of a sender between them the drives' own emergencies tell."""
    bench = moving("XYZ")
    befall(bench, f"babble {words} for 600 ms")
    assert seen(bench, 400) == [FLOODED]


def test_a_silent_drive_on_a_busy_bus_is_still_that_drive_where_it_is_itself_that_was_loud() -> None:
    bench = moving()
    befall(bench, "foreign emcy 2 data 0000000000000000 x 40\nat 20 ms: silence 2 for 100 ms")
    assert seen(bench)[0] == (DriveFault.FEEDBACK_LOST, 1)


def test_spindle_and_inputs_that_are_missed_on_a_full_bus_are_not_what_is_wrong() -> None:
    bench = moving(spindle=spindle(), io=[inputs_and_outputs()])
    befall(bench, "babble 001 for 400 ms")
    assert seen(bench, 300)[0] == FLOODED


@pytest.mark.parametrize("line", ["silence 2 for 100 ms", "drop tpdo 2 x 10", "bus_off 2 for 50 ms"])
def test_a_lost_drive_on_a_quiet_bus_is_that_drive(line: str) -> None:
    bench = moving()
    befall(bench, line)
    assert seen(bench)[0] == (DriveFault.FEEDBACK_LOST, 1)
    assert bench.group.chatter.can_id == NOBODY


def test_a_tick_that_was_late_finds_no_chatter_in_what_has_gathered() -> None:
    bench = moving("XYZAC")
    for late_s in (0.01, 0.1, 0.5, 1.5):
        bench.rig.advance(bench.now_s + late_s)
        bench.tick(100, step=STEP)
        assert bench.group.chatter.can_id == NOBODY, late_s


# ---- the buckets


def test_a_bucket_is_full_where_more_comes_than_drains() -> None:
    for per_s, full in ((900.0, False), (1100.0, True)):
        bucket, found = Bucket(0x701, 1000.0, 20.0), False
        for n in range(1000):
            found = bucket.count((n + 1) / per_s, n / per_s) or found
        assert found is full
    assert bucket.per_s(1000 / per_s) == pytest.approx(per_s, rel=0.01)


def test_what_comes_at_once_is_credited_with_the_time_in_which_nobody_listened() -> None:
    for since_s, full in ((9.5, False), (9.99, True)):
        bucket = Bucket(0x701, 100.0, 20.0)
        assert any([bucket.count(10.0, since_s) for _ in range(60)]) is full


def test_of_strangers_the_one_that_most_frames_are_of_is_known_and_an_even_mixture_is_nobody() -> None:
    for share, known in ((3, True), (1, False)):
        strangers, chatter = Strangers(), Chatter()
        for n in range(400):
            now_s = 1.0 + 0.002 * (n // 14)
            can_id = 0x100 + n if n % (share + 1) == 0 else 0x005
            if strangers.vote(can_id, now_s, now_s - 0.002):
                chatter.report(strangers, now_s)
        assert (chatter.can_id == 0x005) is known


def test_only_the_first_that_chatters_is_told_and_with_its_largest_figure() -> None:
    chatter, one, other = Chatter(), Bucket(0x701, 1.0, 0.0), Bucket(0x702, 1.0, 0.0)
    for bucket in (one, other):
        assert bucket.count(1.0, 0.9)
        chatter.report(bucket, 1.0)
    assert chatter.can_id == 0x701 and chatter.per_s == pytest.approx(10.0)
    for _ in range(9):
        one.count(1.1, 1.0)
    chatter.report(one, 1.1)
    assert chatter.per_s == pytest.approx(50.0)
    chatter.report(one, 2.0)
    assert chatter.per_s == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("can_id", "node"),
    [(0, 0), (0x80, 0), (0x81, 1), (0x1FF, 127), (0x701, 1), (0x7E4, 0), (0x181 | 1 << 31, 0)],
)
def test_an_identifier_says_whose_frame_it_is(can_id: int, node: int) -> None:
    assert pdo.node_of(can_id) == node
