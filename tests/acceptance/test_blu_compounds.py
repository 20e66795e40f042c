"""Compounds written in few decimals are cut without a stop, and at their feed, where blocks meet."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, Cut, cut, largest, shipped
from support.oracles.allowed_speed import allowed_mm_s
from support.parts import blu_compounds
from support.parts.random_surfaces import Pair

from controller.machine.model import Limits, Machine, Tool
from controller.program.program import ProgramError

FEED = 2000.0  # mm/min
BESIDE_MM = 4.0  # of a joint: as far as a blend reaches, and some
TOLERANCE_DEG = 0.2


def course_mm(done: Cut, cuts: list[int]) -> np.ndarray:
    """Way of the contact since the first cut began, nan where nothing is cut."""
    ids, s = done.column("motion_id").astype(int), done.column("s")
    way, begins = np.full(len(ids), np.nan), 0.0
    for k in cuts:
        here = (ids == k) & done.trace.cutting
        way[here] = begins + s[here]
        begins += done.segments[k].motion.end
    return way


def scene(seed: int) -> tuple[list[Pair], str, Machine]:
    """Surfaces, side and machine."""
    rng = random.Random(seed)
    kind = (blu_compounds.general, blu_compounds.like_the_papers)[seed % 2]
    surfaces, side = kind(seed, rng.choice((2, 2, 3, 4, 5))), rng.choice(("G41", "G42"))
    cutter = Tool(1, "end mill", rng.choice((1.0, 1.5, 3.0, 5.0, 8.0)), 0.0, 30.0)
    return surfaces, side, shipped(rng.choice(SHIPPED), tools=(cutter,), period_s=0.008)


def run_one(seed: int) -> int:
    """How many joints of less than the tolerance were looked at whose limits allow the feed.

    Only the lower curves of the compounds are made to run on: where the normals differ above, along the
    ruling, the surfaces have a crease, and what is told is what it is passed at.
    """
    surfaces, side, machine = scene(seed)
    text, feed = blu_compounds.text(surfaces, FEED, side, "T1 M6"), FEED / 60.0
    degrees, creases = blu_compounds.angles(surfaces), blu_compounds.creases(surfaces)
    try:
        done = cut(text, machine)
    except ProgramError as error:
        assert "concave corner" not in str(error) or max(degrees) > TOLERANCE_DEG, (seed, str(error))
        return 0
    assert done.run.result == "completed", (seed, done.run.fault_text)
    first, second, third = largest(done.joints, done.machine)
    assert first <= 1.0005 and second <= 1.002 and third <= 1.02, (seed, first, second, third)
    ids = done.column("motion_id").astype(int)
    cuts = [int(k) for k in dict.fromkeys(ids[done.trace.cutting])]
    assert len(cuts) == len(surfaces)
    way, looked, begins = course_mm(done, cuts), 0, 0.0
    speed = np.diff(way) / machine.period_s
    for (a, b), angle, crease in zip(itertools.pairwise(cuts), degrees, creases, strict=True):
        begins += done.segments[a].motion.end
        if max(angle, crease) >= TOLERANCE_DEG:
            continue
        assert b == a + 1, (seed, "something stands between two cuts that only rounding parts")
        before, after = done.segments[a], done.segments[b]
        if min(allowed_mm_s(before, done, BESIDE_MM, True), allowed_mm_s(after, done, BESIDE_MM)) < feed:
            continue
        near = speed[(way[1:] > begins - 0.1) & (way[:-1] < begins + 0.1)]
        assert len(near) and not np.isnan(near).any()
        least = 0.8 * feed
        assert near.min() >= least, (seed, begins, crease, least, near)
        looked += 1
    return looked


def test_an_unseen_compound_in_blu_is_cut_at_its_feed() -> None:
    assert run_one(4) + run_one(2) >= 2


def test_a_crease_above_the_contact_slows_no_joint_beside_it() -> None:
    """Of 6.8 degrees at the upper end, none at the contact: it is exact, the two others are at F."""
    assert run_one(3016) == 2


def test_a_crease_of_little_more_than_rounding_is_none() -> None:
    """Of 1.5 degrees above, between cuts of 32 mm: limits are kept, and the feed is that of no blend."""
    assert run_one(98_240) == 0


def test_a_joint_of_two_short_cuts_is_passed_at_four_fifths_of_the_feed_at_least() -> None:
    """Of 0.16 degrees at 63 mm/s on a light machine, between cuts of 4 mm: the blends need all of that."""
    limits = {"B": Limits(6.4, 22.0, 233.0), "C": Limits(12.8, 44.0, 466.0)}
    built, linear = shipped("table_head"), Limits(400.0, 1680.0, 22270.0)
    axes = tuple(replace(one, limits=limits.get(one.name, linear)) for one in built.axes)
    machine = replace(built, axes=axes, tools=(Tool(1, "end mill", 3.0, 0.0, 30.0),))
    plan = [
        ([(23.92, 16.48), (24.82, 15.31), (25.59, 14.04), (26.23, 12.69)], 10.05),
        ([(19.63, 13.57), (20.44, 12.44), (21.16, 11.23), (21.77, 9.98)], 0.0),
        ([(26.23, 12.69), (26.87, 11.34), (27.38, 9.9), (27.75, 8.39)], 10.05),
        ([(21.77, 9.98), (22.38, 8.72), (22.89, 7.4), (23.27, 6.05)], 0.0),
    ]
    curves = [np.array([(*point, z) for point in points]) for points, z in plan]
    surfaces = [(curves[0], curves[1]), (curves[2], curves[3])]
    assert 0.15 < blu_compounds.angles(surfaces)[0] < TOLERANCE_DEG
    text, feed = blu_compounds.text(surfaces, 3760.0, "G41", "T1 M6"), 3760.0 / 60.0
    done = cut(text, machine)
    before, after = (k for k, segment in done.segments.items() if segment.cutting)
    assert allowed_mm_s(done.segments[before], done, BESIDE_MM, True) > feed
    assert allowed_mm_s(done.segments[after], done, BESIDE_MM) > feed
    way, joint = course_mm(done, [before, after]), done.segments[before].motion.end
    speed = np.diff(way) / machine.period_s
    near = speed[(way[1:] > joint - 0.5) & (way[:-1] < joint + 0.5)]
    assert len(near) > 5 and near.min() >= 0.8 * feed, near.min() / feed


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(40))
def test_many_unseen_compounds_in_few_decimals_are_cut_at_their_feed(batch: int) -> None:
    assert sum(run_one(seed) for seed in range(7000 + 5 * batch, 7005 + 5 * batch)) >= 1
