"""Placed poses: the formulas, against their definitions; and the turn between two of them."""

import math
import pickle
import random

import numpy as np
import pytest
from support.parts.paper_surfaces import example_1, example_2
from support.parts.random_surfaces import compound

from controller.geometry import series as jets
from controller.geometry.curves import Bezier, Line
from controller.geometry.placement import Placed, Turn
from controller.geometry.splines import BSpline
from controller.geometry.surfaces import RuledSurface
from controller.geometry.vectors import add, angle_between, cross, dot, norm, rotate, scale, subtract, unit

PAIR = (0.15, 0.85)


def free():
    """Two curves for an axis, 3 mm off the second surface of Example 2 and no more than about."""
    knots, rng, surface = (0.0,) * 6 + (0.3, 0.7) + (1.0,) * 6, random.Random(5), example_2()[1]
    rails = []
    for v in (0.0, 1.0):
        points = [
            subtract(surface.point(i / 7, v), scale(normal_at(surface, i / 7, v), 3.0)) for i in range(8)
        ]
        points = [tuple(x + rng.uniform(-0.1, 0.1) for x in point) for point in points]
        rails.append(BSpline.of(6, knots, points))
    return rails[0], rails[1]


def normal_at(surface, u, v):
    """Unit normal of S at (u, v) from its directrices: C0 - C1 lies along the ruling."""
    rate = add(scale(surface.upper.derivative(u), 1.0 - v), scale(surface.lower.derivative(u), v))
    return unit(cross(rate, surface.ruling(u)))


PLACED = {
    "double": Placed(example_2()[0], 3.0, PAIR, PAIR),
    "double, left": Placed(example_2()[1], -1.5, PAIR, PAIR),
    "tapered": Placed(example_2()[0], 2.0, taper_rad=0.07),
    "double, tapered, left": Placed(example_2()[1], -2.0, PAIR, PAIR, taper_rad=0.07, shift_mm=0.4),
    "free": Placed(example_2()[1], -3.0, shift_mm=0.4, through=free()),
}
each_placed = pytest.mark.parametrize("placed", PLACED.values(), ids=PLACED.keys())
each_hung = pytest.mark.parametrize("placed", [one for one in PLACED.values() if one.through is None])


def distance_to_axis(point, pose):
    away = subtract(point, pose.tip)
    return norm(subtract(away, scale(pose.axis, dot(away, pose.axis))))


def test_with_both_normals_at_c1_and_no_taper_the_pose_is_the_papers():
    for surface in (*example_2(), example_1()):
        for u in (0.0, 0.2, 0.77, 1.0):
            placed, plain = Placed(surface, -2.5).pose(u, -2.5), surface.pose(u, -2.5)
            assert placed.tip == pytest.approx(plain.tip, abs=1e-12)
            assert placed.axis == pytest.approx(plain.axis, abs=1e-14)


@pytest.mark.parametrize("offset", (3.0, -1.5))
def test_the_axis_of_double_goes_through_both_offset_points(offset):
    surface = example_2()[1]
    placed = Placed(surface, offset, PAIR, PAIR)
    for u in (0.05, 0.4, 0.93):
        pose = placed.pose(u, offset)
        for v in PAIR:
            point = add(surface.point(u, v), scale(normal_at(surface, u, v), offset))
            assert distance_to_axis(point, pose) == pytest.approx(0.0, abs=1e-12)
        assert dot(pose.axis, surface.axis(u)) > 0.99


def test_a_free_axis_goes_through_both_curves_with_its_tip_below_the_lower_one():
    placed = PLACED["free"]
    for u in (0.0, 0.31, 0.9, 1.0):
        pose, (upper, lower) = placed.pose(u, -3.0), (curve.at(u) for curve in placed.through)
        assert distance_to_axis(upper, pose) == pytest.approx(0.0, abs=1e-12)
        assert subtract(lower, pose.tip) == pytest.approx(scale(pose.axis, 0.4), abs=1e-12)
        assert dot(subtract(upper, lower), pose.axis) > 0.0


