"""Compounds written in few decimals are cut without a stop, and at their feed, where blocks meet."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, Cut, cut, largest, shipped
from support.parts import blu_compounds

from controller.machine import Tool
from controller.plan.feed.course import Course
from controller.plan.feed.limits import JointLimits
from controller.plan.route.path import Stretch
from controller.plan.text.program import ProgramError

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
        begins += done.stretches[k].motion.end
    return way


def allowed(before: Stretch, after: Stretch, done: Cut) -> float:
    """The least speed that the joints' limits allow beside a joint, as the surfaces are, mm/s."""
    machine, kinematics = done.machine, done.kinematics
    limits = JointLimits.of(machine)
    found = []
    for stretch, at_end in ((before, True), (after, False)):
        bare = replace(
            stretch.motion, surface=getattr(stretch.motion.surface, "base", stretch.motion.surface)
        )
        s = np.linspace(0.001, min(BESIDE_MM, bare.end - 0.001), 41)
        course = Course((replace(stretch, motion=bare),), machine, kinematics)
        speeds = limits.path_speed(course.derivatives(bare.end - s if at_end else s))
        found.append(float(speeds.min()))
    return min(found)


def run_one(seed: int) -> int:
    """How many joints of less than the tolerance were looked at whose limits allow the feed."""
    rng = random.Random(seed)
    surfaces = (blu_compounds.general, blu_compounds.like_the_papers)[seed % 2](
        seed, rng.choice((2, 2, 3, 4, 5))
    )
    side, radius, machine = (
        rng.choice(("G41", "G42")),
        rng.choice((1.0, 1.5, 3.0, 5.0, 8.0)),
        shipped(rng.choice(SHIPPED)),
    )
    machine = replace(machine, tools=(Tool(1, "end mill", radius, 0.0, 30.0),))
    degrees = blu_compounds.angles(surfaces)
    try:
        done = cut(blu_compounds.text(surfaces, FEED, side, "T1 M6"), machine)
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
    for (a, b), angle in zip(itertools.pairwise(cuts), degrees, strict=True):
        begins += done.stretches[a].motion.end
        if angle >= TOLERANCE_DEG:
            continue
        assert b == a + 1, (seed, "something stands between two cuts that only rounding parts")
        if allowed(done.stretches[a], done.stretches[b], done) < 2.0 * FEED / 60.0:
            continue
        near = speed[(way[1:] > begins - 0.1) & (way[:-1] < begins + 0.1)]
        assert len(near) and not np.isnan(near).any() and near.min() >= 0.8 * FEED / 60.0, (
            seed,
            begins,
            near,
        )
        looked += 1
    return looked


def test_an_unseen_compound_in_blu_is_cut_at_its_feed() -> None:
    assert run_one(4) + run_one(2) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(6))
def test_many_unseen_compounds_in_few_decimals_are_cut_at_their_feed(batch: int) -> None:
    assert sum(run_one(seed) for seed in range(1000 + 10 * batch, 1010 + 10 * batch)) >= 5
