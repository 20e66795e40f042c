"""Program text of G6.2 for tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Written:
    """One curve as G6.2 takes it: order, knots, points (N, 3), weights (none: R left out)."""

    order: int
    knots: Sequence[float]
    points: Sequence[Sequence[float]]
    weights: Sequence[float] = ()

    def lines(self) -> list[str]:
        rows = []
        for i, (x, y, z) in enumerate(self.points):
            weight = f" R{number(self.weights[i])}" if len(self.weights) else ""
            rows.append(f"K{number(self.knots[i])} X{number(x)} Y{number(y)} Z{number(z)}{weight}")
        return rows + [f"K{number(knot)}" for knot in self.knots[len(self.points) :]]


def number(value: float) -> str:
    """A decimal number with a point, and no exponent."""
    text = np.format_float_positional(value, unique=True, trim="0")
    return str(text)


def nurbs(upper: Written, lower: Written, feed: str = " F600.") -> str:
    head = f"G6.2 P{upper.order} Q{lower.order}{feed}"
    return "\n".join([head, *upper.lines(), *lower.lines()]) + "\n"


def clamped(order: int, count: int, times: int = 1) -> list[float]:
    """Even knots 0, 1, 2 .. with both ends repeated; inner ones stand ``times`` times."""
    inner = [1.0 + k // times for k in range(count - order)]
    last = inner[-1] + 1.0 if inner else 1.0
    return [0.0] * order + inner + [last] * order


def bezier(points: Sequence[Sequence[float]]) -> Written:
    return Written(len(points), clamped(len(points), len(points)), points)


def blade(count: int = 12, twist: float = 0.5) -> tuple[Written, Written]:
    """Upper and lower cubic of a twisted blade: a bent chord whose ruling leans over along it."""
    t = np.linspace(0.0, 1.0, count)
    lower = np.column_stack([60.0 * t, 14.0 * np.sin(np.pi * t) ** 2 * (1.0 - 0.4 * t), 0.5 * t])
    lean = np.column_stack([2.0 * np.cos(3.0 * t), -6.0 * twist * np.sin(2.5 * t), 14.0 + 0.0 * t])
    knots = clamped(4, count)
    return Written(4, knots, np.round(lower + lean, 4)), Written(4, knots, np.round(lower, 4))
