"""When a whole run at 100 % passes which place: what is left from anywhere, without planning it anew.

    passing.take(planned)        each of a check's windows, in the order of the path
    passing.at_s(motion_id, s)   seconds from the start

Between two marks time is taken to grow evenly; marks are as dense as the planner's windows, and where
that would be too many, a few thousand over the whole program.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from controller.plan.feed.binding import Span
from controller.plan.feed.course import Course
from controller.plan.feed.law import along
from controller.plan.report.planned import Planned
from controller.plan.route.stretch import Stretch

MOST = 4000  # marks

Mark = tuple[int, float, float]  # motion id, s, seconds from the start


class Passing:
    """Marks of the places at which windows begin and end."""

    def __init__(self) -> None:
        self._marks: list[Mark] = []
        self._stretch: Stretch | None = None
        self._number = -1  # of that stretch, as the planner counts
        self._now_s = 0.0
        self._apart_s = 0.0  # of two marks of one motion, at the least

    @property
    def marks(self) -> tuple[Mark, ...]:
        return tuple(self._marks)

    def take(self, sent: Planned) -> None:
        """What is planned next."""
        if sent.course is not None:
            self._spans(sent.course, sent.spans)
        self._now_s += sent.took_s

    def _spans(self, course: Course, spans: Sequence[Span]) -> None:
        known = [k for k, stretch in enumerate(course.stretches) if stretch is self._stretch]
        base = self._number - known[0] if known else self._number + 1
        now_s = self._now_s
        for span in spans:
            first, last = along(span.law, np.array([span.from_s, span.to_s]))[0]
            self._mark(base + span.stretch, float(first), now_s)
            now_s += span.to_s - span.from_s
            self._mark(base + span.stretch, float(last), now_s)
        if spans:
            self._number, self._stretch = base + spans[-1].stretch, course.stretches[spans[-1].stretch]

    def _mark(self, number: int, s: float, now_s: float) -> None:
        if self._marks and now_s - self._marks[-1][2] < self._apart_s:
            return
        self._marks.append((number, s, now_s))
        if len(self._marks) > MOST:
            self._apart_s = max(2.0 * self._apart_s, 2.0 * now_s / MOST)
            self._marks = self._marks[::2]


def at_s(marks: Sequence[Mark], motion_id: int, s: float) -> float:
    """Seconds from the start to a place of a motion, at 100 %."""
    i = bisect_right(marks, (motion_id, s), key=lambda mark: mark[:2])
    if i == 0:
        return 0.0
    number, from_s, time_s = marks[i - 1]
    if i == len(marks) or number != motion_id or marks[i][0] != motion_id or marks[i][1] <= from_s:
        return time_s
    return time_s + (marks[i][2] - time_s) * (s - from_s) / (marks[i][1] - from_s)
