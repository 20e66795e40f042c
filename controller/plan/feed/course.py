"""Segments that run through, seen as one path with one coordinate.

A motion law knows only a place on the course, its speed and so on; what the joints
make of it, and what they allow, is asked here. Places are in the unit of the
segments' own s, counted on from the course's beginning.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array, Flags, distinct
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.memory import remembered
from controller.motion.motions import ThreadMove, ToolLine, ToolSpline
from controller.plan import junctions
from controller.plan.feed.limits import JointLimits
from controller.plan.junctions import MARGIN
from controller.plan.segment import Segment
from controller.plan.surfaces.rates import Derivatives, derivatives, kind, together

Index = npt.NDArray[np.intp]
Scales = tuple[float, float, float, float]  # override, rapid override, adaptive, everywhere

REMEMBERED = 256  # segments: more than a window has
THREAD_SHARE = 0.6  # of the axes' limits, along a thread; what is left follows the spindle
THREAD_RAMP_S = 0.06  # in which the spindle's acceleration may change by all of it
MAX_SINGLE = 2  # segments, of which each is looked at alone
APART = 1e-3  # unit of s: of marks closer than that only the boundaries of segments count


class Allowed(Protocol):
    """What is remembered of exact rows: the speeds that are allowed along them."""

    def allowed_at(self, s: Array) -> Array:
        """Of the places ``s`` (N,), in the unit of s per second."""
        ...


@dataclass(frozen=True, slots=True)
class Jump:
    """What jumps where one segment goes over into the next, per unit of s: q' and q'', (axes,) each."""

    rate: Array
    curve: Array


