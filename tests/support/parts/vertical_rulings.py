"""Walls whose ruling comes to the vertical, by contact of a chosen order, and their programs.

The horizontal part of the ruling is (u - place)^order times a polynomial, turned about Z by any
angle; written with few decimals it misses the vertical by about their rounding.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from support.oracles import ruled_surfaces, tool_paths
from support.parts.nurbs_text import Written, number, nurbs

Surface = ruled_surfaces.Ruled | tool_paths.RuledNurbs
Polynomial = np.polynomial.Polynomial
HEAD = "G21 G90 G54 {exact}\nT2 M6\nS12000 M3\n{side}\n"
TAIL = "G40\nM5\nM30\n"
RADIUS_MM = 1.5  # of T2
OFFSETS = {"G40": RADIUS_MM, "G41": -RADIUS_MM, "G42": RADIUS_MM}


@dataclass(frozen=True, eq=False)
class Wall:
    """One surface as a program and as the tests' own oracle has it."""

    label: str
    source: str
    surface: Surface
    offset_mm: float


def powers(place: float, order: int, *factor: float) -> Polynomial:
    """(u - place)^order (factor[0] + factor[1] u + ...)."""
    return Polynomial([-place, 1.0]) ** order * Polynomial(factor)


def control(polynomial: Polynomial, degree: int) -> np.ndarray:
    """Its Bernstein coefficients over 0 <= u <= 1."""
    c = np.zeros(degree + 1)
    c[: len(polynomial.coef)] = polynomial.coef
    return np.array(
        [sum(math.comb(i, j) / math.comb(degree, j) * c[j] for j in range(i + 1)) for i in range(degree + 1)]
    )


def leaning(x: Polynomial, y: Polynomial, height_mm: float, degree: int, turned_deg: float) -> np.ndarray:
    """Control points (degree + 1, 3) of the ruling."""
    a = math.radians(turned_deg)
    columns = control(x, degree), control(y, degree), np.full(degree + 1, height_mm)
    return np.stack(columns, axis=1) @ np.array(
        [[math.cos(a), math.sin(a), 0.0], [-math.sin(a), math.cos(a), 0.0], [0.0, 0.0, 1.0]]
    )


def ruled(
    label: str,
    lower: np.ndarray,
    ruling: np.ndarray,
    feed: str = "1000.",
    side: str = "G41",
    decimals: int | None = None,
    exact: str = "G61",
) -> Wall:
    """A wall of G52; ``decimals``: of its words, or all that there are."""
    pairs = [lower + ruling, lower]
    upper, low = ([[_written(c, decimals) for c in p] for p in points] for points in pairs)
    rows = [" ".join(f"{a}{number(c)}" for a, c in zip("XYZ", p, strict=True)) for p in (*upper, *low)]
    body = "\n".join([f"G52 {rows[0]} F{feed}", *rows[1:], ""])
    text = HEAD.format(exact=exact, side=side) + body + TAIL
    return Wall(label, text, ruled_surfaces.Ruled(upper, low), OFFSETS[side])


def _written(value: float, decimals: int | None) -> float:
    return float(value) if decimals is None else round(float(value), decimals)


def straight(length_mm: float = 20.0, degree: int = 3) -> np.ndarray:
    return np.array([[length_mm * k / degree, 0.0, 0.0] for k in range(degree + 1)])


def random_ruled(seed: int) -> Wall:
    """Contact of the first to the third order on either of two axes, at an end or anywhere."""
    r = random.Random(seed)
    place = r.choice([0.0, 0.5, 1.0, 0.25, 1.0 / 3.0, r.random()])

    def one(order: int) -> Polynomial:
        if order > 3:
            return Polynomial([0.0])
        size = {1: 2.0, 2: 6.0, 3: 12.0}[order]
        return powers(place, order, *(r.uniform(-size, size) for _ in range(r.randint(1, 4 - order))))

    orders = r.choice([(1, 2), (1, 3), (2, 2), (2, 3), (3, 3), (4, 2), (4, 3)])
    length, bend = r.uniform(8.0, 30.0), r.choice([0.0, 0.0, r.uniform(-4.0, 4.0)])
    lower = straight(length)
    lower[1:3, 1] = bend, bend * r.choice([-1.0, 0.0, 1.0])
    turned = r.choice([0.0, 0.0, r.uniform(-180.0, 180.0)])
    ruling = leaning(one(orders[0]), one(orders[1]), r.choice([5.0, 10.0, 20.0]), 3, turned)
    decimals = r.choice([2, 3, 4, 6, 9, None])
    label = f"seed {seed}: orders {orders} at u = {place:.4f}, {decimals} decimals"
    side, exact = r.choice(["G40", "G41", "G42"]), r.choice(["G61", "G64 P0.01"])
    return ruled(label, lower, ruling, r.choice(["100.", "1000.", "3000."]), side, decimals, exact)


def rational(
    label: str, lower: np.ndarray, ruling: np.ndarray, weights: Sequence[float], feed: str = "1000."
) -> Wall:
    """A wall of G6.2, both curves with the same weights: the ruling is ``ruling`` over their polynomial."""
    w = np.asarray(weights)[:, None]
    upper = lower + ruling / w
    order = len(lower)
    knots = [0.0] * order + [1.0] * order
    text = nurbs(Written(order, knots, upper, weights), Written(order, knots, lower, weights), f" F{feed}")
    degree = order - 1
    surface = tool_paths.RuledNurbs(upper, lower, (degree, degree), (knots, knots), (weights, weights))
    head = HEAD.format(exact="G61", side="G42")
    return Wall(label, head + text + TAIL, surface, RADIUS_MM)


def random_rational(seed: int) -> Wall:
    """Contact of the second to the fifth order of a rational wall of degree 5."""
    r = random.Random(seed)
    place, order = r.choice([0.0, 0.5, 1.0, r.random()]), r.randint(2, 5)
    size = 3.0 * 1.8**order
    x, y = (powers(place, order + r.choice([0, 0, 1][: 6 - order]), r.uniform(-size, size)) for _ in range(2))
    ruling = leaning(x, y, 10.0, 5, r.uniform(-180.0, 180.0))
    weights = [1.0, *(r.uniform(0.8, 1.25) for _ in range(4)), 1.0]
    ruling[:, 2] *= np.asarray(weights)
    lower = straight(r.uniform(15.0, 30.0), 5)
    lower[1:5, 1] = [r.uniform(-1.0, 1.0) for _ in range(4)]
    return rational(f"seed {seed}: order {order} at u = {place:.4f}, rational", lower, ruling, weights)
