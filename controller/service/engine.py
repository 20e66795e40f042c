"""The processes of the machine as the service holds them: hubs, tick and plan.

```
            orders (pipe)                     pieces (SEQPACKET)
  service <----------------> [ plan ] -----------------------------> [ tick ] ---- buses
     |                          |  requests (datagrams)                 ^  |
     +--------------------------+---------------------------------------+  | snapshots, recorder
     ^---------------------------------------------------------------------+
```
The service keeps the plan's end of the piece socket, so that a plan that was killed is followed
by another one while the tick goes on. A tick that is gone takes the plan with it: both start
anew, on new sockets, when the operator asks for it. Hubs with simulated drives outlive both. An inverter
on a serial line has a process, too (``serial_inverter``), which lives as long as the tick.
"""

from __future__ import annotations

import contextlib
import socket
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.ipc.handoff import (
    Jog,
    Recorder,
    Snapshot,
    SnapshotBoard,
    piece_pair,
    request_pair,
    send_jog,
    send_request,
)
from controller.machine.model import Bus, Machine
from controller.messages import message
from controller.runtime import children
from controller.runtime.children import Child, Job
from controller.runtime.plan_messages import News
from controller.runtime.planning import PlanJob
from controller.runtime.startup import SessionError
from controller.service import serial_inverter
from controller.service.folders import Folders
from controller.service.planner_client import Line
from controller.service.refusals import by_fault, refused
from controller.service.serial_inverter import SerialInverter
from controller.state.modes import Fault, Request
from drives.settings import BusSettings

MAX_ASKED = 10_000  # requests that no record has looked for yet


class SentRequest(NamedTuple):
    """One request as it went to the tick."""

    request: Request
    value: float = 0.0
    jog: Jog | None = None
    number: int = 0


@dataclass(slots=True)
class _Run:
    """One tick with its sockets and shared memory, and the plan of the moment."""

    tick: Child
    board: SnapshotBoard
    recorder: Recorder
    operator: socket.socket
    plan_end: socket.socket
    snapshot_path: str
    plan: Child
    line: Line

    def end_plan(self) -> None:
        """The tick goes on."""
        with contextlib.suppress(OSError):
            self.plan.end()
        self.line.close()

    def follow(self, plan: Child, line: Line) -> None:
        """Another plan in the place of the one that was ended."""
        self.plan, self.line = plan, line

    def end(self) -> None:
        """To rest on the path, drives off, brakes first."""
        with contextlib.suppress(OSError):
            self.tick.end()
        self.end_plan()
        self.operator.close()
        self.plan_end.close()


