"""Hubs of a machine: virtual buses with simulated drives on them, and what shares a serial adapter."""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from controller.machine.model import Bus, Machine
from controller.runtime import simulation
from controller.runtime.children import Child
from controller.runtime.startup import SessionError

Rows = npt.NDArray[np.float64]

HUB_S = 20.0  # for a hub to be there
POLL_S = 0.05


def started(
    machine: Machine,
    folder: Path,
    ending: contextlib.ExitStack,
    hubs: dict[str, Child],
    stamps_s: dict[str, Rows],
) -> Machine:
    """Start a hub with drives for each virtual bus; the machine with their paths as channels.

    They end with ``ending``; then ``stamps_s`` has when SYNC left the wire, by virtual bus.
    Raises SessionError.
    """
    buses = []
    for bus in machine.buses:
        if bus.interface == "virtual":
            log = folder / f"{bus.name}.sync.npy"
            bus = replace(bus, channel=str(folder / f"{bus.name}.hub"))
            hub = _hub(bus, simulation.options(machine, bus.name), log, folder)
            hubs[bus.name] = hub
            ending.callback(_end_hub, hub, bus.name, log, stamps_s)
            _wait_for_hub(hub, Path(bus.channel))
        elif bus.interface == "slcan":
            # A serial port has one owner, and three of our processes want it: a hub shares it.
            adapter = ["--bit-rate", "0", "--nodes", "--serial", f"{bus.channel}={bus.bit_rate}"]
            bus = replace(bus, interface="shared", channel=str(folder / f"{bus.name}.hub"))
            hub = Child("hub", [bus.channel, *adapter], folder / f"{bus.name}.words")
            hubs[bus.name] = hub
            ending.callback(hub.end)
            _wait_for_hub(hub, Path(bus.channel))
        buses.append(bus)
    return replace(machine, buses=tuple(buses))


def _hub(bus: Bus, nodes: list[str], log: Path, folder: Path) -> Child:
    options = [bus.channel, "--bit-rate", str(bus.bit_rate), "--sync-log", str(log), *nodes]
    return Child("hub", options, folder / f"{bus.name}.words")


def _wait_for_hub(hub: Child, path: Path) -> None:
    give_up_s = time.monotonic() + HUB_S
    while not path.exists():
        if not hub.is_alive() or time.monotonic() > give_up_s:
            raise SessionError("The virtual bus did not start; see its message above.")
        time.sleep(POLL_S)


def _end_hub(hub: Child, name: str, log: Path, stamps_s: dict[str, Rows]) -> None:
    """The hub writes its log at the end; read it before the folder goes."""
    hub.end()
    if log.exists():
        stamps_s[name] = np.load(log)
