"""Motion laws: limits kept at every sample, the feed met exactly, and no time given away."""

from __future__ import annotations

import math
import random
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.machines.planned_laws import chains, laws_of, sampled
from support.machines.slow_machines import drawn
from support.machines.stepped_runs import T2, largest, program, shipped
from support.oracles.laws import at_share
from support.parts.nurbs_text import Written, nurbs
from support.parts.random_surfaces import compound, text
from support.parts.surface_trains import program as train

from controller.ipc.handoff import Law
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine, Tool
from controller.plan.feed import cruise, profile
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import straight, through
from controller.plan.feed.limits import JointLimits
from controller.plan.feed.profile import Profile, State
from controller.plan.segment import ContinuousPath
from controller.program.program import ProgramError

OVERSHOOT = 1e-9  # of the feed: rounding

# --- straight moves


def at_many(law: Law, n: int = 2001) -> tuple[np.ndarray, ...]:
    t = np.linspace(0.0, law.duration_s, n)
    s, v, a = (np.array(x) for x in zip(*(law.at(float(x)) for x in t), strict=True))
    return t, s, v, a


def jerks(law: Law) -> list[float]:
    return [6.0 * row[3] for row in law.coefficients]


@pytest.mark.parametrize("seed", range(20))
def test_a_straight_law_keeps_random_limits_and_ends_exactly_at_rest(seed: int) -> None:
    rng = random.Random(seed)
    length, v_max, a_max, j_max = (10.0 ** rng.uniform(*r) for r in ((-3, 3), (-1, 3), (1, 5), (2, 7)))
    law = straight(length, v_max, a_max, j_max)
    _, s, v, a = at_many(law)
    assert v.max() <= v_max * (1 + 1e-9) and v.min() >= -1e-9 * v_max, seed
    assert np.abs(a).max() <= a_max * (1 + 1e-9), seed
    assert max(map(abs, jerks(law))) <= j_max * (1 + 1e-9), seed
    assert s[0] == 0.0 and s[-1] == pytest.approx(length, rel=1e-14), seed
    assert abs(v[-1]) <= 1e-7 * v.max() and abs(a[-1]) <= 1e-7 * a_max, seed
    assert (np.diff(s) >= 0.0).all(), seed


CLOSED = [
    # length, v, a, j, duration: v/a + a/j more than length/v; the peaks by hand
    (100.0, 10.0, 100.0, 1000.0, 100.0 / 10.0 + 10.0 / 100.0 + 100.0 / 1000.0),
    (100.0, 10.0, 1e9, 1000.0, 100.0 / 10.0 + 2.0 * math.sqrt(10.0 / 1000.0)),  # a is never reached
    (1.0, 1e9, 1e9, 32.0, 4.0 * (1.0 / (2.0 * 32.0)) ** (1 / 3)),  # only jerk counts: four equal phases
]


@pytest.mark.parametrize(("length", "v", "a", "j", "duration"), CLOSED)
def test_a_straight_law_takes_the_time_of_the_closed_form(
    length: float, v: float, a: float, j: float, duration: float
) -> None:
    assert straight(length, v, a, j).duration_s == pytest.approx(duration, rel=1e-12)


def shortest(length: float, v: float, a: float, j: float) -> float:
    """Brute force: of all peak speeds, the fastest rest-to-rest time; ramps as short as they can be."""
    peak = np.linspace(v / 20000, v, 20000)
    ramp = np.where(peak * j < a * a, 2.0 * np.sqrt(peak / j), peak / a + a / j)
    even = length - peak * ramp
    return float((2.0 * ramp + even / peak)[even >= 0.0].min())


@pytest.mark.parametrize("seed", range(20))
def test_a_straight_law_is_no_slower_than_the_best_of_all_peak_speeds(seed: int) -> None:
    rng = random.Random(seed)
    length, v, a, j = (10.0 ** rng.uniform(*r) for r in ((-1, 2), (1, 2.5), (2, 4), (3, 6)))
    found, best = straight(length, v, a, j).duration_s, shortest(length, v, a, j)
    assert found <= best * (1 + 1e-9), seed
    assert found >= best * (1 - 2e-3), seed  # the grid of peaks is coarse


