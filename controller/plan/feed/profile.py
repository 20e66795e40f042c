"""Motion laws on a course: how far along at which time, as fast as every limit allows.

    profile = plan(course)                      from rest at its beginning to rest at its end
    plan(course, State(s, v, a), until)         from a state of motion (or rest) to rest at ``until``
    plan_each(courses)                          of many from rest to rest
    split_at_stops(segments, ...)              where a row of segments must stop anyway

A straight move with constant limits has the classic closed form, and so has one that bends by next to
nothing, and a course on which the feed alone counts (``cruise``); everything else is searched for
(``search``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.curves import Line
from controller.ipc.handoff import Law
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.motion.motions import JointMove
from controller.plan.feed import cruise, row_law, search, ticked
from controller.plan.feed.course import FeedCourse, Index, least_passed, unhindered
from controller.plan.feed.law import split, straight
from controller.plan.feed.tool_limits import goes_straight, has_limits
from controller.plan.junctions import MARGIN, STOP_SHARE
from controller.plan.segment import Segment
from controller.plan.surfaces.rates import Derivatives

Run = tuple[Segment, ...]

WAITS_S = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
WAY_S = 2e-3
NOTHING = 1e-9  # of s: no way to go
SAME = 1e-8  # of s: two places that are one
SAME_SPEED = 1e-6  # unit of s per second
PLACES = 9  # at which a way that bends is looked at ...
BEND_SHARE = (
    0.01  # ... and the share of acceleration and jerk that its bends may take, to be taken for straight
)


class State(NamedTuple):
    """Place on a course, speed along it and acceleration along it (unit of s, seconds)."""

    s: float
    v: float
    a: float


REST = State(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """A motion along a course: s(t) = c0 + c1 x + c2 x^2 + c3 x^3 with x = t - times[i] on piece i.

    ``times`` (n + 1,) rise from 0.0; ``pieces`` (n, 6) rows c0 .. c5 in the course's
    coordinate and seconds, c4 = c5 = 0. The last piece ends at rest.
    """

    times: Array
    pieces: Array

    @property
    def duration_s(self) -> float:
        return float(self.times[-1])

    @property
    def start_s(self) -> float:
        """Place on the course where it begins."""
        return float(self.pieces[0, 0])

    @property
    def end_s(self) -> float:
        """Place on the course where it comes to rest."""
        return self.at(self.duration_s).s

    @property
    def joins(self) -> bool:
        """Whether every piece begins where, and as fast as, the one before it ends."""
        x, c = np.diff(self.times)[:-1], self.pieces[:-1].T
        s = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
        v = c[1] + x * (2.0 * c[2] + x * 3.0 * c[3])
        after = self.pieces[1:, 0], self.pieces[1:, 1]
        gaps = [np.abs(a - b).max(initial=0.0) for a, b in zip((s, v), after, strict=True)]
        return bool(gaps[0] <= SAME * max(1.0, abs(self.start_s)) and gaps[1] <= SAME_SPEED)

    def at(self, t: float) -> State:
        """The state at a time, clamped to the profile's own."""
        s, v, a, _ = self.along(np.array([t]))
        return State(float(s[0]), float(v[0]), float(a[0]))

    def along(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """s, v, a and jerk at many times (N,), clamped to the profile's own."""
        times = np.clip(times, 0.0, self.times[-1])
        index = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.pieces) - 1)
        x, c = times - self.times[index], self.pieces[index].T
        s = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
        return s, c[1] + x * (2.0 * c[2] + x * 3.0 * c[3]), 2.0 * c[2] + x * 6.0 * c[3], 6.0 * c[3]

    @property
    def way(self) -> tuple[Array, Array]:
        """Places and speeds along it, (N,) each, ``WAY_S`` apart."""
        s, v, _, _ = self.along(np.linspace(0.0, self.duration_s, 2 + int(self.duration_s / WAY_S)))
        return s, v

    def laws(self, course: FeedCourse) -> list[tuple[int, Law]]:
        """(index of the segment, its law in its own s) for each segment that the profile passes, in order."""
        first = int(course.index(self.pieces[:1, 0])[0])
        return list(enumerate(split(self.times, self.pieces, course.starts, course.zeros), first))

    def between_rests(self, course: FeedCourse) -> list[Profile]:
        """Its parts between the rests of a course, each as of a course of its own."""
        starts = course.starts[[0, *(k + 1 for k in sorted(course.rests))]]
        rows = [*np.searchsorted(self.pieces[:, 0], starts).tolist(), len(self.pieces)]
        found = []
        for start, i, k in zip(starts.tolist(), rows, rows[1:], strict=False):
            pieces = self.pieces[i:k].copy()
            pieces[:, 0] -= start
            found.append(Profile(self.times[i : k + 1] - self.times[i], pieces))
        return found

    def until(self, t: float) -> Profile:
        """Its part before the time ``t``, not at rest in the end."""
        n = int(np.searchsorted(self.times, t, side="left"))
        return Profile(np.append(self.times[:n], t), self.pieces[:n])

    def followed_by(self, other: Profile) -> Profile:
        """``other``, which begins where this one ends, behind it."""
        times = np.concatenate([self.times, self.duration_s + other.times[1:]])
        return Profile(times, np.concatenate([self.pieces, other.pieces]))

    def time_of(self, s: float) -> float:
        """The first time at which the place ``s`` is reached; clamped to the profile's ends."""
        low, high = 0.0, self.duration_s
        ends = np.append(self.pieces[:, 0], self.end_s)
        i = int(np.searchsorted(ends, s)) - 1
        if i < 0:
            return 0.0
        if i >= len(self.pieces):
            return self.duration_s
        low, high = float(self.times[i]), float(self.times[i + 1])
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.at(middle).s < s else (low, middle)
        return high


