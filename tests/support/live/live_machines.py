"""Live machines for tests: started, watched, listened to; and what their processes are."""

from __future__ import annotations

import contextlib
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from support.machines.stepped_runs import shipped
from support.oracles import latched_setpoints

from controller import messages
from controller.cli import demo
from controller.cli.demo import Operator
from controller.ipc.control_socket import Client, CommandRefused
from controller.ipc.handoff import COLUMN, Recorder, Snapshot
from controller.machine import machine_file
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Joints, Machine
from controller.motion.motions import SurfaceCut
from controller.plan.path import path
from controller.plan.path.path import Path as TracedPath
from controller.plan.segment import ContinuousPath, Segment
from controller.program import blocks
from controller.runtime.startup import SessionError
from controller.service.folders import Folders
from controller.service.service import Service
from controller.state.modes import Mode
from controller.store import service_store
from controller.store.set_up_store import SPINDLE
from controller.verify.console import Refused
from drives import bus, pdo

HANGS_S = 120.0  # no test is meant to come near
POLL_S = 0.02


class Live:
    """A machine as the service runs it, asked at its door, with one part program."""

    def __init__(self, service: Service, client: Client, part: Path) -> None:
        self.service, self._part = service, part
        self._operator = Operator(client)
        run = service.engine._run
        assert run is not None and run.recorder.block.path is not None
        self.tick, self.plan, self.board = run.tick, run.plan, run.board
        self.recorder = Recorder(run.recorder.block.path, create=False)  # the service drains its own
        self.hubs, self.sync_stamps_s = service.engine.hubs, service.engine.sync_stamps_s

    @property
    def machine(self) -> Machine:
        """With the paths of the hubs as channels."""
        return self.service.engine.machine

    def ready(self) -> Snapshot:
        """Loaded, homed, enabled, at rest. Raises SessionError with the sentence of what is refused."""
        with _sentences():
            self._operator.done("load", path=str(self._part))
            self._operator.done("home")
        return now_of(self)

    def start(self) -> None:
        """Cycle start. Raises SessionError."""
        with _sentences():
            self._operator.done("start")

    def run(self, look: Callable[[Snapshot], None] = lambda _: None) -> tuple[np.ndarray, Snapshot]:
        """Cycle start to the end at rest: rows of every tick, and the last snapshot.

        Raises SessionError with what is told of a tick that is gone.
        """
        self.recorder.drain()
        self.start()
        rows = []
        while self.service.run.job is not None or not now_of(self).at_rest:
            rows.append(self.recorder.drain())
            look(now_of(self))
            if not self.tick.is_alive() and self.service.run.job is None:
                raise SessionError(messages.text(self.service.alarms.list()[0]))
            time.sleep(POLL_S)
        rows.append(self.recorder.drain())
        return np.concatenate(rows), now_of(self)


@contextlib.contextmanager
def _sentences() -> Iterator[None]:
    try:
        yield
    except (CommandRefused, Refused) as error:
        raise SessionError(str(error)) from error


@contextlib.contextmanager
def session(text: str, machine: Machine | None = None) -> Iterator[Live]:
    """A machine that is powered up; the tool that its program asks for first is in the spindle."""
    with tempfile.TemporaryDirectory(prefix="directrix-") as name:
        folder = Path(name)
        part = folder / "part.ngc"
        part.write_text(text)
        if asked := re.search(r"T(\d+) *M6", text):
            service_store.put(folder, SPINDLE, int(asked[1]))
        with demo.served(machine or shipped(), Folders.within(folder), folder / "run") as (service, client):
            yield Live(service, client, part)


def until(done: Callable[[], Any]) -> Any:
    """Waits for something to become true, and gives it."""
    give_up_s = time.monotonic() + HANGS_S
    while not (found := done()):
        assert time.monotonic() < give_up_s, "waited in vain"
        time.sleep(0.001)
    return found


def run(running: Live, look: Callable[[Snapshot], None] = lambda _: None) -> tuple[np.ndarray, Snapshot]:
    """``Live.run`` that does not wait forever."""
    give_up_s = time.monotonic() + HANGS_S

    def guarded(now: Snapshot) -> None:
        assert time.monotonic() < give_up_s, f"waited in vain: {now}"
        look(now)

    return running.run(guarded)


def at(running: Live, plan_time_s: float, act: Callable[[], None]) -> Callable[[Snapshot], None]:
    """For ``Live.run``: does something once when the path clock comes to ``plan_time_s``, to the tick."""
    left = [act]

    def look(now: Snapshot) -> None:
        if left and now.plan_time_s > plan_time_s - 0.2:
            until(
                lambda: now_of(running).plan_time_s >= plan_time_s or now_of(running).mode is not Mode.RUNNING
            )
            left.pop()()

    return look


