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
EDGE_MM = 0.05  # as exactly as the grid has a wall's edge
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
        return Wall.between(base[:, None] + v[None, :, None] * (top - base)[:, None], side, part)

    @staticmethod
    def between(points: np.ndarray, side: float, part: Frame) -> Wall:
        """From points (GRID, 3) in the frame of the program, along and up."""
        points = np.stack(part.to_parent(tuple(np.moveaxis(points, 2, 0))), axis=2)
        along, up = np.gradient(points, axis=0), np.gradient(points, axis=1)
        out = side * np.cross(along, up)
        return Wall(points, out / np.linalg.norm(out, axis=2, keepdims=True))

    def in_front(self, middles: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """How far (N,) the middles of discs are in front of it, by its nearest point.

        Beyond its edges how far off in the plane of the disc; infinite where the edge is below the disc, or
        further above it than the next disc is.
        """
        _, nearest = self._nearest.query(middles)
        away = middles - self.points.reshape(-1, 3)[nearest]
        i, j = np.unravel_index(nearest, GRID)
        inside = (i > 0) & (i < GRID[0] - 1) & (j > 0) & (j < GRID[1] - 1)
        ahead = (away * self.normals.reshape(-1, 3)[nearest]).sum(axis=1)
        up = (away * axes).sum(axis=1)
        off = np.sqrt(np.maximum((away * away).sum(axis=1) - up * up, 0.0))
        return np.where(inside, ahead, np.where((up > EDGE_MM) | (up < -DISC_MM), np.inf, off))


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
        reach = max(tool.radius_mm, *(wide for _, _, wide in tool.holder), 0.0) + ENOUGH_MM
        up = np.arange(0.0, float(np.linalg.norm(high - low)) + reach, DISC_MM)
        discs, thick = tips[:, None] + up[:, None] * axes[:, None], thickness(tool, up)
        rows, number = np.nonzero(((discs > low - reach) & (discs < high + reach)).all(axis=2))
        in_front = wall.in_front(discs[rows, number], axes[rows])
        np.maximum.at(found, rows, thick[number] - in_front)
    return found


def thickness(tool: Tool, up: np.ndarray) -> np.ndarray:
    """Radii of a tool so far above its tip: a corner, a flank that goes on upwards, and what holds it."""
    corner, slope = tool.corner_mm, np.tan(tool.taper_rad)
    flank = tool.radius_mm + slope * (up - corner) + corner * (1.0 / np.cos(tool.taper_rad) - 1.0)
    ball = tool.radius_mm - corner + np.sqrt(np.maximum(corner**2 - np.maximum(corner - up, 0.0) ** 2, 0.0))
    thick = np.where(up < corner * (1.0 - np.sin(tool.taper_rad)), ball, flank)
    for low, high, radius in tool.holder:
        thick = np.where((up >= low) & (up <= high), np.maximum(thick, radius), thick)
    return thick
