"""A long row of points made short, with a bound on what is lost.

Every second point goes where it may; then again, until nothing more can go. What a removed
point was away from the line that remains adds to what its neighbours' lines had lost already,
so the sum bounds the distance of every point that was ever there (a point on an old line is
no further from the new one than the removed corner).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


def thin(points: Array, kinds: Whole, tolerance: float, slack: Array | None = None) -> tuple[Whole, Array]:
    """Indices of the points (N, D) that stay, and their slack.

    ``kinds`` (N,) belong to the way *to* each point: a point between two kinds stays. ``slack`` (N,)
    is what the way to each point has lost before, at most ``tolerance`` after.
    """
    kept = np.arange(len(points))
    lost = np.zeros(len(points)) if slack is None else slack.copy()
    first, idle = 1, 0
    while len(kept) > 2 and idle < 2:
        goes, after = _may_go(points[kept], kinds[kept], lost, tolerance, first)
        idle = 0 if goes.any() else idle + 1
        behind = np.flatnonzero(goes) + 1  # the way to these now leaps over what went
        lost[behind] = after[goes]
        kept, lost = kept[~goes], lost[~goes]
        first = 3 - first
    return kept, lost


def _may_go(
    points: Array, kinds: Whole, lost: Array, tolerance: float, first: int
) -> tuple[NDArray[np.bool_], Array]:
    """Which of the points ``first``, ``first + 2``, ... may go, and what is lost behind each then."""
    n = len(points)
    goes, after = np.zeros(n, dtype=bool), np.zeros(n)
    i = np.arange(first, n - 1, 2)
    if len(i):
        away = _distances(points[i], points[i - 1], points[i + 1])
        after[i] = away + np.maximum(lost[i], lost[i + 1])
        goes[i] = (after[i] <= tolerance) & (kinds[i] == kinds[i + 1])
    return goes, after


def _distances(points: Array, begins: Array, ends: Array) -> Array:
    """From each point to its line of finite length; all (n, D)."""
    way = ends - begins
    square = (way * way).sum(axis=1)
    along = ((points - begins) * way).sum(axis=1)
    share = np.clip(np.divide(along, square, out=np.zeros(len(points)), where=square > 0.0), 0.0, 1.0)
    off = points - begins - share[:, None] * way
    return np.asarray(np.sqrt((off * off).sum(axis=1)))
