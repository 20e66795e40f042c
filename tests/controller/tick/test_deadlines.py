"""The loop by itself: deadlines on their grid, what is done before one, how it ends."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import pytest
from support.machines.shipped_kinds import machine
from support.machines.tick_bench import Bench, s_curve, stops, straight

from controller.ipc.handoff import dwell
from controller.state.modes import Fault, Mode, Request
from controller.tick.loop import (
    AHEAD_S,
    CALM_S,
    LAST_TICKS_S,
    MIN_SPIN_S,
    SPIN_S,
    STAND_DOWN_S,
    Loop,
    SteppedClock,
)
from drives.cia402 import State, Wanted
from drives.cyclic.line import MAX_FRAMES

T = 0.002
AT_ONCE = round(AHEAD_S / T)
HERE = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE = (100.0, 60.0, -80.0, 1.0, 2.0)


class Group:
    """No bus."""

    def __init__(self) -> None:
        self.lines: list[Any] = []


class Sync:
    """Which SYNC may leave."""

    earliest_s = float("-inf")


class Stage:
    """A cycle and a clock in one, in which only what the test says takes time."""

    def __init__(self, period_s: float = T, begins_s: float = 7.0) -> None:
        self.machine = machine(period_s=period_s)
        self.group, self.sync = Group(), Sync()
        self.at_rest = self.idle = True
        self.time_s = begins_s
        self.early_s = 250e-6  # before the deadline it wakes
        self.rehearsal_s = self.drain_s = 0.0
        self.late_s = 0.0  # the next spin ends so much too late
        self.waits: list[tuple[float, float]] = []  # deadline, and how long before it was to be woken
        self.called: list[str] = []
        self.runs: list[tuple[float, float, int]] = []  # time, lateness, deadlines missed

    def now_s(self) -> float:
        return self.time_s

    def wake(self, deadline_s: float, early_s: float) -> None:
        self.waits.append((deadline_s, early_s))
        self.called.clear()
        self.time_s = max(self.time_s, deadline_s - self.early_s)

    def spin(self, deadline_s: float) -> float:
        self.time_s = max(self.time_s, deadline_s) + self.late_s
        self.late_s = 0.0
        return self.time_s

    def rehearse(self, now_s: float) -> None:
        self.called.append("rehearse")
        self.time_s += self.rehearsal_s

    def receive(self, now_s: float) -> None:
        assert now_s == self.time_s
        self.called.append("receive")
        self.time_s += self.drain_s

    def run(self, now_s: float, lateness_s: float, missed: int = 0) -> bool:
        self.called.append("run")
        self.runs.append((now_s, lateness_s, missed))
        return True

    def repeat(self, now_s: float) -> None:
        self.called.append("repeat")
        self.runs.append((now_s, 0.0, 0))

    # a bus that keeps frames

    def keep(self) -> None:
        self.called.append("keep")

    def later(self, at_s: float) -> None:
        self.called.append(f"at {at_s:.3f}")

    def hand_over(self) -> None:
        self.called.append("hand over")


def staged(stage: Stage, **more: Any) -> Loop:
    return Loop(stage, stage, **more)  # type: ignore[arg-type]


# ---- deadlines


def test_deadlines_are_whole_periods_from_the_start_and_none_is_left_out() -> None:
    stage = Stage()
    loop = staged(stage)
    for n in range(1, 500):
        assert loop.tick()
        assert stage.waits[-1][0] == 7.0 + n * T
        assert stage.runs[-1] == (7.0 + n * T, 0.0, 0)


@pytest.mark.parametrize(
    ("period_s", "early_s"), [(0.004, SPIN_S), (0.002, SPIN_S), (0.001, 0.2e-3), (0.0005, MIN_SPIN_S)]
)
def test_it_is_woken_before_the_deadline_by_a_fifth_of_the_period_within_bounds(
    period_s: float, early_s: float
) -> None:
    stage = Stage(period_s)
    staged(stage).tick()
    assert stage.waits[-1][1] == pytest.approx(early_s)


@pytest.mark.parametrize("at_rest", [False, True])
def test_unless_drives_are_said_to_be_simulated_each_deadline_is_spun_for(at_rest: bool) -> None:
    stage = Stage()
    stage.at_rest = at_rest
    staged(stage).tick()
    assert stage.waits[-1][1] == SPIN_S
    staged(stage, eased=True).tick()
    assert stage.waits[-1][1] == (0.0 if at_rest else SPIN_S)


@pytest.mark.parametrize(("share", "late"), [(-0.1, 0.0), (0.0, 0.0), (0.1, 0.1), (0.25, 0.25), (0.26, 0.0)])
def test_a_sync_that_would_be_too_close_to_the_last_one_waits_if_that_is_not_too_late(
    share: float, late: float
) -> None:
    stage = Stage(begins_s=0.0)
    stage.sync.earliest_s = (1.0 + share) * T
    staged(stage).tick()
    assert stage.runs == [(pytest.approx((1.0 + late) * T), pytest.approx(late * T), 0)]


def calm(period_s: float = T, nodes: int = 0) -> tuple[Stage, Loop]:
    """Simulated drives (``nodes`` on a bus) with which nothing has happened for long enough."""
    stage = Stage(period_s)
    stage.group.lines = [SimpleNamespace(drives=range(nodes), others=())]
    stage.early_s = 0.0
    loop = staged(stage, eased=True, ahead=(stage,))
    for _ in range(round(CALM_S / period_s)):
        loop.tick()
    assert len(stage.waits) == round(CALM_S / period_s) and "keep" not in stage.called
    return stage, loop


def test_where_nothing_happens_a_tick_is_said_again_for_the_next_ones() -> None:
    stage, loop = calm()
    n = len(stage.waits)
    for turn in range(1, 4):
        assert loop.tick()
        first = n + AT_ONCE * (turn - 1) + 1
        assert stage.waits[-1] == (pytest.approx(7.0 + first * T), 0.0)
        again = [word for k in range(1, AT_ONCE) for word in (f"at {7.0 + (first + k) * T:.3f}", "repeat")]
        assert stage.called == ["receive", "keep", "run", *again, "hand over"]
    times = [now_s for now_s, _, _ in stage.runs]
    assert times == [pytest.approx(7.0 + k * T) for k in range(1, n + 3 * AT_ONCE + 1)], (
        "none is left out, and none is twice"
    )


@pytest.mark.parametrize("period_s", [0.001, AHEAD_S])
def test_of_a_period_that_is_too_short_or_as_long_no_tick_is_said_again(period_s: float) -> None:
    stage, loop = calm(period_s)
    loop.tick()
    assert "keep" not in stage.called


@pytest.mark.parametrize("change", ["idle", "at_rest"])
def test_what_happens_is_looked_at_in_every_tick_until_it_is_calm_again(change: str) -> None:
    stage, loop = calm()
    loop.tick()
    setattr(stage, change, False)
    loop.tick()
    setattr(stage, change, True)
    for _ in range(round(CALM_S / T)):
        loop.tick()
        assert "keep" not in stage.called
    loop.tick()
    assert "keep" in stage.called


def test_a_request_that_comes_with_the_tick_is_not_said_again() -> None:
    stage, loop = calm()
    run = stage.run

    def asked(*how: Any) -> bool:
        stage.idle = False
        return run(*how)

    stage.run = asked  # type: ignore[method-assign]
    loop.tick()
    assert stage.called == ["receive", "keep", "run", "hand over"]


def test_a_tick_that_comes_late_is_said_again_up_to_where_it_would_have_been() -> None:
    stage, loop = calm()
    n, stage.early_s = len(stage.waits), -2.3 * T
    loop.tick()
    assert stage.runs[n:] == [
        (pytest.approx(7.0 + (n + 3.3) * T), pytest.approx(0.3 * T), 2),
        *((pytest.approx(7.0 + (n + k) * T), 0.0, 0) for k in range(4, AT_ONCE + 1)),
    ]
    assert stage.called[3] == f"at {7.0 + (n + 4) * T:.3f}", "when it is due, not so much after the late one"
    stage.early_s = 0.0
    loop.tick()
    assert stage.waits[-1][0] == 7.0 + (n + AT_ONCE + 1) * T


@pytest.mark.parametrize(("nodes", "at_once"), [(5, 20), (9, 12), (40, 3), (127, 1)])
def test_what_answers_to_the_ticks_said_at_once_fits_into_one_drain(nodes: int, at_once: int) -> None:
    stage, loop = calm(nodes=nodes)
    loop.tick()
    assert 1 + stage.called.count("repeat") == at_once
    assert at_once * nodes <= MAX_FRAMES


def test_frames_that_are_kept_go_out_though_a_tick_ends_in_an_error() -> None:
    stage, loop = calm()
    stage.repeat = lambda now_s: 1 / 0  # type: ignore[method-assign,assignment,return-value]
    with pytest.raises(ZeroDivisionError):
        loop.tick()
    assert stage.called[-1] == "hand over"


@pytest.mark.parametrize(("late", "missed"), [(0.3, 0), (0.9, 0), (1.3, 1), (4.6, 4)])
def test_a_late_tick_shifts_no_deadline_behind_it(late: float, missed: int) -> None:
    """How late it is counts from the last deadline that is over; those before it were missed."""
    stage = Stage(begins_s=0.0)
    loop = staged(stage)
    for _ in range(9):
        loop.tick()
    stage.late_s = late * T
    loop.tick()
    now_s, lateness_s, gone = stage.runs[-1]
    assert gone == missed and now_s == pytest.approx((10 + late) * T)
    assert lateness_s == pytest.approx((late - missed) * T)
    loop.tick()
    assert stage.runs[-1] == (pytest.approx((11 + missed) * T), pytest.approx(0.0, abs=1e-12), 0)


def test_a_stepped_clock_begins_at_nothing_steps_its_world_and_is_never_set_back() -> None:
    seen: list[float] = []
    waits: list[int] = []

    def lateness(n: int) -> float:
        waits.append(n)
        return 0.7 if n == 1 else 0.0

    clock = SteppedClock([seen.append], lateness)
    assert clock.now_s() == 0.0
    for deadline_s in (0.5, 1.0, 1.5, 2.0):
        clock.wake(deadline_s, 0.1)
        assert clock.spin(deadline_s) == clock.now_s() == seen[-1]
    assert waits == [0, 1, 2, 3] and seen == [0.5, 1.7, 1.7, 2.0]


# ---- before a deadline


def test_a_rehearsal_is_left_out_where_it_would_not_be_over_in_time() -> None:
    """It is known by the longest of late, with the drain behind it."""
    stage = Stage()
    loop = staged(stage)
    stage.rehearsal_s, stage.drain_s = 60e-6, 40e-6
    loop.tick()
    assert stage.called == ["rehearse", "receive", "run"]
    stage.early_s = 95e-6
    loop.tick()
    assert stage.called == ["receive", "run"]
    stage.early_s = 105e-6
    loop.tick()
    assert stage.called == ["rehearse", "receive", "run"]


def test_after_a_rehearsal_that_was_long_once_it_is_tried_again_a_little_earlier_each_tick() -> None:
    stage = Stage()
    loop = staged(stage)
    stage.rehearsal_s = 200e-6
    loop.tick()
    stage.rehearsal_s, stage.early_s = 20e-6, 100e-6
    n = 0
    while n < 1000 and (n == 0 or "rehearse" not in stage.called):
        loop.tick()
        n += 1
    assert 600 < n < 800, "a thousandth of it is forgotten in each tick: half of it in 693"
    loop.tick()
    assert "rehearse" in stage.called


def test_one_rehearsal_beyond_all_measure_is_remembered_as_the_longest_there_is_time_for() -> None:
    stage = Stage()
    loop = staged(stage)
    stage.rehearsal_s = 1.0
    loop.tick()
    stage.rehearsal_s = 20e-6
    for early_s, rehearses in ((SPIN_S - 10e-6, False), (SPIN_S + 10e-6, True)):
        stage.early_s = early_s
        loop.tick()
        assert ("rehearse" in stage.called) is rehearses


# ---- the end


def moving() -> Bench:
    bench = Bench(machine(period_s=T))
    bench.enable()
    piece, move = straight(HERE, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
    bench.send([piece, dwell(0.0, end=True)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    bench.tick(100)
    assert not bench.snapshot.at_rest
    return bench


def test_asked_to_end_in_a_cut_it_comes_to_rest_on_the_path_and_then_the_drives_are_switched_off() -> None:
    bench = moving()
    enabled_at_rest: list[bool] = []
    want = bench.group.want

    def wanted(what: Wanted) -> None:
        enabled_at_rest.append(bench.cycle.follow.at_rest)
        want(what)

    bench.group.want = wanted  # type: ignore[method-assign]
    before = bench.cycle.tick
    bench.loop.stand_down()
    assert enabled_at_rest and all(enabled_at_rest)
    assert not any(drive.state is State.OPERATION_ENABLED for drive in bench.group.drives)
    assert bench.snapshot.fault is Fault.NONE and 0.0 < bench.snapshot.joints[0] < 100.0
    share = [joint / there for joint, there in zip(bench.snapshot.joints, THERE, strict=True)]
    assert max(share) - min(share) < 1e-12, "on the line"
    assert bench.cycle.tick - before < 2 * STAND_DOWN_S / T, "no longer than it took"
    bench.close()


def test_drives_that_do_not_switch_off_are_waited_for_no_longer_than_a_second() -> None:
    bench = moving()
    bench.until(Mode.READY)
    bench.until_rest()
    for drive in bench.group.drives:
        drive.want = lambda wanted: None  # type: ignore[method-assign]
    before = len(bench.group.syncs)
    bench.loop.stand_down()
    assert len(bench.group.syncs) - before == STAND_DOWN_S / T
    bench.close()


def test_after_an_error_of_our_own_the_drives_are_told_to_stop_sync_by_sync_for_half_a_second() -> None:
    bench = moving()

    def broken() -> None:
        raise ZeroDivisionError

    bench.cycle._requests.take = broken  # type: ignore[assignment]
    before = len(bench.group.syncs)
    assert bench.loop.run(lambda: True) is Fault.INTERNAL
    assert (bench.snapshot.fault, bench.snapshot.fault_axis) == (Fault.INTERNAL, -1)
    assert isinstance(bench.loop.error, ZeroDivisionError), "kept for whoever asks"
    assert bench.group.wanted is Wanted.QUICK_STOP
    syncs = bench.group.syncs[before - 1 :]
    assert len(syncs) - 2 == LAST_TICKS_S / T, "but for the tick that failed"
    gaps = [b - a for a, b in itertools.pairwise(syncs)]
    assert max(gaps) == pytest.approx(T) and min(gaps) == pytest.approx(T)
    assert bench.group.commands[-1][1] == tuple(bench.group.positions), "where they are"
    bench.close()


def test_an_error_in_the_last_ticks_does_not_end_them() -> None:
    bench = moving()

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    bench.cycle._requests.take = broken  # type: ignore[assignment]
    bench.group.command = broken  # type: ignore[assignment]
    before = len(bench.group.syncs)
    assert bench.loop.run(lambda: True) is Fault.INTERNAL
    assert len(bench.group.syncs) - before >= LAST_TICKS_S / T
    bench.close()


def test_a_loop_that_is_told_to_end_has_no_error() -> None:
    bench = Bench()
    left = iter(range(5))
    assert bench.loop.run(lambda: next(left, None) is not None) is Fault.NONE
    assert bench.loop.error is None and bench.cycle.tick == 4
    bench.close()
