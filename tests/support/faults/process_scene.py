"""A live machine whose processes are killed, stopped and started anew, on a bus that stays.

The processes are those of the service, without it: a tick knows of a plan that was killed by the silence
alone, and nobody draws conclusions. The hub with the drives outlives the controller: that is how a machine
looks to a controller that is started again.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from support.faults.scene import RETRACT
from support.live.live_machines import Listener as Client
from support.live.live_machines import until
from support.machines.stepped_runs import shipped, three_times_example_2

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Jog, Outcome, Snapshot
from controller.machine import machine_file
from controller.machine.model import Homing, Machine
from controller.runtime.children import Child, environment
from controller.runtime.listener import Listener
from controller.runtime.plan_messages import Program
from controller.runtime.recording import Keeper
from controller.service.engine import Engine
from controller.service.folders import Folders
from controller.service.planner_client import Line
from controller.state.modes import Mode, Request
from drives import pdo

CUTS, TOOL = three_times_example_2("1500."), 2
JOG_MM, JOG_MM_S = 120.0, 150.0
AXIS = 1  # Y is jogged
STANDS = 0.01  # mm or degrees: less is a servo's last creeping
LIMIT_SWITCH = 17  # the negative one; on the virtual bus that is some 10^8 counts away
FAST, SLOW, ACCELERATION = (150.0, 3.0), (20.0, 0.5), (1000.0, 20.0)  # mm or rad, per s, per s^2
MODES = ("homing", "idle", "jog", "cutting", "hold", "resume")


def _homed_by_switches(made: Machine) -> Machine:
    """The same, with drives that move for some seconds when they home: time for a fault to come and go."""
    axes = []
    for axis in made.axes:
        fast, slow, acceleration = (pair[axis.is_rotary] for pair in (FAST, SLOW, ACCELERATION))
        homing = Homing(
            LIMIT_SWITCH, 1, axis.homing.position, fast=fast, slow=slow, acceleration=acceleration
        )
        axes.append(replace(axis, homing=homing))
    return replace(made, axes=tuple(axes), retract_mm=RETRACT)


class _PlainHub(Child):
    """A virtual bus by itself with simulated drives, as ``python -m drives.bench`` serves it."""

    def __init__(self, channel: Path, nodes: Sequence[int], words: Path) -> None:
        self.role, self._words = "hub", words
        command = [sys.executable, "-P", "-m", "drives.bench", str(channel), "--nodes", *map(str, nodes)]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, env=environment(), process_group=0)


class ProcessScene:
    """``folder`` is for recordings and for what the processes share."""

    def __init__(self, folder: Path) -> None:
        self.recordings = folder / "recordings"
        self.recordings.mkdir()
        self._folder, self._ending = folder, contextlib.ExitStack()
        made = _homed_by_switches(shipped())
        self.engine = Engine(made, folder, Folders.within(folder), lambda _: None)
        self.engine.start_hubs()
        self.machine, self.hubs = self.engine.machine, self.engine.hubs
        self.nodes = [axis.node for axis in self.machine.axes]
        self._before: Snapshot | None = None
        self._problem = ""  # why the machine did not come up
        self._listen()

    # -- processes

    def _listen(self) -> None:
        self.listener = Listener(machine_file.bus_settings(self.machine))
        (self.log,) = self.listener.logs.values()
        self.client = Client(self.machine)

    @property
    def tick(self) -> Child | None:
        return self.engine._run.tick if self.engine._run is not None else None

    @property
    def plan(self) -> Child | None:
        return self.engine._run.plan if self.engine._run is not None else None

    def start_controller(self) -> None:
        """A tick and a plan that know nothing yet."""
        self.engine.start()
        run = self.engine._run
        assert run is not None
        self.board, self.recorder, self._before = run.board, run.recorder, None
        self.keeper = Keeper(self.machine, self.recorder, self.listener.logs, self.recordings)
        self._bring_up()

    def start_plan(self) -> None:
        """Commissions, homes what has no zero, enables, and loads the program."""
        self._before = self.board.read()
        self.engine.mend()
        self._bring_up()

    def _bring_up(self) -> None:
        self._problem = ""
        threading.Thread(target=self._come_up, args=(self.engine.line,), daemon=True).start()

    def _come_up(self, line: Line) -> None:
        """To its end, or to that of the plan that was asked."""
        try:
            line.order("commission")
            homed = until(self.board.read).homed  # drives that know it all are quicker than a new tick
            line.order("home", tuple(i for i in range(len(self.nodes)) if not homed >> i & 1))
            asked = self.engine.request(Request.ENABLE)
            until(lambda: self.now.has_taken(asked) and self.now.mode in (Mode.READY, Mode.FAULT))
            part = Program(CUTS.encode(), "part.ngc", self.machine, in_spindle=TOOL, unchecked=True)
            line.order("arm", program=part)
        except CommandRefused as error:
            self._problem = error.sentence

    def end_controller(self) -> None:
        self.engine.end_run()

    def restart_hub(self) -> None:
        """Another hub at the same place, with drives that have just been switched on."""
        (name,) = self.hubs
        old = self.hubs[name]
        old.process.kill()
        old.process.wait()
        channel = Path(self.machine.buses[0].channel)
        channel.unlink(missing_ok=True)
        self.hubs[name] = _PlainHub(channel, self.nodes, self._folder / "again.words")
        self._ending.callback(self.hubs[name].end)
        until(channel.exists)
        self.listener.close()
        self._listen()

    def close(self) -> None:
        self.listener.close()
        with contextlib.suppress(ProcessLookupError):
            self._ending.close()
        self.engine.end()
        shutil.rmtree(self.recordings, ignore_errors=True)

    # -- what is seen, and asked for

    @property
    def now(self) -> Snapshot:
        now = self.board.read()
        assert now is not None
        return now

    def request(self, request: Request, value: float = 0.0) -> None:
        self.engine.request(request, value)

    def ask(self, request: Request, done: Callable[[Snapshot], bool]) -> None:
        """The tick takes it, or a fault was before it, and it is done."""
        number = self.engine.request(request)
        until(lambda: self.now.has_taken(number))
        came, why = self.now.came_of(number)
        assert came is Outcome.DONE or done(self.now), f"{request.name} in {self.now.mode.name}: {why.name}"
        until(lambda: done(self.now))

    def ready(self) -> None:
        """Homed, enabled, at rest, with the program's first message taken."""
        taken = max(self._before.accepted, self._before.rejected) if self._before else 0

        def done() -> bool:
            now = self.board.read()
            ready = now is not None and now.mode is Mode.READY and now.accepted > taken
            return ready or bool(self._problem) or (now is not None and now.mode is Mode.FAULT)

        until(done)
        assert self.now.mode is Mode.READY, f"{self.now.mode.name}, {self.now.fault.name}: {self._problem}"

    def meet(self) -> None:
        """Joins the bus anew: a client that has not listened for long hears no answer, its queue is full."""
        self.client._port.close()
        self.client = Client(self.machine)

    def bus_s(self) -> float:
        """The stamp of the last frame heard: the bus' time."""
        return self.log._kept[-1][0]

    def heartbeats(self, count: int) -> None:
        """Waits so many heartbeats of a drive: bus time."""
        beat, begun = pdo.HEARTBEAT + self.nodes[0], 0

        def heard() -> bool:
            self.client.listen()
            return self.client.count(beat) >= begun + count

        until(heard)

    def stop_tick(self, seconds: float) -> None:
        """SIGSTOP for a while: of bus time where it is long."""
        assert self.tick is not None
        self.meet()
        os.kill(self.tick.pid, signal.SIGSTOP)
        try:
            if seconds >= 0.2:
                self.heartbeats(math.ceil(seconds / machine_file.master_settings(self.machine).heartbeat_s))
            else:
                time.sleep(seconds)
        finally:
            os.kill(self.tick.pid, signal.SIGCONT)

    # -- where the drives are, by the bus

    def positions(self, from_s: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Times (N,) and counts (N,) of each axis since ``from_s``, from TPDO and SDO."""
        found: list[tuple[list[float], list[int]]] = [([], []) for _ in self.nodes]
        feedback = {pdo.TPDO1 + node: i for i, node in enumerate(self.nodes)}
        answers = {0x580 + node: i for i, node in enumerate(self.nodes)}
        for at_s, frame in self.log.frames():
            can_id, data = pdo.unpack(frame)
            if at_s < from_s:
                continue
            if can_id in feedback:
                times, counts = found[feedback[can_id]]
                times.append(at_s)
                counts.append(pdo.FEEDBACK.unpack(bytes(data))[1])
            elif can_id in answers and bytes(data[:4]) == b"\x43\x64\x60\x00":
                times, counts = found[answers[can_id]]
                times.append(at_s)
                counts.append(int.from_bytes(data[4:8], "little", signed=True))
        return [(np.array(times), np.array(counts)) for times, counts in found]

    def stood_after_s(self, from_s: float) -> float:
        """From ``from_s`` to the last sign of motion of any axis."""
        latest = from_s
        for (times, counts), axis in zip(self.positions(from_s), self.machine.axes, strict=True):
            if len(counts):
                near = STANDS * abs(axis.counts_per_unit / axis.shown_per_unit)
                moving = np.flatnonzero(np.abs(counts - counts[-1]) > near)
                latest = max(latest, float(times[moving[-1]]) if len(moving) else from_s)
        return latest - from_s

    def look_until(self, until_s: float) -> None:
        """Asks the drives where they are, again and again, for nobody else makes them tell."""
        self.meet()

        def over() -> bool:
            for node in self.nodes:
                self.client.read(node, 0x6064)
            return self.bus_s() > until_s

        until(over)

    # -- the modes: each returns at the moment in which the fault is to come

    def bring(self, mode: str) -> None:
        if mode == "homing":
            self.start_controller()
            until(lambda: self.board.read() is not None and self.now.mode is Mode.HOMING and self._homes())
            return
        self.ready()
        getattr(self, f"_{mode}")()

    def _homes(self) -> bool:
        before = self.now
        time.sleep(0.01)
        return self.now.actual != before.actual

    def _idle(self) -> None:
        tick = self.now.tick
        until(lambda: self.now.tick > tick + 20)

    def _jog(self) -> None:
        back = -1.0 if self.now.joints[AXIS] > 0.0 else 1.0
        self.engine.jog(Jog(tuple([back * (i == AXIS) for i in range(5)]), JOG_MM_S, JOG_MM))
        begun = self.now.joints[AXIS]
        until(lambda: abs(self.now.joints[AXIS] - begun) > 0.25 * JOG_MM or self.now.mode is Mode.FAULT)

    def _cutting(self) -> None:
        if self.now.mode is Mode.READY:
            self.request(Request.START)
        until(lambda: (self.now.cutting and self.now.rate == 1.0) or self.now.mode is Mode.FAULT)

    def _hold(self) -> None:
        self._cutting()
        self.request(Request.HOLD)
        until(lambda: self.now.mode is not Mode.RUNNING and (self.now.stopping or self.now.at_rest))

    def _resume(self) -> None:
        self._hold()
        until(lambda: self.now.at_rest and not self.now.stopping)
        self.ask(Request.RESUME, lambda now: now.mode is not Mode.HOLD)
        until(lambda: not self.now.at_rest)

    def again(self, mode: str) -> bool:
        """The same moment once more, on a machine that went on; False if there is none left."""
        now = self.now
        if mode == "homing":
            return now.mode is Mode.HOMING
        if mode == "jog":
            until(lambda: self.now.mode is Mode.READY)
            self._jog()
            return True
        if mode != "idle" and now.mode is Mode.READY:
            return False  # the program is over
        if mode in ("hold", "resume"):
            until(lambda: self.now.at_rest or self.now.mode is Mode.RUNNING)
            if self.now.mode is Mode.HOLD:
                self.ask(Request.RESUME, lambda now: now.mode is not Mode.HOLD)
        if mode != "idle":
            getattr(self, f"_{mode}")()
        return True

    def off(self) -> None:
        """From whatever came of it: at rest, the drives off, the fault reset."""
        if self.now.mode in (Mode.RUNNING, Mode.HOLD, Mode.JOG, Mode.HOMING):
            self.ask(Request.STOP, lambda now: now.mode in (Mode.READY, Mode.OFF, Mode.FAULT))
        if self.now.mode is Mode.FAULT:
            until(lambda: self.now.at_rest)
            self.ask(Request.RESET, lambda now: now.mode is not Mode.FAULT)
        self.ask(Request.DISABLE, lambda now: now.mode is Mode.OFF)
