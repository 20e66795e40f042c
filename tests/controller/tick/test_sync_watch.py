"""Which SYNC still leaves, and from when on those that did not are a fault: on a clock of our own."""

from __future__ import annotations

import math

import pytest
from support.machines.shipped_kinds import machine
from support.machines.tick_bench import FakeGroup

from controller.state import stop_times
from controller.state.modes import Fault, Mode
from controller.tick.mode import Modes
from controller.tick.sync_watch import (
    BLAMED_TICKS,
    LATE_SHARE,
    LONG_GAP,
    NEAREST_SHARE,
    SyncWatch,
)
from drives.cyclic.drive import DriveFault

T = 0.002
LIMIT = 5.0  # skips a second


def at_rest() -> float:
    """Ticks in which axes that stand could be at rest."""
    return 0.0


class Watched:
    def __init__(self, mode: Mode = Mode.RUNNING, **changes: object) -> None:
        built = machine(**({"skip_limit_per_s": LIMIT, "late": "stop"} | changes))
        self.group = FakeGroup([0] * 5)
        self.modes = Modes(self.group, T)
        self.modes.mode = mode
        self.now_s = 0.0
        self.watch = SyncWatch(built, self.group, self.modes, lambda: self.now_s)
        self.deaf_s = stop_times.deaf_s(built)

    def send(self, now_s: float, lateness_s: float = 0.0, tick: int = 1) -> bool:
        self.now_s = now_s
        return self.watch.send(tick, now_s, lateness_s)

    def skip(self, kept_back: bool = False) -> tuple[Fault, int]:
        self.watch.count(False, 1, 0.0, kept_back)
        return self.modes.fault, self.modes.fault_axis


def test_before_the_first_tick_nothing_was_late_and_nothing_left_out() -> None:
    watch = Watched().watch
    assert (watch.skips, watch.late_max_s, watch.lateness_s) == (0, 0.0, 0.0)
    assert not watch.is_unheard
    assert not watch.is_after_a_gap(LONG_GAP, at_rest) and watch.is_after_a_gap(LONG_GAP + 1, at_rest)


def test_a_sync_leaves_up_to_a_quarter_of_the_period_late_and_never_close_to_the_last_one() -> None:
    watched = Watched()
    assert not watched.send(0.0, LATE_SHARE * T)
    assert watched.send(0.0, 0.999 * LATE_SHARE * T)
    assert not watched.send(0.999 * NEAREST_SHARE * T)
    assert watched.send(NEAREST_SHARE * T)
    assert watched.group.syncs == [0.0, NEAREST_SHARE * T]


def test_what_it_takes_from_bus_to_bus_brings_no_two_syncs_closer() -> None:
    """Late by almost a quarter, on five buses one after the other; the next in time is far enough."""
    watched, lasts_s = Watched(), [0.02 * T]
    sync = watched.group.sync

    def slow(now_s: float) -> bool:
        watched.now_s = now_s + lasts_s[0]
        return sync(now_s)

    watched.group.sync = slow  # type: ignore[method-assign]
    at_s = 0.0
    assert watched.send(at_s)
    assert watched.send(at_s := at_s + 1.24 * T, 0.24 * T)
    assert watched.send(at_s := at_s + 0.76 * T), "on every bus it is so far behind"
    lasts_s[0] = 0.2 * T  # somebody was in between
    assert watched.send(at_s := at_s + 1.1 * T, 0.1 * T)
    assert not watched.send(at_s + 0.9 * T), "on the last bus that may be 0.72 T"


def test_a_sync_that_is_said_ahead_of_its_time_changes_nothing_of_that() -> None:
    watched = Watched()
    assert watched.send(0.0)
    assert all(watched.watch.send(n, n * T, 0.0) for n in range(1, 5)), "all at one time"
    assert not watched.watch.send(5, 0.7 * T, 0.0)
    assert watched.send(5 * T, tick=5)


def test_a_gap_is_long_when_so_many_ticks_in_a_row_have_sent_none() -> None:
    watched = Watched()
    watched.send(1.0, tick=100)
    assert not watched.watch.is_after_a_gap(100 + LONG_GAP, at_rest)
    assert watched.watch.is_after_a_gap(101 + LONG_GAP, at_rest)
    watched.watch.pass_over()
    assert not watched.watch.is_after_a_gap(101 + LONG_GAP, at_rest)
    assert watched.watch.is_after_a_gap(102 + LONG_GAP, at_rest)


