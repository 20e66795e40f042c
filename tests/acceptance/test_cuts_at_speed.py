"""Cuts begin and end at their feed: seen from the ticks of ``simulate`` alone, without the plan.

The contact is found by putting every commanded tip back on to the path that the nominal surface gives;
its speed is the difference of two such places over a period.
"""

from __future__ import annotations

import random

import numpy as np
import pytest
from support.machines.stepped_runs import SHIPPED, Cut, cut, shipped
from support.oracles.allowed_speed import allowed_mm_s
from support.oracles.trace_limits import assert_in_limits
from support.parts import random_nurbs
from support.parts.random_surfaces import compound, text

from controller.geometry import arc_length
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.plan.segment import Segment
from controller.program.program import ProgramError
from controller.runtime.events import Event
from controller.state.modes import Request

NEWTON = 30
PERIOD_S = 0.008
BESIDE_MM = 8.0  # of an end: limits that are lower further away leave room to reach the feed


def machine(name: str = "trunnion", **changes: object) -> Machine:
    return shipped(name, **{"period_s": PERIOD_S, **changes})


def places(segment: Segment, tips: np.ndarray) -> np.ndarray:
    """Arc length (mm) along C1 at which the nominal tip is nearest each of ``tips`` (N, 3), table frame."""
    motion = segment.motion
    assert isinstance(motion, SurfaceCut)

    def tip(u: np.ndarray) -> np.ndarray:
        rows = motion.part.to_parent(motion.surface.pose(u, motion.offset_mm, np).tip)
        return np.array([np.broadcast_to(c, u.shape) for c in rows]).T

    grid = np.linspace(0.0, 1.0, 801)
    known = tip(grid)
    u = np.array([grid[int(((known - p) ** 2).sum(axis=1).argmin())] for p in tips])
    for _ in range(NEWTON):
        inner = np.clip(u, 1e-5, 1.0 - 1e-5)
        rate = (tip(inner + 1e-5) - tip(inner - 1e-5)) / 2e-5
        step = ((tips - tip(u)) * rate).sum(axis=1) / (rate * rate).sum(axis=1)
        u = np.clip(u + step, 0.0, 1.0)
    return np.asarray(arc_length.s_at(motion.arc, u))


def speeds(done: Cut, segment: Segment, motion_id: int) -> np.ndarray:
    """Speed of the contact (mm/s) between the ticks of one cut."""
    rows = np.flatnonzero(done.column("motion_id") == motion_id)
    pose = done.kinematics.forward(tuple(done.joints[rows].T), segment.motion.length_mm, np)  # type: ignore[union-attr]
    return np.diff(places(segment, np.array(pose.tip).T)) / done.machine.period_s


def cuts(done: Cut) -> list[tuple[int, Segment]]:
    return [(i, segment) for i, segment in done.segments.items() if segment.cutting]


def assert_at_feed(done: Cut, share: float = 1.0) -> None:
    """At the first and the last ruling of the compound within 1 %, and nowhere inside above the feed."""
    members = cuts(done)
    (first_id, first), (last_id, last) = members[0], members[-1]
    feed = share * first.feed_mm_s
    assert speeds(done, first, first_id)[:3] == pytest.approx(np.full(3, feed), rel=0.01)
    assert speeds(done, last, last_id)[-3:] == pytest.approx(np.full(3, feed), rel=0.01)
    for i, segment in members:
        assert speeds(done, segment, i).max() <= 1.0005 * share * segment.feed_mm_s


@pytest.mark.parametrize("feed", [pytest.param("100.", marks=pytest.mark.slow), "1500."])
@pytest.mark.parametrize("name", ["example1_ready", "example2_ready"])
def test_the_ready_examples_begin_and_end_at_their_feed(name: str, feed: str) -> None:
    source = machine_file.shipped_program(name).read_text()
    source = source.replace("F100.", f"F{feed}").replace("D360.", "D90.")
    done = cut(source, machine(gouge="refuse"))
    if name == "example2_ready":
        # Its first ruling, as auto lays it, and its last one are nearly vertical: C is at its limit at the
        # one, Y and Z run ten times as fast as the contact at the other. It is at its feed where it may be.
        (_, first), *_, (last_id, last) = cuts(done)
        wanted = first.feed_mm_s
        assert allowed_mm_s(first, done, BESIDE_MM, at_end=False) < wanted
        if allowed_mm_s(last, done, BESIDE_MM, at_end=True) > wanted:
            assert speeds(done, last, last_id)[-3:] == pytest.approx(np.full(3, wanted), rel=0.01)
        assert max(speeds(done, one, i).max() for i, one in cuts(done)) <= 1.0005 * wanted
    else:
        assert_at_feed(done)
    assert_in_limits(done, name)


@pytest.mark.parametrize("seed", [1, 5])
def test_random_surfaces_begin_and_end_at_their_feed(seed: int) -> None:
    done = cut(text(compound(seed, 1), 1000.0), machine())
    assert_at_feed(done)
    assert_in_limits(done, seed)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig4b", "table_head", "head_head", "oblique45"])
