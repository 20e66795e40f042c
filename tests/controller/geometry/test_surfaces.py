"""Poses along ruled surfaces, and the audits that refuse a surface."""

import math
import pickle
import random
import warnings

import numpy as np
import pytest
from support.parts.paper_surfaces import equation_7, example_1, example_2

from controller.geometry import series as jets
from controller.geometry.curves import Bezier, Line, Polynomial
from controller.geometry.defects import Defect, DefectKind, concave_radius, defect, turned
from controller.geometry.splines import BSpline
from controller.geometry.surfaces import Cone, RuledSurface, Surface
from controller.geometry.vectors import add, angle_between, cross, dot, norm, scale, subtract, unit

SURFACES: dict[str, Surface] = {
    "Eq. 7": equation_7(),
    "Example 1": example_1(),
    "Example 2, first": example_2()[0],
    "Example 2, second": example_2()[1],
    "clockwise cone": Cone((3.0, 4.0, 1.0), (0.0, 0.0, 1.0), 6.0, 9.0, -8.0),
    "mixed": RuledSurface(
        Line((0.0, 0.0, 9.0), (30.0, 5.0, 12.0)),
        Polynomial(((0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (0.0, 6.0, 0.0))),
    ),
}
each_surface = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES.keys())


def bezier(*points):
    return Bezier(tuple(tuple(map(float, p)) for p in points))


@each_surface
def test_the_pose_is_equations_4_5_and_8_with_the_axis_up(surface):
    for u in (0.1, 0.35, 0.8):
        contact, top, along = surface.lower.at(u), surface.upper.at(u), surface.lower.derivative(u)
        normal = unit(cross(subtract(contact, top), along))
        tip, axis = surface.pose(u, 3.0)
        assert tip == pytest.approx(add(contact, scale(normal, 3.0)), abs=1e-12)
        assert axis == pytest.approx(unit(subtract(top, contact)), abs=1e-14)
        assert surface.normal(u) == pytest.approx(normal, abs=1e-13)
        assert surface.axis(u) == pytest.approx(axis, abs=1e-15)
        assert surface.contact(u) == contact


@each_surface
def test_the_cutter_stands_to_the_right_of_the_travel(surface):
    to_the_right = cross(surface.lower.derivative(0.5), surface.axis(0.5))
    assert dot(surface.normal(0.5), to_the_right) > 0.0


@each_surface
def test_floats_arrays_and_series_give_the_same_pose(surface):
    u = np.linspace(0.02, 0.98, 9)
    many = surface.pose(u, -1.5, np)
    series = surface.pose(jets.variable(u), -1.5, jets)
    for i, x in enumerate(u):
        one = surface.pose(float(x), -1.5)
        for vector, column, jet in zip(one, many, series, strict=True):
            assert [np.broadcast_to(c, u.shape)[i] for c in column] == pytest.approx(vector, abs=1e-13)
            assert [c.c[0][i] for c in map(jets.jet, jet)] == pytest.approx(vector, abs=1e-13)


@each_surface
def test_the_axis_rate_is_the_derivative_of_the_axis(surface):
    u = 0.3
    series = [jets.jet(c) for c in surface.axis(jets.variable(u), jets)]
    assert surface.axis_rate(u) == pytest.approx([float(c.derivative(1)) for c in series], abs=1e-12)


@each_surface
def test_the_papers_surfaces_can_be_cut_and_survive_pickling(surface):
    assert defect(surface) is None
    again = pickle.loads(pickle.dumps(surface))
    assert again == surface and again.pose(0.4, 1.0) == surface.pose(0.4, 1.0)


@each_surface
def test_a_point_between_the_directrices_lies_on_the_ruling(surface):
    middle = surface.point(0.4, 0.25)
    assert middle == pytest.approx(
        subtract(surface.upper.at(0.4), scale(surface.ruling(0.4), 0.25)), abs=1e-13
    )