def now_of(running: Live) -> Snapshot:
    now = running.board.read()
    assert now is not None
    return now


def traced(text: str, machine: Machine, start: tuple[float, ...]) -> TracedPath:
    a, b, c, d, e = start
    return path.trace(
        blocks.read(text.encode(), machine, "part.ngc"), machine, kinematics_of(machine), (a, b, c, d, e)
    )


def home(machine: Machine) -> tuple[float, ...]:
    return tuple(axis.homing.position for axis in machine.axes)


def off_path(rows: np.ndarray, of: TracedPath, machine: Machine) -> np.ndarray:
    """Distance (mm) of each row's commanded tip from the exact path, on the table; dwells left out."""
    kinematics = kinematics_of(machine)
    chains = (item for item in of.items if isinstance(item, ContinuousPath))
    segments = [segment for chain in chains for segment in chain.segments]
    moving = rows[rows[:, COLUMN["motion_id"]] >= 0]
    return np.array([_off(row, segments[int(row[COLUMN["motion_id"]])], kinematics) for row in moving])


def _off(row: np.ndarray, segment: Segment, kinematics: Kinematics) -> float:
    joints = _joints(row)
    s = float(row[COLUMN["s"]])
    motion = segment.motion
    if isinstance(motion, SurfaceCut):
        # The surface itself says where the tip belongs: C1 + r n, no inverse kinematics in between.
        there = motion.part.to_parent(motion.pose(s).tip)
        length_mm = motion.length_mm
    else:
        wanted = motion.joints(s, (0.0, 0.0), kinematics)
        assert wanted is not None
        length_mm = getattr(motion, "length_mm", 0.0)
        there = kinematics.forward(wanted, length_mm).tip
    here = kinematics.forward(joints, length_mm).tip
    return float(np.linalg.norm(np.subtract(here, there)))


def _joints(row: np.ndarray) -> Joints:
    first = COLUMN["joint_command_0"]
    a, b, c, d, e = map(float, row[first : first + 5])
    return (a, b, c, d, e)


def assert_within_limits(rows: np.ndarray, machine: Machine) -> None:
    """First and second differences of the joints that the drives used, from SYNC to SYNC and out of rest."""
    velocity, acceleration, _ = latched_setpoints.most(rows, machine)
    found = f"shares {velocity:.4f}, {acceleration:.4f}; {latched_setpoints.described(rows, machine)}"
    assert velocity <= 1.0 + 1e-6, found
    assert acceleration <= 1.001, found  # the tick's own check allows as much


def processes(of_parent: int) -> dict[int, str]:
    """Names of the living children of a process, by pid."""
    found = {}
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            pid = int(entry.name)
            name, _, rest = (entry / "stat").read_text().partition("(")[2].rpartition(")")
            state, parent, *_ = rest.split()
            if int(parent) == of_parent and state != "Z":
                found[pid] = name
    return found


def gone(pids: list[int]) -> bool:
    return not any(_alive(pid) for pid in pids)


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class Listener:
    """A passive client of a bus: every frame in the order of the bus."""

    def __init__(self, machine: Machine) -> None:
        (settings,) = machine_file.bus_settings(machine)
        self._port = bus.open(settings, filters=[(0, 0)])
        self._buffer = bytearray(pdo.FRAME_BYTES)
        self.frames: list[tuple[int, bytes]] = []

    def listen(self) -> None:
        while self._port.receive_into(self._buffer):
            can_id, data = pdo.unpack(self._buffer)
            self.frames.append((can_id, bytes(data)))

    def count(self, can_id: int, after: int = 0) -> int:
        return sum(heard == can_id for heard, _ in self.frames[after:])

    def last_sync(self) -> int:
        return max(i for i, (heard, _) in enumerate(self.frames) if heard == pdo.SYNC)

    def read(self, node: int, index: int) -> int:
        """SDO upload (CiA 301, 7.2.4.3.5) of up to four bytes."""
        asked = len(self.frames)
        self._port.send(pdo.frame(0x600 + node, bytes([0x40, index & 0xFF, index >> 8, 0, 0, 0, 0, 0])))

        def answer() -> list[bytes]:
            self.listen()
            return [data for heard, data in self.frames[asked:] if heard == 0x580 + node]

        return int.from_bytes(until(answer)[0][4:], "little", signed=True)
