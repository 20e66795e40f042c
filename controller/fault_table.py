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

from controller.faults import Fault, FaultRow, Reaction, Recovery, Times, Wait

_TELL = "report this with the recording, for the plan should have slowed down."

FAULTS: dict[Fault, FaultRow] = {
    Fault.NONE: FaultRow("No fault.", True, "Nothing to do.", Reaction.NONE, Recovery.NOTHING),
    # --- plan
    Fault.PLANNER_GONE: FaultRow(
        "The planner has been silent for more than 100 ms; the tool stopped on the path (planner gone).",
        True,
        "Reset, retract along the tool axis, load the program again.",
        Reaction.PATH_STOP,
        Recovery.RESET,
        wait=Wait.PLANNER,
    ),
    Fault.TRAVEL: FaultRow(
        "The next setpoint lies outside the travel of an axis; it was not sent.",
        True,
        "Check work offset and tool length, then check the program.",
        Reaction.PATH_STOP,
        Recovery.RESET,
    ),
    Fault.VELOCITY: FaultRow(
        "The next setpoint asks an axis for more than its velocity; it was not sent.",
        True,
        f"Check the program; {_TELL}",
        Reaction.PATH_STOP,
        Recovery.RESET,
    ),
    Fault.ACCELERATION: FaultRow(
        "The next setpoint asks an axis for more than its acceleration; it was not sent.",
        True,
        f"Check the program; {_TELL}",
        Reaction.PATH_STOP,
        Recovery.RESET,
    ),
    Fault.BRANCH_LOST: FaultRow(
        "The rotary axes cannot reach the next tool axis; nothing was sent.",
        True,
        "Check the program; report this with the recording.",
        Reaction.PATH_STOP,
        Recovery.RESET,
    ),
    # --- drives
    Fault.FEEDBACK_LOST: FaultRow(
        "A drive did not report its position twice in a row.",
        False,
        "Check cable, termination and bus load; reset, commission again and home the axis.",
        Reaction.LOST_DRIVE,
        Recovery.COMMISSION,
        syncs=4,
    ),
    Fault.STATE_LOST: FaultRow(
        "A drive left the state Operation Enabled by itself.",
        False,
        "Read the drive's error code, remove the cause, reset and home the axis.",
        Reaction.LOST_DRIVE,
        Recovery.HOME,
        syncs=3,
    ),
    Fault.TORQUE_OFF: FaultRow(
        "A drive has lost its torque without an error (safe torque off, or its enable input).",
        True,
        "Close the safety circuit, check where the tool stands, reset and enable.",
        Reaction.LOST_DRIVE,
        Recovery.RESET,
        syncs=3,
    ),
    Fault.FOLLOWING_ERROR: FaultRow(
        "A drive stopped because it lagged behind its setpoint by more than its window (EMCY 8611h).",
        False,
        "Look for a collision, a stiff axis or too small a window; reset and home the axis.",
        Reaction.LOST_DRIVE,
        Recovery.HOME,
        syncs=3,
    ),
    Fault.LIMIT_SWITCH: FaultRow(
        "A drive ran onto a limit switch, so its position is not what it is taken for (EMCY 8612h).",
        False,
        "Move the axis off the switch, reset and home it, then check travel and homing position.",
        Reaction.LOST_DRIVE,
        Recovery.HOME,
        syncs=3,
    ),
    Fault.EMCY: FaultRow(
        "A drive sent an emergency message.",
        False,
        "Look up the emergency code of the drive, remove the cause, reset and home the axis.",
        Reaction.LOST_DRIVE,
        Recovery.HOME,
        syncs=3,
    ),
    Fault.DRIVE_WARNING: FaultRow(
        "A drive warns (statusword bit 7); it goes on working.",
        True,
        "Read the drive's error code and history; look at temperature and load before it trips.",
        Reaction.WARN,
        Recovery.NOTHING,
    ),
    Fault.HEARTBEAT_LOST: FaultRow(
        "A drive's heartbeat stopped, or it does not answer node guarding.",
        False,
        "Check the drive's supply and cable; reset, commission again and home the axis.",
        Reaction.LOST_DRIVE,
        Recovery.COMMISSION,
        wait=Wait.CONSUMER,
    ),
    Fault.NODE_RESET: FaultRow(
        "A drive started anew or left NMT Operational by itself; it has forgotten its settings.",
        False,
        "Check the drive's supply; reset, commission again and home the axis.",
        Reaction.LOST_DRIVE,
        Recovery.COMMISSION,
        syncs=3,
        wait=Wait.CONSUMER,  # a drive that starts is silent: its boot-up message comes at the end
    ),
    Fault.ENABLE_TIMEOUT: FaultRow(
        "A drive did not reach Operation Enabled in time.",
        True,
        "Check the drive's supply, its enable input and its error code; reset and enable again.",
        Reaction.QUICK_STOP,
        Recovery.RESET,
        wait=Wait.ENABLE,
    ),
    Fault.HOMING_FAILED: FaultRow(
        "A drive reported a homing error or did not finish homing.",
        False,
        "Check the reference switch and the homing method; reset and home again.",
        Reaction.QUICK_STOP,
        Recovery.HOME,
        wait=Wait.HOMING,
    ),
    # --- bus
    Fault.BUS_OFF: FaultRow(
        "The CAN controller went bus-off: nothing that is commanded reaches a drive.",
        False,
        "Check wiring, termination and bit rate; reset, commission again and home.",
        Reaction.QUICK_STOP,
        Recovery.COMMISSION,
        wait=Wait.CONSUMER,  # the drives hear nothing and stop by their own supervision
    ),
    Fault.BUS_ERROR: FaultRow(
        "The CAN bus reported an error (error passive, an overflow, or the hub is gone).",
        False,
        "Check wiring, termination and bit rate; reset, commission again and home.",
        Reaction.QUICK_STOP,
        Recovery.COMMISSION,
        wait=Wait.CONSUMER,
    ),
    Fault.RX_OVERFLOW: FaultRow(
        "Frames were lost because the controller did not take them in time.",
        True,
        "Take load off the computer; look for a node that sends too much; reset.",
        Reaction.PATH_STOP,
        Recovery.RESET,
    ),
    Fault.SYNC_FOREIGN: FaultRow(
        "Somebody else sends SYNC on the bus: drives would take setpoints at the wrong time.",
        True,
        "Find the second SYNC producer (object 1006h of each node) and switch it off; reset.",
        Reaction.QUICK_STOP,
        Recovery.RESET,
    ),
    Fault.SEND_FAILED: FaultRow(
        "A frame could not be sent: the transmit queue is full or the bus is gone.",
        False,
        "Check the bus, its load and txqueuelen; reset, commission again and home.",
        Reaction.QUICK_STOP,
        Recovery.COMMISSION,
        wait=Wait.CONSUMER,
    ),
    Fault.SYNC_LOST: FaultRow(
        "The kernel's SYNC did not come back in time.",
        False,
        "Check the bus; set sync to tick in the machine file; start again and home.",
        Reaction.QUICK_STOP,
        Recovery.RESTART,
        syncs=4,
        wait=Wait.CONSUMER,
    ),
    # --- tick
    Fault.TOO_MANY_SKIPS: FaultRow(
        "Too many ticks came too late; the tool stopped on the path.",
        True,
        "Take load off the computer or use a longer period; reset and go on.",
        Reaction.PATH_STOP,
        Recovery.RESET,
    ),
    Fault.STOP_OVERDUE: FaultRow(
        "A stop on the path took longer than any stop should; the drives stopped by their own ramps.",
        True,
        f"Check the program; {_TELL}",
        Reaction.QUICK_STOP,
        Recovery.RESET,
        wait=Wait.STOP,
    ),
    Fault.INTERNAL: FaultRow(
        "The tick met an error of its own and stopped the drives.",
        False,
        "Report this with the recording; start again and home.",
        Reaction.QUICK_STOP,
        Recovery.RESTART,
    ),
    Fault.CONTROLLER_GONE: FaultRow(
        "The tick's process is gone; the drives stopped by their own supervision.",
        False,
        "Find out what ended it, start again and home.",
        Reaction.QUICK_STOP,
        Recovery.RESTART,
        wait=Wait.CONSUMER,
    ),
    # --- operator, safety, peripherals
    Fault.EMERGENCY_STOP: FaultRow(
        "Emergency stop was requested.",
        True,
        "Make the machine safe, reset, enable; the tool has left the path: retract before you start.",
        Reaction.QUICK_STOP,
        Recovery.RESET,
    ),
    Fault.ESTOP_INPUT: FaultRow(
        "The emergency-stop circuit is open.",
        True,
        "Make the machine safe, close the circuit, reset, enable; retract before you start.",
        Reaction.DISABLE,
        Recovery.RESET,
    ),
    Fault.POWER_LOST: FaultRow(
        "The drives' power supply is gone.",
        False,
        "Restore the supply; reset, commission again and home.",
        Reaction.DISABLE,
        Recovery.COMMISSION,
    ),
    Fault.DOOR_OPEN: FaultRow(
        "The door is open.",
        True,
        "Close the door and resume.",
        Reaction.HOLD,
        Recovery.RESUME,
    ),
    Fault.SPINDLE_NOT_AT_SPEED: FaultRow(
        "The spindle did not reach its speed in time.",
        True,
        "Check the spindle drive, its load and the S word; resume.",
        Reaction.HOLD,
        Recovery.RESUME,
        wait=Wait.ANSWER,
    ),
    Fault.SPINDLE_LOST: FaultRow(
        "The spindle's drive is silent, in error or not enabled.",
        True,
        "Retract the tool, read the spindle drive's error code, remove the cause, reset.",
        Reaction.PATH_STOP,
        Recovery.RESET,
        wait=Wait.CONSUMER,
    ),
    Fault.CLAMP: FaultRow(
        "A clamp, of an axis or of the tool, is not as it must be.",
        True,
        "Check air, valve and switch of the clamp; reset.",
        Reaction.PATH_STOP,
        Recovery.RESET,
        wait=Wait.ANSWER,
    ),
    Fault.COOLANT_LOST: FaultRow(
        "The coolant does not flow.",
        True,
        "Fill up or clear the coolant, then resume.",
        Reaction.END_OF_BLOCK,
        Recovery.RESUME,
    ),
    Fault.IO_LOST: FaultRow(
        "The node with door and emergency-stop inputs is silent, restarted or in error.",
        True,
        "Check its supply and cable; reset (it is commissioned again at the next start).",
        Reaction.PATH_STOP,
        Recovery.RESET,
        wait=Wait.CONSUMER,
    ),
}


def sentence(fault: Fault, axis: str = "", also: Fault = Fault.NONE) -> str:
    """Text and remedy for the operator, with the axis concerned and what came on top."""
    row, more = FAULTS[fault], FAULTS[also]
    who = f"Axis {axis}: " if axis else ""
    told = f" Also: {more.text} {more.remedy}" if also not in (Fault.NONE, fault) else ""
    return f"{who}{row.text} {row.remedy}{told}"


def stands_within_s(fault: Fault, times: Times) -> float:
    """Longest time from the event to the standstill of all axes that have torque, s; 0 if nothing stops.

    A machine that stands already stands. END_OF_BLOCK promises the block's own time, so 0 too.
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
        Wait.PLANNER: times.planner_s,
        Wait.UNSENT: times.unsent_s,
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
