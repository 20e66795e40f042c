"""Modes, requests and faults of the machine, and the table that says what may follow what.

Rule 1: a request that the table does not list for the present mode changes nothing.
Rule 2: a mode changes by a request only as the table says, by the tick's own progress
        (standstill reached, end of program, drives enabled, homing done) only as PROGRESS
        says, and to FAULT by a fault from anywhere.
Rule 3: the operator's texts stand here once; the tick itself only knows the enums.

```
            ENABLE                START               HOLD, M0
     OFF  --------->  READY  --------------> RUNNING <---------> HOLD
     ^ ^    drives       ^   end of program     |       RESUME    |
     | |    follow       +----------------------+ STOP            | STOP
     | |                 ^       standstill     v                 |
     | |                 +----------------- STOPPING <------------+
     | +--- HOME ---> HOMING --- done ---> OFF
     +----- RESET --- FAULT <--- any mode
```
Homing starts and ends in OFF, because a drive changes its mode of operation disabled: the
slow side selects homing by SDO, asks for HOME, waits for OFF with the axes in ``homed``,
selects cyclic position again, and asks for ENABLE.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple


class Mode(IntEnum):
    """What the machine is doing."""

    OFF = 0  # drives not enabled, or just being enabled
    READY = 1  # drives enabled, at rest; pieces may be queued
    RUNNING = 2  # the path clock runs (or waits for pieces)
    HOLD = 3  # the path clock slows or stands; RESUME goes on
    STOPPING = 4  # slowing on the path; the queue is dropped at standstill
    FAULT = 5  # slowing or standing after a fault; RESET leaves
    HOMING = 6  # the drives find their zero; commands follow the actual position


class Request(IntEnum):
    """What an operator (or the plan) asks for; the value of a datagram's first byte."""

    START = 1
    HOLD = 2
    RESUME = 3
    STOP = 4
    OVERRIDE = 5  # value: share of F, 1.0 = 100 %
    RAPID_OVERRIDE = 6  # value: share of the rapid speed
    ENABLE = 7
    DISABLE = 8
    HOME = 9  # value: bit mask of the axes, bit i = i-th [[axis]]
    RESET = 10
    ESTOP = 11
    SINGLE_BLOCK = 12  # value: 1 = stop at the end of each block, 0 = run through
    OPTIONAL_STOP = 13  # value: 1 = M1 stops, 0 = it does not


# (mode, request) -> mode that follows at once. Overrides and switches are allowed
# in every mode and change none; ESTOP makes a fault and is allowed everywhere.
TRANSITIONS: dict[tuple[Mode, Request], Mode] = {
    (Mode.OFF, Request.ENABLE): Mode.OFF,  # READY comes when all drives follow
    (Mode.OFF, Request.DISABLE): Mode.OFF,
    (Mode.OFF, Request.HOME): Mode.HOMING,
    (Mode.READY, Request.DISABLE): Mode.OFF,
    (Mode.READY, Request.START): Mode.RUNNING,
    (Mode.READY, Request.STOP): Mode.READY,  # drops what is queued
    (Mode.RUNNING, Request.HOLD): Mode.HOLD,
    (Mode.RUNNING, Request.STOP): Mode.STOPPING,
    (Mode.HOLD, Request.RESUME): Mode.RUNNING,
    (Mode.HOLD, Request.STOP): Mode.STOPPING,
    (Mode.HOMING, Request.STOP): Mode.OFF,  # homing given up: the drives are disabled
    (Mode.FAULT, Request.RESET): Mode.OFF,  # only at standstill; the drives are reset
}

# What the tick's own progress may do to the mode.
PROGRESS: dict[Mode, frozenset[Mode]] = {
    Mode.OFF: frozenset({Mode.READY, Mode.FAULT}),
    Mode.READY: frozenset({Mode.FAULT}),
    Mode.RUNNING: frozenset({Mode.READY, Mode.HOLD, Mode.FAULT}),
    Mode.HOLD: frozenset({Mode.FAULT}),
    Mode.STOPPING: frozenset({Mode.READY, Mode.FAULT}),
    Mode.FAULT: frozenset(),
    Mode.HOMING: frozenset({Mode.OFF, Mode.FAULT}),
}

ALWAYS = frozenset(
    {
        Request.OVERRIDE,
        Request.RAPID_OVERRIDE,
        Request.ESTOP,
        Request.SINGLE_BLOCK,
        Request.OPTIONAL_STOP,
    }
)


def follows(mode: Mode, request: Request) -> Mode | None:
    """The mode after ``request``, or None where the request is refused in ``mode``."""
    if request in ALWAYS:
        return mode
    return TRANSITIONS.get((mode, request))


class Binding(IntEnum):
    """What holds the speed down at a place; the limits of axis i follow from ``AXIS`` on."""

    NOTHING = 0  # a ramp, or a standstill
    FEED = 1
    CORNER = 2
    TIP_ACCELERATION = 3
    AXIS_ANGULAR_SPEED = 4
    AXIS = 10  # + 3 * axis + 0, 1, 2: velocity, acceleration, jerk


AXIS_KINDS = ("velocity", "acceleration", "jerk")
_BINDINGS = ("nothing", "feed", "corner", "tip acceleration", "angular speed of the tool axis")


def axis_binding(axis: int, order: int) -> int:
    """The code of an axis' velocity (order 0), acceleration (1) or jerk (2)."""
    return Binding.AXIS + 3 * axis + order


