"""The two curves that a free tool axis goes through, over a row of surfaces that join.

They are B-splines with knots of their own: equally far apart by the way along both edges, wherever the
edges' knots are. Where one surface follows another the curves run on with their first two derivatives by
the way of the contact, so the joints of the machine do not jump. That is put into the basis: of the first
three control points of a further surface each is a sum of the last three of the one before.

                                             t
    0 ------------ surface 0 ------------ t_1 ------ surface 1 ------ 1
    |     |     |     |     |     |     |  |    |    |    |    |    |  |      breaks of the spans

Over a span the curve depends on ``width`` control points from ``starts`` on, so all that is made of it
is banded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, rows
from controller.geometry.curves import Curve
from controller.geometry.splines import BSpline, simplest
from controller.geometry.surfaces import Surface

Index = npt.NDArray[np.intp]

ORDER = 6
TIED = 3  # control points of a further surface that hang on those of the one before
SMOOTH = ORDER - 2  # derivatives that run through a knot
PLACES = 257  # of a surface, where its way is measured
ALONG = np.array([0.0, 0.5, 1.0])  # of a ruling, from its lower end
CREASE_RAD = math.radians(0.2)  # of the normals along a ruling that two surfaces share: less is none
STILL = 1e-6  # of the mean rate of C1: it stands still at an end, and nothing can be led on by its way
_GAUSS, _SHARES = np.polynomial.legendre.leggauss(3)


def joined(surfaces: Sequence[Surface]) -> list[list[Surface]]:
    """Rows of surfaces, in order, over whose joints an axis can be led on."""
    rows = [[surfaces[0]]]
    for before, after in pairwise(surfaces):
        if _joins(before, after):
            rows[-1].append(after)
        else:
            rows.append([after])
    return rows


def _joins(before: Surface, after: Surface) -> bool:
    """Whether the contact goes on, and the surfaces meet without a crease."""
    normals = []
    for surface, u in ((before, 1.0), (after, 0.0)):
        rate, turn = (np.array(c.derivative(u)) for c in (surface.lower, surface.ruling_curve))
        if float(np.sqrt(rate @ rate)) <= STILL * float(_way(surface)[-1]):
            return False
        normals.append(_unit(np.cross(rate + ALONG[:, None] * turn, np.array(surface.ruling(u)))))
    return float((normals[0] * normals[1]).sum(axis=1).min()) > math.cos(CREASE_RAD)


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """Splines over 0 <= t <= 1: what each span takes of the control points, as Bernstein polynomials."""

    breaks: Array  # (S + 1,) of t
    starts: Index  # (S,) the first control point of each span
    forms: Array  # (S, ORDER, width)
    size: int  # control points
    ends: tuple[int, ...]  # how many spans there are up to the end of each surface
    places: Array  # (size,) t of each control point

    @property
    def width(self) -> int:
        return int(self.forms.shape[2])

    @property
    def tops(self) -> Array:
        """t at the ends of the surfaces, and 0."""
        return np.asarray(self.breaks[[0, *self.ends]])

    @staticmethod
    def over(surfaces: Sequence[Surface], spans: int) -> Basis:
        """With about ``spans`` spans by the way along both edges, one to a surface at least."""
        ways = [_way(surface) for surface in surfaces]
        total = sum(float(way[-1]) for way in ways)
        made = [_Part.of(way, max(1, round(spans * float(way[-1]) / total))) for way in ways]
        tops = np.cumsum([0.0, *(float(way[-1]) / total for way in ways)])
        tops[-1] = 1.0
        width = ORDER if len(made) == 1 else ORDER + TIED - 1
        size = sum(part.size for part in made) - TIED * (len(made) - 1)
        breaks, starts, forms, places, first = [np.zeros(1)], list[int](), list[Array](), list[Array](), 0
        for k, part in enumerate(made):
            tied = None if k == 0 else _tied(surfaces[k - 1], made[k - 1], surfaces[k], part)
            for j, form in enumerate(part.forms):
                start = min(first + (j if tied is None or j >= TIED else 0), size - width)
                whole = np.zeros((ORDER, width))
                for i, own in enumerate(range(j, j + ORDER)):
                    if tied is not None and own < TIED:
                        on = first - start
                        whole[:, on : on + TIED] += np.outer(form[:, i], tied[own])
                    else:
                        whole[:, first + own - start] += form[:, i]
                starts.append(start)
                forms.append(whole)
            breaks.append(tops[k] + part.breaks[1:] * (tops[k + 1] - tops[k]))
            places.append((tops[k] + part.places * (tops[k + 1] - tops[k]))[TIED if k else 0 :])
            first += part.size - TIED
        at = np.concatenate(breaks)
        at[-1] = 1.0
        ends = tuple(np.cumsum([len(part.forms) for part in made]).tolist())
        return Basis(at, np.array(starts), np.array(forms), size, ends, np.concatenate(places))

    def values(self, t: Array, order: int = 0) -> tuple[Array, Index]:
        """What the curve at ``t`` (N,) is of its control points, (N, width), and of which first, (N,)."""
        span = np.searchsorted(self.breaks[1:-1], t, side="right")
        low, wide = self.breaks[span], np.diff(self.breaks)[span]
        bernstein = _bernstein((t - low) / wide, order) / wide[:, None] ** order
        return np.asarray(np.matmul(bernstein[:, None, :], self.forms[span])[:, 0]), self.starts[span]

    def at(self, t: Array, points: Array, order: int = 0) -> Array:
        """Of control points (size, k) the curves at ``t`` (N,), or a derivative of them: (N, k)."""
        span = np.searchsorted(self.breaks[1:-1], t, side="right")
        low, wide = self.breaks[span], np.diff(self.breaks)[span]
        bernstein = _bernstein((t - low) / wide, order) / wide[:, None] ** order
        return np.asarray(np.matmul(bernstein[:, None, :], self._spans(points)[span])[:, 0])

    def bending(self) -> tuple[Array, Index, Array]:
        """Values, firsts and weights of rows whose squares are the third derivative's, over t."""
        low, wide = self.breaks[:-1, None], np.diff(self.breaks)[:, None]
        values, first = self.values((low + 0.5 * wide * (1.0 + _GAUSS)).ravel(), 3)
        return values, first, np.asarray((0.5 * wide * _SHARES).ravel())

    def curve(self, points: Array) -> BSpline:
        """The curve over t of control points (size, 3)."""
        return _spline(self.breaks, self._spans(points))

    def part(self, k: int, points: Array) -> Curve:
        """The same over 0 <= u <= 1 of one of the surfaces."""
        first, last = (0, *self.ends)[k], self.ends[k]
        breaks = self.breaks[first : last + 1]
        breaks = (breaks - breaks[0]) / (breaks[-1] - breaks[0])
        return simplest(_spline(breaks, self._spans(points)[first:last]))

    def _spans(self, points: Array) -> Array:
        """Their control points as Beziers, (S, ORDER, k)."""
        return np.asarray(np.matmul(self.forms, points[self.starts[:, None] + np.arange(self.width)]))


