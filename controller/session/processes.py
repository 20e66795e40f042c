"""What runs in the two processes of a live machine: the plan's and the tick's.

The plan's process owns SDO, the tick's the cyclic frames. They meet in the piece
socket and the snapshot alone, so either may be killed: without the plan the tick
stops on the path; without the tick the drives stop by their own supervision.
"""

from __future__ import annotations

import ctypes
import signal
import socket
import threading
import time
from dataclasses import dataclass

from controller import config
from controller.handoff import (
    PieceInbox,
    PieceMessage,
    PieceOutbox,
    Recorder,
    RequestInbox,
    Snapshot,
    SnapshotBoard,
    send_request,
)
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.plan import blocks, path
from controller.plan.planner import Planner
from controller.session.startup import StartUp
from controller.state import Fault, Mode, Request
from controller.tick import loop
from controller.tick.cycle import Cycle
from drives import bus, commission, pdo
from drives.drive import Drive
from drives.group import Group

PR_SET_NAME = 15
PLAN_TURN_S = 0.010
KEEPALIVE_S = 0.025
COME_UP_S = 30.0


@dataclass(frozen=True, slots=True)
class Wires:
    """What one process is given of the door: its end of each socket, and where shared memory is."""

    pieces: socket.socket
    requests: socket.socket
    snapshot_path: str
    recorder_path: str


def name_process(name: str) -> None:
    """The name that ``ps`` shows (15 characters)."""
    ctypes.CDLL(None).prctl(PR_SET_NAME, name.encode(), 0, 0, 0)


class Asked:
    """Becomes true when this process is asked to end."""

    def __init__(self) -> None:
        self.yes = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._hear)

    def _hear(self, _number: int, _frame: object) -> None:
        self.yes = True


def tick_main(machine: Machine, wires: Wires) -> None:
    """The real-time process: opens the buses and ticks until SIGTERM."""
    name_process("directrix-tick")
    asked = Asked()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the operator's; the parent ends us in order
    ports = {settings.name: bus.open(settings, pdo.TICK_FILTERS) for settings in config.bus_settings(machine)}
    group = Group(
        [Drive(node) for node in config.node_settings(machine)], ports, config.master_settings(machine)
    )
    cycle = Cycle(
        machine,
        group,
        PieceInbox(wires.pieces),
        RequestInbox(wires.requests),
        SnapshotBoard(wires.snapshot_path, create=False),
        Recorder(wires.recorder_path, create=False),
        time.monotonic,
    )
    group.start()
    loop.prepare()
    filenos = [port.fileno() for port in ports.values() if hasattr(port, "fileno")]
    loop.Loop(cycle, loop.WallClock(), filenos).run(lambda: not asked.yes)
    group.stop_sync()
    group.close()


def plan_main(machine: Machine, wires: Wires, program: bytes, name: str) -> None:
    """The plan's process: brings the machine up, then keeps the queue full until SIGTERM."""
    name_process("directrix-plan")
    asked = Asked()
    plan = _Plan(machine, wires)
    plan.start_up()
    now = plan.snapshot()
    traced = path.trace(blocks.read(program, machine, name), machine, plan.kinematics, _five(now.joints))
    plan.planner.load(traced, now.queue_end_s)
    while not asked.yes:
        plan.planner.work(plan.snapshot())
        plan.flush()
        time.sleep(PLAN_TURN_S)


class _Plan:
    """Planner, keepalive and start-up at the plan's end of the door."""

    def __init__(self, machine: Machine, wires: Wires) -> None:
        self.kinematics = Kinematics(machine)
        self._machine, self._wires = machine, wires
        self._board = SnapshotBoard(wires.snapshot_path, create=False)
        self._outbox = PieceOutbox(wires.pieces)
        self._lock = threading.Lock()  # a keepalive must not come between the packets of a message
        self.planner = Planner(machine, self.kinematics, self._send)
        threading.Thread(target=self._keep_alive, daemon=True).start()

    def _send(self, message: PieceMessage) -> bool:
        with self._lock:
            return self._outbox.send(message)

    def flush(self) -> None:
        """Send on what did not fit into the socket."""
        with self._lock:
            self._outbox.flush()

    def _keep_alive(self) -> None:
        """A chain may take a second to plan; the tick must know meanwhile that somebody does."""
        while True:
            self._send(PieceMessage(0, 0.0))
            time.sleep(KEEPALIVE_S)

    def snapshot(self) -> Snapshot:
        """The newest snapshot, waiting for the first."""
        while (now := self._board.read()) is None:
            time.sleep(PLAN_TURN_S)
        return now

    def start_up(self) -> None:
        networks = {}
        for settings in config.bus_settings(self._machine):
            port = bus.open(settings, pdo.SERVICE_FILTERS)
            pump = commission.wall_pump(port.fileno() if hasattr(port, "fileno") else -1)
            networks[settings.name] = commission.Network(port, pump)
        start_up = StartUp(self._machine, networks, self._ask)
        start_up.commission()
        start_up.come_up()

    def _ask(self, request: Request, value: float, wanted: Mode) -> tuple[Mode, Fault]:
        before = self.snapshot().tick
        send_request(self._wires.requests, request, value)
        give_up_s = time.monotonic() + COME_UP_S
        while True:
            now = self.snapshot()
            arrived = now.tick > before + 2 and now.mode in (wanted, Mode.FAULT)
            if arrived or time.monotonic() > give_up_s:
                return now.mode, now.fault
            time.sleep(PLAN_TURN_S)


def _five(values: tuple[float, ...]) -> tuple[float, float, float, float, float]:
    a, b, c, d, e = values
    return (a, b, c, d, e)