@each_hung
def test_the_tip_lies_below_the_foot_of_the_contact_by_the_shift(placed):
    for u in (0.1, 0.5, 0.9):
        pose = placed.pose(u, placed.offset_mm)
        height = dot(subtract(placed.contact(u), pose.tip), pose.axis)
        assert height == pytest.approx(placed.shift_mm, abs=1e-12)


@each_placed
def test_floats_arrays_and_series_give_the_same_placed_pose(placed):
    u = np.linspace(0.0, 1.0, 11)
    many = placed.pose(u, placed.offset_mm, np)
    series = placed.pose(jets.variable(u[1:-1]), placed.offset_mm, jets)
    for i, x in enumerate(u):
        one = placed.pose(float(x), placed.offset_mm)
        for vector, column in zip(one, many, strict=True):
            assert [c[i] for c in column] == pytest.approx(vector, abs=1e-12)
        if 0 < i < 10:
            for vector, jet in zip(one, series, strict=True):
                assert [c.c[0][i - 1] for c in jet] == pytest.approx(vector, abs=1e-12)
        assert placed.axis(float(x)) == one.axis


@each_placed
def test_the_rate_of_a_placed_axis_is_its_derivative(placed):
    u = 0.3
    series = placed.axis(jets.variable(u), jets)
    assert placed.axis_rate(u) == pytest.approx([float(c.derivative(1)) for c in series], rel=1e-5, abs=1e-6)


def test_a_tapered_flank_touches_the_whole_ruling_of_a_cone():
    cone, taper, radius = example_1(), 0.1, 2.0
    for side in (1.0, -1.0):
        placed = Placed(cone, side * radius, taper_rad=taper)
        pose = placed.pose(0.3, side * radius)
        for v in (0.0, 0.4, 1.0):
            point = cone.point(0.3, v)
            height = dot(subtract(point, pose.tip), pose.axis)
            assert distance_to_axis(point, pose) == pytest.approx(
                radius + height * math.tan(taper), abs=1e-12
            )


def test_the_flank_of_a_tapered_double_is_tangent_where_it_was_hung():
    surface, taper, radius = example_2()[0], 0.07, 2.0
    placed = Placed(surface, radius, PAIR, PAIR, taper_rad=taper)
    pose = placed.pose(0.6, radius)
    length = norm(surface.ruling(0.6))
    for v in PAIR:
        rho = (radius + (1.0 - v) * length * math.sin(taper)) / math.cos(taper)
        point = add(surface.point(0.6, v), scale(normal_at(surface, 0.6, v), rho))
        assert distance_to_axis(point, pose) == pytest.approx(0.0, abs=1e-12)