def _spline(breaks: Array, spans: Array) -> BSpline:
    made = tuple(tuple((float(x), float(y), float(z)) for x, y, z in span) for span in spans)
    return BSpline(tuple(breaks.tolist()), made, (), (SMOOTH,) * (len(spans) - 1))


def turn_of(surfaces: Sequence[Surface]) -> float:
    """By how much (rad) the edge, or the ruling, that turns most turns along a row of surfaces."""
    u = np.linspace(0.0, 1.0, PLACES)
    turns = np.zeros(3)
    for surface in surfaces:
        for k, curve in enumerate((surface.lower, surface.upper)):
            turns[k] += _turn(np.diff(rows(curve.at(u, np), u.shape), axis=1).T)
        turns[2] += _turn(rows(surface.ruling(u, np), u.shape).T)
    return float(turns.max())


def _turn(ways: Array) -> float:
    """Of a row of vectors (N, 3), those of no length left out."""
    size = np.sqrt((ways * ways).sum(axis=1))
    unit = ways[size > STILL * size.mean()]
    unit = _unit(unit)
    return float(np.arccos(np.clip((unit[1:] * unit[:-1]).sum(axis=1), -1.0, 1.0)).sum())


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.sqrt((v * v).sum(axis=-1, keepdims=True)), 1e-300))