# --- the law through nodes


@pytest.mark.parametrize("seed", range(10))
def test_the_law_through_nodes_meets_them_and_has_continuous_speed_and_acceleration(seed: int) -> None:
    t = np.linspace(0.0, 1.0, 30)
    rng = np.random.default_rng(seed)
    k = rng.uniform(1.0, 5.0)
    s, v, a = t + 0.1 * np.sin(k * t), 1.0 + 0.1 * k * np.cos(k * t), -0.1 * k * k * np.sin(k * t)
    s = s - s[0]
    times, pieces = through(s, v, a)
    ends = at_share(times, pieces, 1.0)
    starts = at_share(times, pieces, 0.0)
    for end, start, nodes in zip(ends[:3], starts[:3], (s, v, a), strict=True):
        np.testing.assert_allclose(end[:-1], start[1:], atol=1e-9, err_msg=str(seed))
        np.testing.assert_allclose(start[0::2], nodes[:-1], atol=1e-12)
        np.testing.assert_allclose(end[1::2], nodes[1:], atol=1e-8)
    np.testing.assert_allclose(times[::2], t, atol=1e-5)


def test_an_even_piece_has_no_jerk_at_all() -> None:
    _, pieces = through(np.array([0.0, 0.1, 0.3]), np.full(3, 1.0 / 60.0), np.zeros(3))
    assert not pieces[:, 2:].any()
    assert (pieces[:, 1] == 1.0 / 60.0).all()


# --- whole programs, sampled as the tick samples them


def assert_exact_feed(
    chain: ContinuousPath, laws: list[Law], places: list[np.ndarray], machine: Machine
) -> float:
    """Where the feed is reached every tick covers feed x period; the share of ticks that do."""
    even, all_of = 0, 0
    for segment, law, s in zip(chain.segments, laws, places, strict=True):
        if segment.cutting:
            assert segment.feed_mm_s is not None
            step, speed = np.diff(s), np.array([law.at(t)[1] for t in np.linspace(0, law.duration_s, 400)])
            wanted = segment.feed_mm_s * machine.period_s
            assert step.max() <= wanted * (1 + OVERSHOOT)
            assert speed.max() <= segment.feed_mm_s * (1 + OVERSHOOT)
            even += int(np.count_nonzero(np.abs(step - wanted) <= 1e-5 * wanted))
            all_of += len(step)
    return even / max(all_of, 1)


def assert_limits(chain: ContinuousPath, machine: Machine, label: object) -> tuple[float, float]:
    """(duration, share of ticks at exactly the feed)."""
    laws = laws_of(chain.segments, machine)
    joints, places = sampled(chain.segments, laws, machine)
    first, second, third = largest(joints, machine)
    assert first <= 1.0005 and second <= 1.002 and third <= 1.02, (label, first, second, third)
    for segment, law in zip(chain.segments, laws, strict=True):
        assert law.at(law.duration_s)[0] == pytest.approx(segment.motion.end, rel=1e-12), label
    share = assert_exact_feed(chain, laws, places, machine)
    return sum(law.duration_s for law in laws), share


@pytest.mark.parametrize(("feed", "least"), [("1000.", 0.9), ("3000.", 0.4)])
def test_example_2_keeps_all_limits_at_any_feed_and_its_feed_wherever_they_allow(
    feed: str, least: float
) -> None:
    machine = shipped()
    for chain in chains(program("example2.ngc", feed), machine):
        _, share = assert_limits(chain, machine, feed)
        if any(segment.cutting for segment in chain.segments):
            assert share >= least


@pytest.mark.slow
def test_example_2_at_its_own_feed_keeps_it_nearly_everywhere() -> None:
    machine = shipped()
    shares = [assert_limits(chain, machine, 100)[1] for chain in chains(program("example2.ngc"), machine)]
    assert max(shares) > 0.99