def test_a_corner_where_c1_stands_still_at_an_end_is_placed_as_just_inside():
    lower = Bezier(((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (10.0, 3.0, 0.0), (15.0, 0.0, 0.0)))
    for upper in (
        Bezier(((0.0, 1.0, 9.0), (0.0, 1.0, 9.0), (9.0, 5.0, 9.0), (15.0, 2.0, 9.0))),
        Bezier(((0.0, 1.0, 9.0), (4.0, 2.0, 9.0), (9.0, 5.0, 9.0), (15.0, 2.0, 9.0))),
    ):
        placed = Placed(RuledSurface(upper, lower), 2.0, PAIR, PAIR)
        at_end, inside = placed.pose(0.0, 2.0), placed.pose(1e-8, 2.0)
        assert at_end.tip == pytest.approx(inside.tip, abs=1e-5)
        assert at_end.axis == pytest.approx(inside.axis, abs=1e-6)
        array = placed.pose(np.array([0.0, 0.5]), 2.0, np)
        assert [c[0] for c in array.tip] == pytest.approx(at_end.tip, abs=1e-12)


@pytest.mark.parametrize("at", (0.0, 1.0))
@pytest.mark.filterwarnings("error")
def test_where_all_stands_still_to_the_second_order_it_is_placed_as_just_inside(at):
    """Three control points in one: C1 comes to rest there with its third derivative, under an apex."""
    runs = ((9.0, 7.0, 0.0), (-1.0, 2.0, 0.5), (-1.0, 2.0, 0.5), (-1.0, 2.0, 0.5))
    lower = Bezier(runs if at else runs[::-1])
    surface = RuledSurface(Bezier(((2.0, -1.0, 8.0),) * 4), lower)
    placed = Placed(surface, 3.0, PAIR, PAIR)
    end, inside = placed.pose(at, 3.0), placed.pose(abs(at - 1e-4), 3.0)
    assert end.tip == pytest.approx(inside.tip, abs=1e-9) and end.axis == pytest.approx(inside.axis, abs=1e-9)
    many = placed.pose(np.array((0.3, at)), 3.0, np)
    assert [c[1] for c in many.tip] == pytest.approx(end.tip, abs=1e-12)


@each_placed
def test_a_placed_surface_survives_pickling_and_is_the_same_surface_to_all_who_ask(placed):
    again = pickle.loads(pickle.dumps(placed))
    assert again == placed and again.pose(0.4, 1.0) == placed.pose(0.4, 1.0)
    assert placed.point(0.3, 0.6) == placed.base.point(0.3, 0.6)
    assert placed.normal(0.3) == placed.base.normal(0.3)


# ---- the turn between two placements -----------------------------------------------


def turn(angle=0.5):
    first, second = (Placed(surface, -1.5, PAIR, PAIR) for surface in example_2())
    start, end = first.pose(1.0, -1.5), second.pose(0.0, -1.5)
    about = unit(first.ruling(1.0))
    contact = first.contact(1.0)

    def spun(v):
        return rotate(about, angle, v)

    end = type(end)(add(contact, spun(subtract(end.tip, contact))), spun(end.axis))
    return Turn(contact, about, start, end, angle), start, end


@pytest.mark.parametrize("angle", (0.0, 0.5, -1.2))
def test_a_turn_leads_from_one_pose_to_the_other(angle):
    way, start, end = turn(angle)
    for u, pose in ((0.0, start), (1.0, end)):
        found = way.pose(u, 0.0)
        assert found.tip == pytest.approx(pose.tip, abs=1e-12)
        assert found.axis == pytest.approx(pose.axis, abs=1e-12)


def test_the_contact_stands_while_the_tool_turns_about_it():
    way, start, end = turn(0.8)
    reach = [norm(subtract(pose.tip, way.standing)) for pose in (start, end)]
    for u in np.linspace(0.0, 1.0, 21):
        pose = way.pose(float(u), 0.0)
        assert norm(pose.axis) == pytest.approx(1.0, abs=1e-14)
        assert norm(subtract(pose.tip, way.standing)) == pytest.approx(sum(reach) / 2, abs=2e-3)
        assert dot(subtract(way.standing, pose.tip), pose.axis) == pytest.approx(0.0, abs=0.01)
        assert angle_between(pose.axis, way.about) < math.radians(3.0)


def test_a_turn_measures_its_way_and_gives_series():
    way, start, end = turn(0.8)
    assert isinstance(way.lower, Line)
    assert norm(subtract(end.tip, start.tip)) < way.lower.end[0] < 3.0
    u = np.array([0.2, 0.6])
    series = way.pose(jets.variable(u), 0.0, jets)
    for i, x in enumerate(u):
        one = way.pose(float(x), 0.0)
        assert [c.c[0][i] for c in series.tip] == pytest.approx(one.tip, abs=1e-12)


def test_random_surfaces_are_placed_without_a_jump():
    for seed in range(5):
        for upper, lower in compound(seed):
            curves = (Bezier(tuple(map(tuple, c.tolist()))) for c in (upper, lower))
            placed = Placed(RuledSurface(*curves), 2.0, PAIR, PAIR)
            u = np.linspace(0.0, 1.0, 2001)
            tip, axis = (np.array([np.broadcast_to(c, u.shape) for c in v]) for v in placed.pose(u, 2.0, np))
            assert np.isfinite(tip).all() and np.allclose((axis * axis).sum(axis=0), 1.0, atol=1e-13), seed
            assert np.abs(np.diff(tip, axis=1)).max() < 0.2, seed
