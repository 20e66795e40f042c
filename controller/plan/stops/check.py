"""The check of stops: every joint at both ends and inside of every step, by the machine's limits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from controller.plan.stops.search import Found, Motion
from controller.plan.stops.way import ACCELERATION, JERK, RAPID, Way

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

# Accepted at most. A plan runs at up to 1.0, 1.0005 and 1.012, and a stop begins there.
MAX_VELOCITY, MAX_ACCELERATION, MAX_JERK = 1.0003, 1.0009, 1.0148
MIN_LOOKS, MAX_LOOKS = 4, 8  # parts of a step at whose ends it is looked at; of a step of many ticks more
STANDSTILL = 1e-9  # speed (unit of s per second) below which nothing needs to stop


def check(way: Way, start: Motion, h: float, found: Found) -> tuple[Flags, Array]:
    """Whether each stop (N,) was found and keeps the limits, and where it ends (N,)."""
    j = found.jerks
    s, v, a = nodes(start, h, j)
    step, rapid = np.arange(len(s))[:, None], way.at(start[0])[1][RAPID]
    good = found.steps > 0
    used = (step <= found.steps) & good
    lane = np.nonzero(used)[1]
    into, out = np.concatenate([j[:1], j])[used], np.concatenate([j, 0.0 * j[:1]])[used]
    good[lane[~_within(way, (s[used], v[used], a[used]), (into, out), rapid[lane], s[-1][lane])]] = False
    for share in _inner(h, way.period_s):
        used = (step[:-1] < found.steps) & good
        lane = np.nonzero(used)[1]
        inside = _after(s[:-1][used], v[:-1][used], a[:-1][used], j[used], share * h)
        good[lane[~_within(way, inside, (j[used],), rapid[lane], s[-1][lane])]] = False
    return good, s[-1]


def _inner(h: float, period_s: float) -> Array:
    """Shares of a step of ``h`` at which it is looked at inside.

    A joint's jerk is bent there like a parabola: with its ends and middle alone, one rose 0.35 % above them.
    """
    looks = min(max(round(h / period_s) + 1, MIN_LOOKS), MAX_LOOKS)
    return np.arange(1, looks) / looks


def nodes(start: Motion, h: float, jerks: Array) -> Motion:
    """s, v, a at the ends of all steps, each (K + 1, N)."""
    s, v, a = start
    a = np.concatenate([a[None], a + h * np.cumsum(jerks, axis=0)])
    v = np.concatenate([v[None], v + np.cumsum(h * (a[:-1] + 0.5 * h * jerks), axis=0)])
    steps = h * (v[:-1] + h * (0.5 * a[:-1] + h / 6.0 * jerks))
    return np.concatenate([s[None], s + np.cumsum(steps, axis=0)]), v, a


def _after(s: Array, v: Array, a: Array, j: Array, x: float) -> Motion:
    return s + x * (v + x * (a / 2.0 + x * j / 6.0)), v + x * (a + x * j / 2.0), a + x * j


def _within(way: Way, motion: Motion, jerks: tuple[Array, ...], rapid: Array, ends: Array) -> Flags:
    """Whether each of many states (N,) is within every joint's limits, with each of ``jerks`` (N,).

    A stop that begins at feed (``rapid`` 1.0) may end in a rapid with the limits of a feed.
    """
    s, v, a = motion
    q, about = way.at(s, ends)
    room = about * np.maximum(rapid / about[RAPID], 1.0)
    d = q.reshape(3, len(q) // 3, -1)
    rest = v * (d[2] * (v * v) + 3.0 * a * d[1])
    fine = v >= -STANDSTILL
    for j in jerks:
        fine &= np.abs(rest + d[0] * j).max(axis=0) <= MAX_JERK * room[JERK]
    acceleration = (np.abs(d[1] * (v * v) + d[0] * a) / way.acceleration).max(axis=0)
    velocity = (np.abs(d[0] * v) / way.velocity).max(axis=0)
    return np.asarray(
        fine & (acceleration <= MAX_ACCELERATION * room[ACCELERATION]) & (velocity <= MAX_VELOCITY)
    )