@pytest.mark.parametrize("seed", range(100, 106))
def test_random_surfaces_on_other_machines_begin_and_end_at_their_feed(name: str, seed: int) -> None:
    """With a form tolerance that leaves room for whole leads: a cut that uses it up has shorter ones."""
    done = cut(text(compound(seed, 1), 600.0, "G42 P1 R0.5"), shipped(name))
    assert_at_feed(done)
    assert_in_limits(done, (name, seed))


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(4))
def test_unseen_surfaces_begin_and_end_at_any_feed_that_the_limits_allow(batch: int) -> None:
    judged = 0
    for seed in range(98_000 + 5 * batch, 98_005 + 5 * batch):
        rng = random.Random(seed)
        feed, side, name = 10.0 ** rng.uniform(2.0, 3.5), rng.choice(("G41", "G42")), rng.choice(SHIPPED)
        try:
            done = cut(text(compound(seed, 1), feed, f"{side} P{rng.choice((1, 2))} R0.5"), shipped(name))
        except ProgramError:
            continue  # a surface that is refused; others will do
        ((i, segment),) = cuts(done)
        found = speeds(done, segment, i) / segment.feed_mm_s
        for at_end, ends in ((False, found[:3]), (True, found[-3:])):
            if allowed_mm_s(segment, done, BESIDE_MM, at_end) > segment.feed_mm_s:
                assert ends == pytest.approx(np.ones(3), rel=0.01), (seed, name, feed, at_end)
                judged += 1
        assert found.max() <= 1.0005
        assert_in_limits(done, (seed, name, feed))
    assert judged >= 4


def test_a_lead_is_as_long_as_its_own_bend_needs_at_the_feed() -> None:
    """The way to the feed alone would be shorter: there the lead's third derivative was in the way."""
    done = cut(text(compound(5038, 1), 3039.0, "G41 P2 R0.5"), machine("fig4d"))
    i, segment = cuts(done)[0]
    assert speeds(done, segment, i)[:3] == pytest.approx(np.full(3, segment.feed_mm_s), rel=0.01)
    assert_in_limits(done, "bend")


def test_a_cut_does_not_rest_at_its_end_for_some_micrometres_within_its_tolerance() -> None:
    """Every lead that joins its twisted end reaches 1.5 um deeper than the cut, of 490 um that are left."""
    done = cut(text(compound(5011, 3), 175.0, "G41 P2 R0.5"), machine("table_head"))
    i, segment = cuts(done)[-1]
    assert speeds(done, segment, i)[-3:] == pytest.approx(np.full(3, segment.feed_mm_s), rel=0.01)
    assert_in_limits(done, "end")


def test_a_cut_does_not_slow_down_at_its_end_for_a_rotary_that_could_turn_on() -> None:
    """Where B comes to stand at once it reaches 13 um deeper, turning on 30 um, of 315 um that are left."""
    done = cut(text(compound(97_000, 1), 1287.0, "G42 P1 R0.5"), machine("fig4b"))
    assert_at_feed(done)
    assert_in_limits(done, "rotary")


def test_a_cut_does_not_slow_down_at_its_end_for_two_micrometres_within_its_tolerance() -> None:
    """A rotary lets the contact run at 9.6 mm/s at the ruling itself; it came down to 5.3."""
    done = cut(random_nurbs.text(*random_nurbs.blade(98_036), 876.0, "G41 R0.5"), machine("fig4b"))
    i, segment = cuts(done)[-1]
    assert speeds(done, segment, i)[-3:].min() > 9.6
    assert_in_limits(done, "blade")


def test_under_an_override_the_cut_begins_at_its_share_of_the_feed() -> None:
    source = (
        machine_file.shipped_program("example1_ready")
        .read_text()
        .replace("F100.", "F600.")
        .replace("D360.", "D40.")
    )
    done = cut(source, machine(gouge="refuse"), [Event(0, Request.OVERRIDE, 0.5)])
    assert_at_feed(done, 0.5)
    assert_in_limits(done, "override")


SHORT_CONE = machine_file.shipped_program("example1_ready").read_text().replace("D360.", "D10.")


@pytest.fixture(scope="module")
def plain() -> Cut:
    return cut(SHORT_CONE, machine(gouge="refuse"))


@pytest.mark.parametrize("motion", ["lead in", "lead out"])
def test_a_hold_on_a_lead_stands_on_the_path_and_goes_on(motion: str, plain: Cut) -> None:
    which = next(i for i, segment in plain.segments.items() if segment.name == motion)
    tick = int(np.median(np.flatnonzero(plain.column("motion_id") == which)))
    events = [Event(tick, Request.HOLD, 0.0), Event(tick + 150, Request.RESUME, 0.0)]
    done = cut(SHORT_CONE, plain.machine, events)
    assert done.run.result == "completed"
    assert len(done.joints) > len(plain.joints) + 125
    assert done.joints[-1] == pytest.approx(plain.joints[-1], abs=1e-9)
    assert_in_limits(done, motion, events)
