"""The arithmetic of a measurement: bins, shares, sums of many turns, and what is kept of hours."""

from __future__ import annotations

import math
import os
import random
import tracemalloc
from collections.abc import Sequence
from itertools import pairwise

import pytest

from controller.runtime import wake_ups
from controller.runtime.wake_ups import BIN_S, BINS, Echoes, Histogram
from controller.tick.loop import SteppedClock
from drives import pdo

SHARES = (0.0, 0.5, 0.9, 0.99, 0.999, 0.9999, 1.0)


def histogram(times_s: Sequence[float]) -> Histogram:
    found = Histogram()
    for one in times_s:
        found.add(one)
    return found


def drawn(seed: int, count: int) -> list[float]:
    """Most are quick, a few are late, some beyond the last bin."""
    random_ = random.Random(seed)
    return [random_.lognormvariate(math.log(20e-6), 1.2) for _ in range(count)] + [0.0, 0.021, 0.5]


@pytest.mark.parametrize("seed", range(5))
def test_a_quantile_is_that_of_the_sorted_times_to_a_microsecond_and_never_below(seed: int) -> None:
    times_s = drawn(seed, 5000)
    found, ordered = histogram(times_s), sorted(times_s)
    for share in SHARES:
        exact = ordered[min(int(share * len(ordered)), len(ordered) - 1)]
        if exact < BINS * BIN_S:
            assert exact <= found.quantile_s(share) + 1e-9 and found.quantile_s(share) <= exact + BIN_S + 1e-9
        else:
            assert found.quantile_s(share) == found.worst_s >= exact


@pytest.mark.parametrize("seed", range(5))
def test_those_over_a_limit_are_counted_never_too_few(seed: int) -> None:
    times_s = drawn(seed, 5000)
    found = histogram(times_s)
    for limit_s in (0.0, 17e-6, 125e-6, 250e-6, 833.3e-6, 0.019, 0.02, 0.4):
        exact = sum(one >= limit_s for one in times_s)
        assert exact <= found.over(limit_s) <= sum(one >= min(limit_s, 0.02) - BIN_S for one in times_s)
        assert found.share_over(limit_s) == found.over(limit_s) / len(times_s)


def test_a_bin_has_its_lower_end_and_not_its_upper_one() -> None:
    found = histogram([n * 1e-6 for n in range(1000)])
    assert list(found.bins[:1001]) == [1] * 1000 + [0]
    assert found.over(250e-6) == 750 and found.over(250.5e-6) == 750


def test_what_is_beyond_the_last_bin_is_counted_and_the_worst_is_exact() -> None:
    found = histogram([19_999e-6, 0.02, 0.123456789])
    assert (found.beyond, found.count, found.worst_s) == (2, 3, 0.123456789)
    assert found.quantile_s(0.99) == 0.123456789


def test_of_nothing_there_is_nothing() -> None:
    found = Histogram()
    assert (found.quantile_s(0.99), found.share_over(0.0), found.worst_s) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("pieces", [1, 2, 7, 100])
def test_the_sum_of_the_turns_is_the_histogram_of_all(pieces: int) -> None:
    times_s = drawn(3, 3000)
    whole, summed = histogram(times_s), Histogram()
    for n in range(pieces):
        summed.merge(histogram(times_s[n::pieces]))
    assert summed.bins == whole.bins and summed.beyond == whole.beyond
    assert (summed.count, summed.worst_s) == (whole.count, whole.worst_s)


@pytest.mark.parametrize("per_decade", [1, 8, 16, 40])
def test_the_classes_of_a_picture_hold_all_and_leave_no_gap(per_decade: int) -> None:
    times_s = drawn(4, 3000)
    found = histogram(times_s).classes(per_decade)
    assert sum(count for *_, count in found) == len(times_s)
    assert found[0][0] == 0.0 and found[-1][1] == math.inf
    assert all(one[1] == after[0] for one, after in pairwise(found))


def test_hours_of_ticks_take_no_more_memory_than_a_second_of_them() -> None:
    found = Histogram()
    clock = SteppedClock(lateness=lambda n: (n * 7919 % 30_000) * 1e-6)  # every bin, and beyond
    wake_ups.wake_ups(0.0005, 2000, found, clock)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        wake_ups.wake_ups(0.0005, 60_000, found, clock)
        for _ in range(5):
            found.merge(found)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 2000, grown
    assert len(found.bins) == BINS and found.count == 62_000 * 2**5


def test_each_deadline_is_counted_with_its_lateness_and_those_slept_through_are_one() -> None:
    late_s = [0.0, 1e-4, 0.0035, 0.0, 0.0]  # the third sleeps through three more deadlines
    found = Histogram()
    wake_ups.wake_ups(0.001, len(late_s), found, SteppedClock(lateness=lambda n: late_s[n]))
    assert found.count == 5 and found.bins[100] == 1 and found.bins[3500] == 1
    assert found.bins[0] == 3


class Bus:
    """A port whose SYNCs come back, stamped with the time at which they were sent and what that is off."""

    def __init__(self, clock: SteppedClock) -> None:
        self.clock, self.stamps, self.overflows, self.frame = clock, list[float](), 0, pdo.frame(pdo.SYNC)

    def send(self, frame: bytearray) -> bool:
        self.frame = frame
        self.stamps.append(self.clock.now_s())
        return True

    def receive_stamped(self, buffer: bytearray) -> float | None:
        if not self.stamps:
            return None
        buffer[:] = self.frame
        return self.stamps.pop(0)


def test_a_sync_that_is_late_by_a_quarter_is_left_out_and_its_interval_is_off_by_a_period() -> None:
    late_s = [0.0, 0.0, 0.0001, 0.0, 0.0003, 0.0, 0.0]
    clock = SteppedClock(lateness=lambda n: late_s[n])
    port = Bus(clock)
    echoes = Echoes(port, 0.001)  # type: ignore[arg-type]
    wake_ups.send_syncs(0.001, len(late_s), [port], [echoes], clock)  # type: ignore[list-item]
    assert echoes.heard == 6
    off_us = {n: count for n, count in enumerate(echoes.off.bins) if count}
    assert off_us == {0: 2, 100: 2, 1000: 1}
    assert echoes.off.over(0.00025) == 1


def test_an_interval_in_which_the_kernel_had_no_room_is_none() -> None:
    port = Bus(SteppedClock())
    echoes = Echoes(port, 0.001)  # type: ignore[arg-type]
    port.stamps = [1.0, 1.001]
    echoes.drain()
    port.overflows, port.stamps = 1, [1.009, 1.010]
    echoes.drain()
    assert echoes.heard == 4 and echoes.off.count == 2 and echoes.off.over(0.0005) == 0


def test_what_is_no_sync_counts_for_none() -> None:
    port = Bus(SteppedClock())
    echoes = Echoes(port, 0.001)  # type: ignore[arg-type]
    port.frame, port.stamps = pdo.frame(0x20000004, bytes(8)), [1.0, 1.2]
    echoes.drain()
    assert (echoes.heard, echoes.off.count) == (0, 0)


def test_a_turn_leaves_this_process_as_it_was() -> None:
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)
    found = Histogram()
    given = wake_ups.turn(0.001, 0.05, found, cpu=min(before[1]))
    assert found.count == 50 and given.major_faults >= 0
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before
