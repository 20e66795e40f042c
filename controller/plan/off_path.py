"""Whether the tool is off the path, and what the planner has to do about it.

```
     path  ======*======        * held here
                 |  retract: along the tool axis, as often as wanted
                 o-----o        jogged
```
The planner plans one way at a time. While the tool is aside, the program's own track waits here
with the place at which it goes on; the ways off and back are tracks of their own that end held.

Where the tool has been meanwhile does not matter to the way back: it is laid from where the tool stands, with
what is in the spindle by then (``restart.entry``), to a place off the part. There the tool waits, and goes in
by a lead that is laid into the program's track once it is resumed (``restart.reentry``).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine, Tool
from controller.messages import Key, message
from controller.plan.look_ahead import TrackPlace
from controller.plan.restart import entry, other_tool, reentry
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.plan.restart.reentry import (
    RETRACT_MM_S,
    Fitted,
    NotPossible,
    Reentry,
    WayOnto,
    along_axis,
    joints_at,
)
from controller.plan.restart.restart import Rest, named
from controller.plan.segment import ContinuousPath, PathItem, Pause, Segment, straight
from controller.plan.track import Track
from controller.program import modal
from controller.program.program import Act, Place
from controller.state.modes import Mode

FIRST_ID = 2 * ENTRY_ID  # of their motions; each way has its own, for the tick knows the last ones yet


def is_held(now: Snapshot) -> bool:
    """Whether the machine is held and stands."""
    return now.mode is Mode.HOLD and now.at_rest and not now.stopping


def see_held(now: Snapshot, what: str) -> None:
    """Raises NotPossible unless the machine is held and stands."""
    if not is_held(now):
        raise NotPossible(message("aside.not_held", what=Key(f"aside.{what}"), mode=now.mode.name))


@dataclass(slots=True)
class Aside:
    """The tool is off the path. ``held``: joints on the path."""

    spot: Spot
    held: Joints
    place: Place
    retracted: bool = False  # at least once: it does not come back to the path by jogging
    off: bool = False  # the retract has come to its end
    returning: bool = False

    @property
    def marks(self) -> tuple[object, ...]:
        """Changes with whatever its owner has noted."""
        return self.off, self.returning, self.retracted


def retract(
    now: Joints, by_mm: float, place: Place, machine: Machine, kinematics: Kinematics
) -> Iterator[PathItem]:
    """The way off along the tool axis, to a stop. Raises NotPossible."""
    room = reentry.room_along_axis(now, machine, kinematics)
    if not 0.0 < by_mm <= room:
        raise NotPossible(message("aside.room", by=by_mm, room=room))
    off = straight("retract", place, now, along_axis(now, by_mm, kinematics), RETRACT_MM_S, kinematics)
    return ending([] if off is None else [off], place)


def ending(way: Iterable[Segment], place: Place) -> Iterator[PathItem]:
    """A way aside: one move after the other, to a stop."""
    yield from (ContinuousPath((segment,)) for segment in way)
    yield Pause(place, modal.power_on().modal, act=Act.STOP)


Left = tuple[Track, TrackPlace]


class Back(NamedTuple):
    """With what the tool comes back.

    ``rest``: the program from the same spot on as another tool cuts it, which was fitted meanwhile for the
    one ``before``; None: the tool is the same.
    """

    fitted: Fitted = Fitted()
    rest: Rest | None = None
    before: Tool | None = None


SAME = Back()  # of which nothing is known


class Detour:
    """Read ``aside``: None while the tool is on the path."""

    def __init__(self, machine: Machine, kinematics: Kinematics) -> None:
        self._machine, self._kinematics = machine, kinematics
        self.aside: Aside | None = None
        self._left: Left | None = None  # the path, and where it goes on
        self._stood: tuple[Aside, Left] | None = None  # what would be left, of the last look at a hold ...
        self._stood_at: tuple[Joints, float, int] | None = None  # ... there; pauses stand in one place
        self._next_id = FIRST_ID

    def forget(self) -> None:
        """The program is gone, and the way with it."""
        self.aside = self._left = self._stood = None

    @property
    def marks(self) -> tuple[object, ...]:
        """Changes with whatever a turn has noted for later ones."""
        stood = None if self._stood is None else self._stood_at
        return stood, None if self.aside is None else self.aside.marks

    def retract(self, now: Snapshot, left: Left | None, spot: Spot | None, by_mm: float) -> Track:
        """The way off, or further off. Raises NotPossible."""
        see_held(now, "retract")
        away = self.aside
        if away is None:
            made = None if now.away else self._leaving(now, left, spot)
        else:
            made = None if self._left is None else (away, self._left)
        if made is None or made[0].returning:
            raise NotPossible(message("aside.no_retract"))
        way = retract(now.joints, by_mm, made[0].place, self._machine, self._kinematics)
        self.aside, self._left = made
        self.aside.retracted, self.aside.off = True, False
        return self._track(way)

    def go_back(self, now: Snapshot, left: Left | None, spot: Spot | None, back: Back) -> Track:
        """The way back to where the tool waits, off the part; resumed it goes in. Raises NotPossible.

        From the path itself only with another tool: the operator has jogged there.
        """
        see_held(now, "return")
        rest = back.rest
        away = self.aside
        if away is not None:
            left = self._left
        elif rest is not None and (made := self._leaving(now, left, spot)) is not None:
            away, left = made
            away.off = True
        if away is None or left is None or not away.off or away.returning:
            raise NotPossible(message("aside.no_return"))
        machine, kinematics, fitted = self._machine, self._kinematics, back.fitted
        stood = away.held
        if rest is not None:
            if back.before is not None and fitted.tool is not None:
                other_tool.see_fits(now.joints, away.held, back.before, fitted.tool, rest)
            path = Track(rest.opened(rest.items), machine, kinematics, probes=True)
            path.goes_on(left[0])
            left, stood = (path, TrackPlace(0, rest.spot.s)), rest.target.joints
        entrance = WayOnto(machine, kinematics, fitted)
        onto, (track, place) = self._onto(*left, stood, rest, entrance)
        length_mm = 0.0 if fitted.tool is None else fitted.tool.length_mm
        clear_mm = fitted.walls.height(onto.waits, length_mm, kinematics) + machine.clearance_mm
        clear_mm = max(clear_mm, track.clear_mm(onto.waits))
        ways = entry.way(now.joints, onto, clear_mm, away.place, entrance, has_cut=rest is None)
        way = self._track(ending(itertools.chain(*ways), away.place))
        track.lead_in(place.unit, onto.s, onto.ways, onto.joins, self._next_id)
        self._next_id += len(onto.ways)
        self._left, away.returning = (track, TrackPlace(place.unit, 0.0 if onto.ways else onto.s)), True
        self.aside = away
        return way

    def _onto(
        self, track: Track, place: TrackPlace, stood: Joints, rest: Rest | None, entrance: WayOnto
    ) -> tuple[Reentry, Left]:
        """How a path is gone on with that was left at a place of it, the joints at ``stood``, and where."""
        number, s = place
        while (unit := track.at(number)) is not None:
            clear_mm = track.clear_mm(stood, unit.segment) if rest is None else rest.target.clear_mm
            if unit.segment is None:
                if track.comes_free(number):
                    return Reentry(stood, 0.0), (track, TrackPlace(number, 0.0))
                onto = entrance.enter_pause(stood, unit.what.place, clear_mm)
                return onto, (track, TrackPlace(number, 0.0))
            found = reentry.begins_at(unit.segment, max(s, unit.begin))
            if found is not None:
                return entrance.enter(unit.segment, found, clear_mm), (track, TrackPlace(number, found))
            number, s = number + 1, 0.0
        raise NotPossible(message("aside.no_return"))

    def _track(self, items: Iterable[PathItem]) -> Track:
        way = named(items, self._next_id)
        self._next_id += len(way)
        return Track(way, self._machine, self._kinematics, ends=False)

    # --- every turn

    def look(self, now: Snapshot, ask: Callable[[], tuple[Left | None, Spot | None]]) -> None:
        """On the path: a jog out of a hold leads off it as a retract of no length does.

        ``ask`` for place and spot; they are looked up once in a hold, or when a jog from there is over that
        began before anybody had looked.
        """
        held = is_held(now)
        if now.mode is Mode.JOG or now.away:
            if self._stood is None and now.away and held:
                self._stood = self._leaving(now, *ask())
            if self._stood is not None:
                (self.aside, self._left), self._stood = self._stood, None
                self.aside.off = True
        elif not held:
            self._stood = None
        elif self._stood is None or self._stood_at != (now.joints, now.plan_time_s, now.line):
            self._stood_at = now.joints, now.plan_time_s, now.line
            self._stood = self._leaving(now, *ask())

    def follow(self, now: Snapshot, arrived: bool) -> Left | None:
        """Off the path: notes what is jogged; what to go on with once the tool is back.

        ``arrived``: the way that was asked for last has come to its end, held.
        """
        away = self.aside
        if away is None or now.mode not in (Mode.HOLD, Mode.RUNNING, Mode.JOG):
            self.forget()  # stopped, or a fault: the way is void with the program
            return None
        if away.returning:
            if not arrived:
                return None
            left = self._left
            self.forget()
            return left
        away.off = away.off or arrived
        if away.off and not away.retracted and now.mode is Mode.HOLD and not now.away:
            self.forget()  # jogged back to where it was held
        return None

    def _leaving(self, now: Snapshot, left: Left | None, spot: Spot | None) -> tuple[Aside, Left] | None:
        """What is to be known of the place at which the tool leaves the path; None without a path."""
        unit = None if left is None else left[0].at(left[1].unit)
        if left is None or spot is None or unit is None:
            return None
        held = self._goes_on_at(*left) if now.away else now.joints
        return None if held is None else (Aside(spot, held, unit.what.place), left)

    def _goes_on_at(self, track: Track, place: TrackPlace) -> Joints | None:
        """The joints at a place of a path; of a pause, where the motion behind it begins; None at the end."""
        number, s = place.unit, place.s
        while (unit := track.at(number)) is not None:
            if unit.segment:
                return joints_at(unit.segment, s if number == place.unit else unit.begin, self._kinematics)
            number += 1
        return None
