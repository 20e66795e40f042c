"""The law of exact rows: as fast as the limits allow by what the ticks see of the joints (``ticked``).

To the search (``search``) the course is one straight axis whose limits change from place to place: the speed
that corners allow, and the acceleration and jerk that they leave. What is found is looked at tick by tick;
where a limit is exceeded, less is allowed there, and it is sought again.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from controller.geometry.arrays import Array
from controller.plan.feed import barrier, mesh
from controller.plan.feed.bounds import Bounds
from controller.plan.feed.course import FeedCourse, Index
from controller.plan.feed.limits import JointLimits
from controller.plan.feed.search import (
    COARSE,
    COARSE_GAP,
    MAX_KNOTS,
    MIN_KNOTS,
    SMOOTHING,
    WIDEST,
    Law,
    Search,
)
from controller.plan.feed.ticked import Ticked, of
from controller.plan.surfaces.rates import Derivatives

ROUNDS = 4
FINE = 1.002  # of each limit, as ``JointLimits`` of a course has them: good enough ...
LAST = 1.004  # ... and after all rounds; out of motion,
MOVING = 1.014  # which may begin at a limit, so much as stops are checked by
PHASES = 2  # of a tick, at which a law is looked at
AHEAD_S = 0.03  # what is allowed so soon before and behind a place is about what is reached there
SPARE = 0.8  # of acceleration and jerk, to begin with: between knots a law takes more
GAP = 2e-3  # share of the time that may be left on the table
FASTER, REACH = 1.03, 3  # times a speed, and that of cells beside: a law may come to be so fast
KNOTS_S = 8e-3  # time between knots ...
CLOSE_S, RAMP_S = 3e-3, 0.1  # ... and so soon before and behind a rest
# Powers of what exceeds a limit, by which speed, and acceleration and jerk, become less there.
SLOWER, SOFTER = 0.7, 4.0


class Straight(FeedCourse):
    """A row as one axis along s, with the limits of cells between ``edges`` (n + 1,): (n, 1) each."""

    def __init__(self, ticked: Ticked, limits: JointLimits) -> None:
        course = ticked.course
        super().__init__(course.segments[:1], course.machine, course.kinematics)
        self._ticked, self._cells = ticked, limits
        self.starts = np.array([0.0, course.length])

    def derivatives(self, s: Array, index: Index | None = None) -> Derivatives:
        none = np.zeros((len(s), 1))
        return Derivatives(none + 1.0, none, none)

    def feed(self, s: Array, index: Index | None = None) -> Array:
        return np.asarray(self._ticked.feed[self._cell(s)])

    def least_limit(self, s: Array, which: str, index: Index) -> Array:
        found: Array = getattr(self._cells, which)
        first = self._cell(s[:-1])
        last = np.maximum(self._cell(s[1:]), first)
        bounds = np.stack([first, last + 1], axis=1).ravel()
        padded = np.concatenate([found[:, 0], [np.inf]])
        return np.asarray(np.minimum.reduceat(padded, bounds)[::2, None])

    def _cell(self, s: Array) -> Index:
        edges = self._ticked.edges
        return np.clip(np.searchsorted(edges, s, side="right") - 1, 0, len(edges) - 2)

    @cached_property
    def limits(self) -> tuple[JointLimits, ...]:
        least = (getattr(self._cells, name).min(axis=0) for name in ("velocity", "acceleration", "jerk"))
        return (JointLimits(*least),)


class RowSearch(Search):
    """The search on a straight course that stands for a row."""

    def __init__(self, ticked: Ticked, v: float, a: float) -> None:
        self.ticked, self.v, self.a = ticked, v, a
        self.from_rest = v == 0.0
        self._last: tuple[Bounds, barrier.Point] | None = None  # what the last fine search found

    def take(self, limits: JointLimits) -> None:
        """Other limits of the cells."""
        self.course = Straight(self.ticked, limits)
        ends = np.array([self.ticked.first, self.ticked.last])
        self.parts = mesh.Parts(self.course, ends, np.zeros(1, dtype=np.intp))
        self.samples = samples(self.ticked, limits)

    def rough(self) -> Array | None:
        """About the speed at the edges of all cells."""
        speed = mesh.estimate(self.parts, self.samples, self.v, self.a)
        step_s = COARSE * self._step(speed)
        smooth = mesh.smoothed(self.samples, speed, self.a, SMOOTHING * step_s)
        speed = np.minimum(smooth, speed) if self.from_rest else smooth
        found = self._solved(speed, step_s, COARSE_GAP)
        return None if found is None else self._speed(found[0], found[1].c)

    def fine(self, speed: Array) -> Law | None:
        """The law, sought from about the ``speed`` at the edges of all cells; again: from where it was."""
        if self._last is None:
            found = self._solved(speed, self._step(speed), GAP)
        else:
            bounds, point = self._last
            bounds = Bounds(bounds.grid.under(self.parts))
            limits = bounds.limits(self._shares(bounds, point.c), point.c[1:-1])
            found = bounds, barrier.solve(limits, point.c, point, GAP)
        self._last = found
        return None if found is None or found[1].stuck else self._law(found[0], found[1].c)

    def _solved(self, speed: Array, step_s: float, gap: float) -> tuple[Bounds, barrier.Point] | None:
        bounds = self._bounds(speed, step_s)
        c = self._coefficients(bounds, speed)
        if not (c > 0.0).all():
            return None  # it brakes so hard that it would stand before the first knot
        limits = bounds.limits(self._shares(bounds, c), c[1:-1])
        return bounds, barrier.solve(limits, c, None, gap)

    def _step(self, speed: Array) -> float:
        return KNOTS_S

    def _knots(self, speed: Array, step_s: Array | float) -> tuple[Array, Index]:
        """Evenly in time, and closer about rests: what is allowed is rough, and no law can follow it."""
        s, more = self.samples.s, mesh.FROM_REST - 1
        t = mesh.times(s, speed)
        near = np.minimum(t if self.from_rest else np.inf, t[-1] - t) < RAMP_S

        def intervals(step_s: Array | float) -> tuple[Array, int, int]:
            """Intervals up to each sample, all of them, and the knots that are left."""
            steps = np.diff(t) / np.where(near[1:], np.minimum(step_s, CLOSE_S), step_s)
            count = np.cumsum(np.append(0.0, steps))
            n = max(MIN_KNOTS, math.ceil(count[-1]))
            return count, n, n + 1 - more * (2 if self.from_rest else 1)

        count, n, many = intervals(step_s)
        if many > MAX_KNOTS:
            count, n, _ = intervals(step_s * min(many / MAX_KNOTS, WIDEST))
        knots = np.interp(np.linspace(0.0, count[-1], n + 1), count, s)
        knots = np.delete(knots, np.arange(n - more, n))
        if self.from_rest:
            knots = np.delete(knots, np.arange(1, more + 1))
        return knots, np.zeros(len(knots) - 1, dtype=np.intp)


def samples(ticked: Ticked, limits: JointLimits) -> mesh.Samples:
    """At the edges of all cells: the least of both sides."""
    rows = (ticked.feed, limits.velocity[:, 0], limits.acceleration[:, 0], limits.jerk[:, 0])
    feed, *allowed = (np.minimum(np.append(row[:1], row), np.append(row, row[-1:])) for row in rows)
    return mesh.Samples(ticked.edges, np.zeros(len(feed), dtype=np.intp), feed, *allowed)


def law(course: FeedCourse, s: float, v: float, a: float, last: float) -> Law | None:
    """From ``s`` with ``v`` and ``a`` to rest at ``last``; None where the state cannot be continued."""
    ticked = of(course, s, last, v)
    search, allowed = RowSearch(ticked, v, a), ticked.allowed.copy()
    spare = np.full((len(allowed), 1), SPARE)  # of acceleration and jerk

    def left(speed: Array) -> JointLimits:
        rooms = (room[:, None] * spare for room in ticked.left(np.minimum(speed, allowed)))
        return JointLimits(allowed[:, None], *rooms)

    about = _about(ticked)
    if v > about[0]:  # it may have to brake first
        search.take(left(np.maximum(about, v)))
        way, speeds = mesh.braking(search.samples, v, a)
        about = np.maximum(about, np.interp(ticked.edges[:-1], way, speeds, right=0.0))
    search.take(left(about))
    speed, best = search.rough(), None
    for _ in range(ROUNDS):
        if speed is None:
            break
        search.take(left(_at_most(speed)))
        if (found := search.fine(speed)) is None:
            break
        worst, speed = _looked_at(ticked, found, allowed, spare[:, 0])
        if best is None or worst < best[0]:
            best = worst, found
        if worst <= FINE:
            break
    if best is None:
        return None
    if best[0] > LAST and v == 0.0:
        return _slower(ticked, *best)
    return best[1] if best[0] <= MOVING else None


def _slower(ticked: Ticked, worst: float, found: Law) -> Law:
    """A law from rest that takes ``worst`` times a limit, so much slower that it keeps them."""
    for _ in range(ROUNDS):
        times, pieces = found
        found = times * worst, pieces / worst ** np.arange(6)[None, :]
        none = np.ones(len(ticked.allowed))
        worst, _ = _looked_at(ticked, found, none, none.copy())
        if worst <= LAST:
            break
    return found


def _at_most(speed: Array) -> Array:
    """What the law to be sought may reach in each cell, by the ``speed`` at their edges of the one before."""
    found = np.pad(FASTER * speed, REACH, mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(found, 2 * REACH + 2).max(axis=1))


def _about(ticked: Ticked) -> Array:
    """The speed that is about reached in each cell: what the slowest one near it allows."""
    most = np.minimum(ticked.allowed, ticked.feed)
    width = np.diff(ticked.edges)
    t = np.concatenate([[0.0], np.cumsum(width / most)])
    first = np.searchsorted(t, t[:-1] - AHEAD_S, side="left").clip(0, len(most) - 1)
    last = np.searchsorted(t, t[1:] + AHEAD_S, side="right").clip(1, len(most))
    bounds = np.stack([first, np.maximum(last, first + 1)], axis=1).ravel()
    return np.asarray(np.minimum.reduceat(np.append(most, np.inf), bounds)[::2])


def _looked_at(ticked: Ticked, found: Law, allowed: Array, spare: Array) -> tuple[float, Array]:
    """The largest share of a limit that the ticks of a law take, and its speed at the edges of all cells.

    Where it is too much ``allowed`` and ``spare`` (cells,) become less.
    """
    times, pieces = found
    T = ticked.course.machine.period_s
    worst = 0.0
    for phase in range(PHASES):
        t = T * (np.arange(-3, times[-1] / T + 5.0) + phase / PHASES)
        s, v = _along(times, pieces, t)
        use = ticked.uses(s)
        worst = max(worst, float(use.max()))
        cell = np.clip(np.searchsorted(ticked.edges, s, side="right") - 1, 0, len(allowed) - 1)
        for k in np.flatnonzero(use > FINE).tolist():
            here = slice(max(cell[k] - 1, 0), cell[k + 3] + 2)
            allowed[here] = np.minimum(allowed[here], v[k + 1] / use[k] ** SLOWER)
            spare[here] = np.minimum(spare[here], spare[here] / use[k] ** SOFTER)
    return worst, np.interp(ticked.edges, s, v)


def _along(times: Array, pieces: Array, t: Array) -> tuple[Array, Array]:
    """s and v at the times ``t``; before its beginning as it begins, behind its end at rest."""
    i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(pieces) - 1)
    x, c = np.minimum(t, times[-1]) - times[i], pieces[i].T
    if pieces[0, 1] == 0.0:
        x = np.maximum(x, 0.0)
    s = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    return s, c[1] + x * (2.0 * c[2] + x * 3.0 * c[3])