class Engine:
    """Starts, restarts and ends what a machine runs on.

    A process lives as long as the thread that started it: call ``start`` and ``mend`` from one
    thread that outlives them all.
    """

    def __init__(self, machine: Machine, folder: Path, kept: Folders, hear: Callable[[News], None]) -> None:
        """``folder``: of its own, for sockets and shared memory; ``kept``: what outlives it."""
        self.machine = machine  # with the paths of the hubs as channels, once they run
        self.hubs: dict[str, Child] = {}
        self.sync_stamps_s: dict[str, Rows] = {}  # when SYNC left a virtual bus; at the end, if asked for
        self._folder, self._kept, self._hear = folder, kept, hear
        self._run: _Run | None = None
        self._starts = 0
        self.inverter: SerialInverter | None = None  # of the spindle, where it is on a serial line
        self._ending = contextlib.ExitStack()
        self._numbering = threading.Lock()
        self._number = 0  # of the last request
        self.asked: deque[SentRequest] = deque(maxlen=MAX_ASKED)  # in their order, for the record of a run

    def start_hubs(self, part: Path | None = None, stamped: bool = False) -> None:
        """Virtual buses with simulated drives, and hubs that share an adapter.

        ``part``: a simulation file of what can be touched and cut; None: the usual. ``stamped``: for
        ``sync_stamps_s``, which take memory as long as it goes. Raises SessionError.
        """
        serial_inverter.check_packages(self.machine)
        stamps_s = self.sync_stamps_s if stamped else None
        self.machine = hubs_started(self.machine, self._folder, self._ending, self.hubs, stamps_s, part)

    def tell_tool(self, number: int) -> None:
        """Which is in the spindle of a simulated machine: it touches the setter, or as a probe the part."""
        if any(bus.interface == "virtual" for bus in self.machine.buses):
            from controller.runtime import simulation

            simulation.tell_tool(self._folder, number)

    def start(self) -> None:
        """Tick and plan, after ending those that were there."""
        self.end_run()
        self._starts += 1
        paths = [str(self._folder / f"{name}.{self._starts}") for name in ("snapshot", "recorder")]
        board = SnapshotBoard(paths[0], axes=len(self.machine.axes))
        recorder = Recorder(paths[1])
        self.inverter = serial_inverter.begun(self.machine, self._folder, self._starts)
        slot = None if self.inverter is None else self.inverter.paths
        plan_end, piece_end = piece_pair()
        operator, request_end = request_pair()
        with piece_end, request_end:
            ends = (piece_end.fileno(), request_end.fileno())
            tick = children.start(
                "tick", Job(self.machine, *ends, paths[0], paths[1], slot), self._folder, ends
            )
        plan, line = self._plan(plan_end, operator, paths[0])
        self._run = _Run(tick, board, recorder, operator, plan_end, paths[0], plan, line)

    def mend(self) -> None:
        """Another plan for a tick that lives."""
        run = self._there()
        run.end_plan()
        run.follow(*self._plan(run.plan_end, run.operator, run.snapshot_path))

    def _plan(self, plan_end: socket.socket, operator: socket.socket, snapshot: str) -> tuple[Child, Line]:
        own, its = socket.socketpair()
        with its:
            own.setblocking(True)
            ends = (plan_end.fileno(), operator.fileno(), its.fileno())
            job = PlanJob(self.machine, *ends, snapshot, self._kept.checks, self._kept.arranged)
            child = children.start("plan", job, self._folder, ends)
        return child, Line(own, self._hear)

    def end_run(self) -> None:
        """Tick and plan: to rest on the path, drives off, brakes first."""
        run, self._run = self._run, None
        if run is not None:
            run.end()
        inverter, self.inverter = self.inverter, None
        if inverter is not None:
            inverter.end()

    def end_tick(self) -> None:
        """One that hangs; then it is gone as if it had died."""
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):
            self._there().tick.end()

    def end(self) -> None:
        """Everything."""
        self.end_run()
        self._ending.close()

    # -- what is there

    def _there(self) -> _Run:
        if self._run is None:
            raise refused("no_tick", code="gone")
        return self._run

    @property
    def line(self) -> Line:
        """To the plan. Raises CommandRefused."""
        run = self._there()
        if not run.plan.is_alive():
            raise refused("no_plan", code="gone")
        return run.line

    @property
    def tick_alive(self) -> bool:
        return self._run is not None and self._run.tick.is_alive()

    @property
    def plan_alive(self) -> bool:
        return self._run is not None and self._run.plan.is_alive()

    @property
    def pids(self) -> dict[str, int]:
        """Process ids of tick and plan."""
        run = self._run
        return {} if run is None else {"tick": run.tick.pid, "plan": run.plan.pid}

    @property
    def recorder(self) -> Recorder | None:
        return self._run.recorder if self._run is not None else None

    def snapshot(self) -> Snapshot | None:
        """The newest one, also the last of a tick that is gone."""
        return self._run.board.read() if self._run is not None else None

    def request(self, request: Request, value: float = 0.0) -> int:
        """A datagram to the tick; its number, see ``came_of`` of the snapshot.

        Raises CommandRefused where nobody takes it.
        """
        with self._sending(SentRequest(request, value)) as (operator, number):
            send_request(operator, request, value, number)
        return number

    def jog(self, jog: Jog) -> int:
        """As ``request``; to be sent again within 200 ms, or the tick comes to rest by itself."""
        with self._sending(SentRequest(Request.JOG, jog=jog)) as (operator, number):
            send_jog(operator, jog, number)
        return number

    @contextlib.contextmanager
    def _sending(self, asked: SentRequest) -> Iterator[tuple[socket.socket, int]]:
        """Numbers rise in the order in which the tick takes them; nobody waits here for anything."""
        request = asked.request
        try:
            with self._numbering:
                self._number += 1
                self.asked.append(asked._replace(number=self._number))
                yield self._there().operator, self._number
        except BlockingIOError:
            raise refused("busy_tick", request=request.name, code="busy") from None
        except OSError:
            raise by_fault(Fault.CONTROLLER_GONE, request=request.name, code="gone") from None

    def last_words(self) -> str:
        """Of the tick, or of the plan, whichever died with some."""
        run = self._run
        dead = [] if run is None else [one for one in (run.tick, run.plan) if not one.is_alive()]
        return next((words for one in dead if (words := one.last_words())), "")


