"""The plan's end of a live machine: planner, keepalive, and the service access to the buses (SDO)."""

from __future__ import annotations

import contextlib
import gc
import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from controller import memory
from controller.ipc.handoff import (
    Outcome,
    PieceMessage,
    PieceOutbox,
    Snapshot,
    SnapshotBoard,
    plan_ids,
    send_arrangement,
    send_request,
)
from controller.machine import arrangement as arranged
from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.messages import message, text
from controller.plan.planner import Planner
from controller.plan.segment import PathItem
from controller.program.program import ProgramError
from controller.runtime import children
from controller.runtime.startup import Came, SessionError, StartUp, arrangement, came_to
from controller.state.modes import Mode, Request
from drives import bus, commission, pdo
from drives.arranged import Arranged

PLAN_TURN_S = 0.010
KEEPALIVE_S = 0.1
REST_TURN_S = 0.05  # where all is sent and nothing moves; an order is heard at once
# Where we may: before the rest of this computer but the tick; nearer to the kernel's own threads (0), which
# bring the frames of serial and USB adapters: at -10 they wait 10 ms for a core that they share with a plan.
NICE = -5
SWITCH_S = 0.001  # the keepalive gets its turn so soon while a path is planned
STOPPED = message("startup.homing_stopped")
TELL_S = 2.0  # the tick takes requests with every turn
COME_UP_S = 150.0  # longer than the tick itself waits for a drive to home

# What has a sentence for the operator; all else is a mistake of ours.
EXPECTED = (ProgramError, SessionError, commission.CommissionError, bus.BusError)


class PlanEnd:
    """Planner, keepalive and start-up in a process of their own, on sockets that were handed over."""

    def __init__(self, machine: Machine, pieces: int, requests: int, snapshot_path: str, kept: Path) -> None:
        """``pieces`` and ``requests``: descriptors of this end of the sockets; ``kept``: folder for how the
        drives were found.
        """
        self._kept = kept
        self.alone = False  # the tick is gone
        self.before_message: Callable[[], None] = lambda: None  # called before pieces go out
        self._machine = machine
        self._board = SnapshotBoard(snapshot_path, create=False, axes=len(machine.axes))
        self._outbox = PieceOutbox(children.joined(pieces, socket.SOCK_SEQPACKET))
        self._requests = children.joined(requests, socket.SOCK_DGRAM)
        self._lock = threading.Lock()  # a keepalive must not come between the packets of a message
        self._sent = 0  # the last message's number
        self._numbers = plan_ids()  # of requests
        self._start_up: StartUp | None = None
        sys.setswitchinterval(SWITCH_S)
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, NICE)
        self.planner = self.new_planner(machine)
        threading.Thread(target=self._keep_alive, daemon=True).start()

    def new_planner(self, machine: Machine) -> Planner:
        """For a machine whose tools or offsets are other ones; its messages are counted on.

        One of the planner before it may be on its way yet: two with the same number, and the tick's
        answer to the old one would be taken for that to the new one.
        """
        planner = Planner(machine, kinematics_of(machine), self.send, clock=time.monotonic)
        planner.go_on_from(self._sent)
        if (now := self._board.read()) is not None:
            planner.go_on_from(max(now.accepted, now.rejected))
        self.planner = planner
        return planner

    def load(self, items: Iterable[PathItem], now: Snapshot) -> None:
        """A program for the planner, to begin where ``now``'s queue ends; the machine stands.

        What is there by now stays, so the collector need not look at it again: its looks at everything,
        once in a while, would hold up the plan by some 80 ms, and longer the more there is.
        """
        gc.unfreeze()  # of the program before
        gc.collect()
        memory.give_back()
        gc.freeze()
        self.planner.load(items, now.queue_end_s, now.epoch)

    def send(self, message: PieceMessage) -> bool:
        """False while packets wait, and when nobody is there to take them."""
        if not message.is_keepalive:
            self.before_message()
        with self._lock:
            self._sent = max(self._sent, message.sequence)
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
        """A continuous path may take a second to plan; the tick must know meanwhile that somebody does."""
        while not self.alone:
            self.send(PieceMessage(0, 0.0))
            time.sleep(KEEPALIVE_S)

    def snapshot(self) -> Snapshot:
        """The newest snapshot, waiting for the first. Raises SessionError when the tick is gone."""
        while (now := self._board.read()) is None:
            if self.alone:
                raise SessionError(message("startup.tick_ended"))
            time.sleep(PLAN_TURN_S)
        return now

    @property
    def start_up(self) -> StartUp:
        """Commissioning, homing and enabling; opens the buses when it is first needed. Raises BusError."""
        if self._start_up is None:
            networks = {}
            for settings in machine_file.bus_settings(self._machine):
                port = bus.open(settings, pdo.SERVICE_FILTERS)
                networks[settings.name] = commission.Network(port, commission.wall_pump(port.fileno()))
            self._start_up = StartUp(
                self._machine, networks, self._ask, lambda: self.snapshot().homed, self._take_arranged
            )
        return self._start_up

    def _take_arranged(self, found: tuple[Arranged, ...]) -> None:
        """The tick must know it before a drive is enabled, the operator by ``directrix faults``.

        Raises SessionError where the tick takes no requests.
        """
        told = arrangement(self._machine, found)
        give_up_s = time.monotonic() + TELL_S
        while True:
            try:
                send_arrangement(self._requests, told)
                break
            except BlockingIOError:
                if time.monotonic() > give_up_s:
                    raise SessionError(message("startup.tick_takes_none")) from None
                time.sleep(PLAN_TURN_S)
            except OSError:  # it is gone, which others report
                break
        try:
            arranged.save(self._kept, self._machine, found)
        except OSError as error:
            print(text(message("cli.drives.not_kept", folder=self._kept, why=error)), file=sys.stderr)

    def _ask(self, request: Request, value: float, wanted: Mode) -> Came:
        """Raises SessionError where somebody stopped the homing."""
        number = next(self._numbers)
        with contextlib.suppress(BlockingIOError):
            send_request(self._requests, request, value, number)
        give_up_s = time.monotonic() + COME_UP_S
        began = False
        while True:
            now = self.snapshot()
            if (found := came_to(now, number, request, value, wanted)) is not None:
                return found
            if self.alone or time.monotonic() > give_up_s:
                return now.mode, now.fault, now.fault_axis
            came, homes = now.came_of(number)[0], now.mode is Mode.HOMING
            if came is Outcome.SUPERSEDED or (began and not homes):
                raise SessionError(STOPPED)
            began = came is Outcome.DONE and homes
            time.sleep(PLAN_TURN_S)
