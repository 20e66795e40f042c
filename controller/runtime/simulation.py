"""The one door to the bench: simulated devices, virtual buses, what is touched and cut there, and faults.

Its rooms are ``drives.bench`` and ``controller.runtime.bench``. Whoever simulates comes through here; the
processes of a real machine load nothing of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from controller.machine.model import Machine
from controller.machine.toml_table import parse
from controller.runtime import children
from controller.runtime.bench.bus import Job, bus_of, tell_tool, turns
from controller.runtime.bench.surroundings import devices, rig_of
from drives import bus
from drives.bench.options import EVERYTHING, SharedAdapter, equipped
from drives.bench.simulated import build, families, family_sheet
from drives.bench.simulated.can_bridge import InterfaceError
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IoNode
from drives.bench.simulated.parameters import LostSync, Parameters
from drives.bench.simulated.rig import Rig
from drives.bench.simulated.serve import open_server, run
from drives.bench.simulated.spindle_motor import MotorParameters
from drives.bench.virtual.fault_kinds import ScriptError
from drives.bench.virtual.hub import Hub
from drives.settings import BusSettings

if TYPE_CHECKING:
    from collections.abc import Callable

    from controller.machine.spindle import Spindle
    from controller.runtime.bench.fault_file import Injected, MachineScript
    from controller.runtime.bench.inverter import SimulatedInverter, SteppedInverter
    from controller.runtime.bench.observer import Observer
    from controller.runtime.bench.probe import Bench, Wired
    from controller.tick.cycle import Cycle

__all__ = [
    "Bench",
    "Injected",
    "InterfaceError",
    "IoNode",
    "Job",
    "LostSync",
    "MachineScript",
    "MotorParameters",
    "Observer",
    "Parameters",
    "Rig",
    "ScriptError",
    "SimulatedDrive",
    "Wired",
    "build",
    "bus_of",
    "devices",
    "equipped",
    "families",
    "family_sheet",
    "open_server",
    "rig_of",
    "run",
    "tell_tool",
    "turns",
]


def bench(part: Path | None, machine: Machine) -> Bench:
    """What the tools of a machine can touch and cut: a simulation file's or usual. Raises ConfigError."""
    from controller.runtime.bench import touching

    return touching.read(part, machine)


def bench_of(text: str, machine: Machine) -> Bench:
    """The same of the text of a simulation file. Raises ConfigError."""
    from controller.runtime.bench import probe

    return probe.read(parse(text, "part"), machine, Path())


def wired(bench: Bench, machine: Machine, rig: Rig) -> Wired:
    """A machine on the stepped clock that touches and cuts what is on the bench; its probe."""
    from controller.runtime.bench import touching

    return touching.wired(bench, machine, rig)


def inverter(spindle: Spindle, now: Callable[[], float]) -> SimulatedInverter:
    """A simulated inverter for the serial line of a spindle."""
    from controller.runtime.bench.inverter import SimulatedInverter

    return SimulatedInverter(spindle, now)


def stepped_inverter(machine: Machine, now: Callable[[], float]) -> SteppedInverter | None:
    """The same on the stepped clock; None where the spindle has none."""
    from controller.runtime.bench.inverter import SteppedInverter

    spindle = machine.spindle
    return None if spindle is None or spindle.modbus is None else SteppedInverter(spindle, now)


def observer(machine: Machine, cycle: Cycle, rig: Rig) -> Observer:
    """Somebody who looks at the motors of a machine on the stepped clock."""
    from controller.runtime.bench.observer import Observer

    return Observer(machine, cycle, rig)


def script(file: Path, machine: Machine) -> MachineScript:
    """The faults of a run. Raises ScriptError."""
    from controller.runtime.bench.fault_file import MachineScript

    return MachineScript.load(file, machine)


# -- of a process: its job is carried out until SIGTERM


def serve_bus(job: Job) -> None:
    """A virtual bus with a machine's devices. Raises OSError."""
    from controller.runtime.bench import bus

    bus.main(job)


def share_adapter(job: tuple[BusSettings, str]) -> None:
    """The adapter of a bus, which has one owner, for all that join at a path. Raises BusError, OSError."""
    settings, path = job
    adapter = bus.open(settings, EVERYTHING)
    asked, hub = children.EndRequest(), Hub(path, bit_rate=0, sync_log=False)
    hub.open_gateway(SharedAdapter(hub, adapter))
    try:
        hub.run(lambda: asked.yes)
    finally:
        hub.close()