def test_a_cone_lies_on_its_circles_and_turns_by_its_sign():
    cone = SURFACES["clockwise cone"]
    u = np.linspace(0.0, 1.0, 33)
    for curve, radius, height in ((cone.lower, 5.0, 1.0), (cone.upper, 9.0, 7.0)):
        x, y, z = curve.at(u, np)
        np.testing.assert_allclose(np.hypot(x, y), radius, atol=1e-14)
        np.testing.assert_allclose(z, height)
    assert cone.contact(0.0) == (3.0, 4.0, 1.0)
    assert cross(cone.contact(0.0), cone.lower.derivative(0.0))[2] < 0.0  # clockwise


def test_the_tilt_keeps_its_direction_down_to_the_pole():
    for turn in (0.0, 37.0):
        surface = example_2(turn)[1]
        limit = surface.axis_rate(1.0)
        limit_rad = math.atan2(-limit[1], -limit[0])
        for short in (1e-3, 1e-6, 1e-9, 1e-12):
            x, y, _ = surface.axis(1.0 - short)
            assert math.atan2(y, x) == pytest.approx(limit_rad, abs=3.0 * short + 1e-14)


def test_an_axis_that_leaves_its_pole_in_the_second_order_still_has_a_direction():
    lower = ((0, 0, 0), (10, 0, 0), (20, 3, 0), (30, 0, 0))
    start = RuledSurface(bezier((0, 0, 9), (10, 0, 9), (21, 5, 9), (32, 0, 9)), bezier(*lower))
    ahead = subtract(start.axis(1e-5), start.axis(0.0))
    assert angle_between(start.axis_rate(0.0), ahead) < 1e-4
    end = RuledSurface(Bezier(start.upper.points[::-1]), Bezier(start.lower.points[::-1]))
    behind = subtract(end.axis(1.0 - 1e-5), end.axis(1.0))
    assert angle_between(scale(end.axis_rate(1.0), -1.0), behind) < 1e-4


def test_a_cylinders_axis_does_not_turn():
    cylinder = Cone((5.0, 0.0, 0.0), (0.0, 0.0, 0.0), 10.0, 5.0, 2.0)
    assert norm(cylinder.axis_rate(0.0)) < 1e-12
    assert defect(cylinder) is None


@pytest.mark.parametrize("u", [0.0, 1.0])
def test_where_c1_stands_still_at_an_end_the_normal_is_the_limit_from_inside(u):
    lower, upper = (
        ((0, 0, 0), (0, 0, 0), (20, 9, 0), (30, 0, 0)),
        ((0, 0, 9), (9, 1, 9), (20, 9, 9), (30, 0, 9)),
    )
    if u == 1.0:
        lower, upper = lower[::-1], upper[::-1]
    surface = RuledSurface(bezier(*upper), bezier(*lower))
    inside = surface.normal(abs(u - 1e-9))
    assert angle_between(surface.normal(u), inside) < 1e-7
    assert surface.pose(u, 2.0).tip == pytest.approx(add(surface.contact(u), scale(inside, 2.0)), abs=1e-6)
    many = np.array(surface.normal(np.array([0.0, 0.5, 1.0]), np))
    assert many[:, int(2 * u)] == pytest.approx(surface.normal(u), abs=1e-15)
    assert defect(surface) is None