def unseen(seed: int) -> tuple[list[ContinuousPath], Machine, float] | None:
    rng = random.Random(seed)
    machine = shipped(
        rng.choice(("trunnion", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique45"))
    )
    feed = rng.choice((100.0, 1000.0, 3000.0, 10000.0))
    try:
        return chains(text(compound(seed, rng.choice((1, 2, 3))), feed), machine), machine, feed
    except ProgramError:
        return None  # a surface that is refused; others will do


def assert_unseen(seeds: range) -> None:
    done = 0
    for seed in seeds:
        if found := unseen(seed):
            for chain in found[0]:
                assert_limits(chain, found[1], (seed, found[2]))
            done += 1
    assert done >= len(seeds) // 2


def test_random_compound_surfaces_keep_all_limits() -> None:
    assert_unseen(range(300, 301))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(310, 350, 10))
def test_many_random_compound_surfaces_keep_all_limits(first: int) -> None:
    assert_unseen(range(first, first + 10))


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.0005, 0.001, 0.005])
def test_the_limits_hold_at_other_periods(period_s: float) -> None:
    machine = shipped(period_s=period_s)
    for chain in chains(program("example2_ready.ngc", "3000."), machine):
        assert_limits(chain, machine, period_s)


def test_an_override_scales_the_feed_and_not_the_limits() -> None:
    machine = shipped()
    chain = max(chains(program("example1_ready.ngc", "500."), machine), key=lambda c: len(c.segments))
    one, two = (laws_of(chain.segments, machine, share) for share in (1.0, 2.0))
    k = next(i for i, segment in enumerate(chain.segments) if segment.cutting)
    middle = [law.at(law.duration_s / 2)[1] for law in (one[k], two[k])]
    assert middle[1] == pytest.approx(2.0 * middle[0], rel=1e-9)
    assert largest(sampled(chain.segments, two, machine)[0], machine)[1] <= 1.002


def test_a_straight_chain_of_one_move_takes_the_closed_form() -> None:
    machine = shipped()
    chain = chains("G0 X100. Y50.\nM30\n", machine)[0]
    assert len(laws_of(chain.segments, machine)[0].coefficients) <= 7


def test_what_bends_by_next_to_nothing_takes_a_closed_form_that_is_as_fast_as_the_search() -> None:
    """Pivots of some hundredths of a degree, and the cuts of 4 mm between them, each from rest to rest."""
    machine = shipped()
    kinematics = kinematics_of(machine)
    (chain,) = (c for c in chains(train(4, 0.2, decimals=3), machine) if any(s.cutting for s in c.segments))
    looked = {"pivot": 0, "cut": 0}
    for run in profile.split_at_stops(chain.segments, machine, kinematics):
        if len(run) > 1 or run[0].name not in looked:
            continue
        course = FeedCourse(run, machine, kinematics)
        planned = profile.plan(course)
        assert planned is not None and len(planned.pieces) <= 7, run[0].name
        assert max(used(course, planned)) <= 1.0, run[0].name
        assert_goes_on(planned, run[0].name)
        searched = profile._searched(course, profile.REST, course.length)
        assert searched is not None and planned.duration_s <= 1.01 * searched.duration_s, run[0].name
        looked[run[0].name] += 1
    assert looked == {"pivot": 3, "cut": 2}


def test_a_feed_beyond_what_jerk_alone_reaches_has_a_ramp_of_three_phases() -> None:
    machine = shipped()
    limits = machine.axes[0].limits
    feed = 1.2 * limits.acceleration**2 / limits.jerk
    assert feed < 0.6 * limits.velocity
    (chain,) = chains(f"G21 G90 G1 X200. F{60.0 * feed:.3f}\nM30\n", machine)
    course = FeedCourse(chain.segments, machine, kinematics_of(machine))
    planned, law = profile.plan(course), cruise.law(course, *profile.REST, course.length)
    assert planned is not None and law is not None and len(planned.pieces) == 7
    assert_fine(course, Profile(*law), profile.REST, feed)
    assert law[0] == pytest.approx(planned.times) and law[1] == pytest.approx(planned.pieces, abs=1e-9), (
        "on a line, which has a closed form of its own"
    )


# --- from states of motion


