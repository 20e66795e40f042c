"""Signed distances to tools, against their outlines drawn point by point."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.oracles.drawn_tools import border

from controller.machine.model import Tool
from controller.machine.tool_profile import blunt, cutter, flank

SHAPES = {
    "flat": Tool(1, "", 3.0, 0.0, 20.0),
    "ball": Tool(1, "", 3.0, 0.0, 20.0, corner_mm=3.0),
    "a ball whose flute ends below its widest": Tool(1, "", 3.0, 0.0, 2.0, corner_mm=3.0),
    "bull nose": Tool(1, "", 3.0, 0.0, 20.0, corner_mm=0.8),
    "flat taper": Tool(1, "", 2.0, 0.0, 20.0, taper_rad=math.radians(7.0)),
    "tapered ball": Tool(1, "", 1.5, 0.0, 20.0, corner_mm=1.5, taper_rad=math.radians(10.0)),
    "lens": Tool(1, "", 5.0, 0.0, 12.0, corner_mm=1.0, end_mm=14.0),
    "drill": Tool(1, "", 3.0, 0.0, 20.0, point_rad=math.radians(118.0)),
    "rounded countersink": Tool(1, "", 6.0, 0.0, 9.0, corner_mm=0.5, point_rad=math.radians(90.0)),
    "barrel": Tool(1, "", 4.0, 0.0, 22.0, corner_mm=1.0, barrel_mm=85.0),
    "conical barrel": Tool(1, "", 1.5, 0.0, 20.0, corner_mm=1.5, taper_rad=0.3, barrel_mm=250.0),
    "lollipop": Tool(1, "", 4.0, 0.0, 4.0 + math.sqrt(12.0), corner_mm=4.0, back_mm=4.0),
    "T-slot": Tool(1, "", 8.0, 0.0, 6.0, corner_mm=0.5, back_mm=1.5),
}
each_shape = pytest.mark.parametrize("tool", SHAPES.values(), ids=SHAPES)


def to_lines(points: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Distances of points to the straight pieces between those of a border."""
    start, way = drawn[:-1], np.diff(drawn, axis=0)
    away = points[:, None] - start
    share = np.clip((away * way).sum(axis=2) / np.maximum((way * way).sum(axis=1), 1e-30), 0.0, 1.0)
    return np.linalg.norm(away - share[..., None] * way, axis=2).min(axis=1)


@each_shape
def test_the_distance_is_that_to_the_nearest_point_of_the_drawn_outline_in_and_out(tool: Tool) -> None:
    body, drawn = cutter(tool), border(tool)
    points = np.random.default_rng(5).uniform((0.0, -4.0), (12.0, tool.flute_mm + 6.0), (400, 2))
    rho, h = points.T
    thick = np.interp(h, drawn[:-1, 1], drawn[:-1, 0], left=-1.0, right=-1.0)
    nearest, inside = to_lines(points, drawn), rho < thick
    assert inside.any() and (~inside).any()
    assert np.abs(body.distance(rho, h) - np.where(inside, -nearest, nearest)).max() < 2e-5


@each_shape
def test_the_outline_is_at_distance_zero_and_as_thick_as_told(tool: Tool) -> None:
    body, drawn = cutter(tool), border(tool)
    assert np.abs(body.distance(drawn[:, 0], drawn[:, 1])).max() < 1e-12
    side = (drawn[:, 1] > 1e-9) & (drawn[:, 1] < tool.flute_mm - 1e-9)
    assert body.radius(drawn[side, 1]) == pytest.approx(drawn[side, 0], abs=1e-5)
    assert body.widest_mm == pytest.approx(drawn[:, 0].max(), abs=1e-6)
    assert (body.bottom_mm, body.top_mm) == pytest.approx((0.0, tool.flute_mm))
    assert np.abs(body.distance(*body.outline().T)).max() < 1e-12


