"""How far the flank of a placed cutter is from the surface: fast, for choosing a placement.

The moving flank is the union of the flanks of all its positions. A point p of the surface is
cut by the position whose flank comes nearest, so what is left on p (or, negative, cut too deep)
is the least over u of

    s = (e(u) - rho - (h(u) - shift) tan t) cos t        e, h: p seen from the axis at u,

rho the radius beside C1 and t the taper. A barrel of radius B touches that cone in its middle: it leaves

    hypot(B + s, q) - B        q: along the cone, from the barrel's middle.

End face, corner and holder are not in it: those are
looked at by the verifier, which judges the whole cutter.
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags, distinct, rows
from controller.geometry.placement import Barrel, Placed
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Pose, Vector, dot, scale, subtract

Index = npt.NDArray[np.intp]

SEARCHED = 97  # positions among which all contacts are sought
NEAR_MM = 0.5  # that a contact may lie deeper than the position beside it
COARSE = 193  # positions among which the nearest is sought first
PARABOLAS = 6
STEP, FARTHEST, SETTLED = 1e-4, 0.03, 1e-6  # of u


class Deviation(NamedTuple):
    """At points of the surface: what is left on it (mm, negative: overcut), and what cuts it."""

    left: Array  # (N,)
    at_u: Array  # (N,) position of the cutter that comes nearest
    height: Array  # (N,) mm above the tip along its axis
    away: Array  # (3, N) unit vectors from the point to that axis


def points(surface: Surface, u: Array, v: Array) -> Array:
    """S(u, v), (3, N) mm."""
    return _stacked(surface.point(u, v, np), u)


def normals(placed: Placed, u: Array, v: Array) -> Array:
    """Unit normals (3, N) of the surface to the cutter's side; that of C1 where C0 stands still."""
    (tangent, turn), ruling = (
        [_stacked(r, u) for r in placed.rates(u, np)],
        _stacked(placed.ruling(u, np), u),
    )
    normal = np.cross(tangent + (1.0 - v) * turn, ruling, axis=0)
    lost = np.sqrt((normal * normal).sum(axis=0)) < 1e-12
    normal = np.where(lost, np.cross(tangent, ruling, axis=0), normal)
    return math.copysign(1.0, placed.offset_mm) * _unit(normal)


class Flank(Protocol):
    """A moving cutter, as ``Placed`` has it."""

    @property
    def offset_mm(self) -> float: ...
    @property
    def taper_rad(self) -> float: ...
    @property
    def shift_mm(self) -> float: ...
    @property
    def barrel(self) -> Barrel | None: ...
    def pose(self, u: Array, offset_mm: float, m: ModuleType) -> Pose: ...


class Standing(NamedTuple):
    """A flank by itself: radius (mm) at the height of the tip, and the height from which it cuts."""

    radius_mm: float
    taper_rad: float
    barrel: Barrel | None
    begins_mm: float


class Contacts(NamedTuple):
    """All positions whose flank comes nearer to a point than those beside them: M of N points."""

    of: Index  # (M,) the point
    seen: Deviation  # (M,) there
    nearest: Flags  # (M,) whether no other one of its point comes nearer


def contacts(placed: Flank, at: Array, within_mm: float, own: Array, reach: float) -> Contacts:
    """Of the points ``at`` (3, N): the nearest contact, and others that leave no more than ``within_mm``.

    ``own`` (N,): the places of their own rulings, of which those up to ``reach`` away are looked at.
    """
    windows = max(1, math.ceil(0.5 / reach))
    wide = 1.0 / windows
    window = np.minimum((own * windows).astype(np.intp), windows - 1)
    found = [
        _dips(
            placed,
            at,
            np.flatnonzero(window == k),
            (k * wide - reach, (k + 1) * wide + reach),
            within_mm,
        )
        for k in distinct(window)
    ]
    point, places, step = (np.concatenate(each) for each in zip(*found, strict=True))
    seen = of(placed, at[:, point], places, step)
    order = np.lexsort((seen.left, point))
    first = np.zeros(len(point), dtype=bool)
    first[order[np.concatenate(([True], point[order][1:] != point[order][:-1]))]] = True
    kept = first | (seen.left <= within_mm)
    return Contacts(point[kept], Deviation(*(value[..., kept] for value in seen)), first[kept])


def _dips(
    placed: Flank, at: Array, points: Index, window: tuple[float, float], within_mm: float
) -> tuple[Index, Array, Array]:
    """Positions in a window, with their step, where the flank dips towards some of the points; and these."""
    u = np.linspace(max(window[0], 0.0), min(window[1], 1.0), SEARCHED)
    gap = _gaps_of(placed, u, at[:, points]) - abs(placed.offset_mm)
    before, behind = np.full_like(gap, np.inf), np.full_like(gap, np.inf)
    before[1:], behind[:-1] = gap[:-1], gap[1:]
    # A dip between two samples may be deeper than both of them.
    dips = (gap <= before) & (gap < behind)
    dips &= gap <= np.maximum(gap.min(axis=0), within_mm + NEAR_MM)
    k, n = np.nonzero(dips)
    return points[n], u[k], np.full(len(k), u[1] - u[0])