@pytest.mark.parametrize("stops_within", [60.0, 100.0])
def test_a_gap_is_not_long_before_motors_can_have_lost_half_of_their_speed(stops_within: float) -> None:
    watched = Watched()
    watched.send(1.0, tick=100)
    half = int(stops_within / 6.0)
    assert half > LONG_GAP
    assert not watched.watch.is_after_a_gap(100 + half, lambda: stops_within)
    assert watched.watch.is_after_a_gap(101 + half, lambda: stops_within)


def test_a_bus_that_takes_none_for_its_time_is_unheard_and_heard_again_with_the_next() -> None:
    watched = Watched()
    watched.group.deaf = True
    most = round(stop_times.LOST_BUS_S / T)
    for i in range(most):
        assert not watched.send(i * T) and not watched.watch.is_unheard
    watched.send(most * T)
    assert watched.watch.is_unheard
    watched.group.deaf = False
    assert watched.send((most + 1) * T) and not watched.watch.is_unheard
    watched.group.deaf = True
    for i in range(most + 2, 2 * most + 2):
        watched.send(i * T)
    assert not watched.watch.is_unheard  # as long as at first


def test_skips_and_lateness_are_counted_whatever_they_mean() -> None:
    watch = Watched(Mode.READY).watch
    for sent, ticks, late_s, skips, most_s in (
        (True, 1, 0.001, 0, 0.001),
        (False, 1, 0.003, 1, 0.003),
        (True, 4, 0.002, 4, 0.003),
        (False, 3, 0.0, 7, 0.003),
    ):
        watch.count(sent, ticks, late_s, False)
        assert (watch.skips, watch.lateness_s, watch.late_max_s) == (skips, late_s, most_s)


def test_more_than_a_second_s_worth_of_skips_at_once_is_a_fault_while_the_path_runs() -> None:
    watched = Watched()
    for _ in range(round(LIMIT)):
        assert watched.skip()[0] is Fault.NONE
    assert watched.skip() == (Fault.TOO_MANY_SKIPS, -1)


def test_a_long_time_without_skips_is_no_credit() -> None:
    watched = Watched()
    for _ in range(500):
        watched.watch.count(True, 1, 0.0, False)
    for _ in range(round(LIMIT)):
        assert watched.skip()[0] is Fault.NONE
    assert watched.skip()[0] is Fault.TOO_MANY_SKIPS


@pytest.mark.parametrize(("ticks", "fault"), [(102, Fault.NONE), (60, Fault.TOO_MANY_SKIPS)])
def test_what_is_skipped_evenly_may_go_on_for_ever_up_to_the_limit(ticks: int, fault: Fault) -> None:
    watched = Watched()  # five a second are one in a hundred ticks
    for _ in range(20):
        watched.skip()
        for _ in range(ticks - 1):
            watched.watch.count(True, 1, 0.0, False)
    assert watched.modes.fault is fault


def test_what_we_have_kept_back_ourselves_or_came_late_at_rest_does_no_harm_now_or_later() -> None:
    watched = Watched()
    for _ in range(50):
        assert watched.skip(kept_back=True)[0] is Fault.NONE
    watched.modes.mode = Mode.HOLD
    for _ in range(50):
        assert watched.skip()[0] is Fault.NONE
    watched.modes.mode = Mode.RUNNING
    for _ in range(round(LIMIT)):
        assert watched.skip()[0] is Fault.NONE
    watched = Watched(late="count")
    for _ in range(50):
        assert watched.skip()[0] is Fault.NONE


@pytest.mark.parametrize("after", range(BLAMED_TICKS + 1))
@pytest.mark.parametrize("longer", [False, True])
def test_what_drives_tell_just_after_we_were_silent_too_long_is_told_of_us(after: int, longer: bool) -> None:
    watched = Watched()
    missed = math.floor(watched.deaf_s / T) + longer
    for tick in range(after + 1):
        if tick == after:
            watched.group.failure = DriveFault.HEARTBEAT_LOST, 2
        watched.watch.look_for_our_silence(0.0, missed if tick == 0 else 0)
    blamed = longer and after < BLAMED_TICKS
    assert watched.modes.fault is (Fault.TOO_MANY_SKIPS if blamed else Fault.NONE)
    assert watched.modes.fault_axis == -1
