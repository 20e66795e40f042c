"""Cuts with a better placement keep every promise of the paper's: limits, path, hold, restart."""

from __future__ import annotations

import random
from functools import cache

import numpy as np
import pytest
from support.machines import random_operators
from support.machines.interrupted_runs import (
    assert_rest_is_cut,
    assert_sound,
    distance,
    fresh,
    rest_of,
    resumed,
    segments,
)
from support.machines.stepped_runs import Cut, cut, off_the_plan, program, shipped
from support.oracles import time_bound
from support.oracles.placed_cuts import LINE, TIP_MM, assert_on_placed_surfaces, small
from support.oracles.trace_limits import assert_in_limits

from controller.geometry.placement import Placed
from controller.machine.model import Machine
from controller.plan.restart.program_position import Spot
from controller.runtime.events import Event
from controller.state.modes import Request

PERIOD_S = 0.008


def example_2(placement: int, feed: str) -> str:
    return program("example2_ready.ngc", feed).replace("G41", f"G41 P{placement}", 2)


def judged(source: str, machine: Machine, seed: int, count: int) -> Cut:
    """Cut alone, then with an operator of ``count`` doings; every promise held both times."""
    done = cut(source, machine)
    events: list[Event] = []
    for _ in range(2):
        assert done.run.result == "completed", (seed, done.run.fault_text)
        assert_in_limits(done, f"seed {seed} on {machine.name}", events)
        assert assert_on_placed_surfaces(done) >= 1
        assert off_the_plan(done, np.flatnonzero(done.column("mode") != 1.0)) < TIP_MM
        if events or not count:
            break
        events = random_operators.events(random.Random(seed), len(done.rows), count)
        done = cut(source, machine, events)
    return done


@cache
def small_cut(placement: int) -> Cut:
    return cut(small(placement), shipped(period_s=PERIOD_S))


def test_a_placed_cut_with_an_operator_keeps_the_limits_and_its_place() -> None:
    judged(small(2), shipped(period_s=PERIOD_S), 3, 4)


@pytest.mark.slow
def test_a_free_axis_is_followed_as_exactly() -> None:
    assert_in_limits(small_cut(3), "optimal")
    assert assert_on_placed_surfaces(small_cut(3)) == 1


@pytest.mark.slow
def test_the_tick_knows_nothing_of_points_between() -> None:
    """What it is sent is the placed surface itself: a row of numbers that do not grow with the length."""
    (one,) = [s for s in small_cut(3).segments.values() if s.cutting]
    assert isinstance(one.motion.surface, Placed)
    assert all(len(curve.spans) <= 64 for curve in one.motion.surface.through)


@pytest.mark.parametrize(
    "fraction", [pytest.param(0.37, marks=pytest.mark.slow), pytest.param(1.0, marks=pytest.mark.soak)]
)
def test_a_restart_inside_a_placed_cut_goes_on_where_the_whole_would_have(fraction: float) -> None:
    source, stepped = small(2), fresh()
    rest = rest_of(source, Spot(LINE, fraction), stepped.machine)
    done = resumed(stepped, rest)
    assert_sound(done, fraction)
    wanted = segments(source, stepped.machine)
    assert distance(done.rows, wanted, stepped.kinematics) < TIP_MM
    assert_rest_is_cut(done.rows, wanted, rest.spot)
    assert np.abs(done.joints[-1] - small_cut(2).joints[-1]).max() < 1e-9


@pytest.mark.slow
def test_after_a_hold_the_path_is_the_same() -> None:
    first = int(np.flatnonzero(small_cut(2).trace.cutting)[0])
    events = [Event(first + 60, Request.HOLD), Event(first + 400, Request.RESUME)]
    done = cut(small(2), shipped(period_s=PERIOD_S), events)
    assert done.run.result == "completed"
    wanted = segments(small(2), done.machine)
    assert distance(done.rows, wanted, done.kinematics) < TIP_MM
    ids = done.column("motion_id")
    assert (np.diff(ids[ids >= 0.0]) >= 0.0).all()
    s = done.column("s")[done.trace.cutting]
    assert (np.diff(s) >= -1e-9).all()
    assert np.abs(done.joints[-1] - small_cut(2).joints[-1]).max() < 1e-9


@pytest.mark.parametrize(
    ("placement", "machine", "slower"),
    [
        pytest.param(2, "head_head", False, marks=pytest.mark.slow),
        pytest.param(3, "trunnion", True, marks=pytest.mark.soak),
    ],
)
def test_example_2_placed_with_an_operator(placement: int, machine: str, slower: bool) -> None:
    built = time_bound.linuxcnc(shipped(machine)) if slower else shipped(machine)
    done = judged(example_2(placement, "3000."), built, placement, 8)
    # Both surfaces, and between them the turn from one placement to the other.
    names = [segment.name for segment in done.segments.values()]
    assert names.count("cut") == 2 and "pivot" in names