def courses(feed: str, machine: Machine, override: float = 1.0) -> list[FeedCourse]:
    """The runs of Example 2 with its leads."""
    kinematics = kinematics_of(machine)
    return [
        FeedCourse(run, machine, kinematics, override)
        for chain in chains(program("example2.ngc", feed), machine)
        for run in profile.split_at_stops(chain.segments, machine, kinematics)
    ]


def at(course: FeedCourse, override: float, rapid_override: float = 1.0) -> FeedCourse:
    return FeedCourse(course.segments, course.machine, course.kinematics, override, rapid_override)


def used(course: FeedCourse, planned: Profile, n: int = 3000) -> list[float]:
    """Largest shares of velocity, acceleration and jerk limits along a profile, by exact derivatives."""
    s, v, a, j = planned.along(np.linspace(0.0, planned.duration_s, n))
    d, limits = course.derivatives(s), JointLimits.of(course.machine)
    pairs = zip(
        (d.velocity(v), d.acceleration(v, a), d.jerk(v, a, j)),
        (limits.velocity, limits.acceleration, limits.jerk),
        strict=True,
    )
    return [float((np.abs(value) / limit).max()) for value, limit in pairs]


def assert_goes_on(planned: Profile, label: object) -> None:
    """Place, speed and acceleration at the end of each piece are those at the begin of the next one."""
    t, rows = np.diff(planned.times)[:, None], planned.pieces
    scale = 1.0 + np.abs(rows[:, :3]).max(axis=0)
    ends = [sum(math.perm(n, d) * rows[:, n] * t[:, 0] ** (n - d) for n in range(d, 6)) for d in range(3)]
    begins = rows[:, :3] * (1.0, 1.0, 2.0)
    jumps = np.abs(np.transpose(ends)[:-1] - begins[1:]) / scale
    assert jumps.max(initial=0.0) <= 1e-6, (label, jumps.max(axis=0))


def assert_fine(course: FeedCourse, planned: Profile | None, begin: State, label: object) -> None:
    assert planned is not None, label
    assert planned.at(0.0) == pytest.approx(begin, rel=1e-9, abs=1e-9), label
    assert_goes_on(planned, label)
    end = planned.at(planned.duration_s)
    assert abs(end.v) <= 1e-6 * (1.0 + begin.v) and end.s == pytest.approx(planned.end_s), label
    velocity, acceleration, jerk = used(course, planned)
    assert velocity <= 1.0003 and acceleration <= 1.001 and jerk <= 1.015, (
        label,
        velocity,
        acceleration,
        jerk,
    )


@pytest.mark.parametrize("override", [0.1, 1.0, 2.0])
def test_from_any_state_of_a_law_the_course_goes_on_at_another_override(override: float) -> None:
    machine, rng = shipped(), random.Random(int(100 * override))
    for course in courses("2000.", machine)[3:7]:
        first = profile.plan(course)
        assert first is not None
        t = rng.uniform(0.0, 0.97) * first.duration_s
        begin, other = first.at(t), at(course, override)
        rest = tail(first, t)
        assert_fine(other, profile.plan(other, begin, None, rest), begin, (override, begin))


@pytest.mark.parametrize("off", [0.0, 5e-15])
def test_a_way_may_end_where_the_motion_so_far_is_first_left(off: float) -> None:
    """A window was cut just there, at a feed that was lowered much: its rest was no interval at all."""
    course = courses("1000.", shipped())[4]
    planned = profile.plan(course)
    assert planned is not None
    t = planned.time_of(0.5 * course.length)
    for wait_s in profile.WAITS_S:
        until = planned.at(t + wait_s).s + off
        found = profile.plan(at(course, 0.04), planned.at(t), until, tail(planned, t))
        assert found is None or found.end_s == pytest.approx(until, abs=1e-9)


def tail(planned: Profile, t: float) -> Profile:
    """A profile from its time ``t`` on."""
    i = int(np.searchsorted(planned.times, t, side="right")) - 1
    x = t - planned.times[i]
    c0, c1, c2, c3 = planned.pieces[i, :4]
    pieces = planned.pieces[i:].copy()
    pieces[0, :4] = (
        c0 + x * (c1 + x * (c2 + x * c3)),
        c1 + x * (2 * c2 + x * 3 * c3),
        c2 + 3 * x * c3,
        c3,
    )
    return Profile(np.append(0.0, planned.times[i + 1 :] - t), pieces)


