"""What was recorded of a motion, and the machine that it was recorded on, simulated or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from controller.bringup.response import AxisTicks
from controller.geometry.arrays import Array
from controller.ipc.handoff import COLUMN, of_axes
from controller.machine.model import Machine
from controller.messages import Message, TextError
from controller.state.modes import Mode
from controller.state.setpoints import commanded


class NotDone(TextError, Exception):
    """A machine has not done what a step asks of it: why."""


@dataclass(frozen=True, slots=True)
class Stop:
    """What a machine stopped for: the axis ("" = it is of none), and the sentence."""

    axis: str
    why: Message


@dataclass(frozen=True, eq=False)
class Ticks:
    """A row a tick; positions in mm and degrees, as they are shown."""

    period_s: float
    latency: int  # ticks from a setpoint to the position that should be there
    setpoint: Array  # (N, axes) as sent
    actual: Array  # (N, axes) as reported
    line: NDArray[np.int64]  # (N,) of the program, 0 = none
    held: NDArray[np.bool_] | None = None  # (N,) in HOLD, as between the steps of a changer

    def __post_init__(self) -> None:
        """What begins before the start of a program has the line at which the one before it ended."""
        begins = int(np.argmax(self.line != self.line[0])) if len(self.line) else 0
        self.line[:begins] = 0

    @classmethod
    def of_rows(cls, rows: Array, machine: Machine, latency: int) -> Ticks:
        """Of the recorder's rows."""
        axes = len(machine.axes)
        shown = np.array([axis.shown_per_unit for axis in machine.axes])
        return cls(
            machine.period_s,
            latency,
            commanded(rows[:, of_axes("setpoint", axes)], machine) * shown,
            rows[:, of_axes("actual", axes)] * shown,
            rows[:, COLUMN["line"]].astype(np.int64),
            rows[:, COLUMN["mode"]] == Mode.HOLD,
        )

    def of_axis(self, index: int) -> AxisTicks:
        """One axis, each setpoint with the position that answers it."""
        columns = self.setpoint[:, index], self.actual[:, index]
        return AxisTicks.of(*columns, self.line, self.latency, self.period_s)


class Bench(Protocol):
    """A machine that is brought up: homed, and its drives enabled."""

    @property
    def machine(self) -> Machine: ...

    def positions(self) -> tuple[float, ...]:
        """Of the axes as their drives report them, mm and degrees."""

    def run(self, text: str, name: str, dry_run_mm: float = 0.0) -> Ticks:
        """A program, to its end; ``dry_run_mm``: so far off the part, spindle off. Raises NotDone."""

    def switched_off(self, seconds: float) -> Ticks:
        """Drives off for so long, and on again. Raises NotDone."""

    def power(self, on: bool) -> None:
        """Drives on, or off. Raises NotDone."""

    def wait(self, seconds: float) -> None:
        """Lets time pass."""

    def by_hand(self, action: str) -> bool:
        """Does what an operator does by hand, where it is simulated; else False."""

    def inputs(self) -> Mapping[str, bool]:
        """Those of ``[io]``, by name."""

    def switches(self, axis: str) -> int | None:
        """What the drive of an axis sees at its terminals (60FDh); None: it does not say."""

    def clamp(self, axis: str, is_open: bool) -> None:
        """Opens a clamp, or closes it. Raises NotDone."""

    def tool(self) -> int:
        """Which one is in the spindle."""

    def touches(self) -> str:
        """Of the last run, as ``calibration.touch_table`` reads them."""

    def stopped_by(self) -> Stop | None:
        """The fault in which the machine stands; None: in none."""

    def recover(self) -> None:
        """Out of a fault, once its cause has gone: reset, homed, enabled. Raises NotDone."""
