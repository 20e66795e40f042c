"""What a cut comes out as: the deviation of each surface, with its worst places, and gouges.

    judge(surfaces, passes, table)  every surface against every pass of every tool

A surface is looked at on an even (u, v) grid that is doubled until the largest overcut and
undercut change by less than ``SETTLED_MM``; at each grid the worst cells are zoomed into. Three
zones are told apart: the surface with its own cut alone, without its ends; the ends; and the
whole of it with everything else that the program does beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from controller.geometry.arrays import Array, Flags, columns, distinct
from controller.geometry.vectors import Vector
from controller.machine.model import Tool
from controller.machine.tool_profile import cutter
from controller.verify.envelope import deviation
from controller.verify.nominal import Nominal, grid, peaks
from controller.verify.passes import height_mm
from controller.verify.sweep import Pass, Sweep
from controller.workers import Spread, here

INSIDE = (0.02, 0.98)  # of u: without the ends
SETTLED_MM = 1e-4  # change of the largest deviation from one grid to the next
FIRST_GRID = (65, 9)
MAX_LEVELS = 4
ZOOMED = 4  # worst places of a grid
ZOOM_POINTS = 7  # of a zoomed cell, along and across
ZOOM_STEPS = 8
UNCUT_MM = 0.5  # at least, or a radius: what is further from all that cuts is uncut, and in no mean
SURFACE_S = 0.5  # that one takes, about
PERCENTILES = (50.0, 90.0, 99.0)


@dataclass(frozen=True, slots=True)
class Worst:
    """The largest deviation of one sign and its place."""

    mm: float  # signed: negative overcut
    u: float  # of the block's whole surface
    v: float
    place: Vector  # part frame, mm

    def to_dict(self) -> dict[str, Any]:
        return {
            "mm": _short(self.mm),
            "u": _short(self.u),
            "v": _short(self.v),
            "place_mm": list(map(_short, self.place)),
        }


@dataclass(frozen=True, slots=True)
class Zone:
    """Deviation over a part of a surface, mm.

    ``mean`` and ``percentiles`` are of its amount where it is cut; ``undercut`` is of all of it.
    """

    overcut: Worst | None  # None: nothing is cut too deep
    undercut: Worst | None
    mean_mm: float
    percentiles_mm: Mapping[str, float]
    uncut: float  # share of the grid that no tool comes within its radius of
    points: int  # of the last grid
    settled_mm: float  # change of the largest deviation at the last doubling

    @property
    def largest_mm(self) -> float:
        return (
            max(abs(one.mm) for one in (self.overcut, self.undercut) if one)
            if self.overcut or self.undercut
            else 0.0
        )

    def to_dict(self) -> dict[str, Any]:
        return {
            "largest_mm": _short(self.largest_mm),
            "overcut": self.overcut.to_dict() if self.overcut else None,
            "undercut": self.undercut.to_dict() if self.undercut else None,
            "mean_mm": _short(self.mean_mm),
            "percentiles_mm": {name: _short(value) for name, value in self.percentiles_mm.items()},
            "uncut": _short(self.uncut),
            "points": self.points,
            "settled_mm": _short(self.settled_mm),
        }


@dataclass(frozen=True, eq=False, slots=True)
class Map:
    """Deviation of a whole surface with everything, on the last grid, for pictures: (along, across)."""

    t: Array
    points: Array  # (along, across, 3), part frame


@dataclass(frozen=True, eq=False, slots=True)
class Judged:
    """One surface as cut."""

    nominal: Nominal
    inside: Zone  # its own cut alone, u within ``INSIDE``
    ends: Zone  # its own cut alone, the rest of u
    whole: Zone  # with every pass beside it
    map: Map = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        return {
            "line": self.nominal.line,
            "tool": self.nominal.tool.number,
            "side": "right" if self.nominal.side > 0.0 else "left",
            "inside": self.inside.to_dict(),
            "ends": self.ends.to_dict(),
            "whole": self.whole.to_dict(),
        }


def _short(value: float) -> float:
    """To a thousandth of a micrometre."""
    return round(float(value), 6)


class Cutting:
    """Every tool's passes with its cutter: what a point of a surface is held against."""

    def __init__(self, passes: Mapping[Tool, Sequence[Pass]], surfaces: Sequence[Nominal]) -> None:
        self.tools = {
            tool: (cutter(tool), Sweep(rows, height_mm(tool, surfaces)))
            for tool, rows in passes.items()
            if rows
        }

    def of(self, keep: Callable[[Tool, Pass], bool]) -> Cutting:
        """With some of the passes only."""
        made = Cutting({}, ())
        for tool, (body, sweep) in self.tools.items():
            kept = [i for i, one in enumerate(sweep.passes) if keep(tool, one)]
            if kept:
                made.tools[tool] = (body, sweep.only(kept))
        return made

    def own(self, nominal: Nominal) -> Cutting:
        """The cut of a surface alone."""
        return self.of(lambda _, one: one.name == "cut" and one.line == nominal.line)

    def deviation(self, nominal: Nominal, u: Array, v: Array) -> tuple[Array, Array]:
        """Signed deviation (N,) mm at u and v (N,), and distances (N,) to what cuts; nan, inf: nothing."""
        points, normals = nominal.points(u, v), nominal.normals(u, v)
        t, distance = np.full(len(u), np.nan), np.full(len(u), np.inf)
        for body, sweep in self.tools.values():
            found = deviation(points, normals, sweep, body)
            t, distance = np.fmin(t, found.t), np.minimum(distance, found.distance)
        return t, distance


