"""A drive that takes setpoints as they come, and not with SYNC: ahead of what SYNC has given it."""

from __future__ import annotations

from random import Random

import pytest
from support.drives.group_bench import GroupBench, T, nodes

from drives.bench.simulated import Parameters
from drives.cia402 import Wanted
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.following_error import AHEAD, AHEAD_COUNTS, AHEAD_S, MEASURE_EVERY, FollowingError
from drives.settings import FollowingWindow

STEP = 2000  # counts in one SYNC
ON_ARRIVAL = 255
WITHOUT_LAG = Parameters(feed_forward=1.0)


def bench_of(parameters: Parameters = WITHOUT_LAG, **changes: object) -> GroupBench:
    bench = GroupBench(nodes("XYZ", **changes), parameters=parameters)
    bench.enable()
    return bench


def run(bench: GroupBench, ticks: int = 400, up: int = 50) -> list[bool]:
    """Up to speed, on, and down to rest; which drives were found to be early."""
    speeds = [STEP * (i + 1) // up for i in range(up)]
    for step in (*speeds, *[STEP] * ticks, *speeds[::-1], *[0] * up):
        bench.tick(step=step)
        assert bench.fault == (DriveFault.NONE, -1)
    return [drive.following_error.early for drive in bench.group.drives]


@pytest.mark.parametrize("way", [{}, {"feed_forward": True}], ids=["its own", "by 60B1h"])
def test_a_drive_that_a_stranger_has_set_to_take_setpoints_at_once_is_found_and_no_other(
    way: dict[str, bool],
) -> None:
    bench = bench_of(Parameters() if way else WITHOUT_LAG, **way)
    assert run(bench) == [False, False, False]
    bench.write(2, 0x1400, 2, ON_ARRIVAL, 1)
    assert run(bench) == [False, True, False]
    bench.group.want(Wanted.OFF)
    bench.tick(100)
    bench.write(2, 0x1400, 2, 1, 1)
    bench.enable()
    assert run(bench) == [False, False, False], "enabled anew it is looked at anew"


def test_a_drive_that_lags_by_more_than_a_sync_does_not_show_it() -> None:
    """What is known of such a one is what is read back of 1400h:02."""
    bench = bench_of(Parameters(feed_forward=0.0))
    bench.write(2, 0x1400, 2, ON_ARRIVAL, 1)
    assert run(bench) == [False, False, False]


@pytest.mark.parametrize("seed", range(5))
def test_healthy_drives_without_lag_are_never_early(seed: int) -> None:
    """Lost and late frames, reversals and stops: none of it puts a drive ahead for long."""
    bench, rng = bench_of(Parameters(feed_forward=Random(seed).choice((0.9, 1.0)))), Random(seed)

    def tamper(_at_s: float, can_id: int, _frame: bytes) -> tuple[float, ...]:
        if rng.random() > 0.01 or not 0x180 < can_id < 0x300:
            return (0.0,)
        return rng.choice(((), (0.3 * T,), (1.2 * T,)))

    bench.rig.buses["can"].tamper = tamper
    speed = 0.0
    for _ in range(15):
        target = rng.choice((0.0, 1.0, -1.0, rng.uniform(-1.0, 1.0))) * STEP
        for _ in range(rng.randrange(20, 200)):
            speed += max(-STEP / 50, min(STEP / 50, target - speed))
            bench.tick(step=round(speed))
            assert bench.fault[0] in (DriveFault.NONE, DriveFault.FEEDBACK_LOST)
            assert not any(drive.following_error.early for drive in bench.group.drives)


# ---- the measure alone

MEASURES = round(AHEAD_S / T / MEASURE_EVERY)


def measured(share: float, moved: int = 1000, times: int = MEASURES) -> bool:
    error = FollowingError(FollowingWindow(), T)
    for n in range(times):
        way = 1 if n < times // 2 else -1
        error.measure(round(way * share * moved), way * moved)
    return error.early


def test_it_is_early_where_it_leads_by_more_than_its_share_for_so_long_whichever_way_it_goes() -> None:
    assert measured(-1.1 * AHEAD)
    assert not measured(-0.9 * AHEAD)
    assert not measured(1.1)
    assert not measured(-1.1 * AHEAD, times=MEASURES - 1)
    assert not measured(-1.1 * AHEAD, moved=AHEAD_COUNTS - 1)


def test_one_measure_that_is_not_ahead_ends_the_row_and_rest_does_not() -> None:
    for between, early in (((0, 1000), False), ((0, 0), True)):
        error = FollowingError(FollowingWindow(), T)
        for n in range(MEASURES):
            if n == MEASURES - 1:
                error.measure(*between)
            error.measure(-1000, 1000)
        assert error.early is early
