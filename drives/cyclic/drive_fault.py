"""What can be wrong with drives and bus, as the group tells it, and what an emergency code means."""

from __future__ import annotations

from enum import Enum, auto

from drives.cia402 import FOLLOWING_ERROR, INTERNAL_LIMIT, State


class DriveFault(Enum):
    """Why the group cannot go on: ``drive_fault.NAME`` is its text; the controller has a remedy for each."""

    NONE = auto()
    FEEDBACK_LOST = auto()  # two TPDOs in a row did not come
    STATE_LOST = auto()  # left OPERATION_ENABLED, or stopped following, without being told to
    TORQUE_OFF = auto()  # dropped to SWITCH_ON_DISABLED without a fault: STO or the enable input
    FOLLOWING_ERROR = auto()  # emergency 8611h, or not where it was told to be
    LOAD_OFF = auto()  # the encoder at the load is elsewhere than the motor's
    SETPOINTS_LOST = auto()  # emergency 8250h: the deadline of its RPDO (1400h:05) has passed
    LIMIT_SWITCH = auto()  # emergency 8612h
    EMCY = auto()  # the drive reported any other error; see emcy_code
    HEARTBEAT_LOST = auto()  # silent for consumer_s, or node guarding is not answered
    MODE_LOST = auto()  # its mode of operation (6061h) is no more the one in which setpoints come
    NODE_RESET = auto()  # a boot-up message
    NODE_STOPPED = auto()  # NMT operational left without our doing
    NODE_TWICE = auto()  # two different answers to one SYNC: two nodes have this identifier
    BUS_OFF = auto()  # our controller has left the bus, or was restarted after that
    BUS_ERROR = auto()  # error passive, or our controller's own buffers overflowed
    RX_OVERFLOW = auto()  # frames were lost because we did not take them in time
    FOREIGN_FRAMES = auto()  # somebody else sends setpoints, or the controller's heartbeat
    SYNC_FOREIGN = auto()  # somebody else sends SYNC too
    SYNC_DOUBLED = auto()  # our SYNC reaches the drives twice, or two of them close together
    BUS_FLOODED = auto()  # others are missed because one sender leaves them no room
    SEND_FAILED = auto()  # a frame did not go out: queue full, bus gone, or setpoint no int32
    IO_LOST = auto()  # the input and output node is silent, restarted or in error
    SPINDLE_LOST = auto()  # the spindle's drive is silent, restarted, in error or not enabled


# Error codes of emergency messages that name their cause (CiA 402-1; 8250h, 9000h: CiA 301, "external
# error", the one that drives use for a safe torque off). Every other one is EMCY.
EMERGENCIES: dict[int, DriveFault] = {
    0x8250: DriveFault.SETPOINTS_LOST,
    0x8611: DriveFault.FOLLOWING_ERROR,
    0x8612: DriveFault.LIMIT_SWITCH,
    0x9000: DriveFault.TORQUE_OFF,
}


def of_emergency(code: int) -> DriveFault:
    """What an error code other than 0000h means."""
    return EMERGENCIES.get(code, DriveFault.EMCY)


def of_statusword(state: State, statusword: int) -> DriveFault:
    """Why a drive has left operation by itself, as far as its statusword tells.

    An emergency message tells more and usually came before; here it was lost or inhibited.
    """
    if state is State.SWITCH_ON_DISABLED:
        return DriveFault.TORQUE_OFF
    if state in (State.FAULT, State.FAULT_REACTION_ACTIVE) and statusword & FOLLOWING_ERROR:
        return DriveFault.FOLLOWING_ERROR
    if statusword & INTERNAL_LIMIT and state is not State.OPERATION_ENABLED:
        return DriveFault.LIMIT_SWITCH
    return DriveFault.STATE_LOST
