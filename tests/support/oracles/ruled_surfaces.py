"""Ruled surfaces evaluated a second time, by other means than the controller's: the tests' own oracle.

De Casteljau for points, its differences for derivatives, arc length by summing up a fine
grid. Slow and plain on purpose; nothing of ``controller`` is used.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

Points = Sequence[Sequence[float]]
GRID = 4000  # intervals of the arc length, each with Simpson's rule
STEP = 1e-6  # of u, for differences


def casteljau(points: Points, u: np.ndarray) -> np.ndarray:
    """Points of a Bezier curve, (N, 3)."""
    rows = [np.broadcast_to(np.asarray(p, dtype=float), (len(u), 3)) for p in points]
    t = u[:, None]
    while len(rows) > 1:
        rows = [(1.0 - t) * a + t * b for a, b in itertools.pairwise(rows)]
    return rows[0]


def derivative(points: Points, u: np.ndarray) -> np.ndarray:
    """The curve's derivative with respect to u, (N, 3)."""
    p = np.asarray(points, dtype=float)
    return casteljau((len(p) - 1) * np.diff(p, axis=0), u)


class Placed:
    """What both surfaces of the paper do with a cutter beside their lower curve (Eq. 5 and 8)."""

    def tip(self, u: np.ndarray, offset: float) -> np.ndarray:
        raise NotImplementedError

    def axis(self, u: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def off(
        self, tips: np.ndarray, axes: np.ndarray, offset: float, guess: np.ndarray
    ) -> tuple[float, float]:
        """How far poses (N, 3) are off at most: tips from their path (mm), axes from those there (deg).

        The place on the path is the nearest one, by Gauss and Newton from ``guess`` (N,).
        """
        u = guess.copy()
        for _ in range(6):
            inner = np.clip(u, STEP, 1.0 - STEP)
            rate = (self.tip(inner + STEP, offset) - self.tip(inner - STEP, offset)) / (2.0 * STEP)
            gap = tips - self.tip(u, offset)
            u = np.clip(u + (gap * rate).sum(axis=1) / (rate * rate).sum(axis=1), 0.0, 1.0)
        off = np.linalg.norm(np.cross(self.axis(u), axes), axis=1)
        far = np.linalg.norm(self.tip(u, offset) - tips, axis=1)
        return float(far.max()), float(np.degrees(np.arcsin(np.minimum(off, 1.0))).max())


class Ruled(Placed):
    """A pair of Bezier curves as G52 means it."""

    def __init__(self, upper: Points, lower: Points) -> None:
        self.upper, self.lower = upper, lower
        grid = np.linspace(0.0, 1.0, 2 * GRID + 1)
        speed = np.linalg.norm(derivative(lower, grid), axis=1)
        part = (speed[:-2:2] + 4.0 * speed[1::2] + speed[2::2]) / (6.0 * GRID)
        self._u, self._s = grid[::2], np.concatenate([[0.0], np.cumsum(part)])

    @property
    def length(self) -> float:
        return float(self._s[-1])

    def s_at(self, u: np.ndarray) -> np.ndarray:
        """Arc length of the lower curve up to ``u``: the grid's, and Simpson's rule within a cell."""
        cell = np.clip((u * GRID).astype(int), 0, GRID - 1)
        low = self._u[cell]
        places = [derivative(self.lower, low + share * (u - low)) for share in (0.0, 0.5, 1.0)]
        a, b, c = (np.linalg.norm(d, axis=1) for d in places)
        return self._s[cell] + (u - low) * (a + 4.0 * b + c) / 6.0

    def nearest(self, points: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """u of the lower curve's points nearest to ``points`` (N, 3): Newton from ``guess``."""
        u = guess.copy()
        for _ in range(4):
            d = derivative(self.lower, u)
            gap = points - casteljau(self.lower, u)
            u = np.clip(u + np.einsum("ij,ij->i", gap, d) / np.einsum("ij,ij->i", d, d), 0.0, 1.0)
        return u

    def axis(self, u: np.ndarray) -> np.ndarray:
        """Unit vectors from the lower to the upper curve, (N, 3)."""
        ruling = casteljau(self.upper, u) - casteljau(self.lower, u)
        return ruling / np.linalg.norm(ruling, axis=1)[:, None]

    def tip(self, u: np.ndarray, offset: float) -> np.ndarray:
        """Eq. 5: offset to the right of the travel with the upper curve up; negative to the left."""
        down = casteljau(self.lower, u) - casteljau(self.upper, u)
        normal = np.cross(down, derivative(self.lower, u))
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        return casteljau(self.lower, u) + offset * normal


class Frustum(Placed):
    """The cone of G51: circles about +Z."""

    def __init__(
        self, start: Sequence[float], centre: Sequence[float], height: float, radius: float, sweep_deg: float
    ) -> None:
        self.start, self.centre = np.asarray(start, float), np.asarray(centre, float)
        self.height, self.radius, self.sweep = height, radius, np.radians(sweep_deg)
        self._bottom = float(np.linalg.norm((self.start - self.centre)[:2]))
        dx, dy = (self.start - self.centre)[:2]
        self._from = np.arctan2(dy, dx)

    @property
    def length(self) -> float:
        return float(abs(self.sweep) * self._bottom)

    def s_at(self, u: np.ndarray) -> np.ndarray:
        return u * self.length

    def _out(self, u: np.ndarray) -> np.ndarray:
        at = self._from + u * self.sweep
        return np.stack([np.cos(at), np.sin(at), 0.0 * at], axis=1)

    def contact(self, u: np.ndarray) -> np.ndarray:
        return self.centre + self._bottom * self._out(u)

    def axis(self, u: np.ndarray) -> np.ndarray:
        ruling = (self.radius - self._bottom) * self._out(u) + np.array([0.0, 0.0, self.height])
        return ruling / np.linalg.norm(ruling, axis=1)[:, None]

    def tip(self, u: np.ndarray, offset: float) -> np.ndarray:
        """Right of the travel is outside where the sweep is positive; the normal lies across the ruling."""
        out, axis = self._out(u), self.axis(u)
        along = np.sign(self.sweep) * np.stack([-out[:, 1], out[:, 0], 0.0 * u], axis=1)
        return self.contact(u) + offset * np.cross(along, axis)
