"""A course of exact rows as the ticks see it: what the joints' limits leave of its speed, place by place.

The lines of such a row are hardly longer than what is cut in a tick, so that the jumps of the rates at its
corners are not one by one in their ticks: some add up, and the rounding of decimals cancels out. What the
drives get are samples, and their differences are what counts. At the even speed v they are those of the
joints q at places v T apart,

    velocity      [q(s + h) - q(s)] / T                                      h = v T
    acceleration  [q(s + h) - 2 q(s) + q(s - h)] / T^2
    jerk          [q(s + 3h/2) - 3 q(s + h/2) + 3 q(s - h/2) - q(s - 3h/2)] / T^3

and all of them are looked at on one even grid of places, for every stride and wherever a tick may fall. So
fast a place is passed that all lower speeds keep the limits there, too: an override or a hold is slower.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, columns
from controller.geometry.vectors import ROUNDING
from controller.motion.motions import ROW, ToolSpline
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits
from controller.plan.junctions import MARGIN

Index = npt.NDArray[np.intp]

# Shares of velocity, acceleration and jerk that the corners may take at an even speed; the law has the rest.
SHARES = (1.0, 0.9, 0.92)
MIN_ROOM = 0.08  # of acceleration and jerk: the law may have as much anywhere
PER_LINE = 10  # places of the grid on a line of median length ...
PER_TICK = 8  # ... and in a tick at the lowest speeds that are found
FASTER = 1.1  # times the speed at the beginning: that much is looked at
ROUNDS = 4  # until they are so many
MAX_PLACES = 400_000  # places
GROWTH = 1.17  # of the strides that are looked at
SLOWER = (1.0, 0.75, 0.5)  # times a speed: what corners take is the most at these
SMOOTH_TICKS = 4.0  # to both sides, over which joints are smoothed for those who look for no corner
PER_CELL = 8  # places that are told as one


def is_row(course: FeedCourse) -> bool:
    """Whether a course is made of exact rows alone."""
    return all(one.is_exact_row for one in course.segments)


def of(course: FeedCourse, first: float, last: float, v: float = 0.0) -> Ticked:
    """What is known of a course, or of all from ``first`` to ``last`` if nothing is."""
    known = course.ticked
    if isinstance(known, Ticked) and known.first <= first + ROUNDING and known.last >= last - ROUNDING:
        return known
    made = course.ticked = Ticked(course, first, last, v)
    return made


class Ticked:
    """The places from ``first`` to ``last`` of a course of exact rows, in cells (n,) of some places each."""

    def __init__(self, course: FeedCourse, first: float, last: float, v: float = 0.0) -> None:
        """``v``: at which it may come to the first of them, above the feed perhaps."""
        self.course, self.first, self.last, self._v = course, first, last, v
        self.limits = JointLimits.of(course.machine, MARGIN)
        self._period_s = course.machine.period_s
        motions = [one.motion for one in course.segments if isinstance(one.motion, ToolSpline)]
        self._length_mm = motions[0].length_mm
        starts = zip(course.zeros, motions, strict=False)
        knots = np.concatenate([start + np.frombuffer(one.knots)[:-1] for start, one in starts])
        self._knots = np.append(knots, course.length)
        self._cubics = np.concatenate([np.frombuffer(one.spans).reshape(-1, ROW) for one in motions])
        self._cubics = self._cubics.reshape(-1, 5, 4)
        step, least = float(np.median(np.diff(self._knots))) / PER_LINE, (last - first) / MAX_PLACES
        for _ in range(ROUNDS):
            self._lay(max(step, least))
            wanted = float(np.percentile(self.allowed, 10)) * self._period_s / PER_TICK
            if self.step <= max(1.2 * wanted, least):
                break
            step = wanted

    def joints(self, s: Array) -> Array:
        """Joints (axes, N) at the places ``s`` (N,); straight on beyond both ends of the course."""
        i = np.clip(np.searchsorted(self._knots, s, side="right") - 1, 0, len(self._cubics) - 1)
        inside = np.clip(s, 0.0, self.course.length)
        c, h = self._cubics[i], (inside - self._knots[i])[:, None]
        values = c[..., 0] + h * (c[..., 1] + h * (c[..., 2] + h * c[..., 3]))
        beyond = (s - inside)[:, None]
        if beyond.any():
            values += beyond * (c[..., 1] + h * (2.0 * c[..., 2] + h * 3.0 * c[..., 3]))
        x, y, z, a, b = values.T
        kinematics = self.course.kinematics
        x, y, z = kinematics.linear((x, y, z), (a, b), self._length_mm, np)
        return np.ascontiguousarray(columns(kinematics.arrange((x, y, z, a, b)), len(s)).T)

    def allowed_at(self, s: Array) -> Array:
        """What is allowed in the cells of the places ``s`` (N,)."""
        found = np.searchsorted(self.edges, s, side="right") - 1
        return np.asarray(self.allowed[np.clip(found, 0, len(self.allowed) - 1)])

    # ---- the grid

    def _lay(self, step: float) -> None:
        """The grid in steps of about ``step``, and the speeds that are allowed there."""
        course, T = self.course, self._period_s
        middles = np.clip(0.5 * (self._knots[1:] + self._knots[:-1]), self.first, self.last)
        most = max(float(course.feed(middles).max()), FASTER * self._v)
        step = min(step, most * T / PER_TICK)
        cells = max(4, math.ceil((self.last - self.first) / (PER_CELL * step)))
        self.step = (self.last - self.first) / (cells * PER_CELL)
        self._beside = 3 + math.ceil((SMOOTH_TICKS + 1.0) * most * T / self.step) + PER_CELL
        n = cells * PER_CELL
        self.places: Array = self.first + self.step * np.arange(-self._beside, n + self._beside + 1.0)
        self._q = self.joints(self.places)
        self._inner = slice(self._beside, self._beside + n)
        feed = course.feed(np.clip(self.places[self._inner] + 0.5 * self.step, 0.0, course.length))
        self.feed = feed.reshape(cells, PER_CELL).min(axis=1)
        self.edges = self.first + (self.last - self.first) * np.arange(cells + 1) / cells
        self.allowed = self._cells(self._allowed(most))

    def _cells(self, found: Array) -> Array:
        """The least of what was found at the places, of each cell."""
        return np.asarray(found.reshape(-1, PER_CELL).min(axis=1))

    def _allowed(self, most: float) -> Array:
        """The speed at each inner place, up to about ``most``."""
        n, T = self.places[self._inner].size, self._period_s
        speed, before = np.full(n, most), np.zeros(n)
        scales = self._scales()
        open_, slower, stride = np.ones(n, dtype=bool), 0.0, 1
        widest = math.ceil(most * T / self.step)  # counted, for rounding may leave its speed below ``most``
        while True:
            use = self._use(stride, scales)
            v = stride * self.step / T
            over = open_ & (use > 1.0)
            share = (1.0 - before[over]) / (use[over] - before[over])
            speed[over] = slower + (v - slower) * np.maximum(share, 0.0)
            open_ &= ~over
            if stride >= widest or not open_.any():
                return speed
            before, slower = use, v
            stride = min(max(stride + 1, int(GROWTH * stride)), widest)

    def _scales(self) -> tuple[Array, Array, Array]:
        """What differences are multiplied by to be shares of what an even speed may take of limits."""
        T, limits = self._period_s, self.limits
        velocity, acceleration, jerk = SHARES
        return (
            1.0 / (velocity * limits.velocity * T)[:, None],
            1.0 / (acceleration * limits.acceleration * T**2)[:, None],
            1.0 / (jerk * limits.jerk * T**3)[:, None],
        )

    def _use(self, stride: int, scales: tuple[Array, Array, Array]) -> Array:
        """The largest share that ticks ``stride`` places apart take about each inner place."""
        q, m = self._q, stride
        d1 = q[:, m:] - q[:, :-m]
        d2 = d1[:, m:] - d1[:, :-m]
        d3 = d2[:, m:] - d2[:, :-m]
        found = np.abs(d3 * scales[2]).max(axis=0)
        begin, n = self._inner.start, self._inner.stop - self._inner.start
        found = found[begin - (3 * m) // 2 :][:n]
        for d, scale, half in ((d2, scales[1], m), (d1, scales[0], m // 2)):
            found = np.maximum(found, np.abs(d * scale).max(axis=0)[begin - half :][:n])
        return np.asarray(found)

    # ---- what corners leave

    def left(self, speed: Array) -> tuple[Array, Array]:
        """Acceleration and jerk along the path that corners passed at ``speed`` (cells,) leave, per cell."""
        *taken, rates = self._taken(speed)
        found = []
        for use, limit in zip(taken, (self.limits.acceleration, self.limits.jerk), strict=True):
            room = np.maximum(1.0 - use, MIN_ROOM) * limit[:, None]
            found.append(beside(self._cells((room / rates).min(axis=0))))
        return found[0], found[1]

    def rooms(self, speed: Array) -> tuple[Array, Array]:
        """Shares of acceleration and of jerk that they leave of every joint's limit, per cell."""
        acceleration, jerk, _ = self._taken(speed)
        rooms = (self._cells(1.0 - use.max(axis=0)) for use in (acceleration, jerk))
        first, second = (np.maximum(room, MIN_ROOM) for room in rooms)
        return first, second

    def _taken(self, speed: Array) -> tuple[Array, Array, Array]:
        """Shares of acceleration and jerk at ``speed`` and below, and q', absolute, (axes, places)."""
        T = self._period_s
        at = np.arange(self._inner.start, self._inner.stop)
        v = np.repeat(speed, PER_CELL)
        second, third, rates = (np.zeros((len(self._q), len(at))) for _ in range(3))
        for slower in SLOWER:
            m = np.maximum(np.ceil(slower * v * (T / self.step)).astype(np.intp), 1)
            k = at - (3 * m) // 2
            q = [self._q.take(k + i * m, axis=1) for i in range(4)]
            bends = (np.abs(q[i + 2] - 2.0 * q[i + 1] + q[i]) for i in (0, 1))
            second = np.maximum(second, np.maximum(*bends))
            third = np.maximum(third, np.abs(q[3] - 3.0 * (q[2] - q[1]) - q[0]))
            if slower == 1.0:
                rates = np.abs(q[2] - q[1]) / (m * self.step) + 1e-30
        limits = self.limits
        second /= (limits.acceleration * T**2)[:, None]
        third /= (limits.jerk * T**3)[:, None]
        return second, third, rates

    def smooth(self, speed: Array) -> tuple[Array, Array]:
        """q' and q'' (axes, edges) at the edges of all cells, of some ticks at ``speed`` (edges,)."""
        at = self._inner.start + PER_CELL * np.arange(len(self.edges))
        most = self._inner.start - 1
        m = np.clip(
            np.ceil(SMOOTH_TICKS * speed * (self._period_s / self.step)).astype(np.intp), PER_CELL, most
        )
        before, here, behind = (self._q.take(at + i * m, axis=1) for i in (-1, 0, 1))
        way = m * self.step
        return (behind - before) / (2.0 * way), (behind - 2.0 * here + before) / (way * way)

    def uses(self, s: Array) -> Array:
        """The largest share of a limit that ticks at the places ``s`` (N,) one after the other take.

        (N - 3,), about the middle of four ticks.
        """
        T, q = self._period_s, self.joints(s)
        limits = self.limits.velocity, self.limits.acceleration, self.limits.jerk
        first, second, third = (
            np.abs(np.diff(q, k, axis=1) / (limit * T**k)[:, None]).max(axis=0)
            for k, limit in enumerate(limits, 1)
        )
        return np.asarray(np.maximum(np.maximum(first[2:], second[1:]), third))


def beside(cells: Array) -> Array:
    """Of each cell the least of it and of both beside it: a difference of ticks reaches over into them."""
    least = cells.copy()
    least[1:] = np.minimum(least[1:], cells[:-1])
    least[:-1] = np.minimum(least[:-1], cells[1:])
    return least