def binding_text(code: int, axes: Sequence[str]) -> str:
    """A code in words, for instance 'C acceleration'; ``axes`` are the names in the joints' order."""
    if code < Binding.AXIS:
        return _BINDINGS[code]
    axis, order = divmod(code - Binding.AXIS, 3)
    return f"{axes[axis]} {AXIS_KINDS[order]}"


class Fault(IntEnum):
    """Why the machine stopped by itself."""

    NONE = 0
    PLANNER_GONE = 1
    FEEDBACK_LOST = 2
    STATE_LOST = 3
    EMCY = 4
    HEARTBEAT_LOST = 5
    BUS_ERROR = 6
    SEND_FAILED = 7
    TRAVEL = 8
    VELOCITY = 9
    ACCELERATION = 10
    BRANCH_LOST = 11
    TOO_MANY_SKIPS = 12
    EMERGENCY_STOP = 13
    ENABLE_TIMEOUT = 14
    HOMING_FAILED = 15
    SYNC_LOST = 16
    INTERNAL = 17


class Reaction(IntEnum):
    """What the tick does at once when a fault comes while the machine moves."""

    NONE = 0
    PATH_STOP = 1  # all drives are healthy: slow down on the path, stay enabled
    LOST_DRIVE = 2  # quick stop for the lost drive, the others slow on the path, then quick stop for all
    QUICK_STOP = 3  # nothing can be relied on: every drive stops by its own ramp


class FaultRow(NamedTuple):
    """One line of the fault table: for the operator, and what the tick does."""

    text: str
    position_trusted: bool
    remedy: str
    reaction: Reaction


FAULTS: dict[Fault, FaultRow] = {
    Fault.NONE: FaultRow("No fault.", True, "Nothing to do.", Reaction.NONE),
    Fault.PLANNER_GONE: FaultRow(
        "The planner has been silent for more than 100 ms; the tool stopped on the path (planner gone).",
        True,
        "Reset, retract along the tool axis, load the program again.",
        Reaction.PATH_STOP,
    ),
    Fault.FEEDBACK_LOST: FaultRow(
        "A drive did not report its position twice in a row.",
        False,
        "Check cable, termination and bus load; reset; home the axis if its drive lost power.",
        Reaction.LOST_DRIVE,
    ),
    Fault.STATE_LOST: FaultRow(
        "A drive left the state Operation Enabled by itself.",
        False,
        "Read the drive's error code, remove the cause, reset; home the axis if its drive lost power.",
        Reaction.LOST_DRIVE,
    ),
    Fault.EMCY: FaultRow(
        "A drive sent an emergency message.",
        False,
        "Look up the emergency code of the drive, remove the cause, reset.",
        Reaction.LOST_DRIVE,
    ),
    Fault.HEARTBEAT_LOST: FaultRow(
        "A drive's heartbeat stopped.",
        False,
        "Check the drive's supply and cable; commission again; home the axis.",
        Reaction.LOST_DRIVE,
    ),
    Fault.BUS_ERROR: FaultRow(
        "The CAN bus reported an error (bus off, error passive, or the hub is gone).",
        False,
        "Check wiring, termination and bit rate; start again and home.",
        Reaction.QUICK_STOP,
    ),
    Fault.SEND_FAILED: FaultRow(
        "A frame could not be sent: the transmit queue is full or the bus is gone.",
        False,
        "Check the bus and its load; start again and home.",
        Reaction.QUICK_STOP,
    ),
    Fault.TRAVEL: FaultRow(
        "The next setpoint lies outside the travel of an axis; it was not sent.",
        True,
        "Check work offset and tool length, then check the program.",
        Reaction.PATH_STOP,
    ),
    Fault.VELOCITY: FaultRow(
        "The next setpoint asks an axis for more than its velocity; it was not sent.",
        True,
        "Check the program; report this with the recording, for the plan should have slowed down.",
        Reaction.PATH_STOP,
    ),
    Fault.ACCELERATION: FaultRow(
        "The next setpoint asks an axis for more than its acceleration; it was not sent.",
        True,
        "Check the program; report this with the recording, for the plan should have slowed down.",
        Reaction.PATH_STOP,
    ),
    Fault.BRANCH_LOST: FaultRow(
        "The rotary axes cannot reach the next tool axis; nothing was sent.",
        True,
        "Check the program; report this with the recording.",
        Reaction.PATH_STOP,
    ),
    Fault.TOO_MANY_SKIPS: FaultRow(
        "Too many ticks came too late; the tool stopped on the path.",
        True,
        "Take load off the computer or use a longer period; reset and go on.",
        Reaction.PATH_STOP,
    ),
    Fault.EMERGENCY_STOP: FaultRow(
        "Emergency stop was requested.",
        False,
        "Make the machine safe, reset, enable, check the position.",
        Reaction.QUICK_STOP,
    ),
    Fault.ENABLE_TIMEOUT: FaultRow(
        "A drive did not reach Operation Enabled in time.",
        True,
        "Check the drive's supply, its enable input and its error code; reset and enable again.",
        Reaction.QUICK_STOP,
    ),
    Fault.HOMING_FAILED: FaultRow(
        "A drive reported a homing error or did not finish homing.",
        False,
        "Check the reference switch and the homing method; reset and home again.",
        Reaction.QUICK_STOP,
    ),
    Fault.SYNC_LOST: FaultRow(
        "The kernel's SYNC did not come back in time.",
        False,
        "Check the bus; set sync to tick in the machine file; start again.",
        Reaction.QUICK_STOP,
    ),
    Fault.INTERNAL: FaultRow(
        "The tick met an error of its own and stopped the drives.",
        False,
        "Report this with the recording; start again and home.",
        Reaction.QUICK_STOP,
    ),
}
