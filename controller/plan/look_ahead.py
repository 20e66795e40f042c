"""Windows: the next part of a path, planned to a standstill, with pieces and stops for the tick.

Out of rest, or out of the motion of the window before. How far a window reaches depends on the
path alone: ``WINDOW_S`` of motion at the feed, or at what the velocity limits leave of it, or
the whole course where that is little more. A heavy machine that needs long to brake has longer windows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from controller.geometry.vectors import ROUNDING
from controller.ipc.handoff import STILL, Awaited, Law, Piece, StopTable, dwell
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.motion.motions import ToolLine
from controller.motion.pieces import Sensing
from controller.plan import known
from controller.plan.feed import binding, pace
from controller.plan.feed.course import MAX_SINGLE, REMEMBERED, FeedCourse
from controller.plan.feed.profile import Profile, State
from controller.plan.feed.ticked import is_row
from controller.plan.segment import ContinuousPath, Pause, Segment
from controller.plan.track import Unit
from controller.plan.waits import SETTING
from controller.program.program import UNSAID, Act, Await, Level, Outputs, Probing

FIRST_S = 2.5  # of motion in a window that must be ready soon ...
WINDOW_S = 8.0  # ... and in others
WHOLE_SHARE = 1.6  # of a window: a course no longer than this is planned in one
STOPS_BEYOND_S = 0.5  # the seam: should the next window be late
STOP_STEP_S = 0.004  # between two stops; two ticks at most
BLOCKS_TO_STOP_IN = 4  # program blocks within which single block must have stopped a motion
LONG_STOP_S = 0.3  # where no stop is known
BRAKING_SHARE = 2.0  # of the length to brake in, for a window from motion
SHORTENED = (1.0, 0.5, 0.25, 0.1)  # shares of a window that are tried where it cannot be planned


class Orders(NamedTuple):
    """What the operator's switches say of the feed."""

    override: float = 1.0
    rapid_override: float = 1.0
    single_block: bool = False
    optional_stop: bool = False
    adaptive: float = 1.0  # what the load of the spindle leaves of feeds under M52 P1 ...
    everywhere: float = 1.0  # ... and without

    @property
    def stop_inside(self) -> bool:
        """Motion may have to rest where the path runs on."""
        return self.single_block or self.optional_stop

    @property
    def shares(self) -> tuple[float, float, float, float]:
        """As ``Segment.scale`` takes them."""
        return self.override, self.rapid_override, self.adaptive, self.everywhere

    @property
    def scales(self) -> tuple[float, float, float, float]:
        """The same; what an override of 0 is for is not planned at all."""
        return self.override or 1.0, self.rapid_override or 1.0, self.adaptive, self.everywhere


class TrackPlace(NamedTuple):
    """Unit of the track, and s in its motion."""

    unit: int
    s: float


@dataclass(frozen=True, slots=True)
class Sent:
    """A window, or a pause, at its place in plan time."""

    first: int  # number of the unit at which its course begins, or of the pause
    start_s: float  # plan time
    end_s: float  # plan time up to which it holds: its rest, or where the next window replaces it
    seam_s: float | None  # plan time from which on the next window is to replace it; None: it ends for good
    after: TrackPlace  # where the path goes on after its rest
    orders: Orders
    pieces: tuple[Piece, ...]
    course: FeedCourse | None = None  # None: a pause
    profile: Profile | None = None
    laws: binding.Laws = ()  # of the profile, segment by segment
    stops: StopTable | None = None
    segments: dict[int, Segment] = field(default_factory=dict)  # of its motions, by id
    is_split: bool = False  # a block of the program ends inside
    has_optional_stop: bool = False  # one with an M1 does
    is_short: bool = False  # it ends with a block of the program where the course would go on

    def is_other(self, orders: Orders) -> bool:
        """Whether other orders would have made it another one."""
        if self.course is None or orders == self.orders:
            return False
        mine = self.orders
        switched = (orders.single_block, orders.optional_stop) != (mine.single_block, mine.optional_stop)
        return (
            (orders.override != self.orders.override and _has_feed(self.course))
            or (orders.rapid_override != self.orders.rapid_override and _has_rapid(self.course))
            or (orders.single_block > mine.single_block and self.is_split)
            or (orders.optional_stop > mine.optional_stop and self.has_optional_stop)
            or (switched and self.is_short)
            or (orders.adaptive != self.orders.adaptive and _is_led(self.course, True))
            or (orders.everywhere != self.orders.everywhere and _is_led(self.course, False))
        )

    def is_blocked(self, orders: Orders) -> bool:
        """Whether an override of nothing forbids it."""
        return self.course is not None and _stands(self.course.segments, orders)

    def place_at(self, plan_s: float) -> TrackPlace:
        """Where on the path it is at a plan time; a pause stands at its beginning."""
        if self.course is None or self.profile is None:
            ended = not (self.pieces[0].sets or self.pieces[0].stop or self.pieces[0].optional_stop)
            return self.after if ended and self.end_s <= self.start_s else TrackPlace(self.first, 0.0)
        s = self.profile.at(min(max(plan_s - self.start_s, 0.0), self.profile.duration_s)).s
        k = int(self.course.index(np.array([s]))[0])
        return TrackPlace(self.first + k, s - float(self.course.zeros[k]))

    def motion_at(self, plan_s: float) -> int | None:
        """Id of the motion in which it is at a plan time."""
        if self.course is None or self.profile is None:
            return None
        s = self.profile.at(plan_s - self.start_s).s
        return list(self.segments)[int(self.course.index(np.array([s]))[0])]


