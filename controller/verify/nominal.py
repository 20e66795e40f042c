"""The surface as it should be: points, normals and hollows of a cut, in the frame of the table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array, columns
from controller.geometry.placement import Strategy
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Frame, Vector
from controller.machine.model import Tool
from controller.memory import remembered

Index = NDArray[np.int64]

ALONG, ACROSS = 257, 9  # of the table of lengths and of the bounds
MAX_TABLES = 32  # surfaces whose tables are kept


@dataclass(frozen=True, eq=False)
class Nominal:
    """The ruled surface of one cut."""

    surface: Surface
    part: Frame  # seen from the table frame
    side: float  # +1: the cutter is on Eq. 5's side (right of the travel), -1: on the left
    tool: Tool
    line: int  # of the program
    motion: int = -1  # which segment of the path cuts it
    allowance_mm: float = 0.0  # what is to stay on it
    tolerance_mm: float | None = None  # of its form; None: none is asked for
    joint_tolerance_mm: float = 0.0  # what a neighbour may take off it, where they meet in a corner
    placement: Strategy = Strategy.SINGLE  # of the cutter, as the program asks for it
    share: tuple[float, float] = (0.0, 1.0)  # of its block, in the block's u, that it is

    def block_u(self, u: float) -> float:
        """The parameter of the block's whole surface at its own."""
        return self.share[0] + (self.share[1] - self.share[0]) * u

    def points(self, u: Array, v: Array) -> Array:
        """S(u, v) in the table frame, (N, 3) mm, for u and v (N,)."""
        return _rows(self.part.to_parent(self.surface.point(u, v, np)), len(u))

    def normals(self, u: Array, v: Array) -> Array:
        """Unit normals (N, 3) out of the part, to the cutter's side.

        Where the upper curve stands still (the tip of a cone) the ruling's own normal at C1 serves.
        """
        tangent, ruling = self._tangents(u, v), self._rulings(u)
        cross = np.cross(tangent, ruling)
        size = np.sqrt((cross * cross).sum(axis=1))
        lower = _rows(self.surface.normal(u, np), len(u))
        lost = size <= 1e-12 * np.sqrt((ruling * ruling).sum(axis=1))
        unit = np.where(lost[:, None], lower, cross / np.where(lost, 1.0, size)[:, None])
        turned = _rows(self.part.turn((unit[:, 0], unit[:, 1], unit[:, 2])), len(u))
        return self.side * turned

    def hollow(self, u: Array, v: Array) -> Array:
        """Curvature (1/mm) across the ruling, positive where the surface is hollow towards the cutter.

        In the plane normal to the ruling: (S_uu n - 2 (S_u a)(a' n)) / |t|^2, a the ruling's
        direction and t the part of S_u across it. 0 where S_u has no such part.
        """
        tangent, ruling = self._tangents(u, v), self._rulings(u)
        length = np.sqrt((ruling * ruling).sum(axis=1))
        axis = ruling / length[:, None]
        along = (tangent * axis).sum(axis=1)
        across = tangent - along[:, None] * axis
        square = (across * across).sum(axis=1)
        normal = np.cross(tangent, ruling)
        size = np.sqrt((normal * normal).sum(axis=1))
        sound = (size > 1e-9) & (square > 1e-12)
        normal = normal / np.where(sound, size, 1.0)[:, None]
        turn = (_rows(self.surface.ruling_curve.derivative(u, 1, np), len(u)) * normal).sum(axis=1) / length
        bend = (self._derivative(u, v, 2) * normal).sum(axis=1) - 2.0 * along * turn
        return np.asarray(np.where(sound, self.side * bend / np.where(sound, square, 1.0), 0.0))

    def _tangents(self, u: Array, v: Array) -> Array:
        return self._derivative(u, v, 1)

    def _rulings(self, u: Array) -> Array:
        return _rows(self.surface.ruling(u, np), len(u))

    def _derivative(self, u: Array, v: Array, order: int) -> Array:
        upper, lower = (
            _rows(curve.derivative(u, order, np), len(u))
            for curve in (self.surface.upper, self.surface.lower)
        )
        return np.asarray((1.0 - v)[:, None] * upper + v[:, None] * lower)

    # ---- sizes -----------------------------------------------------------------------

    def length_between(self, u: Array, other: Array, v: Array) -> Array:
        """Way (mm) on the surface at height v from u to another u, all (N,)."""
        return np.abs(self._length_at(other, v) - self._length_at(u, v))

    def _length_at(self, u: Array, v: Array) -> Array:
        x, y = u * (ALONG - 1), v * (ACROSS - 1)
        i, j = np.clip(x.astype(int), 0, ALONG - 2), np.clip(y.astype(int), 0, ACROSS - 2)
        x, y, table = x - i, y - j, _lengths(self)
        low = table[i, j] * (1.0 - x) + table[i + 1, j] * x
        high = table[i, j + 1] * (1.0 - x) + table[i + 1, j + 1] * x
        return np.asarray(low * (1.0 - y) + high * y)

    @cached_property
    def size(self) -> tuple[float, float]:
        """(longest curve along u, longest ruling), mm."""
        table = _table(self)
        rulings = np.linalg.norm(table[:, 0] - table[:, -1], axis=1)
        return float(_lengths(self)[-1].max()), float(rulings.max())

    @cached_property
    def ball(self) -> tuple[Array, float]:
        """Centre (3,) and radius of a ball about the whole surface, table frame."""
        flat = _table(self).reshape(-1, 3)
        centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
        return centre, float(np.linalg.norm(flat - centre, axis=1).max())

    def place(self, u: float, v: float) -> Vector:
        """A point of it in the part frame, for a sentence."""
        x, y, z = self.surface.point(u, v)
        return float(x), float(y), float(z)


