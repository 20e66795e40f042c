"""What is left of a path that is being run, planned ahead of the planner at the overrides of the moment.

The planner sends some seconds of the path; from there on the same windows are planned here, one with each
``look``, and nothing of them but their times is kept (``Timetable``). What is planned does not depend on a
clock, so the path clock will be at the end of the path at just the time that is told, if nobody interferes.
Whoever changes an override makes it void: it is begun anew behind what the planner has sent since.

The path is read ahead of the planner for it, no further than ``MAX_AHEAD`` units.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.plan.look_ahead import NoLaw, Orders, Sent, TrackPlace
from controller.plan.planner import Ahead, orders_of
from controller.plan.report.passing import OWN, place_of
from controller.plan.report.planned import FULL, windows_along
from controller.plan.restart.program_position import ENTRY_ID, lines_along, part_at
from controller.plan.segment import PathItem, Wait
from controller.plan.timetable import MAX_EVENTS, Event, Passed, Timetable, event_of
from controller.plan.track import Track, Unit
from controller.plan.waits import OPTIONAL

FIRST = 60  # windows that are planned of a path that nobody runs yet, or at another override than before
MAX_AHEAD = 3000  # units beyond those of the planner: they are kept until it comes to them
SAME_S = 1e-6


def twice(items: Iterable[PathItem]) -> tuple[Iterator[PathItem], Iterator[PathItem]]:
    """A path that two walk along at their own pace; what refuses it stops both at the same place."""
    one, other = itertools.tee(_caught(items))
    return _raised(one), _raised(other)


class _Broken(NamedTuple):
    """In place of the item that could not be made."""

    error: Exception


def _caught(items: Iterable[PathItem]) -> Iterator[PathItem | _Broken]:
    """What breaks it must reach the planner, whoever has read it first: or the path would just end there."""
    try:
        yield from items
    except Exception as error:
        yield _Broken(error)


def _raised(items: Iterable[PathItem | _Broken]) -> Iterator[PathItem]:
    for item in items:
        if isinstance(item, _Broken):
            raise item.error
        yield item


def foreseen(
    items: Iterable[PathItem], machine: Machine, kinematics: Kinematics, orders: Orders = FULL
) -> Timetable | None:
    """Of a path that nobody runs yet, up to ``FIRST`` windows of it; None where it is refused.

    ``orders``: the operator's; an override of nothing is taken for 100 %.
    """
    orders = orders._replace(
        override=orders.override or 1.0, rapid_override=orders.rapid_override or 1.0, single_block=False
    )
    track = Track((), machine, kinematics)
    foresight = Foresight(track, items, machine, kinematics)
    ahead = Ahead(track, (), TrackPlace(0, 0.0), 0.0)
    while foresight.windows < FIRST and foresight.go_on(ahead, 0.0, orders):
        pass
    return None if foresight.refused else foresight.timetable or Timetable(0.0, 0.0)


class Foresight:
    """Of one path; ``look`` whenever the planner has nothing to do."""

    def __init__(
        self, track: Track, items: Iterable[PathItem], machine: Machine, kinematics: Kinematics
    ) -> None:
        """``track``: the planner's; ``items``: the same path once more (``twice``)."""
        self._machine, self._kinematics = machine, kinematics
        self._track, self._own = track, Track(items, machine, kinematics, probes=True)
        self._walk: Iterator[Sent] | None = None
        self._orders = Orders()
        self._known: set[tuple[int, int]] = set()  # units and ticks at which windows begin
        self._rolled: list[tuple[float, float]] = []  # from and to where they are not told from each other
        self._events: list[Event] = []
        self._from_s = self._end_s = 0.0
        self._place = TrackPlace(0, 0.0)  # where the path goes on after what is foreseen
        self.windows = 0  # that are foreseen, since it was begun
        self._entered = False  # it has come to the program's own motions
        self._over = False  # as far as the path can be foreseen now

    # -- what is foreseen

    @property
    def over(self) -> bool:
        """Nothing is foreseen that is not told yet, until the planner goes on."""
        return self._over

    @property
    def timetable(self) -> Timetable | None:
        """None where it is at no place that the check knows: before the program, or between two parts of
        one line, as in a tool change.
        """
        if self._walk is None or self._is_between():
            return None
        at = self._orders.override, self._orders.rapid_override
        return Timetable(self._from_s, self._end_s, tuple(self._events), self._passed(), at)

    @property
    def refused(self) -> bool:
        """The path ends where the program is refused, as far as it is known."""
        return self._own.error is not None

    @property
    def begun(self) -> object:
        """Another one after it has begun anew."""
        return self._walk

    def look(self, ahead: Ahead, now: Snapshot) -> bool:
        """Foresee a little more; True where something has come of it."""
        if ahead.track is not self._track:
            return False  # beside the path
        return self.go_on(ahead, now.plan_time_s, orders_of(now))

    def go_on(self, ahead: Ahead, now_s: float, orders: Orders) -> bool:
        """As ``look``, at a plan time."""
        if self._walk is None or orders != self._orders or not self._goes_on(ahead):
            self._walk = None
            if any(sent.is_other(orders) for sent in ahead.sent if sent.end_s > now_s + SAME_S):
                return False  # the planner will do it first
            self._begin(ahead, now_s, orders)
        self._own.forget(ahead.track.read_to - ahead.track.laid)
        if self._over or self._walk is None or self._place.unit > ahead.next.unit + MAX_AHEAD:
            return False
        try:
            for sent in self._walk:
                self._take(sent)
                if sent.course is not None:
                    self.windows += 1
                    return True
        except NoLaw:
            pass  # the planner will come to it, unless somebody changes an override before
        self._over = True
        return True

    # -- walking

    def _begin(self, ahead: Ahead, now_s: float, orders: Orders) -> None:
        self._orders, self._over, self.windows = orders, False, 0
        self._known = {self._key(sent.first, sent.start_s) for sent in ahead.sent}
        self._events, self._rolled = [], []
        for sent in ahead.sent:
            self._note(sent)
        self._from_s, self._end_s, self._place = now_s, ahead.queue_end_s, ahead.next
        begun = ahead.sent[-1] if ahead.sent and ahead.sent[-1].seam_s is not None else None
        self._walk = windows_along(
            self,
            self._machine,
            self._kinematics,
            orders,
            begun,
            ahead.next,
            ahead.queue_end_s,
            not ahead.sent,
        )

    def _is_between(self) -> bool:
        number, s = self._place
        unit = self.at(number)
        if unit is None or s > 0.0:
            return False
        if not self._entered and not 0 <= unit.motion_id < ENTRY_ID:
            return True
        before = self.at(number - 1) if self.windows else None
        joined = before is not None and unit.chain is not None and before.chain is unit.chain
        return before is not None and before.order == unit.order and not joined

    def _key(self, unit: int, start_s: float) -> tuple[int, int]:
        return unit, round(start_s / self._machine.period_s)

    def _goes_on(self, ahead: Ahead) -> bool:
        """Whether what the planner has sent since is what was foreseen."""
        return all(
            self._key(sent.first, sent.start_s) in self._known
            or any(low - SAME_S <= sent.start_s <= high + SAME_S for low, high in self._rolled)
            for sent in ahead.sent
        )

    def _take(self, sent: Sent) -> None:
        unit = self.at(sent.first)
        self._entered = self._entered or (unit is not None and 0 <= unit.motion_id < ENTRY_ID)
        key = self._key(sent.first, sent.start_s)
        if key not in self._known:
            self._note(sent)
            self._known.add(key)
        if sent.course is not None and not sent.pieces:
            self._rolled.append((sent.start_s, sent.end_s))
        goes_on = sent.seam_s is not None
        self._end_s, self._place = sent.end_s, sent.place_at(sent.end_s) if goes_on else sent.after

    def _note(self, sent: Sent) -> None:
        """The pause, if it is one, or the M1 with which it ends."""
        unit = self.at(sent.first) if sent.course is None else None
        if len(self._events) >= MAX_EVENTS:
            return
        if unit is not None and unit.pause:
            event = event_of(unit.pause, sent.start_s)
            self._events += [event] if event is not None else []
        elif sent.course is not None and sent.pieces and sent.pieces[-1].optional_stop:
            self._events.append(Event(sent.end_s, sent.pieces[-1].line, Wait(stops=OPTIONAL)))

    def at(self, number: int) -> Unit | None:
        """A unit: of the planner's track, which may have ways laid before it, where that has it."""
        if number < self._track.read_to:
            return self._track.at(number)
        own = self._own
        if own.waits is not None and own.waits.came is not None:
            own.waits = None
        return own.at(number - self._track.laid)

    def _passed(self) -> Passed | None:
        """The place to which is foreseen; None: it is the end of the path."""
        number, s = self._place
        unit = self.at(number)
        if unit is None:
            last = self.at(number - 1) if self._own.waits is not None else None
            return None if last is None else (last.order, 1.0, OWN, 0.0)
        if unit.segment is None or unit.chain is None:
            return unit.order, 0.0, 0, 0.0
        part, fraction = part_at(lines_along(unit.chain)[unit.index], s)
        return place_of(unit.segment.name, part.order, fraction, s)
