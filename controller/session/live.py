"""A live machine: hub and simulated drives where the bus is virtual, plan, and tick, each a process."""

from __future__ import annotations

import contextlib
import itertools
import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from controller import config
from controller.handoff import (
    COLUMN,
    Outcome,
    Recorder,
    Snapshot,
    SnapshotBoard,
    piece_pair,
    request_pair,
    send_request,
)
from controller.machine import Bus, Machine
from controller.plan.report.stored import Stored
from controller.session import children, simulation
from controller.session.bus_load import overload
from controller.session.children import Child, Job
from controller.session.listener import Listener
from controller.session.recording import Keeper
from controller.session.startup import SessionError, no_start
from controller.state import Fault, Mode, Request, sentence
from drives.bus import BusError

Rows = npt.NDArray[np.float64]

HUB_S = 20.0  # for a hub to be there, for a start to be taken
READY_S = 600.0  # for all of the start-up; each step of it has its own limit and sentence
LOOK_S = 0.05

KEEP_S = 5.0  # for a recording to be there, after a fault at rest


@dataclass(slots=True)
class Live:
    """Handles on a running live machine."""

    machine: Machine  # with the paths of the hubs as channels
    tick: Child
    plan: Child
    board: SnapshotBoard
    recorder: Recorder
    operator: socket.socket
    hubs: dict[str, Child] = field(default_factory=dict)  # by virtual bus
    sync_stamps_s: dict[str, Rows] = field(default_factory=dict)  # when SYNC left the wire; there at the end
    keeper: Keeper | None = None  # of recordings
    _numbers: Iterator[int] = field(default_factory=lambda: itertools.count(1))  # of requests

    def request(self, request: Request, value: float = 0.0) -> int:
        """What an operator asks for; its number. Raises SessionError when the tick is gone."""
        number = next(self._numbers)
        try:
            send_request(self.operator, request, value, number)
            return number
        except OSError as error:
            raise SessionError(self._ended(self.tick, request.name)) from error

    def wait_for(self, done: Callable[[Snapshot], bool], longest_s: float, what: str) -> Snapshot:
        """The first snapshot that is ``done``. SessionError on a dead process, a fault, or time over."""
        give_up_s = time.monotonic() + longest_s
        while True:
            now = self.board.read()
            if now is not None and done(now):
                return now
            for child in (self.tick, self.plan):
                if not child.is_alive():
                    raise SessionError(self._ended(child, what))
            if now is not None and now.mode is Mode.FAULT:
                self._kept()
                raise SessionError(f"While waiting for {what}: {self.fault_text(now)}")
            if time.monotonic() > give_up_s:
                raise SessionError(f"Waited {longest_s:.0f} s for {what} in vain; is the computer very busy?")
            time.sleep(LOOK_S)

    def ready(self) -> Snapshot:
        """Homed, enabled, at rest, the first piece queued."""
        return self.wait_for(
            lambda now: now.mode is Mode.READY and now.accepted > 0, READY_S, "the machine to be ready"
        )

    def run(self, progress: Callable[[Snapshot], None] = lambda _: None) -> tuple[Rows, Snapshot]:
        """Cycle start to the program's end or a fault at rest: recorder rows and the last snapshot.

        Raises SessionError when the tick is gone, or the plan before all of the program was sent.
        """
        rows = [self.recorder.drain()[:0]]
        began = False
        give_up_s = time.monotonic() + HUB_S
        started = self.request(Request.START)
        while True:
            time.sleep(LOOK_S)
            now = self._in_progress()
            rows.append(self.recorder.drain())
            began = began or _began(rows[-1])
            progress(now)
            if began and now.at_rest and now.mode not in (Mode.RUNNING, Mode.STOPPING, Mode.HOLD):
                self._kept()
                return np.concatenate(rows), now
            if not began:
                self._see_started(now, started, give_up_s)

    def _see_started(self, now: Snapshot, number: int, give_up_s: float) -> None:
        """Raises SessionError where the machine forbids the start, or nothing comes of it."""
        why = no_start(self.machine, now.interlock, now.untrusted)
        if why and now.came_of(number)[0] is Outcome.REFUSED:
            raise SessionError(why)
        if time.monotonic() > give_up_s:
            raise SessionError("The machine did not take the start; is the computer very busy?")

    def _in_progress(self) -> Snapshot:
        """The newest snapshot. SessionError when nothing will come of it any more."""
        alive, planning = self.tick.is_alive(), self.plan.is_alive()
        now = self.board.read()
        if now is None or not alive:
            raise SessionError(f"{self._ended(self.tick, 'the end of the program')} {self._alone(now)}")
        starved = now.mode is Mode.RUNNING and now.at_rest and now.plan_time_s >= now.queue_end_s
        if starved and not planning and not self._fails():
            raise SessionError(self._ended(self.plan, "the end of the program"))
        return now

    def _fails(self) -> bool:
        """Whether the tick makes it a fault, as it does at the queue's end."""
        time.sleep(LOOK_S)
        now = self.board.read()
        return now is not None and now.mode is Mode.FAULT

    def fault_text(self, now: Snapshot) -> str:
        """The operator's sentence on a fault, with the axis and where the recording lies; "" = none."""
        if now.fault is Fault.NONE:
            return ""
        axis = self.machine.axis_off(now.fault_axis, now.fault_off)
        return sentence(now.fault, axis, now.warning) + (self.keeper.told if self.keeper else "")

    def _kept(self) -> None:
        """Wait until a fault is recorded; the drives' way to standstill belongs to it."""
        give_up_s = time.monotonic() + KEEP_S
        while self.keeper is not None and (now := self.board.read()) is not None:
            if self.keeper.look(now):
                return
            if not self.tick.is_alive() or time.monotonic() > give_up_s:
                self.keeper.keep(now)
                return
            time.sleep(LOOK_S)

    def _alone(self, last: Snapshot | None) -> str:
        """Without the tick: what the drives do, and the recording of what was before."""
        if self.keeper is None or last is None:
            return sentence(Fault.CONTROLLER_GONE)
        self.keeper.keep(last, Fault.CONTROLLER_GONE)
        return sentence(Fault.CONTROLLER_GONE) + self.keeper.told

    def _ended(self, child: Child, what: str) -> str:
        """Why a process is gone: its own sentence, or that of the other one, which may be the cause."""
        for one in (child, self.tick, self.plan):
            if not one.is_alive() and (words := one.last_words()):
                return words
        return f"The {child.role} process ended while waiting for {what}."


