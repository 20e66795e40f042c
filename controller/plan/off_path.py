"""Whether the tool is off the path, and what the planner has to do about it.

The planner plans one way at a time. While the tool is aside, the program's own track waits here
with the place at which it goes on; the ways off and back are tracks of their own that end held.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from controller.ipc.handoff import Snapshot
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine
from controller.messages import said
from controller.plan import retract as aside
from controller.plan.look_ahead import Place
from controller.plan.path.path import Chain, Pause, Stretch
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.plan.restart.restart import Rest, joints_at, named
from controller.plan.retract import Aside, NotPossible
from controller.plan.track import Track
from controller.state.modes import Mode

FIRST_ID = 2 * ENTRY_ID  # of their motions; each way has its own, for the tick knows the last ones yet

Left = tuple[Track, Place]


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
        """The way off. Raises NotPossible."""
        aside.see_held(now, "retract")
        made = None if self.aside is not None or now.away else self._leaving(now, left, spot, by_mm)
        if made is None:
            raise NotPossible(said("aside.no_retract"))
        track = self._track(aside.retract(made[0], self._machine, self._kinematics))
        self.aside, self._left = made
        return track

    def go_back(self, now: Snapshot, rest: Rest | None, lengths_mm: tuple[float, float]) -> Track:
        """The way back, at whose end ``rest`` is left of the program. Raises NotPossible."""
        away = self.aside
        if away is None or not away.off or away.returning:
            raise NotPossible(said("aside.no_return"))
        aside.see_held(now, "return")
        away.see(now)
        target = away.held if rest is None else rest.target.joints
        here = now.joints
        track = self._track(aside.back(away, here, target, lengths_mm, self._machine, self._kinematics))
        if rest is not None:
            path = Track(rest.opened(rest.items), self._machine, self._kinematics)
            self._left = (path, Place(0, 0.0))
        away.returning = True
        return track

    def _track(self, items: Iterable[Chain | Pause]) -> Track:
        way = named(items, self._next_id)
        self._next_id += len(way)
        return Track(way, self._machine, self._kinematics, ends=False)

    # --- every turn

    def look(self, now: Snapshot, ask: Callable[[], tuple[Left | None, Spot | None]]) -> None:
        """On the path: a jog out of a hold leads off it as a retract of no length does.

        ``ask`` for place and spot; they are looked up once in a hold, or when a jog from there is over that
        began before anybody had looked.
        """
        held = aside.is_held(now)
        if now.mode is Mode.JOG or now.away:
            if self._stood is None and now.away and held:
                self._stood = self._leaving(now, *ask(), 0.0)
            if self._stood is not None:
                (self.aside, self._left), self._stood = self._stood, None
                self.aside.turns.append(self.aside.held)
                self.aside.off = True
        elif not held:
            self._stood = None
        elif self._stood is None or self._stood_at != (now.joints, now.plan_time_s, now.line):
            self._stood_at = now.joints, now.plan_time_s, now.line
            self._stood = self._leaving(now, *ask(), 0.0)

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
        if away.off:
            away.see(now)
        if away.off and not away.retract_mm and now.mode is Mode.HOLD and not now.away:
            self.forget()  # jogged back to where it was held
        return None

    def _leaving(
        self, now: Snapshot, left: Left | None, spot: Spot | None, by_mm: float
    ) -> tuple[Aside, Left] | None:
        """What is to be known of the place at which the tool leaves the path; None without a path."""
        unit = None if left is None else left[0].at(left[1].unit)
        if left is None or spot is None or unit is None:
            return None
        held = self._goes_on_at(*left) if now.away else now.joints
        if held is None:
            return None
        what, feed_mm_s = unit.what, math.inf
        if isinstance(what, Stretch):
            feed_mm_s = float(what.feed_at(np.array([left[1].s]))[0])
        return Aside(spot, held, what.place, feed_mm_s, by_mm), left

    def _goes_on_at(self, track: Track, place: Place) -> Joints | None:
        """The joints at a place of a path; of a pause, where the motion behind it begins; None at the end."""
        number, s = place.unit, place.s
        while (unit := track.at(number)) is not None:
            if isinstance(unit.what, Stretch):
                return joints_at(unit.what, s if number == place.unit else unit.begin, self._kinematics)
            number += 1
        return None
