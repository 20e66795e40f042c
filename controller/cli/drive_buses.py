"""The buses of a machine for ``directrix drives``: which are asked for, opened and closed again."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

from controller.cli.help_texts import CHANNEL
from controller.machine import machine_file, nodes
from controller.machine.model import Machine
from controller.verify.console import Refused, say
from drives import bus as buses
from drives import commission as commissioning
from drives import pdo
from drives.commissioning.wanted import Settings
from drives.settings import BusSettings, MasterSettings

TIMEOUT_S = 3.0  # for an SDO answer: a drive that writes its memory, or a busy computer of simulated ones


@dataclass(frozen=True, slots=True)
class Joined:
    """One bus of the machine with the nodes that are wanted there."""

    bus: BusSettings
    network: commissioning.Network
    nodes: tuple[Settings, ...]


def machine(file: str, period_ms: float | None = None) -> Machine:
    machine = machine_file.load(file)
    return machine if period_ms is None else machine_file.with_period(machine, period_ms / 1e3)


def _called(node: Settings) -> tuple[str, str]:
    """A drive is asked for by its name or its node id."""
    return node.name, str(node.node)


def _chosen(machine: Machine, bus: str, drive: str) -> list[tuple[BusSettings, tuple[Settings, ...]]]:
    """The buses that are asked for, with those of their nodes. Raises Refused, ConfigError."""
    every = nodes.all_settings(machine)
    names = [settings.name for settings in nodes.bus_settings(machine)]
    if bus and bus not in names:
        raise Refused(say("cli.drives.no_bus", bus=bus, names=", ".join(names)))
    known = ", ".join(node.name for node in every)
    if drive and all(drive not in _called(node) for node in every):
        raise Refused(say("cli.drives.no_drive", drive=drive, known=known))
    wanted = [node for node in every if drive in ("", *_called(node)) and bus in ("", node.bus)]
    found = [
        (settings, tuple(node for node in wanted if node.bus == settings.name))
        for settings in nodes.bus_settings(machine)
        if bus in ("", settings.name)
    ]
    return [(settings, its) for settings, its in found if its or not drive]


@contextlib.contextmanager
def joined(made: Machine, bus: str, channel: str, drive: str = "") -> Iterator[list[Joined]]:
    """Ports on the buses that are asked for; closed at the end. Raises Refused, BusError, ConfigError."""
    chosen = _chosen(made, bus, drive)
    if channel and len(chosen) > 1:
        raise Refused(say("cli.drives.several_buses"))
    with contextlib.ExitStack() as stack:
        found = []
        for named, its in chosen:
            settings = replace(named, channel=channel) if channel else named
            if not settings.channel:
                key = f"cli.drives.no_channel_{'virtual' if settings.interface == 'virtual' else 'other'}"
                raise Refused(say(key, bus=settings.name, interface=settings.interface, path=CHANNEL))
            port = buses.open(settings, pdo.SERVICE_FILTERS)
            stack.callback(port.close)
            pump = commissioning.wall_pump(port.fileno())
            found.append(Joined(settings, commissioning.Network(port, pump, TIMEOUT_S), its))
        yield found


def see_alone(one: Joined, master: MasterSettings) -> None:
    """A running controller sends heartbeats: its drives are not to be taken from under it."""
    heard = one.network.nmt_states
    if one.network.wait(lambda: master.node_id in heard, 3.0 * master.heartbeat_s):
        raise Refused(say("cli.drives.controller_runs", name=one.bus.name, node_id=master.node_id))
