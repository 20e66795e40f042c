"""The CiA 402 state machine as the device sees it: two tables.

(CiA 402-2, figure "power drive system finite state automaton" and the table of
controlword commands; the transition numbers are the standard's.) Transitions 0, 1, 13
and 14 happen by themselves: power-on, initialised, error, fault reaction done.
"""

from __future__ import annotations

from enum import Enum, auto


class Power(Enum):
    """States; the value is the statusword's part that names the state."""

    NOT_READY = 0x00
    DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


class Command(Enum):
    """What a controlword asks for."""

    DISABLE_VOLTAGE = auto()
    QUICK_STOP = auto()
    SHUTDOWN = auto()
    SWITCH_ON = auto()  # in ENABLED the same bits mean "disable operation"
    ENABLE = auto()
    RESET = auto()


# (mask, value) of controlword bits 3..0 without the reset bit, first match counts.
COMMANDS: tuple[tuple[int, int, Command], ...] = (
    (0x02, 0x00, Command.DISABLE_VOLTAGE),
    (0x06, 0x02, Command.QUICK_STOP),
    (0x07, 0x06, Command.SHUTDOWN),
    (0x0F, 0x07, Command.SWITCH_ON),
    (0x0F, 0x0F, Command.ENABLE),
)

TRANSITIONS: dict[tuple[Power, Command], Power] = {
    (Power.DISABLED, Command.SHUTDOWN): Power.READY,  # 2
    (Power.READY, Command.SWITCH_ON): Power.SWITCHED_ON,  # 3
    (Power.READY, Command.ENABLE): Power.SWITCHED_ON,  # 3, then 4 by itself
    (Power.SWITCHED_ON, Command.ENABLE): Power.ENABLED,  # 4
    (Power.ENABLED, Command.SWITCH_ON): Power.SWITCHED_ON,  # 5
    (Power.SWITCHED_ON, Command.SHUTDOWN): Power.READY,  # 6
    (Power.READY, Command.DISABLE_VOLTAGE): Power.DISABLED,  # 7
    (Power.READY, Command.QUICK_STOP): Power.DISABLED,  # 7
    (Power.ENABLED, Command.SHUTDOWN): Power.READY,  # 8
    (Power.ENABLED, Command.DISABLE_VOLTAGE): Power.DISABLED,  # 9
    (Power.SWITCHED_ON, Command.DISABLE_VOLTAGE): Power.DISABLED,  # 10
    (Power.SWITCHED_ON, Command.QUICK_STOP): Power.DISABLED,  # 10
    (Power.ENABLED, Command.QUICK_STOP): Power.QUICK_STOP,  # 11
    (Power.QUICK_STOP, Command.DISABLE_VOLTAGE): Power.DISABLED,  # 12
    (Power.FAULT, Command.RESET): Power.DISABLED,  # 15
    (Power.QUICK_STOP, Command.ENABLE): Power.ENABLED,  # 16, with 605Ah = 5 .. 8 only
}

# The motor carries current in these.
POWERED = frozenset({Power.ENABLED, Power.QUICK_STOP, Power.FAULT_REACTION})


def command(controlword: int, before: int) -> Command | None:
    """The command of a controlword; reset counts on its rising edge only."""
    if controlword & 0x80:
        return Command.RESET if not before & 0x80 else None
    return next((what for mask, value, what in COMMANDS if controlword & mask == value), None)


def following(state: Power, asked: Command) -> Power | None:
    """The state a command leads to, or None where the standard draws no transition."""
    return TRANSITIONS.get((state, asked))
