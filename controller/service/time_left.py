"""How much of a program is left: to its end, to the next tool, to the next stop for the operator.

The plan says when the path clock will be where (``Timetable``), the rows of the tick say how long it has
stood where it stands. Motion and dwells are as long as they are planned at the overrides of the moment; what
is waited for takes as long as it last took on this machine (``Durations``), else as the machine file makes
likely. Where the plan has not come to the end yet, the check's timetable has the rest, at the pace of what is
planned. From a change of an override until the plan has foreseen enough at it, nobody knows.

The path of a run begins once the spindle turns as it is told at the start. Whatever it does before, running
down from another program say, is waited for at first: ``settles_s``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from controller.ipc.handoff import COLUMN, WAITED, Snapshot
from controller.motion.pieces import FIRST_MARK
from controller.plan.report.passing import Mark, passed_s
from controller.plan.segment import Wait
from controller.plan.timetable import Event, Timetable
from controller.plan.waits import BY_HAND, CHANGE, JOURNAL, OPTIONAL, STOP
from controller.service.durations import Durations
from controller.service.runs import Rows
from controller.state.modes import Mode, Request

SAME_S = 1e-5
ENOUGH_S = 2.0  # of a check, from which the pace of what is planned is seen
_RUNNING, _HOLD = int(Mode.RUNNING), int(Mode.HOLD)
_COLUMNS = [COLUMN[name] for name in ("tick", "mode", "motion_id", "plan_time_s", "switches")]


class Left(NamedTuple):
    """Seconds; None: nobody knows, it never ends, or there is none."""

    left_s: float | None = None
    next_tool_s: float | None = None
    next_stop_s: float | None = None


class TimeLeft:
    """Of one program; it hears what the plan and the tick say."""

    def __init__(self) -> None:
        self.durations: Durations | None = None
        self.marks: Sequence[Mark] = ()  # of its check: when a whole run at 100 % passes which place ...
        self._checked: Sequence[Event] = ()  # ... and in which pauses the path clock stands
        self._duration_s: float | None = None  # ... by that clock
        self._here: Timetable | None = None  # of a run from where the machine stands, which begins at 0
        self._table: Timetable | None = None  # of what is left
        self._begins_s = 0.0  # plan time of the start ...
        self._settles_s = 0.0  # ... at which the spindle takes so long
        self._stands = _Standing()
        self.stood_s = 0.0  # since the start, while the path clock stood and nobody held it

    # -- what others say

    def check(
        self,
        duration_s: float | None,
        marks: Sequence[Mark] = (),
        events: Sequence[Event] = (),
        durations: Durations | None = None,
    ) -> None:
        """What the check of the program has found; ``durations``: as the machine was measured."""
        self._duration_s, self.marks, self._checked = duration_s, marks, events
        self.durations = durations

    def begin(self) -> None:
        """A run is about to begin."""
        self._stands, self.stood_s, self._table = _Standing(), 0.0, None

    def stands(self, here: Timetable | None) -> None:
        """From the plan, before a start: of a run from where the machine stands; None: it is as checked."""
        self._here = here

    def starts(self, at_s: float, settles_s: float = 0.0) -> None:
        """At a plan time; until the plan says more, it will take what was known before."""
        self._begins_s, self._settles_s = at_s, settles_s
        if (here := self._here) is not None:
            events = tuple(event._replace(at_s=event.at_s + at_s) for event in here.events)
            self._table = here._replace(from_s=here.from_s + at_s, end_s=here.end_s + at_s, events=events)

    def hear(self, table: Timetable | None) -> None:
        """From the plan: of what is left."""
        if table is not None:
            self._table = table

    def take(self, rows: Rows, period_s: float) -> None:
        """The rows of the newest ticks."""
        for tick, mode, motion_id, tau, switches in rows[:, _COLUMNS].tolist():
            if (left := self._stands.look(tick, mode, motion_id, tau, switches, period_s)) is not None:
                self._learn(*left)
        self.stood_s += self._stands.new_s()

    # -- what is left

    @property
    def duration_s(self) -> float | None:
        """Of the whole program, by the clock of its path: without what it waits for."""
        return self._duration_s

    def before_start(self, before_s: float, override: float = 1.0, settles_s: float = 0.0) -> Left:
        """Of a program that is loaded; ``before_s``: what of the check's time lies before its place."""
        table, pace = self._here, 1.0 / (override or 1.0)
        if table is None and self._duration_s is None:
            return Left()
        table = self._by_check(before_s, before_s, pace) if table is None else table
        return self._of(_settled(table, table.from_s, settles_s), table.from_s, 0.0, False, pace)

    def after_end(self, checked_s: float) -> Left:
        """Of one that ended before its end, at 100 %; ``checked_s``: where, by the clock of the check."""
        if self._duration_s is None:
            return Left()
        return self._of(self._by_check(checked_s, checked_s, 1.0), checked_s, 0.0, False, 1.0)

    def running(
        self, now: Snapshot, checked_s: float, ends_s: float | None = None, aside: bool = False
    ) -> Left:
        """At a snapshot; ``checked_s``: by the clock of the check, at its place; ``ends_s``: plan time of the
        end, where all is sent; ``aside``: it is off the path."""
        here_s, table, at = now.plan_time_s, self._table, (now.override, min(now.rapid_override, 1.0))
        if now.override <= 0.0 or (table is not None and table.at != at):
            return Left()
        pace = 1.0 / now.override
        if aside or table is None or not table.from_s - SAME_S <= here_s <= table.end_s + SAME_S:
            if ends_s is not None:
                table = Timetable(here_s, max(here_s, ends_s))
            elif self._duration_s is None:
                return Left()
            else:
                table = self._by_check(checked_s, here_s, pace)
        elif table.to is not None and (seen_s := passed_s(self.marks, table.to) - checked_s) > ENOUGH_S:
            pace = min(max((table.end_s - here_s) / seen_s, min(1.0, pace)), max(1.0, pace))
        stood_s = self._stands.stood_s if self._stands.at(here_s) else 0.0
        table = _settled(table, self._begins_s, self._settles_s)
        return self._of(table, here_s, stood_s, now.is_on(Request.OPTIONAL_STOP), pace)

    def _by_check(self, checked_s: float, here_s: float, pace: float) -> Timetable:
        """From a time by the clock of the check on, laid at one of the path clock."""
        assert self._duration_s is not None
        rest = [event for event in self._checked if event.at_s >= checked_s - SAME_S]
        events = tuple(event._replace(at_s=here_s + (event.at_s - checked_s) * pace) for event in rest)
        return Timetable(here_s, here_s + max(0.0, self._duration_s - checked_s) * pace, events)

    def _of(self, table: Timetable, now_s: float, stood_s: float, stops: bool, pace: float) -> Left:
        """``stops``: M1 does; ``pace``: of what the check has to say, where the table ends on the way."""
        events, end_s = table.events, table.end_s
        if table.to is not None:
            if self._duration_s is None:
                return Left()
            rest = self._by_check(passed_s(self.marks, table.to), end_s, pace)
            events, end_s = (*events, *rest.events), rest.end_s
        return self._along(events, now_s, end_s, stood_s, stops)

    def _along(
        self, events: Iterable[Event], now_s: float, end_s: float, stood_s: float, stops: bool
    ) -> Left:
        waits_s, tool_s, stop_s = 0.0, None, None
        halts = (STOP, BY_HAND, OPTIONAL) if stops else (STOP, BY_HAND)
        for event in events:
            if event.at_s < now_s - SAME_S:
                continue
            expected_s = self._expected(event)
            if event.at_s <= now_s + SAME_S and stood_s >= expected_s:
                stood_s -= expected_s  # it is over
                continue
            until_s = max(0.0, event.at_s - now_s) + waits_s
            if tool_s is None and event.wait.stops in (CHANGE, BY_HAND):
                tool_s = until_s
            if stop_s is None and event.wait.stops in halts:
                stop_s = until_s
            if event.at_s <= now_s + SAME_S:
                expected_s, stood_s = expected_s - stood_s, 0.0
            waits_s += expected_s
        return Left(max(0.0, end_s - now_s) + waits_s, tool_s, stop_s)

    def _expected(self, event: Event) -> float:
        return event.wait.seconds if self.durations is None else self.durations.of(event)

    # -- what is learned

    def _learn(self, at_s: float, episodes: Sequence[_Episode]) -> None:
        """What the pauses at one time of the path clock have taken, where each is known from the others."""
        if self.durations is None or self._table is None:
            return
        events = [event for event in self._table.events if abs(event.at_s - at_s) <= SAME_S]
        for name, seconds in _taken_by(events, episodes):
            self.durations.learn(name, seconds)


