"""Where along a sampled path something passes that follows it late: the place of the path nearest to it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from controller.geometry.arrays import Array

# How late a joint may follow its command and still find its place on the path (s): a servo of 40 Hz with two
# ticks of transport is some 15 ms late.
LOOK_BACK_S = 0.100
_AT_ONCE = 256  # points: what is worked with stays in the cache


class Passing(NamedTuple):
    """Of M points."""

    place: Array  # (M,) row of the path, with the share of the chord to the next one
    distance: Array  # (M,) from there to the point, in the unit of the path


def passing(path: Array, points: Array, look_back: int, look_ahead: int) -> Passing:
    """The nearest place of the polyline ``path`` (N, 3) to each of ``points`` (M, 3), M <= N.

    The points are those of the last M rows. Of row r only the chords that begin in the rows from
    ``r - look_back`` to ``r + look_ahead`` count: where a path comes by a place twice, the recent
    passage does. Of places that are equally near the latest counts.
    """
    n, m = len(path), len(points)
    rows = np.clip(np.arange(n - m - look_back, n + look_ahead), 0, n - 1)
    chords = path[np.minimum(rows + 1, n - 1)] - path[rows]
    squares = np.einsum("ij,ij->i", chords, chords)
    width = look_back + look_ahead + 1
    # The latest first: what is found first of equals is what counts.
    starts, leads = (sliding_window_view(x, width, axis=0)[:, :, ::-1] for x in (path[rows], chords))
    lengths = sliding_window_view(squares, width)[:, ::-1]
    place, distance = np.empty(m), np.empty(m)
    for first in range(0, m, _AT_ONCE):
        here = slice(first, first + _AT_ONCE)
        gap = points[here, :, None] - starts[here]
        along = np.einsum("ikw,ikw->iw", leads[here], gap)
        share = np.divide(along, lengths[here], out=np.zeros_like(along), where=lengths[here] > 0.0)
        np.clip(share, 0.0, 1.0, out=share)
        off = gap - share[:, None] * leads[here]
        squared = np.einsum("ikw,ikw->iw", off, off)
        best = squared.argmin(axis=1)
        of = np.arange(len(best))
        place[here] = rows[np.arange(m)[here] + width - 1 - best] + share[of, best]
        distance[here] = np.sqrt(squared[of, best])
    return Passing(place, distance)
