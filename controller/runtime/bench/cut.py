"""A cut that loads the simulated spindle: the torque of the chip, where the tool is in the stock.

    P = k_c A v_f       k_c: specific cutting force, A: section of the chip across the feed,
    M = P / (2 pi n)    v_f: speed of the tip in the part, n: speed of the spindle

as text-books have the power of milling (k_c the same at every chip thickness). Of a simulation file, beside
what a probe can touch:

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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from controller.geometry.vectors import Frame, Vector, norm, subtract
from controller.machine.kinematics import kinematics_of
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Machine
from controller.machine.toml_table import Table

if TYPE_CHECKING:
    from drives.bench.simulated.drive import SimulatedDrive

AHEAD_S = 1e-3  # so far the motors' speeds are followed to find that of the tip


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

    def power_w(self, tip: Vector, speed_mm_s: float) -> float:
        """At a tip in the table's frame; 0 outside of the stock."""
        place = self.frame.from_parent(tip)
        found = next((one.section_mm2 for one in self.stock if one.has(place)), 0.0)
        return self.force_n_mm2 * found * speed_mm_s * 1e-3


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
        self, cut: Cut, machine: Machine, drives: Sequence[SimulatedDrive], feel: Callable[[float], None]
    ) -> None:
        """``drives`` in the order of the axes. ``feel`` takes rated torques times rev/s."""
        self._cut, self._drives, self._feel = cut, drives, feel
        self._kinematics = kinematics_of(machine)
        self._counts = tuple(axis.counts_per_unit for axis in machine.axes)
        self._from_motors = Slides(machine.axes).real

    def watch(self, _now_s: float) -> None:
        tip = self._tip(0.0)
        speed = float(norm(subtract(self._tip(AHEAD_S), tip))) / AHEAD_S
        self._feel(self._cut.power_w(tip, speed) / (2.0 * math.pi * self._cut.rated_nm))

    def _tip(self, ahead_s: float) -> Vector:
        """Where it comes to as fast as the motors turn now."""
        motors = [
            (drive.motor_counts + ahead_s * drive.motor_counts_s) * drive.units_per_count / per
            for drive, per in zip(self._drives, self._counts, strict=True)
        ]
        joints = self._from_motors(motors)
        return self._kinematics.forward(joints, self._cut.length_mm).tip
