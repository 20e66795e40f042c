"""Hub and simulated drives in one process, in wall-clock time."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from drives.hub import Hub
from drives.settings import NodeSettings
from drives.simulated.data_sheet import EDS
from drives.simulated.drive import SimulatedDrive
from drives.simulated.parameters import LostSync, Parameters

PRIORITY = 30  # SCHED_FIFO; below the tick's, which spins for a tenth of a millisecond only


def serve(
    path: str,
    nodes: Sequence[int | NodeSettings],
    *,
    bit_rate: int = 1_000_000,
    stiffness: Mapping[int, float] | None = None,
    lost_sync: LostSync = LostSync.HOLD,
    parameters: Parameters = Parameters(),  # noqa: B008 (frozen)
    eds: Path = EDS,
    sync_log: str | None = None,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Run a hub at ``path`` with one simulated drive per node until SIGTERM or SIGINT (or ``stop()``).

    ``eds``: data sheet of nodes given by number. ``stiffness``: factor on the position loop
    gain by node id. ``sync_log``: .npy file for the times (CLOCK_MONOTONIC, s) at which SYNC
    left the wire, written at the end.
    Must run in the main thread unless ``stop`` is given (it installs signal handlers).
    Raises OSError when the path cannot be bound.
    """
    hub = Hub(path, bit_rate, sync_log=sync_log is not None)
    for node in nodes:
        number = node if isinstance(node, int) else node.node
        nature = replace(parameters, stiffness=(stiffness or {}).get(number, 1.0), lost_sync=lost_sync)
        sheet = eds if isinstance(node, int) or not node.eds else Path(node.eds)
        hub.bus.attach(SimulatedDrive(number, nature, sheet))
    _hurry()
    gc.freeze()  # nothing made so far will become garbage: the collector need not look at it
    try:
        hub.run(stop or _signalled())
    finally:
        hub.close()
        if sync_log is not None:
            hub.syncs.save(sync_log)


def _hurry() -> None:
    """This process stands for hardware, which is never late: run before others where that is allowed."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        with contextlib.suppress(OSError):
            os.nice(-10)


def _signalled() -> Callable[[], bool]:
    asked: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _frame: asked.append(received))
    return lambda: bool(asked)
