"""A whole machine on the stepped clock to which faults are done, and what is seen of it.

What counts is the bus' clock and the simulated drives' own motors: their positions are
looked at with every tick, as are the setpoints that the controller sends.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from support.machines.stepped_runs import shipped, three_times_example_2

from controller.ipc.handoff import COLUMN, STOOD
from controller.machine.model import Homing, Machine
from controller.plan.path import path
from controller.program import blocks
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.events import Event
from controller.runtime.recording import Keeper
from controller.runtime.startup import SessionError
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault, Mode, Request
from drives.bench.simulated.drive import SimulatedDrive
from drives.cia402 import Wanted

INDEX_SEARCH = 34  # homing on the next index pulse: it moves, and needs no switch
SLOW = 0.2  # mm/s or rad/s
RETRACT = 140.0  # low, for short ways to the cut
CUTS = three_times_example_2("3000.")
JOG = "G21 G90 G54 G0 Y{y}\nM30\n"
STANDS = 0.5  # mm/s or degrees/s: below this an axis stands
GOES_ON_S = 0.5  # so long after the fault a machine that goes on is stopped


class Look(NamedTuple):
    """What one tick left behind."""

    at_s: float  # bus time
    mode: Mode
    fault: Fault
    sent: bool  # SYNC went out, and setpoints
    stood: bool  # after a long gap what no SYNC had latched was taken back
    setpoints: tuple[int, ...]
    used: tuple[bool, ...]  # the drives follow them, and are told to
    motors: tuple[float, ...]  # of the simulated drives, counts
    speeds: tuple[float, ...]  # theirs, counts/s


def machine() -> Machine:
    """The shipped machine, with drives that move when they home."""
    return with_homing(shipped())


def with_homing(made: Machine) -> Machine:
    """The same, with drives that move when they home."""
    axes = []
    for axis in made.axes:
        homing = Homing(INDEX_SEARCH, 1, axis.homing.position, fast=1.0, slow=SLOW, acceleration=100.0)
        axes.append(replace(axis, homing=homing))
    return replace(made, axes=tuple(axes), retract_mm=RETRACT)


class Scene(SteppedMachine):
    """``after_tick`` is called with every tick; ``late_s`` makes the next one late."""

    def __init__(self, recordings: Path, of: Machine | None = None) -> None:
        self.looks: list[Look] = []
        self.after_tick: Callable[[], None] = lambda: None
        self.late_s = 0.0
        self.planner_dead = False
        self.will_resume = False  # the operator, out of the hold under way
        self.goes_on_s = GOES_ON_S
        self.resumed_s = math.inf  # when a hold of the machine's own was over
        super().__init__(of or machine(), recordings=recordings, lateness=self._late)
        self.bus = self.rig.buses[self.machine.axes[0].bus]
        self.observer = self.observe()
        self.inject()
        self.group = self._group

    def _late(self, _wait: int) -> float:
        late_s, self.late_s = self.late_s, 0.0
        return late_s

    def _plan(self) -> None:
        if not self.planner_dead:
            super()._plan()

    def _is_operator_hold(self, events: Sequence[Event], n: int) -> bool:
        return True  # every hold here is the operator's

    def _goes_on(self, waiting: Sequence[Event], asked: bool) -> bool:
        return self.will_resume

    def kill_planner(self) -> None:
        """It plans nothing more, and its end of the socket is gone."""
        self.planner_dead = self.cycle._pieces.closed = True

    def drive(self, axis: int) -> SimulatedDrive:
        return self.rig.drives[self.machine.axes[axis].name]

    def tick(self) -> None:
        super().tick()
        modes, drives = self.cycle.modes, self.group.drives
        (row,) = self.recorder.last(1)
        self.looks.append(
            Look(
                self.rig.now_s,
                modes.mode,
                modes.fault,
                bool(row[COLUMN["sync_sent"]]),
                bool(int(row[COLUMN["switches"]]) & STOOD),
                tuple(drive.setpoint for drive in drives),
                tuple(drive.following and drive.wanted is Wanted.ENABLED for drive in drives),
                self.motors(),
                tuple(drive.axis.servo.velocity for drive in self.rig.drives.values()),
            )
        )
        self.after_tick()

    def motors(self) -> tuple[float, ...]:
        """In power-on counting: homing moves the counting and not the motor."""
        axes = [drive.axis for drive in self.rig.drives.values()]
        return tuple(axis.servo.position - axis.sensors.moved for axis in axes)

    def settle(self, seconds: float) -> None:
        for _ in range(round(seconds / self.machine.period_s)):
            self.tick()

    def run_text(self, text: str) -> None:
        """Trace and run a program from where the machine stands."""
        known = blocks.read(text.encode(), self.machine, "part.ngc")
        self.run(path.trace(known, self.machine, self.kinematics, self.joints))

    def inject(self) -> None:
        """The script's time begins."""
        self.began_s = self.rig.now_s
        self.injected = MachineScript().inject(self.rig.buses)

    def befall(self, *lines: str) -> None:
        """Lines of a fault script without their time: at once."""
        now_s = self.rig.now_s - self.began_s
        text = "\n".join(f"at {now_s:.9f} s: {line}" for line in lines)
        self.injected.add(MachineScript.read(text, self.machine).faults)

    # -- back to work

    @property
    def keeper(self) -> Keeper:
        assert self._keeper is not None
        return self._keeper

    def heal(self) -> None:
        """Whatever was done to bus, drives and planner is over."""
        self.after_tick = lambda: None
        self.planner_dead = self.will_resume = self.cycle._pieces.closed = False
        for injector in self.injected._injectors.values():
            for twin in injector._nodes._twins.values():
                twin.power_off(self.rig.now_s)
            injector.remove()
        self.inject()
        for source in (
            self.bus.controller,
            *(self.bus.errors.of(self.bus.source_of(a.node)) for a in self.machine.axes),
        ):
            self.bus.errors.restart(source, self.bus.now_s)
        for drive in self.rig.drives.values():
            drive.inputs.set(0, self.rig.now_s)
        self.settle(0.05)


