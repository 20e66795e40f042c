"""The search for stops: many starts at once, each braking as hard as its joints allow, step by step.

            v
    ____      start: jerk down at once, as much as the joints allow
        \\
         \\         along the lowest acceleration that the joints allow
          \\
           \\___    landing: one step that leads onto a constant jerk with which v and a vanish together

The jerk of a step is bounded by each joint's jerk where it begins and where it ends, and
by each joint's acceleration where it ends. All are linear in the jerk of the path:

    q''' v^3 + 3 q'' v a + q' j        q'' v^2 + q' (a + j h)

Slower is nearly always freer, so the hardest braking of one step seldom leads where the
next has none. Where it does, the search is stuck: the lowest acceleration rises faster
than the jerk allows. It is then begun again with a ramp, a line of acceleration over time
that the stop must not be below when it comes there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array
from controller.plan.stops.way import ACCELERATION, JERK, SPEED, STILL, Way

Indices = npt.NDArray[np.intp]
Motion = tuple[Array, Array, Array]  # s, v, a, each (N,)

MAX_STEPS = 1000
NO_SLOPE = 1e-18  # of a joint's acceleration by the path's jerk: it has no part in that joint
LANDING_LOOKS = (0.6, 1.0)  # places of the landing at which its jerk is looked up
CONTRADICTION = 0.01  # of the still jerk, by which bounds may contradict each other
MIN_LIFT = 0.2  # of the still jerk, with which a ramp may rise at least
AHEAD_OF_PLAN = 1.002  # times the plan's speed at the same place: such a stop does not brake


class Shares(NamedTuple):
    """Shares of the limits that a search may use, one per start (N,)."""

    jerk: Array
    acceleration: Array
    lift: Array  # of the jerk, with which a stop expects to land


class Ramps(NamedTuple):
    """Least accelerations: ``acceleration`` from ``step`` to ``until``, less before by ``jerk``; (M, N)."""

    step: Array
    acceleration: Array
    jerk: Array
    until: Array

    def least(self, made: int, h: float) -> Array:
        """The least acceleration after ``made`` steps, (N,)."""
        line = self.acceleration - self.jerk * (h * np.maximum(self.step - made, 0.0))
        return np.asarray(np.where(self.until >= made, line, -np.inf).max(axis=0))

    def of(self, lanes: Indices | npt.NDArray[np.bool_]) -> Ramps:
        return Ramps(*(x[:, lanes] for x in self))


class Stuck(NamedTuple):
    """Where searches came to need more acceleration than they had jerk for, each (N,)."""

    steps: Indices  # made before; 0 = nowhere
    needed: Array  # acceleration behind the step that followed
    lift: Array  # jerk that there was to come to it

    def of(self, lanes: Indices | npt.NDArray[np.bool_]) -> Stuck:
        return Stuck(self.steps[lanes], self.needed[lanes], self.lift[lanes])


@dataclass(frozen=True, slots=True)
class Found:
    """Jerks (K, N) of N stops, zeros behind each one's ``steps`` (N,); ``steps`` 0: none was found.

    ``short`` (N,) marks searches that ran off the end of the table of the way.
    """

    jerks: Array
    steps: Indices
    stuck: Stuck
    short: npt.NDArray[np.bool_]


class _Bounds(NamedTuple):
    """Bounds of a step's jerk by the joints' jerk, and by their acceleration too; each (N,)."""

    least: Array
    most: Array
    low: Array
    high: Array
    landing: Array  # the largest jerk at the step's end


class Lanes:
    """What is known of every start so far, (N,)."""

    def __init__(self, count: int) -> None:
        self.begun, self.landing = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=np.intp)
        self.landing_jerk = np.zeros(count)
        self.stuck = Stuck(np.zeros(count, dtype=np.intp), np.zeros(count), np.zeros(count))
        self.short = np.zeros(count, dtype=bool)
        self.rows: list[tuple[Indices, Array]] = []

    def landed(self, lane: Indices, begun: Indices | int, count: Indices, jerk: Array) -> None:
        self.begun[lane], self.landing[lane], self.landing_jerk[lane] = begun, count, jerk

    def stick(self, lane: Indices, steps: Indices | int, needed: Array, lift: Array) -> None:
        """Note where searches are stuck for the first time."""
        new = self.stuck.steps[lane] == 0
        self.stuck.needed[lane[new]], self.stuck.lift[lane[new]] = needed[new], lift[new]
        self.stuck.steps[lane[new]] = steps if isinstance(steps, int) else steps[new]

    def result(self) -> Found:
        """All stops in one array: the steps that were searched, then the landing."""
        steps = self.begun + self.landing
        jerks = np.zeros((int(steps.max(initial=1)), len(steps)))
        for i, (lane, j) in enumerate(self.rows[: len(jerks)]):
            on = self.begun[lane] > i
            jerks[i, lane[on]] = j[on]
        lane = np.repeat(np.arange(len(steps)), self.landing)
        first = self.begun - np.cumsum(self.landing) + self.landing  # a landing's step, less those before it
        jerks[first[lane] + np.arange(len(lane)), lane] = self.landing_jerk[lane]
        return Found(jerks, steps, self.stuck, self.short & (self.begun == 0))


def search(
    way: Way,
    start: Motion,
    h: float,
    shares: Shares,
    ramps: Ramps | None = None,
    sure: int = MAX_STEPS,
) -> Found:
    """Stops from ``start``, with jerks held for ``h`` seconds each.

    A landing of no more than ``sure`` steps is not looked at again; a longer one goes step by
    step within all bounds, which takes longer to find.
    """
    lanes = Lanes(len(start[0]))
    lane = np.arange(len(start[0]))
    s, v, a = start
    here = way.at(s, v)
    while len(lane) and len(lanes.rows) < MAX_STEPS:
        s1 = s + h * (v + 0.5 * h * a)
        there = way.at(s1, v + h * a)
        bounds = _bounds(way, here, there, (v, a), h, shares)
        if ramps:
            bounds = _above(bounds, (ramps.least(len(lanes.rows) + 1, h) - a) / h)
        landing = _landing(way, bounds, there, (s1, v, a), h, shares)
        still = there[1][STILL]
        # With a landing in sight the jerk is that of the landing, or what the joints ask for above it.
        low = np.where(landing.lands, np.maximum(landing.first, bounds.low), bounds.low)
        j = _between(low, bounds.least, bounds.most)
        landing = landing.of_at_most(sure)
        j = np.where(landing.lands, landing.first, j)
        stuck = (bounds.low - bounds.most > CONTRADICTION * still) & ~landing.lands
        told = np.flatnonzero(stuck | landing.late)
        if len(told):
            needed = a + h * np.where(landing.late, landing.first, bounds.low)
            lift = np.maximum(bounds.most, MIN_LIFT * still)
            lanes.stick(lane[told], len(lanes.rows), needed[told], lift[told])
        lanes.rows.append((lane, j))
        lands = np.flatnonzero(landing.lands)
        lanes.landed(lane[lands], len(lanes.rows), landing.steps[lands], landing.rest[lands])
        off = s1 > way.end
        lanes.short[lane[off]] = True
        s, v, a = s + h * (v + h * (a / 2 + h * j / 6)), v + h * (a + h * j / 2), a + h * j
        lost = landing.missed | (v > AHEAD_OF_PLAN * there[1][SPEED])
        ends = landing.lands | off | stuck | lost
        here = there
        if ends.any():
            keep = np.flatnonzero(~ends)
            s, v, a, lane = s[keep], v[keep], a[keep], lane[keep]
            here = (there[0].take(keep, axis=1), there[1].take(keep, axis=1))
            shares = Shares(*(x[keep] for x in shares))
            ramps = ramps.of(keep) if ramps else None
    return lanes.result()


def _between(x: Array, low: Array | float, high: Array | float) -> Array:
    return np.asarray(np.minimum(np.maximum(x, low), high))


def _above(bounds: _Bounds, least: Array) -> _Bounds:
    """The bounds with a ramp's least jerk, as far as the others allow it."""
    return bounds._replace(low=np.maximum(np.minimum(least, bounds.most), bounds.low))


