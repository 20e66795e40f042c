"""Jogging on the tick: dead-man, limits of travel, another line, steps, holds, and the way back."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.machines.tick_bench import Bench, commands, excess, rapid_law, s_curve, stops, straight

from controller.ipc.handoff import DEAD_MAN_S, PLANNER_SILENCE_S, Jog, dwell
from controller.machine.model import Joints, Machine
from controller.state.modes import ALL_AXES, Fault, Mode, Request
from controller.tick.check import Check
from controller.tick.jog import UNHOMED_SHARE
from controller.tick.mode import Phase
from drives.cia402 import Wanted
from drives.cyclic.drive import DriveFault

X_PLUS: Joints = (1.0, 0.0, 0.0, 0.0, 0.0)
HOME: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)
LINES: tuple[Joints, ...] = (
    X_PLUS,
    (-1.0, 0.0, 0.0, 0.0, 0.0),
    (0.6, -0.8, 0.0, 0.0, 0.0),
    (0.0, 0.0, -1.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 1.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, -1.0),
    (10.0, 0.0, 3.0, 0.1, 0.2),
)


def ready(homed: int = ALL_AXES, built: Machine | None = None, start: Joints = HOME) -> Bench:
    bench = Bench(built, start)
    bench.cycle.modes.homed = homed
    bench.enable()
    bench.tick(3)
    bench.rows()
    return bench


def jog(bench: Bench, line: Joints = X_PLUS, speed: float = 100.0, length: float = math.inf) -> None:
    bench.jog(Jog(line, speed, length))


def press(bench: Bench, ticks: int, line: Joints = X_PLUS, speed: float = 100.0) -> None:
    """A key held down: asked for every 40 ms."""
    for n in range(ticks):
        if n % 20 == 0:
            jog(bench, line, speed)
        bench.tick()


def settle(bench: Bench, mode: Mode = Mode.READY, most: int = 4000) -> None:
    bench.until(mode, most)
    assert bench.cycle.follow.at_rest


def assert_within_limits(bench: Bench, hint: object = "") -> None:
    velocity, acceleration, jerk = excess(bench.machine, commands(bench.rows()))
    assert velocity <= 1.0005 and acceleration <= 1.002 and jerk <= 1.02, hint


def stop_ticks(bench: Bench, speed: float) -> float:
    """A stop of X from ``speed``, by its limits."""
    limits = bench.machine.axes[0].limits
    return (speed / limits.acceleration + limits.acceleration / limits.jerk) / bench.machine.period_s


def test_a_jog_that_is_not_asked_for_again_ends_within_the_dead_man_and_a_stop() -> None:
    bench = ready()
    press(bench, 101)  # the last time with the 101st tick
    bench.rows()
    T = bench.machine.period_s
    bench.tick(math.ceil(DEAD_MAN_S / T + stop_ticks(bench, 100.0)) + 2)
    rows = commands(bench.rows())
    late = rows[math.ceil(DEAD_MAN_S / T + stop_ticks(bench, 100.0)) :]
    assert np.ptp(late, axis=0).max() == 0.0
    steady = np.diff(rows[: round(0.9 * DEAD_MAN_S / T), 0])
    assert steady == pytest.approx(100.0 * T)  # and not sooner either
    settle(bench)
    assert bench.snapshot.fault is Fault.NONE and not bench.snapshot.jogging
    bench.close()


def test_lost_ticks_count_for_the_dead_man_too() -> None:
    bench = ready()
    press(bench, 101)
    at = bench.cycle.tick
    bench.cycle.run(bench.clock.now_s(), 0.0, missed=200)
    assert bench.cycle.tick == at + 201
    assert bench.cycle.modes.phase is Phase.HALTING
    bench.close()


def test_a_released_key_stops_at_once() -> None:
    bench = ready()
    press(bench, 150)
    before = bench.snapshot.joints[0]
    bench.ask(Request.JOG_STOP)
    settle(bench)
    assert bench.snapshot.joints[0] - before <= 100.0 * stop_ticks(bench, 100.0) * bench.machine.period_s
    assert_within_limits(bench)
    bench.close()


@pytest.mark.parametrize("request_", [Request.HOLD, Request.STOP, Request.JOG_STOP])
def test_hold_and_stop_end_a_jog_as_the_key_does(request_: Request) -> None:
    bench = ready()
    press(bench, 60)
    bench.ask(request_)
    settle(bench)
    assert not bench.refused
    bench.close()


def test_random_operators_break_no_limit_and_leave_no_travel() -> None:
    seed = random.randrange(2**32)
    rng = random.Random(seed)
    for period_s in (0.0005, 0.002, 0.005):
        bench = ready(built=_small(period_s))
        for _ in range(60):
            speed = 10 ** rng.uniform(-2, 3)
            length = rng.choice((math.inf, math.inf, 10 ** rng.uniform(-4, 2)))
            jog(bench, rng.choice(LINES), speed, length)
            if rng.random() < 0.1:
                bench.ask(rng.choice((Request.JOG_STOP, Request.HOLD, Request.STOP)))
            bench.tick(rng.randint(1, 120))
        bench.ask(Request.JOG_STOP)  # of a slow step
        settle(bench)
        assert bench.snapshot.fault is Fault.NONE, f"seed {seed}"
        rows = bench.rows()
        moved = commands(rows)
        low = [axis.travel_min for axis in bench.machine.axes]
        high = [axis.travel_max for axis in bench.machine.axes]
        assert (moved >= np.array(low) - 1e-9).all() and (moved <= np.array(high) + 1e-9).all(), (
            f"seed {seed}"
        )
        velocity, acceleration, jerk = excess(bench.machine, moved)
        assert velocity <= 1.0005 and acceleration <= 1.002 and jerk <= 1.02, f"seed {seed} at {period_s}"
        bench.close()


def _small(period_s: float) -> Machine:
    """Travels that are soon at their end."""
    built = machine(period_s=period_s)
    axes = tuple(
        replace(a, travel_min=-a.travel_max / 40.0, travel_max=a.travel_max / 60.0) for a in built.axes
    )
    return replace(built, axes=axes)


@pytest.mark.parametrize("line", LINES)
def test_every_line_ends_at_rest_where_the_first_travel_ends(line: Joints) -> None:
    bench = ready(built=_small(0.002))
    for _ in range(400):
        press(bench, 20, line, 1000.0)
        if bench.cycle.follow.at_rest:
            break
    assert bench.snapshot.mode is Mode.JOG  # as long as the key is down
    ends = [
        (a.travel_max if d > 0.0 else a.travel_min) / d
        for a, d in zip(bench.machine.axes, line, strict=True)
        if d
    ]
    assert bench.snapshot.joints == pytest.approx([min(ends) * d for d in line], abs=1e-9)
    settle(bench)
    assert bench.snapshot.fault is Fault.NONE
    assert_within_limits(bench)
    press(bench, 100, line)
    assert bench.cycle.follow.at_rest  # no further
    settle(bench)
    press(bench, 10, tuple(-d for d in line))  # type: ignore[arg-type]
    assert not bench.cycle.follow.at_rest  # but back
    bench.close()


def test_another_line_begins_once_the_first_one_rests() -> None:
    bench = ready()
    press(bench, 100)
    press(bench, 300, (0.0, 1.0, 0.0, 0.0, 0.0))
    moved = np.diff(commands(bench.rows()), axis=0)
    assert not ((moved[:, 0] != 0.0) & (moved[:, 1] != 0.0)).any()
    assert (moved[:, 1] != 0.0).any()
    bench.close()


def test_the_speed_follows_the_last_word() -> None:
    bench = ready()
    press(bench, 150, speed=100.0)
    press(bench, 150, speed=20.0)
    T = bench.machine.period_s
    x = commands(bench.rows())[:, 0]
    assert x[149] - x[148] == pytest.approx(100.0 * T) and x[-1] - x[-2] == pytest.approx(20.0 * T)
    press(bench, 150, speed=1e9)  # no more than the axis can
    x = commands(bench.rows())[:, 0]
    assert x[-1] - x[-2] == pytest.approx(bench.machine.axes[0].limits.velocity * T)
    bench.close()


@pytest.mark.parametrize("length", [0.0, 1e-6, 1e-3, 0.1, 1.0, 33.3])
def test_a_step_goes_its_length_to_the_last_digit(length: float) -> None:
    bench = ready(start=(5.0, 0.0, 0.0, 0.0, 0.0))
    jog(bench, length=length)
    bench.tick(5)
    settle(bench)
    assert bench.snapshot.joints[0] == pytest.approx(5.0 + length, abs=1e-11)
    assert_within_limits(bench)
    bench.close()


def test_a_second_step_waits_until_the_first_one_is_done() -> None:
    bench = ready()
    jog(bench, length=5.0)
    bench.tick(3)
    jog(bench, length=5.0)
    bench.tick()
    assert bench.refused
    settle(bench)
    assert bench.snapshot.joints[0] == pytest.approx(5.0)
    bench.close()


def test_a_step_needs_a_plan_that_lives_and_a_key_that_is_down_does_not() -> None:
    bench = ready()
    bench.planner_alive = False
    bench.tick(round(PLANNER_SILENCE_S / bench.machine.period_s))
    jog(bench, speed=50.0, length=100.0)
    bench.tick()
    settle(bench)
    assert bench.snapshot.joints[0] < 5.0
    at = bench.snapshot.joints[0]
    press(bench, 300)
    assert bench.snapshot.joints[0] > at + 30.0
    bench.close()


def test_an_axis_that_is_not_homed_is_slow_and_has_no_travel_to_end_at() -> None:
    start = (2000.0, 0.0, 0.0, 0.0, 0.0)  # beyond any travel, as far as its counts say
    bench = ready(homed=ALL_AXES & ~1, start=start)
    press(bench, 300, speed=200.0)
    settle(bench)
    assert bench.snapshot.joints[0] > start[0] + 5.0 and bench.snapshot.fault is Fault.NONE
    velocity, _, _ = excess(bench.machine, commands(bench.rows()))
    assert velocity == pytest.approx(UNHOMED_SHARE)
    bench.close()


def test_axes_without_a_zero_do_not_go_together() -> None:
    bench = ready(homed=ALL_AXES & ~1)
    jog(bench, (0.6, 0.8, 0.0, 0.0, 0.0))
    bench.tick(2)
    assert bench.snapshot.mode is Mode.READY and bench.refused
    bench.close()


@pytest.mark.parametrize(
    "order",
    [
        Jog(HOME, 1.0),
        Jog(X_PLUS, 0.0),
        Jog(X_PLUS, -1.0),
        Jog(X_PLUS, math.nan),
        Jog(X_PLUS, math.inf),
        Jog(X_PLUS, 1.0, -1.0),
        Jog(X_PLUS, 1.0, math.nan),
        Jog((math.nan, 0.0, 0.0, 0.0, 0.0), 1.0),
        Jog((math.inf, 0.0, 0.0, 0.0, 0.0), 1.0),
    ],
)
def test_an_order_without_sense_moves_nothing(order: Jog) -> None:
    bench = ready()
    bench.jog(order)
    bench.tick(5)
    assert bench.snapshot.mode is Mode.READY and bench.refused
    assert bench.snapshot.joints == HOME
    bench.close()


@pytest.mark.parametrize("mode", [Mode.OFF, Mode.RUNNING, Mode.STOPPING, Mode.FAULT, Mode.HOMING])
def test_a_jog_is_refused_in_every_mode_but_ready_hold_and_jog(mode: Mode) -> None:
    bench = ready()
    bench.cycle.modes.mode = mode
    jog(bench)
    bench.tick()
    assert bench.refused and not bench.snapshot.jogging
    bench.close()


def test_a_jog_drops_what_is_queued_for_a_start_from_elsewhere() -> None:
    bench = ready()
    piece, move = straight(HOME, (100.0, 0.0, 0.0, 0.0, 0.0), rapid_law)
    bench.send([piece], {0: move})
    bench.tick()
    epoch = bench.snapshot.epoch
    press(bench, 50, (0.0, 1.0, 0.0, 0.0, 0.0))
    settle(bench)
    assert bench.snapshot.epoch == epoch + 1 and not bench.cycle.follow.pending
    bench.ask(Request.START)
    bench.tick(50)
    assert bench.cycle.follow.at_rest
    bench.close()


# -- in a program that is held

THERE: Joints = (100.0, 60.0, -80.0, 1.0, 2.0)


def held() -> Bench:
    """Held in the middle of a line, with what is left of it queued."""
    bench = ready()
    piece, move = straight(HOME, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
    bench.send([piece, dwell(0.0, end=True)], {0: move}, stops=stops(1900.0, 48000.0))
    bench.tick()
    bench.ask(Request.START)
    bench.tick(200)
    bench.ask(Request.HOLD)
    bench.until(Mode.HOLD)
    bench.until_rest()
    bench.tick(3)
    left, move = straight(bench.cycle.follow.joints, THERE, lambda n: s_curve(n, 100.0, 1000.0, 40000.0), 1)
    bench.send([left, dwell(0.0, end=True)], {1: move})
    bench.tick()
    assert bench.snapshot.accepted == bench.sequence
    bench.rows()
    return bench


def test_a_jog_out_of_a_hold_goes_back_to_it_and_the_program_on_from_where_it_was_held() -> None:
    bench = held()
    at = bench.snapshot.joints
    up: Joints = (0.0, 0.0, 1.0, 0.0, 0.0)
    down: Joints = (0.0, 0.0, -1.0, 0.0, 0.0)
    jog(bench, up, length=20.0)
    bench.tick()
    settle(bench, Mode.HOLD)
    assert bench.snapshot.away
    bench.ask(Request.RESUME)
    bench.tick(2)
    assert bench.snapshot.mode is Mode.HOLD and bench.refused
    jog(bench, down, length=20.0)
    bench.tick()
    settle(bench, Mode.HOLD)
    assert not bench.snapshot.away and bench.snapshot.joints == at
    bench.ask(Request.RESUME)
    bench.until(Mode.READY)
    assert bench.snapshot.joints == pytest.approx(THERE) and bench.snapshot.fault is Fault.NONE
    assert_within_limits(bench)
    bench.close()


def test_a_plan_for_the_place_that_was_jogged_to_may_be_gone_on_with() -> None:
    bench = held()
    jog(bench, (0.0, 0.0, 1.0, 0.0, 0.0), length=20.0)
    bench.tick()
    settle(bench, Mode.HOLD)
    here = bench.cycle.follow.joints
    follow = bench.cycle.follow
    wrong, move = straight((0.0, 0.0, 1.0, 0.0, 0.0), THERE, rapid_law, 2)
    bench.send([wrong], {2: move}, at_s=follow.tau)
    bench.tick()
    assert bench.snapshot.rejected == bench.sequence and bench.snapshot.away
    back, move = straight(here, THERE, lambda n: s_curve(n, 100.0, 1000.0, 40000.0), 3)
    bench.send([back, dwell(0.0, end=True)], {3: move}, at_s=follow.tau)
    bench.tick()
    assert bench.snapshot.accepted == bench.sequence and not bench.snapshot.away
    bench.ask(Request.RESUME)
    bench.until(Mode.READY)
    assert bench.snapshot.joints == pytest.approx(THERE)
    assert_within_limits(bench)
    bench.close()


def test_a_way_back_from_a_jog_is_gone_before_any_mark_that_waits_where_the_program_is_held() -> None:
    bench = ready()
    onward, move = straight(HOME, THERE, lambda n: s_curve(n, 170.0, 1900.0, 48000.0))
    bench.ask(Request.SINGLE_BLOCK, 1.0)
    mark = dwell(0.0)._replace(block_end=True)
    bench.send([mark, mark, onward], {0: move})
    bench.tick()
    bench.ask(Request.START)
    bench.until(Mode.HOLD)
    jog(bench, (0.0, 0.0, -1.0, 0.0, 0.0), length=3.0)
    bench.tick()
    settle(bench, Mode.HOLD)
    bench.tick(3)
    back, move = straight(bench.cycle.follow.joints, HOME, lambda n: s_curve(n, 30.0, 1000.0, 40000.0), 1)
    bench.send([back, dwell(0.0, stop=True)], {1: move}, at_s=bench.cycle.follow.tau, alone=True)
    bench.tick()
    assert bench.snapshot.accepted == bench.sequence and not bench.snapshot.away
    bench.ask(Request.RESUME)
    bench.tick(2)
    bench.until(Mode.HOLD)
    assert bench.snapshot.joints == pytest.approx(HOME) and bench.snapshot.fault is Fault.NONE
    assert_within_limits(bench)
    bench.close()


def test_a_stop_off_the_place_of_the_hold_drops_the_program() -> None:
    bench = held()
    jog(bench, length=3.0)
    bench.tick()
    settle(bench, Mode.HOLD)
    bench.ask(Request.STOP)
    settle(bench)
    assert not bench.snapshot.away and not bench.cycle.follow.pending
    bench.close()


def test_a_jog_waits_for_the_standstill_of_a_hold() -> None:
    bench = held()
    bench.ask(Request.RESUME)
    bench.tick(60)
    bench.ask(Request.HOLD)
    bench.tick()
    jog(bench)
    bench.tick()
    assert bench.snapshot.mode is Mode.HOLD and bench.refused
    bench.close()


# -- faults


@pytest.mark.parametrize(
    ("fault", "quick"), [(DriveFault.EMCY, False), (DriveFault.STATE_LOST, False), (DriveFault.BUS_OFF, True)]
)
def test_a_fault_stops_a_jog_on_its_line_or_by_the_drives(fault: DriveFault, quick: bool) -> None:
    bench = ready()
    line: Joints = (0.6, 0.8, 0.0, 0.0, 0.0)
    press(bench, 100, line)
    bench.group.failure = (fault, 3)
    bench.tick()
    assert bench.snapshot.mode is Mode.FAULT
    assert (bench.group.wanted is Wanted.QUICK_STOP) is quick
    for _ in range(300):
        jog(bench, line)  # the key is still down
        bench.tick()
    assert bench.cycle.follow.at_rest and not bench.snapshot.jogging
    if not quick:
        rows = commands(bench.rows())
        assert np.abs(rows[:, 0] * 0.8 - rows[:, 1] * 0.6).max() < 1e-9
        assert max(excess(bench.machine, rows)) <= 1.02
    bench.group.failure = (DriveFault.NONE, -1)
    bench.ask(Request.RESET)
    bench.until(Mode.OFF, 10)
    bench.enable()
    bench.tick(100)
    assert bench.cycle.follow.at_rest and bench.snapshot.mode is Mode.READY  # nothing by itself
    bench.close()


def test_a_door_that_opens_ends_a_jog_and_forbids_the_next() -> None:
    bench = ready()
    press(bench, 60)
    bench.cycle.modes.interlock = Fault.DOOR_OPEN
    bench.cycle.modes.fail(Fault.DOOR_OPEN, -1)
    press(bench, 200)
    assert bench.snapshot.mode is Mode.READY and bench.snapshot.warning is Fault.DOOR_OPEN
    assert bench.refused
    assert_within_limits(bench)
    bench.close()


def test_an_emergency_stop_leaves_nothing_of_a_jog() -> None:
    bench = ready()
    press(bench, 60)
    bench.ask(Request.ESTOP)
    bench.tick()
    assert bench.group.wanted is Wanted.QUICK_STOP and not bench.snapshot.jogging
    bench.close()


def slow(built: Machine) -> Machine:
    """None of its axes may move."""
    axes = [replace(axis, limits=replace(axis.limits, velocity=1e-9)) for axis in built.axes]
    return replace(built, axes=tuple(axes))


def test_a_setpoint_that_fails_its_check_is_not_sent() -> None:
    bench = ready()
    press(bench, 60)
    at = bench.snapshot.joints
    bench.cycle.jogging.check = Check(slow(machine()))
    bench.tick()
    assert (bench.snapshot.fault, bench.snapshot.fault_axis) == (Fault.VELOCITY, 0)
    assert bench.snapshot.joints == at and bench.group.wanted is Wanted.QUICK_STOP
    bench.close()


def test_an_order_that_is_not_asked_for_again_is_over_two_ticks_before_the_dead_man_s_time() -> None:
    """The last tick that waits, and the one in which a drive uses what it was told, are within it, too."""
    bench = ready()
    jog(bench)
    ticks = 0
    while bench.cycle.modes.phase is Phase.STEADY:
        bench.tick()
        ticks += 1
    assert ticks == math.floor(DEAD_MAN_S / bench.machine.period_s) - 1
    bench.close()


@pytest.mark.parametrize("homed", [ALL_AXES, ALL_AXES & ~1])
def test_an_axis_that_is_homed_has_its_travel_in_a_jog_and_one_that_is_not_has_none(homed: int) -> None:
    bench = ready(homed)
    jog(bench)
    bench.tick()
    end = bench.machine.axes[0].travel_max
    at, beyond = ((q, 0.0, 0.0, 0.0, 0.0) for q in (end, end + 1e-4))
    wanted = (Fault.TRAVEL, 0) if homed & 1 else (Fault.NONE, -1)
    assert bench.cycle.jogging.check.judge(beyond, at, at) == wanted
    bench.close()


@pytest.mark.parametrize("axis", range(5))
def test_each_axis_goes_at_its_largest_speed_and_at_a_share_of_it_when_not_homed(axis: int) -> None:
    bench = ready(homed=ALL_AXES)
    jogging = bench.cycle.jogging
    line = tuple(0.5 if i == axis else 0.0 for i in range(5))
    largest = bench.machine.axes[axis].limits.velocity * bench.machine.period_s
    for homed, share in ((ALL_AXES, 1.0), (ALL_AXES & ~(1 << axis), UNHOMED_SHARE)):
        bench.cycle.modes.homed = homed
        assert 0.5 * jogging._speed_of(Jog(line, 1e9, math.inf)) == pytest.approx(share * largest)
    assert jogging._speed_of(Jog(line, 0.01, math.inf)) == pytest.approx(0.01 * bench.machine.period_s)
    bench.close()
