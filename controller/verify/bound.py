"""How well a flank could cut a surface at all: a search of its own beside the placement that was found.

Short windows of rulings are looked at, each for itself. In the frame of the window's middle ruling

        e1 along it, e2 off the surface, e3 the travel

a moving axis is where it crosses the planes of the lower and the upper edge. The travel t of its lower
crossing counts as time; what is left are cubics of t:

        lower (0, a(t), t)        upper (H, b(t), c(t))        and, of a taper, the radius at the lower one

The largest deviation of the window's points from what that sweeps is made least by linear programs
within a growing and shrinking step, from many starts. Nothing of it is shared with the planner, neither
parameters nor distances nor solver. A window is freer than the whole, for its neighbours ask for nothing;
so no smooth motion can be better than the worst window, as far as the search is right: it proves nothing,
but it has looked elsewhere. Only the flank counts, endless, and only u from ``INSIDE``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from controller.geometry.arrays import columns
from controller.geometry.placement import AT_LOWER, Placed
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Vector
from controller.verify.console import say
from controller.verify.judge import INSIDE
from controller.verify.nominal import Nominal, grid

Array = NDArray[np.float64]

CENTRES = 7
HALVES = (0.1, 0.05)  # of windows, in u
TERMS = 4  # of the polynomials
POINTS = (9, 13)  # of a window, along and across
PLACES = 61  # of the axis in a window
STARTS = 4  # the motion that was found, the offset normals, and some way off both
STEPS = 25
SETTLED = 2e-3  # gain of a step, as a share, below which a search ends
REACH = (1.5, 0.2)  # by which the axis runs over a window: of the radius, of the ruling
SAME = 1.02  # a window whose cubics cannot even do what was found is too wide
OWN_POINTS, OWN_POSES = (129, 25), 2001
WHOLE = 1.2  # more than that between both is explained


@dataclass(frozen=True, slots=True)
class Bound:
    """How far one placed surface is off (flank, inside), and the best that windows of it would allow."""

    line: int
    off_mm: float
    off_u: float  # where
    best_mm: float  # of the worst window
    best_u: float
    narrow_mm: float  # the same of the narrowest windows alone
    placed: str  # 'single', 'double', 'optimal'

    @property
    def ratio(self) -> float:
        return self.off_mm / max(self.best_mm, 1e-9)

    @property
    def sentence(self) -> str:
        """For people, with the reason where both differ."""
        told = say(
            "bound.off",
            off=_micro(self.off_mm),
            off_u=self.off_u,
            best=_micro(self.best_mm),
            best_u=self.best_u,
            ratio=self.ratio,
        )
        return f"{told}{self.why}."

    @property
    def why(self) -> str:
        """What makes the difference; "" where there is next to none."""
        if self.ratio <= WHOLE:
            return ""
        if self.placed != "optimal":
            return say("bound.placed", placed=self.placed)
        if self.narrow_mm < self.best_mm / 1.05:
            return say("bound.window", narrow=_micro(self.narrow_mm))
        return say("bound.smooth")

    def to_dict(self) -> dict[str, Any]:
        shown = {name: getattr(self, name) for name in self.__slots__}
        return {**shown, "ratio": round(self.ratio, 4), "sentence": self.sentence}


def bound(nominal: Nominal, progress: Callable[[float], None] = lambda _: None) -> Bound | None:
    """The bound of one surface; None where no cutter is placed off its ruling."""
    placed = nominal.surface
    if not isinstance(placed, Placed):
        return None
    off, off_u = _own(placed)
    found, dice = dict[float, list[tuple[float, float]]](), np.random.default_rng(7)
    places = [(half, u) for half in HALVES for u in np.linspace(INSIDE[0] + half, INSIDE[1] - half, CENTRES)]
    for k, (half, u) in enumerate(places):
        window = _Window(placed, float(u), half)
        best, own = window.search(dice)
        if best <= SAME * own:
            found.setdefault(half, []).append((min(best, own), float(u)))
        progress((k + 1) / len(places))
    if not found:
        return None
    best, best_u = max(max(rows) for rows in found.values())
    narrow = max(found[min(found)])[0]
    return Bound(nominal.line, off, off_u, best, best_u, narrow, _kind(placed))


def _kind(placed: Placed) -> str:
    if placed.corrections is not None:
        return "optimal"
    return "single" if placed.normals_v == AT_LOWER else "double"


def _micro(mm: float) -> str:
    return f"{1e3 * mm:.1f} um"


def _own(placed: Placed) -> tuple[float, float]:
    """(largest deviation of the flank in mm, its u), from every one of many positions."""
    u, v = grid(*OWN_POINTS, INSIDE)
    at = np.linspace(0.0, 1.0, OWN_POSES)
    tips, axes = (_rows(vector, OWN_POSES) for vector in placed.pose(at, placed.offset_mm, np))
    points = _points(placed, u, v)
    left = np.concatenate([_left(p, tips, axes, placed) for p in np.array_split(points, len(points) // 64)])
    k = int(np.abs(left).argmax())
    return float(abs(left[k])), float(u[k])


def _left(points: Array, tips: Array, axes: Array, placed: Placed) -> Array:
    """What is left on points (N, 3), the least over all poses (M, 3)."""
    height = points @ axes.T - (tips * axes).sum(axis=1)
    square = (points * points).sum(axis=1)[:, None] - 2.0 * points @ tips.T + (tips * tips).sum(axis=1)
    radius = abs(placed.offset_mm) + (height - placed.shift_mm) * math.tan(placed.taper_rad)
    gap = np.sqrt(np.maximum(square - height * height, 0.0)) - radius
    return np.asarray(gap.min(axis=1) * math.cos(placed.taper_rad))


class _Window:
    """The rulings of u +- half, in the frame of the middle one."""

    def __init__(self, placed: Placed, u: float, half: float) -> None:
        self._placed, self._u, self._half = placed, u, half
        self._foot, self._frame, self._height = _frame(placed, u)
        a, b = grid(*POINTS, (u - half, u + half))
        self._points = self._seen(_points(placed, a, b))
        ways = self._points[b == 1.0, 2]
        more = REACH[0] * abs(placed.offset_mm) + REACH[1] * self._height
        self._t = np.linspace(ways.min() - more, ways.max() + more, PLACES)
        self._terms = np.vander(self._t, TERMS, increasing=True)
        self._tapered = placed.taper_rad > 0.0
        per = (0.5 * np.ptp(self._t)) ** -np.arange(TERMS)
        sizes = [0.4 * abs(placed.offset_mm), 0.4 * abs(placed.offset_mm), 0.3 * self._height]
        sizes += [0.2 * abs(placed.offset_mm)] if self._tapered else []
        self._scale = np.concatenate([size * per for size in sizes])

    def search(self, dice: np.random.Generator) -> tuple[float, float]:
        """(least of the largest deviations that was found, that of the motion that was placed), mm."""
        firm = [self._fitted(*self._axis_found()), self._fitted(*self._offset_normals())]
        loose = [x + 0.3 * self._scale * dice.normal(size=len(x)) for x in firm]
        own = float(np.abs(self._own()).max())
        return min(self._least(x) for x in [*firm, *loose][:STARTS]), own

    def _seen(self, points: Array) -> Array:
        return np.asarray((points - self._foot) @ self._frame.T)

    # ---- starts ----------------------------------------------------------------------

    def _around(self) -> Array:
        """Parameters (N,) about the window, as far as the surface goes."""
        return np.linspace(max(0.0, self._u - 2.0 * self._half), min(1.0, self._u + 2.0 * self._half), 41)

    def _axis_found(self) -> tuple[Array, Array, Array]:
        """Where the placed axis crosses both planes, and its radius at the lower one."""
        u, placed = self._around(), self._placed
        tip, axis = (_rows(v, len(u)) for v in placed.pose(u, placed.offset_mm, np))
        tip, axis = self._seen(tip), axis @ self._frame.T
        low, high = ((h - tip[:, :1]) / axis[:, :1] for h in (0.0, self._height))
        radius = abs(placed.offset_mm) + (low[:, 0] - placed.shift_mm) * math.tan(placed.taper_rad)
        return tip + low * axis, tip + high * axis, radius

    def _offset_normals(self) -> tuple[Array, Array, Array]:
        """The edges of the surface, each off along its own normal."""
        u, placed = self._around(), self._placed
        ruling, edges = _rows(placed.ruling(u, np), len(u)), list[Array]()
        for curve in (placed.lower, placed.upper):
            normal = np.cross(_rows(curve.derivative(u, 1, np), len(u)), ruling)
            normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
            edges.append(self._seen(_rows(curve.at(u, np), len(u)) + placed.offset_mm * normal))
        return edges[0], edges[1], np.full(len(u), abs(placed.offset_mm))

    def _fitted(self, low: Array, high: Array, radius: Array) -> Array:
        terms = np.vander(low[:, 2], TERMS, increasing=True)
        columns = [low[:, 1], high[:, 1], high[:, 2], *([radius] if self._tapered else [])]
        return np.concatenate([np.linalg.lstsq(terms, column, rcond=None)[0] for column in columns])

    def _own(self) -> Array:
        """The deviation of this window's points as they were placed."""
        placed, at = self._placed, np.linspace(0.0, 1.0, OWN_POSES)
        tips, axes = (_rows(v, OWN_POSES) for v in placed.pose(at, placed.offset_mm, np))
        return _left(self._points, self._seen(tips), axes @ self._frame.T, placed)

    # ---- the search ------------------------------------------------------------------

    def _deviation(self, x: Array) -> Array:
        """Signed, mm: of each point from what an axis of these cubics sweeps."""
        a, b, c, *more = (self._terms @ one for one in x.reshape(-1, TERMS))
        tangent = math.tan(self._placed.taper_rad)
        radius = more[0] if more else np.full(PLACES, abs(self._placed.offset_mm))
        foot = np.stack([np.zeros(PLACES), a, self._t])
        way = np.stack([np.full(PLACES, self._height), b - a, c - self._t])
        way /= np.sqrt((way * way).sum(axis=0))
        points = self._points
        height = points @ way - (foot * way).sum(axis=0)
        square = (points * points).sum(axis=1)[:, None] - 2.0 * points @ foot + (foot * foot).sum(axis=0)
        gap = np.sqrt(np.maximum(square - height * height, 0.0)) - radius - height * tangent
        return _vertex(gap) * math.cos(self._placed.taper_rad)

    def _least(self, x: Array) -> float:
        """The largest deviation, made least from ``x`` on."""
        y, reach = self._deviation(x), 1.0
        least = float(np.abs(y).max())
        for _ in range(STEPS):
            trial = x + self._scale * self._step(x, y, reach)
            there = self._deviation(trial)
            now = float(np.abs(there).max())
            if now >= least:
                reach *= 0.25
                if reach < 1e-3:
                    break
                continue
            gained, x, y, least = least - now, trial, there, now
            reach = min(1.0, 2.0 * reach)
            if gained < SETTLED * least and reach > 0.1:
                break
        return least

    def _step(self, x: Array, y: Array, reach: float) -> Array:
        """The step (in scales, none beyond ``reach``) that makes the largest of |y + slopes step| least."""
        h = 1e-4
        slopes = np.stack([self._deviation(x + h * row) - y for row in np.diag(self._scale)], axis=1) / h
        one = np.ones((len(y), 1))
        limits = [(-reach, reach)] * len(x) + [(0.0, None)]
        cost = np.append(np.zeros(len(x)), 1.0)
        rows = np.block([[slopes, -one], [-slopes, -one]])
        found = linprog(cost, A_ub=rows, b_ub=np.concatenate([-y, y]), bounds=limits, method="highs")
        return np.zeros(len(x)) if found.x is None else np.asarray(found.x[:-1])


