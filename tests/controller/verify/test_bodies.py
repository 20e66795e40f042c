"""Signed distances to tools, against their outlines drawn point by point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from controller.machine.model import Tool
from controller.verify.bodies import Body, cutter, holder

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
    body = cutter(tool, 0.0)
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
    body = cutter(tool, 0.0)
    drawn = border(body)
    assert np.abs(body.distance(drawn[:, 0], drawn[:, 1])).max() < 1e-12, shape


def test_the_widest_of_a_taper_is_at_its_top() -> None:
    body = cutter(SHAPES[4][0], 0.0)
    assert body.distance(np.array([body.widest_mm]), np.array([body.top_mm])) == pytest.approx(0.0, abs=1e-12)
    assert body.widest_mm > border(body)[-2, 0]


def test_a_holder_is_its_cylinders_and_the_cutter_ends_below_it() -> None:
    tool = Tool(1, "held", 3.0, 80.0, 15.0, holder=((25.0, 45.0, 16.0), (45.0, 80.0, 25.0)))
    assert cutter(tool, 60.0).top_mm == 25.0
    low, high = holder(tool)
    assert (low.bottom_mm, low.top_mm, low.widest_mm) == (25.0, 45.0, 16.0)
    assert high.distance(np.array([25.5]), np.array([50.0]))[0] == pytest.approx(0.5)
