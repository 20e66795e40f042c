"""Modes, requests and faults of the machine, and the table that says what may follow what.

Rule 1: a request that the table does not list for the present mode changes nothing.
Rule 2: a mode changes by a request only as the table says, by the tick's own progress
        (standstill reached, end of program, drives enabled, homing done) only as PROGRESS
        says, and to FAULT by a fault from anywhere.
Rule 3: the operator's texts stand once, in the fault table (``fault_table``, handed on from here);
        the tick itself only knows the enums.
Rule 4: a fault of the classes "hold" and "end of block" leads to HOLD, not to FAULT.

```
            ENABLE                START               HOLD, M0
     OFF  --------->  READY  --------------> RUNNING <---------> HOLD
     ^ ^    drives       ^   end of program     |       RESUME    |
     | |    follow       +----------------------+ STOP            | STOP
     | |                 ^       standstill     v                 |
     | |                 +----------------- STOPPING <------------+
     | +--- HOME ---> HOMING --- done ---> OFF
     +----- RESET --- FAULT <--- any mode

     READY or HOLD  --- JOG, standing --->  JOG  --- standstill --->  where it came from
```
Homing starts and ends in OFF, because a drive changes its mode of operation disabled: the
slow side selects homing by SDO, asks for HOME, waits for OFF with the axes in ``homed``,
selects cyclic position again, and asks for ENABLE.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum, IntFlag

from controller.commands.command import Command
from controller.commands.table import MAX_AXES, OVERRIDES, SWITCHED, Request
from controller.faults import Fault, FaultRow, Reaction, Recovery, Times, Wait
from controller.messages import Key, Message, chain, message
from controller.state.fault_table import FAULTS, fault_message, sentence, stands_within_s, waits_s

__all__ = [
    "ALL_AXES",
    "ALWAYS",
    "AXIS_KINDS",
    "DROPS",
    "FAULTS",
    "MAX_AXES",
    "OVERRIDES",
    "PROGRESS",
    "SHOWN_MODES",
    "TOOL_CHANGE",
    "TRANSITIONS",
    "Binding",
    "Fault",
    "FaultRow",
    "Mode",
    "Reaction",
    "Recovery",
    "Request",
    "Times",
    "Wait",
    "axis_binding",
    "bars",
    "binding_text",
    "fault_message",
    "follows",
    "possible_in",
    "refusal",
    "sentence",
    "stands_within_s",
    "waits_s",
]


class Mode(IntEnum):
    """What the machine is doing."""

    OFF = 0  # drives not enabled, or just being enabled
    READY = 1  # drives enabled, at rest; pieces may be queued
    RUNNING = 2  # the path clock runs (or waits for pieces)
    HOLD = 3  # the path clock slows or stands; RESUME goes on
    STOPPING = 4  # slowing on the path; the queue is dropped at standstill
    FAULT = 5  # slowing or standing after a fault; RESET leaves
    HOMING = 6  # the drives find their zero; commands follow the actual position
    JOG = 7  # an operator moves the axes by hand


# Of the service: a program runs or holds while its tools are changed, and goes on by itself.
TOOL_CHANGE = "TOOL_CHANGE"
SHOWN_MODES = (*(mode.name for mode in Mode), TOOL_CHANGE)  # that the status can have


class StaysOn(IntFlag):
    """What START says of spindle, coolant and outputs that are on (``Start.stays_on``)."""

    BEFORE = 1  # they go on as they are until the program says otherwise; else it begins with all off
    AFTER = 2  # they go on when the program has come to its end by itself; else all is off then


# (mode, request) -> mode that follows at once. Overrides and switches are allowed in every
# mode and change none; so is the end of a jog, whose key may go up after the jog has ended by
# itself. ESTOP makes a fault and is allowed everywhere; PLAN_LOST makes one where the queue has ended.
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
    (Mode.READY, Request.JOG): Mode.JOG,  # drops what is queued
    (Mode.HOLD, Request.JOG): Mode.JOG,  # only at standstill; RESUME only where it was held
    (Mode.JOG, Request.JOG): Mode.JOG,
    (Mode.JOG, Request.HOLD): Mode.JOG,  # READY or HOLD comes at standstill
    (Mode.JOG, Request.STOP): Mode.JOG,
    (Mode.READY, Request.SPINDLE): Mode.READY,
    (Mode.READY, Request.COOLANT): Mode.READY,
    (Mode.RUNNING, Request.COOLANT): Mode.RUNNING,
    (Mode.HOLD, Request.COOLANT): Mode.HOLD,
    (Mode.READY, Request.CLAMPS): Mode.READY,
    (Mode.RUNNING, Request.PREPARE): Mode.RUNNING,
    (Mode.HOLD, Request.PREPARE): Mode.HOLD,
}

# What is queued is void once one of these is taken, and with the tick's own way to READY. A stop of
# motion drops it at its standstill; a jog out of READY at once.
DROPS = frozenset(
    {
        (Mode.READY, Request.STOP),
        (Mode.READY, Request.DISABLE),
        (Mode.OFF, Request.DISABLE),
        (Mode.HOMING, Request.STOP),
        (Mode.FAULT, Request.RESET),
    }
)

# What the tick's own progress may do to the mode.
PROGRESS: dict[Mode, frozenset[Mode]] = {
    Mode.OFF: frozenset({Mode.READY, Mode.FAULT}),
    Mode.READY: frozenset({Mode.FAULT}),
    Mode.RUNNING: frozenset({Mode.READY, Mode.HOLD, Mode.FAULT}),
    Mode.HOLD: frozenset({Mode.FAULT}),
    Mode.STOPPING: frozenset({Mode.READY, Mode.FAULT}),
    Mode.FAULT: frozenset(),
    Mode.HOMING: frozenset({Mode.OFF, Mode.FAULT}),
    Mode.JOG: frozenset({Mode.READY, Mode.HOLD, Mode.FAULT}),
}

ALWAYS = frozenset(
    {
        *OVERRIDES,
        *SWITCHED,
        Request.ESTOP,
        Request.JOG_STOP,
        Request.ARRANGED,
        Request.PLAN_LOST,
    }
)


def follows(mode: Mode, request: Request) -> Mode | None:
    """The mode after ``request``, or None where the request is refused in ``mode``."""
    if request in ALWAYS:
        return mode
    return TRANSITIONS.get((mode, request))


def possible_in(command: Command) -> tuple[Mode, ...] | None:
    """The modes in which a command is possible; None: every one."""
    asked = command.request
    if asked in ALWAYS or (asked is None and not command.modes):
        return None
    by_table = {mode for mode, request in TRANSITIONS if request is asked}
    return tuple([mode for mode in Mode if mode in by_table or mode.name in command.modes])


MOVES = (
    *(Request.START, Request.RESUME, Request.HOME, Request.ENABLE, Request.JOG, Request.SPINDLE),
    Request.PREPARE,
)
BY_HAND = frozenset({Request.SPINDLE, Request.COOLANT, Request.CLAMPS, Request.PREPARE})  # of peripherals
ALL_AXES = (1 << MAX_AXES) - 1


def bars(interlock: Fault, request: Request) -> bool:
    """Whether an open door (then drives may still hold their axes), an e-stop ... forbids a request."""
    if interlock is Fault.NONE or request not in MOVES:
        return False
    return request is not Request.ENABLE or FAULTS[interlock].reaction >= Reaction.QUICK_STOP


_NOTHING_TO = (Request.HOLD, Request.RESUME, Request.STOP, Request.RESET, Request.ENABLE)


def refusal(
    mode: Mode,
    request: Request,
    *,
    standing: bool = True,
    homed: int = ALL_AXES,
    untrusted: int = 0,
    interlock: Fault = Fault.NONE,
    away: bool = False,
    axes: Sequence[str] = (),
) -> Message | None:
    """Why ``request`` is refused: mode, request, reason and what to do, in one sentence; None if it is not.

    ``homed`` and ``untrusted`` are bit masks of the axes, whose names are ``axes``; ``away``: the tool has
    been jogged off the place of the hold.
    """
    if request in ALWAYS:
        return None
    if (mode, request) not in TRANSITIONS:
        why = _where_then(mode, request)
    elif condition := _condition(mode, request, standing, away):
        why = message(condition)
    elif bars(interlock, request):
        why = fault_message(interlock)
    elif request is Request.START and (missing := untrusted | (_every(axes) & ~homed)):
        names = ", ".join(name for i, name in enumerate(axes) if missing >> i & 1)
        why = message("not_homed", axes=names or Key("some_axes"))
    else:
        return None
    return message("refused", request=request.name, mode=mode.name, why=why)


def _every(axes: Sequence[str]) -> int:
    """Bit mask of all axes of a machine; of all that there can be where nobody has named them."""
    return (1 << len(axes)) - 1 if axes else ALL_AXES


def _where_then(mode: Mode, request: Request) -> Message:
    """What the mode is, what to do, and the modes that know the request."""
    nothing = request in _NOTHING_TO and (
        request is not Request.ENABLE or mode not in (Mode.FAULT, Mode.HOMING)
    )
    return message(
        "known",
        now=Key(f"now.{mode.name}"),
        way_out=Key(f"nothing_to.{request.name}" if nothing else f"way_out.{mode.name}"),
        request=request.name,
        modes=chain("or", [m.name for m, r in TRANSITIONS if r is request]),
    )


def _condition(mode: Mode, request: Request, standing: bool, away: bool) -> str:
    """What besides the mode and the doors forbids it: its key in the catalogue's refusals."""
    if request is Request.RESUME and away:
        return "away"
    if not standing and (request is Request.RESET or (request is Request.JOG and mode is not Mode.JOG)):
        return "moves"
    return ""


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
