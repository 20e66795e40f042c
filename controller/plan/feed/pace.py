"""What windows go by: how long a way takes about and how long braking does, and where the next one joins."""

from __future__ import annotations

import numpy as np

from controller.plan.feed.course import Course
from controller.plan.feed.limits import JointLimits
from controller.plan.feed.profile import Profile

PLACES = 17  # at which a stretch is looked at
BRAKINGS, LONGEST_S = 3.0, 24.0  # of a window: no less than so many times what braking takes, up to this
TAIL_S = 1.5  # at a window's end, where it would brake: replaced by the next window ...
TAIL_BRAKINGS = 1.25  # ... no less than so many times what braking takes there ...
TAIL_SHARE = 0.6  # ... but never more of it than this
TAIL_PLACES = 60


def window_s(usual_s: float, braking_s: float) -> float:
    """Seconds of a window in which braking takes so long somewhere."""
    return max(usual_s, min(BRAKINGS * braking_s, LONGEST_S))


def takes_s(course: Course, from_s: float) -> tuple[float, float]:
    """Seconds from ``from_s`` to the end at the feed, or at what the velocity limits leave of it.

    And the longest that braking takes from what the other limits leave of that. One stretch.
    """
    places = np.linspace(from_s, course.length, PLACES)
    places = 0.5 * (places[1:] + places[:-1])
    d, limits = course.derivatives(places), course.limits[0]
    rates = np.abs(d.first)
    with np.errstate(divide="ignore"):
        most = (limits.velocity / rates).min(axis=1)
    speed = np.minimum(course.feed(places), most)
    reached = np.minimum(speed, limits.path_speed(d))[:, None] * rates
    seconds = float(np.sum((course.length - from_s) / len(places) / speed))
    return seconds, float(limits.braking_s(reached).max())


def seam_s(course: Course, found: Profile) -> float:
    """Time of a profile at which the next window is to replace it: before it brakes to its rest."""
    first = (1.0 - TAIL_SHARE) * found.duration_s
    last = max(found.duration_s - TAIL_S, first)
    times = np.linspace(first, last, TAIL_PLACES)
    s, v, _, _ = found.along(times)
    rates = course.derivatives(s).first * v[:, None]
    braking_s = JointLimits.of(course.machine).braking_s(rates).max(axis=1)
    late = np.flatnonzero(found.duration_s - times < TAIL_BRAKINGS * braking_s)
    return float(times[max(late[0] - 1, 0)]) if len(late) else last
