"""What windows go by: how long a way takes about and how long braking does, and where the next one joins."""

from __future__ import annotations

import math

import numpy as np

from controller.geometry.arrays import Array
from controller.motion.motions import ToolSpline
from controller.plan import junctions
from controller.plan.feed.course import FeedCourse, Index
from controller.plan.feed.limits import JointLimits
from controller.plan.feed.profile import Profile
from controller.plan.rotaries import tool_paths
from controller.plan.surfaces.rates import Derivatives

PLACES = 17  # at which a segment is looked at ...
NEAR_LINES = 8  # lines before and behind a place of an exact row, whose corners count there
SHORT_PLACES = 4  # ... and each of a row of short ones
BRAKINGS, LONGEST_S = 3.0, 24.0  # of a window: no less than so many times what braking takes, up to this
TAIL_S = 1.5  # at a window's end, where it would brake: replaced by the next window ...
TAIL_BRAKINGS = 1.25  # ... no less than so many times what braking takes there ...
TAIL_SHARE = 0.6  # ... but never more of it than this
TAIL_PLACES = 60


def window_s(usual_s: float, braking_s: float) -> float:
    """Seconds of a window in which braking takes so long somewhere."""
    return max(usual_s, min(BRAKINGS * braking_s, LONGEST_S))


def takes_s(course: FeedCourse, from_s: float) -> tuple[float, float]:
    """Seconds from ``from_s`` to the end at the feed, or at what the velocity limits leave of it.

    And the longest that braking takes from what the other limits leave of that. One segment.
    """
    places = np.linspace(from_s, course.length, PLACES)
    places = 0.5 * (places[1:] + places[:-1])
    speed, braking_s = _taken(course, places, np.zeros(len(places), dtype=np.intp))
    return float(np.sum((course.length - from_s) / len(places) / speed)), float(braking_s.max())


def row_takes_s(course: FeedCourse, from_s: float) -> tuple[float, float]:
    """The same of an exact row: about as fast as the worst of the corners near a place lets it run."""
    motion, limits = course.segments[0].motion, course.limits[0]
    assert isinstance(motion, ToolSpline)
    knots, cubics = np.frombuffer(motion.knots), np.frombuffer(motion.spans).reshape(-1, 5, 4)
    size = np.diff(knots)
    begin, end = (
        Derivatives(
            *tool_paths.derivatives_of_spans(cubics, h[:, None], True, motion.length_mm, course.kinematics)
        )
        for h in (np.zeros(len(size)), size)
    )
    jump, curve = (np.abs(q[1:] - p[:-1]) for p, q in ((end.first, begin.first), (end.second, begin.second)))
    passed = junctions.passed(jump, curve, limits.acceleration, limits.jerk, course.machine.period_s)
    near = np.pad(passed, NEAR_LINES + 1, constant_values=np.inf)
    slowest = np.lib.stride_tricks.sliding_window_view(near, 2 * NEAR_LINES + 2).min(axis=1)[: len(size)]
    with np.errstate(divide="ignore"):
        most = (limits.velocity / np.abs(begin.first)).min(axis=1)
    speed = np.minimum(np.minimum(course.feed(knots[:-1] + 0.5 * size), most), slowest)
    braking_s = limits.braking_s(speed[:, None] * begin.first).max()
    left = np.clip(knots[1:] - from_s, 0.0, size)
    return float((left / speed).sum()), float(braking_s)


def each_takes_s(course: FeedCourse) -> list[tuple[float, float]]:
    """The same of each segment of a row of short ones, which runs no faster than its corners let it.

    So short lines are often run far below the feed: there is no way to gain speed between two corners.
    """
    lengths = np.diff(course.starts)
    shares = (np.arange(SHORT_PLACES) + 0.5) / SHORT_PLACES
    index = np.repeat(np.arange(len(lengths)), SHORT_PLACES)
    places = (course.starts[:-1, None] + lengths[:, None] * shares).ravel()
    speed, braking_s = (row.reshape(-1, SHORT_PLACES) for row in _taken(course, places, index))
    passed = _passed(course)
    between = np.maximum(passed[1:], passed[:-1])
    seconds = np.maximum((lengths[:, None] / SHORT_PLACES / speed).sum(axis=1), lengths / between)
    return list(zip(seconds.tolist(), braking_s.max(axis=1).tolist(), strict=True))


def _taken(course: FeedCourse, places: Array, index: Index) -> tuple[Array, Array]:
    """Speed, and seconds in which it is braked, at places of the segments ``index``."""
    d = course.derivatives(places, index)
    limits = JointLimits(
        *(course.limit(places, which, index) for which in ("velocity", "acceleration", "jerk"))
    )
    rates = np.abs(d.first)
    with np.errstate(divide="ignore"):
        most = (limits.velocity / rates).min(axis=1)
    speed = np.minimum(course.feed(places, index), most)
    reached = np.minimum(speed, limits.path_speed(d))[:, None] * rates
    return speed, limits.braking_s(reached).max(axis=1)


def _passed(course: FeedCourse) -> Array:
    """About the speed at each boundary of a row from rest, (n + 1,), as corners and jerk let it grow."""
    found = [0.0]
    for k, length in enumerate(np.diff(course.starts).tolist()):
        limits, v = course.limits[k], found[-1]
        rate = np.abs(course.at_ends(k).first).max(axis=0) + 1e-30
        acceleration, jerk = float((limits.acceleration / rate).min()), float((limits.jerk / rate).min())
        a = min(acceleration, math.sqrt(2.0 * jerk * v))
        v = max(math.sqrt(v * v + 2.0 * a * length), math.cbrt(4.5 * jerk * length * length))
        found.append(min(v, course.junction(k)) if k + 1 < len(course.segments) else v)
    return np.array(found)


def seam_s(course: FeedCourse, found: Profile) -> float:
    """Time of a profile at which the next window is to replace it: before it brakes to its rest."""
    first = (1.0 - TAIL_SHARE) * found.duration_s
    last = max(found.duration_s - TAIL_S, first)
    times = np.linspace(first, last, TAIL_PLACES)
    s, v, _, _ = found.along(times)
    rates = course.derivatives(s).first * v[:, None]
    braking_s = JointLimits.of(course.machine).braking_s(rates).max(axis=1)
    late = np.flatnonzero(found.duration_s - times < TAIL_BRAKINGS * braking_s)
    return float(times[max(late[0] - 1, 0)]) if len(late) else last
