"""Placed cuts judged by what placing means: the axis through two points off the surface."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly
from support.machines.stepped_runs import Cut
from support.oracles import tool_paths

from controller.geometry.placement import Placed
from controller.motion.motions import SurfaceCut

TIP_MM = 1e-6
_SMALL = """G21 G90 T2 M6
S9000 M3
G41 P{}
G52 X0. Y0. Z5. F{}
X3. Y0.2 Z5.
X6. Y0.1 Z5.
X9. Y0. Z5.
X0. Y0. Z0.
X3. Y0. Z0.
X6. Y0.3 Z0.
X9. Y0.5 Z0.
M5
M30
"""
LINE = 4  # of its surface


def small(placement: int, feed: str = "1500.") -> str:
    """A program of one small twisted surface, for whose placement a search takes seconds."""
    return _SMALL.format(placement, feed)


def bezier(points: object) -> BPoly:
    return BPoly(np.array(points, dtype=float)[:, None, :], [0.0, 1.0])


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def off_the_axis(placed: Placed, u: np.ndarray, tips: np.ndarray, axes: np.ndarray) -> float:
    """Largest distance (mm) of the tool from where ``placed`` wants it at ``u`` (N,), by definition."""
    if placed.through is not None:
        return _off_the_curves(placed, u, tips, axes)
    upper, lower = bezier(placed.base.upper.points), bezier(placed.base.lower.points)
    ruling = upper(u) - lower(u)
    off = 0.0
    for v in placed.points_v:
        normal = unit(np.cross((1.0 - v) * upper(u, 1) + v * lower(u, 1), ruling))
        point = (1.0 - v) * upper(u) + v * lower(u) + placed.offset_mm * normal
        away = point - tips
        away -= (away * axes).sum(axis=1, keepdims=True) * axes
        off = max(off, float(np.linalg.norm(away, axis=1).max()))
    height = ((lower(u) - tips) * axes).sum(axis=1)
    return max(off, float(np.abs(height - placed.shift_mm).max()))


def _off_the_curves(placed: Placed, u: np.ndarray, tips: np.ndarray, axes: np.ndarray) -> float:
    upper, lower = (BPoly(np.array(c.spans).transpose(1, 0, 2), c.breaks)(u) for c in placed.through)
    wanted = unit(upper - lower)
    turned = np.linalg.norm(wanted - axes, axis=1) * np.linalg.norm(upper - lower, axis=1)
    return float(max(turned.max(), np.linalg.norm(lower - placed.shift_mm * wanted - tips, axis=1).max()))


def assert_on_placed_surfaces(done: Cut, whole: bool = True) -> int:
    """Every cutting tick where its placed surface wants it; how many surfaces there were."""
    tips, axes = tool_paths.tool(done.joints, done.machine, 0.0)
    ids, cutting = done.column("motion_id").astype(int), done.trace.cutting
    found = 0
    for k, segment in done.segments.items():
        rows = np.flatnonzero(cutting & (ids == k))
        if not segment.cutting or not len(rows):
            continue
        assert isinstance(segment.motion, SurfaceCut) and isinstance(segment.motion.surface, Placed)
        u = done.trace.u[rows]
        off = off_the_axis(segment.motion.surface, u, tips[rows], axes[rows])
        assert off < TIP_MM, f"{off:.2e} mm off the place in line {segment.place.line}"
        assert (np.diff(u) > -1e-9).all(), f"backwards in line {segment.place.line}"
        assert not whole or (u[0] < 0.05 and u[-1] > 0.95)
        found += 1
    return found
