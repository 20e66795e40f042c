"""Hulls of curves: no point of a curve lies outside, seen along any direction."""

from __future__ import annotations

import numpy as np
import pytest

from controller.geometry.curves import Arc, Bezier, Curve, Line, Polynomial
from controller.geometry.hulls import hull
from controller.geometry.splines import BSpline

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