@pytest.mark.slow
@pytest.mark.parametrize("feed", ["100.", "1000.", "3000."])
def test_from_many_states_every_override_goes_on(feed: str) -> None:
    machine, rng = shipped(), random.Random(5)
    for course in courses(feed, machine):
        first = profile.plan(course)
        assert first is not None
        for override in (0.05, 0.3, 0.9, 1.1, 2.0):
            t = rng.uniform(0.0, 0.98) * first.duration_s
            begin, other = first.at(t), at(course, override)
            assert_fine(other, profile.plan(other, begin, None, tail(first, t)), begin, (override, begin))


def test_a_lowered_override_brakes_to_the_lower_feed_at_once_and_stays_below_it() -> None:
    machine = shipped()
    course = courses("1000.", machine)[4]
    begin = State(20.0, 1000.0 / 60.0, 0.0)
    slow = profile.plan(at(course, 0.2), begin)
    assert slow is not None
    t = np.linspace(0.0, slow.duration_s, 5000)
    v, lower = slow.along(t)[1], 0.2 * 1000.0 / 60.0
    assert (v[t > 0.15] <= lower * (1.0 + 1e-6)).all() and v.max() <= begin.v * (1.0 + 1e-9)
    assert (v[t > 0.15] >= 0.999 * lower).mean() > 0.9


def test_a_course_goes_on_from_rest_anywhere_and_rests_where_it_is_told_to() -> None:
    machine = shipped()
    course = courses("1000.", machine)[4]
    planned = profile.plan(course, State(12.5, 0.0, 0.0), 30.0)
    assert_fine(course, planned, State(12.5, 0.0, 0.0), "part")
    assert planned is not None and planned.end_s == pytest.approx(30.0, rel=1e-12)
    assert planned.duration_s == pytest.approx(17.5 * 60.0 / 1000.0, abs=0.1)


def test_windows_put_together_are_as_fast_as_the_whole() -> None:
    machine = shipped()
    course = courses("1000.", machine)[4]
    whole = profile.plan(course)
    assert whole is not None
    begin, seconds = State(0.0, 0.0, 0.0), 0.0
    for until in (20.0, 40.0, None):
        window = profile.plan(course, begin, until)
        assert_fine(course, window, begin, until)
        assert window is not None
        keep = window.duration_s if until is None else window.duration_s - 0.6
        begin, seconds = window.at(keep), seconds + keep
    assert seconds == pytest.approx(whole.duration_s, rel=1e-3)


def test_a_rapid_override_scales_the_speed_of_rapids_and_not_their_ramps() -> None:
    machine = shipped()
    course = courses("1000.", machine)[0]
    slow = profile.plan(at(course, 1.0, 0.25))
    assert slow is not None
    velocity, acceleration, _ = used(course, slow)
    assert velocity == pytest.approx(0.25, rel=0.01) and acceleration > 0.75


@pytest.mark.parametrize("feed_mm_min", [0.1, 10.0, 30000.0])
def test_no_feed_is_too_slow_or_too_fast(feed_mm_min: float) -> None:
    machine = shipped()
    course = courses(f"{feed_mm_min}", machine)[-3]
    planned = profile.plan(course)
    assert_fine(course, planned, State(0.0, 0.0, 0.0), feed_mm_min)
    assert planned is not None
    least = course.length / (feed_mm_min / 60.0)
    assert planned.duration_s >= least * (1 - 1e-9)
    if feed_mm_min < 100.0:
        assert planned.duration_s <= least * 1.002 + 0.5


NEARLY_UPRIGHT = [  # X Y Z of six points above, and six below: in the middle the rulings are all but upright
    *((-0.144, 0.081, 16.908), (-1.624, -2.843, 16.885), (-3.161, -5.735, 17.388)),
    *((-4.756, -8.594, 17.009), (-6.409, -11.421, 17.491), (-8.12, -14.216, 16.342)),
    *((0.0, 0.0, 0.908), (-1.595, -2.859, 0.885), (-3.19, -5.719, 1.388)),
    *((-4.785, -8.578, 1.009), (-6.38, -11.437, 1.491), (-7.976, -14.296, 0.342)),
]


