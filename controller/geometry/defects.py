"""Why a ruled surface cannot be cut: audits that look at a whole surface, on arrays, before it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import partial

import numpy as np

from controller.geometry.arrays import Array, distinct
from controller.geometry.curves import Arc, Bezier, Curve, Line
from controller.geometry.splines import BSpline
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Vector, add, cross, dot, norm, scale, subtract

ZERO_MM = 1e-6  # lengths below are no lengths: ten thousandths of a BLU
SAMPLES = 2001
SETTLED = 1e-9  # of a lowest value
FOLD_COSINE = math.cos(math.radians(179.0))  # normals so nearly opposite have none between them
SAMPLES_PER_SPAN = 33  # of a B-spline, whose knots may stand close


class DefectKind(Enum):
    """Why a surface cannot be cut along its rulings."""

    COINCIDENT = "coincident"  # both directrices
    ZERO_RULING_INSIDE = "zero_ruling_inside"
    ZERO_RULING_END = "zero_ruling_end"
    CROSSING = "crossing"  # of the directrices
    STANDSTILL = "standstill"  # of the lower directrix, inside
    TWIST = "twist"  # the normal turns by 90 degrees or more along a ruling
    FOLD = "fold"  # between the directrices


@dataclass(frozen=True, slots=True)
class Defect:
    """A defect and its place; ``v`` is nan where the whole ruling is meant.

    ``turn_deg``: by how much the normal turns along the ruling at ``u``, of a twist.
    """

    kind: DefectKind
    u: float
    v: float = math.nan
    turn_deg: float = math.nan


def defect(surface: Surface) -> Defect | None:
    """The first reason why ``surface`` cannot be cut, or None."""
    with np.errstate(over="ignore"):  # rates of a weight of 1e-300: too large to be the lowest
        for audit in (_zero_ruling, _standstill, _crossing, _fold):  # a crossing is also a fold
            found = audit(surface)
            if found is not None:
                return found
    return None


def _breaks(surface: Surface) -> Array:
    """Where spans of the directrices begin, and 1."""
    curves = (surface.upper, surface.lower)
    return distinct(np.concatenate([getattr(curve, "breaks", (0.0, 1.0)) for curve in curves]))


def _grid(surface: Surface) -> Array:
    breaks = _breaks(surface)
    even = np.linspace(0.0, 1.0, SAMPLES)
    if len(breaks) <= 2:
        return even
    spans = np.linspace(breaks[:-1], breaks[1:], SAMPLES_PER_SPAN)
    return distinct(np.concatenate([even, spans.ravel()]))


def _column(value: Vector, u: Array) -> Vector:
    x, y, z = (np.broadcast_to(c, u.shape) for c in value)
    return x, y, z


def _lowest(value: Callable[[Array], Array], u: Array) -> tuple[float, float]:
    """(u, value) of the lowest value over 0 <= u <= 1: every dip of the samples ``u`` is zoomed into."""
    f = np.nan_to_num(value(u), nan=np.inf)
    padded = np.concatenate(([np.inf], f, [np.inf]))
    dips = np.flatnonzero((f <= padded[:-2]) & (f <= padded[2:]) & (f < np.inf))
    low, high = float(f.min()), float(f.max())
    flat = high - low <= SETTLED * abs(low)  # as the turn of an upright wall's normals, but for rounding
    dips = dips[np.argsort(f[dips], kind="stable")][: 1 if flat else 16]
    if not len(dips):
        return math.nan, math.inf
    return min((_zoom(value, float(u[i])) for i in dips), key=lambda found: found[1])


def _zoom(value: Callable[[Array], Array], u: float) -> tuple[float, float]:
    half, best = 1.0 / (SAMPLES - 1), math.inf
    for k in range(8):
        grid, before = np.clip(u + np.linspace(-half, half, 41), 0.0, 1.0), best
        f = np.nan_to_num(value(grid), nan=np.inf)
        i = int(np.argmin(f))
        if f[i] < best:
            u, best = float(grid[i]), float(f[i])
        if k >= 3 and before - best <= SETTLED * abs(best):  # within 1e-7 of u nothing is gained any more
            break
        half *= 0.1
    return u, best


def _least_along(held: Array | None, way: Array) -> float:
    """How far (mm) along ``way`` all lies at least that these points hold; -inf where none are known."""
    size = float(np.sqrt(way @ way))
    return float((held @ way).min()) / size if held is not None and size > 0.0 else -math.inf


def _middle(held: Array | None) -> Array:
    return np.zeros(3) if held is None else np.asarray(held.mean(axis=0))


def _zero_ruling(surface: Surface) -> Defect | None:
    rulings = hull(surface.ruling_curve)
    if _least_along(rulings, _middle(rulings)) > ZERO_MM:
        return None

    def length(u: Array) -> Array:
        return np.asarray(norm(_column(surface.ruling(u, np), u), np))

    if float(np.max(length(_grid(surface)))) <= ZERO_MM:
        return Defect(DefectKind.COINCIDENT, 0.0)
    u, least = _lowest(length, _grid(surface))
    if least > ZERO_MM:
        return None
    inside = 1e-6 < u < 1.0 - 1e-6
    return Defect(DefectKind.ZERO_RULING_INSIDE if inside else DefectKind.ZERO_RULING_END, u)


def _standstill(surface: Surface) -> Defect | None:
    rates = hull(surface.lower, 1)
    if _least_along(rates, _middle(rates)) > ZERO_MM:
        return None

    def speed(u: Array) -> Array:
        tangent = _column(surface.lower.derivative(u, 1, np), u)
        # At the ends themselves a standstill is legal: the limit from inside serves.
        share = np.asarray(norm(tangent, np)) / np.maximum(np.minimum(u, 1.0 - u), 1e-7)
        return np.where((u > 1e-6) & (u < 1.0 - 1e-6), share, np.inf)

    # Speed over distance from the nearer end: does not dip towards an end that stands still.
    u, least = _lowest(speed, _grid(surface))
    return Defect(DefectKind.STANDSTILL, u) if least <= ZERO_MM else None


def turned(surface: Surface) -> tuple[float, float]:
    """(largest turn of the normal along a ruling in rad, its u); pi where it has none at C1."""
    u, least = _lowest(partial(_turn_cosine, surface), _grid(surface))
    return math.acos(min(1.0, max(-1.0, least))), u


def _fold(surface: Surface) -> Defect | None:
    """The normal turns by 90 degrees or more along a ruling; and where it is no normal any more."""
    u, least = _lowest(partial(_turn_cosine, surface), _grid(surface))
    if least > 1e-9:
        return None
    top, bottom, _ = _end_normals(surface, np.array([u]))
    along = float(dot(top, bottom)[0])
    square = float(dot(bottom, bottom)[0])
    v = 1.0 if least < -1.5 else max(0.0, -along / (square - along))
    if least <= FOLD_COSINE:
        return Defect(DefectKind.FOLD, u, v)
    return Defect(DefectKind.TWIST, u, v, math.degrees(math.acos(least)))


def _end_normals(surface: Surface, u: Array) -> tuple[Vector, Vector, Array]:
    """N(u, v) = (C1 - C0) x ((1 - v) C0' + v C1') at v = 0 and 1: linear in v, v = 0 turns it most.

    And the product of the lengths of C1 - C0 and C1'.
    """
    down = scale(_column(surface.ruling(u, np), u), -1.0)
    lower = _column(surface.tangent(u, np), u)
    upper = _column(surface.upper.derivative(u, 1, np), u)
    lower = _as_fast_as(lower, _column(surface.lower.derivative(u, 1, np), u))
    return cross(down, upper), cross(down, lower), np.asarray(norm(down, np) * norm(lower, np))


def _turn_cosine(surface: Surface, u: Array) -> Array:
    """Of the angle between the normals at both ends of a ruling; -2 where C1' is along it."""
    top, bottom, size = _end_normals(surface, u)
    height, width = norm(top, np), norm(bottom, np)
    # A tip (C0' = 0) has no normal of its own and is legal; C1' along the ruling is not.
    with np.errstate(invalid="ignore", divide="ignore"):
        turned = np.where(height <= 1e-9 * size, 1.0, dot(top, bottom) / (height * width))
    return np.where(width <= 1e-9 * size, -2.0, turned)