class NoLaw(RuntimeError):
    """From rest nothing was found that keeps every limit."""

    def __init__(self, sentence: str, line: int) -> None:
        super().__init__(sentence)
        self.line = line


class _Reach(NamedTuple):
    """Units of a window, and where on their course it ends (None: at its end)."""

    units: list[Unit]
    until: float | None
    rests: bool  # for good: it is not to be replaced by the next window
    marked: bool = False  # a block of the program ends there ...
    optional_stop: bool = False  # ... with an M1
    takes_s: float = math.inf  # about, where it is known to end at a rest of the path


class Units(Protocol):
    """What is needed of a ``Track``."""

    def at(self, number: int) -> Unit | None: ...


class Windows:
    """Plans windows of a track."""

    def __init__(self, machine: Machine, kinematics: Kinematics) -> None:
        self._machine, self._kinematics = machine, kinematics
        self._period_s = machine.period_s
        self._takes = lru_cache(REMEMBERED)(self._takes_s)
        self._row: tuple[ContinuousPath, Orders, list[tuple[float, float]]] | None = (
            None  # that was looked at last
        )

    # --- what others ask for

    def from_rest(
        self, track: Units, place: TrackPlace, start_s: float, orders: Orders, soon: bool = False
    ) -> Sent | None:
        """The next window or pause from rest; None at the end, and where an override of 0 forbids it."""
        unit = track.at(place.unit)
        if unit is None:
            return None
        if unit.pause:
            return self._pause(unit, unit.pause, place, start_s, orders)
        place = TrackPlace(place.unit, max(place.s, unit.begin))
        if place.s >= unit.length - ROUNDING:
            if not unit.rests:
                return self.from_rest(track, TrackPlace(place.unit + 1, 0.0), start_s, orders, soon)
            mark = dwell(0.0, unit.line, end=unit.last, optional_stop=unit.optional_stop)
            mark = mark._replace(block_end=unit.block_end)
            after = TrackPlace(place.unit + 1, 0.0)
            return Sent(place.unit, start_s, start_s, None, after, orders, (mark,))
        begin = State(place.s, 0.0, 0.0)
        seconds = FIRST_S if soon else WINDOW_S
        for share in SHORTENED:
            reach = self._reach(track, place, orders, share * seconds, 0)
            if share == SHORTENED[0] and self._forbidden(reach, orders):
                return None
            if (made := self._window(reach, place, begin, None, start_s, orders)) is not None:
                return made
        if (made := self._window(_first_of(reach), place, begin, None, start_s, orders)) is not None:
            return made
        raise NoLaw(f"Line {unit.line}: no way was found to move from rest within the limits.", unit.line)

    def from_motion(
        self, track: Units, sent: Sent, plan_s: float, orders: Orders, soon: bool = False
    ) -> Sent | None:
        """The path from a sent window's state at ``plan_s`` on; None where there is no way on."""
        if sent.course is None or sent.profile is None:
            return None
        t = plan_s - sent.start_s
        state = sent.profile.at(t)
        if t >= sent.profile.duration_s:
            return None
        k = int(sent.course.index(np.array([state.s]))[0])
        offset = float(sent.course.zeros[k])
        place = TrackPlace(sent.first + k, state.s - offset)
        begin = State(place.s, state.v, state.a)
        guess = _tail(sent.profile, t, offset)
        skips = range(BLOCKS_TO_STOP_IN if orders.stop_inside else 1)
        seconds, least = FIRST_S if soon else WINDOW_S, BRAKING_SHARE * _braking(sent, plan_s, state.v)
        reaches = [self._reach(track, place, orders, seconds, n, least) for n in skips]
        if self._forbidden(reaches[0], orders):
            return None
        if len(reaches[-1].units) > 1:
            reaches.append(_first_of(reaches[-1]))
        for reach in reaches:
            made = self._window(reach, place, begin, guess, plan_s, orders)
            if made is not None:
                return made
        return None

    # --- how far

    def _reach(
        self,
        track: Units,
        place: TrackPlace,
        orders: Orders,
        seconds: float,
        skipped: int,
        least: float = 0.0,
    ) -> _Reach:
        """Units from ``place`` on that take about ``seconds``, or the course where it takes little more.

        At a feed that was lowered much, a few seconds may be too short to brake in: ``least`` is the
        length that is needed.
        With single block the course ends with a block of the program, after ``skipped`` others, with
        optional stop with one that an M1 follows.
        """
        units: list[Unit] = []
        takes: list[float] = []
        number, s, start = place.unit, place.s, 0.0
        while (unit := track.at(number)) is not None and unit.segment:
            units.append(unit)
            takes_s, braking_s = self._unit_takes_s(unit, unit.segment, s, orders)
            takes.append(takes_s)
            seconds = pace.window_s(seconds, braking_s)
            ends, at_end = _stops_of(unit, orders)
            inner = [end for end in ends if end > s + ROUNDING]
            if len(inner) > max(skipped, 0):
                end = inner[max(skipped, 0)]
                optional = end in unit.optional_stops
                return _Reach(units, start + end, rests=True, marked=True, optional_stop=optional)
            skipped -= len(inner)
            if sum(takes) > WHOLE_SHARE * seconds and start + unit.length - place.s > least:
                return self._cut(units, takes, place.s, seconds, least)
            if unit.rests or (at_end and skipped <= 0):
                return _whole(units)._replace(takes_s=sum(takes))
            skipped -= at_end
            number, start = number + 1, start + unit.length
            s = ahead.begin if (ahead := track.at(number)) is not None else 0.0
            start -= s
        return _Reach(units, None, rests=True)  # the path was refused further on

    def _cut(self, units: list[Unit], takes: list[float], s: float, seconds: float, least: float) -> _Reach:
        """A window of just ``seconds``, and not below the ``least`` length."""
        ends = np.cumsum([units[0].length, *(unit.length - unit.begin for unit in units[1:])])
        until = np.interp(seconds, np.cumsum([0.0, *takes]), [s, *ends])
        until = max(float(until), s + least)
        last = int(np.searchsorted(ends, until))
        return _Reach(units[: last + 1], until, rests=False)

    def _unit_takes_s(self, unit: Unit, segment: Segment, s: float, orders: Orders) -> tuple[float, float]:
        """As ``_takes_s``; of a line in a row of lines with all the others of its chain."""
        chain = unit.chain
        if (
            chain is None
            or s > 0.0
            or not isinstance(segment.motion, ToolLine)
            or len(chain.segments) <= MAX_SINGLE
        ):
            return self._takes(segment, s, orders)
        if self._row is None or self._row[0] is not chain or self._row[1] != orders:
            course = FeedCourse(chain.segments, self._machine, self._kinematics, *orders.scales)
            self._row = chain, orders, pace.each_takes_s(course)
        return self._row[2][unit.index] if segment.scale(*orders.shares) > 0.0 else (0.0, 0.0)

    def _takes_s(self, segment: Segment, from_s: float, orders: Orders) -> tuple[float, float]:
        """Seconds from ``from_s`` to the end, and the longest that braking takes on the way."""
        if segment.scale(*orders.shares) <= 0.0:
            return 0.0, 0.0  # it is not to move at all
        course = FeedCourse([segment], self._machine, self._kinematics, *orders.scales)
        return pace.row_takes_s(course, from_s) if is_row(course) else pace.takes_s(course, from_s)

    def _forbidden(self, reach: _Reach, orders: Orders) -> bool:
        return _stands([unit.segment for unit in reach.units if unit.segment], orders)

    # --- one window

    def _window(
        self,
        reach: _Reach,
        place: TrackPlace,
        begin: State,
        guess: Profile | None,
        start_s: float,
        orders: Orders,
    ) -> Sent | None:
        units = reach.units
        segments = [unit.segment for unit in units if unit.segment]
        begins = [unit.begin for unit in units]
        course = FeedCourse(segments, self._machine, self._kinematics, *orders.scales, begins)
        found = known.law(course, begin, reach.until, guess)
        if found is None:
            return None
        made = Sent(
            place.unit,
            start_s,
            start_s + self._on_grid(found.duration_s),
            None if reach.rests else start_s + self._on_grid(pace.seam_s(course, found)),
            self._after(reach, place, course),
            orders,
            (),
            course,
            found,
            found.laws(course),
            segments={unit.motion_id: s for unit, s in zip(units, segments, strict=True)},
            is_split=any(unit.block_end for unit in units[:-1]) or any(unit.lines_end for unit in units),
            has_optional_stop=any(unit.optional_stop for unit in units[:-1])
            or any(unit.optional_stops for unit in units),
            is_short=reach.marked and not (units[-1].rests and reach.until is None),
        )
        return replace(made, pieces=self._pieces(made, units, reach), stops=self._stops(made))

    def _on_grid(self, seconds: float) -> float:
        """Rounded up to whole periods."""
        return math.ceil(seconds / self._period_s - 1e-6) * self._period_s

    def _after(self, reach: _Reach, place: TrackPlace, course: FeedCourse) -> TrackPlace:
        last = len(reach.units) - 1
        if reach.until is None:
            return TrackPlace(place.unit + last + 1, 0.0)
        return TrackPlace(place.unit + last, reach.until - float(course.zeros[last]))

    def _pieces(self, made: Sent, units: list[Unit], reach: _Reach) -> tuple[Piece, ...]:
        assert made.course is not None
        pieces: list[Piece] = []
        for (k, law), binds in zip(made.laws, self._binds(made.course, made.laws), strict=True):
            segment, orders = made.course.segments[k], made.orders
            rapid = segment.feed_mm_s is None
            pieces.append(
                Piece(
                    units[k].motion_id,
                    units[k].line,
                    law,
                    law.duration_s,
                    cutting=segment.cutting,
                    rapid=rapid,
                    override=segment.scale(*orders.shares),
                    own_feed=not segment.overrides.feed,
                    heeds_stop=segment.overrides.stop,
                    adaptive=segment.overrides.adaptive,
                    binds=binds,
                    outputs=_plain(segment.outputs),
                    guarded=segment.guarded,
                )
            )
        rest_s = made.end_s - made.start_s - sum(piece.duration_s for piece in pieces)
        last = pieces[-1]
        pieces[-1] = last._replace(law=_rested(last.law, rest_s), duration_s=last.duration_s + rest_s)
        ends = units[-1].last and reach.until is None
        pieces[-1] = pieces[-1]._replace(block_end=reach.marked, optional_stop=reach.optional_stop, end=ends)
        return tuple(pieces)

    def _binds(self, course: FeedCourse, laws: binding.Laws) -> list[binding.Marks]:
        return binding.marks(course, laws)

    def _stops(self, made: Sent) -> StopTable | None:
        """Stops for the part that is meant to be followed, and a little more."""
        assert made.profile is not None and made.course is not None
        last_s = made.profile.duration_s
        if made.seam_s is not None:
            last_s = min(last_s, made.seam_s - made.start_s + STOPS_BEYOND_S)
        step_s = (1 if self._period_s > 0.75 * STOP_STEP_S else 2) * self._period_s
        return known.stops(made.course, made.profile, 0.0, last_s, step_s).shifted(made.start_s)

    # --- pauses

    def _awaited(self, asked: Await) -> Awaited | None:
        """The input by its bit of the node, and the ticks that it may take."""
        io = self._machine.io
        bit = None if io is None else io.input(io.awaited[asked.number])
        if bit is None:
            return None
        on, edge = asked.level in (Level.RISE, Level.HIGH), asked.level in (Level.RISE, Level.FALL)
        return Awaited(1 << bit, on, edge, round(asked.seconds / self._period_s))

    def _sensing(self, pause: Pause, probe: Probing) -> Sensing | None:
        """What the tick is to listen to."""
        sensor = self._machine.sensor(pause.modal.tool)
        if sensor is None:
            return None
        late = math.ceil(sensor.latency_s / self._period_s)
        mask, latched = self._machine.sensor_mask(sensor), sensor.latch_tpdo > 0 and not probe.away
        return Sensing(mask, not probe.away, pause.ends, latched, sensor.latency_s, late)

    def _pause(self, unit: Unit, pause: Pause, place: TrackPlace, start_s: float, orders: Orders) -> Sent:
        sets = pause.turns or (self._machine.has_peripherals and pause.act in SETTING)
        piece = Piece(
            unit.motion_id,
            unit.line,
            STILL,
            self._on_grid(pause.seconds),
            stop=pause.act is Act.STOP,
            optional_stop=pause.act is Act.OPTIONAL_STOP or unit.optional_stop,
            block_end=unit.block_end,
            end=unit.last,
            sets=sets,
            spindle_rev_min=pause.modal.spindle_rev_min,
            max_rev_min=self._machine.max_rev_min(pause.modal.tool),
            coolant=pause.modal.coolant,
            outputs=_plain(_switched(pause) if sets else UNSAID),
            open_clamps=pause.open_clamps,
            lifts=pause.lifts,
            awaits=self._awaited(pause.awaits) if pause.awaits is not None else None,
            senses=self._sensing(pause, pause.probe) if pause.probe is not None else None,
        )
        end_s, after = start_s + piece.duration_s, TrackPlace(place.unit + 1, 0.0)
        return Sent(place.unit, start_s, end_s, None, after, orders, (piece,))


