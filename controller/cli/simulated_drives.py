"""``directrix drives simulate``: drives that run in software, on a virtual bus or a CAN interface."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer

from controller.cli.help_texts import CHANNEL
from controller.machine import drive_profiles, machine_file, nodes
from controller.runtime import simulation
from controller.runtime.simulation import (
    IoNode,
    LostSync,
    Parameters,
    SimulatedDrive,
    build,
    equipped,
    families,
    family_sheet,
    open_server,
    run,
)
from controller.verify.console import Refused, refusals, say, tell
from drives.profile import Profile
from drives.settings import BusSettings

LostSyncs = Literal["hold", "extrapolate", "fault", "quick_stop"]  # ``LostSync``

LAST_NODE = 127

Devices = list[SimulatedDrive | IoNode]


def simulate(
    profile: str = ("simulated"),
    eds: Path | None = None,
    ids: Annotated[str, typer.Option("--nodes")] = "1-5",
    spindle: str = "",
    io: str = "",
    machine: str = "",
    bus: str = "",
    channel: str = "",
    interface: Annotated[str, typer.Option("--socketcan")] = "",
    bit_rate: int | None = None,
    worst_stuffing: bool = False,
    write_eds: Path | None = None,
    bare: bool = False,
    lost_sync: LostSyncs = "hold",
    faults: Path | None = None,
    log: Path | None = None,
) -> None:
    """Simulated drives of a family or a machine, until Ctrl-C: on a virtual bus, or on a CAN interface."""
    with refusals(False), tempfile.TemporaryDirectory() as folder:
        if write_eds is not None:
            _write_sheet(write_eds, profile, bare, machine)
            return
        nature = Parameters(lost_sync=LostSync(lost_sync))
        if machine:
            wanted, devices = _of_machine(machine, bus, nature)
            if not (channel or interface):
                channel, interface = _place(wanted)
            bit_rate = wanted.bit_rate if bit_rate is None else bit_rate
        else:
            family = drive_profiles.load(profile)
            sheet = eds or _sheet(family, bare, Path(folder))
            devices = _of_family(family, sheet, bare, ids, spindle, io, nature)
        if interface and channel:
            raise Refused(say("sim_drives.two_places"))
        made = open_server(channel or str(CHANNEL), interface, bit_rate, worst_stuffing=worst_stuffing)
        with equipped(made, faults, None if log is None else str(log)):
            tell.print(say("sim_drives.serve", count=len(devices), path=made.path))
            run(made, devices)


def numbers(text: str, option: str) -> list[int]:
    """Node ids of "1-5,7". Raises Refused."""
    found: list[int] = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        first, _, last = part.partition("-")
        if not first.isdigit() or (last or "1").isdigit() is False:
            _refuse_ids(option, text)
        found += range(int(first), int(last or first) + 1)
    if any(not 1 <= node <= LAST_NODE for node in found):
        _refuse_ids(option, text)
    return found


def _refuse_ids(option: str, text: str) -> NoReturn:
    raise Refused(say("sim_drives.ids", option=option, found=text, most=LAST_NODE))


def _write_sheet(file: Path, profile: str, bare: bool, machine: str) -> None:
    """The data sheet of a family's drives; nothing is served. Raises Refused, ConfigError, OSError."""
    if machine:
        raise Refused(say("sim_drives.sheet_of_family", file=file))
    written = family_sheet.write(file, drive_profiles.load(profile), bare)
    tell.print(say("sim_drives.sheet", file=written))


def _sheet(profile: Profile, bare: bool, folder: Path) -> Path:
    """The data sheet that comes with the profile, or one made from it. Raises OSError."""
    if profile.eds and not bare:
        return Path(profile.eds)
    return family_sheet.write(folder / f"{Path(profile.name).stem}.eds", profile, bare)


def _of_family(
    profile: Profile, sheet: Path, bare: bool, ids: str, spindle: str, io: str, nature: Parameters
) -> Devices:
    """Drives of a profile, with spindles and inputs and outputs beside them. Raises Refused, OSError."""
    axes, spindles, others = numbers(ids, "--nodes"), numbers(spindle, "--spindle"), numbers(io, "--io")
    every = [*axes, *spindles, *others]
    twice = sorted({node for node in every if every.count(node) > 1})
    if twice or not every:
        raise Refused(say("sim_drives.twice" if twice else "sim_drives.none", node=next(iter(twice), 0)))
    drives = [families.restrict(SimulatedDrive(node, nature, sheet), profile, bare) for node in axes]
    return [*drives, *build.beside(spindles, others, nature)]


def _of_machine(file: str, bus: str, nature: Parameters) -> tuple[BusSettings, Devices]:
    """A bus of a machine and its nodes. Raises Refused, ConfigError, OSError."""
    made = machine_file.load(file)
    buses = {settings.name: settings for settings in nodes.bus_settings(made)}
    if (bus and bus not in buses) or (not bus and len(buses) > 1):
        key = "sim_drives.no_bus" if bus else "sim_drives.several_buses"
        raise Refused(say(key, bus=bus, allowed=", ".join(buses)))
    wanted = buses[bus] if bus else next(iter(buses.values()))
    return wanted, simulation.devices(made, wanted.name, nature)


def _place(bus: BusSettings) -> tuple[str, str]:
    """Path of the virtual bus, or the CAN interface, that a machine file names."""
    return ("", bus.channel) if bus.interface == "socketcan" else (bus.channel, "")