def of(placed: Flank, at: Array, near: Array | None = None, reach: float | Array = 1.0) -> Deviation:
    """Of the points ``at`` (3, N); ``near`` (N,): where to look first, and no further off than ``reach``.

    The least of the distance is found by parabolas: at the least its place counts in the
    second order only, so that plain differences will do.
    """
    u = _nearest(placed, at) if near is None else near
    low, high = np.maximum(u - reach, 0.0), np.minimum(u + reach, 1.0)
    for _ in range(PARABOLAS):
        inner = np.clip(u, STEP, 1.0 - STEP)
        before, here, behind = _gaps(placed, at, inner)
        slope, bend = 0.5 * (behind - before) / STEP, (before - 2.0 * here + behind) / STEP**2
        step = np.where(bend > 0.0, slope / np.where(bend > 0.0, bend, 1.0), np.sign(slope) * FARTHEST)
        step = np.clip(step, -FARTHEST, FARTHEST)
        last, u = u, np.clip(inner - step, low, high)
        if float(np.abs(u - last).max()) < SETTLED:
            break
    return _seen(placed, at, u)


def _gaps(placed: Flank, at: Array, u: Array) -> Array:
    """Of each point (3, N) to the flank a step before its own ``u``, there, and behind it, (3, N).

    What is the same everywhere is left out. All at once: it is the number of calls that takes the time.
    """
    u = (u + np.array([[-STEP], [0.0], [STEP]])).ravel()
    tip, axis = placed.pose(u, placed.offset_mm, np)
    x, y, z = np.tile(at, 3)
    away: Vector = subtract((x, y, z), tip)
    height = dot(away, axis)
    foot = subtract(away, scale(axis, height))
    return _gap(placed, np.sqrt(dot(foot, foot)), height).reshape(3, -1)


def _gap(placed: Flank, across: Array, height: Array) -> Array:
    """From the flank across the axis, what is the same everywhere left out."""
    tangent, cosine = math.tan(placed.taper_rad), math.cos(placed.taper_rad)
    gap = np.asarray(across - height * tangent)
    if placed.barrel is None:
        return gap
    same = abs(placed.offset_mm) - placed.shift_mm * tangent
    return same + _bowed((gap - same) * cosine, height, placed.taper_rad, placed.barrel) / cosine


def _bowed(left: Array, height: Array, taper_rad: float, barrel: Barrel | None) -> Array:
    """What the barrel leaves where the cone that it touches leaves so much."""
    if barrel is None:
        return left
    along = (height - barrel.middle_mm + left * math.sin(taper_rad)) / math.cos(taper_rad)
    return np.asarray(np.hypot(barrel.radius_mm + left, along) - barrel.radius_mm)


def _seen(placed: Flank, at: Array, u: Array) -> Deviation:
    tip, axis = (_stacked(v, u) for v in placed.pose(u, placed.offset_mm, np))
    away = at - tip
    height = (away * axis).sum(axis=0)
    foot = away - axis * height
    across = np.sqrt((foot * foot).sum(axis=0))
    tangent, cosine = math.tan(placed.taper_rad), math.cos(placed.taper_rad)
    left = (across - abs(placed.offset_mm) - (height - placed.shift_mm) * tangent) * cosine
    left = _bowed(left, height, placed.taper_rad, placed.barrel)
    return Deviation(left, u, height, -foot / np.maximum(across, 1e-12))


def at_poses(tips: Array, axes: Array, flank: Standing, at: Array) -> Array:
    """What the flank at poses (M, 3) leaves of points ``at`` (3, N): (M, N) mm, inf below where it cuts."""
    height = axes @ at - (axes * tips).sum(axis=1)[:, None]
    square = ((at[None] - tips[:, :, None]) ** 2).sum(axis=1) - height * height
    taper_rad = flank.taper_rad
    gap = np.sqrt(np.maximum(square, 0.0)) - flank.radius_mm - height * math.tan(taper_rad)
    left = _bowed(gap * math.cos(taper_rad), height, taper_rad, flank.barrel)
    return np.where(height < flank.begins_mm, math.inf, left)


def _nearest(placed: Flank, at: Array) -> Array:
    """Among positions spread over the block the one whose flank comes nearest to each point."""
    u = np.linspace(0.0, 1.0, COARSE)
    return np.asarray(u[np.argmin(_gaps_of(placed, u, at), axis=0)])


def _gaps_of(placed: Flank, u: Array, at: Array) -> Array:
    """Of every position ``u`` (M,) to every point (3, N): (M, N), what is the same everywhere left out."""
    tips, axes = (_stacked(v, u) for v in placed.pose(u, placed.offset_mm, np))
    height = _products(axes, at) - (axes * tips).sum(axis=0)[:, None]
    square = (at * at).sum(axis=0) - 2.0 * _products(tips, at) + (tips * tips).sum(axis=0)[:, None]
    return _gap(placed, np.sqrt(np.maximum(square - height * height, 0.0)), height)


def _products(a: Array, b: Array) -> Array:
    """Of every vector of a (3, M) with every one of b (3, N): (M, N). In one thread, as ``placing``."""
    (x, y, z), (p, q, r) = a[:, :, None], b
    return np.asarray(x * p + y * q + z * r)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.sqrt((v * v).sum(axis=0)))


def _stacked(v: Vector, u: Array) -> Array:
    return rows(v, u.shape)