def judge(
    surfaces: Sequence[Nominal],
    passes: Mapping[Tool, Sequence[Pass]],
    progress: Callable[[float], None] = lambda _: None,
    spread: Spread = here,
) -> list[Judged]:
    """Every surface as cut by its own cut and by all passes. ``progress`` gets the share that is done."""
    found = []
    for one in spread(_Judge(surfaces, passes), range(len(surfaces)), SURFACE_S):
        found.append(one)
        progress(len(found) / len(surfaces))
    return found


class _Judge:
    """Of one surface by its number."""

    def __init__(self, surfaces: Sequence[Nominal], passes: Mapping[Tool, Sequence[Pass]]) -> None:
        self._surfaces, self._passes = surfaces, passes

    def __call__(self, k: int) -> Judged:
        one, cutting = self._surfaces[k], self._cutting
        alone = Field(one, cutting.own(one))
        inside = alone.zone(*INSIDE)[0]
        ends = _joined(alone.zone(0.0, INSIDE[0])[0], alone.zone(INSIDE[1], 1.0)[0])
        whole, seen = Field(one, cutting).zone(0.0, 1.0)
        return Judged(one, inside, ends, whole, seen)

    @cached_property
    def _cutting(self) -> Cutting:
        return Cutting(self._passes, self._surfaces)


def _joined(a: Zone, b: Zone) -> Zone:
    """Two zones of as many points, as one."""
    over = [one.overcut for one in (a, b) if one.overcut]
    under = [one.undercut for one in (a, b) if one.undercut]
    return Zone(
        min(over, key=lambda w: w.mm) if over else None,
        max(under, key=lambda w: w.mm) if under else None,
        0.5 * (a.mean_mm + b.mean_mm),
        {name: max(value, b.percentiles_mm[name]) for name, value in a.percentiles_mm.items()},
        0.5 * (a.uncut + b.uncut),
        a.points + b.points,
        max(a.settled_mm, b.settled_mm),
    )


