"""How far the cut surface is off the nominal one: along the nominal normal, to the swept tool.

The removed part of space is the union of the tool over all its poses. On the line p + t n
through a nominal point, n pointing out of the part, the cut surface lies where the line enters
that union: t < 0 is overcut, t > 0 undercut (the measure of Li, Mann and Bedi).

F(q), the least signed distance of a point to the tool over all poses, is zero just on that
border; so t is the root of F(p + t n), found by steps of F over its slope. F itself is a
search over the poses. Runs of poses that are too far away to matter are left out by their
bounds, and around the best sample the place is made exact with the cubics of the sweep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.geometry.arrays import Array, distinct
from controller.machine.tool_profile import Body
from controller.verify.sweep import Around, Sweep

Index = NDArray[np.int64]

PATCH = 96  # points that are searched at once
SLAB = 4096  # points whose place is made exact at once: it bounds the memory
ROUNDING_MM = 1e-4  # of a distance to an axis by squares, some metres from the points at most
CLOSE_MM = 1e-8  # F below which the root is found
FAR_STEP_MM = 1e-3  # a longer step looks at all poses again
MAX_STEPS = 30
STEEPEST = 2.0  # a line that meets the border at less than 30 degrees is one over an edge
ASIDE_MM = 0.01  # further than the tool is from a point, its normal meets what is cut on some other side
FLATTEST = 0.2  # slope of F along the normal with which a step is taken at least


@dataclass(frozen=True, eq=False, slots=True)
class Nearest:
    """For each point: least distance (N,), the sample and the place s on its pass that have it."""

    distance: Array
    sample: Index
    s: Array


def nearest(points: Array, sweep: Sweep, body: Body) -> Nearest:
    """Least signed distance of ``points`` (N, 3) to ``body`` over the sweep; inf without a pose."""
    n = len(points)
    value, sample = np.full(n, np.inf), np.zeros(n, dtype=np.int64)
    if not len(sweep):
        return Nearest(value, sample, np.zeros(n))
    for start in range(0, n, PATCH):
        here = slice(start, start + PATCH)
        value[here], sample[here] = _best_sample(points[here], sweep, body)
    return _exact(points, Nearest(value, sample, sweep.s[sample]), sweep, body)


def at_least(points: Array, sweep: Sweep, body: Body) -> Array:
    """Bounds (N,) that the distances of ``points`` (N, 3) are not below, by runs of samples alone."""
    off = sweep.runs.distance(points) - sweep.runs.slack
    return np.asarray(off.min(axis=1, initial=np.inf) - body.widest_mm - ROUNDING_MM)


def _best_sample(points: Array, sweep: Sweep, body: Body) -> tuple[Array, Index]:
    runs = sweep.runs
    off = runs.distance(points) - body.widest_mm  # of the middle pose, from below
    middle = (runs.start + runs.stop - 1) // 2
    likely = distinct(np.argmin(off, axis=1))
    # At least F at every point. The run that has F has a bound no greater than that, so it is found
    # but for the rounding of squares, which is worst close to an axis.
    least = _distances(points, sweep, middle[likely], body).min(axis=1) + ROUNDING_MM
    wanted = np.flatnonzero(((off - runs.slack) <= least[:, None]).any(axis=0))
    samples = runs.samples(wanted)
    found = _distances(points, sweep, samples, body)
    best = np.argmin(found, axis=1)
    return found[np.arange(len(points)), best], samples[best]


def _distances(points: Array, sweep: Sweep, samples: Index, body: Body) -> Array:
    """Signed distances (P, K) of points to the body at samples, by products of matrices."""
    origin = points.mean(axis=0)
    q, tips, axes = points - origin, sweep.tips[samples] - origin, sweep.axes[samples]
    h = q @ axes.T - (tips * axes).sum(axis=1)
    square = (q * q).sum(axis=1)[:, None] - 2.0 * (q @ tips.T) + (tips * tips).sum(axis=1) - h * h
    return body.distance(np.sqrt(np.maximum(square, 0.0)), h)


def _at(points: Array, around: Around, s: Array, body: Body) -> Array:
    """Signed distances (N, K) of each point to the body at places ``s`` (N, K) around its own sample."""
    tips, axes = around.poses(s)
    away = points[:, None, :] - tips
    return _to_body(away, axes, body)


def _to_body(away: Array, axes: Array, body: Body) -> Array:
    """Signed distances (N, K) from vectors tip to point and axes, (N, K, 3)."""
    h = np.einsum("nki,nki->nk", away, axes)
    square = np.einsum("nki,nki->nk", away, away) - h * h
    return body.distance(np.sqrt(np.maximum(square, 0.0)), h)


def _exact(points: Array, found: Nearest, sweep: Sweep, body: Body) -> Nearest:
    """The place made exact between the neighbours of the best sample."""
    parts = [
        _exact_slab(points[k : k + SLAB], found.sample[k : k + SLAB], found.s[k : k + SLAB], sweep, body)
        for k in range(0, len(points), SLAB)
    ]
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else []
    return Nearest(columns[0], columns[1].astype(np.int64), columns[2]) if parts else found


GRID = np.linspace(0.0, 1.0, 5)


def _exact_slab(
    points: Array, sample: Index, s: Array, sweep: Sweep, body: Body
) -> tuple[Array, Index, Array]:
    """Three times a row of places around the best so far, then the vertex of the last three."""
    rows, width = np.arange(len(points)), len(GRID)
    around = Around(sweep, sample)
    low, high = around.low, around.high
    for _ in range(3):
        places = low[:, None] + (high - low)[:, None] * GRID
        values = _at(points, around, places, body)
        best = np.argmin(values, axis=1)
        value, s = values[rows, best], places[rows, best]
        left, right = np.maximum(best - 1, 0), np.minimum(best + 1, width - 1)
        low, high = places[rows, left], places[rows, right]
        a, c = values[rows, left], values[rows, right]
    bend = a + c - 2.0 * value
    inner = (best > 0) & (best < width - 1) & (bend > 0.0)
    vertex = np.where(inner, s + 0.25 * (high - low) * (a - c) / np.where(inner, bend, 1.0), s)
    at_vertex = _at(points, around, vertex[:, None], body)[:, 0]
    s = np.where(at_vertex < value, vertex, s)
    return np.minimum(at_vertex, value), sample, s


# ---- the border along the normal ---------------------------------------------------


@dataclass(frozen=True, eq=False, slots=True)
class Deviation:
    """For each point: t (N,) in mm, negative overcut, nan where nothing cuts at all; and the pose."""

    t: Array
    sample: Index
    s: Array
    distance: Array  # F(p): the signed distance of the nominal point itself


def deviation(points: Array, normals: Array, sweep: Sweep, body: Body) -> Deviation:
    """Signed deviation of the cut surface at ``points`` (N, 3) along unit ``normals`` (N, 3).

    At a sharp edge the line leaves the part after a hair's breadth of it and goes on in the air that was
    cut on the other side; so overcut counts as no more than twice the depth of the point in the tool. Below
    a cutter that runs a hair above the lower edge, and above its flute, the line meets it far off or nowhere;
    so undercut counts as no more than twice the distance of the point to the tool, and as no more than
    ``ASIDE_MM`` beyond that distance. So it is continuous: no limit decides whether a point is held cut.
    """
    found = nearest(points, sweep, body)
    t, own = np.where(np.isfinite(found.distance), 0.0, np.nan), found.distance.copy()
    sample, s, value = found.sample.copy(), found.s.copy(), found.distance.copy()
    slope = np.full(len(points), -1.0)
    least, most = np.minimum(STEEPEST * own, 0.0), np.maximum(own + np.minimum(own, ASIDE_MM), 0.0)
    open_ = np.flatnonzero((np.abs(value) > CLOSE_MM) & np.isfinite(value))
    for _ in range(MAX_STEPS):
        if not len(open_):
            break
        step = value[open_] / -slope[open_]
        t[open_] += step
        inside = (t[open_] < most[open_]) | (own[open_] < 0.0)
        open_, step = open_[inside], step[inside]
        there = points[open_] + t[open_, None] * normals[open_]
        after = _again(there, np.abs(step), sample[open_], s[open_], sweep, body)
        change = (after.distance - value[open_]) / np.where(step == 0.0, 1.0, step)
        slope[open_] = np.clip(change, -1.0, -FLATTEST)
        value[open_], sample[open_], s[open_] = after.distance, after.sample, after.s
        open_ = open_[np.abs(value[open_]) > CLOSE_MM]
    return Deviation(np.clip(t, least, most), sample, s, own)


def _again(points: Array, step: Array, sample: Index, s: Array, sweep: Sweep, body: Body) -> Nearest:
    """F at points that have moved by ``step``: near the old place, or over all poses after a long step."""
    far = step > FAR_STEP_MM
    value, sample, s = np.empty(len(points)), sample.copy(), s.copy()
    if far.any():
        over_all = nearest(points[far], sweep, body)
        value[far], sample[far], s[far] = over_all.distance, over_all.sample, over_all.s
    near = ~far
    if near.any():
        index = _walked(points[near], sample[near], sweep, body)
        found = _exact(points[near], Nearest(value[near], index, sweep.s[index]), sweep, body)
        value[near], sample[near], s[near] = found.distance, found.sample, found.s
    return Nearest(value, sample, s)


def _walked(points: Array, sample: Index, sweep: Sweep, body: Body) -> Index:
    """The best of a few samples around each old one."""
    steps = np.arange(-3, 4)
    index = np.clip(sample[:, None] + steps, sweep.first[sample][:, None], sweep.last[sample][:, None])
    off = _to_body(points[:, None, :] - sweep.tips[index], sweep.axes[index], body)
    return np.asarray(index[np.arange(len(points)), np.argmin(off, axis=1)])