def plan(
    course: FeedCourse, begin: State = REST, until: float | None = None, guess: Profile | None = None
) -> Profile | None:
    """The fastest motion from ``begin`` to rest at ``until`` (the course's end).

    A motion that begins faster than the feed brakes as quickly as the limits allow. ``guess`` is the
    motion so far from the same state, at other overrides perhaps: where it touches limits so
    that the state leaves no choice, it goes on for a while first. None where ``begin`` cannot be
    continued within the limits, or there is nowhere to go.
    """
    last = course.length if until is None else until
    if _is_there(begin, last):
        return None
    if ticked.is_row(course):
        return _of_row(course, begin, last)
    if (closed := _closed(course, begin, last)) is not None:
        return closed
    found = _searched(course, begin, last, guess)
    return _after(course, guess, last) if found is None and guess is not None else found


def plan_each(courses: Sequence[FeedCourse]) -> list[Profile | None]:
    """``plan`` of each of them from rest to rest: what has to be searched for is one search."""
    found = [None if ticked.is_row(one) else _closed(one, REST, one.length) for one in courses]
    sought = [k for k, one in enumerate(courses) if found[k] is None and not ticked.is_row(one)]
    if len(sought) > 1:
        first, *others = (courses[k] for k in sought)
        together = _searched(row := first.as_one(others), REST, row.length)
        if together is not None:
            for k, one in zip(sought, together.between_rests(row), strict=True):
                found[k] = one
    return [plan(one) if law is None else law for one, law in zip(courses, found, strict=True)]


def _closed(course: FeedCourse, begin: State, last: float) -> Profile | None:
    """What needs no search."""
    if begin.v == 0.0 and begin.a == 0.0 and (even := _straight(course, begin.s, last)):
        return even
    law = cruise.law(course, *begin, last)
    return None if law is None else Profile(*law)


def _of_row(course: FeedCourse, begin: State, last: float) -> Profile | None:
    law = row_law.law(course, *begin, last)
    found = Profile(*law) if law is not None else None
    return found if found is not None and found.joins else None


def _is_there(state: State, last: float) -> bool:
    """Whether a state is at ``last``, or beyond it, but for rounding: there is nowhere to go."""
    return last - state.s <= NOTHING * max(1.0, last)


def _searched(course: FeedCourse, begin: State, last: float, before: Profile | None = None) -> Profile | None:
    """What the search finds; None where it finds nothing, or what does not join."""
    law = search.Search(course, *begin, last, before.way if before is not None else None).law()
    found = Profile(*law) if law is not None else None
    return found if found is not None and found.joins else None


def _after(course: FeedCourse, before: Profile, last: float) -> Profile | None:
    """Goes on with ``before`` for a while, where it touches limits so that there is no other way."""
    for wait_s in WAITS_S:
        if wait_s >= before.duration_s or _is_there(before.at(wait_s), last):
            break
        found = _searched(course, before.at(wait_s), last, before)
        if found is not None:
            return before.until(wait_s).followed_by(found)
    return before if abs(before.end_s - last) <= NOTHING * max(1.0, last) else None


