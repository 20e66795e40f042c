"""What the machine is doing: requests by the table, faults by their row, progress of the drives.

All of it works on values; the only thing it moves is the group's goal (``want``).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final

from controller.commands.table import MAX_OVERRIDE, SPINDLE_OVERRIDES, SWITCHED
from controller.state.modes import ALWAYS, FAULTS, TRANSITIONS, Fault, Mode, Reaction, Request, bars
from controller.state.stop_times import ENABLE_S, HOMING_S
from controller.tick.drives import Drives
from drives.cia402 import State, Wanted
from drives.cyclic.drive import DriveFault

_STARTS = (0.0, 1.0, 2.0, 3.0)  # ``StaysOn``
WARNING = 1 << 7  # of the statusword (CiA 402)

# A drive that has tripped, lost its torque or started anew is silent or drops out first.
_EFFECTS = (Fault.FEEDBACK_LOST, Fault.STATE_LOST, Fault.HEARTBEAT_LOST)
_CAUSES = (
    Fault.NODE_RESET,
    Fault.NODE_STOPPED,
    Fault.MODE_LOST,
    Fault.EMCY,
    Fault.FOLLOWING_ERROR,
    Fault.LOAD_OFF,
    Fault.SETPOINTS_LOST,
    Fault.LIMIT_SWITCH,
    Fault.TORQUE_OFF,
)

DRIVE_FAULTS = {fault: Fault[fault.name] for fault in DriveFault}


class Phase(IntEnum):
    """How far a mode has come; each but STEADY is of one mode alone (``PHASES``), and ends with it."""

    STEADY = 0
    ENABLING = 1  # the drives come up, READY is next
    SWITCHING_OFF = 2  # every axis is homed; when the drives are off, OFF is next
    ENDING = 3  # HOLD is next, at the end of this block
    HALTING = 4  # the jog comes to rest, and the mode that it came from is next
    QUICK_STOPPED = 5  # the drives stop by their own ramps, and the path is given up


PHASES = {
    Phase.ENABLING: Mode.OFF,
    Phase.SWITCHING_OFF: Mode.HOMING,
    Phase.ENDING: Mode.RUNNING,
    Phase.HALTING: Mode.JOG,
    Phase.QUICK_STOPPED: Mode.FAULT,
}


# Looked up every tick, and an enum's members are slow to look up.
_OFF: Final = Mode.OFF
_READY: Final = Mode.READY
_RUNNING: Final = Mode.RUNNING
_HOMING: Final = Mode.HOMING
_STOPPING: Final = Mode.STOPPING
_FAULT: Final = Mode.FAULT
_ENABLING: Final = Phase.ENABLING
_QUICK_STOPPED: Final = Phase.QUICK_STOPPED
_DRIVE_WARNING: Final = Fault.DRIVE_WARNING
_NO_DRIVE_FAULT: Final = DriveFault.NONE


class Modes:
    """Mode, fault and overrides.

    What other rooms know is told by the caller: ``standing``, whether the commanded joints stand; ``away``,
    whether a jog has led the tool off the place of the hold.
    """

    def __init__(
        self,
        group: Drives,
        period_s: float,
        path_stop_s: float = math.inf,
        quick_stop_s: float = 0.0,
        absolute: int = 0,
    ) -> None:
        """``path_stop_s``: a coordinated stop that takes longer is broken off by a quick stop;
        ``quick_stop_s``: after so long every drive's own ramp is over. See ``times``.
        ``absolute``: axes whose encoders know where they are, whatever has been (bit mask).
        """
        self._group = group
        self._every_axis = (1 << len(group.drives)) - 1
        self._period_s = period_s
        self._stop_ticks = path_stop_s / period_s
        self.quick_stop_takes(quick_stop_s)
        self._enable_ticks = round(ENABLE_S / period_s)
        self._homing_ticks = round(HOMING_S / period_s)
        self._waited = 0  # ticks of enabling or homing
        self._homing_mask = 0
        self._stopping = 0  # ticks since the fault
        self._looked_at = 0  # the drive whose warning is looked at next
        self.mode = Mode.OFF
        self.phase = Phase.STEADY
        self.fault = Fault.NONE
        self.fault_axis = -1
        self.reaction = Reaction.NONE
        self.override = 1.0
        self.rapid_override = 1.0
        self.spindle_override = 1.0
        self.switched = 0  # the switches below that are on, by the bits of their commands
        self.single_block = False
        self.optional_stop = False
        self.adaptive_feed = False
        self.homed = self.absolute = absolute
        self.untrusted = 0  # axes that a fault has cost their position; no start before they are homed
        self.warning = Fault.NONE  # the last fault that stopped nothing
        self.warning_axis = -1
        self._chatter = group.chatter
        self._chatters = -1  # the identifier that was warned of
        self._early = 0  # axes that were warned of, bit mask
        self.interlock = Fault.NONE  # what forbids motion at present (door, e-stop), see ``forbid``
        self.plan_lost = False  # nobody knows the program beyond what is queued
        self.stays_on = 0  # as START said (``StaysOn``)
        self.ended = False  # the last program has come to its end by itself

    def quick_stop_takes(self, seconds: float) -> None:
        """As the drives were read, from now on."""
        self._ramp_ticks = seconds / self._period_s

    @property
    def running(self) -> bool:
        """Whether the path clock should run."""
        return self.mode is _RUNNING

    @property
    def takes_pieces(self) -> bool:
        return self.mode in (Mode.READY, Mode.RUNNING, Mode.HOLD)

    @property
    def on_path(self) -> bool:
        """Whether the commanded joints are the plan's; otherwise they follow the actual position."""
        mode = self.mode
        return mode is not _OFF and mode is not _HOMING and self.phase is not _QUICK_STOPPED

    def _enter(self, mode: Mode, phase: Phase = Phase.STEADY) -> None:
        self.mode, self.phase = mode, phase

    # -- what the other rooms of the tick tell

    def forbid(self, found: Fault) -> None:
        """Motion, as long as this holds; NONE: nothing forbids it."""
        self.interlock = found

    def end_jog(self) -> None:
        """It comes to rest, if there is one."""
        if self.mode is Mode.JOG:
            self.phase = Phase.HALTING

    def leave_jog(self, back: Mode) -> None:
        """It is at rest; a fault meanwhile stays. In READY there is no program whose plan is lost."""
        if self.mode is Mode.JOG:
            self._enter(back)
            self.plan_lost = self.plan_lost and back is Mode.HOLD

    def path_stops(self) -> None:
        """At a stop of the program."""
        self._enter(Mode.HOLD)

    def path_ends(self) -> None:
        """With the program."""
        self._enter(Mode.READY)
        self.ended = True

    # -- requests

    def request(self, request: Request, value: float, standing: bool, away: bool = False) -> bool:
        """Does what the table allows; False where it refuses it. What is queued then is void by ``DROPS``."""
        if request in ALWAYS:
            return self._always(request, value)
        after = TRANSITIONS.get((self.mode, request))
        if after is None or not self._permitted(request, value, standing, away):
            return False
        self._enter(after)
        act = _ACTS.get(request)
        if act is not None:
            act(self, value)
        return True

    def _permitted(self, request: Request, value: float, standing: bool, away: bool) -> bool:
        """What besides the mode a request depends on."""
        if request is Request.RESET:
            return standing or self.phase is Phase.QUICK_STOPPED
        if request is Request.START and value not in _STARTS:
            return False
        if (request is Request.START and self.untrusted) or (request is Request.RESUME and away):
            return False
        if request is Request.JOG and not standing and self.mode is not Mode.JOG:
            return False
        return not bars(self.interlock, request)

    def _always(self, request: Request, value: float) -> bool:
        """What every mode takes; False for a value that is none."""
        if request in (Request.OVERRIDE, Request.RAPID_OVERRIDE):
            return self._set_override(request, value)
        if request is Request.SPINDLE_OVERRIDE:
            return self._set_spindle_override(value)
        if request in SWITCHED:
            return self._switch(request, value)
        if request is Request.ESTOP:
            self.fail(Fault.EMERGENCY_STOP, -1)
        elif request is Request.PLAN_LOST:
            self.plan_lost = self.mode in (Mode.RUNNING, Mode.HOLD, Mode.JOG)
        elif request is Request.JOG_STOP:
            self.end_jog()
        return True

    def _switch(self, request: Request, value: float) -> bool:
        if value not in (0.0, 1.0):
            return False
        switch, on = SWITCHED[request], value == 1.0
        setattr(self, switch.name, on)
        self.switched = self.switched | switch.bit if on else self.switched & ~switch.bit
        return True

    def _set_override(self, request: Request, value: float) -> bool:
        if not 0.0 <= value <= MAX_OVERRIDE:
            return False
        if request is Request.OVERRIDE:
            self.override = value
        else:
            self.rapid_override = value
        return True

    def _set_spindle_override(self, value: float) -> bool:
        if not SPINDLE_OVERRIDES[0] <= value <= SPINDLE_OVERRIDES[1]:
            return False
        self.spindle_override = value
        return True

    def _start(self, value: float) -> None:
        self.plan_lost, self.ended = False, False
        self.stays_on = int(value)

    def _enable(self, _: float) -> None:
        for drive in self._group.drives:
            if not drive.cyclic:
                drive.resume_cyclic()
        self._group.want(Wanted.ENABLED)
        self._early = 0
        self.phase, self._waited = Phase.ENABLING, 0

    def _disable(self, _: float) -> None:
        self._group.want(Wanted.OFF)

    def _home(self, value: float) -> None:
        self._homing_mask = int(value)
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                drive.homing(True)
        self.homed &= ~self._homing_mask
        self._group.want(Wanted.ENABLED)
        self._waited = 0

    def _halt(self, _: float) -> None:
        """In a program the mode alone says it."""
        self.end_jog()

    def _stop(self, _: float) -> None:
        if self.mode is Mode.JOG:
            self.end_jog()
            return
        if self.mode is Mode.OFF:  # homing given up
            self._end_homing()
        self.plan_lost = False
        self._go_on(0.0)

    def _go_on(self, _: float) -> None:
        """Resume or stop: the reason of the hold is no longer shown."""
        self.fault, self.fault_axis, self.reaction = Fault.NONE, -1, Reaction.NONE

    def _reset(self, _: float) -> None:
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                drive.homing(False)
        self._group.want(Wanted.RESET)
        self._go_on(0.0)
        self.homed |= self.absolute
        self.untrusted &= ~self.absolute
        self._warn(Fault.NONE)

    # -- faults

    def fail(self, fault: Fault, axis: int) -> None:
        """A fault from anywhere. The first one is shown; a harder reaction replaces a softer one."""
        reaction = FAULTS[fault].reaction
        if reaction is Reaction.END_OF_BLOCK or (reaction is Reaction.HOLD and self.mode is not Mode.HOMING):
            self._hold(fault, axis, reaction)
            return
        if reaction is Reaction.WARN:
            self._warn(fault, axis)
            return
        if self.mode in (Mode.OFF, Mode.HOMING):
            reaction = max(reaction, Reaction.QUICK_STOP)  # no path to stop on
        if self.mode is Mode.HOMING:
            self.untrusted |= self._homing_mask  # given up: they have no zero
        if self.mode is not Mode.FAULT:
            self._enter(Mode.FAULT)
            self.fault, self.fault_axis, self.plan_lost = fault, axis, False
            self.reaction, self._stopping = Reaction.NONE, 0
        self._distrust(fault, axis)
        self._name_more(fault, axis)
        if reaction is Reaction.LOST_DRIVE and axis >= 0:
            self._group.drives[axis].want(Wanted.QUICK_STOP)
        if reaction > self.reaction:
            self.reaction = reaction
            if reaction >= Reaction.QUICK_STOP:
                self.quick_stop()

    def _hold(self, fault: Fault, axis: int, reaction: Reaction) -> None:
        """Nothing is lost: hold on the path, or where the block ends. At rest it is only told."""
        if self.mode is Mode.FAULT or reaction < self.reaction:
            return
        if self.mode not in (Mode.RUNNING, Mode.HOLD):
            self._warn(fault, axis)
            if reaction is Reaction.HOLD:
                self.end_jog()
            return
        self.fault, self.fault_axis, self.reaction = fault, axis, reaction
        if reaction is Reaction.HOLD:
            self._enter(Mode.HOLD)
        elif self.mode is Mode.RUNNING:
            self.phase = Phase.ENDING

    def _distrust(self, fault: Fault, axis: int) -> None:
        """Axes that may have lost count, or were out of sight, must be homed again."""
        row = FAULTS[fault]
        if row.position_trusted:
            return
        alone = row.reaction is Reaction.LOST_DRIVE and axis >= 0
        mask = 1 << axis if alone else self._every_axis
        self.untrusted |= mask
        self.homed &= ~mask

    def _name_more(self, fault: Fault, axis: int) -> None:
        """The cause takes the place of its effect; what needs more to recover from is told beside it."""
        if axis == self.fault_axis and self.fault in _EFFECTS and fault in _CAUSES:
            self.fault = fault
        most = max(FAULTS[self.fault].recovery, FAULTS[self.warning].recovery)
        if FAULTS[fault].recovery > most:
            self._warn(fault, axis)

    def _warn(self, fault: Fault, axis: int = -1) -> None:
        self.warning, self.warning_axis = fault, axis

    def quick_stop(self) -> None:
        """Out of FAULT: every drive stops by its own ramp; the path is given up."""
        self._group.want(Wanted.QUICK_STOP)
        self.phase = Phase.QUICK_STOPPED

    def watch(self, now_s: float) -> None:
        """Takes the group's fault over."""
        fault, axis = self._group.fault(now_s)
        if fault is not _NO_DRIVE_FAULT:
            known = DRIVE_FAULTS[fault]
            if self.mode is not Mode.FAULT or FAULTS[known].reaction > self.reaction:
                self.fail(known, axis)
            self._look_for_more(now_s)
        self._look_for_a_warning()

    def _look_for_more(self, now_s: float) -> None:
        """Each drive that is lost costs its position; two of them, and no path can be kept."""
        lost = 0
        for i in range(len(self._group.drives)):
            fault = self._group.fault_of(i, now_s)
            if fault is not DriveFault.NONE:
                lost += 1
                self._look_at(fault, i)
                self._look_at(self._group.out_of_sight(i, now_s), i)
        if lost > 1 and self.phase is not Phase.QUICK_STOPPED:
            self.reaction = max(self.reaction, Reaction.QUICK_STOP)
            self.quick_stop()

    def _look_at(self, fault: DriveFault, i: int) -> None:
        if fault is not DriveFault.NONE:
            self._distrust(DRIVE_FAULTS[fault], i)
            self._name_more(DRIVE_FAULTS[fault], i)

    def _look_for_a_warning(self) -> None:
        """One drive per tick: a warning may wait for a few. Each is given once, as long as it lasts."""
        drives = self._group.drives
        i = self._looked_at = (self._looked_at + 1) % len(drives)
        drive = drives[i]
        if drive.statusword & WARNING and self.warning is not _DRIVE_WARNING:
            self._warn(_DRIVE_WARNING, i)
        if drive.following_error.early and not self._early >> i & 1:
            self._early |= 1 << i
            self._warn(Fault.SETPOINTS_EARLY, i)
        if self._chatter.can_id != self._chatters:
            self._chatters = self._chatter.can_id
            if self._chatters >= 0 and self.fault is not Fault.BUS_FLOODED:
                self._warn(Fault.NODE_CHATTERS)

    # -- progress

    def progress(self, ticks: int, standing: bool) -> bool:
        """What follows by itself: enabled, homed, stopped. True where what is queued is void with it."""
        before = self.mode
        if self.phase is _ENABLING:
            self._watch_enabling(ticks)
        elif before is _HOMING:
            self._watch_homing(ticks)
        elif before is _STOPPING and standing:
            self._enter(_READY)
        elif before is _FAULT:
            self._watch_stop(ticks, standing)
        elif before is _READY and self.fault is not Fault.NONE:
            self._warn(self.fault, self.fault_axis)  # the program ended before its block's end could be held
            self._go_on(0.0)
        return self.mode is _READY and before is not _READY

    def _watch_stop(self, ticks: int, standing: bool) -> None:
        """The way to standstill after a fault: quick stop for the rest, for what takes too long, then off."""
        before = self._stopping
        self._stopping += ticks
        if self.phase is Phase.QUICK_STOPPED:
            if self.reaction is Reaction.DISABLE and before <= self._ramp_ticks < self._stopping:
                self._group.want(Wanted.OFF)
        elif standing:
            if self.reaction is Reaction.LOST_DRIVE:
                self.quick_stop()
        elif self._stopping > self._stop_ticks:
            self.fail(Fault.STOP_OVERDUE, -1)

    def _watch_enabling(self, ticks: int) -> None:
        self._waited += ticks
        if self._group.following():
            self._enter(Mode.READY)
        elif self._waited > self._enable_ticks:
            self.fail(Fault.ENABLE_TIMEOUT, self._first_not_following())

    def not_in_position(self) -> int:
        """Index of a drive that is not where motion has led it yet, or -1."""
        drives = self._group.drives
        return next((i for i, drive in enumerate(drives) if not drive.in_position), -1)

    def _first_not_following(self) -> int:
        return next((i for i, drive in enumerate(self._group.drives) if not drive.following), -1)

    def _watch_homing(self, ticks: int) -> None:
        self._waited += ticks
        if self.phase is Phase.SWITCHING_OFF:
            on = self._first_on()
            if on < 0:
                self._enter(Mode.OFF)
            elif self._waited > self._enable_ticks:  # nobody sees it: it started anew, or is silent
                self.fail(Fault.HOMING_FAILED, on)
            return
        busy = -1
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                if drive.homing_error:
                    self.fail(Fault.HOMING_FAILED, i)
                    return
                if not drive.homing_done:
                    busy = i
        if busy >= 0 and self._waited > self._enable_ticks and (off := self._first_off()) >= 0:
            self.fail(Fault.ENABLE_TIMEOUT, off)
        elif busy < 0:
            # OFF only when every drive has switched off: then its mode may be changed by SDO.
            self.homed |= self._homing_mask
            self.untrusted &= ~self._homing_mask
            self._end_homing()
            self.phase, self._waited = Phase.SWITCHING_OFF, 0
        elif self._waited > self._homing_ticks:
            self.fail(Fault.HOMING_FAILED, busy)

    def _first_on(self) -> int:
        """Index of a drive that is in operation, as far as it has been heard, or -1."""
        drives = self._group.drives
        return next((i for i, drive in enumerate(drives) if drive.state == State.OPERATION_ENABLED), -1)

    def _first_off(self) -> int:
        """Index of a drive without torque, or -1."""
        drives = self._group.drives
        return next((i for i, drive in enumerate(drives) if drive.state != State.OPERATION_ENABLED), -1)

    def _end_homing(self) -> None:
        for i, drive in enumerate(self._group.drives):
            if self._homing_mask >> i & 1:
                drive.homing(False)
        self._group.want(Wanted.OFF)


_ACTS = {
    Request.START: Modes._start,
    Request.RESUME: Modes._go_on,
    Request.ENABLE: Modes._enable,
    Request.DISABLE: Modes._disable,
    Request.HOME: Modes._home,
    Request.STOP: Modes._stop,
    Request.HOLD: Modes._halt,
    Request.RESET: Modes._reset,
}
