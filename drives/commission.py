"""Commissioning over SDO: every drive is what the machine file says, or a sentence tells why not.

Nothing is assumed to have been stored in a drive: each start reads all that the cyclic
side relies on, writes what is not so, and reads that back. So a second run writes
nothing. Once a drive is NMT operational the tick's group takes over; the network stays
for the slow path (homing mode, parameters).

The parts are in ``drives.commissioning``: the network without a thread, data sheets, what
is wanted, what is possible, one drive's reads and writes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from drives import pdo
from drives.arranged import Arranged
from drives.commissioning import identity, possible, sheet, stopping, twins
from drives.commissioning.network import (
    CommissionError,
    Network,
    Port,
    Pump,
    Stepped,
    of_drive,
    stepped_pump,
    wall_pump,
)
from drives.commissioning.remote import NMT_PRE_OPERATIONAL, NMT_START, Change, Drive, Outcome
from drives.commissioning.units import UnitError, units_of
from drives.commissioning.values import shown
from drives.commissioning.wanted import Setting, Settings, Step, interpolation_time, steps_of
from drives.profile import Supervision
from drives.settings import IoSettings, MasterSettings, NodeSettings, SpindleSettings
from drives.texts import Message, message

__all__ = [
    "Arranged",
    "Change",
    "CommissionError",
    "Drive",
    "Network",
    "Outcome",
    "Port",
    "Pump",
    "Setting",
    "Settings",
    "Step",
    "Stepped",
    "commission",
    "interpolation_time",
    "of_drive",
    "on_paper",
    "set_mode",
    "shown",
    "stepped_pump",
    "steps_of",
    "wall_pump",
]

ENABLED_MASK, ENABLED = 0x6F, 0x27  # statusword of operation enabled


def commission(
    network: Network,
    nodes: Sequence[Settings],
    master: MasterSettings,
    *,
    store: bool = False,
    bit_rate: int = 0,
) -> list[Outcome]:
    """Make every node on this network ready for the tick and start it (NMT operational).

    ``store``: have those that were changed keep it. ``bit_rate`` of the bus, 0 = not looked at.
    Raises CommissionError at the first thing that is not as it must be: before a frame is
    sent where data sheet and profile show it, otherwise with the drives left pre-operational.
    """
    drives = [Drive(network, settings) for settings in nodes]
    for drive, settings in zip(drives, nodes, strict=True):
        found, warned = _of_paper(settings, master, drive.sheet, bit_rate)
        if found:
            raise CommissionError(drive.says(_sentences(found)))
        drive.outcome.warnings += warned
    for drive in drives:
        if not drive.answers():
            # A stopped node is deaf to SDO; a moving one would have answered.
            drive.command(NMT_PRE_OPERATIONAL)
        drive.meet()
    _see_single(network, drives)
    for drive, settings in zip(drives, nodes, strict=True):
        _prepare(network, drive, settings, master)
        if store and drive.outcome.changes:
            drive.store()
    _see_undisturbed(network, drives)
    network.nmt_states.clear()
    for drive in drives:
        drive.command(NMT_START)
    for drive, settings in zip(drives, nodes, strict=True):
        if _sends_heartbeats(settings):
            _see_operational(network, drive)
        else:
            drive.read(0x1000)  # answered after it has heard the start command
    return [drive.outcome for drive in drives]


def on_paper(
    settings: Settings, master: MasterSettings, bit_rate: int = 0
) -> tuple[list[Message], list[Message]]:
    """What ``commission`` would refuse of a node that has its sheet's defaults, and what it would warn of."""
    try:
        about = sheet.of(settings)
    except sheet.SheetError as error:
        return [of_drive(settings, error)], []
    problems, warned = _of_paper(settings, master, about, bit_rate)
    problems = (*problems, *possible.default_problems(settings, about))
    warned = (*warned, *identity.contradictions(about))
    return [of_drive(settings, one) for one in problems], [of_drive(settings, one) for one in warned]


def _sentences(found: Sequence[Message]) -> Message:
    """Each with a full stop."""
    return message("text", text=[message("sentence", text=one) for one in found])


@lru_cache(256)
def _of_paper(
    settings: Settings, master: MasterSettings, about: sheet.Sheet, bit_rate: int
) -> tuple[tuple[Message, ...], tuple[Message, ...]]:
    """Problems and warnings; the same drives are looked at with every program of a folder, and each start."""
    found = possible.problems(settings, master, about, bit_rate)
    return tuple(found), tuple(possible.warnings(settings, master, about))


