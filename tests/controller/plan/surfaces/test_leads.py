"""Leads: joined to the cut in place, rate and bend, off the surface, and what is done where they cannot."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from support.machines.planned_laws import laws_of
from support.machines.stepped_runs import program, shipped
from support.machines.traced_programs import (
    HOME,
    assert_goes_on,
    assert_whole,
    differences,
    mill,
    named,
    names,
    sentences,
    trace,
)
from support.parts.random_surfaces import compound, text
from support.parts.vertical_rulings import random_ruled

from controller.geometry.vectors import Vector, norm, subtract
from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.feed import profile
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Path, Segment
from controller.plan.surfaces.leads import MAX_TILT_RAD, MAX_TURN_RAD, SLENDER
from controller.program.program import ProgramError

CONE = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D{} F{}\n"
WALL = (
    "G52 X0. Y0. Z10. F{}\nX10. Y0. Z10.\nX20. Y0. Z10.\nX30. Y0. Z10.\n"
    "X0. Y0. Z0.\nX10. Y0. Z0.\nX20. Y0. Z0.\nX30. Y0. Z0.\n"
)


def ends(traced: Path) -> list[tuple[Segment, Segment]]:
    """Both pairs of a compound of a lead and the cut, the earlier one first."""
    (onto,), (off,) = named(traced, "lead in"), named(traced, "lead out")
    cuts = named(traced, "cut")
    return [(onto, cuts[0]), (cuts[-1], off)]


@pytest.mark.parametrize("side", ["G41", "G42"])
@pytest.mark.parametrize("kind", ["fig4a", "fig4b", "table_head", "head_head", "oblique"])
def test_a_lead_goes_on_with_the_place_the_rate_and_the_bend_of_the_cut(kind: str, side: str) -> None:
    built = mill(kind)
    traced = trace(f"{side}\n" + CONE.format("-200.", "100."), built)
    for before, after in ends(traced):
        assert_goes_on(before, after, built)
    assert_whole(traced, built)


def test_a_lead_goes_on_with_the_rate_of_a_cut_that_ends_at_the_pole() -> None:
    """The last ruling of Example 2 is vertical: its rates are those of the limit."""
    traced = trace(program("example2_ready.ngc", "3000."), shipped(), HOME)
    before, after = ends(traced)[1]
    a = differences(before, before.motion.end, -1.0, shipped())
    b = differences(after, 0.0, 1.0, shipped())
    assert a[1] == pytest.approx(b[1], abs=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_machine_does_not_rest_at_the_first_and_the_last_ruling_of_twisted_surfaces(seed: int) -> None:
    built = shipped()
    home = tuple(axis.homing.position for axis in built.axes)
    traced = trace(text(compound(seed, 1), 1500.0), built, home)
    assert_whole(traced, built, home)
    chain = next(c for c in names(traced) if "cut" in c)
    assert chain == ["lead in", "cut", "lead out"]
    for pair in ends(traced):
        assert len(profile.split_at_stops(pair, built, kinematics_of(built))) == 1


def tips(lead: Segment, built: Machine) -> Vector:
    s = np.linspace(0.0, lead.motion.end, 101)
    q = joints_along(lead, s, kinematics_of(built))
    x, y, z = kinematics_of(built).forward(tuple(q.T), lead.motion.length_mm, np).tip  # type: ignore[union-attr]
    origin = built.offsets[0].origin
    return x - origin[0], y - origin[1], z - origin[2]


def test_on_a_plane_wall_the_way_off_is_a_cubic_parabola() -> None:
    built = mill()
    x, y, z = tips(named(trace("G42\n" + WALL.format(100.0), built), "lead out")[0], built)
    share = (x - 30.0) / (SLENDER * built.lead_mm)
    assert x[-1] == pytest.approx(30.0 + SLENDER * built.lead_mm)
    assert y == pytest.approx(-3.0 - built.lead_mm * share**3, abs=1e-9)
    assert np.abs(z).max() < 1e-9


def test_a_lead_is_as_long_as_the_feed_needs_and_bounded() -> None:
    built = mill()
    lengths = [
        named(trace(WALL.format(f), built), "lead in")[0].motion.end for f in (100.0, 5000.0, 7000.0, 40000.0)
    ]
    assert lengths[0] == pytest.approx(SLENDER * built.lead_mm)
    assert lengths[0] <= lengths[1] < lengths[2] < lengths[3] == pytest.approx(5.0 * built.lead_mm)


def test_beside_a_pole_neither_axis_nor_rotary_turns_far_on_a_lead() -> None:
    """The last ruling of example 2 is vertical, and a rotary turns by many degrees per millimetre there."""
    built = shipped()
    home = tuple(axis.homing.position for axis in built.axes)
    traced = trace(program("example2_ready"), built, home)
    a, b = built.rotary()
    for lead in (*named(traced, "lead in"), *named(traced, "lead out")):
        turned = max(abs(lead.end[a] - lead.start[a]), abs(lead.end[b] - lead.start[b]))
        assert turned <= 1.1 * MAX_TURN_RAD
        axes = [kinematics_of(built).forward(q, 0.0).axis for q in (lead.start, lead.end)]
        assert norm(subtract(*axes)) <= 1.1 * MAX_TILT_RAD


def test_where_no_lead_keeps_the_feed_the_one_that_keeps_most_of_it_is_laid() -> None:
    """A wall beyond its form tolerance: one that turns on reaches 6.8 um deeper, and 6.4 um may be."""
    built = shipped("fig4d")
    traced = trace(random_ruled(98_011).source, built, tuple(axis.homing.position for axis in built.axes))
    (off,) = named(traced, "lead out")
    course = FeedCourse((off,), built, kinematics_of(built))
    allowed = JointLimits.of(built).path_speed(course.derivatives(np.linspace(0.0, off.motion.end, 65)))
    assert allowed.min() > 0.7 * off.feed_mm_s, "0.47 of it where the rotary comes to stand at once"


# ---- feeds -------------------------------------------------------------------------


def feeds(segment: Segment) -> tuple[float, float, float]:
    s = np.array([0.0, 0.5 * segment.motion.end, segment.motion.end])
    first, middle, last = segment.feed_at(s).tolist()
    return first, middle, last


def test_leads_are_fast_by_default_and_have_the_cuts_own_feed_beside_it() -> None:
    built, feed = mill(), 100.0 / 60.0
    traced = trace(WALL.format(100.0), built)
    (onto,), (off,) = named(traced, "lead in"), named(traced, "lead out")
    assert feeds(onto)[2] == pytest.approx(feed) and feeds(onto)[1] > 100.0
    assert feeds(off)[0] == pytest.approx(feed) and feeds(off)[1] > 100.0


def test_lead_feed_is_that_of_the_tip_and_never_below_what_the_cut_begins_with() -> None:
    built = replace(mill(), lead_feed_mm_s=10.0)
    (onto,) = named(trace(WALL.format(100.0), built), "lead in")
    s = np.linspace(0.0, 0.9 * onto.motion.end, 50)
    q = joints_along(onto, np.concatenate([s, s + 1e-6]), kinematics_of(built))
    rate = np.linalg.norm(q[50:, :3] - q[:50, :3], axis=1) / 1e-6
    assert onto.feed_at(s) * rate == pytest.approx(np.full(50, 10.0), rel=1e-4)
    slow = replace(built, lead_feed_mm_s=0.1)
    (onto,) = named(trace(WALL.format(100.0), slow), "lead in")
    assert feeds(onto) == pytest.approx([100.0 / 60.0] * 3)


def test_lead_feed_is_a_key_of_the_machine_file_in_millimetres_a_minute() -> None:
    text = machine_file.load("fig4b").text
    assert machine_file.read(text, "m.toml").lead_feed_mm_s is None
    assert machine_file.read(
        text.replace("[machine]\n", "[machine]\nlead_feed = 600\n"), "m.toml"
    ).lead_feed_mm_s == pytest.approx(10.0)
    for bad in ("0", "-5.0", '"fast"'):
        with pytest.raises(machine_file.ConfigError, match="lead_feed"):
            machine_file.read(text.replace("[machine]\n", f"[machine]\nlead_feed = {bad}\n"), "m.toml")


@pytest.mark.parametrize("feed", [0.1, 3.0, 60.0, 900.0])
def test_a_law_leads_from_a_fast_lead_to_a_slow_cut_and_keeps_its_feed_at_both_rulings(feed: float) -> None:
    """Down to the slowest the lead is passed in no time, and the cut begins neither faster nor slower."""
    built = shipped()
    home = tuple(axis.homing.position for axis in built.axes)
    traced = trace("G42\n" + CONE.format("0.4", feed), built, home)
    (run,) = (
        item.segments for item in traced.items if isinstance(item, ContinuousPath) and len(item.segments) == 3
    )
    course = FeedCourse(run, built, kinematics_of(built))
    plan = profile.plan(course)
    assert plan is not None and plan.joins
    times = [plan.time_of(float(place)) for place in course.starts[1:3]]
    inside = np.linspace(times[0] + 1e-6, times[1] - 1e-6, 400)
    speed = plan.along(inside)[1]
    assert speed == pytest.approx(np.full(400, feed / 60.0), rel=1e-3)
    assert times[0] < 0.3 + 1.0 / feed, "the lead itself, which took 150 / feed"


# ---- gouging and travel ------------------------------------------------------------

# Inside of a ring of radius 15 (cutter on the left), with leads of 3 mm: room enough.
RING = "G41\nG51 X15. Y0. Z0. I0. J0. K0. H10. R15. D{} F100.\n"
RESTS = "the cut rests at that ruling"


def test_leads_inside_a_wide_ring_are_free_and_join() -> None:
    told = sentences(trace(RING.format("360.")))
    assert "Gouge" not in told and RESTS not in told


def test_a_lead_that_would_cut_into_the_ring_is_made_smaller() -> None:
    built = mill(lead_mm=14.0)
    traced = trace(RING.format("360."), built)
    assert "Gouge" not in sentences(traced)
    x, y, _ = tips(named(traced, "lead in")[0], built)
    assert float(np.hypot(x, y).max()) <= 12.0 + 1e-3, "the wall is at 15 mm, the cutter has 3"


def test_a_lead_that_finds_no_room_is_refused_or_noted() -> None:
    # In a slot of 7 mm for a cutter of 6 no way leads off the first wall: the other one is there.
    slot = "G41\nG52 X0. Y0. Z10. F100.\nX10. Y0. Z10.\nX20. Y0. Z10.\nX30. Y0. Z10.\n"
    slot += "X0. Y0. Z0.\nX10. Y0. Z0.\nX20. Y0. Z0.\nX30. Y0. Z0.\n"
    ring = "G41\nG51 X{0} Y0. Z0. I0. J0. K0. H10. R{0} D360. F100.\n"
    roomy, ring = ring.format(3.2), ring.format(3.01)
    assert "Gouge" not in sentences(trace(roomy, mill(lead_mm=9.0))), "a lead fits itself into 0.4 mm"
    with pytest.raises(ProgramError, match=r"the lead in of 9.000 mm would cut .* set a smaller lead_mm"):
        trace(ring, mill(lead_mm=9.0))
    assert "Gouge: the lead in" in sentences(trace(ring, mill(lead_mm=9.0, gouge="warn")))
    trace(slot)


@pytest.mark.parametrize(
    "seed", [16, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (3, 7, 8, 12))]
)
def test_a_longer_lead_mm_never_makes_a_cut_slower(seed: int) -> None:
    """On surfaces so twisted that the flank reaches over their ends; 16 rested at 4 mm and more."""
    built, seen = shipped("head_head", gouge="warn"), list[tuple[float, bool]]()
    home = tuple(axis.homing.position for axis in built.axes)
    for lead_mm in (1.3, 2.0, 3.0, 4.0, 5.0, 9.0, 20.0):
        one = replace(built, lead_mm=lead_mm)
        traced = trace(twisted(seed), one, home)
        (chain,) = (
            c for c in traced.items if isinstance(c, ContinuousPath) and "cut" in {s.name for s in c.segments}
        )
        laws = zip(chain.segments, laws_of(chain.segments, one), strict=True)
        cut_s = sum(law.duration_s for segment, law in laws if segment.name == "cut")
        seen.append((cut_s, RESTS in sentences(traced)))
    for (shorter_s, rested), (longer_s, rests) in itertools.pairwise(seen):
        assert longer_s <= 1.01 * shorter_s and rests <= rested, seen


def twisted(seed: int) -> str:
    """A wall of 20 mm whose rulings turn by up to 90 degrees, for an end mill of 6 mm."""
    rng = np.random.default_rng(seed)
    lower = np.array([[20.0, 11.0, 0.0], [23.0, 6.0, 0.0], [25.0, -3.0, 0.0], [23.0, -9.0, 0.0]])
    upper = lower + rng.uniform((-8.0, -8.0, 9.0), (8.0, 8.0, 11.0), (4, 3))
    rows = [f"X{x:.6f} Y{y:.6f} Z{z:.6f}" for x, y, z in (*upper, *lower)]
    return "G21 G90 G54 G61\nT2 M6\nG42 P1\nG52 " + rows[0] + " F5000.\n" + "\n".join([*rows[1:], "M2", ""])


def test_a_lead_is_free_where_the_ring_is_open() -> None:
    trace(RING.format("90."), mill(lead_mm=6.0))


def test_a_lead_that_leaves_the_travel_is_made_smaller_or_goes_straight_off_and_rests() -> None:
    """From y = 30 on there is as much room as is given, and none ahead makes the lead a straight one."""
    wall = "G52 X0. Y0. Z10. F100.\nX0. Y10. Z10.\nX0. Y20. Z10.\nX0. Y30. Z10.\n"
    wall += "X0. Y0. Z0.\nX0. Y10. Z0.\nX0. Y20. Z0.\nX0. Y30. Z0.\n"
    for room, rests in ((30.0, False), (2.0, False), (1e-3, True)):
        built = mill()
        axes = list(built.axes)
        axes[1] = replace(axes[1], travel_max=built.offsets[0].origin[1] + 30.0 + room)
        built = replace(built, axes=tuple(axes))
        traced = trace(wall, built)
        assert (RESTS in sentences(traced)) == rests
        assert_whole(traced, built, HOME)
