"""Series against derivatives known in closed form."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.geometry import series as jets

U = np.array([-0.7, 0.3, 1.2])


def powers(x, *terms):
    return tuple(factor * x**exponent for factor, exponent in terms)


# (name, formula over any m, derivatives 0 to 3 at u)
ROWS = [
    (
        "sine",
        lambda u, m: m.sin(u * 2.0),
        lambda u: (np.sin(2 * u), 2 * np.cos(2 * u), -4 * np.sin(2 * u), -8 * np.cos(2 * u)),
    ),
    ("cosine", lambda u, m: m.cos(u), lambda u: (np.cos(u), -np.sin(u), -np.cos(u), np.sin(u))),
    ("power", lambda u, m: 1.0 - u**4, lambda u: (1 - u**4, -4 * u**3, -12 * u**2, -24 * u)),
    ("inverse", lambda u, m: 1.0 / (u + 2.0), lambda u: powers(u + 2, (1, -1), (-1, -2), (2, -3), (-6, -4))),
    (
        "root",
        lambda u, m: m.sqrt(u + 2.0),
        lambda u: powers(u + 2, (1, 0.5), (0.5, -0.5), (-0.25, -1.5), (0.375, -2.5)),
    ),
    (
        "angle",
        lambda u, m: m.atan2(u, 1.0),
        lambda u: (np.atan(u), 1 / (1 + u**2), -2 * u / (1 + u**2) ** 2, (6 * u**2 - 2) / (1 + u**2) ** 3),
    ),
    (
        "arc cosine of a cosine",
        lambda u, m: m.acos(m.cos(u + 1.0)),
        lambda u: (u + 1, 1 + 0 * u, 0 * u, 0 * u),
    ),
    ("hypotenuse", lambda u, m: m.hypot(m.cos(u), m.sin(u)), lambda u: (1 + 0 * u, 0 * u, 0 * u, 0 * u)),
]


@pytest.mark.parametrize(("name", "formula", "known"), ROWS, ids=[row[0] for row in ROWS])
def test_a_series_holds_value_and_three_derivatives(name, formula, known):
    series = formula(jets.variable(U), jets)
    for order, expected in enumerate(known(U)):
        np.testing.assert_allclose(series.derivative(order), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("name", "formula", "known"), ROWS, ids=[row[0] for row in ROWS])
def test_the_value_of_a_series_is_the_value_of_the_formula_on_arrays(name, formula, known):
    np.testing.assert_allclose(formula(jets.variable(U), jets).c[0], formula(U, np), rtol=1e-15, atol=1e-15)


def test_arrays_on_the_left_hand_over_to_the_series():
    x = jets.variable(U)
    for series in (U + x, U * x, U - x, U / (x + 5.0)):
        assert isinstance(series, jets.Jet) and series.c.shape == (4, 3)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_quotient_times_its_divisor_is_the_dividend(u, shift):
    x = jets.variable(np.array([u]))
    divisor = x * x + (1.0 + shift * shift)
    dividend = jets.sin(x) - shift
    np.testing.assert_allclose((dividend / divisor * divisor).c, dividend.c, atol=1e-12)


def test_a_constant_has_no_derivatives_and_a_negative_power_divides():
    assert jets.constant(math.e).derivative(1) == 0.0
    x = jets.variable(np.array([2.0]))
    np.testing.assert_allclose((x**-1).c[:, 0], [0.5, -0.25, 0.125, -0.0625])


@pytest.mark.parametrize(("a", "b"), [((), (5,)), ((5,), ()), ((3, 1), (5,)), ((5,), (3, 5)), ((), ())])
def test_products_and_sums_take_points_of_different_shapes_as_arrays_do(a, b):
    random = np.random.default_rng(7)
    x, y = (jets.Jet(random.normal(size=(4, *shape))) for shape in (a, b))
    shape = np.broadcast_shapes(a, b)
    wide = [jets.Jet(np.array([np.broadcast_to(c, shape) for c in one.c])) for one in (x, y)]
    assert (x * y).c.tobytes() == (wide[0] * wide[1]).c.tobytes()
    for k in range(4):
        by_hand = sum(x.c[i] * y.c[k - i] for i in range(k + 1))
        assert np.allclose((x * y).c[k], by_hand, rtol=1e-14, atol=1e-14)
    assert (x + y.c[0]).c.tobytes() == (wide[0] + wide[1].c[0]).c.tobytes()