@each_shape
def test_the_flank_lies_on_the_outline_and_its_cone_holds_it(tool: Tool) -> None:
    bare, drawn = flank(tool), border(tool)
    top = min(bare.ends_mm, tool.flute_mm)
    on = drawn[1:-1][(drawn[1:-1, 1] >= bare.begins_mm) & (drawn[1:-1, 1] <= top)]
    assert (bare.radius_mm(on[:, 1]) >= on[:, 0] - 1e-6).all()
    if bare.barrel is None:
        assert bare.radius_mm(on[:, 1]) == pytest.approx(on[:, 0], abs=1e-5) or not len(on)
    else:
        k = int(np.argmin(bare.radius_mm(on[:, 1]) - on[:, 0]))
        assert on[k, 1] == pytest.approx(bare.barrel.middle_mm, abs=0.05)
        assert on[k, 0] == pytest.approx(bare.radius_mm(on[k, 1]), abs=1e-5)


def test_a_lollipops_shank_is_as_thick_as_its_ball_ends_and_a_drills_as_the_drill() -> None:
    assert blunt(SHAPES["lollipop"], 50.0)[0].widest_mm == pytest.approx(2.0)
    assert blunt(SHAPES["drill"], 50.0)[0].widest_mm == 3.0
    assert blunt(SHAPES["a ball whose flute ends below its widest"], 50.0)[0].widest_mm == 3.0


def test_a_flute_that_goes_on_goes_on_along_its_flank() -> None:
    taper = SHAPES["flat taper"]
    longer, built = cutter(taper).longer(5.0), cutter(replace(taper, flute_mm=25.0))
    assert np.array(longer.arcs) == pytest.approx(np.array(built.arcs))
    assert cutter(SHAPES["lollipop"]).longer(5.0) == cutter(SHAPES["lollipop"])


def test_only_the_flute_cuts_and_the_shank_reaches_from_it_to_the_holder() -> None:
    tool = Tool(1, "held", 3.0, 80.0, 15.0, holder=((25.0, 45.0, 16.0), (45.0, 80.0, 25.0)))
    assert cutter(tool).top_mm == 15.0
    shank, low, high = blunt(tool, 60.0)
    assert (shank.name, shank.bottom_mm, shank.top_mm, shank.widest_mm) == ("shank", 15.0, 25.0, 3.0)
    assert (low.name, low.bottom_mm, low.top_mm, low.widest_mm) == ("holder", 25.0, 45.0, 16.0)
    assert high.distance(np.array([25.5]), np.array([50.0]))[0] == pytest.approx(0.5)


def test_a_neck_begins_where_the_flute_ends() -> None:
    tool = Tool(1, "relieved", 3.0, 80.0, 15.0, holder=((15.0, 80.0, 2.5),))
    assert [(body.name, body.widest_mm) for body in blunt(tool, 60.0)] == [("holder", 2.5)]


def test_a_shank_of_which_no_holder_is_told_reaches_over_all_of_the_surfaces() -> None:
    (short,), (long,) = (blunt(Tool(1, "x", 3.0, length, 15.0), 60.0) for length in (0.0, 90.0))
    assert (short.bottom_mm, short.top_mm, long.top_mm) == (15.0, 75.0, 90.0)


def test_a_shank_above_a_taper_is_as_wide_as_the_taper_ends() -> None:
    tool = SHAPES["flat taper"]
    (shank,) = blunt(tool, 10.0)
    assert shank.widest_mm == pytest.approx(2.0 + 20.0 * math.tan(math.radians(7.0)))


def test_a_body_seen_from_its_foot_is_the_same_body() -> None:
    _, low, _ = blunt(Tool(1, "held", 3.0, 80.0, 15.0, holder=((25.0, 45.0, 16.0), (45.0, 80.0, 25.0))))
    rho, h = np.array([0.0, 17.0, 10.0]), np.array([24.0, 30.0, 46.0])
    assert low.from_its_foot.distance(rho, h - 25.0) == pytest.approx(low.distance(rho, h))
