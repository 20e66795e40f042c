"""What stops see of exact rows: the joints smoothed over some ticks, and what their corners leave of limits.

Between two corners there is hardly a tick, so that no single one of them counts, but what ticks see of all
(``feed.ticked``) at the plan's speed there. At a lower one it is less.
"""

from __future__ import annotations

import numpy as np

from controller.geometry.arrays import Array
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.profile import Profile
from controller.plan.feed.ticked import beside, of
from controller.plan.stops.way import SPEED, TINY, Way, lower


class RowWay(Way):
    """A way of exact rows alone."""

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
