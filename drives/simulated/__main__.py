"""``python -m drives.simulated PATH``: a virtual bus with simulated drives, until SIGTERM.

``python -m drives.simulated --socketcan vcan0``: the same drives on a CAN interface.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import socket
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from drives.gateways import options
from drives.settings import SpindleSettings
from drives.simulated import build
from drives.simulated.can_bridge import InterfaceError
from drives.simulated.data_sheet import EDS
from drives.simulated.drive import SimulatedDrive
from drives.simulated.io_node import IoNode
from drives.simulated.parameters import LostSync, Parameters
from drives.simulated.serve import Server, on_interface, run
from drives.simulated.spindle_motor import MotorParameters
from drives.virtual.fault_script import ScriptError
from drives.virtual.hub import Hub

MAX_WORDS = 64  # bytes of a packet that sets an input
LOAD = b"load"
COUNTS_PER_REV = 4096.0  # of spindles given by node id


Join = Callable[[Server, Sequence[SimulatedDrive | IoNode]], None]


def main(arguments: Sequence[str] | None = None, join: Join | None = None) -> None:
    """``join`` gets server and devices before they run."""
    parser = _parser()
    chosen = parser.parse_args(arguments)
    if (chosen.path is None) == (chosen.socketcan is None):
        parser.error("give either the path of the virtual bus or --socketcan INTERFACE")
    try:
        with options.equipped(
            _server(chosen), chosen.faults, chosen.log, chosen.socketcand, chosen.slcan, chosen.serial
        ) as server:
            devices = _devices(chosen)
            if chosen.heard is not None and isinstance(server, Hub):
                _hear(server, devices, chosen)
            if join is not None:
                join(server, devices)
            run(server, devices, sync_log=chosen.sync_log)
    except (OSError, ScriptError, InterfaceError) as error:
        parser.error(str(error))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m drives.simulated", description=__doc__)
    parser.add_argument("path", nargs="?", help="where the hub's UNIX socket is made")
    parser.add_argument("--socketcan", metavar="INTERFACE", help="serve on this CAN interface instead")
    parser.add_argument("--nodes", type=int, nargs="*", default=[1, 2, 3, 4, 5], help="ids of axis drives")
    parser.add_argument("--spindle", type=int, nargs="*", default=[], help="ids of spindle drives")
    parser.add_argument("--counts-per-rev", type=float, default=COUNTS_PER_REV, help="of the spindles")
    parser.add_argument(
        "--slips", action="store_true", help="spindles have inertia and slip, and feel a load"
    )
    parser.add_argument("--io", type=int, nargs="*", default=[], help="ids of CiA 401 nodes")
    parser.add_argument("--inputs", type=int, default=0, help="word of their inputs at the start")
    parser.add_argument(
        "--wire",
        metavar="OUTPUT:INPUT:SECONDS:INVERTED",
        nargs="*",
        default=[],
        help="an input that follows an output, e.g. 2:3:0.1:1",
    )
    parser.add_argument(
        "--heard", metavar="PATH", help="datagram socket: 'INPUT 0|1', 'load TORQUES*REV/S' of spindles"
    )
    parser.add_argument(
        "--bit-rate", type=int, help="bit/s; 0 = no bit timing; virtual bus: 1000000, CAN interface: 0"
    )
    parser.add_argument(
        "--worst-stuffing",
        action="store_true",
        help="let every frame take as long as it can",
    )
    parser.add_argument("--lost-sync", choices=[kind.value for kind in LostSync], default="hold")
    parser.add_argument(
        "--soft", metavar="NODE=FACTOR", nargs="*", default=[], help="position loop gains, e.g. 3=0.95"
    )
    parser.add_argument(
        "--absolute", metavar="NODE=COUNTS", nargs="*", default=[], help="drives that know where they are"
    )
    parser.add_argument(
        "--motor",
        metavar="NODE=COUNTS/S:COUNTS/S^2",
        nargs="*",
        default=[],
        help="what the axis asks of it, e.g. 1=4e8:4e9; default: a motor for some 20 000 counts per mm",
    )
    parser.add_argument("--eds", type=Path, default=EDS, help="data sheet the drives answer by")
    options.add_options(parser)
    parser.add_argument("--sync-log", metavar="FILE.npy", help="times of SYNC on the bus, written at the end")
    return parser


def _server(chosen: argparse.Namespace) -> Server:
    logs = chosen.sync_log is not None
    if chosen.socketcan is not None:
        return on_interface(chosen.socketcan, chosen.bit_rate or 0, logs, chosen.worst_stuffing)
    bit_rate = 1_000_000 if chosen.bit_rate is None else chosen.bit_rate
    return Hub(chosen.path, bit_rate, sync_log=logs, worst_stuffing=chosen.worst_stuffing)


def _devices(chosen: argparse.Namespace) -> list[SimulatedDrive | IoNode]:
    soft = {int(node): float(factor) for node, factor in (item.split("=") for item in chosen.soft)}
    nature = Parameters(lost_sync=LostSync(chosen.lost_sync))
    devices: list[SimulatedDrive | IoNode] = []
    places = {int(node): int(counts) for node, counts in (item.split("=") for item in chosen.absolute)}
    needs = {
        int(node): map(float, both.split(":")) for node, both in (one.split("=") for one in chosen.motor)
    }
    for node in chosen.nodes:
        own = build.sized(nature, *needs.get(node, (0.0, 0.0)))
        own = replace(own, stiffness=soft.get(node, 1.0), absolute_encoder=node in places)
        own = replace(own, position_counts=places.get(node, 0))
        devices.append(SimulatedDrive(node, own, chosen.eds))
    for node in chosen.spindle:
        settings = SpindleSettings("spindle", "", node, "", chosen.counts_per_rev)
        motor = MotorParameters() if chosen.slips else None
        devices.append(build.spindle(settings, replace(nature, motor=motor)))
    return devices + [_inputs_and_outputs(node, nature, chosen) for node in chosen.io]


def heard(hub: Hub, path: str) -> Callable[[Callable[[bytes], None]], None]:
    """A datagram socket beside a hub; gives what takes the reader of its packets. Raises OSError."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(path)
    own = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    own.bind(path)
    own.setblocking(False)

    def read_by(reader: Callable[[bytes], None]) -> None:
        def read() -> None:
            with contextlib.suppress(OSError):
                reader(own.recv(MAX_WORDS))

        hub.listen(own.fileno(), read)

    return read_by


def _hear(hub: Hub, devices: Sequence[SimulatedDrive | IoNode], chosen: argparse.Namespace) -> None:
    """Inputs that something outside of this process sets, and what its cut takes of the spindles."""

    def take(words: bytes) -> None:
        with contextlib.suppress(ValueError):
            name, value = words.split()
            for device in devices:
                if isinstance(device, IoNode):
                    if name != LOAD:
                        device.set_input(int(name), value == b"1", hub.bus.now_s)
                elif name == LOAD and device.node in chosen.spindle:
                    device.feel(float(value), chosen.counts_per_rev)

    heard(hub, chosen.heard)(take)


def _inputs_and_outputs(node: int, nature: Parameters, chosen: argparse.Namespace) -> IoNode:
    made = IoNode(node, nature)
    made.set_inputs(chosen.inputs, 0.0)
    for wire in chosen.wire:
        output, wired, seconds, inverted = wire.split(":")
        made.wire(int(output), int(wired), float(seconds), inverted == "1")
    return made


if __name__ == "__main__":
    main()
