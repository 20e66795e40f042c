"""Circular test by ISO 230-4 from what drives have reported: circles of two linear axes in both senses.

    G   circular deviation: least distance of two concentric circles with the path between them, of each
        sense, and of both together (bi-directional)
    H   circular hysteresis: largest distance of the two paths, about one centre
    F   radial deviation: largest and least radius of the path less the nominal one, about the centre of the
        nominal circle

A circle is a line of the program on which the commanded path of the two axes is one (to ``ROUND_MM``) of more
than ``MIN_TURN``. Encoders of motors do not see what lies behind them: a nut's play shows with scales only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.calibration.refusal import Refusal
from controller.geometry.arrays import Array

ROUND_MM = 2e-3
MIN_TURN = 0.99 * 2.0 * math.pi
ANGLES = 1440  # that both paths are compared at
MIN_SAMPLES = 60


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle that was cut: nominal centre and radius (mm), the path as reported about that centre."""

    line: int
    centre: Array  # (2,)
    radius_mm: float
    sense: int  # 1: counter-clockwise as seen against the third axis
    path: Array  # (N, 2) mm, actual less centre


def circles(command: Array, actual: Array, lines: NDArray[np.int64]) -> Iterator[Circle]:
    """Of positions (N, 2) of two axes, commanded and reported, and the program line (N,) of each."""
    edges = np.flatnonzero(np.diff(lines)) + 1
    for rows in np.split(np.arange(len(lines)), edges):
        if len(rows) < MIN_SAMPLES or lines[rows[0]] <= 0:
            continue
        moving = rows[np.concatenate(([True], np.abs(np.diff(command[rows], axis=0)).max(axis=1) > 0.0))]
        if len(moving) < MIN_SAMPLES:
            continue
        centre, radius, off = fitted(command[moving])
        about = command[moving] - centre
        turn = np.unwrap(np.arctan2(about[:, 1], about[:, 0]))
        swept = float(turn[-1] - turn[0])
        if off < ROUND_MM and abs(swept) > MIN_TURN and radius > 10.0 * ROUND_MM:
            yield Circle(int(lines[rows[0]]), centre, radius, 1 if swept > 0 else -1, actual[moving] - centre)


def fitted(points: Array) -> tuple[Array, float, float]:
    """Least-squares circle of (N, 2): centre, radius, and how far the points are from it at most."""
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    A = np.column_stack([2.0 * x, 2.0 * y, np.ones(len(x))])
    a, b, c = np.linalg.lstsq(A, x * x + y * y, rcond=None)[0]
    radius = math.sqrt(max(c + a * a + b * b, 0.0))
    off = np.abs(np.hypot(x - a, y - b) - radius).max()
    return middle + np.array([a, b]), radius, float(off)


def zone_mm(path: Array) -> float:
    """Least distance of two concentric circles that hold the path (N, 2) between them."""
    from scipy.optimize import minimize  # takes as long to import as any other measurement altogether

    def width(centre: Array) -> float:
        return float(np.ptp(np.hypot(*(path - centre).T)))

    start, radius, _ = fitted(path)
    size = max(1e-3, width(start))
    simplex = start + size * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    options = {"initial_simplex": simplex, "xatol": 1e-8 * max(radius, 1.0), "fatol": 1e-9}
    return float(minimize(width, start, method="Nelder-Mead", options=options).fun)


def radii(path: Array) -> Array:
    """Radius of a closed path about 0 at ``ANGLES`` even angles."""
    angle = np.arctan2(path[:, 1], path[:, 0])
    order = np.argsort(angle)
    even = np.linspace(-math.pi, math.pi, ANGLES, endpoint=False)
    found = np.interp(even, angle[order], np.hypot(*path.T)[order], period=2.0 * math.pi)
    return np.asarray(found, dtype=np.float64)


def report(found: list[Circle], axes: tuple[str, str]) -> dict[str, Any]:
    """Micrometres. Raises Refusal where there is no circle."""
    if not found:
        raise Refusal("no_circle", axes=" ".join(axes))
    by_sense = {sense: [one for one in found if one.sense == sense] for sense in (1, -1)}
    last = {sense: rows[-1] for sense, rows in by_sense.items() if rows}
    told: dict[str, Any] = {"axes": list(axes), "radius_mm": found[-1].radius_mm, "circles": len(found)}
    for sense, name in ((1, "counter_clockwise"), (-1, "clockwise")):
        one = last.get(sense)
        if one is not None:
            off = 1e3 * (np.hypot(*one.path.T) - one.radius_mm)
            told[name] = {
                "line": one.line,
                "G_um": 1e3 * zone_mm(one.path),
                "F_max_um": float(off.max()),
                "F_min_um": float(off.min()),
            }
    if len(last) == 2:
        one, other = last[1], last[-1]
        told["G_bidirectional_um"] = 1e3 * zone_mm(np.vstack([one.path, other.path]))
        told["H_um"] = 1e3 * float(np.abs(radii(one.path) - radii(other.path)).max())
    return told
