"""Approach, leads and departure: where they run, how they touch, what they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.traced_programs import (
    HOME,
    assert_whole,
    mill,
    named,
    names,
    segments,
    sentences,
    trace,
)

from controller.geometry.vectors import Vector, add, dot, norm, scale, subtract, unit
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine, Tool
from controller.plan.segment import Segment
from controller.plan.surfaces.leads import SLENDER

CONE = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D{} F100.\n"


def tip(segment: Segment, s: float, built: Machine) -> Vector:
    kinematics = kinematics_of(built)
    joints = segment.motion.joints(s, (segment.start[3], segment.start[4]), kinematics)
    assert joints is not None
    return kinematics.forward(joints, 0.0).tip


def test_the_lead_in_comes_from_the_cutters_side() -> None:
    for side, y in (("G42", -1.0), ("G41", 1.0)):
        built = mill()
        wall = "G52 X0. Y0. Z10. F100.\nX10. Y0. Z10.\nX20. Y0. Z10.\nX30. Y0. Z10.\n"
        wall += "X0. Y0. Z0.\nX10. Y0. Z0.\nX20. Y0. Z0.\nX30. Y0. Z0.\n"
        (onto,) = named(trace(f"{side}\n{wall}", built), "lead in")
        away = subtract(tip(onto, 0.0, built), built.offsets[0].origin)
        assert away == pytest.approx((-SLENDER * 3.0, y * (3.0 + 3.0), 0.0), abs=1e-9)


def test_rotaries_turn_only_at_the_retract_height_or_in_the_cut_with_its_leads() -> None:
    built = mill()
    for segment in segments(trace(CONE.format("360."), built, (10.0, 20.0, -50.0, 0.3, 1.0))):
        if segment.name not in ("position", "lead in", "cut", "lead out"):
            assert segment.start[3:] == segment.end[3:], segment.name
        if segment.name == "position":
            assert segment.start[2] == segment.end[2] == built.retract_mm


def test_the_tool_is_first_retracted_where_it_stands() -> None:
    start = (10.0, 20.0, -50.0, 0.0, 0.0)
    traced = trace(CONE.format("90."), start=start)
    assert names(traced)[0] == ["retract"]
    assert segments(traced)[0].end == (10.0, 20.0, 200.0, 0.0, 0.0)
    assert names(trace(CONE.format("90."), start=HOME))[0] == ["position"]


@pytest.mark.parametrize("kind", ["fig4a", "fig4b", "table_head", "head_head", "oblique"])
def test_the_plunge_runs_along_the_tool_axis_from_above_the_highest_point(kind: str) -> None:
    built = mill(kind)
    traced = trace(CONE.format("90."), built)
    (plunge,), (down,), (cut,) = (named(traced, name) for name in ("plunge", "down", "cut"))
    kinematics = kinematics_of(built)
    axis = kinematics.forward(plunge.start, 0.0).axis
    way = subtract(tip(plunge, plunge.motion.end, built), tip(plunge, 0.0, built))
    assert dot(unit(way), axis) == pytest.approx(-1.0)
    assert plunge.feed_mm_s == cut.feed_mm_s
    # Down is vertical, and ends with the tip at least clearance above all of the block.
    assert down.start[:2] == pytest.approx(down.end[:2])
    surface, part = cut.motion.surface, cut.motion.part
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 91), np.linspace(0, 1, 5)))
    points = part.to_parent(surface.point(u, v, np))
    heights = kinematics.linear(points, (down.end[3], down.end[4]), 0.0, np)[2]
    over = down.end[2] - float(np.max(heights))
    assert over >= built.clearance_mm - 1e-6
    if kind.startswith(("fig", "oblique")):
        assert over == pytest.approx(built.clearance_mm, abs=0.01)


def test_the_departure_lifts_along_the_axis_and_retracts() -> None:
    traced = trace(CONE.format("90."))
    assert names(traced)[-2:] == [["lift"], ["retract"]]
    assert traced.end[2] == 200.0
    assert named(traced, "lift")[0].feed_mm_s is None


def test_without_leads_the_flank_plunges_and_lifts_at_feed() -> None:
    built = mill(lead_mm=0.0)
    traced = trace(CONE.format("90."), built)
    assert ["cut"] in names(traced)
    assert named(traced, "lift")[0].feed_mm_s == named(traced, "cut")[0].feed_mm_s
    assert_whole(traced, built)


def test_a_clearance_above_the_retract_height_raises_the_way_there() -> None:
    built = mill(retract_mm=-500.0)
    traced = trace(CONE.format("90."), built, (0.0, 0.0, -500.0, 0.0, 0.0))
    (position,) = named(traced, "position")
    assert position.start[2] == pytest.approx(named(traced, "plunge")[0].start[2])
    assert_whole(traced, built, (0.0, 0.0, -500.0, 0.0, 0.0))


def test_a_ruling_longer_than_the_flute_is_noted() -> None:
    built = mill(tools=(Tool(1, "short", 3.0, 0.0, 5.0),))
    assert "flute of T1 is 5.000 mm" in sentences(trace(CONE.format("90."), built))


def test_a_cutter_without_radius_leads_in_and_out_as_well() -> None:
    built = mill(tools=(Tool(1, "needle", 0.0, 0.0, 15.0),))
    traced = trace(CONE.format("90."), built)
    away = norm(subtract(tip(named(traced, "lead in")[0], 0.0, built), built.offsets[0].origin))
    assert away > 15.0
    assert_whole(traced, built)


def test_a_long_tool_stands_higher_by_its_length() -> None:
    built = mill()
    longer = replace(built, tools=(replace(built.tools[0], length_mm=40.0),))
    short, long = (named(trace(CONE.format("90."), m), "cut")[0].start for m in (built, longer))
    assert subtract(long[:3], short[:3]) == pytest.approx(add((0.0, 0.0, 0.0), scale((0.0, 0.0, 1.0), 40.0)))
