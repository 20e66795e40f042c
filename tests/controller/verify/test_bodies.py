"""Signed distances to tools, against their outlines drawn point by point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from controller.machine.model import Tool
from controller.verify.bodies import Body, blunt, cutter

SHAPES = [
    (Tool(1, "flat", 3.0, 0.0, 20.0), "a flat end mill"),
    (Tool(1, "ball", 3.0, 0.0, 20.0, corner_mm=3.0), "a ball end mill"),
    (Tool(1, "bull", 3.0, 0.0, 20.0, corner_mm=0.8), "a bull nose"),
    (Tool(1, "taper", 2.0, 0.0, 20.0, taper_rad=math.radians(7.0)), "a flat taper"),
    (Tool(1, "tapered ball", 1.5, 0.0, 20.0, corner_mm=1.5, taper_rad=math.radians(10.0)), "a tapered ball"),
]


def border(body: Body) -> np.ndarray:
    """Points of end, corner and flank in the half plane, some micrometres apart."""
    turn = np.linspace(-0.5 * math.pi, -body.taper_rad, 4001)
    corner = np.stack(
        [
            body.corner_rho_mm + body.rounding_mm * np.cos(turn),
            body.corner_h_mm + body.rounding_mm * np.sin(turn),
        ],
        axis=1,
    )
    up = np.linspace(0.0, (body.top_mm - corner[-1, 1]) / math.cos(body.taper_rad), 20001)[:, None]
    flank = corner[-1] + up * [math.sin(body.taper_rad), math.cos(body.taper_rad)]
    end = np.stack([np.linspace(0.0, body.corner_rho_mm, 4001), np.full(4001, body.bottom_mm)], axis=1)
    top = np.stack([np.linspace(0.0, flank[-1, 0], 4001), np.full(4001, body.top_mm)], axis=1)
    return np.vstack([end, corner, flank, top])


@pytest.mark.parametrize(("tool", "shape"), SHAPES, ids=[shape for _, shape in SHAPES])
def test_the_distance_outside_is_that_to_the_nearest_point_of_the_outline(tool: Tool, shape: str) -> None:
    body = cutter(tool)
    rng = np.random.default_rng(5)
    points = np.stack([rng.uniform(0.0, 12.0, 400), rng.uniform(-5.0, 28.0, 400)], axis=1)
    drawn = border(body)
    nearest = cKDTree(drawn).query(points)[0]
    told = body.distance(points[:, 0], points[:, 1])
    outside = told > 0.0
    assert outside.any() and (~outside).any()
    assert np.abs(told - nearest)[outside].max() < 1e-4, shape
    assert np.all(-told[~outside] <= nearest[~outside] + 1e-4), "inside it is never called deeper than it is"


@pytest.mark.parametrize(("tool", "shape"), SHAPES, ids=[shape for _, shape in SHAPES])
def test_the_outline_is_at_distance_zero(tool: Tool, shape: str) -> None:
    body = cutter(tool)
    drawn = border(body)
    assert np.abs(body.distance(drawn[:, 0], drawn[:, 1])).max() < 1e-12, shape


def test_the_widest_of_a_taper_is_at_its_top() -> None:
    body = cutter(SHAPES[4][0])
    assert body.distance(np.array([body.widest_mm]), np.array([body.top_mm])) == pytest.approx(0.0, abs=1e-12)
    assert body.widest_mm > border(body)[-2, 0]


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
    tool = SHAPES[3][0]
    (shank,) = blunt(tool, 10.0)
    assert shank.widest_mm == pytest.approx(2.0 + 20.0 * math.tan(math.radians(7.0)))


def test_a_body_seen_from_its_foot_is_the_same_body() -> None:
    _, low, _ = blunt(Tool(1, "held", 3.0, 80.0, 15.0, holder=((25.0, 45.0, 16.0), (45.0, 80.0, 25.0))))
    rho, h = np.array([0.0, 17.0, 10.0]), np.array([24.0, 30.0, 46.0])
    assert low.from_its_foot.distance(rho, h - 25.0) == pytest.approx(low.distance(rho, h))
