"""Every fault of drive, bus, tick and plan: what it is, what the tick does, what the operator does.

Position is trusted where every drive has kept count and has been in sight of the
controller all the time. Otherwise the axes concerned lose their homed mark, and no
program starts before they are homed again.

The time in which a machine stands is a sum, and the fault matrix measures it:

```
   event ------> noticed ----------> the path slows to rest -----> standstill
         SYNCs, or    at the next    (or every drive's own ramp,
         a silence    tick           or the drive's supervision first)
```
"""

from __future__ import annotations

from typing import NamedTuple

from controller import messages
from controller.faults import Fault, FaultRow, Reaction, Recovery, Times, Wait, Words
from controller.messages import DEFAULT, LANGUAGES, Key, Message, message, several
from drives import pdo


def words(fault: Fault, language: str = DEFAULT) -> Words:
    """What happened, where that usually comes from, what to do."""
    return Words(
        *(LANGUAGES[language].texts[f"{part}.{fault.name}"] for part in ("fault", "cause", "remedy"))
    )


def _row(
    fault: Fault,
    position_trusted: bool,
    reaction: Reaction,
    recovery: Recovery,
    syncs: int = 2,
    wait: Wait = Wait.NONE,
) -> tuple[Fault, FaultRow]:
    return fault, FaultRow(words(fault), position_trusted, reaction, recovery, syncs, wait)


