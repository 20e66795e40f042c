"""What holds a curve: points whose convex hull it never leaves.

Most walls are seen to be sound by that alone, without a sample of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.geometry.curves import Arc, Bezier, Curve, Line
from controller.geometry.splines import BSpline
from controller.geometry.vectors import Vector, add, scale

Array = NDArray[np.float64]


def hull(curve: Curve, order: int = 0) -> Array | None:
    """Points (N, 3) in whose convex hull the curve, or its first derivative, stays; None: not known."""
    points: list[Vector] = []
    if isinstance(curve, Bezier):
        points = list(curve.points if order == 0 else curve.hodograph)
    elif isinstance(curve, Line):
        points = [curve.start, curve.end] if order == 0 else [curve.derivative(0.0)]
    elif isinstance(curve, Arc):
        points = _of_arc(curve, order)
    elif isinstance(curve, BSpline) and order == 0:  # weights are positive
        points = [point for span in curve.spans for point in span]
    found = np.array(points, dtype=float)
    return found if len(points) and bool(np.isfinite(found).all()) else None


def _of_arc(arc: Arc, order: int) -> list[Vector]:
    """The corners of a square about the circle, at both ends of its rise."""
    a, b = scale(arc.first, arc.sweep_rad**order), scale(arc.second, arc.sweep_rad**order)
    bases = [arc.rise] if order else [arc.centre, add(arc.centre, arc.rise)]
    signs = [(p, q) for p in (-1.0, 1.0) for q in (-1.0, 1.0)]
    return [add(base, add(scale(a, p), scale(b, q))) for base in bases for p, q in signs]