def _frame(placed: Placed, u: float) -> tuple[Array, Array, float]:
    """Foot of the middle ruling, rows e1 e2 e3, and its length."""
    ruling = np.array(placed.ruling(u))
    height = float(np.sqrt(ruling @ ruling))
    tangents = [np.array(curve.derivative(u)) for curve in (placed.lower, placed.upper)]
    normals = [np.cross(tangent, ruling) for tangent in tangents]
    out = sum((n / max(float(np.sqrt(n @ n)), 1e-12) for n in normals), start=np.zeros(3))
    e1 = ruling / height
    e2 = math.copysign(1.0, placed.offset_mm) * out / np.sqrt(out @ out)
    e3 = np.cross(e1, e2)
    e3 = e3 if e3 @ (tangents[0] + tangents[1]) > 0.0 else -e3
    return np.array(placed.contact(u)), np.stack([e1, e2, e3]), height


def _vertex(gap: Array) -> Array:
    """The least of each row (N, K), by the parabola through the three values about it."""
    rows, k = np.arange(len(gap)), np.clip(gap.argmin(axis=1), 1, gap.shape[1] - 2)
    before, here, behind = gap[rows, k - 1], gap[rows, k], gap[rows, k + 1]
    bend = before + behind - 2.0 * here
    lower = (before - behind) ** 2 / (8.0 * np.where(bend > 0.0, bend, 1.0))
    inner = (bend > 0.0) & (here <= np.minimum(before, behind))
    return np.asarray(np.where(inner, here - lower, gap.min(axis=1)))


def _points(surface: Surface, u: Array, v: Array) -> Array:
    return _rows(surface.point(u, v, np), len(u))


def _rows(vector: Vector, n: int) -> Array:
    """A vector of components (N,) or floats as (N, 3)."""
    return columns(vector, n)
