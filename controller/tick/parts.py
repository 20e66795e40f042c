"""The parts of one machine's tick, each made after those that it needs."""

from __future__ import annotations

from collections.abc import Callable

from controller.ipc.handoff import Answers
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.state import stop_times
from controller.tick.adaptive import Adaptive
from controller.tick.check import Check
from controller.tick.coupling import Coupling
from controller.tick.drives import Drives
from controller.tick.follow import Follow
from controller.tick.jog import Jogging
from controller.tick.joints import Encoder
from controller.tick.mode import Modes
from controller.tick.peripherals import Peripherals
from controller.tick.probing import Probing
from controller.tick.sync_watch import SyncWatch


class Parts:
    """What ``live_state`` names as the owners of its values, but for the cycle; and what else that calls."""

    __slots__ = (
        "adaptive",
        "answers",
        "check",
        "coupling",
        "encoder",
        "follow",
        "group",
        "jogging",
        "machine",
        "modes",
        "peripherals",
        "probing",
        "sync",
    )

    def __init__(self, machine: Machine, group: Drives, now: Callable[[], float]) -> None:
        self.machine, self.group = machine, group
        stops_s = stop_times.path_stop_s(machine), stop_times.quick_stop_s(machine)
        absolute = sum(1 << i for i, axis in enumerate(machine.axes) if axis.homing.absolute)
        self.modes = Modes(group, machine.period_s, *stops_s, absolute)
        self.coupling = Coupling(machine, group.spindle, group.drives)
        self.follow = Follow(machine, kinematics_of(machine), self.coupling)
        self.peripherals = Peripherals(machine, group.spindle, group.io, self.coupling)
        self.adaptive = Adaptive(machine, group.spindle)
        self.jogging = Jogging(machine, self.modes, self.follow)
        self.answers = Answers()
        self.sync = SyncWatch(machine, group, self.modes, now)
        self.encoder = Encoder(machine)
        self.probing = Probing(machine, group, self.modes, self.follow, self.encoder, self.peripherals)
        self.check = Check(machine)
