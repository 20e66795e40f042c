"""A live machine: hub and simulated drives where the bus is virtual, plan, and tick, each a process."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
import numpy.typing as npt

from controller.handoff import Recorder, Snapshot, SnapshotBoard, piece_pair, request_pair, send_request
from controller.machine import Machine
from controller.session import processes
from controller.session.startup import SessionError
from controller.state import FAULTS, Mode, Request

Rows = npt.NDArray[np.float64]

HUB_S = 20.0  # for a hub to be there, a process to publish
READY_S = 90.0  # for commissioning, homing and enabling
LOOK_S = 0.05
HUB_PRIORITY = 40  # of SCHED_FIFO, below the tick's


@dataclass(slots=True)
class Live:
    """Handles on a running live machine."""

    machine: Machine
    tick: BaseProcess
    plan: BaseProcess
    board: SnapshotBoard
    recorder: Recorder
    operator: socket.socket
    sync_stamps_s: dict[str, Rows]  # by virtual bus, when SYNC left the wire; filled at the end

    def request(self, request: Request, value: float = 0.0) -> None:
        """What an operator asks for."""
        send_request(self.operator, request, value)

    def wait_for(self, done: Callable[[Snapshot], bool], longest_s: float, what: str) -> Snapshot:
        """The first snapshot that is ``done``. SessionError on a dead process, a fault, or time over."""
        give_up_s = time.monotonic() + longest_s
        while True:
            now = self.board.read()
            if now is not None and done(now):
                return now
            if now is not None and now.mode is Mode.FAULT:
                row = FAULTS[now.fault]
                raise SessionError(f"While waiting for {what}: {row.text} {row.remedy}")
            for name, process in (("tick", self.tick), ("plan", self.plan)):
                if not process.is_alive():
                    raise SessionError(
                        f"The {name} process ended while waiting for {what}; see its message above."
                    )
            if time.monotonic() > give_up_s:
                raise SessionError(f"Waited {longest_s:.0f} s for {what} in vain; is the computer very busy?")
            time.sleep(LOOK_S)

    def ready(self) -> Snapshot:
        """Homed, enabled, at rest, the first piece queued."""
        return self.wait_for(
            lambda now: now.mode is Mode.READY and now.accepted > 0, READY_S, "the machine to be ready"
        )

    def run(self, progress: Callable[[Snapshot], None] = lambda _: None) -> tuple[Rows, Snapshot]:
        """Cycle start to the program's end or a fault at rest: recorder rows and the last snapshot."""
        rows = [self.recorder.drain()[:0]]
        self.request(Request.START)
        self.wait_for(lambda now: now.mode is not Mode.READY, HUB_S, "the start")
        while True:
            time.sleep(LOOK_S)
            rows.append(self.recorder.drain())
            now = self.board.read()
            if now is None or not self.tick.is_alive():
                raise SessionError(
                    "The tick process ended in the middle of the cut; the drives stopped by themselves."
                )
            progress(now)
            if now.at_rest and now.mode not in (Mode.RUNNING, Mode.STOPPING, Mode.HOLD):
                rows.append(self.recorder.drain())
                return np.concatenate(rows), now


@contextlib.contextmanager
def started(machine: Machine, program: bytes, name: str) -> Iterator[Live]:
    """A live machine that has ``program`` loaded; everything ends with the block.

    Virtual buses get a hub with simulated drives each, other buses are what they are.
    Raises SessionError.
    """
    with tempfile.TemporaryDirectory(prefix="directrix-") as folder, contextlib.ExitStack() as ending:
        stamps_s: dict[str, Rows] = {}
        machine = _with_hubs(machine, Path(folder), ending, stamps_s)
        plan_end, piece_end = piece_pair()
        operator, request_end = request_pair()
        board = SnapshotBoard(str(Path(folder) / "snapshot"))
        recorder = Recorder(str(Path(folder) / "recorder"))
        to_tick = processes.Wires(piece_end, request_end, str(board.block.path), str(recorder.block.path))
        to_plan = processes.Wires(plan_end, operator, str(board.block.path), str(recorder.block.path))
        spawn = multiprocessing.get_context("spawn")
        tick = spawn.Process(target=processes.tick_main, args=(machine, to_tick), daemon=True)
        plan = spawn.Process(target=processes.plan_main, args=(machine, to_plan, program, name), daemon=True)
        for process in (tick, plan):
            process.start()
            ending.callback(_end, process)
        # The children have their own ends; ours would hide that the other one is gone.
        for end in (plan_end, piece_end, request_end):
            end.close()
        ending.callback(operator.close)
        yield Live(machine, tick, plan, board, recorder, operator, stamps_s)


def _end(process: BaseProcess) -> None:
    process.terminate()
    process.join(5.0)
    if process.is_alive():
        process.kill()
        process.join()


def _with_hubs(
    machine: Machine, folder: Path, ending: contextlib.ExitStack, stamps_s: dict[str, Rows]
) -> Machine:
    """Start a hub with drives for each virtual bus; the machine with their paths as channels."""
    buses = []
    for bus in machine.buses:
        if bus.interface == "virtual":
            path, log = folder / f"{bus.name}.hub", folder / f"{bus.name}.sync.npy"
            nodes = [str(axis.node) for axis in machine.axes if axis.bus == bus.name]
            bus = replace(bus, channel=str(path))
            ending.callback(_end_hub, _hub(path, nodes, bus.bit_rate, log), bus.name, log, stamps_s)
        buses.append(bus)
    return replace(machine, buses=tuple(buses))


def _hub(path: Path, nodes: list[str], bit_rate: int, log: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "drives.simulated", str(path), "--bit-rate", str(bit_rate)]
    hub = subprocess.Popen([*command, "--sync-log", str(log), "--nodes", *nodes])
    with contextlib.suppress(OSError):  # a simulated bus that is late is no bus; not permitted: it may be
        os.sched_setscheduler(hub.pid, os.SCHED_FIFO, os.sched_param(HUB_PRIORITY))
    give_up_s = time.monotonic() + HUB_S
    while not path.exists():
        if hub.poll() is not None or time.monotonic() > give_up_s:
            hub.kill()
            raise SessionError("The virtual bus did not start; see its message above.")
        time.sleep(LOOK_S)
    return hub


def _end_hub(hub: subprocess.Popen[bytes], name: str, log: Path, stamps_s: dict[str, Rows]) -> None:
    """The hub writes its log at the end; read it before the folder goes."""
    hub.terminate()
    try:
        hub.wait(5.0)
    except subprocess.TimeoutExpired:
        hub.kill()
    if log.exists():
        stamps_s[name] = np.load(log)
