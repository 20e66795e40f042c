"""A cut that loads the simulated spindle: the torque of the chip, where the tool is in the stock.

    M = k_c A v_f / (2 pi n)      k_c: specific cutting force, A: section of the chip across the feed,
                                  v_f: speed of the tip in the part, n: speed of the spindle

as text-books have the power P = k_c A v_f of milling (k_c the same at every chip thickness). Of a
simulation file, beside what a probe can touch:

```toml
[cut]
force_n_mm2 = 1800.0     # k_c
rated_nm = 12.0          # of the spindle's drive: its load is a share of that
length_mm = 100.0        # of the tool: where its tip is

[[stock]]                # in the frame of the part; the first in which the tip is counts
low_mm = [0.0, -5.0, -5.0]
high_mm = [20.0, 5.0, 5.0]
section_mm2 = 15.0       # A: width times depth of cut
```
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from controller.geometry.vectors import Frame, Vector, norm, subtract
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.machine.toml_table import Table
from controller.values import dataclass
from drives.simulated.spindle_motor import SpindleMotor

if TYPE_CHECKING:
    from drives.simulated.drive import SimulatedDrive

TURNS_REV_S = 0.5  # slower than this it does not cut


@dataclass(frozen=True, slots=True)
class Stock:
    """A box in the frame of the part, and the section of the chip in it."""

    low: Vector
    high: Vector
    section_mm2: float

    def has(self, p: Vector) -> bool:
        return all(a <= x <= b for a, x, b in zip(self.low, p, self.high, strict=True))


@dataclass(frozen=True, slots=True)
class Cut:
    """What there is to be cut; ``frame`` is that of the part, seen from the table."""

    frame: Frame
    force_n_mm2: float
    rated_nm: float
    length_mm: float
    stock: tuple[Stock, ...]

    def torque_nm(self, tip: Vector, speed_mm_s: float, rev_s: float) -> float:
        """At a tip in the table's frame; 0 outside of the stock, and of a spindle that stands."""
        place = self.frame.from_parent(tip)
        found = next((one.section_mm2 for one in self.stock if one.has(place)), 0.0)
        if abs(rev_s) < TURNS_REV_S:
            return 0.0
        return self.force_n_mm2 * found * speed_mm_s * 1e-3 / (2.0 * math.pi * abs(rev_s))


def read(top: Table, frame: Frame) -> Cut | None:
    """``[cut]`` and ``[[stock]]`` of a simulation file; None without them. Raises ConfigError."""
    if not top.has("cut"):
        return None
    table = top.table("cut", "[cut]")
    force, rated = table.positive("force_n_mm2"), table.positive("rated_nm")
    length = table.number("length_mm", default=0.0)
    table.finish()
    stock = []
    for one in top.tables("stock"):
        stock.append(Stock(one.vector("low_mm"), one.vector("high_mm"), one.positive("section_mm2")))
        one.finish()
    return Cut(frame, force, rated, length, tuple(stock))


class Cutting:
    """The tool in the stock; call ``watch`` when the motors have moved."""

    def __init__(
        self, cut: Cut, machine: Machine, drives: Sequence[SimulatedDrive], spindle: SimulatedDrive
    ) -> None:
        """``drives`` in the order of the axes."""
        self._cut, self._drives, self._spindle = cut, drives, spindle
        self._kinematics = kinematics_of(machine)
        self._counts = tuple(axis.counts_per_unit for axis in machine.axes)
        assert machine.spindle is not None
        self._per_rev = abs(machine.spindle.counts_per_rev)
        self._at: tuple[Vector, float] | None = None  # tip and time, when the motors were looked at last
        self.torque_nm = 0.0

    def watch(self, now_s: float) -> None:
        joints = [drive.motor_counts / per for drive, per in zip(self._drives, self._counts, strict=True)]
        tip = self._kinematics.forward(joints, self._cut.length_mm).tip
        before, self._at = self._at, (tip, now_s)
        if before is None or now_s <= before[1]:
            return
        speed = float(norm(subtract(tip, before[0]))) / (now_s - before[1])
        rev_s = self._spindle.motor_counts_s / self._per_rev
        self.torque_nm = self._cut.torque_nm(tip, speed, rev_s)
        motor = self._spindle.axis.servo
        if isinstance(motor, SpindleMotor):
            rated = 1000.0 * self._spindle.axis.parameters.torque_counts_s2
            motor.cutting = rated * self.torque_nm / self._cut.rated_nm