def _straight(course: FeedCourse, first: float, last: float) -> Profile | None:
    """The closed form, where q' is constant over the whole way or changes by next to nothing on it.

    So it is on a line, and on a pivot about a joint of some hundredths of a degree.
    """
    ends = course.index(np.array([first, last - 1e-12 * last]))
    segment = course.segments[ends[0]]
    if ends[0] != ends[1] or not _is_even(segment, course.machine):
        return None
    places = np.linspace(first, last, 1 if is_straight(segment, course.machine) else PLACES)
    index, limits = np.full(len(places), ends[0]), course.limits[ends[0]]
    d = course.derivatives(places, index)
    velocity, acceleration, jerk = (float(one.min()) for one in _most(course, d, index))
    velocity = min(float(course.feed(places[:1], ends[:1])[0]), velocity)
    if len(places) > 1:
        bend, twist = (np.abs(q).max(axis=0) + 1e-30 for q in (d.second, d.third))
        # From rest to rest over l: v^2 is at most a l, 3 v a at most j l, and v^3 at most j l^2 / 4.
        length = last - first
        bends = float((bend / limits.acceleration).max()) * acceleration * length
        twists = float(((bend + 0.25 * length * twist) / limits.jerk).max()) * jerk * length
        if max(bends, twists) > BEND_SHARE:
            return None
        acceleration, jerk = (1.0 - bends) * acceleration, (1.0 - twists) * jerk
    law = straight(last - first, velocity, acceleration, jerk)
    pieces = np.array(law.coefficients)
    pieces[:, 0] += first
    return Profile(np.array(law.knots_s), pieces)


def straights(course: FeedCourse) -> list[Law]:
    """The closed forms of a row of straight segments, each from rest to rest as if it were alone."""
    index, lengths = np.arange(len(course.segments)), [one.motion.end for one in course.segments]
    velocity, *others = _most(course, course.derivatives(course.zeros, index), index)
    velocity = np.minimum(course.feed(course.zeros, index), velocity)
    rows = zip(lengths, *(row.tolist() for row in (velocity, *others)), strict=True)
    return [straight(*row) for row in rows]


def is_straight(segment: Segment, machine: Machine) -> bool:
    """Whether its closed form is known without a look at its way."""
    motion = segment.motion
    return _is_even(segment, machine) and isinstance(motion, JointMove) and isinstance(motion.curve, Line)


def _is_even(segment: Segment, machine: Machine) -> bool:
    """Whether one feed holds for a motion whose rotaries turn evenly, and of the tool's limits at most one.

    Where the rotaries stand the tip goes as X Y Z do: on a straight way its acceleration is that of s.
    """
    if not isinstance(segment.motion, JointMove) or len(segment.feed_steps) > 1:
        return False
    return segment.feed_mm_s is None or not has_limits(machine) or goes_straight(segment.motion)


def _most(course: FeedCourse, d: Derivatives, index: Index) -> list[Array]:
    """Velocity, acceleration and jerk along the segments ``index`` that the limits allow, (N,) each."""
    rates = np.abs(d.first) + 1e-30
    limits = [
        course.limit(course.zeros[index], which, index) for which in ("velocity", "acceleration", "jerk")
    ]
    velocity, acceleration, jerk = (np.asarray((limit / rates).min(axis=1)) for limit in limits)
    if (most := course.machine.tip_acceleration_mm_s2) is not None:
        fed = np.array([course.segments[k].feed_mm_s is not None for k in index.tolist()])
        acceleration = np.where(fed, np.minimum(acceleration, MARGIN * most), acceleration)
    return [velocity, acceleration, jerk]


def split_at_stops(
    segments: Sequence[Segment],
    machine: Machine,
    kinematics: Kinematics,
    override: float = 1.0,
    rapid_override: float = 1.0,
    begins: Sequence[float] = (),
) -> list[Run]:
    """Cut at junctions so sharp that passing them is no faster than stopping, and where exact rows end.

    ``begins``: as of ``FeedCourse``.
    """
    course = FeedCourse(segments, machine, kinematics, override, rapid_override, begins=begins)
    found: list[list[Segment]] = [[segments[0]]]
    for k, after in enumerate(segments[1:]):
        if segments[k].is_exact_row is not after.is_exact_row or course.junction(k) < max(
            STOP_SHARE * unhindered(course, k), least_passed(course, k)
        ):
            found.append([after])
        else:
            found[-1].append(after)
    return [tuple(run) for run in found]
