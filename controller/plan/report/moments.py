"""At which moments of a planned motion one has to look to know all of it.

    for row in rows(course, spans, limits):     so many windows at once that memory is bounded
        motion = of(course, row)

Where the speed changes there are windows of ``binding.SHOWN_S``, ten moments in each. Where it is even
the path alone makes a difference: windows are as long as the path is the same, and shorter where a
joint's share of a limit changes by more than ``CHANGE`` within one, until they are ``SHOWN_S`` long. So
no share is wrong by more than that between two moments, as far as what happens is longer than
``mesh.SPACING``, the planner's own.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array, distinct
from controller.geometry.curves import Arc, Even, Line
from controller.motion.motions import JointMove
from controller.plan.feed import binding, mesh
from controller.plan.feed.binding import NUMBER_OF_CODES, SHOWN_S, Codes, Motion, Span
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import along, along_each
from controller.plan.segment import Segment

PER_WINDOW = 10  # moments
MAX_WINDOWS = 320  # that are looked at at once
CHANGE = 0.02  # of a limit, within a window that is longer than SHOWN_S
CLOSER = 4  # parts of a window in which it changes more
PER_RADIAN = 16.0  # moments on an arc


class Look(NamedTuple):
    """A span and how many windows of it are looked at."""

    span: Span
    windows: int


class Windows(NamedTuple):
    """Windows of the display, one after the other: seconds, millimetres of the tip and what binds."""

    dt: list[float]
    ds: list[float]
    codes: list[int]


class Sums:
    """What the moments of a row come to, a row of each list for each look."""

    def __init__(
        self, row: Sequence[Look], motion: Motion, found: Codes, ratio: Array, rate: Array, feed: Array
    ) -> None:
        """Code, shares of limits, ``rate`` of the tip and programmed ``feed`` of each moment."""
        counts = motion.per_window * np.array(motion.windows)
        firsts = np.cumsum(counts) - counts
        self.first = firsts.tolist()
        codes = np.repeat(np.arange(len(row)), counts) * NUMBER_OF_CODES + found
        self.seconds = np.bincount(codes, motion.dt, len(row) * NUMBER_OF_CODES).reshape(len(row), -1)
        self.ratio = np.maximum.reduceat(ratio, firsts, axis=0)
        self.fastest = np.maximum.reduceat(rate * motion.v, firsts).tolist()
        most, least = np.maximum.reduceat(rate * feed, firsts), np.minimum.reduceat(rate * feed, firsts)
        self.feeds = list(zip(least.tolist(), most.tolist(), strict=True))
        ends = [_ends(look) for look in row]
        s = along_each([look.span.law for look in row], [np.array(times) for times in ends])[0]
        ways = np.delete(np.diff(s), np.cumsum(motion.windows)[:-1] + np.arange(len(row) - 1))
        tip_mm = (rate.reshape(-1, motion.per_window).mean(axis=1) * ways).tolist()
        shown, first = binding.shown(motion, found).tolist(), 0
        self.windows: list[Windows] = []
        for look, times in zip(row, ends, strict=True):
            here = slice(first, first := first + look.windows)
            lasts = [after - before for before, after in itertools.pairwise(times)]
            self.windows.append(Windows(lasts, tip_mm[here], shown[here]))


def _ends(look: Look) -> list[float]:
    """Of its windows, in the time of its law."""
    span, n = look
    step_s = (span.to_s - span.from_s) / n
    return [*(k * step_s + span.from_s for k in range(n)), span.to_s]


def of(course: FeedCourse, row: Sequence[Look]) -> Motion:
    """The moments of a row."""
    return binding.moments(course, [one.span for one in row], PER_WINDOW, [one.windows for one in row])


def rows(course: FeedCourse, spans: Sequence[Span], limits: Array) -> Iterator[list[Look]]:
    """All that is to be looked at, in order; ``limits`` (axes, 3) of the joints."""
    row: list[Look] = []
    windows = 0
    for look in _looks(course, spans, limits):
        row.append(look)
        windows += look.windows
        if windows >= MAX_WINDOWS:
            yield row
            row, windows = [], 0
    if row:
        yield row


def _looks(course: FeedCourse, spans: Sequence[Span], limits: Array) -> Iterator[Look]:
    """Spans cut where their speed is even, and none of more windows than are looked at at once."""
    for span in spans:
        for part, even in _cut(span):
            own = binding.windows(part)
            n = min(own, _places(course, part)) if even else own
            changes = even and not _is_even(course.segments[span.segment])
            many = _even(course, Look(part, n), limits) if changes else iter([Look(part, n)])
            for look in many:
                yield from _slices(look)


def _slices(look: Look) -> Iterator[Look]:
    count = math.ceil(look.windows / MAX_WINDOWS)
    ends = np.linspace(look.span.from_s, look.span.to_s, look.windows + 1)
    for first in range(0, look.windows, MAX_WINDOWS) if count > 1 else ():
        last = min(first + MAX_WINDOWS, look.windows)
        yield Look(_part(look.span, ends[first], ends[last]), last - first)
    if count <= 1:
        yield look


def _part(span: Span, from_s: float, to_s: float) -> Span:
    stands_s = span.stands_s if to_s >= span.to_s else 0.0
    return span._replace(from_s=float(from_s), to_s=float(to_s), stands_s=stands_s)


def _cut(span: Span) -> Iterator[tuple[Span, bool]]:
    """A span's parts with whether their speed is even; those are longer than a window."""
    law, start = span.law, span.from_s
    for t0, t1, row in zip(law.knots_s, law.knots_s[1:], law.coefficients, strict=False):
        low, high = max(t0, span.from_s), min(t1, span.to_s)
        if high - low > SHOWN_S and not any(row[2:]):
            if low > start:
                yield _part(span, start, low), False
            yield _part(span, low, high), True
            start = high
    if span.to_s > start or start == span.from_s:
        yield _part(span, start, span.to_s), False


