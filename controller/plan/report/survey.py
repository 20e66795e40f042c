"""A program looked at whole before anything moves: how long, how fast, what binds, every joint's share.

    survey(items)   plans the path item by item as the planner will, tells each block as it
                    is done, and keeps nothing of it but sums: programs may be of any length

A block is a line of the program. Its own motion (cut, line, arc, rapid) is one part, the
ways that the controller adds before and behind a cut (retract, position, leads, pivot) are
the parts ``approach`` and ``departure``. Short lines of a CAM system that became one curve
are reported together, as one block with its range and number of lines.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.plan.feed import binding
from controller.plan.feed.binding import Span
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import along
from controller.plan.report import moments, works
from controller.plan.report.passing import Passing
from controller.plan.report.planned import Planned, planned
from controller.plan.report.tally import Bound, Part, Tally, bounds
from controller.plan.report.tool_use import Hole, Places, ToolUse, ToolUses
from controller.plan.restart.program_position import BESIDE
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import PathItem, Pause, Segment
from controller.plan.surfaces import rates
from controller.plan.waits import laid
from controller.program.carried import InForce
from controller.program.program import Act

# To so much of a limit the laws of the plan keep an axis: that of jerk is met at the knots of a law, nearly
# between them. A larger share is a fault of the plan.
MAX_SHARES = {"velocity": 1.002, "acceleration": 1.002, "jerk": 1.015}


@dataclass(frozen=True, slots=True)
class JointUse:
    """Range of one joint over the path, and the largest shares of its limits (1.0 = the limit).

    They are those of the setpoints where the law's own derivatives are above a limit (``Setpoints``).
    """

    name: str
    lowest: float  # mm or degrees, as shown outside
    highest: float
    travel: tuple[float, float]
    velocity_share: float
    acceleration_share: float
    jerk_share: float

    @property
    def over(self) -> tuple[str, ...]:
        """The limits that it goes beyond: kinds of ``MAX_SHARES``."""
        return tuple(kind for kind, most in MAX_SHARES.items() if getattr(self, f"{kind}_share") > most)

    def to_dict(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in self.__slots__}
        return {**plain, "over": self.over} if self.over else plain


@dataclass(frozen=True, slots=True)
class BlockUse:
    """One block (or row of CAM lines): its own motion, and the ways before and behind it."""

    line: int
    last_line: int
    lines: int  # of the program that are in it
    what: str  # 'cone', 'surface', 'line', 'arc', 'rapid', 'dwell', 'stop', 'spindle', ...
    own: Part
    approach: Part | None
    departure: Part | None

    def to_dict(self) -> dict[str, Any]:
        return {
            "line": self.line,
            "last_line": self.last_line,
            "lines": self.lines,
            "what": self.what,
            **self.own.to_dict(),
            "approach": self.approach.to_dict() if self.approach else None,
            "departure": self.departure.to_dict() if self.departure else None,
        }


@dataclass(frozen=True, slots=True)
class Work:
    """How far and how long a program works in one way: ways of the tip at a programmed feed, and rapids."""

    what: str  # of ``works.WORKS``
    length_mm: float  # turns of rotaries alone have none
    time_s: float

    def to_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


LISTS = ("binds", "cut_binds", "joints", "work", "tools", "holes")  # of a survey


@dataclass(frozen=True, slots=True)
class Survey:
    """What ``check`` tells of a program that can run, but for its blocks."""

    duration_s: float  # a whole number of periods: what ``simulate`` takes
    ticks: int
    cut_time_s: float
    cut_length_mm: float
    cuts_mm: tuple[float, ...]  # length of C1 of each surface
    blocks: int
    binds: tuple[Bound, ...]  # over the whole program, the longest first
    cut_binds: tuple[Bound, ...]  # over the cuts and programmed feeds alone
    joints: tuple[JointUse, ...]
    waits_s: float = 0.0  # for spindle, clamps, changes and inputs, as expected; no part of ``duration_s``
    work: tuple[Work, ...] = ()  # what there is of it, in the order of ``works.WORKS``
    tools: tuple[ToolUse, ...] = ()
    holes: tuple[Hole, ...] = ()  # the first ``tool_use.MAX_HOLES``
    hole_count: int = 0

    def to_dict(self) -> dict[str, Any]:
        plain = {name: getattr(self, name) for name in self.__slots__}
        lists = {name: [one.to_dict() for one in plain[name]] for name in LISTS}
        return {**plain, **lists}


def survey(
    items: Iterable[PathItem],
    machine: Machine,
    kinematics: Kinematics,
    tell: Callable[[BlockUse], None] = lambda _: None,
    progress: Callable[[int], None] = lambda _: None,
    passing: Passing | None = None,
    in_force: InForce | None = None,
) -> Survey:
    """Plan a path at 100 % and measure it; ``tell`` gets each block, ``progress`` the line that is done.

    ``passing`` gets when which place is passed. ``in_force`` has the modal state of the lines that are read,
    for tools and holes; None: that of power-on.
    """
    look = _Look(machine, kinematics, tell, ToolUses(machine, kinematics, in_force or InForce()))
    items = laid(items, machine)
    for sent in planned(items if passing is None else passing.watched(items), machine, kinematics):
        look.window(sent)
        if passing is not None:
            passing.take(sent)
        progress(_line(sent))
    return look.survey()


# ---- collecting -----------------------------------------------------------------


@dataclass(slots=True)
class _Open:
    """The block that is being looked at."""

    line: int
    last_line: int
    lines: int
    machine: Machine
    what: str = ""
    parts: dict[str, Tally] = field(default_factory=dict)

    def tally(self, segment: Segment) -> Tally:
        """Where a segment counts: ways before the block's own motion are its approach."""
        if segment.cutting or segment.name not in BESIDE:
            name, self.what = "own", segment.hole or self.what or works.kind_of(segment)
        else:
            name = "departure" if "own" in self.parts else "approach"
        return self.parts.setdefault(name, Tally(self.machine))

    def use(self) -> BlockUse:
        found = {name: tally.part() for name, tally in self.parts.items()}
        own = found.get("own") or Tally(self.machine).part()
        ways = found.get("approach"), found.get("departure")
        return BlockUse(self.line, self.last_line, self.lines, self.what or "ways", own, *ways)


