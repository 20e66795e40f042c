"""The parts of one machine's tick, each made after those that it needs."""

from __future__ import annotations

from collections.abc import Callable

from controller.ipc.handoff import Answers
from controller.ipc.inverter_slot import InverterSlot
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
from controller.tick.limit_switches import LimitSwitches
from controller.tick.lookahead import Lookahead
from controller.tick.mode import Modes
from controller.tick.peripherals import Peripherals
from controller.tick.probing import Probing
from controller.tick.stock import DELAY, Stock
from controller.tick.sync_watch import SyncWatch
from drives.pump.plan_memory import Memory


class Parts:
    """What ``live_state`` names as the owners of its values, but for the cycle; and what else that calls."""

    def __init__(
        self,
        machine: Machine,
        group: Drives,
        now: Callable[[], float],
        plans: Memory | None = None,
        slot: InverterSlot | None = None,
    ) -> None:
        self.machine, self.group = machine, group
        stops_s = stop_times.path_stop_s(machine), stop_times.quick_stop_s(machine)
        absolute = sum(1 << i for i, axis in enumerate(machine.axes) if axis.homing.absolute)
        self.modes = Modes(group, machine.period_s, *stops_s, absolute)
        delay = DELAY if plans is not None else 0
        periods = round(machine.stock_s / machine.period_s) if plans is not None else 0
        self.coupling = Coupling(machine, group.spindle, group.drives, delay, periods)
        self.follow = Follow(machine, kinematics_of(machine), self.coupling)
        self.peripherals = Peripherals(machine, group.spindle, group.io, self.coupling, slot)
        self.limit_switches = LimitSwitches(machine)
        self.adaptive = Adaptive(machine, group.spindle)
        self.jogging = Jogging(machine, self.modes, self.follow, delay)
        self.answers = Answers()
        self.chatter = group.chatter
        self.sync = SyncWatch(machine, group, self.modes, now, delay)
        self.encoder = Encoder(machine)
        self.probing = Probing(machine, group, self.modes, self.follow, self.encoder, self.peripherals, delay)
        self.check = Check(machine)
        self.stock: Stock | None = None
        if plans is not None:
            ahead = Lookahead(machine, self.follow, self.encoder, periods)
            self.stock = Stock(machine, group, ahead, self.encoder, plans)
