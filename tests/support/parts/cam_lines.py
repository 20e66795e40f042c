"""Five-axis programs as CAM systems write them, and how far a path is from their lines."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from controller.geometry.arrays import Array

WIDTH_MM = 60.0  # of a row
OVER_MM = 0.5  # from row to row


def places(count: int, step_mm: float = 0.1) -> Array:
    """(count, 6): tip and tool vector, to and fro over a gently curved surface with a tilting axis.

    Lines of about ``step_mm``; rows along X, the way to the next row along Y, axis near
    the surface's normal and leaning more from row to row.
    """
    per_row, over = round(WIDTH_MM / step_mm), max(1, round(OVER_MM / step_mm))
    k = np.arange(count)
    row, i = np.divmod(k, per_row + over)
    along = np.minimum(i, per_row) * step_mm
    x = np.where(row % 2 == 0, along, WIDTH_MM - along) - WIDTH_MM / 2.0
    y = OVER_MM * row + np.maximum(i - per_row, 0) * step_mm
    y = 25.0 * np.sin(y / 40.0)  # any number of rows on one part
    z = 4.0 * np.cos(x / 25.0) + 2.0 * np.sin(y / 20.0)
    i_, j_ = 4.0 / 25.0 * np.sin(x / 25.0) + 0.15, -0.1 * np.cos(y / 20.0) + 0.2 + 0.1 * np.sin(x / 40.0)
    vector = np.stack([i_, j_, np.ones(count)], axis=1)
    vector /= np.sqrt((vector * vector).sum(axis=1))[:, None]
    return np.column_stack([x, y, z, vector])


def rotaries(vectors: Array) -> Array:
    """A and C in degrees (N, 2) of the trunnion (tilt A carrying C) for tool vectors (N, 3); no jumps."""
    x, y, z = vectors.T
    a, c = np.arctan2(np.hypot(x, y), z), np.unwrap(np.arctan2(x, y))
    return np.degrees(np.stack([a, c], axis=1))


def program(at: Array, vectors: bool, head: str = "G21 G90 G64 P0.01", feed: float = 3000.0) -> Iterator[str]:
    """The lines of a program through ``at`` (N, 6): G43.5 with I J K, or G43.4 with A C (trunnion)."""
    if vectors:
        words = [f"I{i:.6f} J{j:.6f} K{k:.6f}" for i, j, k in at[:, 3:].tolist()]
    else:
        words = [f"A{a:.4f} C{c:.4f}" for a, c in rotaries(at[:, 3:]).tolist()]
    tips = [f"X{x:.4f} Y{y:.4f} Z{z:.4f}" for x, y, z in at[:, :3].tolist()]
    yield f"{head}\n{'G43.5' if vectors else 'G43.4'} H1\n"
    x, y, z = at[0, :3].tolist()
    yield f"G0 X{x:.4f} Y{y:.4f} Z{z + 5.0:.4f} {words[0]}\nG1 Z{z:.4f} F{feed:g}\n"
    for tip, word in zip(tips[1:], words[1:], strict=True):
        yield f"{tip} {word}\n"
    yield "M30\n"


def corners(at: Array) -> Array:
    """Corners (N + 1, 3) of the feed lines of ``program``, as it rounds them."""
    tips = np.round(at[:, :3], 4)
    return np.concatenate([tips[:1] + np.array([0.0, 0.0, 5.0]), tips])


def distance(points: Array, corners: Array) -> Array:
    """Distance (N,) of each point (N, 3) from the nearest segment of the polyline ``corners`` (M, 3)."""
    a, b = corners[:-1], corners[1:]
    way = b - a
    square = np.maximum((way * way).sum(axis=1), 1e-300)
    found = np.empty(len(points))
    for first in range(0, len(points), 500):
        away = points[first : first + 500, None, :] - a
        share = np.clip((away * way).sum(axis=2) / square, 0.0, 1.0)
        off = away - share[..., None] * way
        found[first : first + 500] = np.sqrt((off * off).sum(axis=2).min(axis=1))
    return found


def degrees_between(a: Array, b: Array) -> Array:
    """Angles (N,) between unit vectors."""
    side = np.cross(a, b)
    return np.degrees(np.arctan2(np.sqrt((side * side).sum(axis=1)), (a * b).sum(axis=1)))


def length_mm(at: Array) -> float:
    return math.fsum(np.sqrt((np.diff(at[:, :3], axis=0) ** 2).sum(axis=1)).tolist())
