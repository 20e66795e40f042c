"""What probe and tool setter of a simulated service touch, and what loads its spindle: a part on the table.

The motors turn in the process of the axes' bus. There it is found out once per period what is touched, by the
tool that the service says is in the spindle; inputs and spindle may be in the process of another bus:

    service: tool in the spindle --> axes' bus: motors, touch, cut --> inputs' bus, spindle's bus

A part is a simulation file (``simulated_probe``); without one a block with a bore lies at the first work
offset, not quite where it should. Each tool is as the machine file has it. A ``[cut]`` of the file loads
the spindle (``simulated_cut``).
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from controller.machine.model import TOOL_AT_POWER_ON, Machine, Sensor
from controller.machine.toml_table import parse
from controller.runtime import simulated_probe
from controller.runtime.simulated_cut import Cutting
from controller.runtime.simulated_probe import Bench, Inputs, Wired
from controller.values import dataclass
from drives.simulated import __main__ as simulated
from drives.simulated.__main__ import LOAD
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
SPINDLE = "spindle"  # socket in the engine's folder: which tool is in it


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


def bus_of(machine: Machine, part: bool = False) -> str | None:
    """Name of the virtual bus beside which something can be touched or cut; None: nothing can.

    All axes must be on it, for no process sees the motors of two. ``part``: there is a simulation file, whose
    stock can load the spindle.
    """
    names = {axis.bus for axis in machine.axes}
    virtual = _virtual(machine)
    touches = machine.probe is not None or machine.setter is not None or (part and turns(machine))
    return names.pop() if touches and len(names) == 1 and names <= virtual else None


def turns(machine: Machine) -> bool:
    """It has a spindle that can feel a cut: one with a drive, on a virtual bus."""
    spindle = machine.spindle
    return spindle is not None and spindle.is_driven and spindle.bus in _virtual(machine)


def _virtual(machine: Machine) -> set[str]:
    return {bus.name for bus in machine.buses if bus.interface == "virtual"}


def heard(folder: Path, bus: str) -> Path:
    """The socket by which the process of another bus hears of touches and of the cut."""
    return folder / f"{bus}.heard"


def tell_tool(folder: Path, number: int) -> None:
    """Which tool is in the spindle; nobody may be there who wants to know."""
    _send(folder / SPINDLE, str(number))


def _send(path: Path, words: str) -> None:
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as own:
        own.setblocking(False)
        own.sendto(words.encode(), str(path))


class _Far:
    """Inputs and spindle in the process of another bus."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._felt = 0.0

    def set_input(self, number: int, on: bool, now_s: float) -> None:
        _send(self._path, f"{number} {on:d}")

    def feel(self, power_rev_s: float) -> None:
        """Again and again while there is any, for its torque goes with the speed; once that it is over."""
        if power_rev_s or self._felt:
            _send(self._path, f"{LOAD.decode()} {power_rev_s:.9g}")
        self._felt = power_rev_s


class Touching:
    """The tool in the spindle, and what it touches or cuts; ``watch`` after each turn of the bus."""

    def __init__(
        self,
        bench: Bench,
        machine: Machine,
        drives: Sequence[SimulatedDrive],
        inputs: Inputs,
        feel: Callable[[float], None],
    ) -> None:
        self._bench, self._machine, self._drives, self._inputs = bench, machine, drives, inputs
        self._wired: Wired | None = None
        self._cutting = None if bench.cut is None else Cutting(bench.cut, machine, drives, feel)
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
        if now_s - self._looked_s < 0.5 * self._machine.period_s:  # the motors take one step in each
            return
        self._looked_s = now_s
        if self._wired is not None:
            self._wired.watch(now_s)
        if self._cutting is not None:
            self._cutting.watch(now_s)


def _inputs(job: Job, nodes: Mapping[int, SimulatedDrive | IoNode]) -> Inputs:
    """Those of this bus, or of another; a machine without any has nothing that tells a touch."""
    io = job.machine.io
    if io is not None and io.bus == job.machine.axes[0].bus and isinstance(own := nodes[io.node], IoNode):
        return own
    return _Far(heard(job.folder, io.bus if io is not None else ""))


def _spindle(job: Job, nodes: Mapping[int, SimulatedDrive | IoNode]) -> Callable[[float], None]:
    """Takes what the cut takes of it."""
    spindle = job.machine.spindle
    if spindle is None or not spindle.is_driven:
        return lambda _: None
    if spindle.bus == job.machine.axes[0].bus and isinstance(own := nodes[spindle.node], SimulatedDrive):
        return partial(own.feel, counts_per_rev=abs(spindle.counts_per_rev))
    return _Far(heard(job.folder, spindle.bus)).feel


def main(job: Job) -> None:
    """The process of the axes' bus, until SIGTERM."""

    def join(server: Server, devices: Sequence[SimulatedDrive | IoNode]) -> None:
        assert isinstance(server, Hub)
        machine, nodes = job.machine, {one.node: one for one in devices}
        drives = [nodes[axis.node] for axis in machine.axes]
        motors = [one for one in drives if isinstance(one, SimulatedDrive)]
        inputs, feel = _inputs(job, nodes), _spindle(job, nodes)
        touching = Touching(read(job.part, machine), machine, motors, inputs, feel)
        told = simulated.heard(server, str(job.folder / SPINDLE))

        def put_in(words: bytes) -> None:
            with contextlib.suppress(ValueError):
                touching.put_in(int(words), server.bus.now_s)

        told(put_in)
        server.watchers.append(touching.watch)

    simulated.main(job.options, join)
    with contextlib.suppress(OSError):
        os.unlink(job.folder / SPINDLE)
