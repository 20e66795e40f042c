"""What stops see of a course: joint derivatives at any place, gathered from a table.

A stop is slower than the plan at every place, so places where the plan is at every
millisecond are close enough together for straight lines between them; where they are
not, more are put in. All joints are in shares of their jerk limit.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags, distinct, within
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits
from controller.plan.feed.profile import Profile
from controller.plan.feed.ticked import beside, of
from controller.plan.junctions import JUMP_SHARE

NODE_STEP_S = 1e-3  # of the plan, between two nodes
MIN_STEP = 1e-9  # between two nodes, in the unit of s
NEAR_TICKS = 3.0  # about a junction, where its jump takes a share of the limits
SPLIT_ERROR = 1e-3  # of a limit, by which a straight line between nodes may be wrong
SPLIT_ROUNDS = 3
TINY = 1e-30
JERK, ACCELERATION, RAPID, STILL, SPEED = range(5)  # rows of what holds about a place


class Straight(NamedTuple):
    """A way with constant rates: q' of the joints that move and their acceleration limits, (axes, 1) each."""

    rates: Array
    acceleration: Array
    jerk_room: float
    acceleration_room: float
    rapid: float
    still: float


class Way:
    """Derivatives and limits over s, from the plan's place at ``first_s`` to that at ``last_s``.

    ``acceleration`` and ``velocity`` (axes, 1) are the machine's limits in units of each
    joint's jerk limit.
    """

    is_rough = False  # where one start has no stop the next has, and it is not worth while to seek for long

    def __init__(self, course: FeedCourse, profile: Profile, first_s: float, last_s: float) -> None:
        limits = course.stop_limits
        self._take(limits, course.machine.period_s)
        times = np.linspace(first_s, last_s, max(int((last_s - first_s) / NODE_STEP_S), 4) + 1)
        s, v = _rising(*profile.along(times)[:2])
        marks = course.marks[(course.marks > s[0]) & (course.marks < s[-1])]
        # A sum of lengths may fall short of a joint of a spline: a little behind it as well.
        sides = np.array([-MIN_STEP, 0.0, 0.5 * MIN_STEP])
        places = distinct(np.concatenate([s, (marks[:, None] + sides).ravel()]))
        places, derived = self._refined(course, places, s, v)
        self._fill(places, derived)
        rooms, before, ahead = _rooms(course, places, s, v)
        size = np.ascontiguousarray(np.abs(derived).T).reshape(3, len(limits.jerk), -1)
        still = 1.0 / (size[0].max(axis=0) + TINY)
        speed = np.interp(places, s, v)
        fastest = np.maximum(speed[:-1], speed[1:])
        self._about = np.vstack([lower(np.vstack([rooms, still])), fastest])
        self._about_before = np.vstack([lower(np.vstack([before, still])), fastest])
        self._ahead = np.maximum(ahead[:-1], ahead[1:])
        self._most = self._shares(size)
        self._widths: dict[int, Array] = {}

    def _take(self, limits: JointLimits, period_s: float) -> None:
        self.period_s = period_s
        self._jerk = limits.jerk
        self.acceleration = (limits.acceleration / limits.jerk)[:, None]
        self.velocity = (limits.velocity / limits.jerk)[:, None]

    @property
    def end(self) -> float:
        return float(self.s[-1])

    def at(self, s: Array, v: Array, ends: Array | None = None) -> tuple[Array, Array]:
        """q', q'', q''' of the joints over their jerk limits (3 axes, N), and what holds about there (5, N).

        The latter are the shares of jerk and of acceleration that may be used, what of both
        is the share of rapids, the largest jerk at no speed, and the speed of the plan. What ``v`` (N,) they
        are passed at does not count here. A motion that is known to end at ``ends`` (N,) leaves no room for
        the jump of a junction behind that.
        """
        found, about = self._found(s, self._about)
        if ends is not None:
            i = self._cell(s)
            about = np.where(ends < self._ahead[i], self._about_before.take(i, axis=1), about)
        return found, about

    def _found(self, s: Array, about: Array) -> tuple[Array, Array]:
        i = self._cell(s)
        both = self._lines.take(i, axis=1)
        found = both[: len(both) // 2]
        found *= s - self.s[i]
        found += both[len(both) // 2 :]
        return found, about.take(i, axis=1)

    def most(self, s: Array, h: float) -> tuple[Array, Flags]:
        """The largest of all joints anywhere in steps of ``h`` that end at the places ``s`` (K + 1, N).

        Of their first three derivatives as shares of what jerk may be used there; of the first two
        likewise of the acceleration; of the first of the velocity: (6, K, N). And whether it is known
        (K, N): a step may be longer than steps of the plan are, or end behind the way.
        """
        width = 2 + math.ceil(h / NODE_STEP_S)  # a stop is slower than the plan
        if width not in self._widths:
            self._widths[width] = _running(self._most, width)
        i = self._cell(s)
        known = (i[1:] - i[:-1] < width) & (s[:-1] >= self.s[0]) & (s[1:] <= self.s[-1])
        return self._widths[width].take(i[:-1], axis=1), known

    def _shares(self, size: Array) -> Array:
        """The rows of ``most`` in each cell (6, cells), by the sizes of derivatives (3, axes, nodes)."""
        acceleration = (size[:2] / self.acceleration).max(axis=1)
        nodes = np.vstack([size.max(axis=1), acceleration, (size[0] / self.velocity).max(axis=0)])
        cells = np.maximum(nodes[:, :-1], nodes[:, 1:])
        cells[:3] /= self._about[JERK]
        cells[3:5] /= self._about[ACCELERATION]
        return np.asarray(cells)

    def still(self, s: Array) -> Array:
        """Largest jerk along the path that the joints allow at no speed, (N,)."""
        return np.asarray(self._about[STILL].take(self._cell(s)))

    def speed(self, s: Array) -> Array:
        """The plan's about there."""
        return np.asarray(self._about[SPEED].take(self._cell(s)))

    @cached_property
    def straight(self) -> Straight | None:
        """What holds everywhere, where nothing changes but the speed of the plan."""
        still, rates = self._about[:SPEED], self._lines[len(self._lines) // 2 :, 0]
        axes = len(self.acceleration)
        if rates[axes:].any() or self._lines[: len(rates)].any() or np.ptp(still, axis=1).any():
            return None
        moves = rates[:axes] != 0.0
        return Straight(rates[:axes][moves, None], self.acceleration[moves], *still[:, 0].tolist())

    def _cell(self, s: Array) -> npt.NDArray[np.intp]:
        return np.asarray(np.searchsorted(self.s[1:-1], s, side="right"))

    def _fill(self, places: Array, derived: Array) -> None:
        slope = np.diff(derived, axis=0) / np.diff(places)[:, None]
        slope[np.diff(places) <= 2.0 * MIN_STEP] = 0.0  # the jump at a junction
        self.s = places
        self._lines = np.ascontiguousarray(np.hstack([slope, derived[:-1]]).T)  # else each take copies all

    def _refined(self, course: FeedCourse, places: Array, s: Array, v: Array) -> tuple[Array, Array]:
        """More places where a straight line between two is not good enough at the plan's speed."""
        derived = self._derived(course, places)
        for _ in range(SPLIT_ROUNDS):
            speed = np.interp(places[1:-1], s, v)
            wrong = self._error(places, derived, speed) > SPLIT_ERROR
            bad = np.flatnonzero(wrong)
            cells = distinct(np.concatenate([bad, bad + 1]))
            cells = cells[np.diff(places)[cells] > 4.0 * MIN_STEP]
            if not len(cells):
                break
            more = 0.5 * (places[cells] + places[cells + 1])
            order = np.argsort(np.concatenate([places, more]), kind="stable")
            derived = np.concatenate([derived, self._derived(course, more)])[order]
            places = np.concatenate([places, more])[order]
        return places, derived

    def _derived(self, course: FeedCourse, places: Array) -> Array:
        d = course.derivatives(places)
        return np.concatenate([d.first, d.second, d.third], axis=1) / np.tile(self._jerk, 3)

    def _error(self, places: Array, derived: Array, speed: Array) -> Array:
        """Estimated error of a straight line about each inner place, in shares of limits (N - 2,)."""
        h0, h1 = np.diff(places)[:-1, None], np.diff(places)[1:, None]
        line = (derived[:-2] * h1 + derived[2:] * h0) / (h0 + h1)
        off = np.abs(derived[1:-1] - line) / 4.0
        a, v = self.acceleration.T, speed[:, None]
        _, second, third = np.split(off, 3, axis=1)
        found = np.maximum(second * v**2 / a, third * v**3)
        jump = ((h0 <= 2.0 * MIN_STEP) | (h1 <= 2.0 * MIN_STEP))[:, 0]
        return np.where(jump, 0.0, found.max(axis=1))


def _rising(s: Array, v: Array) -> tuple[Array, Array]:
    """The samples of a plan without those that do not advance; of one that hardly does, both ends."""
    keep = np.concatenate([[True], np.diff(np.maximum.accumulate(s)) > 4.0 * MIN_STEP])
    keep[-1] |= keep.sum() < 2
    return s[keep], v[keep]


def _running(cells: Array, width: int) -> Array:
    """Of each cell the largest of it and those behind it, ``width`` in all; (rows, cells)."""
    found, done = cells.copy(), 1
    while done < width:
        more = min(done, width - done)
        found[:, :-more] = np.maximum(found[:, :-more], found[:, more:])
        done += more
    return found


def lower(nodes: Array) -> Array:
    """Of each cell the lower of its two ends' values, (rows, nodes) to (rows, nodes - 1)."""
    return np.minimum(nodes[:, :-1], nodes[:, 1:])


def _rooms(course: FeedCourse, places: Array, s: Array, v: Array) -> tuple[Array, Array, Array]:
    """Shares of the jerk and acceleration limits that a stop may use, and the share of rapids in them.

    A junction's jump of rates is spread over one tick; at the speed that it allows it takes
    JUMP_SHARE of the jerk, and of the acceleration what that jerk makes in a tick. Also the same
    for a stop that ends before the junction ahead, and where that one is; -inf where none is near.
    """
    period, limits = course.machine.period_s, course.stop_limits
    rapid = [course.machine.rapid_share if x.feed_mm_s is None else 1.0 for x in course.segments]
    room = np.tile(np.array(rapid)[course.index(places)], (3, 1))
    before, ahead = room.copy(), np.full(len(places), -np.inf)
    inner = course.starts[1:-1]
    for k in np.flatnonzero((inner >= s[0]) & (inner <= s[-1])).tolist():
        speed = float(np.interp(inner[k], s, v))
        taken = JUMP_SHARE * min(1.0, speed / max(course.junction(k), TINY))
        reach = NEAR_TICKS * speed * period
        here = within(places, inner[k], reach)
        near = np.abs(places[here] - inner[k]) <= reach
        behind = near & (places[here] >= inner[k])
        ahead[here][near & ~behind] = inner[k]
        acceleration = taken * min(1.0, float((limits.jerk * period / limits.acceleration).max()))
        for rows, where in ((room[:, here], near), (before[:, here], behind)):
            rows[0, where] *= 1.0 - taken
            rows[1, where] *= 1.0 - acceleration
    return room, before, ahead


class RowWay(Way):
    """A way of exact rows alone.

    Between two corners there is hardly a tick, so that no single one of them counts, but what ticks see of
    all (``feed.ticked``) at the plan's speed there. At a lower one it is less.
    """

    is_rough = True

    def __init__(self, course: FeedCourse, profile: Profile, first_s: float, last_s: float) -> None:
        self._take(course.stop_limits, course.machine.period_s)
        ticked = of(course, profile.start_s, profile.end_s)
        ends = profile.along(np.array([first_s, last_s]))[0]
        edges = ticked.edges
        low = max(int(np.searchsorted(edges, ends[0], side="right")) - 1, 0)
        high = min(int(np.searchsorted(edges, ends[1])) + 1, len(edges))
        times = np.linspace(first_s, last_s, max(int((last_s - first_s) / course.machine.period_s), 4) + 1)
        s, v, _, _ = profile.along(times)
        speed = np.interp(edges, np.maximum.accumulate(s), v)
        fastest = np.maximum(speed[1:], speed[:-1])
        first, second = ticked.smooth(speed)
        self.s, inner = edges[low:high], slice(low, high - 1)
        first, second = first[:, low:high] / self._jerk[:, None], second[:, low:high] / self._jerk[:, None]
        derived = np.concatenate([first, second, 0.0 * first])
        self._fill(self.s, derived.T)
        still = lower(1.0 / (np.abs(first).max(axis=0) + TINY)[None])[0]
        rapid, rooms = np.ones(high - 1 - low), ticked.rooms(fastest)
        # A search steps over into the next cell: it has the least of three.
        self._about, self._about_before = (
            np.stack([jerk[inner], acceleration[inner], rapid, still, fastest[inner]])
            for acceleration, jerk in ([beside(room) for room in rooms], rooms)
        )
        self._most = self._shares(np.abs(derived).reshape(3, len(first), -1))
        self._widths = {}

    def at(self, s: Array, v: Array, ends: Array | None = None) -> tuple[Array, Array]:
        """As of any way; what corners take becomes less with the speed ``v``, as jumps of rates do."""
        found, about = self._found(s, self._about if ends is None else self._about_before)
        share = np.clip(v / np.maximum(about[SPEED], TINY), 0.0, 1.0)
        about[:2] = 1.0 - (1.0 - about[:2]) * share  # JERK and ACCELERATION
        return found, about
