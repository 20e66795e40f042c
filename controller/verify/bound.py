"""How well a flank could cut a surface at all: a search of its own beside the placement that was found.

The axis is where it crosses the lines of both edges: each crossing is moved off the surface and along the
travel by a cubic spline of u with ``CONTROLS`` control points, so the motion is smooth all over the surface.
The largest deviation of the surface's points from what that sweeps is made least by linear programs within a
growing and shrinking step, from the motion that was found, from the normals of both edges, and from some way
off both.

It shares no code with the planner's search: other unknowns (offsets of a start over u, a third of the control
points), the sweep by many sampled positions instead of nearest ones that are sought, and linear programs by
HiGHS instead of an interior point of its own. It proves nothing, but it has looked elsewhere. Only the flank
counts, endless, and only u from ``INSIDE``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, CubicSpline
from scipy.optimize import linprog

from controller.geometry.arrays import Array, columns
from controller.geometry.placement import AT_LOWER, Placed
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Vector
from controller.verify.console import say
from controller.verify.judge import INSIDE
from controller.verify.nominal import Nominal, grid

CONTROLS, DEGREE = 12, 3
POINTS = (49, 11)  # along and across
POSES = 241
STARTS = 6  # the motion that was found, the offset normals, and some way off both
STEPS = 30
NOTHING_MM = 2e-5  # off: nothing is sought below that
MAX_TURNS = 5000  # of one linear program
SETTLED = 2e-3  # gain of a step, as a share, below which a search ends
OWN_POINTS, OWN_POSES = (129, 25), 2001
BELOW_UPPER = 0.02  # of the ruling: at C0 itself there may be no normal
WORTH = 1.2  # times the best: a placement that is not free is then told of one that is


@dataclass(frozen=True, slots=True)
class Bound:
    """How far one placed surface is off (flank, inside), and the best that the search comes to."""

    line: int
    off_mm: float
    off_u: float  # where
    best_mm: float
    best_u: float
    placed: str  # 'single', 'double', 'optimal'

    @property
    def ratio(self) -> float:
        return self.off_mm / max(self.best_mm, 1e-9)

    @property
    def sentence(self) -> str:
        """For people, with what is freer where a placement keeps to the ruling."""
        told = say(
            "bound.off",
            off=_micro(self.off_mm),
            off_u=self.off_u,
            best=_micro(self.best_mm),
            best_u=self.best_u,
            ratio=self.ratio,
        )
        freer = self.ratio > WORTH and self.placed != "optimal"
        return f"{told}{say('bound.placed', placed=self.placed) if freer else ''}."

    def to_dict(self) -> dict[str, Any]:
        shown = {name: getattr(self, name) for name in self.__slots__}
        return {**shown, "ratio": round(self.ratio, 4), "sentence": self.sentence}


def bound(nominal: Nominal, progress: Callable[[float], None] = lambda _: None) -> Bound | None:
    """The bound of one surface; None where no cutter is placed off its ruling."""
    placed = nominal.surface
    if not isinstance(placed, Placed):
        return None
    u, v = grid(*OWN_POINTS, INSIDE)
    points = _points(placed, u, v)
    found, dice = list[Array](), np.random.default_rng(7)
    for k, motion in enumerate(_starts(placed, dice)):
        found.append(np.abs(motion.least().sweep(points, OWN_POSES)))
        progress((k + 1) / STARTS)
    own = np.abs(_Motion.of(placed, *_axis_found(placed, OWN_POSES)).sweep(points, OWN_POSES))
    best = min([*found, own], key=np.max)
    off, least = int(own.argmax()), int(best.argmax())
    return Bound(
        nominal.line, float(own[off]), float(u[off]), float(best[least]), float(u[least]), _kind(placed)
    )


def _kind(placed: Placed) -> str:
    if placed.through is not None:
        return "optimal"
    return "single" if placed.normals_v == AT_LOWER else "double"


def _micro(mm: float) -> str:
    return f"{1e3 * mm:.1f} um"


def _starts(placed: Placed, dice: np.random.Generator) -> list[_Motion]:
    firm = [_Motion.of(placed, *_axis_found(placed, POSES)), _Motion.of(placed, *_normals(placed, POSES))]
    return [*firm, *(firm[k % 2].thrown(dice) for k in range(STARTS - len(firm)))]


def _axis_found(placed: Placed, poses: int) -> tuple[Array, Array, Array, Array]:
    """Where the placed axis passes the edges, (poses, 3) each; radius and height at the lower one."""
    u = np.linspace(0.0, 1.0, poses)
    tip, axis = (_rows(v, poses) for v in placed.pose(u, placed.offset_mm, np))
    low, high = (((_rows(c.at(u, np), poses) - tip) * axis).sum(axis=1) for c in (placed.lower, placed.upper))
    radius = abs(placed.offset_mm) + (low - placed.shift_mm) * math.tan(placed.taper_rad)
    return tip + low[:, None] * axis, tip + high[:, None] * axis, radius, low


def _normals(placed: Placed, poses: int) -> tuple[Array, Array, Array, Array]:
    """The edges of the surface, each off along its own normal."""
    u, edges = np.linspace(0.0, 1.0, poses), list[Array]()
    inside = np.clip(u, 1e-6, 1.0 - 1e-6)  # a curve may stand still at its end
    ruling = _rows(placed.ruling(u, np), poses)
    rates = [_rows(c.derivative(inside, 1, np), poses) for c in (placed.lower, placed.upper)]
    for curve, share in ((placed.lower, 0.0), (placed.upper, 1.0 - BELOW_UPPER)):
        normal = _unit(np.cross((1.0 - share) * rates[0] + share * rates[1], ruling))
        edges.append(_rows(curve.at(u, np), poses) + placed.offset_mm * normal)
    low = np.full(poses, placed.shift_mm)
    return edges[0], edges[1], np.full(poses, abs(placed.offset_mm)), low


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """An axis over u, by its points next to both edges."""

    placed: Placed
    low: Array  # (M, 3)
    high: Array
    radius: Array  # (M,) at the lower one
    rise: Array  # (M,) of the lower one above the tip
    ways: Array  # (M, 2, 3) off the axis: out and along the travel
    scale: float  # mm, of a step

    @staticmethod
    def of(placed: Placed, low: Array, high: Array, radius: Array, rise: Array) -> _Motion:
        axis = _unit(high - low)
        travel = np.gradient(low + high, axis=0)
        out = _unit(np.cross(axis, travel))
        ways = np.stack([out, np.cross(out, axis)], axis=1)
        return _Motion(placed, low, high, radius, rise, ways, 0.4 * abs(placed.offset_mm))

    def moved(self, x: Array) -> _Motion:
        """By the splines of the control points ``x`` (rows of ``CONTROLS``)."""
        steps = _basis(len(self.low)) @ x.reshape(-1, CONTROLS).T
        low = self.low + (steps[:, :2, None] * self.ways).sum(axis=1)
        high = self.high + (steps[:, 2:4, None] * self.ways).sum(axis=1)
        radius = self.radius + (steps[:, 4] if steps.shape[1] > 4 else 0.0)
        return replace(self, low=low, high=high, radius=radius)

    def thrown(self, dice: np.random.Generator) -> _Motion:
        return self.moved(0.3 * self.scale * dice.normal(size=4 * CONTROLS))

    def sweep(self, points: Array, poses: int) -> Array:
        """What is left (mm, signed) on points (N, 3) by so many poses."""
        if poses != len(self.low):
            return self._finer(poses).sweep(points, poses)
        parts = np.array_split(points, max(1, len(points) // 64))
        return np.concatenate([_vertex(self._gaps(part)[0]) for part in parts]) * self._cosine

    @property
    def _cosine(self) -> float:
        return math.cos(self.placed.taper_rad)

    def _finer(self, poses: int) -> _Motion:
        """The same by more poses, by cubics."""
        rows = np.column_stack([self.low, self.high, self.radius, self.rise])
        fine = CubicSpline(np.linspace(0.0, 1.0, len(rows)), rows)(np.linspace(0.0, 1.0, poses))
        return _Motion.of(self.placed, fine[:, :3], fine[:, 3:6], *fine[:, 6:].T)

    def _gaps(self, points: Array) -> tuple[Array, Array, Array]:
        """From points (N, 3) to the flank at each pose (N, M); heights above the lower points; distances."""
        way = _unit(self.high - self.low)
        height = points @ way.T - (self.low * way).sum(axis=1)
        square = (points * points).sum(axis=1)[:, None] - 2.0 * points @ self.low.T
        square += (self.low * self.low).sum(axis=1)
        off = np.sqrt(np.maximum(square - height * height, 1e-18))
        gap = off - self.radius - height * math.tan(self.placed.taper_rad)
        return gap if self.placed.barrel is None else self._to_barrel(off, height), height, off

    def _to_barrel(self, off: Array, height: Array) -> Array:
        """The gap (N, M) where the flank is an arc about a point beyond the axis."""
        (far, middle), lean = self.placed.barrel or (0.0, 0.0), self.placed.taper_rad
        widest = self.radius + (middle - self.rise) * math.tan(lean)
        across, up = off - widest + far * math.cos(lean), height + self.rise - middle - far * math.sin(lean)
        return np.asarray((np.hypot(across, up) - far) / self._cosine)

    def least(self) -> _Motion:
        """With the largest deviation made least."""
        points = _points(self.placed, *grid(*POINTS, INSIDE))
        motion, y, reach = self, self.sweep(points, POSES), 1.0
        least = float(np.abs(y).max())
        for _ in range(STEPS if least > NOTHING_MM else 0):
            trial = motion.moved(self.scale * motion._step(points, y, reach))
            there = trial.sweep(points, POSES)
            now = float(np.abs(there).max())
            if now >= least:
                reach *= 0.25
                if reach < 1e-4:
                    break
                continue
            gained, motion, y, least = least - now, trial, there, now
            reach = min(1.0, 2.0 * reach)
            if least < NOTHING_MM or (gained < SETTLED * least and reach > 0.01):
                break
        return motion

    def _step(self, points: Array, y: Array, reach: float) -> Array:
        """The step (in scales, none beyond ``reach``) that makes the largest of |y + slopes step| least."""
        size = float(np.abs(y).max())
        slopes, y = self.scale * self._slopes(points) / size, y / size
        one = np.ones((len(y), 1))
        limits = [(-reach, reach)] * slopes.shape[1] + [(0.0, None)]
        cost = np.append(np.zeros(slopes.shape[1]), 1.0)
        rows = np.block([[slopes, -one], [-slopes, -one]])
        found = linprog(
            cost,
            A_ub=rows,
            b_ub=np.concatenate([-y, y]),
            bounds=limits,
            method="highs",
            options={"maxiter": MAX_TURNS},
        )
        return np.zeros(slopes.shape[1]) if found.x is None else np.asarray(found.x[:-1])

    def _slopes(self, points: Array) -> Array:
        """How the deviation of each point changes with the control points, where the flank is nearest."""
        gap, height, off = self._gaps(points)
        rows, k = np.arange(len(points)), gap.argmin(axis=1)
        length = np.sqrt(((self.high - self.low) ** 2).sum(axis=1))[k]
        way = (self.high - self.low)[k] / length[:, None]
        h, far = height[rows, k], off[rows, k]
        away = (self.low[k] + h[:, None] * way - points) / far[:, None]
        across = (away[:, None, :] * self.ways[k]).sum(axis=2)
        high = (h / length)[:, None]
        parts = [across * (1.0 - high), across * high]
        if self.placed.taper_rad > 0.0:
            parts.append(-np.ones((len(points), 1)))
        shares = np.concatenate(parts, axis=1)
        basis = _basis(len(self.low))[k]
        return np.asarray((shares[:, :, None] * basis[:, None, :]).reshape(len(points), -1) * self._cosine)


def _basis(poses: int) -> Array:
    """What the spline at each of so many poses is of its control points, (poses, CONTROLS)."""
    inner = np.linspace(0.0, 1.0, CONTROLS - DEGREE + 1)
    knots = np.concatenate(([0.0] * DEGREE, inner, [1.0] * DEGREE))
    return np.asarray(BSpline.design_matrix(np.linspace(0.0, 1.0, poses), knots, DEGREE).toarray())


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.sqrt((v * v).sum(axis=-1, keepdims=True)), 1e-300))


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