def test_where_the_jerk_steps_inside_of_an_interval_it_is_kept_on_both_sides() -> None:
    """C turns over within a tenth of a millimetre: between the places looked at it took 1.03 of its jerk."""
    knots, curves = [0.0] * 6 + [1.0] * 6, (NEARLY_UPRIGHT[:6], NEARLY_UPRIGHT[6:])
    upper, lower = (Written(6, knots, points) for points in curves)
    source = T2.format(side="G42 P1 R5.", cuts=nurbs(upper, lower, " F278.19"))
    machine = drawn(91000)
    (cut,) = [chain for chain in chains(source, machine) if any(s.cutting for s in chain.segments)]
    joints, _ = sampled(cut.segments, laws_of(cut.segments, machine), machine)
    first, second, third = largest(joints, machine)
    assert first <= 1.0005 and second <= 1.002 and third <= 1.02


PIVOT = """G42 P1 R5.
G52 X-8.74 Y-25.72 Z10.25 F2990.
X-9.02 Y-26.99 Z10.22
X-9.28 Y-28.3 Z10.18
X-9.52 Y-29.66 Z10.13
X-8.05 Y-24.71 Z0.0
X-8.23 Y-25.98 Z0.0
X-8.38 Y-27.25 Z0.0
X-8.51 Y-28.54 Z0.0
G52 X-9.52 Y-29.66 Z10.13
X-9.58 Y-29.99 Z10.12
X-9.64 Y-30.33 Z10.1
X-9.7 Y-30.68 Z10.09
X-8.51 Y-28.54 Z0.0
X-8.54 Y-28.86 Z0.0
X-8.57 Y-29.18 Z0.0
X-8.6 Y-29.5 Z0.0
"""


def test_a_jump_of_rates_that_would_be_passed_within_a_tick_of_standstill_is_a_stop() -> None:
    """Both rotaries stop for a pivot of 14 um: X took 1.10 of its jerk in the tick in which they do."""
    machine = shipped("table_head", tools=(Tool(1, "end mill", 2.0, 0.0, 30.0),))
    limits = [
        replace(a.limits, acceleration=0.469 * a.limits.acceleration, jerk=2.5 * a.limits.jerk)
        for a in machine.axes
    ]
    axes = tuple(replace(a, limits=own) for a, own in zip(machine.axes, limits, strict=True))
    machine = replace(machine, axes=axes)
    (cut,) = [
        c
        for c in chains("G21 G90 G54\nT1 M6\nS12000 M3\n" + PIVOT, machine)
        if any(s.cutting for s in c.segments)
    ]
    assert "pivot" in [segment.name for segment in cut.segments]
    joints, _ = sampled(cut.segments, laws_of(cut.segments, machine), machine)
    assert largest(joints, machine)[2] <= 1.02


def test_a_profile_knows_when_it_is_where() -> None:
    machine = shipped()
    course = courses("1000.", machine)[5]
    planned = profile.plan(course)
    assert planned is not None
    for share in (0.0, 0.1, 0.5, 0.99, 1.0):
        s = share * course.length
        assert planned.at(planned.time_of(s)).s == pytest.approx(s, abs=1e-9)
    pieces = planned.laws(course)
    assert [k for k, _ in pieces] == list(range(len(course.segments)))
    assert sum(law.duration_s for _, law in pieces) == pytest.approx(planned.duration_s)


# --- against another planner


@pytest.mark.slow
def test_the_cut_takes_little_longer_than_a_bound_that_knows_no_jerk() -> None:
    pytest.importorskip("toppra")
    sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
    import motion_time

    figures = motion_time.of_the_paper()
    for figure, most in zip(figures, (1.02, 1.02, 1.08, 1.05, 1.05), strict=True):
        assert 0.999 <= figure.ratio <= most, figure
    ratios = sorted(figure.ratio for figure in motion_time.of_random_surfaces(5))
    assert ratios[-1] <= 1.20 and ratios[0] >= 0.999, ratios