STRAIGHT = ((0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0))
HIGH = ((0, 0, 9), (10, 0, 9), (20, 0, 9), (30, 0, 9))
CUSP = ((0, 0, 0), (30, 20, 0), (0, 20, 0), (30, 0, 0))  # C1' = 0 at u = 1/2
BAD = [
    ("the same curve twice", STRAIGHT, STRAIGHT, DefectKind.COINCIDENT, None),
    (
        "meeting inside",
        ((0, 0, 9), (10, 0, 3), (20, 0, -3), (30, 0, -9)),
        STRAIGHT,
        DefectKind.ZERO_RULING_INSIDE,
        0.5,
    ),
    (
        "meeting at the start",
        ((0, 0, 0), (10, 0, 9), (20, 0, 9), (30, 0, 9)),
        STRAIGHT,
        DefectKind.ZERO_RULING_END,
        0.0,
    ),
    (
        "meeting at the end",
        ((0, 0, 9), (10, 0, 9), (20, 0, 9), (30, 0, 0)),
        STRAIGHT,
        DefectKind.ZERO_RULING_END,
        1.0,
    ),
    ("a cusp in C1", ((0, 0, 9), (10, 20, 9), (20, 20, 9), (30, 0, 9)), CUSP, DefectKind.STANDSTILL, 0.5),
    ("C0 run backwards", HIGH[::-1], STRAIGHT, DefectKind.FOLD, None),
    (
        "C0 turning back half way",
        ((0, 0, 9), (40, 0, 9), (-10, 0, 9), (30, 0, 9)),
        STRAIGHT,
        DefectKind.FOLD,
        None,
    ),
    ("a ruling along C1", ((15, 0, 0), (25, 0, 1), (35, 0, 2), (45, 0, 3)), STRAIGHT, DefectKind.FOLD, 0.0),
    (
        "crossing at other parameters",
        ((0, -8, 2), (9, -4, 1), (19, 4, -1), (24, 8, -2)),
        STRAIGHT,
        DefectKind.CROSSING,
        None,
    ),
]


@pytest.mark.parametrize(("name", "upper", "lower", "kind", "u"), BAD, ids=[row[0] for row in BAD])
def test_a_surface_that_cannot_be_cut_is_named_with_its_place(name, upper, lower, kind, u):
    found = defect(RuledSurface(bezier(*upper), bezier(*lower)))
    assert isinstance(found, Defect) and found.kind is kind
    if u is not None:
        assert found.u == pytest.approx(u, abs=1e-6)
    if kind is DefectKind.FOLD:
        assert 0.0 <= found.v <= 1.0


@pytest.mark.parametrize("turn_deg", [60.0, 89.0, 91.0, 120.0, 170.0])
def test_a_normal_that_turns_by_more_than_90_degrees_is_told_with_its_angle(turn_deg):
    """A saddle: along the middle ruling the normal turns by the angle between both straight directrices."""
    c, s = (20.0 * f(math.radians(0.5 * turn_deg)) for f in (math.cos, math.sin))
    upper, lower = (
        Bezier(tuple((x * c, y * x * s, z) for x in (-1.0, -1 / 3, 1 / 3, 1.0))) for y, z in EDGES
    )
    found = defect(RuledSurface(upper, lower))
    angle, u = turned(RuledSurface(upper, lower))
    assert (math.degrees(angle), u) == (pytest.approx(turn_deg), pytest.approx(0.5, abs=1e-5))
    if turn_deg < 90.0:
        assert found is None
    else:
        assert found.kind is DefectKind.TWIST and found.turn_deg == pytest.approx(turn_deg, abs=1e-6)


EDGES = ((1.0, 25.0), (-1.0, 0.0))  # sign of Y, and Z
LEGAL_CONES = [
    ("a tip", Cone((5.0, 0.0, 0.0), (0.0, 0.0, 0.0), 8.0, 0.0, 3.0)),
    ("a cylinder", Cone((5.0, 0.0, 0.0), (0.0, 0.0, 0.0), 8.0, 5.0, -3.0)),
    ("an undercut", Cone((5.0, 0.0, 0.0), (0.0, 0.0, 0.0), 8.0, 25.0, 3.0)),
    ("three turns", Cone((5.0, 0.0, 0.0), (0.0, 0.0, 0.0), 8.0, 2.0, 20.0)),
]


@pytest.mark.parametrize(("name", "cone"), LEGAL_CONES, ids=[row[0] for row in LEGAL_CONES])
def test_cones_that_look_odd_are_legal(name, cone):
    assert defect(cone) is None


def test_a_cone_without_bottom_radius_is_refused():
    with pytest.raises(ValueError, match="no radius"):
        Cone((1.0, 2.0, 0.0), (1.0, 2.0, 0.0), 8.0, 5.0, 1.0)


