"""A bus with simulated devices in one process, in wall-clock time: the virtual bus, or a CAN interface."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from drives.simulated import build
from drives.simulated.build import NodeLike
from drives.simulated.can_bridge import CanBridge, open_interface
from drives.simulated.data_sheet import EDS
from drives.simulated.drive import SimulatedDrive
from drives.simulated.io_node import IoNode
from drives.simulated.parameters import LostSync, Parameters
from drives.virtual.hub import Hub

PRIORITY = 30  # SCHED_FIFO; below the tick's, which spins for a tenth of a millisecond only

Server = Hub | CanBridge


def serve(
    path: str,
    nodes: Sequence[int | NodeLike],
    *,
    bit_rate: int = 1_000_000,
    stiffness: Mapping[int, float] | None = None,
    lost_sync: LostSync = LostSync.HOLD,
    parameters: Parameters = Parameters(),  # noqa: B008 (frozen)
    eds: Path = EDS,
    sync_log: str | None = None,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Run a hub at ``path`` with one simulated device per node until SIGTERM or SIGINT (or ``stop()``).

    ``eds``: data sheet of drives given by number. ``stiffness``: factor on the position loop
    gain by node id. ``sync_log``: .npy file for the times (CLOCK_MONOTONIC, s) at which SYNC
    left the wire, written at the end.
    Must run in the main thread unless ``stop`` is given (it installs signal handlers).
    Raises OSError when the path cannot be bound.
    """
    server = Hub(path, bit_rate, sync_log=sync_log is not None)
    nature = replace(parameters, lost_sync=lost_sync)
    devices = [_device(node, _softened(nature, node, stiffness), eds) for node in nodes]
    run(server, devices, sync_log=sync_log, stop=stop)


def run(
    server: Server,
    devices: Sequence[SimulatedDrive | IoNode],
    *,
    sync_log: str | None = None,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Attach the devices and serve until told to stop; as ``serve``."""
    for device in devices:
        server.bus.attach(device)
    _hurry()
    gc.freeze()  # nothing made so far will become garbage: the collector need not look at it
    try:
        server.run(stop or _signalled())
    finally:
        server.close()
        if sync_log is not None:
            server.syncs.save(sync_log)


def on_interface(
    channel: str, bit_rate: int = 0, sync_log: bool = False, worst_stuffing: bool = False
) -> CanBridge:
    """A server on a CAN interface; give it to ``run``. Raises InterfaceError."""
    return CanBridge(open_interface(channel), bit_rate, sync_log, channel, worst_stuffing)


def _softened(nature: Parameters, node: int | NodeLike, stiffness: Mapping[int, float] | None) -> Parameters:
    number = node if isinstance(node, int) else node.node
    return replace(nature, stiffness=(stiffness or {}).get(number, 1.0))


def _device(node: int | NodeLike, nature: Parameters, eds: Path) -> SimulatedDrive | IoNode:
    if isinstance(node, int):
        return SimulatedDrive(node, nature, eds)
    return build.device(node, nature)


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
