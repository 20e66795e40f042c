"""The contour error of the run under way: alarms where it is too large, and what the machine file says.

Beside it the setpoints that did not come to the drives are counted.

Its lock is that of ``JobRun``: motions come from the plan's thread, rows and the run's end from others.
"""

from __future__ import annotations

import contextlib
from bisect import bisect_right
from collections.abc import Mapping
from operator import itemgetter
from typing import Any

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, Snapshot
from controller.machine.model import Machine
from controller.plan.restart.program_position import ENTRY_ID
from controller.runtime.contour_error import Demand, demand
from controller.runtime.contour_watch import ContourWatch, Excess, reaction
from controller.runtime.plan_messages import MotionFacts
from controller.service import alarms
from controller.service.alarms import Alarms
from controller.service.engine import Engine
from controller.service.runs import Rows
from controller.state import setpoint_counts
from controller.state.modes import Mode

ALARM = "CONTOUR_ERROR"
MAX_ALARMS = 50  # of a run; the record of it has more


class ContourGuard:
    """Watches over one run after another."""

    def __init__(self, alarms: Alarms, engine: Engine) -> None:
        self._alarms, self._engine = alarms, engine
        self._watch: ContourWatch | None = None
        # Of the motions at feed that are not passed: from which s on what is asked.
        self._demands: dict[int, list[tuple[float, Demand]]] = {}
        self._axes: list[str] = []
        self._first: Snapshot | None = None  # of the run ...
        self._last: Snapshot | None = None  # ... and the newest
        self._raised: dict[int, tuple[int, float]] = {}  # by line: the alarm, and how large it says it is

    def begin(self, machine: Machine) -> None:
        """Another run; what was heard of the last is forgotten."""
        self._demands, self._raised = {}, {}
        self._watch, self._first, self._last = ContourWatch(machine, self._demand), None, None
        self._axes = [axis.name for axis in machine.axes]

    def hear(self, ways: Mapping[int, MotionFacts], machine: Machine) -> None:
        """The plan has sent some more motions; ``machine``: with its tools."""
        for number, way in ways.items():
            if way.feed_mm_s is not None:
                states = ((0.0, way.state), *way.states)
                self._demands[number] = [(s, demand(state.modal, machine)) for s, state in states]

    def _demand(self, motion_id: int, s: float) -> Demand | None:
        found = self._demands.get(motion_id)
        if found is None:
            return None
        return found[max(0, bisect_right(found, s, key=itemgetter(0)) - 1)][1]

    def take(self, rows: Rows, machine: Machine, now: Snapshot) -> None:
        """The newest rows of the tick."""
        if self._watch is None or not len(rows):
            return
        self._first, self._last = self._first or now, now
        for excess in self._watch.take(rows):
            self._raise(excess, machine, now)
            if not excess.over and now.mode is Mode.RUNNING:
                self._react(machine, now)
        if not self._watch.waits:
            self._forget(int(rows[-1, COLUMN["motion_id"]]))

    def end(self) -> dict[str, Any]:
        """The run is over; what its record has of it."""
        watch, self._watch = self._watch, None
        if watch is None:
            return {}
        watch.see_all()
        first, last = self._first, self._last
        counts = {} if first is None or last is None else setpoint_counts.between(self._axes, first, last)
        return {"contour_error": watch.to_dict(), "setpoints": counts}

    def _raise(self, excess: Excess, machine: Machine, now: Snapshot) -> None:
        """One alarm for each line, which says how far off it was at most."""
        line, largest_mm = excess.largest.line, excess.largest.mm
        axis = machine.axes[excess.largest.axis].name
        if (raised := self._raised.get(line)) is not None:
            number, known_mm = raised
            if largest_mm >= known_mm:
                self._alarms.change(number, **excess.sentence(machine), axis=axis)
        elif len(self._raised) < MAX_ALARMS:
            at = {**alarms.where(now), "line": line, "tick": excess.tick}
            number = self._alarms.add(ALARM, excess.sentence(machine), axis=axis, **at)["id"]
        else:
            return
        self._raised[line] = number, max(largest_mm, raised[1] if raised is not None else 0.0)

    def _react(self, machine: Machine, now: Snapshot) -> None:
        if (asked := reaction(machine, now.override)) is not None:
            with contextlib.suppress(CommandRefused):  # the tick is gone, and with it the motion
                self._engine.request(*asked)

    def _forget(self, passed: int) -> None:
        """Of the program no motion before this one comes again; ways beside it are few."""
        if 0 <= passed < ENTRY_ID:
            for number in [one for one in self._demands if one < passed]:
                del self._demands[number]
