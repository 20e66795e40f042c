"""What the faults of a machine take: the figures behind the promises of the fault table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from controller.machine.model import Machine
from controller.motion.pieces import commit_lead_s
from controller.state.modes import Times
from drives.arranged import Arranged
from drives.settings import MasterSettings

ENABLE_S = 5.0  # brakes take 0.2 s, some drives' intermediate circuits two or three
HOMING_S = 120.0
LOST_BUS_S = 0.1  # without a SYNC that can be sent: nothing that is commanded reaches a drive

# A stop on a curved path shares the axes' limits with the path's own curvature. Straight ahead
# it takes v / a + a / j; a stop beyond so many times that is broken off by a quick stop.
STOP_FACTOR = 4.0


def of(machine: Machine, arranged: Sequence[Arranged] = ()) -> Times:
    """The times of a machine: its axes' limits, the master's settings, and its drives as they were read."""
    master = MasterSettings(period_s=machine.period_s)
    return Times(
        period_s=machine.period_s,
        consumer_s=master.consumer_s,
        enable_s=ENABLE_S,
        homing_s=HOMING_S,
        answer_s=_answer_s(machine),
        path_stop_s=path_stop_s(machine),
        quick_stop_s=quick_stop_s(machine, arranged),
        feedback_every=max(axis.feedback_every for axis in machine.axes),
    )


def deaf_s(machine: Machine) -> float:
    """The shortest silence of ours after which drives may have stopped by their own supervision."""
    master = MasterSettings(period_s=machine.period_s)
    return master.consumer_s - 2.0 * master.heartbeat_s


def _answer_s(machine: Machine) -> float:
    """What the machine file gives its spindle and its clamps."""
    spindle_s = (
        [machine.spindle.spin_up_s] if machine.spindle is not None and machine.spindle.is_driven else []
    )
    return max([*spindle_s, *(axis.clamp.open_s for axis in machine.axes if axis.clamp)], default=0.0)


def quick_stop_s(machine: Machine, arranged: Sequence[Arranged] = ()) -> float:
    """A drive's own ramp from its axis' largest speed: as the drive was read, else as it will be told."""
    read_s = {found.name: found.stop_s for found in arranged if found.stop_s}
    return max(
        read_s.get(axis.name) or axis.limits.velocity / (axis.stopping.quick_stop or axis.limits.acceleration)
        for axis in machine.axes
    )


def path_stop_s(machine: Machine) -> float:
    """No coordinated stop takes longer, or a limit of the machine file is not what it says."""
    alone_s = max(_ramp_s(a.limits.velocity, a.limits.acceleration, a.limits.jerk) for a in machine.axes)
    return STOP_FACTOR * max(alone_s, _tip_s(machine)) + commit_lead_s(machine.period_s)


def _ramp_s(velocity: float, acceleration: float, jerk: float) -> float:
    return velocity / acceleration + acceleration / jerk


def _tip_s(machine: Machine) -> float:
    """Where the tip's acceleration is bounded, from the largest speed of the slides."""
    if not machine.tip_acceleration_mm_s2:
        return 0.0
    speed = math.hypot(*(machine.axes[i].limits.velocity for i in machine.linear()))
    return speed / machine.tip_acceleration_mm_s2