_ROWS = (
    _row(Fault.NONE, True, Reaction.NONE, Recovery.NOTHING),
    # --- plan
    _row(Fault.PLANNER_GONE, True, Reaction.PATH_STOP, Recovery.RESET, wait=Wait.QUEUE),
    _row(Fault.TRAVEL, True, Reaction.PATH_STOP, Recovery.RESET),
    _row(Fault.VELOCITY, True, Reaction.PATH_STOP, Recovery.RESET),
    _row(Fault.ACCELERATION, True, Reaction.PATH_STOP, Recovery.RESET),
    _row(Fault.BRANCH_LOST, True, Reaction.PATH_STOP, Recovery.RESET),
    # --- drives
    _row(Fault.FEEDBACK_LOST, False, Reaction.LOST_DRIVE, Recovery.COMMISSION, syncs=4),
    _row(Fault.STATE_LOST, False, Reaction.LOST_DRIVE, Recovery.HOME, syncs=3),
    _row(Fault.TORQUE_OFF, True, Reaction.LOST_DRIVE, Recovery.RESET, syncs=3),
    # Three SYNCs until a position answers a setpoint, and some in a row that are beyond the window.
    _row(Fault.FOLLOWING_ERROR, False, Reaction.LOST_DRIVE, Recovery.HOME, syncs=7),
    # One more until it is told, and some in a row that are beyond what is allowed.
    _row(Fault.LOAD_OFF, False, Reaction.LOST_DRIVE, Recovery.HOME, syncs=7),
    _row(Fault.SETPOINTS_LOST, True, Reaction.LOST_DRIVE, Recovery.RESET, syncs=3, wait=Wait.CONSUMER),
    _row(Fault.LIMIT_SWITCH, False, Reaction.LOST_DRIVE, Recovery.HOME, syncs=3),
    _row(Fault.EMCY, False, Reaction.LOST_DRIVE, Recovery.HOME, syncs=3),
    _row(Fault.DRIVE_WARNING, True, Reaction.WARN, Recovery.NOTHING),
    _row(Fault.HEARTBEAT_LOST, False, Reaction.LOST_DRIVE, Recovery.COMMISSION, wait=Wait.CONSUMER),
    # A drive that starts is silent: its boot-up message comes at the end.
    _row(Fault.NODE_RESET, False, Reaction.LOST_DRIVE, Recovery.COMMISSION, syncs=3, wait=Wait.CONSUMER),
    _row(Fault.NODE_STOPPED, False, Reaction.LOST_DRIVE, Recovery.COMMISSION, syncs=3, wait=Wait.CONSUMER),
    _row(Fault.NODE_TWICE, False, Reaction.QUICK_STOP, Recovery.COMMISSION, syncs=5),
    _row(Fault.MODE_LOST, True, Reaction.LOST_DRIVE, Recovery.COMMISSION, syncs=3, wait=Wait.CONSUMER),
    _row(Fault.ENABLE_TIMEOUT, True, Reaction.QUICK_STOP, Recovery.RESET, wait=Wait.ENABLE),
    _row(Fault.HOMING_FAILED, False, Reaction.QUICK_STOP, Recovery.HOME, wait=Wait.HOMING),
    # --- bus
    # The drives hear nothing and stop by their own supervision.
    _row(Fault.BUS_OFF, False, Reaction.QUICK_STOP, Recovery.COMMISSION, wait=Wait.CONSUMER),
    _row(Fault.BUS_ERROR, False, Reaction.QUICK_STOP, Recovery.COMMISSION, wait=Wait.CONSUMER),
    _row(Fault.RX_OVERFLOW, True, Reaction.PATH_STOP, Recovery.RESET),
    _row(Fault.SYNC_FOREIGN, True, Reaction.QUICK_STOP, Recovery.RESET),
    # So many of them in a row, and two until their answers are there.
    _row(Fault.SYNC_DOUBLED, True, Reaction.PATH_STOP, Recovery.RESET, syncs=12),
    _row(Fault.SETPOINTS_EARLY, True, Reaction.WARN, Recovery.NOTHING),
    _row(Fault.NODE_CHATTERS, True, Reaction.WARN, Recovery.NOTHING),
    # Nothing gets through to the drives, they stop by their own supervision.
    _row(Fault.BUS_FLOODED, False, Reaction.QUICK_STOP, Recovery.COMMISSION, syncs=4, wait=Wait.CONSUMER),
    # A drive obeys the stranger, too: one setpoint of his and it is on its way at full speed, maybe back.
    # The stop begins from there, with his last frame.
    _row(Fault.FOREIGN_FRAMES, True, Reaction.QUICK_STOP, Recovery.RESET, wait=Wait.CONSUMER),
    _row(Fault.SEND_FAILED, False, Reaction.QUICK_STOP, Recovery.COMMISSION, wait=Wait.CONSUMER),
    _row(Fault.SYNC_LOST, False, Reaction.QUICK_STOP, Recovery.RESTART, syncs=4, wait=Wait.CONSUMER),
    # --- tick
    _row(Fault.TOO_MANY_SKIPS, True, Reaction.PATH_STOP, Recovery.RESET),
    # On the path the axes stand by then: the stop is a part of the stock.
    _row(Fault.STOCK_USED_UP, True, Reaction.QUICK_STOP, Recovery.RESET),
    _row(Fault.TICK_LATE, True, Reaction.WARN, Recovery.NOTHING),
    _row(Fault.STOP_OVERDUE, True, Reaction.QUICK_STOP, Recovery.RESET, wait=Wait.STOP),
    _row(Fault.INTERNAL, False, Reaction.QUICK_STOP, Recovery.RESTART),
    _row(Fault.CONTROLLER_GONE, False, Reaction.QUICK_STOP, Recovery.RESTART, wait=Wait.CONSUMER),
    # --- operator, safety, peripherals
    _row(Fault.EMERGENCY_STOP, True, Reaction.QUICK_STOP, Recovery.RESET),
    _row(Fault.ESTOP_INPUT, True, Reaction.DISABLE, Recovery.RESET),
    _row(Fault.POWER_LOST, False, Reaction.DISABLE, Recovery.COMMISSION),
    _row(Fault.DOOR_OPEN, True, Reaction.HOLD, Recovery.RESUME),
    _row(Fault.SPINDLE_NOT_AT_SPEED, True, Reaction.HOLD, Recovery.RESUME, wait=Wait.ANSWER),
    _row(Fault.SPINDLE_LAGS, True, Reaction.HOLD, Recovery.RESUME, wait=Wait.ANSWER),
    _row(Fault.SPINDLE_OVERLOADED, True, Reaction.HOLD, Recovery.RESUME, wait=Wait.ANSWER),
    _row(Fault.LOAD_UNKNOWN, True, Reaction.WARN, Recovery.NOTHING),
    _row(Fault.SPINDLE_LOST, True, Reaction.PATH_STOP, Recovery.RESET, wait=Wait.CONSUMER),
    _row(Fault.CLAMP, True, Reaction.PATH_STOP, Recovery.RESET, wait=Wait.ANSWER),
    _row(Fault.COOLANT_LOST, True, Reaction.END_OF_BLOCK, Recovery.RESUME),
    _row(Fault.INPUT_MISSING, True, Reaction.HOLD, Recovery.RESUME),
    _row(Fault.PROBE_OPEN, True, Reaction.HOLD, Recovery.RESUME),
    _row(Fault.PROBE_FREE, True, Reaction.HOLD, Recovery.RESUME),
    _row(Fault.PROBE_HIT, True, Reaction.PATH_STOP, Recovery.RESET),
    _row(Fault.PROBE_STUCK, True, Reaction.PATH_STOP, Recovery.RESET),
    _row(Fault.PROBE_LATCH, True, Reaction.PATH_STOP, Recovery.RESET),
    _row(Fault.IO_LOST, True, Reaction.PATH_STOP, Recovery.RESET, wait=Wait.CONSUMER),
)
FAULTS: dict[Fault, FaultRow] = dict(_ROWS)
FRAMES = {  # by function code (CiA 301), what they are called
    pdo.EMCY: "emcy",
    pdo.HEARTBEAT: "heartbeat",
    pdo.SDO_ANSWER: "sdo",
    pdo.SDO_QUESTION: "sdo",
    **{pdo.TPDO1 + pdo.NEXT_PDO * n: "tpdo" for n in range(4)},
    **{pdo.RPDO1 + pdo.NEXT_PDO * n: "rpdo" for n in range(4)},
    0x100: "other",  # function codes that CANopen leaves to nobody
    0x680: "other",
}
IDENTIFIER = 0x1FFF_FFFF  # without Linux' flags
OF_FRAMES = (Fault.NODE_CHATTERS, Fault.BUS_FLOODED)  # about frames of an identifier


