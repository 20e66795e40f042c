"""Motion laws: limits kept at every sample, the feed met exactly, and no time given away."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import pytest
import traced
from cutting import largest, program, shipped
from random_surfaces import compound, text

from controller.handoff import Law
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.plan import profile
from controller.plan.law import at_share, straight, through
from controller.plan.limits import JointLimits, derivatives
from controller.plan.path import Chain, Stretch
from controller.plan.program import ProgramError
from controller.plan.stretch import rotaries_of

OVERSHOOT = 1e-9  # of the feed: rounding

# --- straight moves


def at_many(law: Law, n: int = 2001) -> tuple[np.ndarray, ...]:
    t = np.linspace(0.0, law.duration_s, n)
    s, v, a = (np.array(x) for x in zip(*(law.at(float(x)) for x in t), strict=True))
    return t, s, v, a


def jerks(law: Law) -> list[float]:
    return [6.0 * row[3] for row in law.coefficients]


@pytest.mark.parametrize("seed", range(60))
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


def chains(source: str, machine: Machine) -> list[Chain]:
    home = tuple(axis.homing.position for axis in machine.axes)
    return [item for item in traced.trace(source, machine, home).items if isinstance(item, Chain)]  # type: ignore[arg-type]


def sampled(chain: Chain, laws: list[Law], machine: Machine) -> tuple[np.ndarray, list[np.ndarray]]:
    """Joints at every tick, standing before and after; and s of each stretch at its ticks."""
    kinematics, T = Kinematics(machine), machine.period_s
    ends = np.cumsum([law.duration_s for law in laws])
    near = rotaries_of(chain.stretches[0].start, kinematics)
    joints = [chain.stretches[0].start] * 4
    places: list[list[float]] = [[] for _ in laws]
    for n in itertools.count(1):
        k = int(np.searchsorted(ends, n * T, side="right"))
        if k == len(laws):
            break
        s = laws[k].at(n * T - (ends[k] - laws[k].duration_s))[0]
        q = chain.stretches[k].motion.joints(s, near, kinematics)
        assert q is not None
        near = rotaries_of(q, kinematics)
        joints.append(q)
        places[k].append(s)
    joints += [chain.stretches[-1].end] * 4
    return np.asarray(joints), [np.asarray(p) for p in places]


def assert_exact_feed(chain: Chain, laws: list[Law], places: list[np.ndarray], machine: Machine) -> float:
    """Where the feed is reached every tick covers feed x period; the share of ticks that do."""
    even, all_of = 0, 0
    for stretch, law, s in zip(chain.stretches, laws, places, strict=True):
        if stretch.cutting:
            assert stretch.feed_mm_s is not None
            step, speed = np.diff(s), np.array([law.at(t)[1] for t in np.linspace(0, law.duration_s, 400)])
            wanted = stretch.feed_mm_s * machine.period_s
            assert step.max() <= wanted * (1 + OVERSHOOT)
            assert speed.max() <= stretch.feed_mm_s * (1 + OVERSHOOT)
            even += int(np.count_nonzero(np.abs(step - wanted) <= 1e-5 * wanted))
            all_of += len(step)
    return even / max(all_of, 1)


def assert_limits(chain: Chain, machine: Machine, label: object) -> tuple[float, float]:
    """(duration, share of ticks at exactly the feed)."""
    laws = profile.plan(chain, machine, Kinematics(machine))
    joints, places = sampled(chain, laws, machine)
    first, second, third = largest(joints, machine)
    assert first <= 1.0005 and second <= 1.002 and third <= 1.02, (label, first, second, third)
    for stretch, law in zip(chain.stretches, laws, strict=True):
        assert law.at(law.duration_s)[0] == pytest.approx(stretch.motion.end, rel=1e-12), label
    share = assert_exact_feed(chain, laws, places, machine)
    return sum(law.duration_s for law in laws), share


@pytest.mark.parametrize(("feed", "least"), [("1000.", 0.9), ("3000.", 0.4)])
def test_example_2_keeps_all_limits_at_any_feed_and_its_feed_wherever_they_allow(
    feed: str, least: float
) -> None:
    machine = shipped()
    for chain in chains(program("example2.ngc", feed), machine):
        _, share = assert_limits(chain, machine, feed)
        if any(stretch.cutting for stretch in chain.stretches):
            assert share >= least


@pytest.mark.slow
def test_example_2_at_its_own_feed_keeps_it_nearly_everywhere() -> None:
    machine = shipped()
    shares = [assert_limits(chain, machine, 100)[1] for chain in chains(program("example2.ngc"), machine)]
    assert max(shares) > 0.99


def unseen(seed: int) -> tuple[list[Chain], Machine, float] | None:
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
def test_many_random_compound_surfaces_keep_all_limits() -> None:
    assert_unseen(range(310, 350))


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.0005, 0.001, 0.005])
def test_the_limits_hold_at_other_periods(period_s: float) -> None:
    machine = shipped(period_s=period_s)
    for chain in chains(program("example2_ready.ngc", "3000."), machine):
        assert_limits(chain, machine, period_s)


def test_an_override_scales_the_feed_and_not_the_limits() -> None:
    machine = shipped()
    chain = max(chains(program("example1_ready.ngc", "500."), machine), key=lambda c: len(c.stretches))
    kinematics = Kinematics(machine)
    one, two = (profile.plan(chain, machine, kinematics, share) for share in (1.0, 2.0))
    k = next(i for i, stretch in enumerate(chain.stretches) if stretch.cutting)
    middle = [law.at(law.duration_s / 2)[1] for law in (one[k], two[k])]
    assert middle[1] == pytest.approx(2.0 * middle[0], rel=1e-9)
    assert largest(sampled(chain, two, machine)[0], machine)[1] <= 1.002


def test_a_straight_chain_of_one_move_takes_the_closed_form() -> None:
    machine = shipped()
    chain = chains("G0 X100. Y50.\nM30\n", machine)[0]
    assert len(profile.plan(chain, machine, Kinematics(machine))[0].coefficients) <= 7


# --- against another planner


def best_time(run: tuple[Stretch, ...], machine: Machine) -> float:
    """The shortest time with velocity, acceleration and feed alone, by toppra: a lower bound."""
    toppra = pytest.importorskip("toppra")
    kinematics = Kinematics(machine)
    limit = JointLimits.of(machine)
    total = 0.0
    for stretch in run:

        class Geometry(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc, name-defined]
            """q(s) by its exact derivatives; joints' values themselves do not matter."""

            dof, path_interval = 5, np.array([0.0, stretch.motion.end])

            def __call__(self, s: np.ndarray, order: int = 0, own: Stretch = stretch) -> np.ndarray:
                at = np.atleast_1d(np.asarray(s, dtype=float))
                d = derivatives(own, at, kinematics)
                return (np.zeros((len(at), 5)), d.first, d.second)[order]

        class Feed(toppra.constraint.LinearConstraint):  # type: ignore[misc, name-defined]
            """sd <= feed."""

            def __init__(self, feed: float) -> None:
                super().__init__()
                self.feed, self.identical = feed, False
                self.discretization_type = toppra.constraint.DiscretizationType.Collocation

            def compute_constraint_params(self, path: object, grid: np.ndarray) -> tuple[object, ...]:
                bound = np.tile([0.0, self.feed**2], (len(grid), 1))
                return None, None, None, None, None, None, bound

        constraints = [
            toppra.constraint.JointVelocityConstraint(np.stack([-limit.velocity, limit.velocity], axis=1)),
            toppra.constraint.JointAccelerationConstraint(
                np.stack([-limit.acceleration, limit.acceleration], axis=1)
            ),
            Feed(stretch.feed_mm_s or 1e6),
        ]
        x = np.linspace(0.0, 1.0, 1201)
        grid = (x * x * (3.0 - 2.0 * x)) * stretch.motion.end
        # Each cut alone, entered and left at any speed: never slower than in its chain.
        planner = toppra.algorithm.TOPPRA(constraints, Geometry(), gridpoints=grid, solver_wrapper="seidel")
        total += _fastest_through(planner, grid)
    return total


