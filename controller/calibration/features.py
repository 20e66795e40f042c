"""What a probe can touch on a part: the surfaces of its program, planes, bores, bosses, spheres (part frame).

Of every feature is asked, for points (N, 3) near it, where it is next to them (its *feet*), and its unit
normals there. A surface tells u and v with them; a foot on one of its edges is no place to measure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from controller.calibration.refusal import Refusal
from controller.geometry.arrays import Array, columns
from controller.geometry.surfaces import Surface

ALONG, ACROSS = 193, 13  # of the grid that the search for a foot begins on
STEPS = 12  # of Newton
EDGE = 1e-6  # of u and v


@dataclass(frozen=True, eq=False)
class Feet:
    """Of N points: the feet and unit normals there (N, 3), and u, v (N,), nan where there are none."""

    points: Array
    normals: Array
    u: Array
    v: Array

    @property
    def at_edge(self) -> NDArray[np.bool_]:
        """Whether a foot is on an edge of its surface: there the point may be beside it."""
        ends = (np.minimum(self.u, 1.0 - self.u) < EDGE) | (np.minimum(self.v, 1.0 - self.v) < EDGE)
        return np.asarray(ends & ~np.isnan(self.u))


class Feature(Protocol):
    def feet(self, points: Array) -> Feet:
        """Next to points (N, 3)."""
        ...


@dataclass(frozen=True, eq=False)
class Ruled:
    """A surface of the program."""

    surface: Surface

    def at(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """S, dS/du and dS/dv, each (N, 3)."""
        upper, lower = (columns(c.at(u, np), len(u)) for c in (self.surface.upper, self.surface.lower))
        rates = (columns(c.derivative(u, 1, np), len(u)) for c in (self.surface.upper, self.surface.lower))
        upper_rate, lower_rate = rates
        w = v[:, None]
        return (1.0 - w) * upper + w * lower, (1.0 - w) * upper_rate + w * lower_rate, lower - upper

    def feet(self, points: Array) -> Feet:
        grid_u, grid_v = (
            g.ravel() for g in np.meshgrid(np.linspace(0, 1, ALONG), np.linspace(0, 1, ACROSS), indexing="ij")
        )
        grid = self.at(grid_u, grid_v)[0]
        nearest = [int(np.argmin(((grid - p) ** 2).sum(axis=1))) for p in points]
        u, v = grid_u[nearest], grid_v[nearest]
        for _ in range(STEPS):
            du, dv = self._step(points, u, v)
            u, v = np.clip(u + du, 0.0, 1.0), np.clip(v + dv, 0.0, 1.0)
        place, along, across = self.at(u, v)
        return Feet(place, _unit(np.cross(along, across)), u, v)

    def _step(self, points: Array, u: Array, v: Array) -> tuple[Array, Array]:
        """Of Gauss and Newton; where an edge is in the way of one only the other moves."""
        place, along, across = self.at(u, v)
        off = points - place
        a, b, c = ((x * y).sum(axis=1) for x, y in ((along, along), (along, across), (across, across)))
        e, f = (off * along).sum(axis=1), (off * across).sum(axis=1)
        det = a * c - b * b
        sound = det > 1e-12 * a * c
        safe = np.where(sound, det, 1.0)
        du, dv = np.where(sound, (c * e - b * f) / safe, 0.0), np.where(sound, (a * f - b * e) / safe, 0.0)
        out_u = ((u <= 0.0) & (du < 0.0)) | ((u >= 1.0) & (du > 0.0))
        out_v = ((v <= 0.0) & (dv < 0.0)) | ((v >= 1.0) & (dv > 0.0))
        du = np.where(out_u, 0.0, np.where(out_v, e / np.maximum(a, 1e-300), du))
        return du, np.where(out_v, 0.0, np.where(out_u, f / np.maximum(c, 1e-300), dv))


def places(surface: Surface, along: int, across: int) -> Iterator[tuple[float, float, Array, Array]]:
    """(u, v, point, unit normal dS/dv x dS/du) at so many places, evenly and off the edges, row by row."""
    for v in (np.arange(across) + 0.5) / across:
        u = (np.arange(along) + 0.5) / along
        points, rate, ruling = Ruled(surface).at(u, np.full(along, v))
        for k, normal in enumerate(_unit(np.cross(ruling, rate))):
            yield float(u[k]), float(v), points[k], normal


@dataclass(frozen=True, eq=False)
class Plane:
    """All points with normal . x = height_mm."""

    normal: Array
    height_mm: float

    def feet(self, points: Array) -> Feet:
        off = points @ self.normal - self.height_mm
        return _without(points - off[:, None] * self.normal, np.broadcast_to(self.normal, points.shape))


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A bore or a boss: a line in space, and a radius about it."""

    point: Array
    axis: Array
    radius_mm: float

    def feet(self, points: Array) -> Feet:
        from_point = points - self.point
        along = (from_point @ self.axis)[:, None] * self.axis
        out = _unit(from_point - along)
        return _without(self.point + along + self.radius_mm * out, out)


@dataclass(frozen=True, eq=False)
class Ball:
    centre: Array
    radius_mm: float

    def feet(self, points: Array) -> Feet:
        out = _unit(points - self.centre)
        return _without(self.centre + self.radius_mm * out, out)


def _without(points: Array, normals: Array) -> Feet:
    none = np.full(len(points), math.nan)
    return Feet(points, np.asarray(normals), none, none)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=1), 1e-300)[:, None])


KINDS = "line N, plane NX NY NZ HEIGHT, bore X Y RADIUS, boss X Y RADIUS, sphere X Y Z RADIUS"


def named(name: str, surfaces: dict[int, Surface], file: str) -> Feature:
    """The feature of a name: ``line 10``, ``plane 0 0 1 -5``, ``bore 20 30 8`` ... Raises Refusal."""
    kind, *rest = name.split() or [""]
    try:
        values = [float(one) for one in rest]
    except ValueError:
        values = []
    if kind == "line" and len(values) == 1 and int(values[0]) in surfaces:
        return Ruled(surfaces[int(values[0])])
    if kind == "plane" and len(values) == 4 and np.linalg.norm(values[:3]) > 1e-9:
        size = float(np.linalg.norm(values[:3]))
        return Plane(np.array(values[:3]) / size, values[3] / size)
    if kind in ("bore", "boss") and len(values) == 3 and values[2] > 0.0:
        return Cylinder(np.array([*values[:2], 0.0]), np.array([0.0, 0.0, 1.0]), values[2])
    if kind == "sphere" and len(values) == 4 and values[3] > 0.0:
        return Ball(np.array(values[:3]), values[3])
    lines = ", ".join(map(str, sorted(surfaces))) or "-"
    raise Refusal("no_feature", file=file, feature=name, kinds=KINDS, lines=lines)
