"""The process of one virtual bus of a live machine: its simulated devices, and what they touch and cut.

The motors turn in the process of the axes' bus. There it is found out what is touched (``touching``),
by the tool that the service says is in the spindle; inputs and spindle may be in the process of another bus:

    service: tool in the spindle --> axes' bus: motors, touch, cut --> inputs' bus, spindle's bus
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from controller.machine.model import Bus, Machine
from controller.runtime.bench import surroundings
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IoNode
from drives.bench.simulated.parameters import Parameters
from drives.bench.simulated.serve import run
from drives.bench.simulated.spindle_motor import MotorParameters
from drives.bench.virtual.hub import Hub

SPINDLE = "spindle"  # socket in the engine's folder: which tool is in it
LOAD = b"load"
MAX_WORDS = 64  # bytes of a packet

Devices = Mapping[int, SimulatedDrive | IoNode]  # by node id


@dataclass(frozen=True, slots=True)
class Job:
    """What the process is given. ``bus``: with the path of its hub as channel."""

    machine: Machine
    bus: Bus
    folder: Path  # the engine's, for sockets between the buses
    touching: str | None = None  # name of the bus beside which something is touched or cut
    part: Path | None = None  # the simulation file of that; spindles then have inertia and slip
    sync_log: Path | None = None  # .npy file of the times at which SYNC left the wire, written at the end


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
    return spindle is not None and spindle.has_drive and spindle.bus in _virtual(machine)


def _virtual(machine: Machine) -> set[str]:
    return {bus.name for bus in machine.buses if bus.interface == "virtual"}


def tell_tool(folder: Path, number: int) -> None:
    """Which tool is in the spindle; nobody may be there who wants to know."""
    _send(folder / SPINDLE, str(number))


def main(job: Job) -> None:
    """Until SIGTERM. Raises OSError where a data sheet is missing, or the hub's path cannot be bound."""
    bus, log = job.bus, job.sync_log
    motor = None if job.part is None else MotorParameters()
    devices = surroundings.devices(job.machine, bus.name, Parameters(), motor)
    nodes = {device.node: device for device in devices}
    hub = Hub(bus.channel, bus.bit_rate, sync_log=log is not None)  # found by others from here on
    if job.touching == bus.name:
        _touch(hub, nodes, job)
    elif job.touching is not None:
        _feel(hub, nodes, job)
    run(hub, devices, sync_log=None if log is None else str(log))


def _touch(hub: Hub, nodes: Devices, job: Job) -> None:
    """Here something is touched or cut."""
    from controller.runtime.bench.touching import Touching, read  # much that other buses do not need

    machine = job.machine
    drives = [nodes[axis.node] for axis in machine.axes]
    motors = [one for one in drives if isinstance(one, SimulatedDrive)]
    bench = read(job.part, machine)
    inputs = _inputs(nodes, job) or _Far(_heard(job, machine.io.bus if machine.io is not None else ""))
    touching = Touching(bench, machine, motors, inputs, _spindle(nodes, job))
    _hear(hub, job.folder / SPINDLE, lambda words: touching.put_in(int(words), hub.bus.now_s))
    hub.watchers.append(touching.watch)


def _inputs(nodes: Devices, job: Job) -> IoNode | None:
    """The node that a touch is told by, if it is on this bus."""
    io = job.machine.io
    own = nodes[io.node] if io is not None and io.bus == job.bus.name else None
    return own if isinstance(own, IoNode) else None


def _motor(nodes: Devices, job: Job) -> Callable[[float], None] | None:
    """Takes what the cut takes of the spindle, if its drive is on this bus."""
    spindle = job.machine.spindle
    if spindle is None or not spindle.has_drive or spindle.bus != job.bus.name:
        return None
    own = nodes[spindle.node]
    assert isinstance(own, SimulatedDrive)
    return partial(own.feel, counts_per_rev=abs(spindle.counts_per_rev))


def _spindle(nodes: Devices, job: Job) -> Callable[[float], None]:
    """Takes what the cut takes of it, wherever it is."""
    if (here := _motor(nodes, job)) is not None:
        return here
    spindle = job.machine.spindle
    if spindle is None or not spindle.has_drive:
        return lambda _: None
    return _Far(_heard(job, spindle.bus)).feel


def _feel(hub: Hub, nodes: Devices, job: Job) -> None:
    """Inputs that another bus sets, and what its cut takes of the spindle."""
    io, feel = _inputs(nodes, job), _motor(nodes, job)

    def take(words: bytes) -> None:
        name, value = words.split()
        if name != LOAD and io is not None:
            io.set_input(int(name), value == b"1", hub.bus.now_s)
        elif name == LOAD and feel is not None:
            feel(float(value))

    _hear(hub, _heard(job, job.bus.name), take)


def _heard(job: Job, bus: str) -> Path:
    """The socket by which the process of another bus hears of touches and of the cut."""
    return job.folder / f"{bus}.heard"


def _hear(hub: Hub, path: Path, take: Callable[[bytes], None]) -> None:
    """A datagram socket beside the hub. Raises OSError."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(path)
    own = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    own.bind(str(path))
    own.setblocking(False)

    def read() -> None:
        with contextlib.suppress(OSError, ValueError):
            take(own.recv(MAX_WORDS))

    hub.listen(own.fileno(), read)


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
