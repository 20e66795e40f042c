"""From commissioned drives to a machine that is homed and enabled; the same on every clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from controller import config
from controller.machine import Machine
from controller.state import FAULTS, Fault, Mode, Request
from drives import commission
from drives.settings import NodeSettings

HOMING, CSP = 6, 8  # modes of operation, 6060h

# Sends a request and lets time pass until the machine is in that mode or in a fault.
Ask = Callable[[Request, float, Mode], tuple[Mode, Fault]]


class SessionError(Exception):
    """The machine did not come up, or a part of it is gone; one sentence says which and what to do."""


class StartUp:
    """Commissioning, homing and enabling over SDO and requests."""

    def __init__(self, machine: Machine, networks: Mapping[str, commission.Network], ask: Ask) -> None:
        """``networks`` by bus name."""
        self._machine, self._networks, self._ask = machine, networks, ask
        self._nodes = config.node_settings(machine)

    def commission(self) -> None:
        """Write and read back every drive's settings and start it. Raises CommissionError."""
        master = config.master_settings(self._machine)
        for name, network in self._networks.items():
            commission.commission(network, [node for node in self._nodes if node.bus == name], master)

    def come_up(self) -> None:
        """Home every axis, group by group, and enable. Raises SessionError."""
        axes = self._machine.axes
        for group in sorted({axis.homing.group for axis in axes}):
            self._home([i for i, axis in enumerate(axes) if axis.homing.group == group])
        self._reach(Request.ENABLE, 0.0, Mode.READY)

    def _home(self, axes: Sequence[int]) -> None:
        self._set_mode([self._nodes[i] for i in axes], HOMING)
        self._reach(Request.HOME, float(sum(1 << i for i in axes)), Mode.OFF)
        self._set_mode([self._nodes[i] for i in axes], CSP)

    def _set_mode(self, nodes: Sequence[NodeSettings], mode: int) -> None:
        for node in nodes:
            commission.set_mode(self._networks[node.bus], node, mode)

    def _reach(self, request: Request, value: float, wanted: Mode) -> None:
        mode, fault = self._ask(request, value, wanted)
        if mode is not wanted:
            raise SessionError(
                f"The machine did not become {wanted.name} after {request.name} but is in {mode.name}: "
                f"{FAULTS[fault].text} {FAULTS[fault].remedy}"
            )
