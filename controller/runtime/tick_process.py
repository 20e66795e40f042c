"""What runs in the tick's process.

The plan's process (``planning``) owns SDO, this one the cyclic frames. They meet in the piece socket
and the snapshot alone, so either may be killed: without the plan the tick stops on the path; without the tick
the pump (``pump_process``) brakes on the path and is silent; without the pump the drives stop by their own
supervision.
"""

from __future__ import annotations

import contextlib
import socket
import sys
import time

from controller.geometry import placement, surfaces
from controller.ipc.handoff import Recorder, RequestInbox, SnapshotBoard
from controller.ipc.inverter_slot import InverterSlot
from controller.ipc.piece_socket import PACKETS_PER_S, PieceInbox
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import chain, message, text
from controller.runtime import children, cores, cyclic, pump_process
from controller.runtime.children import Job
from controller.tick import loop
from controller.tick.cycle import Cycle
from drives import bus, pdo, real_time
from drives.pump.plan_memory import Memory

# A busy computer has been seen to hold a process back for 20 ms and more; beyond this the
# heartbeats judge. On a real bus two lost feedbacks in a row are a fault.
VIRTUAL_TIMEOUT_S = 0.150

# Of ``real_time.prepare`` and ``cores.take``; the texts ``privilege.locked`` ... have an operator's words.
PRIVILEGES = ("locked", "slack", "fifo", "awake", "own_core")

# What messages of pieces are made of is loaded at once: taking one would load it within a tick.
OF_MESSAGES = (surfaces, placement)


def main(job: Job) -> None:
    """The real-time process: opens the buses and ticks until SIGTERM. Raises BusError."""
    machine, asked = job.machine, children.EndRequest()
    ports = {
        settings.name: bus.open(settings, pdo.TICK_FILTERS) for settings in machine_file.bus_settings(machine)
    }
    group = cyclic.group(machine, ports, _patience_s(machine))
    simulated = machine.is_simulated
    plans = pump = None
    only_counts = simulated and machine.late == "count"  # of such a computer nobody asks to be in time
    if machine.has_pump and not only_counts and pump_process.possible(ports):
        plans, descriptor = Memory.create(len(machine.axes), machine.has_threads)
        pump = pump_process.PumpProcess(machine, group, descriptor, _patience_s(machine))
    cycle = Cycle(
        machine,
        group,
        PieceInbox(
            children.joined(job.pieces, socket.SOCK_SEQPACKET), round(PACKETS_PER_S * machine.period_s)
        ),
        RequestInbox(children.joined(job.requests, socket.SOCK_DGRAM), len(machine.axes)),
        SnapshotBoard(job.snapshot_path, create=False),
        Recorder(job.recorder_path, create=False),
        time.monotonic,
        plans,
        None if job.inverter is None else InverterSlot(job.inverter, create=False),
    )
    of_pump = pump.wait_until_ready() if pump is not None else real_time.Granted()
    granted = of_pump & real_time.prepare()
    granted["own_core"] = cores.take(granted["fifo"]) is not None
    if pump is not None:
        cores.give(pump.pid, granted["fifo"])
    if missing := lacking(granted, simulated):
        with contextlib.suppress(OSError):  # nobody may be there to read it
            print(missing, file=sys.stderr, flush=True)
    hubs = [port for port in ports.values() if isinstance(port, bus.HubSocket)]
    turning = loop.Loop(cycle, loop.WallClock(), simulated, hubs, pump is not None, pump)
    turning.run(lambda: not asked.yes)
    if turning.error is None:
        turning.stand_down()
    if pump is not None:
        pump.end()
    group.close()
    if turning.error is not None:
        raise turning.error


def lacking(granted: real_time.Granted, simulated: bool) -> str:
    """What a tick has to do without, in a sentence for the journal; "" where a simulated one bears it."""
    missing = [message(f"privilege.{name}") for name, given in granted.items() if not given]
    if simulated or not missing:
        return ""
    return text(message("privilege.missing", names=chain("comma", missing)))


def _patience_s(machine: Machine) -> float:
    """Simulated drives on a virtual bus are a process of this computer and may be late."""
    return VIRTUAL_TIMEOUT_S if machine.is_simulated else 0.0
