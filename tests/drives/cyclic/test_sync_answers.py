"""SYNC that reaches the drives twice, or two of them close together, by what simulated drives answer."""

from __future__ import annotations

from itertools import count
from random import Random

import pytest
from support.drives.group_bench import GroupBench, T, nodes

from drives import pdo
from drives.cia402 import Wanted
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.line import DOUBLED

STEP = 200  # counts in one SYNC
TWICE = (0.0, 0.0)
FINE = DriveFault.NONE
SETTLED = 20  # ticks


def moving(names: str = "XYZ", **changes: object) -> GroupBench:
    bench = GroupBench(nodes(names, **changes))
    bench.enable()
    bench.tick(2 * SETTLED, step=STEP)
    assert bench.fault == (FINE, -1)
    return bench


def befall(bench: GroupBench, *rows: tuple[float, ...], can_id: int = pdo.SYNC) -> None:
    """Each frame of an identifier in turn is sent after these delays (s); none: lost."""
    turn = count()

    def tamper(_at_s: float, heard: int, _frame: bytes) -> tuple[float, ...]:
        return rows[next(turn) % len(rows)] if heard == can_id else (0.0,)

    bench.rig.buses["can"].tamper = tamper


def ticks_until_fault(bench: GroupBench, most: int = 200, step: int = STEP) -> int:
    for ticks in range(most):
        bench.tick(step=step)
        if bench.fault[0] is not FINE:
            return ticks
    return most


@pytest.mark.parametrize("step", [0, STEP], ids=["standing", "moving"])
@pytest.mark.parametrize("names", ["X", "XYZAC"], ids=["one drive", "five"])
def test_sync_that_comes_twice_is_named_whatever_the_drives_do(names: str, step: int) -> None:
    bench = moving(names)
    bench.tick(SETTLED, step=step)
    befall(bench, TWICE)
    ticks = ticks_until_fault(bench, step=step)
    assert bench.fault == (DriveFault.SYNC_DOUBLED, 0)
    assert ticks < 2 * DOUBLED


def test_drives_that_have_moved_between_two_answers_to_one_sync_are_no_second_nodes() -> None:
    """A true motor goes on between the two; a simulated one takes a SYNC that is too soon for none."""
    bench = moving()
    befall(bench, TWICE)
    for device in bench.devices:
        report, odd = device._report, count()

        def jittered(frame: bytes, now_s: float, device=device, report=report, odd=odd) -> None:
            away = next(odd) % 2 * STEP * 0.05
            device.axis.servo.position += away
            report(frame, now_s)
            device.axis.servo.position -= away

        device._report = jittered
    ticks_until_fault(bench)
    assert bench.fault == (DriveFault.SYNC_DOUBLED, 0)


@pytest.mark.parametrize("share", [3, 5])
def test_sync_of_which_some_come_twice_is_named_too(share: int) -> None:
    bench = moving()
    befall(bench, TWICE, *((0.0,),) * (share - 1))
    ticks_until_fault(bench, 400)
    assert bench.fault == (DriveFault.SYNC_DOUBLED, 0)


def test_a_few_that_come_twice_are_nothing() -> None:
    bench = moving()
    befall(bench, *(TWICE,) * round(DOUBLED), *((0.0,),) * 10_000)
    assert ticks_until_fault(bench) == 200


def test_two_syncs_that_come_close_together_are_named_where_the_drives_move() -> None:
    bench = moving()
    befall(bench, (0.95 * T,), (0.0,))
    ticks_until_fault(bench)
    assert bench.fault == (DriveFault.SYNC_DOUBLED, 0)


def test_feedback_that_an_adapter_delivers_two_by_two_was_given_in_time() -> None:
    bench = moving()
    port = bench.ports["can"]
    heard, kept, odd = port.receive_into, [], count()
    receive = bench.group.receive

    def two_by_two(now_s: float) -> None:
        buffer = bytearray(pdo.FRAME_BYTES)
        while heard(buffer):
            kept.append(bytes(buffer))
        if next(odd) % 2:
            port._queue.extend(kept)
            kept.clear()
        receive(now_s)

    bench.group.receive = two_by_two  # type: ignore[method-assign]
    assert ticks_until_fault(bench, 300) == 300


@pytest.mark.parametrize("can_id", [0x181, 0x182, 0x201, 0x77F])
def test_other_frames_that_come_twice_are_nothing(can_id: int) -> None:
    bench = moving()
    befall(bench, TWICE, can_id=can_id)
    assert ticks_until_fault(bench) == 200


@pytest.mark.parametrize("seed", range(4))
def test_lost_and_late_frames_are_no_doubled_sync(seed: int) -> None:
    bench, rng = moving("XYZAC"), Random(seed)

    def tamper(_at_s: float, can_id: int, _frame: bytes) -> tuple[float, ...]:
        if can_id == pdo.SYNC or rng.random() > 0.02:
            return (0.0,)
        return rng.choice(((), (1.5 * T,), (0.3 * T,)))

    bench.rig.buses["can"].tamper = tamper
    for _ in range(1000):
        bench.tick(step=rng.choice((0, STEP)))
        assert bench.fault[0] in (FINE, DriveFault.FEEDBACK_LOST)


def test_reset_forgets_it_and_it_is_named_again() -> None:
    bench = moving()
    befall(bench, TWICE)
    ticks_until_fault(bench)
    bench.group.want(Wanted.RESET)
    befall(bench, (0.0,))
    bench.tick(200)
    bench.enable()
    assert ticks_until_fault(bench) == 200
    befall(bench, TWICE)
    ticks_until_fault(bench)
    assert bench.fault == (DriveFault.SYNC_DOUBLED, 0)
