"""Faults and warnings as they come and go: each told once, as an alarm, with its recording.

The main thread looks; the door's thread reads what is shown.
"""

from __future__ import annotations

from typing import Any

from controller.handoff import Snapshot
from controller.machine import Machine
from controller.service import alarms as alarm_values
from controller.service.alarms import Alarms
from controller.session.recording import Keeper
from controller.state import Fault


class Troubles:
    """``shown``: the present fault as the status has it, None without one."""

    def __init__(self, machine: Machine, alarms: Alarms) -> None:
        self.shown: dict[str, Any] | None = None
        self.keeper: Keeper | None = None  # of recordings; there is one while there is a tick
        self._machine, self._alarms = machine, alarms
        self._fault = self._warning = Fault.NONE
        self._id = 0

    def begin(self) -> None:
        """There is a new tick, which has told nothing yet."""
        self._fault = Fault.NONE

    def at(self, now: Snapshot, tick_alive: bool) -> dict[str, Any] | None:
        """The fault of this very snapshot, though nobody has drawn conclusions yet."""
        known = self.shown
        if not tick_alive:
            return known
        if now.fault is Fault.NONE:
            return None
        if known is not None and known["name"] == now.fault.name:
            return known
        return self._of(now)

    def look(self, now: Snapshot) -> None:
        """A fault is told as soon as it is seen; its recording follows when the machine stands."""
        if now.fault is not Fault.NONE and now.fault is not self._fault:
            self.shown = self._of(now)
            self._id = self._tell(self.shown, now)
        elif now.fault is Fault.NONE:
            self.shown = None
        self._fault = now.fault
        if now.warning is not self._warning and now.warning is not Fault.NONE:
            self._tell(alarm_values.of(self._machine, now.warning, -1), now)
        self._warning = now.warning
        self._look_at_recording(now)

    def planner_gone(self, now: Snapshot, words: str) -> None:
        """The plan's process died; the tick tells a fault of its own if that stops it."""
        self._tell(alarm_values.of(self._machine, Fault.PLANNER_GONE, -1), now, words)

    def tick_gone(self, now: Snapshot, words: str) -> str:
        """The drives stop by themselves; what the last ticks were is kept. The sentence."""
        shown, recording = alarm_values.of(self._machine, Fault.CONTROLLER_GONE, -1), None
        if (keeper := self.keeper) is not None:
            keeper.keep(now, Fault.CONTROLLER_GONE)
            recording = str(keeper.saved) if keeper.saved else None
        self.shown = {**shown, "recording": recording}
        self._tell(shown, now, words, recording=recording)
        return str(shown["sentence"])

    def _of(self, now: Snapshot) -> dict[str, Any]:
        known = alarm_values.of(self._machine, now.fault, now.fault_axis, now.warning)
        return {**known, "recording": None}

    def _look_at_recording(self, now: Snapshot) -> None:
        keeper = self.keeper
        if keeper is None or not keeper.look(now) or self.shown is None:
            return
        told = str(keeper.saved) if keeper.saved else None
        if told != self.shown.get("recording"):
            self.shown = {**self.shown, "recording": told}
            self._alarms.change(self._id, recording=told)

    def _tell(self, shown: dict[str, Any], now: Snapshot, words: str = "", **more: Any) -> int:
        """An alarm out of a fault, with the last words of a process; its number."""
        left_out = ("name", "sentence", "recording")
        entry = {name: value for name, value in shown.items() if name not in left_out}
        said = f"{shown['sentence']} {words}".strip()
        return int(self._alarms.add(shown["name"], said, **entry, **alarm_values.where(now), **more)["id"])
