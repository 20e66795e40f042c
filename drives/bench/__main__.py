"""``python -m drives.bench PATH``: a virtual bus with simulated drives, until SIGTERM.

``python -m drives.bench --socketcan vcan0``: the same drives on a CAN interface.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from drives.bench import options
from drives.bench.options import helped
from drives.bench.simulated import build
from drives.bench.simulated.can_bridge import InterfaceError
from drives.bench.simulated.data_sheet import EDS
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IoNode
from drives.bench.simulated.parameters import LostSync, Parameters
from drives.bench.simulated.serve import Server, open_server, run
from drives.bench.virtual.fault_script import ScriptError
from drives.texts import english, message


def main(arguments: Sequence[str] | None = None) -> None:
    parser = _parser()
    chosen = parser.parse_args(arguments)
    if (chosen.path is None) == (chosen.socketcan is None):
        parser.error(english(message("bench.either")))
    try:
        with options.equipped(_server(chosen), chosen.faults, chosen.log, chosen.serial) as served:
            run(served, _devices(chosen), sync_log=chosen.sync_log)
    except (OSError, ScriptError, InterfaceError) as error:
        parser.error(str(error))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m drives.bench", description=__doc__)
    parser.add_argument("path", nargs="?", help=helped("path"))
    parser.add_argument("--socketcan", metavar="INTERFACE", help=helped("socketcan"))
    parser.add_argument("--nodes", type=int, nargs="*", default=[1, 2, 3, 4, 5], help=helped("nodes"))
    parser.add_argument("--spindle", type=int, nargs="*", default=[], help=helped("spindle"))
    parser.add_argument("--io", type=int, nargs="*", default=[], help=helped("io"))
    parser.add_argument("--bit-rate", type=int, help=helped("bit_rate"))
    parser.add_argument(
        "--worst-stuffing",
        action="store_true",
        help=helped("worst_stuffing"),
    )
    parser.add_argument("--lost-sync", choices=[kind.value for kind in LostSync], default="hold")
    parser.add_argument("--eds", type=Path, default=EDS, help=helped("eds"))
    options.add_options(parser)
    parser.add_argument("--sync-log", metavar="FILE.npy", help=helped("sync_log"))
    return parser


def _server(chosen: argparse.Namespace) -> Server:
    logs = chosen.sync_log is not None
    return open_server(chosen.path, chosen.socketcan, chosen.bit_rate, logs, chosen.worst_stuffing)


def _devices(chosen: argparse.Namespace) -> list[SimulatedDrive | IoNode]:
    nature = Parameters(lost_sync=LostSync(chosen.lost_sync))
    axes = [SimulatedDrive(node, nature, chosen.eds) for node in chosen.nodes]
    return [*axes, *build.beside(chosen.spindle, chosen.io, nature)]


if __name__ == "__main__":
    main()
