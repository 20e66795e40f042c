"""Impeller-like blades whose normal turns by 90 degrees and more, and their cut by brute force."""

from __future__ import annotations

import math
import random

import numpy as np

from controller.geometry.curves import Bezier
from controller.geometry.surfaces import RuledSurface, Surface

Array = np.ndarray
FITTED = 24  # points of a directrix
MIN_DEG, MAX_DEG = 90.0, 132.0


def blade(seed: int) -> tuple[RuledSurface, float]:
    """A blade between hub and shroud, and a signed cutter radius; the lowest point of the hub lies at Z 0.

    Both directrices run over cylinders about Y, each with a heading of its own: what lies between the
    two headings is what the normal turns by.
    """
    rng = random.Random(seed)
    while True:
        hub, height, length = rng.uniform(20.0, 40.0), rng.uniform(15.0, 40.0), rng.uniform(30.0, 60.0)
        radius = rng.uniform(2.0, 5.0) * rng.choice((1.0, -1.0))
        twist, mid = math.radians(rng.uniform(90.0, 125.0)), math.radians(rng.uniform(-20.0, 20.0))
        bends = [math.radians(rng.uniform(-20.0, 20.0)) for _ in range(2)]
        lower = _run(hub, mid - 0.5 * twist, bends[0], length)
        upper = _run(hub + height, mid + 0.5 * twist, bends[1], length * rng.uniform(0.9, 1.3))
        floor = np.array([0.0, 0.0, lower[:, 2].min()])
        surface = RuledSurface(_bezier(upper - floor), _bezier(lower - floor))
        if MIN_DEG <= normal_turns_deg(surface).max() <= MAX_DEG:
            return surface, round(radius, 1)


def _run(radius: float, heading: float, bend: float, length: float) -> Array:
    """Points of a curve on a cylinder about Y: ``heading`` from its axis, changing by ``bend``."""
    t = np.linspace(-0.5, 0.5, FITTED)
    along, around = (f(heading + bend * t).cumsum() * length / (FITTED - 1) for f in (np.cos, np.sin))
    along, angle = along - along[FITTED // 2], (around - around[FITTED // 2]) / radius
    return np.stack([radius * np.sin(angle), along, radius * np.cos(angle)], axis=1)


def _bezier(points: Array) -> Bezier:
    """The cubic nearest to ``points``, in the thousandths of a millimetre of a program."""
    t = np.linspace(0.0, 1.0, FITTED)
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    controls = np.round(np.linalg.lstsq(basis, points, rcond=None)[0], 3)
    return Bezier(tuple((float(x), float(y), float(z)) for x, y, z in controls))


def normal_turns_deg(surface: Surface, along: int = 65) -> Array:
    """Between the normals at both ends of each of some rulings."""
    u = np.linspace(0.0, 1.0, along)
    ruling = _stacked(surface.ruling(u, np), along)
    top, low = (
        np.cross(_stacked(curve.derivative(u, 1, np), along), ruling, axis=0)
        for curve in (surface.upper, surface.lower)
    )
    cosine = (top * low).sum(axis=0) / np.sqrt((top * top).sum(axis=0) * (low * low).sum(axis=0))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def off_by_brute_force(surface: Surface, placed: Surface, offset_mm: float, poses: int = 3001) -> Array:
    """What is left (mm, negative: overcut) on a (97, 25) grid of points, ends included.

    From every one of many positions of an endless cylinder: no nearest one is sought.
    """
    at = np.linspace(0.0, 1.0, poses)
    tips, axes = (_stacked(v, poses) for v in placed.pose(at, offset_mm, np))
    rows = []
    v = np.linspace(0.0, 1.0, 25)
    for u in np.linspace(0.0, 1.0, 97):
        away = _stacked(surface.point(np.full(v.shape, u), v, np), len(v))[:, :, None] - tips[:, None, :]
        height = (away * axes[:, None, :]).sum(axis=0)
        across = np.sqrt(np.maximum((away * away).sum(axis=0) - height * height, 0.0))
        rows.append(across.min(axis=1) - abs(offset_mm))
    return np.array(rows)


def program(surface: RuledSurface, tool: int, radius_mm: float, placement: int, feed: str = "1000.") -> str:
    """One G52 block of the surface."""
    points = (*surface.upper.points, *surface.lower.points)
    words = [f"X{x:.3f} Y{y:.3f} Z{z:.3f}" for x, y, z in points]
    side = "G42" if radius_mm > 0.0 else "G41"
    rows = [f"G21 G90 T{tool} M6", "S9000 M3", f"{side} P{placement}", f"G52 {words[0]} F{feed}", *words[1:]]
    return "\n".join([*rows, "M5", "M30", ""])


def _stacked(vector: tuple, n: int) -> Array:
    return np.array([np.broadcast_to(c, (n,)) for c in vector], dtype=float)
