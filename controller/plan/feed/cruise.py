r"""The law of a course on which the feed alone counts: up to it, along at it, and down to rest.

     ________________
    /                \        v
   /                  \____

Where the joints allow much more than the feed, and the path bends so little at that speed that it takes
next to nothing of any joint's acceleration and jerk, nothing is to be sought: the quickest ramps have a
closed form, and between them nothing is quicker than the feed. So a slow feed costs nothing.
"""

from __future__ import annotations

import math

import numpy as np

from controller.geometry.arrays import Array
from controller.plan.feed import mesh
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.limits import JointLimits
from controller.plan.feed.tool_limits import has_limits

Law = tuple[Array, Array]  # times (n + 1,) and pieces (n, 6)
Phase = tuple[float, float]  # seconds, and jerk along the path

# The joints allow so much more than the feed. Samples of the mesh are so close together that what
# is allowed between two of them is at most by ``mesh.ROUGH`` less, so it is 1.25 times the feed.
MARGIN_RATIO = 1.5
BEND_SHARE = (
    0.01  # of a joint's acceleration and jerk may go into the bends of the path: the ramps have the rest
)
# ... and so much of the jerk into turning a ramp's acceleration: a ramp takes a hundredth longer.
COUPLED = 0.03
RAMP_PLACES = 9  # places at which a ramp is looked at, and the whole course before it is sampled
REACH = 1.1  # times a ramp's first length: it is looked at as far


def law(course: FeedCourse, s: float, v: float, a: float, last: float) -> Law | None:
    """From ``s``, at rest or at the feed, to rest at ``last``; None where more than the feed counts."""
    parts = mesh.Parts.of(course, s, last)
    if len(parts.index) != 1 or a != 0.0 or has_limits(course.machine):
        return None
    feed = float(parts.feed(np.array([s]), np.zeros(1, dtype=np.intp))[0])
    if not math.isfinite(feed) or v not in (0.0, feed):
        return None
    k = int(parts.index[0])
    if _slight(course, k, np.linspace(s, last, RAMP_PLACES), feed) is None:
        return None
    found = mesh.survey(parts)
    taken = _slight(course, k, found.s, feed)
    if taken is None or (found.feed != feed).any() or (found.allowed < MARGIN_RATIO * feed).any():
        return None
    up = _ramp(course, k, s, 1.0, feed, taken) if v == 0.0 else []
    down = _ramp(course, k, last, -1.0, feed, taken)
    return _joined(s, last, feed, up, down) if up is not None and down is not None else None


def _slight(course: FeedCourse, k: int, s: Array, feed: float) -> tuple[float, float] | None:
    """Shares of acceleration and jerk that the bends take at the feed; None where they are not slight."""
    d, limits = course.derivatives(s, np.full(len(s), k)), course.limits[k]
    bend = float((np.abs(d.second) / limits.acceleration).max()) * feed**2
    twist = float((np.abs(d.third) / limits.jerk).max()) * feed**3
    return (bend, twist) if max(bend, twist) <= BEND_SHARE else None


def _ramp(
    course: FeedCourse, k: int, at: float, sign: float, feed: float, taken: tuple[float, float]
) -> list[Phase] | None:
    """Phases of the quickest way from rest at ``at`` to the feed, forwards or (``sign`` -1) backwards."""
    limits, reach = course.limits[k], 0.0
    low, high = course.starts[k], course.starts[k + 1]
    found: list[Phase] = []
    for _ in range(2):
        places = np.clip(at + sign * reach * np.linspace(0.0, 1.0, RAMP_PLACES), low, high)
        d = course.derivatives(places, np.full(RAMP_PLACES, k))
        found, coupled = _phases(limits, np.abs(d.first), np.abs(d.second), feed, taken)
        if coupled > COUPLED:
            return None
        length = 0.5 * feed * sum(t for t, _ in found)
        if length <= reach:
            return found
        reach = REACH * length
    return found if 0.5 * feed * sum(t for t, _ in found) <= reach else None


def _phases(
    limits: JointLimits, first: Array, second: Array, feed: float, taken: tuple[float, float]
) -> tuple[list[Phase], float]:
    """Up to three phases to the feed, and the share of jerk by which its acceleration turns the path."""
    rate = first.max(axis=0) + 1e-30
    acceleration = (1.0 - taken[0]) * float((limits.acceleration / rate).min())
    jerk = (1.0 - taken[1]) * float((limits.jerk / rate).min())
    most = min(acceleration, math.sqrt(feed * jerk))
    coupled = 3.0 * feed * most * float((second.max(axis=0) / limits.jerk).max())
    jerk *= max(1.0 - coupled, 0.5)
    if feed * jerk < acceleration**2:
        t = math.sqrt(feed / jerk)
        return [(t, jerk), (t, -jerk)], coupled
    t = acceleration / jerk
    return [(t, jerk), (feed / acceleration - t, 0.0), (t, -jerk)], coupled


def _joined(s: float, last: float, feed: float, up: list[Phase], down: list[Phase]) -> Law | None:
    """The whole law; None where there is no room for both ramps."""
    rise, fall = (0.5 * feed * sum(t for t, _ in ramp) for ramp in (up, down))
    even_s = (last - s - rise - fall) / feed
    if even_s < 0.0:
        return None
    pieces, durations = _pieces(s, 0.0, up)
    pieces.append((s + rise, feed, 0.0, 0.0, 0.0, 0.0))
    # A ramp downwards is one upwards with its phases' signs turned about.
    more, others = _pieces(last - fall, feed, [(t, -j) for t, j in down])
    times = np.concatenate([[0.0], np.cumsum([*durations, even_s, *others])])
    return times, np.array(pieces + more)


def _pieces(s: float, v: float, phases: list[Phase]) -> tuple[list[tuple[float, ...]], list[float]]:
    """Rows of coefficients of phases that begin at ``s`` with ``v``, and their durations."""
    rows, a = list[tuple[float, ...]](), 0.0
    for t, j in phases:
        rows.append((s, v, a / 2.0, j / 6.0, 0.0, 0.0))
        s, v, a = s + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j
    return rows, [t for t, _ in phases]