def _began(rows: Rows) -> bool:
    """Whether the clock has run. A program without motion is over in one tick: only its rate tells."""
    return bool(np.any((rows[:, COLUMN["mode"]] != Mode.READY) | (rows[:, COLUMN["rate"]] > 0.0)))


@contextlib.contextmanager
def started(
    machine: Machine,
    program: bytes,
    name: str,
    check: Stored | None = None,
    unchecked: bool = False,
    recordings: Path | None = None,
) -> Iterator[Live]:
    """A live machine that has ``program`` loaded; everything ends with the block.

    ``recordings``: folder for what is kept of a fault; None = nothing is kept.
    Without a ``check`` the whole program is read before anything moves, unless ``unchecked``.
    Virtual buses get a hub with simulated drives each, other buses are what they are.
    Raises SessionError, also where a bus has no room for the tick.
    """
    if sentence := overload(machine):
        raise SessionError(sentence)
    with tempfile.TemporaryDirectory(prefix="directrix-") as text, contextlib.ExitStack() as ending:
        folder = Path(text)
        stamps_s: dict[str, Rows] = {}
        hubs: dict[str, Child] = {}
        machine = with_hubs(machine, folder, ending, hubs, stamps_s)
        plan_end, piece_end = piece_pair()
        operator, request_end = request_pair()
        ending.callback(operator.close)
        board = SnapshotBoard(str(folder / "snapshot"))
        recorder = Recorder(str(folder / "recorder"))
        shared = (str(folder / "snapshot"), str(folder / "recorder"))
        to_tick = Job(machine, piece_end.fileno(), request_end.fileno(), *shared)
        to_plan = Job(machine, plan_end.fileno(), operator.fileno(), *shared, program, name, check, unchecked)
        # The children have their own ends; ours would hide that the other one is gone.
        with plan_end, piece_end, request_end:
            tick = children.start("tick", to_tick, folder)
            ending.callback(tick.end)
            plan = children.start("plan", to_plan, folder)
            ending.callback(plan.end)
        keeper = None if recordings is None else _keeper(machine, recorder, recordings, ending)
        yield Live(machine, tick, plan, board, recorder, operator, hubs, stamps_s, keeper)


def _keeper(machine: Machine, recorder: Recorder, base: Path, ending: contextlib.ExitStack) -> Keeper:
    """Listens on every bus from now on."""
    try:
        listener = Listener(config.bus_settings(machine))
    except BusError as error:
        raise SessionError(str(error)) from error
    ending.callback(listener.close)
    return Keeper(machine, recorder, listener.logs, base)


def with_hubs(
    machine: Machine,
    folder: Path,
    ending: contextlib.ExitStack,
    hubs: dict[str, Child],
    stamps_s: dict[str, Rows],
) -> Machine:
    """Start a hub with drives for each virtual bus; the machine with their paths as channels."""
    buses = []
    for bus in machine.buses:
        if bus.interface == "virtual":
            log = folder / f"{bus.name}.sync.npy"
            bus = replace(bus, channel=str(folder / f"{bus.name}.hub"))
            hub = _hub(bus, simulation.options(machine, bus.name), log, folder)
            hubs[bus.name] = hub
            ending.callback(_end_hub, hub, bus.name, log, stamps_s)
            _wait_for_hub(hub, Path(bus.channel))
        elif bus.interface == "slcan":
            # A serial port has one owner, and three of our processes want it: a hub shares it.
            adapter = ["--bit-rate", "0", "--nodes", "--serial", f"{bus.channel}={bus.bit_rate}"]
            bus = replace(bus, interface="shared", channel=str(folder / f"{bus.name}.hub"))
            hub = Child("hub", [bus.channel, *adapter], folder / f"{bus.name}.words")
            hubs[bus.name] = hub
            ending.callback(hub.end)
            _wait_for_hub(hub, Path(bus.channel))
        buses.append(bus)
    return replace(machine, buses=tuple(buses))


def _hub(bus: Bus, nodes: list[str], log: Path, folder: Path) -> Child:
    options = [bus.channel, "--bit-rate", str(bus.bit_rate), "--sync-log", str(log), *nodes]
    return Child("hub", options, folder / f"{bus.name}.words")


def _wait_for_hub(hub: Child, path: Path) -> None:
    give_up_s = time.monotonic() + HUB_S
    while not path.exists():
        if not hub.is_alive() or time.monotonic() > give_up_s:
            raise SessionError("The virtual bus did not start; see its message above.")
        time.sleep(LOOK_S)


def _end_hub(hub: Child, name: str, log: Path, stamps_s: dict[str, Rows]) -> None:
    """The hub writes its log at the end; read it before the folder goes."""
    hub.end()
    if log.exists():
        stamps_s[name] = np.load(log)
