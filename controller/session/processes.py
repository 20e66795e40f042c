"""What runs in the two processes of a live machine: the plan's and the tick's.

The plan's process owns SDO, the tick's the cyclic frames. They meet in the piece
socket and the snapshot alone, so either may be killed: without the plan the tick
stops on the path; without the tick the drives stop by their own supervision.
"""

from __future__ import annotations

import pickle
import signal
import socket
import threading
import time
import traceback
from dataclasses import replace
from pathlib import Path

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
from controller.machine import Machine, five
from controller.plan.planner import Planner
from controller.plan.text.program import ProgramError
from controller.session import checked, children, cyclic
from controller.session.children import Job
from controller.session.startup import SessionError, StartUp, homing_mask
from controller.state import Fault, Mode, Request
from controller.tick import loop
from controller.tick.cycle import Cycle
from drives import bus, commission, pdo

PLAN_TURN_S = 0.010
KEEPALIVE_S = 0.025
# A busy computer has been seen to hold a process back for 20 ms and more; beyond this the
# heartbeats judge. On a real bus two lost feedbacks in a row are a fault.
VIRTUAL_PATIENCE_S = 0.150
COME_UP_S = 150.0  # longer than the tick itself waits for a drive to home
SAME_PLACE = 1e-9  # mm or rad

EXPECTED = (ProgramError, SessionError, commission.CommissionError, bus.BusError)


def run(role: str, job_file: Path) -> int:
    """Runs ``tick`` or ``plan``; the exit code. Whatever ends it too early is one sentence beside the job."""
    job: Job = pickle.loads(job_file.read_bytes())
    try:
        (tick_main if role == "tick" else plan_main)(job)
    except EXPECTED as error:
        children.words_of(job_file).write_text(str(error))
    except Exception as error:  # the top of a process: its parent tells the operator
        children.words_of(job_file).write_text(_own_error(role, error))
    else:
        return 0
    return 1


def _own_error(role: str, error: Exception) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    what = f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})"
    return f"The {role} process met an error of its own; report this: {what}"


# --- tick ------------------------------------------------------------------------


class Asked:
    """Becomes true when this process is asked to end."""

    def __init__(self) -> None:
        self.yes = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._hear)

    def _hear(self, _number: int, _frame: object) -> None:
        self.yes = True


def tick_main(job: Job) -> None:
    """The real-time process: opens the buses and ticks until SIGTERM. Raises BusError."""
    machine = job.machine
    ports = {settings.name: bus.open(settings, pdo.TICK_FILTERS) for settings in config.bus_settings(machine)}
    group = cyclic.group(machine, ports, _patience_s(machine))
    cycle = Cycle(
        machine,
        group,
        PieceInbox(children.joined(job.pieces, socket.SOCK_SEQPACKET)),
        RequestInbox(children.joined(job.requests, socket.SOCK_DGRAM)),
        SnapshotBoard(job.snapshot_path, create=False),
        Recorder(job.recorder_path, create=False),
        time.monotonic,
    )
    group.start()
    loop.prepare()
    asked = Asked()
    filenos = [port.fileno() for port in ports.values() if port.fileno() >= 0]
    turning = loop.Loop(cycle, loop.WallClock(), filenos)
    turning.run(lambda: not asked.yes)
    if turning.error is None:
        turning.stand_down()
    group.stop_sync()
    group.close()
    if turning.error is not None:
        raise turning.error


def _patience_s(machine: Machine) -> float:
    """Simulated drives on a virtual bus are a process of this computer and may be late."""
    return VIRTUAL_PATIENCE_S if all(bus.interface == "virtual" for bus in machine.buses) else 0.0


# --- plan ------------------------------------------------------------------------


