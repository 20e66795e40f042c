"""When a whole run at 100 % passes which place: what is left from anywhere, without planning it anew.

    passing = Passing()
    for sent in planned(passing.watched(items), ...):
        passing.take(sent)
    passed_s(passing.marks, place)

Beside the marks it has the pauses in which the path clock stands (``events``), at the same seconds.

A place is told by what does not depend on where the run started: the block in the order of the run, the
fraction of it, and the way beside it. Between two marks of a motion time is taken to grow evenly; they are
some hundredths of a second apart, and where that would be too many, some thousands over the whole program.
"""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from controller.geometry.arrays import Array
from controller.plan.feed.binding import Span
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import along_each
from controller.plan.report.planned import Planned
from controller.plan.restart.program_position import LinePart, lines_along, part_at
from controller.plan.segment import ContinuousPath, PathItem, Segment, Wait
from controller.plan.timetable import MAX_EVENTS, Event, Passed, event_of
from controller.plan.waits import OPTIONAL

MAX_MARKS = 4000  # marks
APART_S = 0.02  # of two marks inside of a window ...
MAX_INSIDE = 40  # ... and so many of them at the most
# In the order in which they are gone along; the block's own motion is OWN.
BEFORE = ("retract", "position", "down", "plunge", "swivel", "pivot", "link", "lead in")
BEHIND = ("lead out", "lift")
OWN = len(BEFORE)

Mark = tuple[Passed, float]  # and seconds from the start


def place_of(name: str, order: int, fraction: float, s: float) -> Passed:
    """Of a motion by its name: the block in the order of the run, the fraction of it, and s."""
    if name in BEFORE:
        return order, fraction, BEFORE.index(name), s
    if name in BEHIND:
        return order, fraction, OWN + 1 + BEHIND.index(name), s
    return order, fraction, OWN, 0.0


class Passing:
    """Marks of the places at which windows, and motions in them, begin and end."""

    def __init__(self) -> None:
        self.marks: list[Mark] = []
        self._events: list[Event] = []
        self._optional: dict[int, int] = {}  # lines that an M1 follows, by the order of their block
        self._parts: dict[int, tuple[Segment, tuple[LinePart, ...]]] = {}  # by identity, of what is ahead
        self._now_s = 0.0
        self._apart_s = 0.0  # of two marks, at the least

    def watched(self, items: Iterable[PathItem]) -> Iterator[PathItem]:
        """The same path."""
        for item in items:
            if isinstance(item, ContinuousPath):
                parts_of = lines_along(item)
                lines = zip(item.segments, parts_of, strict=True)
                self._parts.update((id(segment), (segment, parts)) for segment, parts in lines)
                if item.optional_stops:
                    ends = (part for parts in parts_of for part in parts if part.order in item.optional_stops)
                    self._optional.update((part.order, part.line) for part in ends)
            yield item

    @property
    def events(self) -> list[Event]:
        """In the order of time."""
        stops = [
            Event(passed_s(self.marks, (order, 1.0, OWN, 0.0)), line, Wait(stops=OPTIONAL))
            for order, line in itertools.islice(self._optional.items(), MAX_EVENTS)
        ]
        return sorted([*self._events, *stops], key=lambda event: event.at_s)

    def take(self, sent: Planned) -> None:
        """What is planned next."""
        if sent.course is not None:
            self._spans(sent.course, sent.spans)
        elif sent.pause is not None and (event := event_of(sent.pause, self._now_s)) is not None:
            self._events += [event] if len(self._events) < MAX_EVENTS else []
        self._now_s += sent.took_s

    def _spans(self, course: FeedCourse, spans: Sequence[Span]) -> None:
        now_s, first = self._now_s, 0
        times = [_times(span) for span in spans]
        places = along_each([span.law for span in spans], times)[0].tolist()
        for span, of in zip(spans, times, strict=True):
            segment, parts = self._of(course.segments[span.segment])
            here = slice(first, first := first + len(of))
            took_s = span.to_s - span.from_s
            if not self.marks or now_s + took_s >= self.marks[-1][1] + self._apart_s:
                for s, at_s in zip(places[here], of.tolist(), strict=True):
                    part, fraction = part_at(parts, s)
                    self._mark(place_of(segment.name, part.order, fraction, s), now_s + at_s - span.from_s)
            now_s += took_s + span.stands_s

    def _of(self, segment: Segment) -> tuple[Segment, tuple[LinePart, ...]]:
        """What lies behind it is forgotten."""
        while (first := next(iter(self._parts))) != id(segment):
            del self._parts[first]
        return self._parts[first]

    def _mark(self, place: Passed, now_s: float) -> None:
        if self.marks and (now_s - self.marks[-1][1] < self._apart_s or place < self.marks[-1][0]):
            return
        self.marks.append((place, now_s))
        if len(self.marks) > MAX_MARKS:
            self._apart_s = max(2.0 * self._apart_s, 2.0 * now_s / MAX_MARKS)
            self.marks = self.marks[::2]


def _times(span: Span) -> Array:
    """In the time of its law, at which it is looked at."""
    inside = min(MAX_INSIDE, int((span.to_s - span.from_s) / APART_S))
    return np.linspace(span.from_s, span.to_s, 2 + inside)


def passed_s(marks: Sequence[Mark], place: Passed) -> float:
    """Seconds from the start to a place, at 100 %."""
    i = bisect_right(marks, place, key=lambda mark: mark[0])
    if i == 0:
        return 0.0
    (before, time_s), (after, next_s) = marks[i - 1], marks[min(i, len(marks) - 1)]
    if i == len(marks) or place[2] != before[2] or before[2] != after[2]:
        return time_s
    begin, here, end = map(_along, (before, place, after))
    return time_s + (next_s - time_s) * ((here - begin) / (end - begin) if end > begin else 0.0)


def _along(place: Passed) -> float:
    """Of the block's own way its lines are the measure, of one beside it s."""
    order, fraction, way, s = place
    return order + fraction if way == OWN else s
