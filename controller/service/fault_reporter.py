"""Faults and warnings as they come and go: each reported once, as an alarm, with its recording.

The main thread looks; the door's thread reads what is shown. A recording takes the better part of a
second: where the machine stands in a fault the main thread has that time, but a hold or a warning
may be over in the next moment, and then the journal must not wait. So another thread writes those.
"""

from __future__ import annotations

from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.messages import Message, several
from controller.runtime.recording import Keeper
from controller.service import alarms as alarm_values
from controller.service.alarms import Alarms
from controller.state.fault_table import Sender
from controller.state.modes import FAULTS, Fault, Mode, Reaction


class Troubles:
    """``shown``: the present fault as the status has it, None without one."""

    def __init__(self, machine: Machine, alarms: Alarms, writer: Executor) -> None:
        """``writer`` writes recordings while the machine may go on."""
        self.shown: dict[str, Any] | None = None
        self._keeper: Keeper | None = None  # of recordings; there is one while there is a tick
        self._machine, self._alarms, self._writer = machine, alarms, writer
        self._fault = self._warning = Fault.NONE
        self._told_before: dict[str, Any] | None = None  # the alarm of a fault that the tick is yet to report
        self._owed: list[int] = []  # alarms whose recording is still to come
        self._first: Snapshot | None = None  # when the first of them came, with its fault
        self._written: list[int] = []  # alarms of the recording that is being written
        self._writing: Future[Path] | None = None

    def begin(self) -> None:
        """There is a new tick, which has reported nothing yet."""
        self.shown, self._fault = None, Fault.NONE
        self._told_before = None
        self._owed.clear()

    def record_by(self, keeper: Keeper | None) -> None:
        """``keeper`` of recordings, while there is a tick."""
        self._keeper = keeper

    def at(self, now: Snapshot, tick_alive: bool) -> dict[str, Any] | None:
        """The fault of this very snapshot, though nobody has drawn conclusions yet."""
        known = self.shown
        if not tick_alive:
            if known is not None and known["name"] == Fault.CONTROLLER_GONE.name:
                return known
            return {**alarm_values.of(self._machine, Fault.CONTROLLER_GONE, -1), "recording": None}
        if now.fault is Fault.NONE:
            return None
        if known is not None and known["name"] == now.fault.name:
            return known
        return self._of(now)

    def look(self, now: Snapshot) -> None:
        """A fault is reported as soon as it is seen; its recording follows when the machine stands."""
        if now.fault is not Fault.NONE and now.fault is not self._fault:
            self._show(now.fault, self._of(now), now)
        elif now.fault is Fault.NONE:
            self.shown = None
        self._fault = now.fault
        if now.warning is not self._warning and now.warning is not Fault.NONE:
            self._tell_of(now.warning, now, axis=now.warning_axis)
        self._warning = now.warning
        self._look_at_recording(now)

    def planner_gone(self, now: Snapshot, words: str, runs: bool = False) -> None:
        """The plan's process died. ``runs``: a program was under way, which becomes a fault of the tick."""
        alarm = self._tell_of(Fault.PLANNER_GONE, now, words)
        self._told_before = alarm if runs and now.fault is not Fault.PLANNER_GONE else None

    def run_over(self) -> None:
        """What becomes of a program has been reported."""
        self._told_before = None

    @property
    def message(self) -> Message | None:
        """The message of the present fault."""
        return _message(self.shown) if self.shown is not None else None

    def tick_gone(self, now: Snapshot, words: str) -> Message:
        """The drives stop by themselves; what the last ticks were is kept. What is said of it."""
        gone = Fault.CONTROLLER_GONE
        shown = {**alarm_values.of(self._machine, gone, -1), "recording": None}
        self._show(gone, shown, now, words)
        if (keeper := self._keeper) is not None:
            keeper.keep(now, gone)
            self._pay(self._owed, keeper.saved)
        return _message(shown)

    def _of(self, now: Snapshot) -> dict[str, Any]:
        known = alarm_values.of(
            self._machine, now.fault, now.fault_axis, now.warning, now.fault_off, _sender(now)
        )
        return {**known, "recording": None}

    def _look_at_recording(self, now: Snapshot) -> None:
        keeper = self._keeper
        if keeper is None:
            return
        if keeper.look(now) and now.mode is Mode.FAULT:
            self._pay(self._owed, keeper.saved)
        elif now.mode is not Mode.FAULT and self._writing is None and self._owed:
            self._have_written(keeper, now)
        if self._writing is not None and self._writing.done():
            failed, written = self._writing.exception(), self._writing
            self._pay(self._written, None if failed else written.result())
            self._writing = None

    def _have_written(self, keeper: Keeper, now: Snapshot) -> None:
        """Of what stops the machine for a while only, or not at all."""
        if (first := self._first) is None:
            return
        stops = FAULTS[first.fault].reaction > Reaction.WARN
        if keeper.settled(now, first.tick, stops):
            named = now._replace(fault=first.fault, fault_axis=first.fault_axis)
            self._written, self._owed = self._owed, []
            self._writing = self._writer.submit(keeper.save, named)

    def _pay(self, owed: list[int], saved: Path | None) -> None:
        """These alarms have their recording now; None: it could not be written."""
        told = str(saved) if saved else None
        for number in owed:
            self._alarms.change(number, recording=told)
        if (shown := self.shown) is not None and shown["number"] in owed:
            self.shown = {**shown, "recording": told}
        owed.clear()

    def _show(self, fault: Fault, shown: dict[str, Any], now: Snapshot, words: str = "") -> None:
        """The present fault, with number and time of its alarm; one alarm for what was reported before."""
        before, self._told_before = self._told_before, None
        alarm = before if before and before["name"] == fault.name else self._tell(fault, shown, now, words)
        self.shown = {**shown, "number": alarm["id"], "time_s": alarm["time_s"]}

    def _tell_of(self, fault: Fault, now: Snapshot, words: str = "", axis: int = -1) -> dict[str, Any]:
        """Of what is not, or not yet, the fault of a snapshot."""
        shown = alarm_values.of(self._machine, fault, axis, sender=_sender(now))
        return self._tell(fault, shown, now._replace(fault_axis=axis), words)

    def _tell(self, fault: Fault, shown: dict[str, Any], now: Snapshot, words: str = "") -> dict[str, Any]:
        """An alarm out of a fault, with the last words of a process."""
        left_out = ("name", "key", "values", "recording")
        entry = {name: value for name, value in shown.items() if name not in left_out}
        what = several(_message(shown), words) if words else _message(shown)
        alarm = self._alarms.add(shown["name"], what, **entry, **alarm_values.where(now))
        if not self._owed:
            self._first = now._replace(fault=fault)
        self._owed.append(alarm["id"])
        return alarm


def _sender(now: Snapshot) -> Sender:
    return Sender(now.chatter_id, now.chatter_per_s)


def _message(shown: dict[str, Any]) -> Message:
    return Message(key=shown["key"], values=shown["values"])
