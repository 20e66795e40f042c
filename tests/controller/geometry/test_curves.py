"""Curves by value and derivative on floats, arrays and series, and equal steps along them."""

import math
import pickle
import random

import numpy as np
import pytest
from support.parts.paper_surfaces import equation_7, example_1, example_2

from controller.geometry import arc_length
from controller.geometry import series as jets
from controller.geometry.curves import Arc, Bezier, Line, Polynomial
from controller.geometry.rulings import Difference, difference
from controller.geometry.splines import BSpline
from controller.geometry.vectors import norm, subtract

CUBIC = Bezier(((0.0, 0.0, 0.0), (1.0, 5.0, 2.0), (7.0, -3.0, 1.0), (9.0, 4.0, 6.0)))
QUINTIC = Bezier(tuple((float(i), float(i * i % 7), float((3 * i) % 5)) for i in range(6)))
CURVES = {
    "polynomial": Polynomial(((1.0, 2.0, 3.0), (4.0, -5.0, 6.0), (0.5, 0.0, -2.0), (0.1, 3.0, 0.0))),
    "cubic Bezier": CUBIC,
    "quintic Bezier": QUINTIC,
    "straight Bezier": Bezier(((0.0, 0.0, 0.0), (3.0, 4.0, 0.0))),
    "line": Line((1.0, 2.0, 3.0), (4.0, 6.0, 3.0)),
    "helix": Arc((1.0, 2.0, 3.0), (5.0, 0.0, 0.0), (0.0, 5.0, 0.0), -7.0, (0.0, 0.0, 4.0)),
    "difference": Difference(CUBIC, Line((1.0, 2.0, 3.0), (4.0, 6.0, 3.0))),
}
each_curve = pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())


@each_curve
def test_series_give_the_derivatives_that_the_curve_states(curve):
    u = np.array([0.0, 0.2, 0.7, 1.0])
    series = [jets.jet(component) for component in curve.at(jets.variable(u), jets)]
    for order in (1, 2, 3):
        for component, stated in zip(series, curve.derivative(u, order, np), strict=True):
            np.testing.assert_allclose(
                np.broadcast_to(component.derivative(order), u.shape),
                np.broadcast_to(stated, u.shape),
                atol=1e-9,
            )


@each_curve
def test_floats_and_arrays_agree(curve):
    u = np.linspace(0.0, 1.0, 7)
    samples = np.array([np.broadcast_to(c, u.shape) for c in curve.at(u, np)]).T
    np.testing.assert_allclose(samples, [curve.at(float(x)) for x in u], atol=1e-14)


@each_curve
def test_a_curve_survives_pickling(curve):
    assert pickle.loads(pickle.dumps(curve)) == curve


