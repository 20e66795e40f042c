"""Somebody beside a simulated machine who looks at its motors, and believes nothing that is reported.

Once per tick the mode, the fault, the commanded joints and the true places of the motors are noted:
those of the simulated motors themselves, not what their drives say. A setpoint that is sent in tick k
is latched by the SYNC of tick k + 1 and is the end of the interpolation period that then begins;
with the SYNC of tick k + 2 the period is over, and in tick k + 3 the motors of that moment are seen:

    tick      k        k+1       k+2       k+3
    SYNC      |---------|---------|---------|
    setpoint  sent      latched   reached   compared with the motor
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array
from controller.geometry.vectors import ROUNDING
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Machine
from controller.state.modes import FAULTS, Fault, Mode, Reaction
from controller.tick.cycle import Cycle
from controller.tick.stock import DELAY
from controller.tick.sync_watch import FEEDBACK_TICKS
from drives.bench.simulated.plant import Plant
from drives.bench.simulated.rig import Rig
from drives.bench.simulated.servo import Servo

STANDS = 0.5  # mm/s or degrees/s: below this a motor stands
STANDS_FOR_S = 0.1  # so long; a drive that is about to be switched off stands no longer
LONGEST_STOP_S = 10.0  # a motor without torque may coast for long, not for ever


class Seen(NamedTuple):
    """One tick."""

    tick: int
    time_s: float  # of the buses' clock; homing passes some without ticks
    mode: Mode
    fault: Fault
    fault_axis: int
    warning: Fault
    on_path: bool  # the commanded joints are the plan's, and the drives are to follow them
    untrusted: int  # bit mask of the axes
    torque: int  # of the motors that have enough for a stop of their axis
    recounted: int  # of the drives that count from another zero than when the path began
    command: tuple[float, ...]  # joints, mm and rad
    motors: tuple[float, ...]  # mm and rad, in power-on counting: homing moves the counting, not the motor
    zeros: tuple[float, ...]  # to be added for joints
    speeds: tuple[float, ...]  # of the motors, mm/s and rad/s
    told: tuple[float, ...]  # joints where the drives say they are, as the tick has heard it
    warning_axis: int = -1


class Raised(NamedTuple):
    """A fault as it was first shown."""

    tick: int
    time_s: float
    fault: Fault
    axis: int  # -1 = none


class Observer:
    """Call ``look`` with every tick; then ask for ``sight``."""

    def __init__(self, machine: Machine, cycle: Cycle, rig: Rig) -> None:
        self._machine, self._cycle, self._rig = machine, cycle, rig
        self._axes = [rig.drives[axis.name].axis for axis in machine.axes]
        # Motors are in increments of their encoders, whatever their drives speak in.
        scales = zip(self._axes, machine.axes, strict=True)
        self._per_increment = [one.units.position / axis.counts_per_unit for one, axis in scales]
        self._stops = [  # increments/s^2
            (axis.stopping.quick_stop or axis.limits.acceleration) / abs(size)
            for axis, size in zip(machine.axes, self._per_increment, strict=True)
        ]
        self._per_count = [1.0 / axis.counts_per_unit for axis in machine.axes]
        self._seen: list[Seen] = []
        self._shift = [0.0] * len(self._axes)
        self._on_path = False
        self._still = 0  # ticks in which all motors stood
        self._since_fault = 0
        self._step = [STANDS / abs(axis.shown_per_unit) * machine.period_s for axis in machine.axes]
        self.begin(0.0)

    def begin(self, after_s: float) -> None:
        """Forget what was; the next tick is number 0, and times count from ``after_s`` on."""
        self._seen.clear()
        self._on_path, self._still, self._since_fault = False, 0, 0
        self.first_tick = self._cycle.tick + 1
        self._origin_s = self._rig.now_s + after_s

    def look(self) -> None:
        """Note what the tick has left."""
        cycle = self._cycle
        modes = cycle.modes
        on_path = modes.on_path and modes.mode not in (Mode.OFF, Mode.HOMING)
        if (on_path and not self._on_path) or modes.mode in (Mode.OFF, Mode.HOMING):
            self._shift = [axis.sensors.moved for axis in self._axes]
        self._on_path = on_path
        seen = Seen(
            cycle.tick - self.first_tick,
            self._rig.now_s - self._origin_s,
            modes.mode,
            modes.fault,
            modes.fault_axis,
            modes.warning,
            on_path,
            modes.untrusted,
            self._braking(),
            self._recounted(),
            cycle.follow.joints,
            self._turned([_true_counts(axis.servo) - axis.sensors.moved for axis in self._axes]),
            self._turned(self._shift),
            self._turned([axis.servo.velocity for axis in self._axes]),
            tuple(n * size for n, size in zip(cycle.group.positions, self._per_count, strict=True)),
            modes.warning_axis,
        )
        self._count(seen)
        self._seen.append(seen)

    def _braking(self) -> int:
        pairs = enumerate(zip(self._axes, self._stops, strict=True))
        return sum(1 << i for i, (axis, stop) in pairs if axis.powered and axis.servo.strongest >= stop)

    def _recounted(self) -> int:
        pairs = zip(self._axes, self._shift, strict=True)
        return sum(1 << i for i, (axis, shift) in enumerate(pairs) if axis.sensors.moved != shift)

    def _turned(self, increments: Sequence[float]) -> tuple[float, ...]:
        return tuple(n * size for n, size in zip(increments, self._per_increment, strict=True))

    def _count(self, seen: Seen) -> None:
        before = self._seen[-1].motors if self._seen else seen.motors
        moves = any(abs(a - b) > s for a, b, s in zip(seen.motors, before, self._step, strict=True))
        self._still = 0 if moves else self._still + 1
        stops = seen.fault is not Fault.NONE and seen.mode in (Mode.FAULT, Mode.HOLD)
        self._since_fault = self._since_fault + 1 if stops else 0

    @property
    def settled(self) -> bool:
        """Whether a machine that a fault has stopped stands, or never will."""
        if not self._since_fault:
            return True
        T = self._machine.period_s
        return self._still * T >= STANDS_FOR_S or self._since_fault * T >= LONGEST_STOP_S

    @property
    def sight(self) -> Sight:
        return Sight(self._machine, tuple(self._seen))


def latency(machine: Machine) -> int:
    """Ticks from a setpoint to the motor that should be there."""
    return FEEDBACK_TICKS + DELAY * machine.has_pump


def _true_counts(servo: Servo) -> float:
    """Where the motor is; of a plant with an encoder of its own, not what that reads."""
    return servo.motor if isinstance(servo, Plant) else servo.position


@dataclass(frozen=True)
class Sight:
    """What was seen of a run, tick by tick."""

    machine: Machine
    ticks: tuple[Seen, ...]

    @cached_property
    def command(self) -> Array:
        """Commanded joints, shape (N, axes), mm and rad."""
        return np.array([seen.command for seen in self.ticks])

    @cached_property
    def motors(self) -> Array:
        """Where the motors truly were, shape (N, axes), mm and rad, in the joints' counting."""
        travelled = self.travel + np.array([seen.zeros for seen in self.ticks])
        return np.stack(Slides(self.machine.axes).real(travelled.T), axis=1)

    @cached_property
    def travel(self) -> Array:
        """Where the motors were in power-on counting, shape (N, axes), mm and rad."""
        return np.array([seen.motors for seen in self.ticks])

    @cached_property
    def followed(self) -> npt.NDArray[np.bool_]:
        """Ticks in which the motors should be where the path was ``latency`` ticks before, shape (N,)."""
        on = np.array([seen.on_path for seen in self.ticks])
        whole = on.copy()
        for lag in range(1, latency(self.machine) + 1):
            whole[lag:] &= on[:-lag]
            whole[:lag] = False
        return whole

    @cached_property
    def distance(self) -> Array:
        """From the command to the motor, shape (N, axes), mm and rad; 0 where no path is followed."""
        off = np.zeros_like(self.motors)
        late = latency(self.machine)
        off[late:] = np.abs(self.command[:-late] - self.motors[late:])
        off[~self.followed] = 0.0
        return off

    @cached_property
    def turned(self) -> Array:
        """The speed of the motors themselves, shape (N, axes), mm/s and rad/s."""
        return np.asarray(np.abs(np.array([seen.speeds for seen in self.ticks])))

    @cached_property
    def speed(self) -> Array:
        """Of the motors since the tick before, shape (N, axes), mm/s and rad/s.

        Their periods end with a SYNC, which may come late: now and then two of them are in one tick.
        """
        T, times_s = self.machine.period_s, np.array([seen.time_s for seen in self.ticks])
        steps = np.diff(self.travel, axis=0, prepend=self.travel[:1])
        return np.asarray(np.abs(steps) / np.diff(times_s, prepend=times_s[0] - T)[:, None])

    def raised(self) -> tuple[Raised, ...]:
        """Every fault in the order of its first tick; also what stopped nothing, or came on top."""
        found: dict[tuple[Fault, int], Raised] = {}
        for seen in self.ticks:
            known = {fault for fault, _ in found}
            told = seen.fault in known if seen.fault_axis < 0 else (seen.fault, seen.fault_axis) in found
            new = [] if told else [(seen.fault, seen.fault_axis)]
            new += [] if seen.warning in {*known, seen.fault} else [(seen.warning, seen.warning_axis)]
            for fault, axis in new:
                if fault is not Fault.NONE:
                    found[fault, axis] = Raised(seen.tick, seen.time_s, fault, axis)
        return tuple(found.values())

    def tick_at(self, time_s: float) -> int:
        """The tick whose SYNC was the last one before a time."""
        times_s = [seen.time_s for seen in self.ticks]
        return bisect(times_s, time_s + ROUNDING) - 1 if times_s else 0

    def stood(self) -> tuple[int | None, ...]:
        """Axis by axis the tick from which on its motor stood to the end; None where it never did."""
        shown = np.array([abs(axis.shown_per_unit) for axis in self.machine.axes])
        moves = self.speed * shown > STANDS
        stand = max(1, round(STANDS_FOR_S / self.machine.period_s))
        last = [int(np.flatnonzero(column)[-1]) if column.any() else -1 for column in moves.T]
        return tuple(self._tick(n + 1) if n + stand < len(self.ticks) else None for n in last)

    def _tick(self, row: int) -> int:
        return self.ticks[row].tick

    def to_dict(self) -> dict[str, object]:
        """For ``--json``: lengths in mm, angles in degrees, ticks from the beginning."""
        axes = self.machine.axes
        raised = self.raised()
        stopped = [one for one in raised if FAULTS[one.fault].reaction >= Reaction.HOLD]
        return {
            "raised": [
                {
                    "tick": one.tick,
                    "time_s": one.time_s,
                    "fault": one.fault.name,
                    "axis": axes[one.axis].name if one.axis >= 0 else None,
                    "class": FAULTS[one.fault].reaction.name,
                }
                for one in raised
            ],
            "distance": self._distances(),
            "stood": self._standstill(stopped[0]) if stopped else None,
            "mode": self.ticks[-1].mode.name if self.ticks else None,
        }

    def _distances(self) -> dict[str, object]:
        """Of each axis the largest distance from its command, and when that was."""
        told: dict[str, object] = {}
        for i, axis in enumerate(self.machine.axes):
            row = int(self.distance[:, i].argmax())
            unit = "deg" if axis.is_rotary else "mm"
            largest = float(self.distance[row, i]) * abs(axis.shown_per_unit)
            told[axis.name] = {"largest": largest, "unit": unit, "tick": self._tick(row)}
        return told

    def _standstill(self, fault: Raised) -> dict[str, object]:
        """When the machine stood, and each axis, in ticks and in ms after the fault; null = it did not."""

        def to_json(tick: int | None) -> dict[str, object] | None:
            if tick is None:
                return None
            after_ms = 1e3 * max(0, tick - fault.tick) * self.machine.period_s
            return {"tick": tick, "after_ms": after_ms}

        ticks = self.stood()
        stand = [tick for tick in ticks if tick is not None]
        whole = to_json(max(stand)) if len(stand) == len(ticks) else None
        by_axis = {axis.name: to_json(tick) for axis, tick in zip(self.machine.axes, ticks, strict=True)}
        return {**(whole or {"tick": None, "after_ms": None}), "axes": by_axis}
