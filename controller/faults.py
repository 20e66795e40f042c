"""What a fault is made of: its name, what the tick does, what the operator does, what it takes.

The rows themselves are in ``fault_table``, what the operator reads in ``messages``.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Fault(IntEnum):
    """Why the machine stopped by itself, or will not go on."""

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
    TORQUE_OFF = 18
    FOLLOWING_ERROR = 19
    LIMIT_SWITCH = 20
    NODE_RESET = 21
    BUS_OFF = 22
    RX_OVERFLOW = 23
    SYNC_FOREIGN = 24
    IO_LOST = 25
    SPINDLE_LOST = 26
    DOOR_OPEN = 27
    ESTOP_INPUT = 28
    SPINDLE_NOT_AT_SPEED = 29
    POWER_LOST = 30
    CLAMP = 31
    DRIVE_WARNING = 32
    COOLANT_LOST = 33
    CONTROLLER_GONE = 34
    STOP_OVERDUE = 35
    NODE_STOPPED = 36
    NODE_TWICE = 37
    MODE_LOST = 38
    FOREIGN_FRAMES = 39
    SETPOINTS_LOST = 40
    INPUT_MISSING = 41
    SPINDLE_LAGS = 46
    PROBE_OPEN = 42
    PROBE_FREE = 43
    PROBE_HIT = 44
    PROBE_STUCK = 45
    PROBE_LATCH = 47
    SPINDLE_OVERLOADED = 48
    LOAD_UNKNOWN = 49
    SYNC_DOUBLED = 50
    SETPOINTS_EARLY = 51
    NODE_CHATTERS = 52
    BUS_FLOODED = 53
    STOCK_USED_UP = 54
    TICK_LATE = 55
    LOAD_OFF = 56


class Reaction(IntEnum):
    """What the tick does at once when a fault comes while the machine moves; a harder one wins."""

    NONE = 0
    WARN = 1  # it is told, nothing stops
    END_OF_BLOCK = 2  # hold where the block under way ends; resume goes on
    HOLD = 3  # hold on the path at once; resume goes on when the cause is gone
    PATH_STOP = 4  # coordinated: all drives are healthy, slow down on the path, stay enabled
    LOST_DRIVE = 5  # coordinated: quick stop for the lost drive, the others on the path, then for all
    QUICK_STOP = 6  # nothing can be relied on: every drive stops by its own ramp
    DISABLE = 7  # quick stop, and at standstill the drives are switched off (IEC 60204-1, category 1)


class Recovery(IntEnum):
    """The remedy in steps: what must be done before a program may start again."""

    NOTHING = 0
    RESUME = 1
    RESET = 2  # reset, enable
    HOME = 3  # reset, home the axes that lost their mark, enable
    COMMISSION = 4  # reset, commission, home, enable
    RESTART = 5  # start the controller again: commission, home, enable


class Wait(IntEnum):
    """The silence, or the time given, that makes a fault; see ``Times``."""

    NONE = 0
    CONSUMER = 1  # heartbeat or node guarding
    QUEUE = 2  # what is queued comes to its end first; it has no time of its own
    ENABLE = 3
    HOMING = 4
    ANSWER = 5  # of a spindle or a clamp; the machine file's time
    STOP = 6  # a coordinated stop has taken longer than any should


class Times(NamedTuple):
    """What a machine's faults take, in seconds; from its machine file."""

    period_s: float
    consumer_s: float  # silence after which either side takes the other for dead
    enable_s: float
    homing_s: float
    answer_s: float
    path_stop_s: float  # the longest coordinated stop; a longer one is broken off by a quick stop
    quick_stop_s: float  # a drive's own ramp from the axis' largest speed
    feedback_every: int = 1  # SYNCs from one feedback to the next, of the axis that has the fewest


class Words(NamedTuple):
    """A fault in one language, in whole sentences."""

    text: str  # what happened
    cause: str  # where it comes from as a rule
    remedy: str


class FaultRow(NamedTuple):
    """One line of the fault table: what the tick does, and what it costs; the words are English."""

    words: Words
    position_trusted: bool
    reaction: Reaction
    recovery: Recovery
    syncs: int = 2  # from what is seen on the bus to the tick that acts
    wait: Wait = Wait.NONE  # before that

    @property
    def text(self) -> str:
        return self.words.text

    @property
    def cause(self) -> str:
        return self.words.cause

    @property
    def remedy(self) -> str:
        return self.words.remedy