def test_a_bezier_keeps_relative_precision_next_to_a_zero_end():
    falling = Bezier(((3.0, 0.0, 1.0), (2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (0.0, 0.0, 1.0)))
    for tiny in (1e-3, 1e-9, 2.0**-50):
        u = 1.0 - tiny
        tiny = 1.0 - u
        assert falling.at(u)[0] == pytest.approx(3.0 * tiny, rel=1e-14)
        assert falling.at(tiny)[1] == pytest.approx(
            3.0 * tiny * (1 - tiny) ** 2 + 6.0 * tiny**2 * (1 - tiny), rel=1e-14
        )


def test_differences_of_beziers_of_any_degrees_are_beziers_of_differences():
    for upper, lower in ((CUBIC, QUINTIC), (QUINTIC, Line((0.0, 1.0, 2.0), (3.0, 4.0, 5.0)))):
        exact = difference(upper, lower)
        assert isinstance(exact, Bezier)
        for u in (0.0, 0.3, 1.0):
            assert exact.at(u) == pytest.approx(subtract(upper.at(u), lower.at(u)), abs=1e-14)


def test_differences_of_polynomials_of_different_degree_and_of_mixed_kinds():
    long, short = CURVES["polynomial"], Polynomial(((1.0, 1.0, 1.0), (0.0, 2.0, 0.0)))
    for upper, lower in ((long, short), (short, long), (CUBIC, long)):
        assert difference(upper, lower).at(0.4) == pytest.approx(
            subtract(upper.at(0.4), lower.at(0.4)), abs=1e-14
        )


# The lengths the paper's parts must have (DESIGN section 1, slips 1 and 5).
LENGTHS = [
    ("Eq. 7", equation_7().lower, 23.5814),
    ("Example 1", example_1().lower, 94.2478),
    ("Example 2, first", example_2()[0].lower, 50.5115),
    ("Example 2, second", example_2()[1].lower, 36.7618),
]


@pytest.mark.parametrize(("name", "curve", "length"), LENGTHS, ids=[row[0] for row in LENGTHS])
def test_the_papers_curves_have_the_stated_lengths(name, curve, length):
    assert arc_length.of(curve).length_mm == pytest.approx(length, abs=5e-5)


@each_curve
def test_the_parameter_at_a_length_lies_at_that_length(curve):
    arc = arc_length.of(curve)
    s = np.linspace(0.0, arc.length_mm, 1001)
    assert np.max(np.abs(arc_length.s_at(arc, arc.u_along(s)) - s)) <= 1e-11 * max(1.0, arc.length_mm)


@each_curve
def test_one_length_and_many_give_the_same_bits(curve):
    arc = arc_length.of(curve)
    s = np.linspace(-0.1, arc.length_mm + 0.1, 777)
    assert [arc.u_at(float(x)) for x in s] == arc.u_along(s).tolist()


@each_curve
def test_the_ends_are_exact(curve):
    arc = arc_length.of(curve)
    assert (arc.u_at(0.0), arc.u_at(arc.length_mm)) == (0.0, 1.0)
    assert (arc.u_at(-1.0), arc.u_at(arc.length_mm + 1.0)) == (0.0, 1.0)
    assert arc_length.s_at(arc, 1.0) == pytest.approx(arc.length_mm, abs=1e-12)


def test_equal_steps_of_length_are_equal_steps_along_the_curve():
    arc = arc_length.of(example_2()[0].lower)
    step = 1000.0 / 60.0 * 0.002
    s = np.arange(0.0, arc.length_mm, step)
    steps = np.diff(arc_length.s_at(arc, arc.u_along(s)))
    assert np.max(np.abs(steps / step - 1.0)) < 1e-8


@pytest.mark.parametrize("turned", [False, True])
def test_a_curve_that_stands_still_at_an_end_is_still_run_evenly(turned):
    points = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (5.0, 1.0, 0.0), (9.0, 4.0, 0.0))
    curve = Bezier(points[::-1] if turned else points)
    arc = arc_length.of(curve)
    s = np.linspace(0.0, arc.length_mm, 2001)
    assert np.max(np.abs(arc_length.s_at(arc, arc.u_along(s)) - s)) <= 1e-10
    assert len(arc.panels) < 200


def test_random_cubics_are_run_evenly():
    seed = random.randrange(10**6)
    rng = random.Random(seed)
    for _ in range(20):
        curve = Bezier(tuple((rng.uniform(0, 80), rng.uniform(0, 80), rng.uniform(0, 5)) for _ in range(4)))
        arc = arc_length.of(curve)
        s = np.linspace(0.0, arc.length_mm, 500)
        assert np.max(np.abs(arc_length.s_at(arc, arc.u_along(s)) - s)) <= 1e-11 * arc.length_mm, (
            f"seed {seed}"
        )


def test_a_point_is_no_curve():
    for curve in (Bezier(((1.0, 2.0, 3.0),) * 4), Line((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))):
        with pytest.raises(ValueError, match="no length"):
            arc_length.of(curve)
    with pytest.raises(ValueError, match="two control points"):
        Bezier(((1.0, 2.0, 3.0),))


def test_a_curve_whose_length_is_noise_is_given_up_soon(monkeypatch):
    """A weight of a million at an end: no panel fits, however narrow."""
    points = ((0.0, 0.0), (4.5, -0.3), (9.0, 0.5), (13.5, 0.2), (18.0, 0.3), (22.5, 0.0))
    weights = (1.0, 1.18, 0.94, 1.0, 1.03, 1e6)
    spans = (tuple((x * w, y * w, 0.0) for (x, y), w in zip(points, weights, strict=True)),)
    curve, tries = BSpline((0.0, 1.0), spans, (weights,)), []
    fit = arc_length._fit
    monkeypatch.setattr(arc_length, "_fit", lambda *asked: tries.append(1) or fit(*asked))
    with pytest.raises(ValueError, match="bends without end"):
        arc_length.of(curve)
    assert len(tries) < 1000


def test_an_arc_length_survives_pickling_and_shapes():
    arc = arc_length.of(CUBIC)
    again = pickle.loads(pickle.dumps(arc))
    assert again == arc and again.u_at(3.3) == arc.u_at(3.3)
    assert arc.u_along(np.zeros((2, 3))).shape == (2, 3)
    assert isinstance(arc_length.s_at(arc, 0.5), float)


def test_a_helix_is_as_long_as_pythagoras_says():
    helix = CURVES["helix"]
    assert arc_length.of(helix).length_mm == pytest.approx(math.hypot(35.0, 4.0), abs=1e-12)
    assert norm(subtract(helix.at(0.0), (6.0, 2.0, 3.0))) == 0.0
