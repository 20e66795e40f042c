"""Rows of five-axis lines as the ruled surfaces that they cut with the flank, and how far off they are.

The tool's tip goes along C1 + r n (Eq. 5), n square to the tool axis O and to C1'. As n keeps its length, n'
is square to n, so n is square to the tip's own travel, too: C1 = tip - r n with n = unit(tip' x O), exactly.
So ``single`` placement (P1) of the surface found leads the tool as the lines do, whatever its twist.

Two rows of one operation are its bottom and its top where the tips of the one lie on the axes of the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline as Basis
from scipy.interpolate import splprep
from scipy.spatial import cKDTree

from controller.cad.curve import Nurbs, Shape, fit
from controller.cad.path_rows import Row
from controller.cad.strip import Strip
from controller.geometry.arrays import Array
from controller.geometry.defects import defect
from controller.geometry.surfaces import Surface
from controller.messages import Message, TextError, message
from controller.plan.surfaces.cuts import describe

# Lines may be off their smooth curve (root of the mean square) by their words' rounding, as far as it shows
# in their fourth differences, but by no less and no more than these shares of the tolerance. The axis is
# rounded, too, which counts as many times as the flank is long.
SMOOTH_SHARES, AXIS_SHARE = (0.1, 0.4), 2.0
ABOVE_ROUNDING = 1.4
FIT_SHARE = 0.1  # of the tolerance, for the directrices
DENSE = 4001  # places of a surface's path beside which lines are measured
LEAST_HEIGHT_MM = 0.2  # between the bottom and the top of a pair
BESIDE_RADII = 2.0  # rows nearer than so many radii, and no pair, are passes of a milling cut


class NoStrip(TextError):
    """Why a row is no surface."""


@dataclass(frozen=True, eq=False)
class Recognised:
    """A row, or the bottom and the top of a pair, as a strip; or the reason why it is none."""

    rows: tuple[Row, ...]  # the bottom first
    strip: Strip | None
    reason: Message | None = None
    beside: bool = False  # passes lie beside it: more likely the end of a tool cuts than its flank

    @property
    def number(self) -> int:
        return self.rows[0].number


@dataclass(frozen=True, slots=True)
class Off:
    """How far lines are from the path of a surface: their ends, their axes there, and between their ends."""

    tip_mm: float
    axis_deg: float
    between_mm: float


Curves = tuple[Shape, Shape, Shape]  # by shares (N,): the tip, its travel, and a place above it on the axis


def recognised(
    rows: Sequence[Row], flank_mm: float, radius_mm: float, right: bool, within_mm: float
) -> list[Recognised]:
    """What the rows of a file cut; sizes are for rows whose file says none.

    ``right``: the cutter is on the right of its travel.
    """
    tops = {id(high): low for low, high in _pairs(rows, flank_mm, within_mm)}
    lows = {id(low): high for high in rows if (low := tops.get(id(high))) is not None}
    found = []
    for row in rows:
        if id(row) in tops:
            continue
        pair = (row, lows[id(row)]) if id(row) in lows else (row,)
        radius = row.radius_mm or radius_mm
        try:
            made = _strip(pair, row.flank_mm or flank_mm, radius, right, within_mm)
            found.append(Recognised(pair, made, beside=_has_passes(row, rows, radius, pair)))
        except (TextError, ArithmeticError, ValueError) as error:
            why = error.said if isinstance(error, TextError) else message("cad.path.no_curve", why=error)
            found.append(Recognised(pair, None, why))
    return found


def _strip(rows: Sequence[Row], flank_mm: float, radius_mm: float, right: bool, within_mm: float) -> Strip:
    row = rows[0]
    if row.curves is not None:
        low, high = row.curves
        curves: Curves = (low.at, _derivative(low), high.at)
    else:
        curves = _smooth(row, rows[1] if len(rows) > 1 else None, flank_mm, within_mm)
    side = radius_mm if right else -radius_mm

    def directrix(above: bool) -> Shape:
        def points(share: Array) -> Array:
            tip, travel, top = (curve(share) for curve in curves)
            out = np.cross(travel, top - tip)
            return np.asarray((top if above else tip) - side * out / np.linalg.norm(out, axis=1)[:, None])

        return points

    corners = _corners(row.curves) if row.curves is not None else (0.0, 1.0)
    upper, lower = (fit(directrix(above), corners, FIT_SHARE * within_mm) for above in (True, False))
    made = Strip(row, upper, lower, 0.0, right)
    if (wrong := defect(made.surface)) is not None:
        raise NoStrip(describe(wrong))
    return made


def _smooth(row: Row, top: Row | None, flank_mm: float, within_mm: float) -> Curves:
    """The smoothest curves of the tip and of a place above it that stay within the tolerance of the lines."""
    tips, above = row.tips, row.tips + flank_mm * row.axes
    ways = np.linalg.norm(np.diff(tips, axis=0), axis=1)  # of the axes' rounding there is nothing in them
    share = np.concatenate([[0.0], np.cumsum(ways)]) / ways.sum()
    low = _spline(share, tips, within_mm, SMOOTH_SHARES[1])
    high = _spline(share, above, within_mm, AXIS_SHARE)
    if top is None:
        return low, low.derivative(), high
    dense = np.linspace(0.0, 1.0, DENSE)
    index = _nearest_rulings(low(dense), high(dense), top.tips)[0]
    ends = np.argsort(index)
    at = (index[ends] - index[ends[0]]) / (index[ends[-1]] - index[ends[0]])
    keeps = np.concatenate([[True], np.diff(at) > 0.0])
    return low, low.derivative(), _spline(at[keeps], top.tips[ends][keeps], within_mm, AXIS_SHARE)


def _spline(share: Array, rows: Array, within_mm: float, most: float) -> Basis:
    """A B-spline through points (N, 3), as smooth as the tolerance allows."""
    degree, (least, _) = min(5, len(rows) - 1), SMOOTH_SHARES
    off = float(np.clip(_rounding_mm(rows), least * within_mm, most * within_mm))
    (knots, columns, degree), _ = splprep(list(rows.T), u=share, k=degree, s=len(rows) * off * off)
    return Basis(knots, np.array(columns).T, degree)


def _rounding_mm(rows: Array) -> float:
    """By how much points of a smooth curve (N, 3) seem to be rounded, root of the mean square, mm.

    Of noise alone the squares of fourth differences are 70 times its own. It is taken for somewhat more: a
    spline that has to come nearer follows it.
    """
    squares = (np.diff(rows, 4, axis=0) ** 2).sum(axis=1)
    return ABOVE_ROUNDING * math.sqrt(float(np.median(squares)) / 70.0) if len(squares) else 0.0


def _derivative(curve: Nurbs) -> Shape:
    def of(share: Array) -> Array:
        parts = curve.spline.derivative(share, 1, np)
        return np.stack([np.broadcast_to(c, share.shape) for c in parts], axis=1)

    return of


def _corners(curves: Sequence[Nurbs]) -> Array:
    """Where a knot stands so often that a curve may have a corner."""
    found = [0.0, 1.0]
    for curve in curves:
        shares, times = np.unique(np.round(curve.shares, 12), return_counts=True)
        found += shares[(times >= curve.order - 1) & (shares > 0.0) & (shares < 1.0)].tolist()
    return np.unique(found)


# ---- rows beside each other


def _pairs(rows: Sequence[Row], flank_mm: float, within_mm: float) -> list[tuple[Row, Row]]:
    """Bottom and top: each tip of the one lies on an axis of the other, above its tip."""
    found: list[tuple[Row, Row]] = []
    used: set[int] = set()
    for low in rows:
        for high in rows:
            if low is high or id(low) in used or id(high) in used or low.curves or high.curves:
                continue
            fine = np.linspace(0.0, len(low.tips) - 1.0, DENSE)
            at = np.arange(len(low.tips))
            tips, axes = (
                np.stack([np.interp(fine, at, values[:, k]) for k in range(3)], axis=1)
                for values in (low.tips, low.axes)
            )
            index, off, height = _nearest_rulings(tips, tips + flank_mm * axes, high.tips)
            whole = index.min() < 0.02 * DENSE and index.max() > 0.98 * DENSE
            sag = 2.0 * within_mm + _sag(low)
            if whole and off.max() <= sag and height.min() >= LEAST_HEIGHT_MM:
                found.append((low, high))
                used |= {id(low), id(high)}
    return found


def _sag(row: Row) -> float:
    """How far the lines of a row may leave what they are chords of, mm, by the turns between them."""
    ways = np.diff(row.tips, axis=0)
    sizes = np.linalg.norm(ways, axis=1)
    turns = np.linalg.norm(np.diff(ways / sizes[:, None], axis=0), axis=1)
    return float((np.maximum(sizes[1:], sizes[:-1]) * turns).max(initial=0.0)) / 4.0


def _nearest_rulings(tips: Array, tops: Array, points: Array) -> tuple[Array, Array, Array]:
    """Of each point the nearest of the straight lines (between two as well), how far off and above it is."""
    axes = (tops - tips) / np.linalg.norm(tops - tips, axis=1)[:, None]
    index, off, height = (np.zeros(len(points)) for _ in range(3))
    for i, point in enumerate(points):
        from_tips = point - tips
        above = (from_tips * axes).sum(axis=1)
        apart = np.linalg.norm(from_tips - above[:, None] * axes, axis=1)
        k = int(apart.argmin())
        before, here, after = apart[np.clip([k - 1, k, k + 1], 0, len(tips) - 1)] ** 2
        bend = before - 2.0 * here + after  # the squares go like a parabola about the nearest place
        between = 0.5 * (before - after) / bend if 0 < k < len(tips) - 1 and bend > 0.0 else 0.0
        index[i], off[i], height[i] = k + between, apart[k], above[k]
    return index, off, height


def _has_passes(row: Row, rows: Sequence[Row], radius_mm: float, pair: Sequence[Row]) -> bool:
    """Whether another row runs beside it."""
    tree = cKDTree(row.tips)
    others = (other for other in rows if other not in pair)
    return any(float(np.median(tree.query(other.tips)[0])) < BESIDE_RADII * radius_mm for other in others)


# ---- deviation


def deviation(found: Recognised, written: Surface, radius_mm: float, right: bool) -> Off:
    """Of the lines of a row from the path on which P1 leads the tool along the surface as it is written."""
    pose = written.pose(np.linspace(0.0, 1.0, DENSE), radius_mm if right else -radius_mm, np)
    tips, axes = (np.stack([np.broadcast_to(c, DENSE) for c in v], axis=1) for v in (pose.tip, pose.axis))
    ends, along = found.rows[0].tips, found.rows[0].axes
    if not len(ends) and (curves := found.rows[0].curves) is not None:  # no lines: the curves themselves
        ends, above = (curve.at(np.linspace(0.0, 1.0, 101)) for curve in curves)
        along = (above - ends) / np.linalg.norm(above - ends, axis=1)[:, None]
    off, axis = _from_path(ends, tips, axes)
    turned = np.linalg.norm(axis - along, axis=1).max()
    between, _ = _from_path(0.5 * (ends[1:] + ends[:-1]), tips, axes)
    return Off(
        float(off.max()), math.degrees(2.0 * math.asin(min(1.0, turned / 2.0))), between.max(initial=0.0)
    )


def _from_path(points: Array, tips: Array, axes: Array) -> tuple[Array, Array]:
    """How far points are from a row of tips, and its axes there."""
    nearest = cKDTree(tips).query(points)[1]
    best, axis = np.full(len(points), np.inf), np.zeros_like(points)
    for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, len(tips) - 2)):
        way = tips[first + 1] - tips[first]
        size = np.maximum((way * way).sum(axis=1), 1e-30)
        share = np.clip(((points - tips[first]) * way).sum(axis=1) / size, 0.0, 1.0)[:, None]
        off = np.linalg.norm(points - tips[first] - share * way, axis=1)
        mixed = axes[first] + share * (axes[first + 1] - axes[first])
        nearer = off < best
        best[nearer] = off[nearer]
        axis[nearer] = (mixed / np.linalg.norm(mixed, axis=1)[:, None])[nearer]
    return best, axis
