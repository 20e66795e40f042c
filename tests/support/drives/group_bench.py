"""A group on commissioned simulated nodes, advanced one period at a time, for tests of the cyclic part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from drives import commission, pdo
from drives.bench.simulated import Parameters, SimulatedDrive, rig
from drives.cia402 import Wanted
from drives.cyclic.drive import Drive
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.group import Group
from drives.cyclic.io_node import IoNode
from drives.cyclic.spindle import SpindleDrive
from drives.settings import BusSettings, IoSettings, MasterSettings, NodeSettings, SpindleSettings

CONFIG = Path(__file__).parents[3] / "config"
EDS, IO_EDS = str(CONFIG / "eds" / "simulated_drive.eds"), str(CONFIG / "eds" / "simulated_io.eds")
T = 0.002


def nodes(names: str = "XYZAC", bus: str = "can", **changes: object) -> list[NodeSettings]:
    made = [NodeSettings(name, bus, number, EDS) for number, name in enumerate(names, 1)]
    return [replace(node, **changes) for node in made]  # type: ignore[arg-type]


def spindle(bus: str = "can", **changes: object) -> SpindleSettings:
    return replace(SpindleSettings("S", bus, 10, EDS, 4000.0), **changes)  # type: ignore[arg-type]


def inputs_and_outputs(bus: str = "can", **changes: object) -> IoSettings:
    return replace(IoSettings("panel", bus, 20, IO_EDS), **changes)  # type: ignore[arg-type]


class GroupBench:
    """``tick`` is one period: receive, SYNC, setpoints. ``setpoints`` start where the drives are."""

    def __init__(
        self,
        drives: Sequence[NodeSettings],
        *,
        spindle: SpindleSettings | None = None,
        io: Sequence[IoSettings] = (),
        parameters: Parameters | None = None,
        bit_rate: int = 1_000_000,
    ) -> None:
        everybody = [*drives, *([] if spindle is None else [spindle]), *io]
        names = list(dict.fromkeys(node.bus for node in everybody))
        self.period_s = drives[0].period_s if drives else T
        self.master = MasterSettings(period_s=self.period_s)
        self.rig = rig(
            drives,
            [BusSettings(name, "virtual", "", bit_rate) for name in names],
            spindle=spindle,
            io=io,
            parameters=parameters or Parameters(),
        )
        for name in names:
            network = commission.Network(
                self.rig.port(pdo.SERVICE_FILTERS, name), commission.stepped_pump(self.rig)
            )
            commission.commission(network, [node for node in everybody if node.bus == name], self.master)
        self.service = {name: self.rig.port(None, name) for name in names}
        self.ports = {name: self.rig.port(pdo.TICK_FILTERS, name) for name in names}
        self.spindle = None if spindle is None else SpindleDrive(spindle)
        self.io = [IoNode(settings) for settings in io]
        self.group = Group([Drive(node) for node in drives], self.ports, self.master, self.spindle, self.io)
        self.setpoints = [0] * len(drives)
        self.fault = (DriveFault.NONE, -1)

    @property
    def now_s(self) -> float:
        return self.rig.now_s

    @property
    def devices(self) -> list[SimulatedDrive]:
        return list(self.rig.drives.values())

    def tick(self, count: int = 1, step: int = 0) -> None:
        """``step``: counts added to every setpoint with each SYNC that goes out, as a path would."""
        group = self.group
        for _ in range(count):
            self.rig.advance(self.now_s + self.period_s)
            group.receive(self.now_s)
            self.fault = group.fault(self.now_s)
            if group.sync(self.now_s):
                for i, drive in enumerate(group.drives):
                    self.setpoints[i] = self.setpoints[i] + step if drive.following else drive.position
                group.command(self.setpoints, self.now_s)

    def until(self, done: Callable[[], bool], most: int = 300) -> int:
        """Ticks until ``done()``; how many."""
        for ticks in range(most):
            if done():
                return ticks
            self.tick()
        states = [drive.state.name for drive in self.group.drives]
        raise AssertionError(f"not after {most} ticks; fault {self.fault}, states {states}")

    def enable(self) -> int:
        self.group.want(Wanted.ENABLED)
        return self.until(self.group.following)

    def write(self, node: int, index: int, sub: int, value: int, size: int, bus: str = "can") -> None:
        """Expedited SDO download, by hand, in the course of ticks."""
        head = bytes([0x23 | (4 - size) << 2]) + index.to_bytes(2, "little") + bytes([sub])
        data = value.to_bytes(size, "little").ljust(4, b"\0")
        self.service[bus].send(pdo.frame(0x600 + node, head + data))
