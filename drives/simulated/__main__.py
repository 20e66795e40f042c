"""``python -m drives.simulated PATH``: a virtual bus with simulated drives, until SIGTERM."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from drives.simulated.data_sheet import EDS
from drives.simulated.parameters import LostSync
from drives.simulated.serve import serve


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m drives.simulated", description=__doc__)
    parser.add_argument("path", help="where the hub's UNIX socket is made")
    parser.add_argument("--nodes", type=int, nargs="+", default=[1, 2, 3, 4, 5], help="CANopen node ids")
    parser.add_argument("--bit-rate", type=int, default=1_000_000, help="bit/s; 0 = no bit timing")
    parser.add_argument("--lost-sync", choices=[kind.value for kind in LostSync], default="hold")
    parser.add_argument(
        "--soft", metavar="NODE=FACTOR", nargs="*", default=[], help="position loop gains, e.g. 3=0.95"
    )
    parser.add_argument("--eds", type=Path, default=EDS, help="data sheet the drives answer by")
    parser.add_argument("--sync-log", metavar="FILE.npy", help="times of SYNC on the bus, written at the end")
    chosen = parser.parse_args(arguments)
    pairs = (item.split("=") for item in chosen.soft)
    serve(
        chosen.path,
        chosen.nodes,
        bit_rate=chosen.bit_rate,
        stiffness={int(node): float(factor) for node, factor in pairs},
        lost_sync=LostSync(chosen.lost_sync),
        eds=chosen.eds,
        sync_log=chosen.sync_log,
    )


if __name__ == "__main__":
    main()
