"""Hands at the terminals of a live machine's simulated devices: what an operator presses, by object 2004h."""

from __future__ import annotations

import os
import time
from pathlib import Path

import can
import canopen
from support.live.five_buses import hub_paths

from controller.machine.model import Machine
from drives.bench.simulated.inputs import HOME, NEGATIVE_LIMIT, POSITIVE_LIMIT, STO

SWITCHES = {"negative": NEGATIVE_LIMIT, "positive": POSITIVE_LIMIT, "home": HOME}
SIMULATED = 0x2004
AT_ONCE_S = 2.0


class Terminals:
    """Joined to the virtual buses of the processes that this one has started."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        paths = hub_paths(_offspring(os.getpid()))
        self._buses = [can.Bus(interface="directrix", channel=path) for path in paths]
        self._networks = []
        for bus in self._buses:
            network = canopen.Network(bus)
            network.connect()
            self._networks.append(network)

    def close(self) -> None:
        for network in self._networks:
            network.disconnect()

    def turn_input(self, name: str) -> None:
        """An input of the I/O node changes."""
        io = self._machine.io
        assert io is not None
        bit = io.input(name)
        assert bit is not None
        self._turn(io.node, io.bus, 1 << bit)

    def turn_switch(self, axis: str, name: str) -> None:
        """A limit or reference switch of an axis is pressed, or let go."""
        self._turn_axis(axis, SWITCHES[name])

    def turn_sto(self, axis: str) -> None:
        """Its drive loses its torque, or may have it again."""
        self._turn_axis(axis, STO)

    def _turn_axis(self, axis: str, bit: int) -> None:
        own = next(one for one in self._machine.axes if one.name == axis)
        self._turn(own.node, own.bus, bit)

    def _turn(self, node: int, bus: str, bit: int) -> None:
        """Whoever else has an SDO under way with the node is waited for."""
        network = self._networks[[one.name for one in self._machine.buses].index(bus)]
        remote = network.nodes.get(node) or network.add_node(node, canopen.ObjectDictionary())
        give_up_s = time.monotonic() + AT_ONCE_S
        while True:
            try:
                word = int.from_bytes(remote.sdo.upload(SIMULATED, 0), "little")
                remote.sdo.download(SIMULATED, 0, (word ^ bit).to_bytes(4, "little"))
                return
            except canopen.SdoError:
                if time.monotonic() > give_up_s:
                    raise


def _offspring(pid: int) -> list[int]:
    """All processes below one."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += [int(child), *_offspring(int(child))]
    return found
