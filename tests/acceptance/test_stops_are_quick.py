"""A hold leaves the plan within two ticks and takes hardly longer than the shortest stop there is.

The undisturbed run tells what the plan would have done; the run with the hold tells
what was done. The shortest stop from the same state comes from linear programs that
know nothing of the controller's stops (independent_stop).
"""

from __future__ import annotations

import random
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, Cut, cut, program, shipped
from support.oracles import jerk_limited_stop
from support.oracles.trace_limits import assert_in_limits
from support.parts.random_surfaces import compound, text

from controller.machine.model import Machine
from controller.plan.rotaries.branch import joints_along
from controller.program.program import ProgramError
from controller.runtime.events import Event
from controller.state.modes import Request

MOST = 1.3  # times the shortest stop
LEAVE = 2  # ticks from the request within which the path speed leaves the plan
LONG = 2000  # ticks within which every stop is over


class Stop(NamedTuple):
    """One hold: the row of its request, of the first deviation from the plan, and of standstill."""

    tick: int
    left: int
    rest: int
    name: str  # of the segment in which it came
    crosses: bool  # it ends in another segment, or the state could not be told
    shortest_s: float | None


def hold_at(source: str, machine: Machine, tick: int, plain: Cut) -> tuple[Cut, Stop]:
    """The run of ``source`` with a hold at ``tick`` and no resume, and what came of it."""
    done = cut(source, machine, events=[Event(tick, Request.HOLD)])
    assert done.run.result == "held", (tick, done.run.fault_text)
    n = min(len(done.joints), len(plain.joints))
    apart = np.flatnonzero((done.joints[:n] != plain.joints[:n]).any(axis=1))
    moving = np.flatnonzero((done.joints != done.joints[-1]).any(axis=1))
    left = int(apart[0]) if len(apart) else n
    rest = int(moving[-1]) + 1 if len(moving) else 0
    first, last = int(plain.column("motion_id")[tick - 1]), int(done.column("motion_id")[-1])
    segment = done.segments.get(first)
    crosses = first != last or segment is None
    best = None if crosses else _shortest(plain, left - 1, machine)
    return done, Stop(tick, left, rest, segment.name if segment else "standstill", crosses, best)


def _shortest(plain: Cut, row: int, machine: Machine) -> float | None:
    """The shortest stop from the state of the undisturbed run at ``row``."""
    s, ids = plain.column("s"), plain.column("motion_id")
    if len(set(ids[row - 1 : row + 2])) != 1:
        return None
    T, segment = machine.period_s, plain.segments[int(ids[row])]
    v, a = (s[row + 1] - s[row - 1]) / (2 * T), (s[row + 1] - 2 * s[row] + s[row - 1]) / T**2
    end = segment.motion.end
    path = jerk_limited_stop.way(
        lambda x: np.asarray(joints_along(segment, np.clip(x, 0.0, end), plain.kinematics)),
        float(s[row]),
        min(end, float(s[row]) + max(0.5, 0.6 * v)),
    )
    return jerk_limited_stop.shortest(path, limits(segment, machine), float(s[row]), float(v), float(a))


def limits(segment: object, machine: Machine) -> jerk_limited_stop.Limits:
    found = jerk_limited_stop.limits_of(machine.axes)
    rapid = segment.feed_mm_s is None  # type: ignore[attr-defined]
    return jerk_limited_stop.Limits(*(x * machine.rapid_share for x in found)) if rapid else found


def judge(source: str, machine: Machine, ticks: list[int], label: object) -> list[float]:
    """Ratios of the stops, from leaving the plan to standstill, to the shortest."""
    plain, ratios, T = cut(source, machine), [], machine.period_s
    for tick in ticks:
        done, stop = hold_at(source, machine, tick, plain)
        assert_in_limits(done, f"{label}, hold at {tick}", [Event(tick, Request.HOLD)])
        if stop.name == "standstill":
            continue
        braking = bool(np.diff(plain.column("feed_mm_s")[tick - 1 : tick + 3]).min() < 0.0)
        assert stop.left <= tick + LEAVE or braking, (label, stop)
        if stop.shortest_s is None or stop.crosses:
            continue
        took = (stop.rest - stop.left + 1) * T
        ratios.append(took / stop.shortest_s)
        whole = (stop.rest - tick + 1) * T / stop.shortest_s
        print(
            f"{label} {stop.name} hold {tick}: left after {stop.left - tick + 1}, took {took * 1e3:.0f} ms, "
            f"shortest {stop.shortest_s * 1e3:.1f} ms, ratio {ratios[-1]:.3f}, from the request {whole:.3f}"
        )
        assert ratios[-1] <= MOST, (label, stop, ratios[-1])
    return ratios


@cache
def paper(name: str, feed: str) -> str:
    return program(name, feed)


def spread(source: str, machine: Machine, count: int, seed: int) -> list[int]:
    last = len(cut(source, machine).rows) - 30
    return sorted(random.Random(seed).sample(range(10, last), count))


def test_the_independent_stop_finds_the_closed_form_on_a_straight_line() -> None:
    limits = jerk_limited_stop.Limits(np.full(5, 200.0), np.full(5, 2000.0), np.full(5, 50_000.0))
    path = jerk_limited_stop.way(lambda x: np.stack([x, 0 * x, 0 * x, 0 * x, 0 * x], axis=1), 0.0, 100.0)
    for v, closed in ((50.0, 2 * (50.0 / 50_000.0) ** 0.5), (150.0, 150.0 / 2000.0 + 2000.0 / 50_000.0)):
        assert jerk_limited_stop.shortest(path, limits, 0.0, v, 0.0) == pytest.approx(closed, rel=3e-3)


def test_a_hold_in_the_cut_of_example_2_stops_nearly_as_fast_as_can_be() -> None:
    assert judge(paper("example2_ready.ngc", "3000."), shipped(), [1300], "Example 2")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["example1_ready.ngc", "example2_ready.ngc"])
@pytest.mark.parametrize("feed", ["1000.", "3000."])
def test_holds_anywhere_in_the_papers_parts_stop_nearly_as_fast_as_can_be(name: str, feed: str) -> None:
    machine, source = shipped(), paper(name, feed)
    ratios = judge(source, machine, spread(source, machine, 4, 7), f"{name} at {feed}")
    print(f"\n{name} {feed}: median {np.median(ratios):.3f}, worst {max(ratios):.3f}, {len(ratios)} stops")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_holds_on_unseen_surfaces_stop_nearly_as_fast_as_can_be(seed: int) -> None:
    rng = random.Random(9000 + seed)
    machine, feed = shipped(rng.choice(SHIPPED)), 10.0 ** rng.uniform(2.0, 3.7)
    source = text(compound(700 + seed, rng.choice((1, 2))), feed)
    try:
        ticks = spread(source, machine, 4, seed)
    except ProgramError:
        pytest.skip("refused")
    judge(source, machine, ticks, f"seed {seed}, {machine.name}, {feed:.0f} mm/min")
