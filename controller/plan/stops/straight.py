"""The search for stops on a straight way: the same stops as ``search`` finds, many steps at once.

What the joints allow is the same everywhere there, so that the braking of every start is known without its
places: the acceleration alone leads from step to step. Where each one lands is looked up behind that.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array
from controller.plan.stops.search import (
    AHEAD_OF_PLAN,
    CONTRADICTION,
    MAX_STEPS,
    MIN_LIFT,
    Found,
    Lanes,
    Motion,
    landing_of,
)
from controller.plan.stops.way import Straight, Way

AT_ONCE = 16  # steps


def search(
    way: Way, straight: Straight, start: Motion, h: float, shares: tuple[float, float, float]
) -> Found:
    """Stops from ``start``, with jerks held for ``h`` seconds each; all have the same ``shares``."""
    lanes, lane = Lanes(len(start[0])), np.arange(len(start[0]))
    joints = _Joints(straight, h, shares)
    s, v, a = start
    while len(lane) and len(lanes.rows) < MAX_STEPS:
        made = len(lanes.rows)
        a, low, high, j = joints.braked(a, min(AT_ONCE, MAX_STEPS - made))
        v = np.cumsum(np.concatenate([v[None], h * (a[:-1] + h * j / 2)]), axis=0)
        s = np.cumsum(np.concatenate([s[None], h * (v[:-1] + h * (a[:-1] / 2 + h * j / 6))]), axis=0)
        x = v[:-1] + 0.5 * h * a[:-1]
        first, rest, count = landing_of(x, a[:-1], h, joints.landing)
        s1, ahead = s[:-1] + h * x, x > 0.0
        lands = ahead & (first >= low) & (first <= high + 1e-9) & joints.fit(rest)
        late = ahead & (first > high) & (a[:-1] < 0.0) & ~lands
        stuck = (low - joints.most > CONTRADICTION * straight.still) & ~lands
        off = s1 > way.end
        ends = lands | off | stuck | ~ahead | (v[1:] > AHEAD_OF_PLAN * way.speed(s1))
        ended = ends.any(axis=0)
        last = np.where(ended, ends.argmax(axis=0), len(j) - 1)
        at, step = (last, np.arange(len(lane))), np.arange(len(j))[:, None]
        told = (stuck | late) & (step <= last) & (made + step > 0)
        where = np.flatnonzero(told.any(axis=0))
        at_first = (told[:, where].argmax(axis=0), where)
        needed = a[at_first] + h * np.where(late[at_first], first[at_first], low[at_first])
        lanes.stick(lane[where], made + at_first[0], needed, np.full(len(where), joints.lift))
        landed = lands[at]
        j[at] = np.where(landed, first[at], j[at])
        lanes.rows += [(lane, row) for row in j]
        lanes.landed(lane[landed], made + last[landed] + 1, count[at][landed], rest[at][landed])
        lanes.short[lane[(off & (step <= last)).any(axis=0)]] = True
        s, v, a, lane = s[-1][~ended], v[-1][~ended], a[-1][~ended], lane[~ended]
    return lanes.result()


class _Joints:
    """What the joints allow along the path: jerks, and by their accelerations."""

    def __init__(self, straight: Straight, h: float, shares: tuple[float, float, float]) -> None:
        self._h, rates = h, straight.rates
        jerk, acceleration, lift = shares
        room = jerk * straight.jerk_room
        self.most = float((room / np.abs(rates)).min())
        self._bends = h * rates, rates
        self._half = straight.acceleration * (acceleration * straight.acceleration_room)
        self._half = self._half / np.abs(self._bends[0])
        self.landing = max(min(self.most, room * straight.still) * lift, 1e-9)
        self.lift = max(self.most, MIN_LIFT * straight.still)
        self._rate, self._room = float(np.abs(rates).max()), room * (1.0 + 1e-6)

    def braked(self, a: Array, steps: int) -> tuple[Array, Array, Array, Array]:
        """Accelerations (steps + 1, N) from ``a`` on, bounds of each step's jerk, and the jerk (steps, N)."""
        found, low, high, jerks = [a], [], [], []
        slope, rates = self._bends
        for _ in range(steps):
            middle = rates * a / slope  # with its sign turned
            low.append(np.maximum(0.0 - (middle + self._half).min(axis=0), -self.most))
            high.append(np.minimum((self._half - middle).min(axis=0), self.most))
            jerks.append(np.minimum(low[-1], self.most))
            a = a + self._h * jerks[-1]
            found.append(a)
        return np.array(found), np.array(low), np.array(high), np.array(jerks)

    def fit(self, rest: Array) -> npt.NDArray[np.bool_]:
        """Whether they allow the jerk of a landing."""
        return np.asarray(self._rate * rest <= self._room)
