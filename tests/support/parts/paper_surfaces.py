"""The paper's surfaces, with its slips put right, for tests."""

from __future__ import annotations

import math

from controller.geometry.curves import Bezier, Polynomial
from controller.geometry.surfaces import Cone, RuledSurface
from controller.geometry.vectors import Vector

POINTS = (
    (
        ((38, 22, 10), (21.5, -5.5, 10), (5, 5, 10), (10.5, 11, 10)),
        ((38, 22, 0), (21.5, -11, 0), (-1.58, 3.3, 0), (3.6, 11, 0)),
    ),
    (
        ((10.5, 11, 10), (16, 16.5, 10), (35.8, 18.42, 10), (38, 22, 10)),
        ((3.6, 11, 0), (8.78, 18.7, 0), (28.1, 18.7, 0), (38, 22, 0)),
    ),
)


def equation_7() -> RuledSurface:
    """Slip 1: C0's y ends in + 8.015 u, so that C1 = 3 C0 in x and y."""
    upper = ((5.0, 0.0, 20.0), (0.22, 8.015, 0.0), (-7.425, -0.81, 0.0), (2.205, -2.205, 0.0))
    lower = tuple((3.0 * x, 3.0 * y, 0.0) for x, y, _ in upper)
    return RuledSurface(Polynomial(upper), Polynomial(lower))


def example_1() -> Cone:
    return Cone((0.0, 15.0, 0.0), (0.0, 0.0, 0.0), 10.0, 10.0, math.tau)


def example_2(turn_deg: float = 0.0) -> tuple[RuledSurface, RuledSurface]:
    """Both surfaces, the part turned about Z."""
    first, second = (
        RuledSurface(*(Bezier(tuple(turned(p, turn_deg) for p in points)) for points in pair))
        for pair in POINTS
    )
    return first, second


def turned(p: Vector, degrees: float) -> Vector:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y, z = map(float, p)
    return (x * c - y * s, x * s + y * c, z)