# ---- the six modes: each brings the scene to a moment and lets ``strike`` happen there ----------

Strike = Callable[[], None]


def homing(scene: Scene, strike: Strike) -> None:
    struck: list[int] = []

    def look() -> None:
        moving = len(scene.looks) > 1 and scene.looks[-1].motors[0] != scene.looks[-2].motors[0]
        if scene.cycle.modes.mode is Mode.HOMING and moving and not struck:
            struck.append(1)
            strike()

    scene.after_tick = look
    try:
        scene.come_up()
    except SessionError:
        scene.settle(1.0)


def idle(scene: Scene, strike: Strike) -> None:
    scene.settle(0.02)
    strike()
    scene.settle(0.8)


def _running(scene: Scene, text: str, strike: Strike, when: Callable[[], bool]) -> None:
    """``strike`` once at ``when``; a machine that goes on is stopped by the operator a while later."""
    struck: list[int] = []

    def look() -> None:
        tick = scene.cycle.tick
        if not struck and when():
            struck.append(tick)
            strike()
        over = bool(struck) and tick == struck[0] + round(scene.goes_on_s / scene.machine.period_s)
        if over and not (scene.planner_dead and scene.cycle.modes.running):  # that ends with the queue
            _stop(scene)

    scene.after_tick = look
    scene.run_text(text)
    assert struck, f"the moment did not come: {scene.cycle.modes.mode!r}, {scene.fault_text}"
    if scene.cycle.modes.mode is Mode.FAULT:
        return  # the run has waited until it stood and was recorded
    scene.settle(GOES_ON_S)
    if scene.cycle.modes.mode in (Mode.HOLD, Mode.RUNNING):
        _stop(scene)
        scene.settle(0.1)


def _stop(scene: Scene) -> None:
    scene.planner.drop()
    scene.request(Request.STOP)


