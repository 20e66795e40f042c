"""What probe and tool setter of a simulated service touch: a part on the table beside its virtual buses.

The motors turn in the process of the axes' bus. There it is found out once per period what is touched, by the
tool that the service says is in the spindle; the inputs may be in the process of another bus:

    service: tool in the spindle --> axes' bus: motors, touch --> inputs' bus

A part is a simulation file (``simulated_probe``); without one a block with a bore lies at the first work
offset, not quite where it should. Each tool is as the machine file has it.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Sequence
from pathlib import Path

from controller.machine.model import TOOL_AT_POWER_ON, Machine, Sensor
from controller.machine.toml_table import parse
from controller.runtime import simulated_probe
from controller.runtime.simulated_probe import Bench, Inputs, Wired
from controller.values import dataclass
from drives.simulated import __main__ as simulated
from drives.simulated.drive import SimulatedDrive
from drives.simulated.io_node import IoNode
from drives.simulated.serve import Server
from drives.virtual.hub import Hub

STOCK = """
name = "stock"
shift_mm = [0.35, -0.2, 0.1]
turned_deg = [0.0, 0.0, 0.5]

[probe]
pretravel_mm = 0.003
scatter_mm = 0.0005

[[solid]]
kind = "block"
low_mm = [-40.0, -30.0, -30.0]
high_mm = [40.0, 30.0, 0.0]

[[hole]]
kind = "cylinder"
centre_mm = [0.0, 0.0, 10.0]
radius_mm = 12.0
height_mm = 35.0
"""
SPINDLE, INPUTS = "spindle", "inputs"  # sockets in the engine's folder


@dataclass(frozen=True, slots=True)
class Job:
    """What the process of the axes' bus is given."""

    machine: Machine
    options: list[str]  # of ``drives.simulated``
    folder: Path
    part: Path | None


def read(part: Path | None, machine: Machine) -> Bench:
    """The bench of a simulation file, or the usual one. Raises ConfigError."""
    if part is not None:
        return simulated_probe.load(part, machine)
    return simulated_probe.read(parse(STOCK, "stock"), machine, Path())


def bus_of(machine: Machine) -> str | None:
    """Name of the virtual bus beside which something can be touched; None: nothing can.

    All axes must be on it, for no process sees the motors of two.
    """
    names = {axis.bus for axis in machine.axes}
    virtual = {bus.name for bus in machine.buses if bus.interface == "virtual"}
    touches = machine.probe is not None or machine.setter is not None
    return names.pop() if touches and len(names) == 1 and names <= virtual else None


def tell_tool(folder: Path, number: int) -> None:
    """Which tool is in the spindle; nobody may be there who wants to know."""
    _send(folder / SPINDLE, str(number))


def _send(path: Path, words: str) -> None:
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as own:
        own.setblocking(False)
        own.sendto(words.encode(), str(path))


class _Far:
    """Inputs in the process of another bus."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def set_input(self, number: int, on: bool, now_s: float) -> None:
        _send(self._path, f"{number} {on:d}")


class Touching:
    """The tool in the spindle, and what it touches; ``watch`` after each turn of the bus."""

    def __init__(
        self, bench: Bench, machine: Machine, drives: Sequence[SimulatedDrive], inputs: Inputs
    ) -> None:
        self._bench, self._machine, self._drives, self._inputs = bench, machine, drives, inputs
        self._wired: Wired | None = None
        self._looked_s = 0.0
        self.put_in(TOOL_AT_POWER_ON, 0.0)

    def put_in(self, number: int, now_s: float) -> None:
        """The probe touches the part, any other tool the setter."""
        if self._wired is not None and self._wired.touched.closed:
            self._wired.show(False, now_s)
        self._wired = None
        if (found := self._bench_of(number)) is not None:
            bench, sensor = found
            self._wired = Wired(bench, self._machine, self._drives, self._inputs, sensor)

    def _bench_of(self, number: int) -> tuple[Bench, Sensor] | None:
        machine, bench = self._machine, self._bench
        if machine.probe is not None and number == machine.probe.tool:
            return bench, machine.probe
        tool = machine.tool(number)
        if machine.setter is None or tool is None:
            return None
        part, nature = simulated_probe.on_setter(machine.setter, tool.length_mm, tool.radius_mm)
        return Bench(part, nature, bench.machine, bench.lost), machine.setter

    def watch(self, now_s: float) -> None:
        if self._wired is not None and now_s - self._looked_s >= self._machine.period_s:
            self._looked_s = now_s
            self._wired.watch(now_s)


def main(job: Job) -> None:
    """The process of the axes' bus, until SIGTERM."""

    def join(server: Server, devices: Sequence[SimulatedDrive | IoNode]) -> None:
        assert isinstance(server, Hub)
        machine, nodes = job.machine, {one.node: one for one in devices}
        drives = [nodes[axis.node] for axis in machine.axes]
        io = nodes.get(machine.io.node) if machine.io is not None else None
        inputs = io if isinstance(io, IoNode) else _Far(job.folder / INPUTS)
        motors = [one for one in drives if isinstance(one, SimulatedDrive)]
        touching = Touching(read(job.part, machine), machine, motors, inputs)
        told = simulated.heard(server, str(job.folder / SPINDLE))

        def put_in(words: bytes) -> None:
            with contextlib.suppress(ValueError):
                touching.put_in(int(words), server.bus.now_s)

        told(put_in)
        server.watchers.append(touching.watch)

    simulated.main(job.options, join)
    with contextlib.suppress(OSError):
        os.unlink(job.folder / SPINDLE)