def _settled(table: Timetable, at_s: float, settles_s: float) -> Timetable:
    """The same, where the spindle takes so long at the start: never the same twice, it has no name."""
    return table._replace(events=(Event(at_s, 0, Wait(seconds=settles_s)), *table.events))


# -- how long the path clock stands


class _Episode(NamedTuple):
    what: str  # _WAIT, JOURNAL, STOP
    seconds: float


_WAIT = "wait"


class _Standing:
    """Row by row: how long the path clock has stood where it stands, and why."""

    def __init__(self) -> None:
        self._tau = -1.0
        self._what = ""
        self._episodes: list[_Episode] = []
        self._clear = True  # each row was one of a wait, a journal, a stop, or the way from one to the next
        self.stood_s = 0.0  # in all, but for stops
        self._new_s = 0.0
        self._tick = -1.0

    def at(self, tau: float) -> bool:
        """Whether it is where the path clock stands."""
        return abs(tau - self._tau) <= SAME_S

    def new_s(self) -> float:
        """What it has stood since this was asked."""
        new_s, self._new_s = self._new_s, 0.0
        return new_s

    def look(
        self, tick: float, mode: float, motion_id: float, tau: float, switches: float, period_s: float
    ) -> tuple[float, list[_Episode]] | None:
        """A row; where the clock goes on, from where and what it stood for there."""
        took_s, self._tick = max(1.0, tick - self._tick) * period_s if self._tick >= 0.0 else 0.0, tick
        if not self.at(tau):
            came = (self._tau, self._episodes) if self._clear and self._episodes else None
            self._tau, self._what, self._episodes, self._clear, self.stood_s = tau, "", [], True, 0.0
            return came
        what = _what(mode, motion_id, switches)
        if what is None:
            self._clear = False
            return None
        if what != STOP:
            self.stood_s += took_s
            self._new_s += took_s
        if what and (what != self._what or not self._episodes):
            self._episodes.append(_Episode(what, took_s))
        elif self._episodes:
            last = self._episodes[-1]
            self._episodes[-1] = last._replace(seconds=last.seconds + took_s)
        self._what = what
        return None


