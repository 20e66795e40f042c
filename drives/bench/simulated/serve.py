"""A bus with simulated devices in one process, in wall-clock time: the virtual bus, or a CAN interface."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from collections.abc import Callable, Sequence

from drives.bench.simulated.can_bridge import CanBridge, open_interface
from drives.bench.simulated.drive import SimulatedDrive
from drives.bench.simulated.io_node import IoNode
from drives.bench.virtual.hub import Hub

PRIORITY = 30  # SCHED_FIFO; below the tick's, which spins for a tenth of a millisecond only

BIT_RATE = 1_000_000  # of a virtual bus

Server = Hub | CanBridge


def run(server: Server, devices: Sequence[SimulatedDrive | IoNode], sync_log: str | None = None) -> None:
    """Attach the devices and serve until SIGTERM or SIGINT, in the main thread.

    ``sync_log``: .npy file for the times (CLOCK_MONOTONIC, s) at which SYNC left the wire, made at the end.
    """
    for device in devices:
        server.bus.attach(device)
    _hurry()
    gc.freeze()  # nothing made so far will become garbage: the collector need not look at it
    try:
        server.run(_signalled())
    finally:
        server.close()
        if sync_log is not None:
            server.syncs.save(sync_log)


def open_server(
    path: str | None,
    interface: str | None,
    bit_rate: int | None = None,
    sync_log: bool = False,
    worst_stuffing: bool = False,
) -> Server:
    """A virtual bus at ``path``, or a CAN interface; give it to ``run``. Raises OSError, InterfaceError.

    ``bit_rate``: None = ``BIT_RATE`` of a virtual bus, and no bit timing beside that of an interface.
    """
    if interface:
        return CanBridge(open_interface(interface), bit_rate or 0, sync_log, interface, worst_stuffing)
    bit_rate = BIT_RATE if bit_rate is None else bit_rate
    return Hub(path or "", bit_rate, sync_log, worst_stuffing=worst_stuffing)


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
