"""Shares of the limits as drives get them: by the differences of setpoints a period apart.

    velocity      [q(t + T/2) - q(t - T/2)] / T
    acceleration  [q(t + T) - 2 q(t) + q(t - T)] / T^2
    jerk          [q(t + 3T/2) - 3 q(t + T/2) + 3 q(t - T/2) - q(t - 3T/2)] / T^3

A law keeps its limits at its knots and nearly between them: its own derivatives may exceed a limit of jerk by
up to 1.2 % for a millisecond or two (``feed.search.FINE``). No drive gets a derivative, so where one is above
its limit these differences say what the axis is asked for.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from controller.geometry.arrays import Array
from controller.plan.feed.binding import Span
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import along
from controller.plan.path.path import joints_along

STEPS = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)  # periods about a moment
DIFFERENCES = np.array(  # of the joints at those: a row each of velocity, acceleration and jerk
    [
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, -2.0, 0.0, 1.0, 0.0],
        [-1.0, 0.0, 3.0, 0.0, -3.0, 0.0, 1.0],
    ]
)


class Setpoints:
    """The joints of one window of a plan at any time of it."""

    def __init__(self, course: FeedCourse, spans: Sequence[Span]) -> None:
        self._course, self._spans = course, spans
        lasts = itertools.accumulate((one.to_s - one.from_s + one.stands_s for one in spans), initial=0.0)
        self._begins = np.array([*lasts][:-1])
        self._clocks = {one.stretch: t - one.from_s for one, t in zip(spans, self._begins, strict=True)}

    def shares(self, stretch: int, law_s: Array, limits: Array) -> Array:
        """Shares (N, axes, 3) of ``limits`` (axes, 3) at the times ``law_s`` (N,) of a stretch's law."""
        T = self._course.machine.period_s
        t = self._clocks[stretch] + law_s[:, None] + T * np.array(STEPS)
        q = self._joints(t.ravel()).reshape(*t.shape, -1)
        found = np.abs(np.einsum("kp,npa->nak", DIFFERENCES, q)) / T ** np.arange(1.0, 4.0)
        return np.asarray(found / limits)

    def _joints(self, t: Array) -> Array:
        """(N, axes). Before the window and after it the law goes on, but not beyond its stretch."""
        course, k = self._course, np.clip(np.searchsorted(self._begins, t, side="right") - 1, 0, None)
        q = np.empty((len(t), len(course.machine.axes)))
        for one in np.unique(k).tolist():
            span, here = self._spans[one], k == one
            stretch = course.stretches[span.stretch]
            s = along(span.law, t[here] - self._begins[one] + span.from_s)[0]
            q[here] = joints_along(stretch, np.clip(s, 0.0, stretch.motion.end), course.kinematics)
        return q