def _what(mode: float, motion_id: float, switches: float) -> str | None:
    """What a row in which the path clock stands is one of; "" = of none, None: not of a run."""
    if mode == _RUNNING:
        return _WAIT if int(switches) & WAITED else ""
    if mode == _HOLD:
        return JOURNAL if motion_id <= FIRST_MARK else STOP
    return None


def _taken_by(events: Sequence[Event], episodes: Sequence[_Episode]) -> Iterable[tuple[str, float]]:
    """Of the waits of pauses at one time what each has taken; nothing where that is not clear.

    After each stop, and after a journal that took its time, there is a wait of some ticks more.
    """
    wanted, found = _parts(map(_kind, events)), _parts(one.what for one in episodes)
    if [part[0] for part in wanted] != [part[0] for part in found]:
        return []
    seconds = iter(episodes)
    took: list[float] = []
    for part, asked in zip(found, wanted, strict=True):
        row = [next(seconds).seconds for _ in range(len(part) - (part[0] == ""))]
        surplus = len(part) - len(asked)
        if surplus not in (0, 1):
            return []
        first = part[0] != ""
        if surplus and first:
            row[:2] = [row[0] + row[1]]
        elif surplus:
            del row[0]
        took += row
    named = [event for event in events if _kind(event)]
    return [(one.wait.name, took_s) for one, took_s in zip(named, took, strict=True) if one.wait.name]


def _parts(kinds: Iterable[str]) -> list[list[str]]:
    """Rows of waits, each with the stop or journal before it; the first has none ("")."""
    parts = [[""]]
    for kind in kinds:
        if kind == _WAIT:
            parts[-1].append(kind)
        elif kind:
            parts.append([kind])
    return parts


def _kind(event: Event) -> str:
    """As what it shows in the rows; M1 counts where it stops only, and then it is not clear."""
    wait = event.wait
    if wait.stops in (STOP, BY_HAND):
        return STOP
    return JOURNAL if wait.name == JOURNAL else _WAIT if wait.name else ""
