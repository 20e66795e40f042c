"""Cuts for the verifier's tests: poses of a cylinder offset along one normal, written out on their own."""

from __future__ import annotations

import numpy as np
from support.oracles.drawn_tools import border

from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Frame
from controller.machine.model import Tool
from controller.verify.nominal import Nominal, grid
from controller.verify.passes import height_mm, longest, step_mm
from controller.verify.sweep import Pass, Sweep, sampled


def rows(vector: tuple, n: int) -> np.ndarray:
    return np.stack([np.broadcast_to(np.asarray(c, dtype=float), (n,)) for c in vector], axis=1)


def nominal(surface: Surface, side: float = 1.0, tool: Tool | None = None) -> Nominal:
    return Nominal(surface, Frame(), side, tool or Tool(1, "end mill", 3.0, 0.0, 60.0), 1, 0)


def single(one: Nominal, step: float = 0.0) -> Pass:
    """The paper's way: the axis parallel to the ruling, beside C1, over u instead of length."""

    def poses(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        tip, axis = one.surface.pose(u, one.side * one.tool.radius_mm, np)
        return rows(tip, len(u)), rows(axis, len(u))

    s, tips, axes = sampled(poses, 1.0, step or step_mm(one.tool), longest([one]))
    return Pass(s, tips, axes, one.line, "cut", one.motion)


def sweep(one: Nominal, step: float = 0.0) -> Sweep:
    return Sweep([single(one, step)], height_mm(one.tool, [one]))


def places(one: Nominal, along: int, across: int, u: tuple[float, float] = (0.02, 0.98)) -> tuple:
    """u, v, points and normals of an even grid."""
    a, b = grid(along, across, u)
    return a, b, one.points(a, b), one.normals(a, b)


def by_brute_force(one: Nominal, points: np.ndarray, normals: np.ndarray, poses: int = 20001) -> np.ndarray:
    """Where lines along the normals enter a flat-ended cylinder, least over many poses; nan: nowhere.

    Each line is cut with the endless cylinder (a quadratic) and with the half space above the
    end; no distance is measured, and nothing is left out.
    """
    radius = one.tool.radius_mm
    u = np.linspace(0.0, 1.0, poses)
    tip, axis = one.surface.pose(u, one.side * radius, np)
    tips, axes = rows(tip, poses), rows(axis, poses)
    found = np.empty(len(points))
    for k, (p, n) in enumerate(zip(points, normals, strict=True)):
        enter, leave = _through(p - tips, n, axes, radius)
        enter = np.where((enter < leave) & (leave > -1e-9), enter, np.inf)
        i = int(np.argmin(enter))
        found[k] = _vertex(enter, i)
    return found


def deepest(one: Nominal, points: np.ndarray, poses: int = 4001) -> float:
    """How deep (mm) the deepest of ``points`` (N, 3) gets into an endless cylinder over many poses."""
    radius = one.tool.radius_mm
    u = np.linspace(0.0, 1.0, poses)
    tip, axis = one.surface.pose(u, one.side * radius, np)
    tips, axes = rows(tip, poses), rows(axis, poses)
    off = [np.linalg.norm(np.cross(p - tips, axes), axis=1).min() for p in points]
    return float(max(0.0, radius - min(off)))


def body_by_brute_force(
    one: Nominal, points: np.ndarray, normals: np.ndarray, poses: int = 6001
) -> np.ndarray:
    """The same for cutters of every form, by halving: no distance, only whether a point is inside.

    Inside is between the ends and nearer the axis than the drawn outline at that height. From a place
    deep in the part up to the first pose that holds it.
    """
    tool, found = one.tool, np.empty(len(points))
    tip, axis = one.surface.pose(np.linspace(0.0, 1.0, poses), 0.0, np)
    tips, axes = rows(tip, poses), rows(axis, poses)
    for k, (p, n) in enumerate(zip(points, normals, strict=True)):
        low, high = -2.0, 0.5 * tool.radius_mm
        for _ in range(40):
            middle = 0.5 * (low + high)
            inside = _holds(tool, p + middle * n - tips, axes)
            low, high = (low, middle) if inside else (middle, high)
        found[k] = high
    return found


def _holds(tool: Tool, away: np.ndarray, axes: np.ndarray) -> bool:
    height = (away * axes).sum(axis=1)
    across = np.linalg.norm(away - height[:, None] * axes, axis=1)
    outline = border(tool)[:-1]
    thick = np.interp(height, outline[:, 1], outline[:, 0])
    return bool(((height > 0.0) & (height < tool.flute_mm) & (across < thick)).any())


def _through(away: np.ndarray, n: np.ndarray, axes: np.ndarray, radius: float) -> tuple:
    rise, height = axes @ n, (away * axes).sum(axis=1)
    across, off = n - rise[:, None] * axes, away - height[:, None] * axes
    a, b = (across * across).sum(axis=1), (across * off).sum(axis=1)
    c = (off * off).sum(axis=1) - radius * radius
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        enter, leave = (-b - root) / a, (-b + root) / a
        plane = -height / rise
    flat = np.abs(rise) < 1e-12
    low = np.where(flat, np.where(height > -1e-9, -np.inf, np.inf), np.where(rise > 0.0, plane, -np.inf))
    high = np.where(flat, np.inf, np.where(rise > 0.0, np.inf, plane))
    missed = np.isnan(enter)
    return np.where(missed, np.inf, np.maximum(enter, low)), np.where(
        missed, -np.inf, np.minimum(leave, high)
    )


def _vertex(values: np.ndarray, i: int) -> float:
    """The least of a parabola through a sample and its neighbours."""
    if not 0 < i < len(values) - 1 or not np.isfinite(values[i - 1 : i + 2]).all():
        return float(values[i])
    a, b, c = values[i - 1 : i + 2]
    bend = a + c - 2.0 * b
    return float(b - (a - c) ** 2 / (8.0 * bend)) if bend > 0.0 else float(b)