def _way(surface: Surface) -> Array:
    """The way along both edges (mm) up to each of ``PLACES`` evenly spread u."""
    u = np.linspace(0.0, 1.0, PLACES)
    legs = [np.diff(rows(curve.at(u, np), u.shape), axis=1) for curve in (surface.lower, surface.upper)]
    steps = np.sqrt(sum((leg * leg).sum(axis=0) for leg in legs))
    return np.concatenate(([0.0], np.cumsum(steps)))


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The basis over one surface alone."""

    breaks: Array  # (m + 1,) of u
    forms: tuple[Array, ...]  # (ORDER, ORDER) of each span
    places: Array  # Greville's, of each control point

    @property
    def size(self) -> int:
        return len(self.places)

    @staticmethod
    def of(way: Array, spans: int) -> _Part:
        breaks = np.interp(np.linspace(0.0, way[-1], spans + 1), way, np.linspace(0.0, 1.0, len(way)))
        breaks[0], breaks[-1] = 0.0, 1.0
        knots = np.concatenate(([0.0] * (ORDER - 1), breaks, [1.0] * (ORDER - 1)))
        nodes = (np.arange(ORDER) + 0.5) / ORDER
        inverse, forms = np.linalg.inv(_bernstein(nodes)), list[Array]()
        for j, (low, high) in enumerate(pairwise(breaks)):
            forms.append(
                inverse @ _of_knots(knots, low + nodes * (high - low), j + ORDER - 1)[:, j : j + ORDER]
            )
        places = np.array([knots[i + 1 : i + ORDER].mean() for i in range(spans + ORDER - 1)])
        return _Part(breaks, tuple(forms), places)

    def end(self, surface: Surface, u: float) -> Array:
        """Value, first and second derivative by the way of C1 at an end, of its ``TIED`` control points."""
        at_start = u < 0.5
        form = self.forms[0 if at_start else -1]
        wide = float(self.breaks[1] if at_start else 1.0 - self.breaks[-2])
        rate, bend = (np.array(surface.lower.derivative(u, k)) for k in (1, 2))
        speed = float(np.sqrt(rate @ rate))
        value, first, second = ((_bernstein(np.array([u]), k) @ form)[0] / wide**k for k in range(TIED))
        by_way = [value, first / speed, (second - first * float(rate @ bend) / speed**2) / speed**2]
        found = np.array(by_way)
        return found[:, :TIED] if at_start else found[:, -TIED:]


def _tied(before: Surface, first: _Part, after: Surface, second: _Part) -> Array:
    """The first control points of ``after`` as sums of the last ones of ``before``, (TIED, TIED)."""
    made = np.linalg.solve(second.end(after, 0.0), first.end(before, 1.0))
    made[0], made[1, 0] = (0.0, 0.0, 1.0), 0.0  # but for rounding
    return np.asarray(made)


def _bernstein(x: Array, order: int = 0) -> Array:
    """The Bernstein polynomials at ``x`` (N,), or a derivative of them: (N, ORDER)."""
    degree = ORDER - 1 - order
    k = np.arange(degree + 1)
    low = np.array([math.comb(degree, i) for i in k]) * x[:, None] ** k * (1.0 - x[:, None]) ** (degree - k)
    for higher in range(degree + 1, ORDER):  # of differences of control points
        low = higher * (np.pad(low, ((0, 0), (1, 0))) - np.pad(low, ((0, 0), (0, 1))))
    return np.asarray(low)


def _of_knots(knots: Array, u: Array, span: int) -> Array:
    """Of a row of knots at ``u`` (N,) of one span, by Cox and de Boor: (N, len(knots) - ORDER)."""
    table = np.zeros((len(u), len(knots) - 1))
    table[:, span] = 1.0
    for degree in range(1, ORDER):
        n = len(knots) - 1 - degree
        left, right = knots[degree : degree + n] - knots[:n], knots[degree + 1 :] - knots[1 : n + 1]
        rise = (u[:, None] - knots[:n]) / np.where(left > 0.0, left, 1.0) * (left > 0.0)
        fall = (knots[degree + 1 :] - u[:, None]) / np.where(right > 0.0, right, 1.0) * (right > 0.0)
        table = rise * table[:, :n] + fall * table[:, 1 : n + 1]
    return table