def _as_fast_as(limit: Vector, tangent: Vector) -> Vector:
    """A limit tangent with a length of its own where the tangent is 0."""
    zero = norm(tangent, np) == 0.0
    x, y, z = (np.where(zero, a, b) for a, b in zip(limit, tangent, strict=True))
    return x, y, z


def _crossing(surface: Surface) -> Defect | None:
    """A point both directrices have in common, at whatever parameters, inside both."""
    above, below = hull(surface.upper), hull(surface.lower)
    up = _middle(above) - _middle(below)
    if _least_along(above, up) + _least_along(below, -up) > ZERO_MM:
        return None  # a plane lies between them
    u = np.linspace(0.0, 1.0, max(201, min(801, 8 * len(_breaks(surface)))))
    upper = np.array(_column(surface.upper.at(u, np), u))
    lower = np.array(_column(surface.lower.at(u, np), u))
    squares = ((upper[:, :, None] - lower[:, None, :]) ** 2).sum(axis=0)
    order = np.argsort(squares, axis=None, kind="stable")[:8]
    for i, j in zip(*np.unravel_index(order, squares.shape), strict=True):
        a, b, gap = _meet(surface, float(u[i]), float(u[j]))
        if gap <= ZERO_MM and 1e-4 < a < 1.0 - 1e-4 and 1e-4 < b < 1.0 - 1e-4:
            return Defect(DefectKind.CROSSING, b)
    return None