def _prepare(network: Network, drive: Drive, settings: Settings, master: MasterSettings) -> None:
    _identify(drive, settings)
    if not isinstance(settings, IoSettings):
        _see_off(network, drive)
    drive.command(NMT_PRE_OPERATIONAL)
    if isinstance(settings, IoSettings):
        for step in steps_of(settings, master, drive.sheet):
            drive.apply(step)
        return
    try:
        _set_up(drive, settings, master)
    except UnitError as error:
        raise CommissionError(of_drive(settings, error)) from error


def _set_up(drive: Drive, settings: NodeSettings | SpindleSettings, master: MasterSettings) -> None:
    units = units_of(settings, drive.find)
    for step in steps_of(settings, master, drive.sheet, units):
        drive.apply(step)
    if isinstance(settings, NodeSettings):
        drive.outcome.arranged = stopping.arrange(drive, settings, units)
    else:
        drive.outcome.arranged = stopping.of_spindle(settings, units)
    drive.set_mode(_mode(settings))


def _see_single(network: Network, drives: Sequence[Drive]) -> None:
    """Every node id is one drive's."""
    found = twins.doubled(network, [drive.settings.node for drive in drives])
    network.booted.clear()
    if found:
        by_node = {drive.settings.node: drive for drive in drives}
        told = [by_node[node].says(twins.sentence(serials)) for node, serials in found.items()]
        before = [message("sentence", text=one) for one in told[:-1]]
        raise CommissionError(message("text", text=[*before, told[-1]]))


def _see_undisturbed(network: Network, drives: Sequence[Drive]) -> None:
    """A drive that starts up meanwhile is a second one with this node id, or it has lost what it was told."""
    again = [drive for drive in drives if drive.settings.node in network.booted]
    if again:
        _see_single(network, again)
        raise CommissionError(again[0].says(message("drive.booted_again")))


def _mode(settings: NodeSettings | SpindleSettings) -> int:
    return settings.profile.mode.value if isinstance(settings, NodeSettings) else settings.mode


def _see_off(network: Network, drive: Drive) -> None:
    """Process data and mode are changed on a drive without torque only."""

    def off() -> bool:
        return drive.read(0x6041) & ENABLED_MASK != ENABLED

    if not network.wait(off):
        raise CommissionError(drive.says(message("drive.enabled")))


def _sends_heartbeats(settings: Settings) -> bool:
    """A guarded drive is asked by the tick: a poll from here would start its life guarding at once."""
    return isinstance(settings, IoSettings) or settings.profile.supervision is not Supervision.GUARDING


def _see_operational(network: Network, drive: Drive) -> None:
    node = drive.settings.node
    if not network.wait(lambda: network.nmt_states.get(node) == pdo.NMT_OPERATIONAL):
        raise CommissionError(drive.says(message("drive.not_operational")))


def set_mode(network: Network, node: NodeSettings | SpindleSettings, mode: int) -> None:
    """Change a standing drive's mode of operation (6 homing, 8 cyclic synchronous position)."""
    Drive(network, node).set_mode(mode)


def terminals(network: Network, node: NodeSettings) -> int | None:
    """What a drive sees at its terminals (60FDh); None: it does not say. Raises CommissionError."""
    drive = Drive(network, node)
    return drive.read(0x60FD) if drive.has(0x60FD, 0) else None


def _identify(drive: Drive, settings: Settings) -> None:
    """The node is of its kind, has the mode, and is the one of data sheet and machine file."""
    needed = 401 if isinstance(settings, IoSettings) else 402
    kind = drive.read(0x1000) & 0xFFFF
    if kind != needed:
        raise CommissionError(drive.says(message("drive.other_profile", kind=kind, needed=needed)))
    words = [word for word in identity.words_of(settings, drive.sheet) if drive.has(0x1018, word.sub)]
    found = {word.sub: drive.read(0x1018, word.sub) for word in words}
    for word in words:
        if sentence := word.mismatch(found[word.sub]):
            raise CommissionError(drive.says(sentence))
    drive.outcome.warnings += identity.contradictions(drive.sheet, found)
    if not isinstance(settings, IoSettings) and drive.has(0x6502, 0):
        mode = _mode(settings)
        modes = drive.read(0x6502)
        if not modes & 1 << (mode - 1):
            raise CommissionError(drive.says(message("drive.no_mode", modes=modes, mode=mode)))