def _switched(pause: Pause) -> Outputs:
    """What is switched where it begins."""
    if pause.awaits is not None:
        return pause.awaits.outputs
    return pause.modal.outputs if pause.act is Act.OUTPUT else UNSAID


def _plain(outputs: Outputs) -> tuple[int, int, tuple[tuple[int, float], ...]]:
    """As a piece has them: the tick does not load the class of a program."""
    return outputs.on, outputs.off, outputs.levels


def _first_of(reach: _Reach) -> _Reach:
    """Only the first unit, to a rest at its end: where no way is found to run on into the next."""
    if len(reach.units) == 1:
        return reach
    return _whole(reach.units[:1])


def _whole(units: list[Unit]) -> _Reach:
    """To a rest at the end of the last."""
    last = units[-1]
    return _Reach(units, None, rests=True, marked=last.block_end, optional_stop=last.optional_stop)


def _stops_of(unit: Unit, orders: Orders) -> tuple[Sequence[float], bool]:
    """Places inside of a unit at which the operator's switches stop it, and whether they do at its end."""
    if orders.single_block:
        return unit.lines_end, unit.block_end
    return (unit.optional_stops, unit.optional_stop) if orders.optional_stop else ((), False)


def _has_feed(course: FeedCourse) -> bool:
    """Whether the override of feeds counts somewhere in it."""
    return any(one.feed_mm_s is not None and one.overrides.feed for one in course.segments)


