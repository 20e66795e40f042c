"""The deviation of the cut surface: closed forms, and a brute force that shares nothing with it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from support.oracles.swept_cylinder import body_by_brute_force, by_brute_force, nominal, places, sweep
from support.parts.paper_surfaces import example_1, example_2
from support.parts.random_surfaces import compound

from controller.geometry.curves import Bezier, Line
from controller.geometry.surfaces import Cone, RuledSurface, Surface
from controller.machine.model import Tool
from controller.machine.tool_profile import cutter
from controller.plan.surfaces.placing import Cutter, as_the_paper
from controller.verify.envelope import ASIDE_MM, _best_sample, deviation, nearest
from controller.verify.nominal import Nominal
from controller.verify.sweep import Pass, Sweep

CLOSED_MM = 1e-4  # 0.1 um
BRUTE_MM = 1e-3

UNTWISTED: list[tuple[Surface, str]] = [
    (
        RuledSurface(Line((0.0, 0.0, 20.0), (30.0, 5.0, 20.0)), Line((0.0, 0.0, 0.0), (30.0, 5.0, 0.0))),
        "plane",
    ),
    (
        RuledSurface(Line((3.0, 8.0, 20.0), (33.0, 8.0, 20.0)), Line((0.0, 0.0, 0.0), (30.0, 0.0, 0.0))),
        "leaning",
    ),
    (example_1(), "the paper's cone"),
    (Cone((12.0, 0.0, 1.0), (0.0, 0.0, 1.0), 14.0, 0.0, -2.0), "a cone with a tip"),
    (Cone((9.0, 0.0, 0.0), (0.0, 0.0, 0.0), 10.0, 9.0, 7.5), "a cylinder, more than a turn"),
]


def cut(one: Nominal, along: int, across: int, step: float = 0.0) -> np.ndarray:
    _, _, points, normals = places(one, along, across)
    return deviation(points, normals, sweep(one, step), cutter(one.tool)).t


@pytest.mark.parametrize("surface", [s for s, _ in UNTWISTED], ids=[name for _, name in UNTWISTED])
def test_what_is_not_twisted_is_cut_exactly(surface: Surface) -> None:
    side = -1.0 if isinstance(surface, Cone) and surface.sweep_rad < 0.0 else 1.0  # the outside
    t = cut(nominal(surface, side), 41, 9)
    assert not np.isnan(t).any()
    assert np.abs(t).max() < CLOSED_MM


SLOPE, LENGTH, HEIGHT, RADIUS = 0.03, 24.0, 18.0, 3.0


def paraboloid() -> Nominal:
    """y = SLOPE x z over -12 <= x <= 12, 0 <= z <= 18, cut from the side of negative y."""
    half = 0.5 * LENGTH
    upper = Line((-half, -SLOPE * half * HEIGHT, HEIGHT), (half, SLOPE * half * HEIGHT, HEIGHT))
    return nominal(RuledSurface(upper, Line((-half, 0.0, 0.0), (half, 0.0, 0.0))))


def off_the_axes(point: np.ndarray) -> float:
    """Distance to the nearest axis: every axis lies in a plane of its own x, at RADIUS from its ruling."""

    def square(x: float) -> float:
        in_plane = (point[1] - SLOPE * x * point[2]) / math.hypot(1.0, SLOPE * x) + RADIUS
        return float((x - point[0]) ** 2 + in_plane**2)

    around = (point[0] - 3.0, point[0] + 3.0)
    return math.sqrt(minimize_scalar(square, bounds=around, method="bounded", options={"xatol": 1e-10}).fun)


def test_a_hyperbolic_paraboloid_comes_out_as_its_known_envelope() -> None:
    one = paraboloid()
    _, _, points, normals = places(one, 9, 7, (0.2, 0.8))
    body = cutter(one.tool)
    t = deviation(points, normals, sweep(one), body).t
    assert nearest(points, sweep(one), body).distance == pytest.approx(
        [off_the_axes(p) - RADIUS for p in points], abs=CLOSED_MM
    )
    for p, n, told in zip(points, normals, t, strict=True):
        # From above into the tool: a twisted surface is cut too deep, and never too little.
        right = brentq(lambda t, p=p, n=n: off_the_axes(p + t * n) - RADIUS, -2.0, 1e-7)
        assert told == pytest.approx(right, abs=CLOSED_MM)
    assert t.min() < -0.1, "the twist is worth tenths here"


def random_surface(seed: int) -> Surface:
    upper, lower = compound(seed, 1)[0]
    curves = (Bezier(tuple(tuple(map(float, p)) for p in points)) for points in (upper, lower))
    return RuledSurface(*curves)


@pytest.mark.parametrize("seed", range(3))
def test_unseen_surfaces_agree_with_brute_force(seed: int) -> None:
    """Half of the step that is used otherwise, and twelve thousand times as plain."""
    tool = Tool(1, "end mill", (1.0, 1.5, 3.0)[seed % 3], 0.0, 15.0)
    one = nominal(random_surface(seed), -1.0 if seed % 2 else 1.0, tool)
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0.02, 0.98, 60), rng.uniform(0.0, 1.0, 60)
    points, normals = one.points(u, v), one.normals(u, v)
    body = cutter(tool)
    t = deviation(points, normals, sweep(one), body).t
    assert t == pytest.approx(by_brute_force(one, points, normals), abs=BRUTE_MM), f"seed {seed}"


SHAPES = {
    "taper": Tool(1, "taper", 1.5, 0.0, 20.0, taper_rad=math.radians(4.0)),
    "ball": Tool(1, "ball", 2.0, 0.0, 20.0, corner_mm=2.0),
    "bull nose": Tool(1, "bull nose", 3.0, 0.0, 20.0, corner_mm=0.7),
    "tapered ball": Tool(1, "tapered ball", 1.0, 0.0, 20.0, corner_mm=1.0, taper_rad=math.radians(7.0)),
    "tapered bull nose": Tool(1, "bull", 2.0, 0.0, 20.0, corner_mm=0.5, taper_rad=math.radians(2.0)),
    "barrel": Tool(1, "barrel", 2.0, 0.0, 20.0, corner_mm=0.5, barrel_mm=120.0),
    "conical barrel": Tool(1, "cone", 1.5, 0.0, 20.0, corner_mm=1.5, taper_rad=0.1, barrel_mm=85.0),
    "lens": Tool(1, "lens", 2.0, 0.0, 20.0, corner_mm=0.3, end_mm=6.0),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", [21])
def test_cutters_of_every_shape_agree_with_brute_force_on_unseen_surfaces(shape: str, seed: int) -> None:
    """Set beside the ruling, and hung on two points of the surface; both sides."""
    tool, side = SHAPES[shape], -1.0 if seed % 2 else 1.0
    plain = as_the_paper(random_surface(seed), Cutter.of(tool, side))
    hung = replace(plain, points_v=(0.25, 0.7), normals_v=(0.25, 0.7))
    for placed in (plain, hung):
        one = nominal(placed, side, tool)
        rng = np.random.default_rng(seed)
        u, v = rng.uniform(0.05, 0.95, 12), rng.uniform(0.0, 1.0, 12)
        points, normals = one.points(u, v), one.normals(u, v)
        t = deviation(points, normals, sweep(one), cutter(tool)).t
        assert t == pytest.approx(body_by_brute_force(one, points, normals), abs=BRUTE_MM), placed


@pytest.mark.parametrize("seed", range(3))
def test_no_pose_that_is_nearest_is_left_out_by_the_bounds(seed: int) -> None:
    """Wild poses, passes of few samples, points on axes, above the tool and far away."""
    rng = np.random.default_rng(seed)
    passes = []
    for k, count in enumerate((1, 2, 4, 33, 300)):
        tips, axes = rng.uniform(-20.0, 20.0, (count, 3)), rng.normal(size=(count, 3))
        axes /= np.linalg.norm(axes, axis=1)[:, None]
        passes.append(Pass(np.arange(float(count)), tips, axes, k, "line"))
    body = cutter(list(SHAPES.values())[seed])
    poses = Sweep(passes, body.top_mm)
    on_axes = poses.tips + rng.uniform(-10.0, 40.0, (len(poses), 1)) * poses.axes
    points = np.vstack([rng.uniform(-60.0, 60.0, (300, 3)), on_axes])
    away = points[:, None] - poses.tips
    h = (away * poses.axes).sum(axis=2)
    rho = np.sqrt(np.maximum((away * away).sum(axis=2) - h * h, 0.0))
    least = body.distance(rho, h).min(axis=1)
    for start in range(0, len(points), 50):
        some = slice(start, start + 50)
        assert _best_sample(points[some], poses, body)[0] == pytest.approx(least[some], abs=1e-6)


def test_half_the_step_changes_nothing() -> None:
    one = nominal(random_surface(11))
    assert cut(one, 33, 9, 0.02) == pytest.approx(cut(one, 33, 9, 0.04), abs=CLOSED_MM)


@pytest.mark.parametrize(
    ("which", "side", "overcut"), [(0, 1.0, 0.1827), (1, 1.0, 0.3126), (0, -1.0, 0.0282)]
)
def test_the_papers_second_example_is_overcut_as_the_design_says(
    which: int, side: float, overcut: float
) -> None:
    t = cut(nominal(example_2()[which], side), 193, 9)
    assert -np.nanmin(t) == pytest.approx(overcut, abs=5e-4)
    assert np.nanmax(t) < CLOSED_MM, "a cylinder along the rulings leaves nothing"


def test_what_no_tool_comes_to_is_left() -> None:
    one = paraboloid()
    whole = sweep(one).passes[0]
    half = Sweep([type(whole)(whole.s[:200], whole.tips[:200], whole.axes[:200], 1, "cut", 0)], 30.0)
    _, _, points, normals = places(one, 21, 3)
    found = deviation(points, normals, half, cutter(one.tool))
    beyond = points[:, 0] - whole.tips[199, 0]
    assert (found.distance[beyond > RADIUS] > 0.0).all()
    assert np.abs(found.t - found.distance)[beyond > RADIUS].max() <= ASIDE_MM + 1e-12
    assert found.t[beyond < -RADIUS].max() < CLOSED_MM


@pytest.mark.parametrize("surface", [s for s, _ in UNTWISTED[:3]] + list(example_2()))
@pytest.mark.parametrize("hair_mm", [6e-4, 3e-3])
def test_a_cutter_that_runs_a_hair_too_high_leaves_no_more_at_the_lower_edge(
    surface: Surface, hair_mm: float
) -> None:
    """A line along the normal of the edge then runs below the cutter, and meets it far off or nowhere."""
    one = nominal(surface)
    low = sweep(one).passes[0]
    high = Sweep([replace(low, tips=low.tips + hair_mm * low.axes)], 30.0)
    _, v, points, normals = places(one, 41, 9)
    t = deviation(points, normals, high, cutter(one.tool)).t
    assert not np.isnan(t).any()
    assert t.max() <= 2.0 * hair_mm + 1e-9
    assert (t[v == 1.0] > 0.0).all(), "what is left is told"


def test_a_sweep_without_a_pose_is_infinitely_far() -> None:
    found = nearest(np.zeros((3, 3)), Sweep([], 10.0), cutter(Tool(1, "x", 1.0, 0.0, 5.0)))
    assert np.isinf(found.distance).all()


def test_a_ball_along_a_line_leaves_its_trough() -> None:
    """A ball end with its centre on a line: a tube, whose distance is plain."""
    tool = Tool(1, "ball", 2.0, 0.0, 15.0, corner_mm=2.0)
    one = nominal(UNTWISTED[0][0], 1.0, tool)
    poses = sweep(one).passes[0]
    tube = Sweep([poses], 20.0)
    rng = np.random.default_rng(3)
    points = rng.uniform((5.0, -3.0, -3.0), (25.0, 3.0, 1.0), (50, 3))
    found = nearest(points, tube, cutter(tool))
    start, way = poses.tips[0] + [0.0, 0.0, 2.0], np.array([30.0, 5.0, 0.0]) / math.hypot(30.0, 5.0)
    away = points - start
    along = away @ way
    across = away - along[:, None] * way
    below = across[:, 2] < 0.0
    expected = np.linalg.norm(across, axis=1) - 2.0
    assert found.distance[below] == pytest.approx(expected[below], abs=1e-6)