class _Look:
    """Takes what is planned in the order of the path, and sums it up."""

    def __init__(
        self, machine: Machine, kinematics: Kinematics, tell: Callable[[BlockUse], None], uses: ToolUses
    ) -> None:
        self._machine, self._kinematics, self._tell = machine, kinematics, tell
        self._tool_uses = uses
        self._limits = rates.limits(machine)
        self._open: _Open | None = None
        self._waits_s = 0.0
        self._blocks = self._ticks = 0
        self._marked = True  # no time has passed since the start, or since the last program stop
        self._ended = False  # with a program stop
        self._cut_time_s = 0.0
        self._last_cut: SurfaceCut | None = None
        self._cuts: list[float] = []
        self._work = {what: [0.0, 0.0] for what in works.WORKS}  # mm, s
        self._seconds = np.zeros(binding.NUMBER_OF_CODES)
        self._fed_seconds = np.zeros(binding.NUMBER_OF_CODES)
        self._ratio = np.zeros(self._limits.shape)
        self._ends = np.array([[np.inf], [-np.inf]]) * np.ones(len(self._limits))

    def window(self, sent: Planned) -> None:
        """What is planned next."""
        ticks = round(sent.took_s / self._machine.period_s)
        self._ticks += ticks
        self._marked &= ticks == 0
        self._ended = sent.pause is not None and sent.pause.act is Act.STOP
        if sent.pause is not None:
            self._pause(sent.pause, sent.took_s)
        elif sent.course is not None and sent.spans:
            self._motion(sent.course, sent.spans)

    def _pause(self, pause: Pause, took_s: float) -> None:
        self._waits_s += pause.wait.seconds
        block = self._block(pause.place.line, pause.place.line, 1)
        if pause.act is not Act.CLAMP:
            block.what = block.what or (_word(pause.act) if pause.act else "dwell")
        tally = block.parts.setdefault("own", Tally(self._machine))
        self._rest(tally, took_s)
        if self._ended:
            self._mark(tally)

    def _mark(self, tally: Tally) -> None:
        """A program stop, or the end: the tick that reaches it counts, or else one more."""
        if self._marked:
            self._ticks += 1
            self._rest(tally, self._machine.period_s)
        self._marked = True

    def _motion(self, course: FeedCourse, spans: Sequence[Span]) -> None:
        setpoints = Setpoints(course, spans)
        for row in moments.rows(course, spans, self._limits):
            self._moments(course, row, setpoints)
        for span in spans:
            cut = course.segments[span.segment].cut
            if cut is not None and cut is not self._last_cut:
                self._cuts.append(cut.end)
                self._last_cut = cut

    def _rest(self, tally: Tally, seconds: float) -> None:
        """A standstill; also what a run is padded by to a whole number of periods."""
        if seconds > 0.0:
            tally.rest(seconds)
            self._seconds[0] += seconds

    def survey(self) -> Survey:
        """The sums; closes the last block."""
        if not self._ended:
            self._mark(self._last_tally())
        self._close()
        return Survey(
            self._ticks * self._machine.period_s,
            self._ticks,
            self._cut_time_s,
            float(sum(self._cuts)),
            tuple(self._cuts),
            self._blocks,
            bounds(self._seconds, self._machine),
            bounds(self._fed_seconds, self._machine),
            self._uses(),
            self._waits_s,
            tuple(Work(what, *found) for what, found in self._work.items() if found[1]),
            self._tool_uses.tools,
            *self._tool_uses.holes(),
        )

    # ---- blocks

    def _of(self, segment: Segment) -> Tally:
        lines = segment.lines
        return self._block(lines[0], lines[-1], len(lines)).tally(segment)

    def _block(self, first: int, last: int, lines: int) -> _Open:
        """The open block if these lines are its own, or a new one."""
        if self._open is None or not self._open.line <= first <= last <= self._open.last_line:
            self._close()
            self._open = _Open(first, last, lines, self._machine)
        return self._open

    def _last_tally(self) -> Tally:
        parts = list(self._open.parts.values()) if self._open else []
        return parts[-1] if parts else Tally(self._machine)

    def _close(self) -> None:
        if self._open is not None:
            self._blocks += 1
            self._tell(self._open.use())
            self._open = None

    # ---- moments

    def _moments(self, course: FeedCourse, row: Sequence[moments.Look], setpoints: Setpoints) -> None:
        motion = moments.of(course, row)
        use = binding.used(motion, course.derivatives(motion.s, motion.index))
        found = binding.codes(course, motion, use)
        ratio = self._ratios(row, use / self._limits, setpoints)
        feed = course.feed(motion.s, motion.index)
        self._seconds += np.bincount(found, motion.dt, binding.NUMBER_OF_CODES)
        fed = np.isfinite(feed)
        self._fed_seconds += np.bincount(found[fed], motion.dt[fed], binding.NUMBER_OF_CODES)
        np.maximum(self._ratio, ratio.max(axis=0), out=self._ratio)
        rate = course.tip_rate(motion.s, motion.index)
        sums, places = moments.Sums(row, motion, found, ratio, rate, feed), []
        for k, (span, n) in enumerate(row):
            segment = course.segments[span.segment]
            tally, work, windows = self._of(segment), works.work_of(segment), sums.windows[k]
            tally.moments(sums.seconds[k], sums.fastest[k], sums.feeds[k][1], sums.ratio[k])
            tally.windows(*windows)
            length_mm = 0.0 if works.turns_alone(segment) else sum(windows.ds)
            took_s = sum(windows.dt)
            self._works(work, length_mm, took_s)
            self._tool_uses.take(segment, work, took_s, length_mm, sums.feeds[k])
            here = slice(sums.first[k], sums.first[k] + n * motion.per_window)
            places.append(
                Places(segment, work, self._joints(segment, motion.s[here] - course.zeros[span.segment]))
            )
            self._rest(tally, span.stands_s)
            self._cut_time_s += (span.to_s - span.from_s) * segment.cutting
        self._tool_uses.places(places)
        q = np.concatenate([one.joints for one in places])
        self._ends[0] = np.minimum(self._ends[0], q.min(axis=0))
        self._ends[1] = np.maximum(self._ends[1], q.max(axis=0))

    def _works(self, what: str, length_mm: float, time_s: float) -> None:
        if what != works.OTHER:
            self._work[what][0] += length_mm
            self._work[what][1] += time_s

    def _ratios(self, row: Sequence[moments.Look], ratio: Array, setpoints: Setpoints) -> Array:
        """Shares of limits (N, axes, 3); where a derivative is above its limit, as the drives get them."""
        first = 0
        for span, n in row:
            here = ratio[first : (first := first + n * moments.PER_WINDOW)]
            above = np.flatnonzero((here > 1.0).any(axis=(1, 2)))
            if len(above):
                times = binding.middles(span, len(here))[above]
                asked = np.minimum(here[above], setpoints.shares(span.segment, times, self._limits))
                here[above] = np.where(here[above] > 1.0, asked, here[above])
        return ratio

    def _joints(self, segment: Segment, s: Array) -> Array:
        """Where the axes are at the places ``s``, and at both ends of the motion, (N, axes)."""
        ends = [segment.start, segment.end]
        if segment.is_straight:
            return np.array(ends)  # nowhere beyond them
        s = np.clip(s[:: max(1, len(s) // 400)], 0.0, segment.motion.end)
        return np.concatenate([joints_along(segment, s, self._kinematics), ends])

    def _uses(self) -> tuple[JointUse, ...]:
        if not np.isfinite(self._ends).all():
            return ()
        uses = []
        for i, axis in enumerate(self._machine.axes):
            lowest, highest = sorted(float(q) * axis.shown_per_unit for q in self._ends[:, i])
            low, high = sorted((axis.travel_min * axis.shown_per_unit, axis.travel_max * axis.shown_per_unit))
            uses.append(JointUse(axis.name, lowest, highest, (low, high), *map(float, self._ratio[i])))
        return tuple(uses)


def _line(sent: Planned) -> int:
    """The last line of the program in it."""
    if sent.pause is not None:
        return sent.pause.place.line
    return sent.course.segments[sent.spans[-1].segment].lines[-1] if sent.course and sent.spans else 0


def _word(act: Act) -> str:
    return act.name.lower().replace("_", " ")


# ---- shares of the limits as drives get them -----------------------------------------------


STEPS = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)  # periods about a moment
DIFFERENCES = np.array(  # of the joints at those: a row each of velocity, acceleration and jerk
    [
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, -2.0, 0.0, 1.0, 0.0],
        [-1.0, 0.0, 3.0, 0.0, -3.0, 0.0, 1.0],
    ]
)


class Setpoints:
    """The joints of one window of a plan at any time of it.

    A law keeps its limits at its knots and nearly between them: its own derivatives may exceed a limit of
    jerk by up to 1.2 % for a millisecond or two (``feed.search.FINE``). No drive gets a derivative, so where
    one is above its limit the differences of setpoints a period apart say what the axis is asked for.
    """

    def __init__(self, course: FeedCourse, spans: Sequence[Span]) -> None:
        self._course, self._spans = course, spans
        lasts = itertools.accumulate((one.to_s - one.from_s + one.stands_s for one in spans), initial=0.0)
        self._begins = np.array([*lasts][:-1])
        self._clocks = {one.segment: t - one.from_s for one, t in zip(spans, self._begins, strict=True)}

    def shares(self, segment: int, law_s: Array, limits: Array) -> Array:
        """Shares (N, axes, 3) of ``limits`` (axes, 3) at the times ``law_s`` (N,) of a segment's law."""
        T = self._course.machine.period_s
        t = self._clocks[segment] + law_s[:, None] + T * np.array(STEPS)
        q = self._joints(t.ravel()).reshape(*t.shape, -1)
        found = np.abs(np.einsum("kp,npa->nak", DIFFERENCES, q)) / T ** np.arange(1.0, 4.0)
        return np.asarray(found / limits)

    def _joints(self, t: Array) -> Array:
        """(N, axes). Before the window and after it the law goes on, but not beyond its segment."""
        course, k = self._course, np.clip(np.searchsorted(self._begins, t, side="right") - 1, 0, None)
        q = np.empty((len(t), len(course.machine.axes)))
        for one in np.unique(k).tolist():
            span, here = self._spans[one], k == one
            segment = course.segments[span.segment]
            s = along(span.law, t[here] - self._begins[one] + span.from_s)[0]
            q[here] = joints_along(segment, np.clip(s, 0.0, segment.motion.end), course.kinematics)
        return q
