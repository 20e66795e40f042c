"""A directrix on its way from CAD to a program: a rational B-spline in plain numbers, or a fitted one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import make_interp_spline

from controller.geometry.arrays import Array
from controller.geometry.splines import ORDERS, BadSpline, BSpline, check
from controller.geometry.vectors import Vector
from controller.messages import TextError, message

Shape = Callable[[Array], Array]  # shares (N,) from 0 to 1 -> points (N, 3)

SAME_WEIGHT = 1e-12
FIT_MM = 5e-5  # a fitted curve is this near to what it stands for
DEGREE = 5  # of a fitted curve: one that is smooth to the fourth derivative is one part for the controller
FIRST_SPANS, MAX_SPANS = 6, 512
SLOW = 4  # halvings one after the other that gain little, and a shape is taken not to be smooth
BETWEEN = np.array([0.07, 0.23, 0.5, 0.77, 0.93])  # where a fit is looked at, shares of a span


class NoFit(TextError):
    """A curve that no fit comes near enough to."""


@dataclass(frozen=True, eq=False)
class Nurbs:
    """Order, knots (N + order,), control points (N, 3) in mm, weights (N,); clamped at both ends."""

    order: int
    knots: Array
    points: Array
    weights: Array

    @property
    def is_rational(self) -> bool:
        return bool(np.ptp(self.weights) > SAME_WEIGHT * self.weights.max())

    @cached_property
    def spline(self) -> BSpline:
        """For the formulas of the controller; raises BadSpline."""
        points: list[Vector] = [(float(x), float(y), float(z)) for x, y, z in self.points]
        weights = self.weights.tolist() if self.is_rational else ()
        return BSpline.of(self.order, self.shares.tolist(), points, weights)

    @property
    def shares(self) -> Array:
        """The knots as shares of their range."""
        low, high = self.knots[0], self.knots[-1]
        return np.asarray((self.knots - low) / (high - low))

    def at(self, share: Array) -> Array:
        """Points (N, 3) at shares (N,) of the range of the knots."""
        return np.stack([np.broadcast_to(c, share.shape) for c in self.spline.at(share, np)], axis=1)

    def turned(self) -> Nurbs:
        """The same curve, run the other way."""
        knots = (self.knots[0] + self.knots[-1]) - self.knots[::-1]
        return Nurbs(self.order, knots, self.points[::-1], self.weights[::-1])

    def cubic(self) -> Array | None:
        """The four control points of one cubic Bezier, (4, 3), where the curve is one."""
        if self.is_rational or len(self.points) != self.order or self.order > 4:
            return None
        points = self.points
        while len(points) < 4:
            points = _raised(points)
        return points

    def written(self) -> Nurbs:
        """Itself, or a fit where a program cannot say it (too high an order, knots too near each other)."""
        try:
            points: list[Vector] = [(0.0, 0.0, 0.0)] * len(self.points)
            check(self.order, self.shares.tolist(), points, self.weights.tolist())
        except BadSpline:
            return self._fitted()
        return self

    def _fitted(self) -> Nurbs:
        basis = _Rational(self)
        return fit(basis, np.unique(self.shares) if self.order > ORDERS[-1] else (0.0, 1.0))


def _raised(points: Array) -> Array:
    """A Bezier of one degree more."""
    n = len(points)
    share = (np.arange(1, n) / n)[:, None]
    return np.concatenate([points[:1], share * points[:-1] + (1.0 - share) * points[1:], points[-1:]])


class _Rational:
    """Evaluates what ``BSpline`` does not take."""

    def __init__(self, curve: Nurbs) -> None:
        from scipy.interpolate import BSpline as Basis

        rows = np.column_stack([curve.points * curve.weights[:, None], curve.weights])
        self._basis = Basis(curve.shares, rows, curve.order - 1)

    def __call__(self, share: Array) -> Array:
        rows = self._basis(share)
        return np.asarray(rows[:, :3] / rows[:, 3:])


def fit(shape: Shape, corners: Sequence[float] | Array = (0.0, 1.0), within_mm: float = FIT_MM) -> Nurbs:
    """A B-spline at the same parameter, within ``within_mm`` of ``shape``; kinks only at ``corners``.

    Spans that are not near enough between their knots are halved until they are. Raises NoFit.
    """
    return _joined([_part(shape, a, b, within_mm) for a, b in pairwise(corners)])


def _part(shape: Shape, a: float, b: float, within_mm: float) -> Nurbs:
    share, before, slow = np.linspace(a, b, FIRST_SPANS + 1), math.inf, 0
    while len(share) <= MAX_SPANS and slow < SLOW:
        made = make_interp_spline(share, shape(share), k=DEGREE)  # not a knot
        off = _errors(shape, made, share)
        if off.max() <= within_mm:
            return Nurbs(DEGREE + 1, np.asarray(made.t), np.asarray(made.c), np.ones(len(made.c)))
        slow = slow + 1 if off.max() > 0.7 * before else 0
        before = float(off.max())
        halved = 0.5 * (share[:-1] + share[1:])[off > within_mm]
        share = np.sort(np.concatenate([share, halved]))
    raise NoFit(message("cad.no_fit", spans=len(share) - 1, within_mm=within_mm * 1000.0))


def _joined(parts: Sequence[Nurbs]) -> Nurbs:
    """Curves one after the other; their ends are one."""
    knots, points = [parts[0].knots], [parts[0].points]
    for part in parts[1:]:
        knots[-1] = knots[-1][:-1]  # at a kink a knot stands as often as the degree
        knots.append(part.knots[DEGREE + 1 :])
        points.append(part.points[1:])
    rows = np.concatenate(points)
    return Nurbs(DEGREE + 1, np.concatenate(knots), rows, np.ones(len(rows)))


def _errors(shape: Shape, made: Shape, share: Array) -> Array:
    """How far each span between ``share`` (N + 1) is off, (N,) mm."""
    between = (share[:-1, None] + np.diff(share)[:, None] * BETWEEN).ravel()
    off = np.linalg.norm(made(between) - shape(between), axis=1)
    return np.asarray(off.reshape(-1, len(BETWEEN)).max(axis=1))
