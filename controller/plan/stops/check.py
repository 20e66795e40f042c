"""The check of stops: every joint at both ends and inside of every step, by the machine's limits.

Nearly every step is within them by a bound on all of it, for which the largest derivatives thereabouts are
enough. Only the steps that this does not show to be within are looked at place by place.
"""

from __future__ import annotations

import itertools

import numpy as np

from controller.geometry.arrays import Array, Flags
from controller.plan.stops.search import Found, Indices, Motion
from controller.plan.stops.way import ACCELERATION, JERK, RAPID, Way

# Accepted at most. A plan runs at up to 1.0, 1.0005 and 1.012, and a stop begins there.
MAX_VELOCITY, MAX_ACCELERATION, MAX_JERK = 1.0003, 1.0009, 1.0148
SURE_SHARE = 1.0 - 1e-9  # of those, what is within without a closer look: rounding is less
AT_ONCE = 128  # stops: what is known of them fits into a cache
MIN_LOOKS, MAX_LOOKS = 4, 8  # parts of a step at whose ends it is looked at; of a step of many ticks more
STANDSTILL = 1e-9  # speed (unit of s per second) below which nothing needs to stop


def check(way: Way, start: Motion, h: float, found: Found) -> tuple[Flags, Array]:
    """Whether each stop (N,) was found and keeps the limits, and where it ends (N,); inf: none was found."""
    good, ends = found.steps > 0, np.full(len(found.steps), np.inf)
    there = np.flatnonzero(good)
    there = there[np.argsort(found.steps[there], kind="stable")]  # one long stop makes all beside it long
    for k in range(0, len(there), AT_ONCE):
        lanes = there[k : k + AT_ONCE]
        good[lanes], ends[lanes] = _checked(way, start, h, found, lanes)
    return good, ends


def _checked(way: Way, start: Motion, h: float, found: Found, lanes: Indices) -> tuple[Flags, Array]:
    """Of some stops that were found."""
    steps, fine = found.steps[lanes], np.ones(len(lanes), dtype=bool)
    j = found.jerks[: steps.max()].take(lanes, axis=1)
    s, v, a = nodes((start[0][lanes], start[1][lanes], start[2][lanes]), h, j)
    used = np.arange(len(j))[:, None] < steps
    step, lane = np.nonzero(used & ~_surely_within(way, (s, v, a), j, h))
    if not len(step):
        return fine, s[-1]
    rapid, at, n = way.at(s[0], v[0])[1][RAPID], (step, lane), len(looks := _looks(h, way.period_s))
    inside = _after(s[at], v[at], a[at], j[at], h * looks[:, None])
    motion = (inside[0].ravel(), inside[1].ravel(), inside[2].ravel())
    lane = np.tile(lane, n)
    fine[lane[~_within(way, motion, np.tile(j[at], n), rapid[lane], s[-1][lane])]] = False
    return fine, s[-1]


def _looks(h: float, period_s: float) -> Array:
    """Shares of a step of ``h`` at which it is looked at.

    A joint's jerk is bent there like a parabola: with its ends and middle alone, one rose 0.35 % above them.
    """
    looks = min(max(round(h / period_s) + 1, MIN_LOOKS), MAX_LOOKS)
    return np.arange(looks + 1) / looks


def nodes(start: Motion, h: float, jerks: Array) -> Motion:
    """s, v, a at the ends of all steps, each (K + 1, N)."""
    s, v, a = start
    a = np.concatenate([a[None], a + h * _sums(jerks)])
    v = np.concatenate([v[None], v + _sums(h * (a[:-1] + 0.5 * h * jerks))])
    steps = h * (v[:-1] + h * (0.5 * a[:-1] + h / 6.0 * jerks))
    return np.concatenate([s[None], s + _sums(steps)]), v, a


def _sums(rows: Array) -> Array:
    """As cumsum along the first axis, which goes down one column after the other and out of the cache."""
    for before, row in itertools.pairwise(found := rows.copy()):
        row += before
    return found


def _after(s: Array, v: Array, a: Array, j: Array, x: Array) -> Motion:
    return s + x * (v + x * (a / 2.0 + x * j / 6.0)), v + x * (a + x * j / 2.0), a + x * j


def _surely_within(way: Way, motion: Motion, j: Array, h: float) -> Flags:
    """Which steps (K, N) keep the limits as a whole; ``motion`` is that of their ends (K + 1, N).

    The acceleration of a step is the larger at one of its ends, and so is the speed, but where the
    acceleration changes its sign: there it is by less than half of the lesser acceleration times h beyond.
    """
    s, v, a = motion
    size = np.abs(a)
    turns = np.where(a[:-1] * a[1:] < 0.0, 0.5 * h * np.minimum(size[:-1], size[1:]), 0.0)
    speed, rate = np.maximum(v[:-1], v[1:]) + turns, np.maximum(size[:-1], size[1:])
    most, known = way.most(s, h)
    jerk = speed * (most[2] * (speed * speed) + 3.0 * rate * most[1]) + most[0] * np.abs(j)
    known &= np.minimum(v[:-1], v[1:]) - turns >= -STANDSTILL
    known &= jerk <= SURE_SHARE * MAX_JERK
    known &= most[4] * (speed * speed) + most[3] * rate <= SURE_SHARE * MAX_ACCELERATION
    known &= most[5] * speed <= SURE_SHARE * MAX_VELOCITY
    return known


def _within(way: Way, motion: Motion, j: Array, rapid: Array, ends: Array) -> Flags:
    """Whether each of many states (N,) is within every joint's limits, with its jerk ``j`` (N,).

    A stop that begins at feed (``rapid`` 1.0) may end in a rapid with the limits of a feed.
    """
    s, v, a = motion
    q, about = way.at(s, v, ends)
    room = about * np.maximum(rapid / about[RAPID], 1.0)
    d = q.reshape(3, len(q) // 3, -1)
    jerk = np.abs(v * (d[2] * (v * v) + 3.0 * a * d[1]) + d[0] * j).max(axis=0)
    acceleration = (np.abs(d[1] * (v * v) + d[0] * a) / way.acceleration).max(axis=0)
    velocity = (np.abs(d[0] * v) / way.velocity).max(axis=0)
    return np.asarray(
        (v >= -STANDSTILL)
        & (jerk <= MAX_JERK * room[JERK])
        & (acceleration <= MAX_ACCELERATION * room[ACCELERATION])
        & (velocity <= MAX_VELOCITY)
    )
