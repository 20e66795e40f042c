"""The drive profile's state machine as two tables: what a drive says, what to answer.

Rules (CiA 402-2, "Power drive system state machine"):
1. The statusword alone says where a drive is; nothing is inferred from elapsed time.
2. One received statusword earns one step. The answer depends on nothing but the
   state and the wish, so that a lost or repeated frame changes nothing.
3. A fault is left only by a rising edge of controlword bit 7, one edge per request.
   Enabling never resets a fault on its way.
"""

from __future__ import annotations

from enum import Enum, IntEnum


class State(IntEnum):
    """Where a drive's power stage stands."""

    UNKNOWN = 0  # no statusword yet, or a bit pattern the profile does not define
    NOT_READY_TO_SWITCH_ON = 1
    SWITCH_ON_DISABLED = 2
    READY_TO_SWITCH_ON = 3
    SWITCHED_ON = 4
    OPERATION_ENABLED = 5
    QUICK_STOP_ACTIVE = 6
    FAULT_REACTION_ACTIVE = 7
    FAULT = 8


class Wanted(Enum):
    """What the controller wants of a drive."""

    OFF = "off"
    ENABLED = "enabled"
    QUICK_STOP = "quick stop"
    RESET = "reset"


# Statusword bits, CiA 402-2 object 6041h.
WARNING = 1 << 7
TARGET_REACHED = 1 << 10  # in QUICK_STOP_ACTIVE: the drive stands
INTERNAL_LIMIT = 1 << 11
FOLLOWS_COMMAND = 1 << 12  # cyclic synchronous position: the target is used; mode 7: interpolation is active
HOMING_ATTAINED = 1 << 12  # the same bit, in homing mode
FOLLOWING_ERROR = 1 << 13
HOMING_ERROR = 1 << 13

HOMING = 6  # mode of operation, objects 6060h and 6061h

# Controlwords, object 6040h.
DISABLE_VOLTAGE = 0x00
QUICK_STOP = 0x02
SHUTDOWN = 0x06
SWITCH_ON = 0x07  # from SWITCHED_ON upward; "disable operation" from above
ENABLE_OPERATION = 0x0F
START_HOMING = 1 << 4
ENABLE_INTERPOLATION = 1 << 4  # the same bit, in interpolated position mode
FAULT_RESET = 1 << 7

STATUSWORDS: tuple[tuple[int, int, State], ...] = (
    (0x4F, 0x00, State.NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY_TO_SWITCH_ON),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.OPERATION_ENABLED),
    (0x6F, 0x07, State.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, State.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, State.FAULT),
)

# A drive in QUICK_STOP_ACTIVE is told "quick stop" whatever is wanted, because
# "disable voltage" would let a moving axis coast: see `controlword`.
# OFF steps down through "disable operation", which ramps down and sets the brake
# (605Ch) before the voltage goes, so that a gravity axis does not drop.
CONTROLWORDS: dict[Wanted, dict[State, int]] = {
    Wanted.OFF: {
        State.UNKNOWN: DISABLE_VOLTAGE,
        State.NOT_READY_TO_SWITCH_ON: DISABLE_VOLTAGE,
        State.SWITCH_ON_DISABLED: DISABLE_VOLTAGE,
        State.READY_TO_SWITCH_ON: DISABLE_VOLTAGE,
        State.SWITCHED_ON: SHUTDOWN,
        State.OPERATION_ENABLED: SWITCH_ON,
        State.QUICK_STOP_ACTIVE: QUICK_STOP,
        State.FAULT_REACTION_ACTIVE: DISABLE_VOLTAGE,
        State.FAULT: DISABLE_VOLTAGE,
    },
    Wanted.ENABLED: {
        State.UNKNOWN: DISABLE_VOLTAGE,
        State.NOT_READY_TO_SWITCH_ON: DISABLE_VOLTAGE,
        State.SWITCH_ON_DISABLED: SHUTDOWN,
        State.READY_TO_SWITCH_ON: SWITCH_ON,
        State.SWITCHED_ON: ENABLE_OPERATION,
        State.OPERATION_ENABLED: ENABLE_OPERATION,
        State.QUICK_STOP_ACTIVE: QUICK_STOP,
        State.FAULT_REACTION_ACTIVE: DISABLE_VOLTAGE,
        State.FAULT: DISABLE_VOLTAGE,
    },
    Wanted.QUICK_STOP: dict.fromkeys(State, QUICK_STOP),
}
# A reset is OFF with an edge of bit 7 for those that are in FAULT; drive.py makes the edge.
CONTROLWORDS[Wanted.RESET] = CONTROLWORDS[Wanted.OFF] | {State.FAULT: FAULT_RESET}


def _decode(statusword: int) -> State:
    """The state by the profile's masks, the first row that fits."""
    return next((s for mask, value, s in STATUSWORDS if statusword & mask == value), State.UNKNOWN)


# The state lies in the lower seven bits: 128 answers, looked up in the tick.
_STATES: tuple[State, ...] = tuple(_decode(low) for low in range(128))


def state(statusword: int) -> State:
    """The state a statusword reports."""
    return _STATES[statusword & 0x7F]


def controlword(statusword: int, wanted: Wanted, braked: bool = False) -> int:
    """The one step that a statusword earns on the way to what is wanted.

    ``braked``: an axis that falls without current. Quick-stop options 5 .. 8 of 605Ah stay
    in QUICK_STOP_ACTIVE, with current, until told to leave. "Disable voltage" takes the
    current while the brake is still closing, so a braked axis goes back to operation first
    (transition 16) and leaves it by "disable operation", which waits for the brake.
    """
    now = _STATES[statusword & 0x7F]
    if now is State.QUICK_STOP_ACTIVE and statusword & TARGET_REACHED and wanted is not Wanted.QUICK_STOP:
        return ENABLE_OPERATION if braked else DISABLE_VOLTAGE
    return CONTROLWORDS[wanted][now]