def _is_led(course: FeedCourse, asked: bool) -> bool:
    """Whether adaptive feed counts somewhere in it: where the program has ``asked`` for it, or where not."""
    feeds = (one.overrides for one in course.segments if one.feed_mm_s is not None)
    return any(has.feed and has.adaptive is asked for has in feeds)


def _has_rapid(course: FeedCourse) -> bool:
    return any(segment.feed_mm_s is None for segment in course.segments)


def _stands(segments: Sequence[Segment], orders: Orders) -> bool:
    """Whether one of them is at an override of nothing."""
    return any(one.scale(*orders.shares) <= 0.0 for one in segments)


def _braking(sent: Sent, plan_s: float, v: float) -> float:
    """More than the length in which the sent motion can stop, by its own stops."""
    table = sent.stops
    if table is None or len(table) == 0:
        return v * LONG_STOP_S
    i = min(max(round((plan_s - table.start_s) / table.step_s), 0), len(table) - 1)
    steps = table.first[i + 1] - table.first[i]
    return v * (steps * table.jerk_step_s if steps else LONG_STOP_S)


def _tail(found: Profile, t: float, offset: float) -> Profile:
    """A profile from its time ``t`` on, with ``offset`` taken off its places."""
    i = int(np.clip(np.searchsorted(found.times, t, side="right") - 1, 0, len(found.pieces) - 1))
    times, pieces = found.times[i:] - t, found.pieces[i:].copy()
    x = -float(times[0])
    times[0] = 0.0
    c0, c1, c2, c3 = (float(c) for c in pieces[0, :4])
    pieces[0, :4] = (
        c0 + x * (c1 + x * (c2 + x * c3)),
        c1 + x * (2.0 * c2 + x * 3.0 * c3),
        c2 + 3.0 * x * c3,
        c3,
    )
    pieces[:, 0] -= offset
    return Profile(times, pieces)


def _rested(law: Law, seconds: float) -> Law:
    """A law that stands at its end for some time more."""
    if seconds <= 0.0:
        return law
    end = law.at(law.duration_s)[0]
    return Law((*law.knots_s, law.duration_s + seconds), (*law.coefficients, (end, 0.0, 0.0, 0.0, 0.0, 0.0)))
