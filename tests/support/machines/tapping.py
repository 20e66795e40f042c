"""A mill whose spindle tells its angle, and what its tap has cut: from the motors' own positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from support.machines.spindle_machine import SLOWER, SPINDLE, mill

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.runtime import checked
from controller.runtime.events import Event
from controller.runtime.stepped import Run, SteppedMachine
from drives.bench.simulated.spindle_motor import MotorParameters

POSITION = "counts_per_rev = 4096\nposition = { acceleration_rev_s2 = 50.0, load = true }"


def machine(position: str = POSITION, slower: bool = False) -> Machine:
    changes = (SLOWER,) if slower else ()
    return mill(SPINDLE.replace("counts_per_rev = 4096", position), "", "", changes=changes)


class Cut(NamedTuple):
    """While the axes followed the spindle, a row each tick."""

    turns: npt.NDArray[np.float64]  # of the motor, since the thread began
    joints: npt.NDArray[np.float64]  # (N, axes) where the axes' motors are
    way: npt.NDArray[np.float64]  # mm along the tool's way, X Y Z, since the thread began

    def error_um(self, rev_per_mm: float) -> float:
        """The largest distance of the tap from its thread."""
        return float(np.abs(self.way - self.turns / rev_per_mm).max() * 1000.0)

    def pitch_mm(self) -> float:
        """Of the line through the turns at more than a fifth of the speed."""
        speed = np.abs(np.gradient(self.turns))
        fast = speed > 0.2 * speed.max()
        return float(np.polyfit(self.turns[fast], self.way[fast], 1)[0])


class Tapper:
    """Runs programs; notes every tick, and where the motors themselves are."""

    def __init__(self, made: Machine | None = None, motor: MotorParameters | None = None) -> None:
        self.machine = made or machine()
        self.bench = SteppedMachine(self.machine, motor=motor)
        self.bench.come_up()
        self.seen: list[Snapshot] = []
        self.at: dict[int, Callable[[], None]] = {}  # what happens, by tick of the thread
        self._rows: list[tuple[float, ...]] = []
        self._tick = self.bench.tick
        self.bench.tick = self._noted  # type: ignore[method-assign]

    @property
    def spindle(self):  # type: ignore[no-untyped-def]
        return self.bench.rig.spindle

    @property
    def now_s(self) -> float:
        return self.bench.rig.now_s

    def _noted(self) -> None:
        if (act := self.at.get(len(self._rows))) is not None and self.bench.cycle.coupling.active:
            act()
        self._tick()
        now = self.bench.board.read()
        assert now is not None
        self.seen.append(now)
        if self.bench.cycle.coupling.active:
            drives = self.bench.rig.drives
            axes = [drives[a.name].motor_counts / a.counts_per_unit for a in self.machine.axes]
            assert self.machine.spindle is not None
            turned = self.spindle.axis.servo.shaft / self.machine.spindle.counts_per_rev
            self._rows.append((turned, *axes))

    def run(self, program: str, *events: Event) -> Run:
        task = replace(checked.task(program.encode(), "part.ngc", self.machine), start=self.bench.joints)
        self.seen.clear()
        self._rows.clear()
        return self.bench.run(checked.walk_of(task, None, False), events)

    def ticks(self, count: int) -> Snapshot:
        for _ in range(count):
            self.bench.tick()
        return self.seen[-1]

    @property
    def cut(self) -> Cut:
        rows = np.array(self._rows)
        xyz = rows[:, [1 + i for i in self.machine.linear()]]
        off = xyz - xyz[0]
        return Cut(rows[:, 0] - rows[0, 0], rows[:, 1:], np.linalg.norm(off, axis=1))