class Sender(NamedTuple):
    """Of frames that are too many: their identifier (-1: there are none), and how many come a second."""

    can_id: int = -1
    per_s: float = 0.0

    def message(self) -> Message:
        """Whose frames they are, which ones, and how many a second."""
        shown, per_s = f"{self.can_id & IDENTIFIER:03X}", round(self.per_s)
        if not (node := pdo.node_of(self.can_id)):
            return message("frames.of_nobody", can_id=shown, per_s=per_s)
        what = Key(f"frames.{FRAMES[pdo.group(self.can_id)]}")
        return message("frames.of_node", node=node, what=what, can_id=shown, per_s=per_s)


NOBODY = Sender()


def fault_message(fault: Fault, axis: str = "", also: Fault = Fault.NONE, sender: Sender = NOBODY) -> Message:
    """Text and remedy for the operator, with the axis or the sender concerned and what came on top."""
    text, remedy = message(f"fault.{fault.name}"), message(f"remedy.{fault.name}")
    first = message("of_axis", axis=axis, text=text) if axis else text
    if fault in OF_FRAMES and sender.can_id >= 0:
        first = several(sender.message(), text)
    if also in (Fault.NONE, fault) or (fault is Fault.BUS_FLOODED and also in OF_FRAMES):
        return several(first, remedy)
    more = message("also", text=Key(f"fault.{also.name}"), remedy=Key(f"remedy.{also.name}"))
    return several(first, remedy, more)


def sentence(
    fault: Fault,
    axis: str = "",
    also: Fault = Fault.NONE,
    language: str = DEFAULT,
    sender: Sender = NOBODY,
) -> str:
    """The same in words. Raises ValueError where the catalogue has no such language."""
    return messages.text(fault_message(fault, axis, also, sender), language)


def stands_within_s(fault: Fault, times: Times) -> float:
    """Longest time from the event to the standstill of all axes that have torque, s; 0 if nothing stops.

    A machine that stands already stands. END_OF_BLOCK promises the block's own time, so 0 too. Where the
    queue comes to its end first, that is the event.
    """
    row = FAULTS[fault]
    if row.reaction in (Reaction.NONE, Reaction.WARN, Reaction.END_OF_BLOCK):
        return 0.0
    noticed_s = row.syncs * times.feedback_every * times.period_s + waits_s(row.wait, times)
    return noticed_s + _stopping_s(row.reaction, times)


def waits_s(wait: Wait, times: Times) -> float:
    """The seconds of a wait on a machine."""
    return {
        Wait.NONE: 0.0,
        Wait.CONSUMER: times.consumer_s,
        Wait.QUEUE: 0.0,
        Wait.ENABLE: times.enable_s,
        Wait.HOMING: times.homing_s,
        Wait.ANSWER: times.answer_s,
        Wait.STOP: times.path_stop_s,
    }[wait]


def _stopping_s(reaction: Reaction, times: Times) -> float:
    if reaction >= Reaction.QUICK_STOP:
        return times.quick_stop_s
    # A path stop that takes too long is broken off; a lost drive may hear nothing, not even quick stop.
    whole_s = times.path_stop_s + times.quick_stop_s
    if reaction is Reaction.LOST_DRIVE:
        return max(whole_s, times.consumer_s + times.quick_stop_s)
    return whole_s