class Field:
    """The deviation of one surface over (u, v) under some passes."""

    def __init__(self, nominal: Nominal, cutting: Cutting) -> None:
        self.nominal, self._cutting = nominal, cutting

    def __call__(self, u: Array, v: Array) -> Array:
        return self._cutting.deviation(self.nominal, u, v)[0]

    def _on_grid(self, u: Array, v: Array) -> tuple[Array, Flags]:
        """The deviation (N,), and which points stand uncut (N,): a radius or more from all that cuts."""
        t, distance = self._cutting.deviation(self.nominal, u, v)
        return t, distance > max(self.nominal.tool.radius_mm, UNCUT_MM)

    def once(self, along: int, across: int) -> tuple[Zone, Map]:
        """The whole surface on one grid, its worst places zoomed into: no more is looked at."""
        u, v = grid(along, across)
        t, uncut = self._on_grid(u, v)
        cell = (1.0 / (along - 1), 1.0 / (across - 1))
        look = partial(self._worst, t, (u, v), cell, (0.0, 1.0))
        cut = np.where(uncut, np.nan, t)
        return self._zone(cut, (look(-1.0), look(1.0)), np.inf), self._map(cut, (u, v), across)

    def zone(self, low: float, high: float) -> tuple[Zone, Map]:
        """Over low <= u <= high, on grids that are doubled until the largest deviations stand."""
        along, across = _first_grid(self.nominal, low, high)
        worst: tuple[Worst | None, Worst | None] = (None, None)
        settled = np.inf
        for _ in range(MAX_LEVELS):
            u, v = grid(along, across, (low, high))
            t, uncut = self._on_grid(u, v)
            cell = ((high - low) / (along - 1), 1.0 / (across - 1))
            look = partial(self._worst, t, (u, v), cell, (low, high))
            before, worst = worst, (look(-1.0), look(1.0))
            settled = max(abs(_mm(a) - _mm(b)) for a, b in zip(before, worst, strict=True))
            if settled < SETTLED_MM:
                break
            along, across = 2 * along - 1, 2 * across - 1
        cut = np.where(uncut, np.nan, t)
        return self._zone(cut, worst, settled), self._map(cut, (u, v), len(distinct(v)))

    def _worst(
        self,
        t: Array,
        at: tuple[Array, Array],
        cell: tuple[float, float],
        ends: tuple[float, float],
        sign: float,
    ) -> Worst | None:
        """The largest deviation of a sign: the worst points of the grid, zoomed into."""
        size = np.nan_to_num(sign * t, nan=-np.inf)
        u, v = at
        starts = peaks(size, len(distinct(v)), ZOOMED)
        if not len(starts):
            return None
        a, b, half = u[starts], v[starts], np.array(cell)
        best = size[starts]
        for _ in range(ZOOM_STEPS):
            a, b, after = self._zoomed(a, b, half, ends, sign)
            gained, best = float(np.max(after - best)), after
            half = half / (0.5 * (ZOOM_POINTS - 1))
            if gained < 0.01 * SETTLED_MM:
                break
        k = int(np.argmax(best))
        if best[k] <= 0.0:
            return None
        place = self.nominal.place(float(a[k]), float(b[k]))
        return Worst(sign * float(best[k]), self.nominal.block_u(float(a[k])), float(b[k]), place)

    def _zoomed(
        self, a: Array, b: Array, half: Array, ends: tuple[float, float], sign: float
    ) -> tuple[Array, Array, Array]:
        """The best points of small grids about (a, b) (K,)."""
        step = np.linspace(-1.0, 1.0, ZOOM_POINTS)
        x, y = (m.ravel() for m in np.meshgrid(step, step, indexing="ij"))
        u = np.clip(a[:, None] + half[0] * x, *ends)
        v = np.clip(b[:, None] + half[1] * y, 0.0, 1.0)
        size = np.nan_to_num(sign * self(u.ravel(), v.ravel()), nan=-np.inf).reshape(u.shape)
        best, rows = np.argmax(size, axis=1), np.arange(len(a))
        return u[rows, best], v[rows, best], size[rows, best]

    def _zone(self, t: Array, worst: tuple[Worst | None, Worst | None], settled: float) -> Zone:
        amount = np.abs(t[~np.isnan(t)])
        shares = np.percentile(amount, PERCENTILES) if len(amount) else np.zeros(len(PERCENTILES))
        return Zone(
            worst[0],
            worst[1],
            float(amount.mean()) if len(amount) else 0.0,
            {f"{p:g}": float(value) for p, value in zip(PERCENTILES, shares, strict=True)},
            float(np.isnan(t).mean()),
            len(t),
            settled,
        )

    def _map(self, t: Array, at: tuple[Array, Array], across: int) -> Map:
        u, v = at
        points = columns(self.nominal.surface.point(u, v, np), len(u))
        return Map(t.reshape(-1, across), points.reshape(-1, across, 3))


def _mm(worst: Worst | None) -> float:
    return worst.mm if worst else 0.0


def _first_grid(nominal: Nominal, low: float, high: float) -> tuple[int, int]:
    """Fewer points along a narrow zone."""
    along, across = FIRST_GRID
    return max(9, int(along * min(1.0, 2.0 * (high - low)))), across
