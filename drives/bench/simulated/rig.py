"""The whole drive side of a machine in one call, for the stepped clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from drives.bench.simulated import build
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IoNode
from drives.bench.simulated.parameters import LostSync, Parameters
from drives.bench.simulated.spindle_motor import MotorParameters
from drives.bench.virtual.virtual_bus import Filters, Port, SteppedBus
from drives.settings import BusSettings, IoSettings, NodeSettings, SpindleSettings


class Rig:
    """Stepped buses with simulated devices; ``advance`` moves all of them to one time."""

    def __init__(self, buses: Mapping[str, SteppedBus], drives: Mapping[str, SimulatedDrive]) -> None:
        self.buses = dict(buses)  # by BusSettings.name
        self.drives = dict(drives)  # by NodeSettings.name
        self.spindle: SimulatedDrive | None = None
        self.io: dict[str, IoNode] = {}  # by IoSettings.name
        self.watchers: list[Callable[[float], None]] = []  # of what the motors do: told the time

    @property
    def now_s(self) -> float:
        return next(iter(self.buses.values())).now_s

    def port(self, filters: Filters | None = None, bus: str | None = None) -> Port:
        """A frame socket on a bus, by default the only one."""
        name = next(iter(self.buses)) if bus is None else bus
        return self.buses[name].port(filters)

    def advance(self, now_s: float) -> None:
        for bus in self.buses.values():
            bus.advance(now_s)
        for watch in self.watchers:
            watch(now_s)


def rig(
    nodes: Sequence[NodeSettings],
    buses: Sequence[BusSettings],
    *,
    spindle: SpindleSettings | None = None,
    io: Sequence[IoSettings] = (),
    stiffness: Mapping[str, float] | None = None,
    lost_sync: LostSync = LostSync.HOLD,
    parameters: Parameters = Parameters(),  # noqa: B008 (frozen)
    motor: MotorParameters | None = None,
    start_s: float = 0.0,
    worst_stuffing: bool = False,
) -> Rig:
    """Stepped buses with a simulated device per node, from power-on at ``start_s``.

    A device has the object dictionary of its node's data sheet.
    ``motor``: how the spindle lags and slips; None = it does not.
    ``stiffness`` is a factor on the position loop gain by axis name (0.95 = 5 % softer);
    ``worst_stuffing`` lets every frame take as long as it can.
    Raises KeyError for a node on a bus that is not there, OSError for a data sheet that is not.
    """
    nature = replace(parameters, lost_sync=lost_sync)
    made = Rig({bus.name: SteppedBus(bus.bit_rate, start_s, worst_stuffing) for bus in buses}, {})
    for node in nodes:
        one = replace(nature, stiffness=(stiffness or {}).get(node.name, 1.0))
        made.drives[node.name] = build.drive(node, one)
        made.buses[node.bus].attach(made.drives[node.name])
    if spindle is not None:
        made.spindle = build.spindle(spindle, replace(nature, motor=motor))
        made.buses[spindle.bus].attach(made.spindle)
    for settings in io:
        made.io[settings.name] = build.inputs_and_outputs(settings, nature)
        made.buses[settings.bus].attach(made.io[settings.name])
    return made
