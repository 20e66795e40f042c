"""A whole path as the planner will send it when nobody interferes, and no dearer than what happens on it.

    planned(items, machine, kinematics)   pauses and parts of windows, in the order of the path
    windows_along(track, ...)             the windows themselves, from anywhere and at any override

Windows are of so many seconds, so a slow feed would need as many as its motion lasts. Where the
feed alone holds the speed one window is like the one before it: such a row of windows is not
planned but rolled on, as far as nothing of the path comes into the sight of its last one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from controller.ipc.handoff import Law
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.plan import known
from controller.plan.feed import cruise, mesh, pace, profile
from controller.plan.feed.binding import Laws, Marks, Span
from controller.plan.feed.course import FeedCourse, Scales
from controller.plan.feed.profile import Profile
from controller.plan.look_ahead import (
    FIRST_S,
    WHOLE_SHARE,
    WINDOW_S,
    Orders,
    Sent,
    TrackPlace,
    Units,
    Windows,
)
from controller.plan.planner import RETRY_S
from controller.plan.segment import PathItem, Pause, Segment
from controller.plan.track import Track, Unit

SIGHT = 2.0 * WHOLE_SHARE  # times a window of motion at the feed: none looks as far ahead
FEWEST = 2  # windows that are rolled on at once
FIRST_ROW, MAX_ROW = 8, 256  # ways from rest to rest planned at once: at first, and twice as many each time
MAX_ROW_S = 12.0  # of motion in those of them that have to be searched for
FULL, START = Orders(), TrackPlace(0, 0.0)


class Planned(NamedTuple):
    """A pause, or the part of a window that is followed, as the planner sends it when nobody interferes."""

    took_s: float  # a whole number of periods
    pause: Pause | None
    course: FeedCourse | None
    spans: list[Span]  # of the course


def planned(items: Iterable[PathItem], machine: Machine, kinematics: Kinematics) -> Iterator[Planned]:
    """The planner's own windows over a whole path, each up to where the next one replaces it.

    Raises ProgramError where the path is refused on the way.
    """
    track = _Track(items, machine, kinematics)
    for sent in windows_along(track, machine, kinematics):
        yield _planned(track, sent)
        track.forget(sent.first)
    if track.error is not None:
        raise track.error


class _Track(Track):
    """A track on which nobody will go up over the part."""

    def _note_top(self, what: Segment | Pause) -> None:
        pass


def windows_along(
    track: Units,
    machine: Machine,
    kinematics: Kinematics,
    orders: Orders = FULL,
    begun: Sent | None = None,
    place: TrackPlace = START,
    start_s: float = 0.0,
    soon: bool = True,
) -> Iterator[Sent]:
    """Windows and pauses along a path as the planner sends them, to its end or as far as it is known.

    ``begun``: the window that is under way and goes on; else it goes on from rest at ``place``, at the plan
    time ``start_s``. ``end_s`` of each is where the next one takes its place.
    """
    windows, rolling = _Windows(machine, kinematics), _Rolling(machine, kinematics, orders)
    while (sent := begun or windows.from_rest(track, place, start_s, orders, soon)) is not None:
        begun, soon = None, False
        while (seam_s := sent.seam_s) is not None:
            if (rolled := rolling.on(sent)) is not None:
                yield replace(sent, end_s=seam_s)
                sent = rolled
                continue
            after = windows.from_motion(track, sent, seam_s, orders)
            if after is None:  # as the planner does: a little later, or not at all
                later_s = seam_s + RETRY_S
                sent = replace(sent, seam_s=later_s if later_s < sent.end_s else None)
                continue
            yield replace(sent, end_s=seam_s)
            sent = after
        yield sent
        place, start_s = sent.after, sent.end_s


@dataclass(frozen=True, slots=True)
class Row(Sent):
    """Ways from rest to rest, each in a window of its own, as one."""

    spans: tuple[Span, ...] = ()


Way = tuple[Segment, ...]


class _Windows(Windows):
    """Windows that nobody will have to stop in, or to look at while they run."""

    def __init__(self, machine: Machine, kinematics: Kinematics) -> None:
        super().__init__(machine, kinematics)
        self._many = FIRST_ROW

    def from_rest(
        self, track: Units, place: TrackPlace, start_s: float, orders: Orders, soon: bool = False
    ) -> Sent | None:
        """As of any; ways that rest are planned many at once."""
        ways = [] if place.s > 0.0 or orders.stop_inside else self._ways(track, place.unit, orders, soon)
        row = self._together(ways, place.unit, start_s, orders) if len(ways) > 1 else None
        self._many = FIRST_ROW if row is None else min(max(2 * len(ways), FIRST_ROW), MAX_ROW)
        return super().from_rest(track, place, start_s, orders, soon) if row is None else row

    def _ways(self, track: Units, first: int, orders: Orders, soon: bool) -> list[Way]:
        """Those that follow each other from a unit on, as far as a window has all of each."""
        found: list[Way] = []
        takes_s = 0.0
        while len(found) < self._many and takes_s < MAX_ROW_S and (unit := track.at(first)) is not None:
            units = [unit]
            if not (unit.rests and unit.segment and profile.is_straight(unit.segment, self._machine)):
                seconds = FIRST_S if soon and not found else WINDOW_S
                reach = self._reach(track, TrackPlace(first, 0.0), orders, seconds, 0)
                units, takes_s = reach.units, takes_s + reach.takes_s
            way = tuple(one.segment for one in units if one.segment)
            if takes_s == math.inf or not way or self._is_special(units, orders):
                break
            found.append(way)
            first += len(way)
        return found

    def _is_special(self, units: list[Unit], orders: Orders) -> bool:
        """Whether more than the path is to be heeded on the way."""
        none = [one.segment for one in units if one.segment and one.segment.scale(*orders.shares) <= 0.0]
        return bool(none) or any(one.begin > 0.0 or one.optional_stop for one in units)

    def _together(self, ways: list[Way], first: int, start_s: float, orders: Orders) -> Row | None:
        """Those before the first that takes more than one window; None: there are none."""
        spans, end_s, k, scales = list[Span](), start_s, 0, orders.scales
        for way, laws in zip(ways, self._laws(ways, scales), strict=True):
            if not laws or (len(way) == 1 and laws[0].duration_s > WHOLE_SHARE * FIRST_S):
                break
            long_s = sum(law.duration_s for law in laws)
            took_s = self._on_grid(long_s)
            spans += [Span(k + i, law, 0.0, law.duration_s) for i, law in enumerate(laws)]
            spans[-1] = spans[-1]._replace(stands_s=took_s - long_s)
            end_s, k = end_s + took_s, k + len(way)
        after = TrackPlace(first + k, 0.0)
        course = FeedCourse.of_ways(ways, self._machine, self._kinematics, scales)
        row = Row(first, start_s, end_s, None, after, orders, (), course, spans=tuple(spans))
        return row if spans else None

    def _laws(self, ways: list[Way], scales: Scales) -> list[list[Law]]:
        """Of each way its segments' laws; none where there is no law from rest."""
        at = self._machine, self._kinematics
        even = [len(way) == 1 and profile.is_straight(way[0], self._machine) for way in ways]
        straight = [way for way, is_even in zip(ways, even, strict=True) if is_even]
        courses = [
            FeedCourse(way, *at, *scales) for way, is_even in zip(ways, even, strict=True) if not is_even
        ]
        closed = iter(profile.straights(FeedCourse.of_ways(straight, *at, scales)) if straight else ())
        sought = zip(courses, known.laws(courses), strict=True)
        others = iter([one for _, one in law.laws(course)] if law else [] for course, law in sought)
        return [[next(closed)] if is_even else next(others) for is_even in even]

    def _stops(self, made: Sent) -> None:
        return None

    def _binds(self, course: FeedCourse, laws: Laws) -> list[Marks]:
        return [()] * len(laws)


