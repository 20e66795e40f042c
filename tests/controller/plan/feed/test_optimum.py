"""The feed law beside an optimum found another way, on machines of every weight, and what it must keep."""

from __future__ import annotations

import itertools
import random
import statistics
from collections.abc import Iterable
from dataclasses import replace

import pytest
from support.machines.planned_laws import chains, laws_of, sampled
from support.machines.slow_machines import any_path, drawn, published, two_rails
from support.machines.stepped_runs import largest, shipped
from support.oracles import jerk_limited_time, time_bound
from support.parts.random_surfaces import compound, text

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Limits, Machine
from controller.plan.feed import profile
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import straight
from controller.plan.segment import Segment
from controller.program.program import ProgramError

MOST, MEDIAN = 1.15, 1.05  # times the optimum


def cuts_of(source: str, machine: Machine) -> list[Segment]:
    return [s for chain in chains(source, machine) for s in chain.segments if s.cutting]


def ratio(cuts: list[Segment], machine: Machine, label: object) -> float:
    """Planned time of the cuts over the optimum; the joints, sampled as the tick does, keep all limits."""
    laws = laws_of(cuts, machine)
    velocity, acceleration, jerk = largest(sampled(cuts, laws, machine)[0], machine)
    assert velocity <= 1.0005 and acceleration <= 1.002 and jerk <= 1.02, (
        label,
        velocity,
        acceleration,
        jerk,
    )
    return sum(law.duration_s for law in laws) / jerk_limited_time.optimum(cuts, machine).seconds


# --- the optimum itself


@pytest.mark.parametrize(
    "limits",
    [Limits(50.0, 400.0, 4000.0), Limits(1000.0, 100.0, 5000.0), Limits(1000.0, 1e5, 300.0)],
    ids=["all three bind", "velocity is out of reach", "jerk alone"],
)
def test_the_optimum_of_a_straight_line_is_the_closed_form(limits: Limits) -> None:
    machine = shipped()
    machine = replace(machine, axes=tuple(replace(axis, limits=limits) for axis in machine.axes))
    line = chains("G53 G0 X100.\nM30\n", machine)[0].segments[0]
    assert line.motion.end == 100.0
    wanted = straight(100.0, limits.velocity, limits.acceleration, limits.jerk).duration_s
    assert jerk_limited_time.optimum([line], machine).seconds == pytest.approx(wanted, rel=3e-3)


@pytest.mark.parametrize("jerk", [1.0, 100.0])
def test_the_optimum_depends_little_on_its_nodes_and_is_never_below_the_bound_without_jerk(
    jerk: float,
) -> None:
    machine = published(jerk)
    cut = cuts_of(two_rails(), machine)[2]
    coarse, fine = (jerk_limited_time.optimum([cut], machine, nodes).seconds for nodes in (200, 400))
    assert coarse == pytest.approx(fine, rel=2e-3)
    assert fine >= time_bound.seconds([cut], machine) * (1.0 - 2e-3)


# --- the law beside it


@pytest.mark.parametrize("jerk", [1.0, 100.0])
def test_the_published_two_rail_case_takes_little_more_than_the_optimum(jerk: float) -> None:
    """It took 2.1 times the optimum: rates that seemed to jump at every knot made the machine creep."""
    machine = published(jerk)
    assert ratio(cuts_of(two_rails(), machine), machine, jerk) <= 1.02


def test_a_feed_out_of_reach_makes_no_stops() -> None:
    """Five cuts that join smoothly are one run however high the feed is and however heavy the machine."""
    for seed in (7, 8, 16, 17):
        machine = drawn(seed)
        cuts = cuts_of(two_rails(), machine)
        fast = [replace(cut, feed_mm_s=1e4) for cut in cuts]
        assert len(profile.split_at_stops(fast, machine, kinematics_of(machine))) == 1, seed


def random_ratios(seeds: Iterable[int], count: int) -> list[float]:
    found: list[float] = []
    for seed in seeds:
        machine = drawn(seed)
        try:
            cuts = cuts_of(any_path(seed), machine)
        except ProgramError:
            continue  # a surface that is refused; others will do
        found.append(ratio(cuts, machine, seed))
        print(f"seed {seed}: {len(cuts)} cuts on {machine.name}, {found[-1]:.4f} of the optimum")
        if len(found) == count:
            break
    assert len(found) == count
    return found


def test_random_paths_and_machines_come_near_the_optimum() -> None:
    assert max(random_ratios(itertools.count(), 3)) <= MOST


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(10))
def test_a_hundred_random_paths_and_machines_come_near_the_optimum(batch: int) -> None:
    found = random_ratios(itertools.count(1000 * (batch + 1)), 10)
    print(f"median {statistics.median(found):.4f}, worst {max(found):.4f}")
    assert statistics.median(found) <= MEDIAN and max(found) <= MOST


# --- with the leads: what begins and ends at speed


@pytest.mark.slow
def test_random_compounds_take_little_more_than_an_optimum_that_begins_and_ends_at_speed() -> None:
    """Each run from rest to rest with its leads, so that the cuts begin as fast as the path lets them."""
    found = []
    for seed in range(500, 506):
        rng = random.Random(seed)
        machine, feed = shipped(), rng.uniform(2000.0, 5000.0)
        kinematics = kinematics_of(machine)
        try:
            source = text(compound(seed, rng.choice((1, 2, 3))), feed)
            whole = chains(source, machine)
        except (ProgramError, ValueError):
            continue
        for chain in whole:
            for run in profile.split_at_stops(chain.segments, machine, kinematics):
                if not any(segment.cutting for segment in run):
                    continue
                planned = profile.plan(FeedCourse(run, machine, kinematics))
                assert planned is not None
                best = jerk_limited_time.optimum(run, machine, 800)
                found.append(planned.duration_s / best.seconds)
                print(f"seed {seed}: {planned.duration_s:.3f} s, {found[-1]:.4f} of the optimum")
    print(f"median {statistics.median(found):.4f}, worst {max(found):.4f}")
    assert len(found) >= 6
    assert statistics.median(found) <= 1.02 and max(found) <= 1.06