class FeedCourse:
    """A row of segments between two rests; the overrides scale feeds and rapids (1.0 = 100 %).

    ``adaptive`` and ``everywhere``: as of ``Segment.scale``. ``begins``: s at which each segment is come to,
    where a lead enters one in its middle. ``starts`` (n + 1,) are the places where one goes over into the
    next, ``zeros`` (n,) those at which each has s = 0: the same but for such a segment. ``rests``: numbers of
    the segments after which the motion rests though the course goes on.
    """

    def __init__(
        self,
        segments: Sequence[Segment],
        machine: Machine,
        kinematics: Kinematics,
        override: float = 1.0,
        rapid_override: float = 1.0,
        adaptive: float = 1.0,
        everywhere: float = 1.0,
        begins: Sequence[float] = (),
        rests: Sequence[int] = (),
    ) -> None:
        self.segments, self.rests = tuple(segments), frozenset(rests)
        self.machine, self.kinematics = machine, kinematics
        self.rapid_override = rapid_override
        self._scales = override, rapid_override, adaptive, everywhere
        self.begins = [0.0, *begins[1:]] if begins else [0.0] * len(self.segments)
        lengths = [one.motion.end - begin for one, begin in zip(self.segments, self.begins, strict=True)]
        self.starts: Array = np.concatenate([[0.0], np.cumsum(lengths)])
        self.zeros: Array = self.starts[:-1] - self.begins
        self.made_of = self.segments, machine, type(kinematics), self._scales, tuple(self.begins)
        self._junctions: dict[int, float] = {}
        self._jumps: dict[int, Jump] = {}
        self._kinds: dict[int, object] = {}
        self._ends: dict[int, Derivatives] = {}
        self.ticked: Allowed | None = None  # where all of it is exact rows

    @staticmethod
    def of_ways(
        ways: Sequence[Sequence[Segment]], machine: Machine, kinematics: Kinematics, scales: Scales
    ) -> FeedCourse:
        """One course of several ways that are each from rest to rest; ``scales``: of feeds, in order."""
        ends = itertools.accumulate(map(len, ways), initial=-1)
        return FeedCourse([*itertools.chain(*ways)], machine, kinematics, *scales, rests=[*ends][1:-1])

    def as_one(self, others: Sequence[FeedCourse]) -> FeedCourse:
        """The same of this course and ``others`` of the same scales."""
        ways = [one.segments for one in (self, *others)]
        return FeedCourse.of_ways(ways, self.machine, self.kinematics, self._scales)

    @property
    def length(self) -> float:
        return float(self.starts[-1])

    def index(self, s: Array) -> Index:
        """Index of the segment in which each place lies (N,); a boundary belongs to the segment behind it."""
        if len(self.segments) == 1:
            return np.zeros(len(s), dtype=np.intp)
        found = np.searchsorted(self.starts, s, side="right") - 1
        return np.clip(found, 0, len(self.segments) - 1)

    def derivatives(self, s: Array, index: Index | None = None) -> Derivatives:
        """q', q'', q''' of the joints at the places ``s`` (N,).

        ``index`` names the segments (N,): at a boundary both sides can be asked for.
        """
        index = self.index(s) if index is None else index
        groups = self._alike(index)
        if len(groups) == 1 == len(groups[0]):
            segment, start = self.segments[groups[0][0]], self.zeros[groups[0][0]]
            return derivatives(segment, np.clip(s - start, 0.0, segment.motion.end), self.kinematics)
        found = [np.empty((len(s), len(self.machine.axes))) for _ in range(3)]
        for members in groups:
            here: Flags | slice = np.isin(index, members) if len(groups) > 1 else slice(None)
            of = np.searchsorted(members, index[here])
            segments = [self.segments[k] for k in members]
            ends = np.array([segment.motion.end for segment in segments])[of]
            local = np.clip(s[here] - self.zeros[index[here]], 0.0, ends)
            if len(segments) == 1:
                d = derivatives(segments[0], local, self.kinematics)
            else:
                d = together(segments, local, of, self.kinematics)
            found[0][here], found[1][here], found[2][here] = d.first, d.second, d.third
        return Derivatives(*found)

    def _alike(self, index: Index) -> list[list[int]]:
        """The segments that are asked for, those together whose derivatives can be taken together."""
        groups: dict[object, list[int]] = {}
        for k in distinct(index).tolist():
            what = self._kind(k)
            groups.setdefault(k if what is None else (what,), []).append(k)
        return list(groups.values())

    def feed(self, s: Array, index: Index | None = None) -> Array:
        """Programmed feed times override at each place (N,), in the unit of s per second; inf on rapids."""
        index = self.index(s) if index is None else index
        found = self._even_feeds[index]
        for k in distinct(index[np.isnan(found)]):
            here, segment = index == k, self.segments[k]
            local = np.clip(s[here] - self.zeros[k], 0.0, segment.motion.end)
            found[here] = segment.feed_at(local) * segment.scale(*self._scales)
        return found

    def tip_rate(self, s: Array, index: Index) -> Array:
        """As ``Segment.tip_rate`` at the places ``s`` (N,) of the segments ``index``."""
        found = np.ones(len(s))
        for k, segment in enumerate(self.segments):
            if isinstance(segment.motion, ToolLine | ToolSpline) and (here := index == k).any():
                found[here] = segment.tip_rate(np.clip(s[here] - self.zeros[k], 0.0, segment.motion.end))
        return found

    @cached_property
    def _even_feeds(self) -> Array:
        """Of each segment the feed that ``feed`` tells anywhere on it; nan where it is not one."""
        feeds = [(segment.even_feed, segment.scale(*self._scales)) for segment in self.segments]
        return np.array([math.nan if feed is None else feed * scale for feed, scale in feeds])

    @cached_property
    def marks(self) -> Array:
        """Places where the course changes its manners.

        Boundaries of segments, steps of the feed, and the joints of splines, where the
        third derivative jumps.
        """
        found = [self.starts]
        for zero, begin, segment in zip(self.zeros, self.begins, self.segments, strict=True):
            steps = itertools.pairwise(segment.feed_steps)
            at = np.array([at for (_, before), (at, after) in steps if before != after])
            if isinstance(segment.motion, ToolSpline):
                at = np.concatenate([at, np.frombuffer(segment.motion.knots)[1:-1]])
            found.append(zero + at[at > begin] if begin else zero + at)
        marks = distinct(np.concatenate(found))
        apart = np.minimum(np.diff(marks, prepend=-1.0), np.diff(marks, append=np.inf)) > APART
        return np.asarray(marks[apart | np.isin(marks, self.starts)])

    @cached_property
    def limits(self) -> tuple[JointLimits, ...]:
        """What each segment may use of the joints' limits, the margin taken off."""
        cut = JointLimits.of(self.machine, MARGIN)
        rapid = JointLimits.of(self.machine, MARGIN * self.machine.rapid_share)
        rapid = replace(rapid, velocity=rapid.velocity * self.rapid_override)
        return tuple(
            _along_thread(cut, s.motion, self)
            if isinstance(s.motion, ThreadMove)
            else rapid
            if s.feed_mm_s is None
            else cut
            for s in self.segments
        )

    @property
    def stop_limits(self) -> JointLimits:
        """What a stop may use: all that the joints have, on a thread (a course of its own) its share."""
        limits, first = JointLimits.of(self.machine), self.segments[0].motion
        return _along_thread(limits, first, self) if isinstance(first, ThreadMove) else limits

    def limit(self, s: Array, which: str, index: Index | None = None) -> Array:
        """One of ``velocity``, ``acceleration``, ``jerk`` of the joints at each place, (N, axes)."""
        index = self.index(s) if index is None else index
        return np.array([getattr(limit, which) for limit in self.limits])[index]

    def least_limit(self, s: Array, which: str, index: Index) -> Array:
        """The least of it between neighbours of the places ``s`` (n + 1,), (n, axes)."""
        return self.limit(0.5 * (s[1:] + s[:-1]), which, index)

    # --- boundaries

    @property
    def junctions(self) -> tuple[float, ...]:
        """Speed at which each inner boundary may be passed: what jumps fits into one tick; inf at rests."""
        inner = range(len(self.segments) - 1)
        return tuple(math.inf if k in self.rests else self.junction(k) for k in inner)

    def junction(self, k: int) -> float:
        """Speed at which the boundary between segment ``k`` and the next may be passed."""
        if k not in self._junctions:
            jump, limits = self.jump(k), self.limits[k]
            period_s = self.machine.period_s
            found = junctions.passed(jump.rate, jump.curve, limits.acceleration, limits.jerk, period_s)
            self._junctions[k] = float(found)
        return self._junctions[k]

    def at_ends(self, k: int) -> Derivatives:
        """At the beginning and the end of segment ``k``; of a row, in which there are many, all at once."""
        if k not in self._ends:
            in_row = isinstance(self.segments[k].motion, ToolLine | ToolSpline)
            if in_row and len(self.segments) > MAX_SINGLE and self._kind(k) is not None:
                self._ends |= self._row_ends(k)
            else:
                self._ends[k] = _at_ends(self.segments[k], self.begins[k], self.kinematics)
        return self._ends[k]

    def _row_ends(self, k: int) -> dict[int, Derivatives]:
        """Of all segments of the same kind as ``k``."""
        alike = [n for n in range(len(self.segments)) if self._kind(n) == self._kind(k)]
        row = [self.segments[n] for n in alike]
        ends = np.array([[self.begins[n], self.segments[n].motion.end] for n in alike]).ravel()
        d = together(row, ends, np.repeat(np.arange(len(row)), 2), self.kinematics)
        return {
            n: Derivatives(*(order[2 * i : 2 * i + 2] for order in (d.first, d.second, d.third)))
            for i, n in enumerate(alike)
        }

    def _kind(self, k: int) -> object:
        if k not in self._kinds:
            self._kinds[k] = kind(self.segments[k], self.kinematics)
        return self._kinds[k]

    def jump(self, k: int) -> Jump:
        """What jumps between segment ``k`` and the next."""
        if k not in self._jumps:
            left, right = self.at_ends(k), self.at_ends(k + 1)
            self._jumps[k] = Jump(
                np.abs(right.first[0] - left.first[1]), np.abs(right.second[0] - left.second[1])
            )
        return self._jumps[k]