def _bounds(
    way: Way,
    here: tuple[Array, Array],
    there: tuple[Array, Array],
    motion: tuple[Array, Array],
    h: float,
    shares: Shares,
) -> _Bounds:
    """Bounds of the jerk of one step; ``here`` and ``there`` are the way where it begins and ends."""
    v, a = motion
    v1 = v + h * a
    d, e = (q.reshape(3, len(q) // 3, -1) for q, _ in (here, there))
    slope, value, bound = np.empty((3, *d.shape))
    slope[0], value[0] = d[0], v * (d[2] * (v * v) + 3.0 * a * d[1])
    slope[1] = e[0] + e[1] * (3.0 * h * (v1 + 0.5 * h * a)) + e[2] * (1.5 * h * h * v1 * v1)
    value[1] = v1 * (e[2] * (v1 * v1) + 3.0 * a * e[1])
    slope[2], value[2] = h * (e[0] + e[1] * (v1 * h)), e[1] * (v1 * v1) + e[0] * a
    bound[0], bound[1] = shares.jerk * here[1][JERK], shares.jerk * there[1][JERK]
    bound[2] = way.acceleration * (shares.acceleration * there[1][ACCELERATION])
    size = np.abs(slope)
    if size.min(initial=1.0) < NO_SLOPE:
        slope[size < NO_SLOPE] = NO_SLOPE
        size = np.abs(slope)
    middle, half = value / slope, bound / size  # the former with its sign turned
    low, high = 0.0 - (middle + half).min(axis=1), (half - middle).min(axis=1)  # 0.0 -: no zero below 0
    least, most = np.maximum(low[0], low[1]), np.minimum(high[0], high[1])
    if (none := least > most).any():
        best = _compromise((-middle - half)[:2, :, none], (half - middle)[:2, :, none], slope[:2, :, none])
        most[none] = best
    return _Bounds(least, most, np.maximum(least, low[2]), np.minimum(most, high[2]), high[1])


def _compromise(low: Array, high: Array, slope: Array) -> Array:
    """Where the joints' bounds (2, axes, N) contradict each other: a jerk as far beyond both."""
    low, high, weight = (x.reshape(2 * x.shape[1], -1) for x in (low, high, 1.0 / np.abs(slope)))
    i, k = low.argmax(axis=0), high.argmin(axis=0)
    lane = np.arange(low.shape[1])
    over = (low[i, lane] - high[k, lane]) / (weight[i, lane] + weight[k, lane])
    return np.asarray(low[i, lane] - over * weight[i, lane])


class _Landing(NamedTuple):
    """A landing from each state: jerk of this step, then ``rest`` for ``steps`` steps; each (N,)."""

    first: Array
    rest: Array
    steps: Indices
    lands: npt.NDArray[np.bool_]  # the joints allow it
    late: npt.NDArray[np.bool_]  # it should have begun before
    missed: npt.NDArray[np.bool_]  # v would fall below zero whatever is done

    def of_at_most(self, steps: int) -> _Landing:
        return self._replace(lands=self.lands & (self.steps <= steps))


def _landing(
    way: Way, bounds: _Bounds, there: tuple[Array, Array], state: Motion, h: float, shares: Shares
) -> _Landing:
    """The quickest landing with one jerk; ``state`` is the place behind this step, v and a before it."""
    _, v, a = state
    up = np.minimum(bounds.landing, _landing_jerk(way, state, h, there[1][JERK] * shares.jerk))
    x = v + 0.5 * h * a
    first, rest, n = landing_of(x, a, h, np.maximum(up * shares.lift, 1e-9))
    ahead = x > 0.0
    lands = ahead & (first >= bounds.low) & (first <= bounds.high + 1e-9)
    lands[lands] = _fits(there, v[lands], a[lands], first[lands], rest[lands], h, shares.jerk, lands)
    late = ahead & (first > bounds.high) & (a < 0.0) & ~lands
    return _Landing(first, rest, n, lands, late, ~ahead)


def landing_of(x: Array, a: Array, h: float, up: Array | float) -> tuple[Array, Array, Indices]:
    """Jerk of this step, of those behind it, and how many these are; ``up`` is what the joints allow.

    With x = v + a h / 2:  rest = 2 x / (h^2 n (n + 1)),  first = -a / h - n rest, and n is the
    least for which rest is no more than ``up``.
    """
    n = np.ceil(0.5 * (np.sqrt(1.0 + 8.0 * np.maximum(x, 0.0) / (up * h * h)) - 1.0) - 1e-9)
    n = _between(n, 1.0, MAX_STEPS)
    rest = 2.0 * x / (h * h * n * (n + 1.0))
    return -a / h - n * rest, rest, n.astype(np.intp)


def _landing_jerk(way: Way, state: Motion, h: float, room: Array) -> Array:
    """The jerk that the joints allow further on in a landing, v t / 3 long with t = 2 v / -a."""
    s, v, a = state[0], state[1] + h * state[2], state[2]
    length = np.where(a < 0.0, 2.0 / 3.0 * v * np.minimum(v / np.maximum(-a, 1e-9), 1.0), 0.0)
    return room * np.minimum(*(way.still(s + look * length) for look in LANDING_LOOKS))


def _fits(
    there: tuple[Array, Array],
    v: Array,
    a: Array,
    first: Array,
    rest: Array,
    h: float,
    share: Array,
    lands: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bool_]:
    """Whether the joints allow the jerk of a landing where it begins, behind the first step."""
    e, bound = there[0][:, lands], (share * there[1][JERK])[lands]
    e = e.reshape(3, len(e) // 3, -1)
    v1, a1 = v + h * (a + 0.5 * h * first), a + h * first
    jerk = v1 * (e[2] * (v1 * v1) + 3.0 * a1 * e[1]) + e[0] * rest
    return np.asarray(np.abs(jerk).max(axis=0) <= bound * (1.0 + 1e-6))