# Of the surfaces that are looked at just now: there may be thousands, and these are large.
@remembered(MAX_TABLES)
def _table(nominal: Nominal) -> Array:
    """Points (ALONG, ACROSS, 3) on an even grid, table frame."""
    u, v = grid(ALONG, ACROSS)
    return nominal.points(u, v).reshape(ALONG, ACROSS, 3)


@remembered(MAX_TABLES)
def _lengths(nominal: Nominal) -> Array:
    """Length from u = 0 along curves of constant v, (ALONG, ACROSS)."""
    steps = np.linalg.norm(np.diff(_table(nominal), axis=0), axis=2)
    return np.concatenate([np.zeros((1, ACROSS)), np.cumsum(steps, axis=0)])


def grid(along: int, across: int, u: tuple[float, float] = (0.0, 1.0)) -> tuple[Array, Array]:
    """u and v of an even grid, each (along * across,), v running faster."""
    a, b = np.meshgrid(np.linspace(*u, along), np.linspace(0.0, 1.0, across), indexing="ij")
    return a.ravel(), b.ravel()


def peaks(size: Array, across: int, most: int) -> Index:
    """Where the largest of what is between the points of a grid may be, so many points across; values (N,).

    Indices of finite local maxima (of equal neighbours the first) that half of the steepest way to a
    neighbour lifts to the largest value or above it, as a crease may; the ``most`` highest of these.
    """
    rows = size.reshape(-1, across)
    along = len(rows)
    wide = np.pad(rows, 1, constant_values=np.nan)
    is_peak, steepest = np.isfinite(rows), np.zeros(rows.shape)
    known = np.where(is_peak, rows, 0.0)
    for i, j in ((i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)):
        beside = wide[i : i + along, j : j + across]
        is_peak &= ~((beside >= rows) if (i, j) < (1, 1) else (beside > rows))
        steepest = np.fmax(steepest, known - np.where(np.isfinite(beside), beside, known))
    found = np.flatnonzero(is_peak)
    lifted = (rows + 0.5 * steepest).ravel()[found]
    order = np.argsort(-lifted, kind="stable")[:most]
    return np.asarray(found[order[lifted[order] >= size[found].max(initial=-np.inf)]])


def _rows(vector: Vector, n: int) -> Array:
    """A vector of components (N,) or floats as (N, 3)."""
    return columns(vector, n)
