"""What probe and tool setter of a simulated service touch, and what loads its spindle: a part on the table.

It is found out once per period what is touched, by the tool that is in the spindle. A part is a simulation
file (``probe``); without one a block with a bore lies at the first work offset, not quite where it
should. Each tool is as the machine file has it. A ``[cut]`` loads the spindle (``cut``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from controller.machine.model import TOOL_AT_POWER_ON, Machine, Sensor
from controller.machine.toml_table import parse
from controller.runtime.bench import probe
from controller.runtime.bench.cut import Cutting
from controller.runtime.bench.probe import Bench, Inputs, Wired
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.rig import Rig

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


def read(part: Path | None, machine: Machine) -> Bench:
    """The bench of a simulation file, or the usual one. Raises ConfigError."""
    if part is not None:
        return probe.load(part, machine)
    return probe.read(parse(STOCK, "stock"), machine, Path())


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
        part, nature = probe.on_setter(machine.setter, tool.length_mm, tool.radius_mm)
        return Bench(part, nature, bench.machine, bench.lost), machine.setter

    def watch(self, now_s: float) -> None:
        if now_s - self._looked_s < 0.5 * self._machine.period_s:  # the motors take one step in each
            return
        self._looked_s = now_s
        if self._wired is not None:
            self._wired.watch(now_s)
        if self._cutting is not None:
            self._cutting.watch(now_s)


def wired(bench: Bench, machine: Machine, rig: Rig) -> Wired:
    """On the stepped clock: probe, setter and spindle of a machine feel what is on the bench; its probe."""
    drives = [rig.drives[axis.name] for axis in machine.axes]
    io = next(iter(rig.io.values()), None)
    touch = Wired(bench, machine, drives, io, machine.probe)
    rig.watchers.append(touch.watch)
    if bench.cut is not None and rig.spindle is not None and machine.spindle is not None:
        feel = partial(rig.spindle.feel, counts_per_rev=abs(machine.spindle.counts_per_rev))
        rig.watchers.append(Cutting(bench.cut, machine, drives, feel).watch)
    if bench.setter is not None:
        rig.watchers.append(Wired(bench.setter, machine, drives, io, machine.setter).watch)
    return touch