def _planned(track: Track, sent: Sent) -> Planned:
    took_s = sent.end_s - sent.start_s
    if isinstance(sent, Row):
        return Planned(took_s, None, sent.course, list(sent.spans))
    if sent.course is None or sent.profile is None:
        unit = track.at(sent.first)
        return Planned(took_s, unit.pause if unit else None, None, [])
    spans, begin_s = [], 0.0
    for k, law in sent.laws:
        if begin_s < took_s and law.duration_s > 0.0:
            spans.append(Span(k, law, 0.0, min(law.duration_s, took_s - begin_s)))
        begin_s += law.duration_s
    moved_s = sum(span.to_s - span.from_s for span in spans)
    if spans and moved_s < took_s:
        spans[-1] = spans[-1]._replace(stands_s=took_s - moved_s)
    return Planned(took_s, None, sent.course, spans)


class _Rolling:
    """Rolls even windows on; of the last segment it knows where more than the feed counts."""

    def __init__(self, machine: Machine, kinematics: Kinematics, orders: Orders) -> None:
        self._machine, self._kinematics, self._scales = machine, kinematics, orders.scales
        self._stops = orders.stop_inside
        self._segment: Segment | None = None
        self._tight = np.empty(0)  # places of it where anything but its feed holds the speed
        self._sight_s = 0.0  # from anywhere on it

    def on(self, sent: Sent) -> Sent | None:
        """As many windows like ``sent`` as may follow it, as one; None where they must be planned."""
        if self._stops or sent.course is None or sent.profile is None or sent.seam_s is None:
            return None
        step_s = sent.seam_s - sent.start_s
        speed = _even_speed(sent.profile, step_s)
        s = sent.profile.at(step_s).s
        first, k = sent.course.index(np.array([sent.profile.start_s, s]))
        segment = sent.course.segments[k]
        if first != k or speed is None or segment.feed_mm_s is None:
            return None
        base = float(sent.course.starts[k])
        ahead_s = (self._until(segment, s - base, speed) - (s - base)) / speed
        count = math.floor((ahead_s - self._sight_s) / step_s)
        if count < FEWEST:
            return None
        long_s = count * step_s
        even = Profile(np.array([0.0, long_s + WINDOW_S]), np.array([[s, speed, 0.0, 0.0, 0.0, 0.0]]))
        end_s = sent.seam_s + long_s
        rolled = replace(sent, start_s=sent.seam_s, end_s=end_s, seam_s=end_s, pieces=())
        return replace(rolled, profile=even, laws=even.laws(sent.course))

    def _until(self, segment: Segment, s: float, speed: float) -> float:
        """The first place of a segment behind ``s`` at which anything but a feed of ``speed`` counts."""
        if segment is not self._segment:
            course = FeedCourse([segment], self._machine, self._kinematics, *self._scales)
            found = mesh.survey(mesh.Parts.of(course, s, course.length))
            tight = (found.allowed < cruise.MARGIN_RATIO * found.feed) | (found.feed != speed)
            self._segment, self._tight = segment, np.append(found.s[tight], course.length)
            self._sight_s = SIGHT * pace.window_s(WINDOW_S, pace.takes_s(course, s)[1])
        return float(self._tight[np.searchsorted(self._tight, s)])


def _even_speed(profile: Profile, until_s: float) -> float | None:
    """The one speed of a profile up to a time; None where it has others."""
    rows = profile.pieces[: int(np.searchsorted(profile.times, until_s))]
    even = len(rows) > 0 and not rows[:, 2:].any() and (rows[:, 1] == rows[0, 1]).all()
    return float(rows[0, 1]) if even else None