def _places(course: FeedCourse, span: Span) -> int:
    """Windows in which the path's own bends are seen at an even speed."""
    segment = course.segments[span.segment]
    low, high = along(span.law, np.array([span.from_s, span.to_s]))[0]
    return 1 + int(_moments(segment, float(high - low)) / PER_WINDOW)


def _moments(segment: Segment, length: float) -> float:
    motion = segment.motion
    if isinstance(motion, JointMove) and not isinstance(motion.curve, Even):
        if isinstance(motion.curve, Line):
            return 0.0
        turn = motion.curve.sweep_rad if isinstance(motion.curve, Arc) else 2.0 * math.pi
        return PER_RADIAN * abs(turn) * length / motion.end
    return max(length / mesh.SPACING, mesh.SAMPLES[0] * length / motion.end)


def _is_even(segment: Segment) -> bool:
    """Whether the shares of all limits are the same anywhere on it at an even speed."""
    return segment.is_straight and segment.even_feed is not None


def _even(course: FeedCourse, look: Look, limits: Array) -> Iterator[Look]:
    """A look cut into more and closer windows where the joints' shares change."""
    span, n = look
    if n >= binding.windows(span):
        yield look
        return
    motion = of(course, [look])
    share = binding.used(motion, course.derivatives(motion.s, motion.index)) / limits
    change = np.ptp(share.reshape(n, PER_WINDOW, -1), axis=1).max(axis=1)
    feed = course.feed(motion.s, motion.index).reshape(n, PER_WINDOW)
    rough = (change > CHANGE) | (feed != feed[:, :1]).any(axis=1)
    ends = np.linspace(span.from_s, span.to_s, n + 1)
    cuts = distinct(np.concatenate([[0, n], np.flatnonzero(np.diff(rough)) + 1]))
    for first, last in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
        part = _part(span, ends[first], ends[last])
        closer = Look(part, min(CLOSER * (last - first), binding.windows(part)))
        yield from _even(course, closer, limits) if rough[first] else iter([Look(part, last - first)])
