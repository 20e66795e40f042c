"""CL files and programs as CAM systems write them for the flank of a cutter along a ruled surface."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.curves import Bezier
from controller.geometry.surfaces import RuledSurface
from controller.geometry.vectors import Vector


def random_surface(seed: int) -> RuledSurface:
    """Upright, some 40 mm long and 12 mm high, twisted by a few degrees, its bends wider than a cutter."""
    draw = np.random.default_rng(seed)
    low = np.array([[0.0, 0.0, 0.0], [14.0, 3.0, 0.5], [27.0, -3.0, -0.5], [40.0, 1.0, 0.0]])
    low += draw.uniform(-2.0, 2.0, (4, 3)) * (1.0, 1.0, 0.3)
    high = low + np.array([0.0, 0.0, 12.0]) + draw.uniform(-1.5, 1.5, (4, 3))
    return RuledSurface(*(Bezier(tuple(_vector(p) for p in points)) for points in (high, low)))  # type: ignore[arg-type]


def _vector(point: Iterable[float]) -> Vector:
    x, y, z = (float(q) for q in point)
    return x, y, z


def along(surface: RuledSurface, radius_mm: float, count: int, above_mm: float = 0.0) -> tuple[Array, Array]:
    """Tips and axes of a cutter beside it (Eq. 5), on its right where the radius is positive."""
    u = np.linspace(0.0, 1.0, count)
    pose = surface.pose(u, radius_mm, np)
    tips, axes = (np.stack([np.broadcast_to(c, count) for c in v], axis=1) for v in (pose.tip, pose.axis))
    return tips + above_mm * axes, axes


def goto(tips: Array, axes: Array, digits: int = 5) -> list[str]:
    return [
        "GOTO/" + ",".join(f"{value:.{digits}f}" for value in (*tip, *axis))
        for tip, axis in zip(tips, axes, strict=True)
    ]


def cl_file(rows: Sequence[tuple[Array, Array]], radius_mm: float, digits: int = 5) -> str:
    """Each row with a rapid to it, a plunge along its axis, and leads on which the axis stands."""
    text = ["$$ swarf", "UNITS/MM", f"CUTTER/{2.0 * radius_mm:.4f}", "SPINDL/8000,RPM,CLW"]
    for tips, axes in rows:
        first, last = tips[1] - tips[0], tips[-1] - tips[-2]
        begin, end = tips[0] - first, tips[-1] + last
        text += ["RAPID", *goto(np.array([begin + 20.0 * axes[0]]), axes[:1]), "FEDRAT/300.0,MMPM"]
        text += goto(np.array([begin]), axes[:1], digits)
        text += goto(tips, axes, digits)
        text += goto(np.array([end, end + 20.0 * axes[-1]]), axes[[-1, -1]], digits)
    return "\n".join([*text, "FINI", ""])