def plan_main(job: Job) -> None:
    """The plan's process: brings the machine up, then keeps the queue full until SIGTERM.

    A program that cannot be run is refused before anything moves. Raises what ``EXPECTED`` lists.
    """
    plan = _Plan(job)
    task = checked.task(job.program, job.name, job.machine)
    walk = checked.walk_of(task, job.check, job.unchecked)
    plan.start_up()
    now = plan.snapshot()
    if max(abs(a - b) for a, b in zip(now.joints, task.start, strict=True)) > SAME_PLACE:
        task = replace(task, start=five(now.joints))
        walk = checked.walk_of(task, job.check, job.unchecked)
    plan.planner.load(walk.items, now.queue_end_s, now.epoch)
    while not plan.alone:
        now = plan.snapshot()
        plan.planner.work(now)
        plan.flush()
        if plan.planner.error is not None and _stands_before_it(now, plan.planner):
            raise plan.planner.error
        time.sleep(PLAN_TURN_S)


def _stands_before_it(now: Snapshot, planner: Planner) -> bool:
    """Whether a program that is refused on the way has been run up to there."""
    return planner.finished and now.at_rest and now.plan_time_s >= now.queue_end_s


class _Plan:
    """Planner, keepalive and start-up at the plan's end of the door."""

    def __init__(self, job: Job) -> None:
        self.kinematics = Kinematics(job.machine)
        self.alone = False  # the tick is gone
        self._machine = job.machine
        self._board = SnapshotBoard(job.snapshot_path, create=False)
        self._outbox = PieceOutbox(children.joined(job.pieces, socket.SOCK_SEQPACKET))
        self._requests = children.joined(job.requests, socket.SOCK_DGRAM)
        self._lock = threading.Lock()  # a keepalive must not come between the packets of a message
        self.planner = Planner(job.machine, self.kinematics, self._send, clock=time.monotonic)
        threading.Thread(target=self._keep_alive, daemon=True).start()

    def _send(self, message: PieceMessage) -> bool:
        """False while packets wait, and when nobody is there to take them."""
        with self._lock:
            try:
                return self._outbox.send(message)
            except OSError:
                self.alone = True
                return False

    def flush(self) -> None:
        """Send on what did not fit into the socket."""
        with self._lock:
            try:
                self._outbox.flush()
            except OSError:
                self.alone = True

    def _keep_alive(self) -> None:
        """A chain may take a second to plan; the tick must know meanwhile that somebody does."""
        while not self.alone:
            self._send(PieceMessage(0, 0.0))
            time.sleep(KEEPALIVE_S)

    def snapshot(self) -> Snapshot:
        """The newest snapshot, waiting for the first. Raises SessionError when the tick is gone."""
        while (now := self._board.read()) is None:
            if self.alone:
                raise SessionError("The tick process ended before its first tick.")
            time.sleep(PLAN_TURN_S)
        return now

    def start_up(self) -> None:
        """Commission, home, enable. Raises BusError, CommissionError, SessionError."""
        networks = {}
        for settings in config.bus_settings(self._machine):
            port = bus.open(settings, pdo.SERVICE_FILTERS)
            networks[settings.name] = commission.Network(port, commission.wall_pump(port.fileno()))
        start_up = StartUp(self._machine, networks, self._ask, lambda: self.snapshot().homed)
        start_up.commission()
        start_up.come_up()

    def _ask(self, request: Request, value: float, wanted: Mode) -> tuple[Mode, Fault]:
        """Homing begins and ends in OFF: there it is the axes homed that tell that it is over."""
        send_request(self._requests, request, value)
        mask = homing_mask(request, value)
        give_up_s = time.monotonic() + COME_UP_S
        while True:
            now = self.snapshot()
            if now.refused_request == request and now.interlock is not Fault.NONE:
                return now.mode, now.interlock
            arrived = now.mode is wanted and now.homed & mask == mask
            if arrived or now.mode is Mode.FAULT or self.alone or time.monotonic() > give_up_s:
                return now.mode, now.fault
            time.sleep(PLAN_TURN_S)
