"""How deep a tool gets into the part on any way: discs along its axis against the material side of walls.

Nothing of the plan is asked: a wall is a dense grid of points of two Beziers with normals by differences,
and a disc cuts as deep as its radius is more than its middle is in front of the wall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from scipy.spatial import KDTree

from controller.geometry.vectors import Frame
from controller.machine.kinematics import Kinematics
from controller.machine.model import Tool

DISC_MM = 1.0  # from disc to disc
GRID = (161, 41)  # points of a wall, along and across
ENOUGH_MM = 12.0  # behind a wall: what is as far from all of it is not told to be in the part


@dataclass(frozen=True, eq=False)
class Wall:
    """Points and normals to the tool's side, (along, across, 3); table frame."""

    points: np.ndarray
    normals: np.ndarray

    @cached_property
    def _nearest(self) -> KDTree:
        return KDTree(self.points.reshape(-1, 3))

    @staticmethod
    def of(
        upper: Sequence[Sequence[float]], lower: Sequence[Sequence[float]], side: float, part: Frame
    ) -> Wall:
        """From control points of both directrices; ``side``: 1 with the cutter on the right (G42)."""
        u, v = np.linspace(0.0, 1.0, GRID[0]), np.linspace(0.0, 1.0, GRID[1])
        top, base = (bezier(np.asarray(p, float), u) for p in (upper, lower))
        points = base[:, None] + v[None, :, None] * (top - base)[:, None]
        points = np.stack(part.to_parent(tuple(np.moveaxis(points, 2, 0))), axis=2)
        along, up = np.gradient(points, axis=0), np.gradient(points, axis=1)
        out = side * np.cross(along, up)
        return Wall(points, out / np.linalg.norm(out, axis=2, keepdims=True))

    def in_front(self, middles: np.ndarray) -> np.ndarray:
        """How far (N,) places are in front of it, by its nearest point; beyond its edges how far off."""
        _, nearest = self._nearest.query(middles)
        away = middles - self.points.reshape(-1, 3)[nearest]
        i, j = np.unravel_index(nearest, GRID)
        inside = (i > 0) & (i < GRID[0] - 1) & (j > 0) & (j < GRID[1] - 1)
        ahead = (away * self.normals.reshape(-1, 3)[nearest]).sum(axis=1)
        return np.where(inside, ahead, np.linalg.norm(away, axis=1))


def bezier(points: np.ndarray, u: np.ndarray) -> np.ndarray:
    n = len(points) - 1
    basis = np.array([comb(n, k) * u**k * (1.0 - u) ** (n - k) for k in range(n + 1)])
    return basis.T @ points


def depths(joints: np.ndarray, tool: Tool, walls: Sequence[Wall], kinematics: Kinematics) -> np.ndarray:
    """How deep (mm) a tool is in the walls, at each row of joints (N, axes); below 0: off them."""
    found = np.full(len(joints), -np.inf)
    pose = kinematics.forward(tuple(joints.T), tool.length_mm, np)
    tips, axes = (np.stack([np.broadcast_to(c, len(joints)) for c in v], axis=1) for v in pose)
    for wall in walls:
        points = wall.points.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        reach = tool.radius_mm + ENOUGH_MM
        height = float(np.linalg.norm(high - low)) + reach
        discs = tips[:, None] + np.arange(0.0, height, DISC_MM)[:, None] * axes[:, None]
        rows, number = np.nonzero(((discs > low - reach) & (discs < high + reach)).all(axis=2))
        np.maximum.at(found, rows, tool.radius_mm - wall.in_front(discs[rows, number]))
    return found