def test_the_concave_radius_of_a_cone_is_that_of_its_section_across_the_ruling():
    cone = example_1()
    slant = math.hypot(10.0, 5.0) / 10.0  # 1 / cosine of the half angle
    assert concave_radius(cone, 1.0)[0] == math.inf  # Eq. 5's side of Example 1 is outside
    assert concave_radius(cone, -1.0)[0] == pytest.approx(15.0 * slant, rel=1e-12)


def test_a_flat_wall_is_nowhere_concave():
    wall = RuledSurface(bezier(*HIGH), bezier(*STRAIGHT))
    assert concave_radius(wall, 1.0)[0] == math.inf and concave_radius(wall, -1.0)[0] == math.inf


def test_where_c1_stands_still_it_has_no_normal_and_none_is_divided_by():
    """Hostile program 913414: beside its begin C1' is exactly 0, and numpy said so on the terminal."""
    stands, runs, end = (-0.93, -1.48, 0.0), (6.35, -1.66, 0.0), (6.08, -6.0, 0.0)
    weights = (1.61, 1.0, 1.69, 1.0, 1.67)
    lower = BSpline.of(4, (0, 0, 0, 0, 0.25, 1, 1, 1, 1), (stands, stands, stands, runs, end), weights)
    upper = bezier((-0.9, -1.5, 12.0), (2.0, -0.1, 12.0), (4.0, -1.6, 12.0), (6.1, -6.0, 12.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert concave_radius(RuledSurface(upper, lower), 1.0)[0] >= 0.0


def test_the_concave_radius_agrees_with_a_section_cut_through_the_surface():
    seed = random.randrange(10**6)
    rng = random.Random(seed)
    points = [
        tuple(x + rng.uniform(-2, 2) for x in p) for p in ((0, 0, 0), (10, 8, 0), (20, 8, 0), (30, 0, 0))
    ]
    tops = [(x + rng.uniform(-3, 3), y + rng.uniform(-3, 3), z + 10) for x, y, z in points]
    surface = RuledSurface(bezier(*tops), bezier(*points))
    for side in (1.0, -1.0):
        radius, u = concave_radius(surface, side)
        if math.isinf(radius):
            continue
        curvature = pytest.approx(1.0 / radius, rel=1e-3, abs=1e-7)  # where it is as good as flat
        assert abs(_curvature_at(surface, u)) == curvature, f"seed {seed}"


def _curvature_at(surface, u, h=1e-3):
    """Of the section across the ruling at u; at an end by a parabola through those inside."""
    end = round(u)
    if abs(u - end) > 2.0 * h:
        return _section_curvature(surface, u, h)
    inside = [abs(end - n * h) for n in (1, 2, 3)]
    return np.polyval(np.polyfit(inside, [_section_curvature(surface, x, h) for x in inside], 2), u)


def _section_curvature(surface, u, h):
    """Of the circle through three points of the section by the plane across the ruling at u, with a sign."""
    origin, axis = surface.contact(u), surface.axis(u)
    points = []
    for x in (u - h, u, u + h):
        p, a = surface.contact(x), surface.axis(x)
        points.append(add(p, scale(a, -dot(subtract(p, origin), axis) / dot(a, axis))))
    a, b, c = (
        subtract(p, q) for p, q in ((points[1], points[0]), (points[2], points[1]), (points[2], points[0]))
    )
    return 2.0 * dot(cross(a, b), axis) / (norm(a) * norm(b) * norm(c) * norm(axis))


@pytest.mark.filterwarnings("error")
def test_rates_that_overflow_are_looked_at_in_silence():
    lower = bezier((0, 0, 0), (1e200, 0, 0), (-1e200, 5, 0), (9, 0, 0))
    found = defect(RuledSurface(bezier((0, 0, 9), (3, 0, 9), (6, 0, 9), (9, 0, 9)), lower))
    assert found is None or found.kind in DefectKind
