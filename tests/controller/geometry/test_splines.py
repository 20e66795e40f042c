"""B-splines against scipy's, exact at both ends, in any form of the parameter; and their differences."""

import math
import pickle
import random

import numpy as np
import pytest
from scipy.interpolate import BSpline as Reference

from controller.geometry import arc_length
from controller.geometry import series as jets
from controller.geometry.curves import Arc, Bezier, Curve, Line, Polynomial
from controller.geometry.defects import hull
from controller.geometry.rulings import difference, smooth_parts
from controller.geometry.splines import BadSpline, BSpline
from controller.geometry.vectors import norm, subtract

ROOT = math.sqrt(0.5)
QUARTER = BSpline.of(3, (0, 0, 0, 1, 1, 1), ((5.0, 0.0, 0.0), (5.0, 5.0, 0.0), (0.0, 5.0, 0.0)), (1, ROOT, 1))


def made(seed: int, order: int, count: int, rational: bool = False, times: int = 1):
    """(curve, knots, points, weights) with every inner knot standing ``times`` times."""
    rng = random.Random(seed)
    inner = (
        [float(k // times + rng.choice((0.0, 0.0, 0.3))) for k in range(count - order)] if times == 1 else []
    )
    inner = inner or [float(k // times) for k in range(count - order)]
    knots = [-1.5] * order + sorted(inner) + [max([0.0, *inner]) + 2.0] * order
    points = [(10.0 * k + rng.uniform(-4, 4), rng.uniform(0, 30), rng.uniform(0, 5)) for k in range(count)]
    weights = [rng.uniform(0.4, 2.5) for _ in points] if rational else [1.0] * count
    return BSpline.of(order, knots, points, weights), knots, points, weights


def reference(knots, points, weights, order, u, derivative=0):
    """The curve or its derivative in u by scipy, rational by the quotient rule through series."""
    t = np.array(knots, dtype=float)
    x = t[0] + (t[-1] - t[0]) * np.asarray(u)
    w = np.array(weights)
    rows = np.column_stack([np.array(points) * w[:, None], w])
    spline = Reference(t, rows, order - 1)
    series = [spline(x, k) * (t[-1] - t[0]) ** k / math.factorial(k) for k in range(4)]
    stacked = np.array(series)
    bottom = jets.Jet(stacked[:, :, 3])
    return np.array([(jets.Jet(stacked[:, :, c]) / bottom).derivative(derivative) for c in range(3)]).T


CASES = [
    (order, count, rational)
    for order in (2, 3, 4, 5, 6, 8)
    for count in (order, order + 5)
    for rational in (0, 1)
]


@pytest.mark.parametrize(("order", "count", "rational"), CASES)
def test_points_and_three_derivatives_are_those_of_scipy(order, count, rational):
    curve, knots, points, weights = made(order * count, order, count, bool(rational))
    rng = np.random.default_rng(7)
    u = np.sort(np.concatenate([[0.0, 1.0], rng.uniform(0.0, 1.0, 40)]))
    u = u[np.abs(u[:, None] - np.array([*curve.breaks[1:-1], 2.0])).min(axis=1) > 1e-6]
    for k in range(4):
        wanted = reference(knots, points, weights, order, u, k)
        if k == 0:
            found = np.array([curve.at(float(x)) for x in u])
        else:
            found = np.array([curve.derivative(float(x), k) for x in u])
            columns = [np.broadcast_to(c, u.shape) for c in curve.derivative(u, k, np)]
            np.testing.assert_allclose(np.array(columns).T, found, rtol=1e-12, atol=1e-9)
        size = 1.0 + np.abs(wanted).max()
        np.testing.assert_allclose(found / size, wanted / size, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(
    "curve", [QUARTER, made(3, 4, 9)[0], made(4, 5, 8, True)[0]], ids=["arc", "cubic", "quartic"]
)
def test_series_give_the_derivatives_that_the_curve_states(curve):
    u = np.array([0.0, 0.21, 0.5, 0.77, 1.0])
    for lower in (0, 1):
        value = curve.derivative(jets.variable(u), 1, jets) if lower else curve.at(jets.variable(u), jets)
        for order in range(4 - lower):
            for component, stated in zip(value, curve.derivative(u, order + lower, np), strict=True):
                found = np.broadcast_to(jets.jet(component).derivative(order), u.shape)
                np.testing.assert_allclose(found, np.broadcast_to(stated, u.shape), rtol=1e-9, atol=1e-7)


def test_the_ends_are_the_first_and_the_last_control_point_to_the_last_bit():
    for seed, (order, count, rational) in enumerate(CASES):
        curve, _, points, _ = made(seed, order, count, bool(rational))
        assert curve.at(0.0) == pytest.approx(points[0], abs=1e-14)
        assert curve.at(1.0) == pytest.approx(points[-1], abs=1e-13)


def test_next_to_both_ends_small_parts_keep_their_relative_precision():
    knots = (0, 0, 0, 0, 1, 2, 2, 2, 2)
    falling = BSpline.of(4, knots, ((1, 0, 0), (2, 0.5, 0), (3, 1, 0), (2, 1, 0), (0, 1, 0)))
    per = abs(falling.derivative(1.0)[0])
    for tiny in (1e-6, 1e-11, 2.0**-50):
        u = 1.0 - tiny
        assert falling.at(u)[0] == pytest.approx(per * (1.0 - u), rel=5.0 * tiny + 1e-14)
        assert falling.at(tiny)[1] == pytest.approx(falling.derivative(0.0)[1] * tiny, rel=5.0 * tiny + 1e-14)


def test_a_spline_without_inner_knots_and_weights_is_its_bezier():
    points = ((0.0, 0.0, 0.0), (1.0, 5.0, 2.0), (7.0, -3.0, 1.0), (9.0, 4.0, 6.0))
    spline = BSpline.of(4, (3, 3, 3, 3, 7, 7, 7, 7), points, (2.0,) * 4)
    assert spline.weights == ()
    assert spline.between(0.0, 1.0) == Bezier(points)


def test_a_rational_quadratic_is_a_circle_and_its_length_the_arc():
    u = np.linspace(0.0, 1.0, 33)
    assert np.allclose(norm(QUARTER.at(u, np), np), 5.0, rtol=0.0, atol=1e-14)
    assert arc_length.of(QUARTER).length_mm == pytest.approx(2.5 * math.pi, abs=1e-12)


def test_a_part_of_a_curve_is_that_curve_there():
    curve, *_ = made(11, 4, 9, True)
    a, b = curve.breaks[1], 0.5 * (curve.breaks[3] + curve.breaks[4])
    part = curve.between(a, b)
    for t in (0.0, 0.3, 0.77, 1.0):
        assert part.at(t) == pytest.approx(curve.at(a + (b - a) * t), abs=1e-12)


def test_equal_steps_of_length_run_evenly_over_all_knots():
    curve, *_ = made(5, 4, 12)
    arc = arc_length.of(curve)
    s = np.linspace(0.0, arc.length_mm, 3001)
    assert np.max(np.abs(arc_length.s_at(arc, arc.u_along(s)) - s)) <= 1e-11 * arc.length_mm
    assert set(curve.breaks) <= set(arc.knots_u)


CURVES = {
    "cubic": made(1, 4, 9)[0],
    "quartic of other knots": made(2, 5, 7)[0],
    "rational": made(3, 4, 6, True)[0],
    "arc": QUARTER,
    "Bezier": Bezier(((0.0, 0.0, 0.0), (1.0, 5.0, 2.0), (9.0, 4.0, 6.0))),
    "line": Line((1.0, 2.0, 3.0), (4.0, 6.0, 3.0)),
}


@pytest.mark.parametrize("upper", CURVES)
@pytest.mark.parametrize("lower", CURVES)
def test_the_difference_of_any_two_is_made_of_differences_of_points(upper, lower):
    a, b = CURVES[upper], CURVES[lower]
    gap = difference(a, b)
    assert isinstance(gap, (Bezier, BSpline))
    for u in (0.0, 0.1, 0.49, 0.93, 1.0):
        assert gap.at(u) == pytest.approx(subtract(a.at(u), b.at(u)), abs=1e-12)
        assert gap.derivative(u) == pytest.approx(
            subtract(a.derivative(u), b.derivative(u)), rel=1e-10, abs=1e-9
        )


def test_a_ruling_that_stands_upright_at_an_end_does_so_exactly():
    upper = BSpline.of(
        4, (0, 0, 0, 0, 2, 3, 3, 3, 3), ((1.1, 0.3, 9), (2, 2, 9), (3, 1, 9), (4, 0, 9), (7.7, 0.1, 9))
    )
    lower = BSpline.of(3, (0, 0, 0, 1, 1, 1), ((1.1, 0.3, 0), (4, 3, 0), (7.7, 0.1, 0)), (1, 0.7, 1))
    gap = difference(upper, lower)
    assert gap.at(0.0)[:2] == (0.0, 0.0)
    assert gap.at(1.0)[:2] == (0.0, 0.0)


def test_a_circle_stays_without_a_common_form_with_an_arc():
    arc = Arc((0.0, 0.0, 1.0), (5.0, 0.0, 0.0), (0.0, 5.0, 0.0), 1.0)
    assert difference(QUARTER, arc).at(0.0) == (0.0, 0.0, -1.0)


def test_parts_end_at_the_knots_where_the_joints_would_jump():
    cubic, quintic = made(1, 4, 7)[0], made(1, 6, 9)[0]
    double = made(1, 4, 8, times=2)[0]
    assert list(smooth_parts(cubic, quintic)) == [(0.0, 1.0)]
    assert [a for a, _ in smooth_parts(quintic, cubic)] == list(cubic.breaks[:-1])
    assert [a for a, _ in smooth_parts(double, quintic)] == list(double.breaks[:-1])


def test_a_spline_survives_pickling():
    curve, *_ = made(3, 4, 6, True)
    again = pickle.loads(pickle.dumps(curve))
    assert again == curve and again.at(0.3) == curve.at(0.3)


P = tuple((float(k), float(k * k), 0.0) for k in range(6))
REFUSED = [
    (1, (0, 1), P[:1], (), "order", "the order is 1: it is 2 to 8"),
    (9, (0,) * 9 + (1,) * 9, P * 2, (), "order", "the order is 9"),
    (4, (0, 0, 0, 1, 1, 1), P[:3], (), "points", "3 control points are too few: order 4 takes 4 or more"),
    (4, (0, 0, 0, 0, 1, 1, 1), P[:4], (), "knots", "4 points of order 4 take 8 knots, found 7"),
    (4, (0, 0, 0, 0, 2, 1, 3, 3, 3, 3), P, (), "knots", "the knots fall from 2 to 1"),
    (4, (0, 0, 0, 1, 2, 3, 3, 3, 3, 3), P, (), "knots", "the first knot 0 stands 3 times"),
    (4, (0, 0, 0, 0, 1, 2, 3, 3, 3, 4), P, (), "knots", "the last knot 4 stands 1 times"),
    (
        2,
        (0, 0, 1, 1, 2, 3, 4, 4),
        P,
        (),
        "knots",
        "the inner knot 1 stands 2 times: order 2 takes it 1 times",
    ),
    (4, (0,) * 8, P[:4], (), "knots", "all knots are 0"),
    (4, (0, 0, 0, 0, 1, 1.0 + 1e-9, 3, 3, 3, 3), P, (), "knots", "too near to be two"),
    (4, (0, 0, 0, 0, 1, 1, 1, 1), P[:4], (1, 0, 1, 1), "weights", "the weight is 0"),
    (4, (0, 0, 0, 0, 1, 1, 1, 1), P[:4], (1, 1, -2, 1), "weights", "the weight is -2"),
    (4, (0, 0, 0, 0, 1, 1, 1, 1), P[:4], (1, 1), "weights", "4 points take 4 weights, found 2"),
]


@pytest.mark.parametrize(("order", "knots", "points", "weights", "what", "sentence"), REFUSED)
def test_what_makes_no_curve_is_refused_with_a_sentence(order, knots, points, weights, what, sentence):
    with pytest.raises(BadSpline, match=sentence) as refused:
        BSpline.of(order, knots, points, weights)
    assert refused.value.what == what


# Hulls of curves: no point of a curve lies outside, seen along any direction.

U = np.linspace(0.0, 1.0, 501)


def points(rng: np.random.Generator, count: int) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in rng.normal(size=(count, 3)))


def curves(seed: int) -> list[Curve]:
    rng = np.random.default_rng(seed)
    knots = [0.0] * 4 + [0.3, 0.6] + [1.0] * 4
    radius, turn = rng.uniform(0.5, 3.0), rng.uniform(-9.0, 9.0)
    return [
        Bezier(points(rng, 4)),
        Bezier(points(rng, 7)),
        Line(*points(rng, 2)),
        Arc(points(rng, 1)[0], (radius, 0.0, 0.0), (0.0, radius, 0.0), turn, (0.0, 0.0, 2.0)),
        BSpline.of(4, knots, points(rng, 6)),
        BSpline.of(4, knots, points(rng, 6), rng.uniform(0.2, 4.0, 6).tolist()),
    ]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("order", [0, 1])
def test_no_point_of_a_curve_is_outside_of_its_hull(seed: int, order: int) -> None:
    ways = np.random.default_rng(seed + 100).normal(size=(40, 3))
    for curve in curves(seed):
        held = hull(curve, order)
        if isinstance(curve, BSpline) and order:
            assert held is None
            continue
        assert held is not None
        found = curve.derivative(U, 1, np) if order else curve.at(U, np)
        along = ways @ np.stack([np.broadcast_to(c, U.shape) for c in found])
        assert (along.min(axis=1) >= (ways @ held.T).min(axis=1) - 1e-9).all()


def test_of_other_curves_nothing_is_known() -> None:
    assert hull(Polynomial(((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)))) is None
