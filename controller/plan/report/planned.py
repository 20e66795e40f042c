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

from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.plan.feed import cruise, mesh, pace, profile
from controller.plan.feed.binding import Laws, Marks, Span
from controller.plan.feed.course import FeedCourse, Rests
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
from controller.plan.track import Track

SIGHT = 2.0 * WHOLE_SHARE  # times a window of motion at the feed: none looks as far ahead
FEWEST = 2  # windows that are rolled on at once
FIRST_ROW, MAX_ROW = (
    8,
    256,
)  # straight motions that are planned at once: at first, and twice as many each time
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
    """Straight motions, each from rest to rest in a window of its own, as one."""

    spans: tuple[Span, ...] = ()


class _Windows(Windows):
    """Windows that nobody will have to stop in, or to look at while they run."""

    def __init__(self, machine: Machine, kinematics: Kinematics) -> None:
        super().__init__(machine, kinematics)
        self._many = FIRST_ROW

    def from_rest(
        self, track: Units, place: TrackPlace, start_s: float, orders: Orders, soon: bool = False
    ) -> Sent | None:
        """As of any; straight motions that rest are planned many at once."""
        units = [] if place.s > 0.0 or orders.stop_inside else self._straights(track, place.unit, orders)
        row = self._together(units, place.unit, start_s, orders) if len(units) > 1 else None
        self._many = FIRST_ROW if row is None else min(max(2 * len(row.spans), FIRST_ROW), MAX_ROW)
        return super().from_rest(track, place, start_s, orders, soon) if row is None else row

    def _straights(self, track: Units, first: int, orders: Orders) -> list[Segment]:
        """Those that follow each other from a unit on."""
        found: list[Segment] = []
        while len(found) < self._many and (unit := track.at(first + len(found))) is not None:
            what = unit.segment
            if what is None or not unit.rests or unit.begin > 0.0 or unit.optional_stop:
                break
            if not profile.is_straight(what, self._machine) or what.scale(*orders.shares) <= 0.0:
                break
            found.append(what)
        return found

    def _together(self, segments: list[Segment], first: int, start_s: float, orders: Orders) -> Row | None:
        """Those before the first that takes more than one window; None: there are none."""
        course, spans, end_s = Rests(segments, self._machine, self._kinematics, *orders.scales), [], start_s
        for k, law in enumerate(profile.straights(course)):
            if law.duration_s > WHOLE_SHARE * FIRST_S:
                break
            took_s = self._on_grid(law.duration_s)
            spans.append(Span(k, law, 0.0, law.duration_s, took_s - law.duration_s))
            end_s += took_s
        after = TrackPlace(first + len(spans), 0.0)
        row = Row(first, start_s, end_s, None, after, orders, (), course, spans=tuple(spans))
        return row if spans else None

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
