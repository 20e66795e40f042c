"""The processes of a real machine load nothing of the bench: no simulated device, virtual bus or fault.

Each runs in an interpreter of its own, on CAN interfaces whose other end is a socket without drives.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

REAL = """
import os, signal, socket, sys
from dataclasses import replace
from pathlib import Path

from controller.machine import machine_file
from drives import bus as ways
from drives.ports.can_socket import CanSocket

folder = Path(sys.argv[1])
machine = machine_file.load("machining_centre")
buses = [replace(bus, interface="socketcan", channel="can0") for bus in machine.buses]
machine = replace(machine, buses=tuple(buses))
silent = []

def open_socket(settings, filters):
    own, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    silent.append(far)
    return CanSocket(own, settings.name)

ways.open_socket = open_socket
"""

ENDS = """
from controller.ipc.handoff import Recorder, SnapshotBoard, piece_pair, request_pair

paths = [str(folder / "snapshot"), str(folder / "recorder")]
kept = SnapshotBoard(paths[0], axes=len(machine.axes)), Recorder(paths[1])
plan_end, piece_end = piece_pair()
operator, request_end = request_pair()
"""

TICK = """
from controller.runtime import tick_process
from controller.runtime.children import Job

def end(*_):
    now = kept[0].read()
    if now is not None and now.tick > 20:
        os.kill(os.getpid(), signal.SIGTERM)

signal.signal(signal.SIGALRM, end)
signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
tick_process.main(Job(machine, piece_end.detach(), request_end.detach(), *paths))
"""

PLAN = """
import threading
from multiprocessing.connection import Connection

from controller.runtime import planning
from controller.runtime.plan_messages import Order

own, its = socket.socketpair()
line = Connection(own.detach())
line.send(Order(1, "commission"))
line.send(Order(2, "drop"))
job = planning.PlanJob(
    machine, plan_end.detach(), operator.detach(), its.detach(), paths[0], folder / "checks", folder
)
threading.Thread(target=planning.main, args=(job,), daemon=True).start()
while line.recv().number != 2: pass
"""

# Its tick and plan end at once: they find no interface.
SERVICE = """
import contextlib

from controller.runtime.startup import SessionError
from controller.service import main, sequences
from controller.service.command_handlers import CommandHandlers
from controller.service.folders import Folders
from controller.service.service import Service

service = Service(machine, Folders.within(folder))
service.engine.start_hubs()
handlers = CommandHandlers(service)
with contextlib.suppress(SessionError):
    sequences.power_up(service)
service.engine.tell_tool(3)
handlers.close()
service.close()
"""

LOADED = """
print(*sorted(name for name in sys.modules if name.startswith(("drives.bench", "controller.runtime.bench"))))
"""

PROCESSES = {"tick": REAL + ENDS + TICK, "plan": REAL + ENDS + PLAN, "service": REAL + SERVICE}


def loaded_by(source: str, folder: Path) -> list[str]:
    """Modules of the bench that are there when a process has done this."""
    run = subprocess.run(
        [sys.executable, "-c", source + LOADED, str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()[-1].split()


@pytest.mark.parametrize("name", PROCESSES)
def test_a_process_of_a_real_machine_loads_nothing_of_the_bench(name: str, tmp_path: Path) -> None:
    assert loaded_by(PROCESSES[name], tmp_path) == []


def test_a_simulated_bus_loads_it(tmp_path: Path) -> None:
    """So what is looked for is there to be found."""
    assert "drives.bench.virtual.hub" in loaded_by(
        "import sys\nfrom controller.runtime import simulation\n", tmp_path
    )