def _meet(surface: Surface, a: float, b: float) -> tuple[float, float, float]:
    """Where C0(a) and C1(b) come nearest, by Gauss-Newton from a sampled start: (a, b, gap in mm)."""
    for _ in range(30):
        gap = np.array(subtract(surface.upper.at(a), surface.lower.at(b)))
        slopes = np.array([surface.upper.derivative(a), scale(surface.lower.derivative(b), -1.0)]).T
        step = np.linalg.lstsq(slopes, -gap, rcond=1e-9)[0]
        a, b = (min(1.0, max(0.0, x + float(d))) for x, d in zip((a, b), step, strict=True))
    gap = np.array(subtract(surface.upper.at(a), surface.lower.at(b)))
    return a, b, float(np.sqrt(gap @ gap))


def concave_radius(surface: Surface, side_sign: float) -> tuple[float, float]:
    """(smallest concave radius in mm, its u) at C1 for a cutter on ``side_sign`` of the normal.

    Taken in the plane normal to the ruling; (inf, nan) where that side is nowhere
    concave. With S = C1(u) + w a(u), a the axis and t = C1' - (C1' a) a the tangent
    in that plane: curvature = (C1'' n - 2 (C1' a)(a' n)) / |t|^2.
    """

    def bend(u: Array) -> Array:
        # Beside an end where C1 stands still C1' may be 0: no normal there.
        with np.errstate(invalid="ignore", divide="ignore"):
            ruling = _column(surface.ruling(u, np), u)
            length = norm(ruling, np)
            axis, normal = scale(ruling, 1.0 / length), surface.normal(u, np)
            tangent = _column(surface.lower.derivative(u, 1, np), u)
            along = dot(tangent, axis)
            across = subtract(tangent, scale(axis, along))
            turn = dot(surface.ruling_curve.derivative(u, 1, np), normal) / length
            hollow = dot(surface.lower.derivative(u, 2, np), normal) - 2.0 * along * turn
            return np.asarray(-side_sign * hollow / dot(across, across))

    u, least = _lowest(bend, _grid(surface))
    # Radii beyond a kilometre are rounding of straight lines.
    return (-1.0 / least, u) if least < -1e-6 else (math.inf, math.nan)


# What holds a curve: points whose convex hull it never leaves.
#
# Most walls are seen to be sound by that alone, without a sample of them.


def hull(curve: Curve, order: int = 0) -> Array | None:
    """Points (N, 3) in whose convex hull the curve, or its first derivative, stays; None: not known."""
    points: list[Vector] = []
    if isinstance(curve, Bezier):
        points = list(curve.points if order == 0 else curve.hodograph)
    elif isinstance(curve, Line):
        points = [curve.start, curve.end] if order == 0 else [curve.derivative(0.0)]
    elif isinstance(curve, Arc):
        points = _of_arc(curve, order)
    elif isinstance(curve, BSpline) and order == 0:  # weights are positive
        points = [point for span in curve.spans for point in span]
    found = np.array(points, dtype=float)
    return found if len(points) and bool(np.isfinite(found).all()) else None


def _of_arc(arc: Arc, order: int) -> list[Vector]:
    """The corners of a square about the circle, at both ends of its rise."""
    a, b = scale(arc.first, arc.sweep_rad**order), scale(arc.second, arc.sweep_rad**order)
    bases = [arc.rise] if order else [arc.centre, add(arc.centre, arc.rise)]
    signs = [(p, q) for p in (-1.0, 1.0) for q in (-1.0, 1.0)]
    return [add(base, add(scale(a, p), scale(b, q))) for base in bases for p, q in signs]
