"""The tie of a path to the spindle's angle, tick by tick, against a spindle that turns as a test has it.

That threads come out right is for ``tests/acceptance/test_tapping.py``.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from support.machines.shipped_kinds import machine as plain
from support.machines.tapping import machine

from controller.tick.coupling import (
    BEYOND_TIMEOUT_S,
    CLOSING_REV_S,
    DEAF_SYNCS,
    FASTER,
    LATE_S,
    LEARNS_S,
    MAX_LAG_S,
    MAX_SLIP,
    MIN_REV_S,
    REMEMBERS,
    SETTLED_REV,
    SETTLED_TICKS,
    SURE_ACCELERATION,
    SURE_SPEED,
    Coupling,
    Law,
    Recorded,
    Reply,
)
from controller.tick.law_alone import LawAlone
from drives.pump.lead import Correction
from drives.pump.plan_memory import Stop

T = 0.002
PITCH_MM = 1.25
SPEED = 20.0  # mm/s
LATE = 3  # ticks from a place to its answer


class Spindle:
    def __init__(self) -> None:
        self.turns, self.unheard, self.load, self.led = 100.0, 1, 0.25, math.nan
        self.by_plan, self.even_syncs, self.commanded_rev_s = True, 0, 0.0

    def lead(self, rev_s: float, by_plan: bool, /) -> None:
        self.led, self.by_plan = rev_s, by_plan


def move_of(pitch_mm: float = PITCH_MM, direction: tuple[float, float, float] = (0.0, 0.0, -1.0)) -> Any:
    return SimpleNamespace(
        begin_rev=0.0, rev_per_mm=1.0 / pitch_mm, direction=direction, give_mm_s=50.0, give_mm_s2=2000.0
    )


class Thread:
    """The law runs evenly, and began at rest; the spindle answers ``behind`` revolutions late."""

    def __init__(
        self,
        lags_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
        move: Any = None,
        delay: int = 0,
        periods: int = 0,
    ) -> None:
        drives = [SimpleNamespace(following_error=SimpleNamespace(lag_s=lag_s)) for lag_s in lags_s]
        self.spindle = Spindle()
        self.coupling = Coupling(machine(), self.spindle, drives, delay, periods)
        self.move, self.s, self.behind = move or move_of(), 0.0, 0.0
        self.late = LATE + delay
        self._places = [0.0] * (self.late + 1)
        self.run(1, 0.0)

    def run(self, ticks: int, v: float = SPEED) -> float:
        for _ in range(ticks):
            self.s += v * T
            self._places.append(self.s)
            self.spindle.turns = 100.0 + self._places[-1 - self.late] * self.move.rev_per_mm - self.behind
            self.coupling.look()
            at = self.coupling.follow(self.move, self.s, v, 0.0)
        return at


# ---- what is learnt of the spindle's answer


def test_a_slip_is_the_slope_of_what_is_missing_over_the_speed() -> None:
    for way in (1.0, -1.0):
        reply = Reply()
        reply.learn(way * 10.0, 0.0, way * 0.5)
        assert reply.slip == pytest.approx(5.0 / (REMEMBERS * SURE_SPEED + 100.0))
        for _ in range(3000):
            reply.learn(way * 10.0, 0.0, way * 0.5)
        assert reply.slip == pytest.approx(0.05, rel=1e-3) and reply.lag_s == 0.0


def test_a_lag_is_the_slope_over_the_acceleration_of_what_the_slip_does_not_explain() -> None:
    reply = Reply()
    reply.slip = 0.05
    reply.learn(10.0, 20.0, 0.5 + 0.4)
    assert reply.lag_s == pytest.approx(8.0 / (REMEMBERS * SURE_ACCELERATION + 400.0))
    for _ in range(3000):
        reply.learn(10.0, -20.0, 0.5 - 0.4)
    assert reply.lag_s == pytest.approx(0.02, rel=1e-3) and reply.slip == 0.05


def test_what_is_learnt_has_bounds_and_one_that_is_stuck_teaches_nothing() -> None:
    reply = Reply()
    for _ in range(3000):
        reply.learn(10.0, 0.0, 2.9)
        reply.learn(10.0, 20.0, 10.0 * reply.slip + 2.9)
    assert (reply.slip, reply.lag_s) == (MAX_SLIP, MAX_LAG_S)
    for _ in range(3000):
        reply.learn(10.0, 0.0, -2.9)
        reply.learn(10.0, 20.0, 10.0 * reply.slip - 2.9)
    assert (reply.slip, reply.lag_s) == (-MAX_SLIP, 0.0)
    reply = Reply()
    reply.learn(16.0, 0.0, 1.5 * MAX_SLIP * 16.0)
    reply.learn(0.0, 16.0, 1.5 * MAX_LAG_S * 16.0)
    assert (reply.slip, reply.lag_s) == (0.0, 0.0)


# ---- the tie


def test_a_machine_whose_spindle_tells_no_angle_is_led_by_nothing() -> None:
    coupling = Coupling(plain(), Spindle())
    assert coupling.follow(move_of(), 3.0, SPEED, 0.0) == 3.0
    assert not coupling.active and (coupling.turns, coupling.load) == (0.0, 0.0)
    assert not coupling.lags and not coupling.deaf and not coupling.settled


def test_a_spindle_that_turns_as_told_leaves_the_axes_to_the_law() -> None:
    thread = Thread()
    coupling = thread.coupling
    assert thread.run(100) == pytest.approx(thread.s, abs=1e-9)
    assert coupling.active and coupling.rev_s == pytest.approx(SPEED / PITCH_MM)
    assert coupling.lag_rev == pytest.approx(0.0, abs=1e-9)
    assert coupling.depth_rev == pytest.approx(thread.s / PITCH_MM)
    assert coupling.pitch_mm == pytest.approx(PITCH_MM)
    assert (coupling.turns, coupling.load) == (thread.spindle.turns, 0.25)
    coupling.lead()
    assert thread.spindle.led == coupling.rev_s and not thread.spindle.by_plan


@pytest.mark.parametrize("behind", [-0.1, 0.1])
def test_a_spindle_that_is_behind_is_hurried_and_takes_the_axes_along(behind: float) -> None:
    thread = Thread()
    thread.run(100)
    thread.behind = behind
    at = thread.run(200)
    coupling = thread.coupling
    assert coupling.lag_rev == pytest.approx(behind, rel=1e-6)
    assert coupling.off_mm == pytest.approx(behind * PITCH_MM, rel=1e-6)
    assert at == pytest.approx(thread.s - behind * PITCH_MM)
    assert coupling.place(thread.move, thread.s) == at
    assert (coupling.rev_s - SPEED / PITCH_MM) * behind > 0.0
    assert coupling.depth_rev == pytest.approx(thread.s / PITCH_MM - behind)
    assert coupling.reply.slip * behind > 0.0  # it turns slower, or faster, than it is told


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_it_is_hurried_by_a_share_of_its_speed_at_most(side: float) -> None:
    thread = Thread()
    thread.run(100)
    thread.behind = side * 0.45  # further off than what teaches
    thread.run(200)
    asked = SPEED / PITCH_MM
    most = (FASTER - 1.0) * asked + MIN_REV_S
    slip = thread.coupling.reply.slip
    assert thread.coupling.rev_s == pytest.approx(asked * (1.0 + slip) + side * min(most, 4.5))


def test_the_axes_are_led_by_as_much_as_their_drives_lag_along_the_thread() -> None:
    thread = Thread((0.010, 0.020, 0.030), move_of(direction=(0.6, 0.0, 0.8)))
    lag_s = 0.36 * 0.010 + 0.64 * 0.030
    assert thread.run(1) == pytest.approx(thread.s + lag_s * SPEED)
    at = thread.coupling.follow(thread.move, thread.s, SPEED, 100.0)
    assert at == pytest.approx(thread.s + lag_s * (SPEED + 0.5 * lag_s * 100.0), abs=1e-6)
    for drive in thread.coupling._drives:
        drive.following_error.lag_s += 1.0
    led = thread.coupling.foreseen[0].axis_s
    thread.run(2)
    assert thread.coupling.foreseen[0].axis_s == pytest.approx(led + 2 * LEARNS_S)
    for drive in thread.coupling._drives:
        drive.following_error.lag_s = 0.0
    thread.run(1)
    assert thread.coupling.foreseen[0].axis_s == pytest.approx(led + LEARNS_S)


def test_what_is_off_is_the_same_angle_on_a_way_of_another_pitch() -> None:
    thread = Thread()
    thread.behind = 0.1
    thread.run(200)
    coupling, off, wanted = thread.coupling, thread.coupling.off_mm, thread.s / PITCH_MM
    back = move_of(-2.0 * PITCH_MM)
    back.begin_rev = wanted - thread.s * back.rev_per_mm
    coupling.stood()
    coupling.follow(back, thread.s, 0.0, 0.0)
    assert coupling.off_mm == pytest.approx(-2.0 * off, abs=0.01)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_axes_follow_within_what_their_limits_leave_and_stop_where_they_are_to(side: float) -> None:
    bend, most, off = 0.001, 0.02, side * 1.0
    now, steps = Correction(), [0.0]
    while now.off_rev != off or now.step_rev != 0.0:
        before, (off_rev, step_rev) = now, now.approach(off, bend, most)
        now = now._replace(off_rev=off_rev, step_rev=step_rev)
        steps.append(now.off_rev - before.off_rev)
        assert abs(steps[-1]) <= most * (1 + 1e-9)
        assert abs(steps[-1] - steps[-2]) <= bend * (1 + 1e-9)
        assert now.off_rev * side <= 1.0 + 3.0 * bend
        assert len(steps) < 80
    assert len(steps) >= 1.0 / most + most / bend  # 70, the fastest that the limits let it


# ---- a spindle that does not come


def tied(lag_rev: float, rate_rev_s: float) -> Coupling:
    coupling = Coupling(machine(), Spindle())
    coupling.active, coupling.lag_rev, coupling._rate = True, lag_rev, rate_rev_s
    return coupling


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_beyond_its_window_it_lags_at_once_if_it_falls_back_further_and_after_a_while_if_it_stays(
    side: float,
) -> None:
    patience = round(BEYOND_TIMEOUT_S / T)
    away, even, nearer = 1.1 * CLOSING_REV_S, 0.0, -1.1 * CLOSING_REV_S
    for lag, rate, ticks in ((0.51, away, 1), (0.51, even, patience + 1), (0.51, nearer, 0), (0.5, away, 0)):
        coupling = tied(side * lag, side * rate)
        seen = 0
        while not coupling.lags and seen < 2 * patience:
            coupling._watch()
            seen += 1
        assert seen == (ticks or 2 * patience), (lag, rate)
        coupling.lag_rev = 0.0
        coupling._watch()
        assert not coupling.lags


def test_one_that_has_come_has_stood_there_for_some_ticks() -> None:
    thread = Thread()
    thread.run(100)
    settled = []
    for _ in range(2 * SETTLED_TICKS + LATE):
        thread.run(1, 0.0)
        thread.coupling.look()
        settled.append(thread.coupling.settled)
    assert settled.index(True) == SETTLED_TICKS - 1 and all(settled[SETTLED_TICKS:])
    thread.run(1)
    thread.coupling.look()
    assert not thread.coupling.settled


def test_one_that_does_not_come_within_its_time_lags() -> None:
    coupling = tied(2.0 * SETTLED_REV, 0.0)
    for _ in range(round(LATE_S / T)):
        coupling._settle(True)
        assert not coupling.lags
    coupling._settle(True)
    assert coupling.lags and coupling._settled == 0
    coupling.lag_rev = SETTLED_REV
    coupling._settle(True)
    assert not coupling.lags and coupling._settled == 1


def test_one_whose_angle_is_not_heard_is_deaf_and_goes_on_as_it_did() -> None:
    thread = Thread()
    thread.behind = 0.1
    thread.run(200)
    coupling = thread.coupling
    coupling._rate = 0.5
    lag, thread.spindle.unheard = coupling.lag_rev, DEAF_SYNCS
    slip = coupling.reply.slip
    thread.run(2)
    assert coupling.lag_rev == pytest.approx(lag + 2 * (0.5 * T - coupling._added_rev)) and not coupling.deaf
    thread.spindle.unheard = 2  # late by one SYNC teaches nothing either
    thread.run(1)
    assert coupling.reply.slip == slip
    thread.spindle.unheard = DEAF_SYNCS
    thread.spindle.unheard += 1
    assert coupling.deaf
    coupling.end()
    assert not coupling.deaf


def test_the_slip_is_learnt_beside_a_thread_where_the_spindle_has_long_been_told_one_speed() -> None:
    spindle = Spindle()
    coupling = Coupling(machine(), spindle)

    def ticks(many: int, even: bool, speed: float, slip: float) -> float:
        for n in range(many):
            spindle.even_syncs = 1000 + n if even else 100
            spindle.commanded_rev_s = speed
            spindle.turns += speed * (1.0 - slip) * T
            coupling.look()
        return coupling.reply.slip

    assert ticks(200, False, 25.0, 0.02) == 0.0  # on its ramp, or hardly off it
    assert ticks(200, True, 25.0, 0.02) == pytest.approx(0.02, rel=1e-2)
    assert ticks(200, True, 25.0, 0.9) == pytest.approx(0.02, rel=1e-2)  # jammed: that is no slip
    assert ticks(200, True, 0.0, 0.0) == pytest.approx(0.02, rel=1e-2)
    assert ticks(3000, True, -25.0, 0.01) == pytest.approx(0.01, rel=1e-2)
    spindle.unheard = 0  # two answers at once
    assert ticks(3, True, -25.0, 0.25) == pytest.approx(0.01, rel=1e-2)


def test_the_axes_go_where_the_spindle_will_be_when_they_are_there() -> None:
    thread = Thread((0.0, 0.0, 0.01))
    move = move_of()
    move.give_mm_s = move.give_mm_s2 = 1e9
    coupling = thread.coupling
    coupling.lag_rev, coupling._rate, coupling.unseen = 0.1 - 0.5 * T, 0.5, False
    coupling._measure = lambda _: None  # type: ignore[method-assign]
    coupling._gain = 0.0
    coupling.follow(move, thread.s, 0.0, 0.0)
    assert coupling.off_mm == pytest.approx((0.1 + 0.5 * (LATE * T + 0.01)) * PITCH_MM)


def test_axes_that_have_stood_meanwhile_begin_from_rest_and_leave_a_thread_with_nothing_off() -> None:
    thread = Thread(periods=4)
    thread.behind = 0.0
    thread.run(5, 0.0)
    coupling = thread.coupling
    coupling.now = coupling.now._replace(off_rev=0.0005, step_rev=0.01)
    coupling.stood()
    assert {(one.off_rev, one.step_rev) for one in coupling.foreseen} == {(0.0005, 0.0)}
    coupling._settled = SETTLED_TICKS
    thread.run(1, 0.0)
    assert coupling.foreseen[0].off_rev == 0.0005  # so little moves no axis
    coupling.releasing = True
    coupling.look()
    assert not coupling.settled
    thread.run(8, 0.0)
    coupling.look()
    assert coupling.off_mm == 0.0 and coupling.settled


# ---- a stock of periods


DELAY, PERIODS = 2, 8


def stocked() -> Thread:
    thread = Thread((0.0, 0.0, 0.01), delay=DELAY, periods=PERIODS)
    thread.run(200)
    return thread


def test_what_was_foreseen_stays_as_it_is_while_the_spindle_is_where_it_was_foreseen_to_be() -> None:
    thread = stocked()
    for turned in (0.0003, -0.0003, 0.0001):  # of FORESEEN_MM / PITCH_MM = 0.0016
        thread.behind = turned
        before = thread.coupling.foreseen
        thread.run(1)
        assert thread.coupling.foreseen[:-1] == before[1:]


def test_a_spindle_that_is_elsewhere_is_followed_from_the_next_tick_on_that_is_not_committed() -> None:
    for committed in (0, 3, PERIODS):
        thread = stocked()
        thread.behind, before = 0.1, thread.coupling.foreseen
        thread.coupling.committed = committed
        thread.run(1)
        now = thread.coupling.foreseen
        assert now[:committed] == before[1 : 1 + committed]
        assert now[committed].off_rev > 0.0 and now[-1].off_rev > 0.0
    thread = stocked()
    thread.behind, before = 0.1, thread.coupling.foreseen
    thread.coupling.committed = PERIODS + 1
    thread.run(1)
    assert thread.coupling.foreseen[:-1] == before[1:]
    assert thread.coupling.foreseen[-1].off_rev == before[-1].off_rev


def test_the_ticks_to_come_can_be_those_of_an_older_plan() -> None:
    thread = stocked()
    plan = thread.coupling.foreseen
    thread.behind = 0.1
    thread.run(2)
    thread.coupling.go_by(plan, 2)
    assert thread.coupling.foreseen[1 : PERIODS - 1] == plan[3:]
    assert len(thread.coupling.foreseen) == PERIODS + 1


def test_a_look_ahead_by_the_law_with_the_corrections_laid_over_it_comes_to_what_the_tick_does() -> None:
    thread = stocked()
    alone = LawAlone(machine(), thread.coupling)
    alone.restore(thread.coupling.save())
    s, places = thread.s, []
    for by in thread.coupling.foreseen[1:]:
        s += SPEED * T
        assert alone.follow(thread.move, s, SPEED, 0.0) == s
        law = alone.law
        assert law is not None and not alone.settled
        led_mm = by.ahead_mm(law.v, law.a) - by.off_rev / law.move.rev_per_mm
        places.append((s + led_mm, by.rev_s(law.rev_s, law.rev_s2)))
    thread.behind = 0.0005
    assert places == [(thread.run(1), thread.coupling.rev_s) for _ in range(PERIODS)]


def test_a_stop_has_the_answer_of_spindle_and_axes_and_what_drifts_by_the_speed() -> None:
    speed = SPEED / PITCH_MM
    law = Law(move_of(), 1.0, SPEED, 0.0, 1.0, speed, 0.0)
    by = Correction(slip=0.02, lag_s=0.03, drift_rev_s=0.01 * speed, axis_s=0.01)
    stop = Stop((1.0,), 1, 0, SPEED, 0.0)
    assert law.stop(stop, by)[5:] == pytest.approx((0.01, 0.03, 0.03))
    assert law._replace(rev_s=0.1).stop(stop, by)[5:] == pytest.approx((0.01, 0.02, 0.03))


# ---- a step that is taken back, and a run that is made again


def test_a_tick_that_is_taken_back_and_done_again_is_the_same() -> None:
    thread = Thread((0.0, 0.0, 0.01))
    thread.run(50)
    thread.behind = 0.1
    thread.run(20)
    coupling, move, s = thread.coupling, thread.move, thread.s
    coupling.reply.slip = coupling.reply.lag_s = 0.0
    coupling.reply.learn = lambda *_: None  # type: ignore[method-assign]
    saved, found = coupling.save(), []
    for _ in range(2):
        at = [coupling.follow(move, s + i * SPEED * T, SPEED, 0.0) for i in (1, 2, 3)]
        found.append((at, coupling.save()))
        coupling.restore(saved)
    assert found[0][0] == found[1][0] and found[0][1] == found[1][1]
    coupling.restore(None)
    assert not coupling.active and coupling.move is None and coupling.save() is None
    assert (coupling.rev_s, coupling.lag_rev, coupling.off_mm, coupling.led_mm) == (0.0,) * 4
    assert coupling.place(move, 3.0) == 3.0


def test_a_run_that_is_made_again_goes_where_it_went_whatever_the_spindle_does() -> None:
    thread = Thread()
    for led_mm, settled in ((0.25, True), (-0.5, False)):
        thread.coupling.again = Recorded(led_mm, settled)
        assert thread.run(1) == pytest.approx(thread.s + led_mm)
        assert thread.coupling.settled is settled