def simulated(machine: Machine) -> Machine:
    """The machine with virtual buses in place of its own."""
    return replace(machine, buses=tuple(replace(bus, interface="virtual") for bus in machine.buses))


# Hubs of a machine: virtual buses with simulated drives on them, and what shares an adapter.

Rows = npt.NDArray[np.float64]

# Interfaces that several processes can join. Any other adapter has one owner, and tick, pump and service
# want it: a hub shares it.
JOINABLE = ("shared", "socketcan")
HUB_S = 20.0  # for a hub to be there
POLL_S = 0.05


def hubs_started(
    machine: Machine,
    folder: Path,
    ending: contextlib.ExitStack,
    hubs: dict[str, Child],
    stamps_s: dict[str, Rows] | None,
    part: Path | None = None,
) -> Machine:
    """Start a hub with drives for each virtual bus; the machine with their paths as channels.

    They end with ``ending``; then ``stamps_s`` has when SYNC left the wire, by virtual bus; None: nobody
    asks. Raises SessionError.
    """
    buses = []
    for bus in machine.buses:
        if bus.interface == "virtual":
            log = folder / f"{bus.name}.sync.npy"
            bus = replace(bus, channel=str(folder / f"{bus.name}.hub"))
            hub = _hub(bus, machine, log if stamps_s is not None else None, folder, part)
            hubs[bus.name] = hub
            ending.callback(_end_hub, hub, bus.name, log, {} if stamps_s is None else stamps_s)
            _wait_for_hub(hub, Path(bus.channel))
        elif bus.interface not in JOINABLE:
            settings = BusSettings(bus.name, bus.interface, bus.channel, bus.bit_rate)
            bus = replace(bus, interface="shared", channel=str(folder / f"{bus.name}.hub"))
            hub = children.start("hub", (settings, bus.channel), folder, name=bus.name)
            hubs[bus.name] = hub
            ending.callback(hub.end)
            _wait_for_hub(hub, Path(bus.channel))
        buses.append(bus)
    return replace(machine, buses=tuple(buses))


def _hub(bus: Bus, machine: Machine, log: Path | None, folder: Path, part: Path | None) -> Child:
    from controller.runtime import simulation

    touching = simulation.bus_of(machine, part is not None)
    job = simulation.Job(machine, bus, folder, touching, part, log)
    return children.start("bus", job, folder, name=bus.name)


def _wait_for_hub(hub: Child, path: Path) -> None:
    give_up_s = time.monotonic() + HUB_S
    while not path.exists():
        if not hub.is_alive() or time.monotonic() > give_up_s:
            raise SessionError(hub.last_words() or message("startup.no_bus"))
        time.sleep(POLL_S)


def _end_hub(hub: Child, name: str, log: Path, stamps_s: dict[str, Rows]) -> None:
    """The hub writes its log at the end; read it before the folder goes."""
    hub.end()
    if log.exists():
        stamps_s[name] = np.load(log)