def jog(scene: Scene, strike: Strike) -> None:
    """A rapid alone, at full speed."""
    y = scene.machine.axes[1]
    far = -150.0 if scene.joints[1] > 96.0 else 150.0

    def fast() -> bool:
        if len(scene.looks) < 2:
            return False
        moved = scene.looks[-1].setpoints[1] - scene.looks[-2].setpoints[1]
        return bool(abs(moved) > 0.9 * y.limits.velocity * abs(y.counts_per_unit) * scene.machine.period_s)

    _running(scene, JOG.format(y=far), strike, fast)


def _cuts(scene: Scene) -> bool:
    follow = scene.cycle.follow
    return bool(follow.piece and follow.piece.cutting and follow.feed > 40.0)


def cutting(scene: Scene, strike: Strike) -> None:
    _running(scene, CUTS, strike, lambda: _cuts(scene))


def hold(scene: Scene, strike: Strike) -> None:
    """Half-way down to the standstill of a hold."""
    asked: list[int] = []

    def when() -> bool:
        if not asked and _cuts(scene):
            asked.append(scene.cycle.tick)
            scene.request(Request.HOLD)
        return bool(asked) and scene.cycle.tick == asked[0] + 12

    _running(scene, CUTS, strike, when)


def resume(scene: Scene, strike: Strike) -> None:
    """Shortly after it has begun to move again."""
    asked: list[int] = []

    def when() -> bool:
        if not asked and _cuts(scene):
            asked.append(scene.cycle.tick)
            scene.request(Request.HOLD)
            scene.will_resume = True
        if asked and scene.cycle.tick == asked[0] + 100:
            scene.request(Request.RESUME)
        begun = asked and scene.cycle.tick > asked[0] + 110 and scene.cycle.modes.running
        return bool(begun) and scene.cycle.follow.feed > 5.0

    _running(scene, CUTS, strike, when)


MODES = {"homing": homing, "idle": idle, "jog": jog, "cutting": cutting, "hold": hold, "resume": resume}


# ---- what is judged -----------------------------------------------------------------------------


def stood_after_s(scene: Scene, struck_s: float, skip: tuple[int, ...] = ()) -> float:
    """From ``struck_s`` to the last moment at which any motor moved; ``skip``: axes not looked at."""
    rows = [look for look in scene.looks if struck_s <= look.at_s <= scene.resumed_s]
    motors = np.array([look.motors for look in rows])
    times = np.array([look.at_s for look in rows])
    shown = np.array([abs(a.counts_per_unit / a.shown_per_unit) for a in scene.machine.axes])
    speed = np.abs(np.diff(motors, axis=0)) / np.diff(times)[:, None] / shown
    speed[:, list(skip)] = 0.0
    moving = np.flatnonzero((speed > STANDS).any(axis=1))
    return 0.0 if not len(moving) else float(times[moving[-1] + 1] - struck_s)


def jumps(scene: Scene) -> tuple[float, float]:
    """Largest first and second difference of the setpoints in use, as shares of the axes' limits."""
    T = scene.machine.period_s
    axes = scene.machine.axes
    scale = np.array([abs(a.counts_per_unit) for a in axes])
    v = np.array([a.limits.velocity for a in axes]) * scale * T + 1.0
    a = np.array([a.limits.acceleration for a in axes]) * scale * T**2 + 4.0
    worst = np.zeros(2)
    for latched, used in _parts(scene.looks):
        first, second = np.diff(latched, axis=0), np.diff(latched, n=2, axis=0)
        in_use = used[1:] & used[:-1]
        through = used[2:] & used[1:-1] & used[:-2]
        here = (np.abs(first) / v * in_use).max(initial=0.0), (np.abs(second) / a * through).max(initial=0.0)
        worst = np.maximum(worst, here)
    return float(worst[0]), float(worst[1])


def _parts(looks: Sequence[Look]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Setpoints that a SYNC had the drives use (N, 5), and whether they did, from gap to gap.

    After a gap the drives stand, so its part begins with the place of the last one, three times.
    """
    found: list[list[Look]] = [[]]
    for before, look in itertools.pairwise(looks):
        if look.stood:
            found.append(found[-1][-1:] * 3)
        elif look.sent:
            found[-1].append(before)
    long = [part for part in found if len(part) > 2]
    return [(np.array([p.setpoints for p in part], float), np.array([p.used for p in part])) for part in long]
