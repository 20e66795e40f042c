"""What binds where: which limit holds the speed down at each moment of a planned motion.

A law is looked at in the middles of equal parts of its pieces, where exact derivatives
tell the share of every joint's every limit. The code of a moment (``state.Binding``) is

    feed       the speed is the programmed feed times override
    corner     a junction between two segments is passed as fast as its jump allows
    the tip    its acceleration, or how fast the tool axis turns, where the machine file bounds them
    an axis    of all axes and kinds the one that is used most, from ``BOUND`` of it on
    nothing    otherwise: a ramp on which no limit is used up, or a standstill

For people a code must last: the time of a piece is cut into windows of ``SHOWN_S`` or a
little less, and each shows what bound for most of it, or the corner in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array
from controller.ipc.handoff import Law
from controller.plan.feed import tool_limits
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import along_each
from controller.plan.surfaces.rates import Derivatives
from controller.state.modes import Binding, axis_binding

Codes = npt.NDArray[np.int64]
Index = npt.NDArray[np.intp]
Laws = Sequence[tuple[int, Law]]  # (index of the segment in the course, its law)
Marks = tuple[tuple[float, int], ...]  # (time within a piece, code from then on)

BOUND = 0.97  # of what the planner may use of a limit: from here on it binds
AT_FEED = 0.995
IN_ROWS = 0.9  # of what the corners of short exact lines allow: their law comes no nearer to each of them
SHOWN_S = 0.025
PER_WINDOW = 4  # samples for the display
NUMBER_OF_CODES = axis_binding(4, 2) + 1


class Span(NamedTuple):
    """A part of one segment's law, from one time of the law to another."""

    segment: int  # index in the course
    law: Law
    from_s: float
    to_s: float
    stands_s: float = 0.0  # behind it


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion along a course at N moments; places and their derivatives in the course's coordinate."""

    windows: tuple[int, ...]  # of each span
    per_window: int
    index: Index  # (N,) of the segments
    dt: Array  # (N,) the time that a moment stands for
    s: Array
    v: Array
    a: Array
    j: Array


def spans(laws: Laws) -> list[Span]:
    """Each law as a whole."""
    return [Span(k, law, 0.0, law.duration_s) for k, law in laws]


def windows(span: Span) -> int:
    """How many windows a span is cut into: of ``SHOWN_S`` or a little less."""
    length = span.to_s - span.from_s
    return max(1, math.ceil(length / SHOWN_S - 1e-9)) if length > 0.0 else 0


def middles(span: Span, count: int) -> Array:
    """The middles of ``count`` equal parts of a span, in the time of its law."""
    dt = (span.to_s - span.from_s) / max(1, count)
    return np.asarray(span.from_s + (np.arange(count) + 0.5) * dt)


def moments(
    course: FeedCourse, row: Sequence[Span], per_window: int = PER_WINDOW, counts: Sequence[int] | None = None
) -> Motion:
    """``per_window`` moments in each window of each span; ``counts`` windows instead of their own number."""
    counts = [windows(span) for span in row] if counts is None else counts
    many = per_window * np.array(counts)
    index = np.repeat([span.segment for span in row], many)
    dt = np.repeat([span.to_s - span.from_s for span in row] / np.maximum(many, 1), many)
    times = [middles(span, n) for span, n in zip(row, many.tolist(), strict=True)]
    s, v, a, j = along_each([span.law for span in row], times)
    return Motion(tuple(counts), per_window, index, dt, s + course.zeros[index], v, a, j)


def used(motion: Motion, d: Derivatives) -> Array:
    """Velocity, acceleration and jerk of every joint, absolute, (N, axes, 3)."""
    v, a, j = motion.v, motion.a, motion.j
    return np.abs(np.stack([d.velocity(v), d.acceleration(v, a), d.jerk(v, a, j)], axis=2))


def codes(course: FeedCourse, motion: Motion, use: Array) -> Codes:
    """What binds at each moment, (N,); ``use`` is what ``used`` gives."""
    s, index = motion.s, motion.index
    may = np.stack([course.limit(s, which, index) for which in ("velocity", "acceleration", "jerk")], axis=2)
    share = (use / may).reshape(len(s), -1)
    most = share.argmax(axis=1)
    bound = share[np.arange(len(s)), most] >= BOUND
    found: Codes = np.where(bound, Binding.AXIS + most, Binding.NOTHING)
    found = _by_tool(course, motion, found)
    found[_corners(course, motion)] = Binding.CORNER
    found[motion.v >= AT_FEED * course.feed(s, index)] = Binding.FEED
    return found


def _by_tool(course: FeedCourse, motion: Motion, found: Codes) -> Codes:
    """The codes with the limits on the tip's acceleration and the axis' turning, where there are such."""
    machine, index = course.machine, motion.index
    rates = tool_limits.rates_in(course, motion.s, index)
    if rates is None:
        return found
    rapid = np.isinf(course.feed(motion.s, index))
    if machine.tip_acceleration_mm_s2 is not None:
        asked = rates.tip_acceleration(motion.v, motion.a)
        found = np.where(
            (asked >= BOUND * machine.tip_acceleration_mm_s2) & ~rapid, Binding.TIP_ACCELERATION, found
        )
    if machine.axis_speed_rad_s is not None:
        asked = rates.turn * motion.v
        found = np.where(
            (asked >= BOUND * machine.axis_speed_rad_s) & ~rapid, Binding.AXIS_ANGULAR_SPEED, found
        )
    return found


def _corners(course: FeedCourse, motion: Motion) -> npt.NDArray[np.intp]:
    """The moments before and behind each junction that is passed as fast as it allows, or among many such."""
    if course.ticked is not None:
        return np.flatnonzero(motion.v >= IN_ROWS * course.ticked.allowed_at(motion.s))
    s, places = motion.s, course.starts[1:-1]
    after = np.searchsorted(s, places)
    inside = (after > 0) & (after < len(s))
    if not inside.any():
        return np.empty(0, dtype=np.intp)
    speeds = np.interp(places, s, motion.v)
    tight = inside & (speeds >= BOUND * np.array(course.junctions))
    return np.concatenate([after[tight] - 1, after[tight]])


def shown(motion: Motion, found: Codes) -> Codes:
    """What bound for most of each window, (sum of windows,); nothing only where nothing else comes near."""
    rows = found.reshape(-1, motion.per_window)
    counts = np.zeros((len(rows), NUMBER_OF_CODES))
    np.add.at(counts, (np.arange(len(rows))[:, None], rows), 1.0)
    counts[:, Binding.NOTHING] -= 0.5  # in a tie something is said
    counts[:, Binding.CORNER] *= motion.per_window  # a moment, but the reason of slow ones around
    return np.asarray(counts.argmax(axis=1))


def marks(course: FeedCourse, laws: Laws) -> list[Marks]:
    """For each (segment, law) of a planned course what binds when, for ``Piece.binds``.

    Times rise from 0.0 within the piece, neighbours differ, and each lasts a window at
    least (a shorter piece is one window).
    """
    motion = moments(course, spans(laws))
    use = used(motion, course.derivatives(motion.s, motion.index))
    window_codes = shown(motion, codes(course, motion, use))
    found, first = [], 0
    for (_, law), n in zip(laws, motion.windows, strict=True):
        of_piece = window_codes[first : first + n]
        times = np.arange(n) * (law.duration_s / max(n, 1))
        changes = np.flatnonzero(np.diff(of_piece, prepend=-1))
        found.append(tuple((float(times[k]), int(of_piece[k])) for k in changes))
        first += n
    return found