def _fastest_through(planner: object, grid: np.ndarray) -> float:
    """Time with free end speeds at the largest speed feasible at each place by itself: a lower bound."""
    upper = planner.compute_feasible_sets()[:, 1]  # type: ignore[attr-defined]
    speed = np.sqrt(np.maximum(upper, 1e-12))
    return float((2.0 * np.diff(grid) / (speed[1:] + speed[:-1])).sum())


@pytest.mark.slow
@pytest.mark.parametrize("feed", ["100.", "1000.", "3000."])
def test_the_cut_is_within_a_few_percent_of_a_bound_that_knows_no_jerk(feed: str) -> None:
    pytest.importorskip("toppra")
    machine = shipped()
    chain = max(chains(program("example2_ready.ngc", feed), machine), key=lambda c: len(c.stretches))
    cuts = tuple(stretch for stretch in chain.stretches if stretch.cutting)
    laws = profile.plan(chain, machine, Kinematics(machine))
    ours = sum(law.duration_s for law, stretch in zip(laws, chain.stretches, strict=True) if stretch.cutting)
    bound = best_time(cuts, machine)
    print(f"\n{feed} mm/min: {ours:.3f} s, bound by velocity, acceleration and feed {bound:.3f} s")
    assert bound * 0.999 <= ours <= bound * {"100.": 1.02, "1000.": 1.08, "3000.": 1.35}[feed]
