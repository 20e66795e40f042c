"""Unseen ruled surfaces between rational B-splines, and their program text for G6.2."""

from __future__ import annotations

import random
from typing import NamedTuple

import numpy as np


class Nurbs(NamedTuple):
    """One curve as a program gives it."""

    points: np.ndarray  # (n, 3)
    knots: list[float]  # n + degree + 1
    weights: list[float]
    degree: int


def blade(seed: int, spans: int = 4) -> tuple[Nurbs, Nurbs]:
    """(upper, lower) over a bent way in the plane with a leaning, slightly twisting ruling.

    Degrees 3 to 5, uneven inner knots of their own on both curves, weights about 1.
    """
    rng = random.Random(seed)
    bend, lean = (
        rng.uniform(-0.8, 0.8),
        np.array([rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), rng.uniform(9.0, 13.0)]),
    )
    lower = _curve(rng, spans, lambda share: _way(share, bend))
    sway = np.array([rng.uniform(-2.0, 2.0), rng.uniform(-2.0, 2.0), 0.0])
    upper = _curve(rng, spans, lambda share: _way(share, bend) + lean + share * sway)
    return upper, lower


def _way(share: float, bend: float) -> np.ndarray:
    heading = bend * share
    return 40.0 * share * np.array([np.cos(heading), np.sin(heading), 0.0]) - np.array([20.0, 0.0, 0.0])


def _curve(rng: random.Random, spans: int, at: object) -> Nurbs:
    degree = rng.choice((3, 4, 5))
    inner = sorted(k / spans + rng.uniform(-0.15, 0.15) / spans for k in range(1, spans))
    knots = [0.0] * (degree + 1) + [round(k, 4) for k in inner] + [1.0] * (degree + 1)
    count = len(knots) - degree - 1
    greville = [sum(knots[i + 1 : i + degree + 1]) / degree for i in range(count)]
    points = np.round([at(g) + _shake(rng) for g in greville], 4)  # type: ignore[operator]
    weights = [1.0, *(round(rng.uniform(0.8, 1.25), 4) for _ in range(count - 2)), 1.0]
    return Nurbs(np.asarray(points), knots, weights, degree)


def _shake(rng: random.Random) -> np.ndarray:
    return np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), 0.0])


def text(upper: Nurbs, lower: Nurbs, feed: float, side: str = "G42") -> str:
    """A program that cuts the surface with the 3 mm end mill."""
    lines = [
        "G21 G90 G54 G61",
        "T2 M6",
        "S12000 M3",
        side,
        f"G6.2 P{upper.degree + 1} Q{lower.degree + 1} F{feed:.3f}",
    ]
    for curve in (upper, lower):
        for k, p, w in zip(curve.knots, curve.points, curve.weights, strict=False):
            lines.append(
                f"K{k:.4f} " + " ".join(f"{a}{c:.4f}" for a, c in zip("XYZ", p, strict=True)) + f" R{w:.4f}"
            )
        lines += [f"K{k:.4f}" for k in curve.knots[len(curve.points) :]]
    return "\n".join([*lines, "G40", "M5", "M30", ""])