def _along_thread(limits: JointLimits, move: ThreadMove, course: FeedCourse) -> JointLimits:
    """What a thread leaves of the joints' limits: the spindle's own, and a share to follow it by."""
    kinematics, axes = course.kinematics, len(course.machine.axes)
    along = np.abs(np.array(kinematics.arrange((*move.direction, 0.0, 0.0)), dtype=float))
    most = np.where(along > 0.0, along * move.spindle_mm_s2, np.inf)
    share = THREAD_SHARE * np.ones(axes)
    return JointLimits(
        limits.velocity * share,
        np.minimum(limits.acceleration * share, most),
        np.minimum(limits.jerk * share, most / THREAD_RAMP_S),
    )


@remembered(REMEMBERED)
def _at_ends(segment: Segment, begin: float, kinematics: Kinematics) -> Derivatives:
    """Where it is come to and at its end: whoever looks at a boundary asks for them again."""
    return derivatives(segment, np.array([begin, segment.motion.end]), kinematics)


def least_passed(course: FeedCourse, k: int) -> float:
    """What the boundary behind segment ``k`` is passed at, or it is a stop."""
    return min(
        float(junctions.least(np.abs(course.at_ends(side).first[end]), limit.jerk, course.machine.period_s))
        for side, end, limit in ((k, 1, course.limits[k]), (k + 1, 0, course.limits[k + 1]))
    )


def unhindered(course: FeedCourse, k: int) -> float:
    """About the speed that the boundary behind segment ``k`` would be passed at if nothing jumped there.

    The lower feed of both sides, what the limits allow at that place, and what a start from rest
    reaches within each of the two: a slow machine never comes near a high feed.
    """
    at, sides = np.full(2, course.starts[k + 1]), np.array([k, k + 1])
    lengths = np.diff(course.starts)[k : k + 2]
    found = float(course.feed(at, sides).min())
    for i, side in enumerate(sides):
        limit, d, end = course.limits[side], course.at_ends(side), 1 - i
        here = Derivatives(*(q[end : end + 1] for q in (d.first, d.second, d.third)))
        rates = np.abs(here.first[0])
        reached = float(junctions.reached(rates, lengths[i], limit.acceleration, limit.jerk))
        found = min(found, reached, float(limit.path_speed(here)[0]))
    return found
