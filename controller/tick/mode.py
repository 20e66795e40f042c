"""What the machine is doing: requests by the table, faults by their row, progress of the drives.

All of it works on values; the only thing it moves is the group's goal (``want``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from controller.state import ALWAYS, FAULTS, TRANSITIONS, Fault, Mode, Reaction, Request
from drives.cia402 import State, Wanted
from drives.drive import DriveFault

ENABLE_S = 5.0  # brakes take 0.2 s, some drives' intermediate circuits two or three
HOMING_S = 120.0
MOST_OVERRIDE = 2.0

DRIVE_FAULTS = {
    DriveFault.NONE: Fault.NONE,
    DriveFault.FEEDBACK_LOST: Fault.FEEDBACK_LOST,
    DriveFault.STATE_LOST: Fault.STATE_LOST,
    DriveFault.EMCY: Fault.EMCY,
    DriveFault.HEARTBEAT_LOST: Fault.HEARTBEAT_LOST,
    DriveFault.BUS_ERROR: Fault.BUS_ERROR,
    DriveFault.SEND_FAILED: Fault.SEND_FAILED,
}


class Drives(Protocol):
    """What the tick needs of ``drives.group.Group``."""

    sync_seen: bool
    syncs_seen: int

    @property
    def drives(self) -> Sequence[Any]: ...
    @property
    def positions(self) -> Sequence[int]: ...

    def receive(self, now_s: float) -> None: ...
    def sync(self, now_s: float) -> bool: ...
    def command(self, setpoints: Sequence[int], now_s: float) -> bool: ...
    def want(self, wanted: Wanted) -> None: ...
    def following(self) -> bool: ...
    def fault(self, now_s: float) -> tuple[DriveFault, int]: ...
    def stop_sync(self) -> None: ...


class Modes:
    """Mode, fault and overrides. ``standing`` is told by the caller: whether the commanded joints stand."""

    def __init__(self, group: Drives, period_s: float) -> None:
        self._group = group
        self._enable_ticks = round(ENABLE_S / period_s)
        self._homing_ticks = round(HOMING_S / period_s)
        self._waited = 0  # ticks of enabling or homing
        self._homing_mask = 0
        self._quick_stopped = False
        self.enabling = False
        self._switching_off = False  # homing is done, the drives are switching off
        self.mode = Mode.OFF
        self.fault = Fault.NONE
        self.fault_axis = -1
        self.reaction = Reaction.NONE
        self.override = 1.0
        self.rapid_override = 1.0
        self.single_block = False
        self.optional_stop = False
        self.homed = 0
        self.refused = 0  # the last request that the table refused
        self.dropped = False  # the queue is void: its owner clears it and this flag

    @property
    def running(self) -> bool:
        """Whether the path clock should run."""
        return self.mode is Mode.RUNNING

    @property
    def takes_pieces(self) -> bool:
        return self.mode in (Mode.READY, Mode.RUNNING, Mode.HOLD)

    @property
    def on_path(self) -> bool:
        """Whether the commanded joints are the plan's; otherwise they follow the actual position."""
        return self.mode not in (Mode.OFF, Mode.HOMING) and not self._quick_stopped

    # -- requests

    def request(self, request: Request, value: float, standing: bool) -> None:
        """Does what the table allows; remembers what it refuses."""
        if request in ALWAYS:
            self._always(request, value)
            return
        after = TRANSITIONS.get((self.mode, request))
        if after is None or (request is Request.RESET and not (standing or self._quick_stopped)):
            self.refused = request
            return
        self.mode = after
        act = _ACTS.get(request)
        if act is not None:
            act(self, value)

    def _always(self, request: Request, value: float) -> None:
        if request is Request.ESTOP:
            self.fail(Fault.EMERGENCY_STOP, -1)
        elif request in (Request.OVERRIDE, Request.RAPID_OVERRIDE):
            self._set_override(request, value)
        elif value not in (0.0, 1.0):
            self.refused = request
        elif request is Request.SINGLE_BLOCK:
            self.single_block = value == 1.0
        else:
            self.optional_stop = value == 1.0

    def _set_override(self, request: Request, value: float) -> None:
        if not 0.0 <= value <= MOST_OVERRIDE:
            self.refused = request
        elif request is Request.OVERRIDE:
            self.override = value
        else:
            self.rapid_override = value

    def _enable(self, _: float) -> None:
        for drive in self._group.drives:
            if not drive.cyclic:
                drive.resume_cyclic()
        self._group.want(Wanted.ENABLED)
        self.enabling, self._waited = True, 0

    def _disable(self, _: float) -> None:
        self._group.want(Wanted.OFF)
        self.enabling, self.dropped = False, True

    def _home(self, value: float) -> None:
        self._homing_mask = int(value)
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                drive.homing(True)
        self.homed &= ~self._homing_mask
        self._group.want(Wanted.ENABLED)
        self.enabling, self._waited = False, 0

    def _stop(self, _: float) -> None:
        if self.mode is Mode.OFF:  # homing given up
            self._end_homing()
        self.dropped = self.mode is not Mode.STOPPING  # STOPPING drops it at standstill

    def _reset(self, _: float) -> None:
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                drive.homing(False)
        self._group.want(Wanted.RESET)
        self.fault, self.fault_axis, self.reaction = Fault.NONE, -1, Reaction.NONE
        self._quick_stopped = self.enabling = False
        self.dropped = True

    # -- faults

    def fail(self, fault: Fault, axis: int) -> None:
        """A fault from anywhere. The first one is shown; a harder reaction replaces a softer one."""
        reaction = FAULTS[fault].reaction
        if self.mode in (Mode.OFF, Mode.HOMING):
            reaction = Reaction.QUICK_STOP  # no path to stop on
        if self.mode is not Mode.FAULT:
            self.fault, self.fault_axis, self.mode = fault, axis, Mode.FAULT
            self.enabling = False
        if reaction is Reaction.LOST_DRIVE and axis >= 0:
            self._group.drives[axis].want(Wanted.QUICK_STOP)
        if reaction > self.reaction:
            self.reaction = reaction
            if reaction is Reaction.QUICK_STOP:
                self.quick_stop()

    def quick_stop(self) -> None:
        """Every drive stops by its own ramp; the path is given up."""
        self._group.want(Wanted.QUICK_STOP)
        self._quick_stopped = True

    def watch(self, now_s: float) -> None:
        """Takes the group's fault over."""
        fault, axis = self._group.fault(now_s)
        if fault is not DriveFault.NONE:
            known = DRIVE_FAULTS[fault]
            if self.mode is not Mode.FAULT or FAULTS[known].reaction > self.reaction:
                self.fail(known, axis)

    # -- progress

    def progress(self, ticks: int, standing: bool) -> None:
        """What follows by itself: enabled, homed, stopped."""
        if self.enabling:
            self._watch_enabling(ticks)
        elif self.mode is Mode.HOMING:
            self._watch_homing(ticks)
        elif self.mode is Mode.STOPPING and standing:
            self.mode, self.dropped = Mode.READY, True
        elif self.reaction is Reaction.LOST_DRIVE and standing and not self._quick_stopped:
            self.quick_stop()

    def _watch_enabling(self, ticks: int) -> None:
        self._waited += ticks
        if self._group.following():
            self.mode, self.enabling, self.dropped = Mode.READY, False, True
        elif self._waited > self._enable_ticks:
            self.fail(Fault.ENABLE_TIMEOUT, self._first_not_following())

    def _first_not_following(self) -> int:
        return next((i for i, drive in enumerate(self._group.drives) if not drive.following), -1)

    def _watch_homing(self, ticks: int) -> None:
        self._waited += ticks
        if self._switching_off:
            if not any(drive.state == State.OPERATION_ENABLED for drive in self._group.drives):
                self._switching_off, self.mode = False, Mode.OFF
            return
        busy = -1
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                if drive.homing_error:
                    self.fail(Fault.HOMING_FAILED, i)
                    return
                if not drive.homing_done:
                    busy = i
        if busy < 0:
            # OFF only when every drive has switched off: then its mode may be changed by SDO.
            self.homed |= self._homing_mask
            self._end_homing()
            self.mode, self._switching_off = Mode.HOMING, True
        elif self._waited > self._homing_ticks:
            self.fail(Fault.HOMING_FAILED, busy)

    def _end_homing(self) -> None:
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                drive.homing(False)
        self._group.want(Wanted.OFF)
        self.mode = Mode.OFF


_ACTS = {
    Request.ENABLE: Modes._enable,
    Request.DISABLE: Modes._disable,
    Request.HOME: Modes._home,
    Request.STOP: Modes._stop,
    Request.RESET: Modes._reset,
}
