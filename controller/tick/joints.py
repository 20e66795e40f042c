"""Joints to drive counts and back: the last step before the wire."""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul

from controller.machine import Joints, Machine

INT32 = 1 << 31


class Encoder:
    """Keeps the counts of one tick in place: ``setpoints`` (int, as sent) and ``actual`` (mm, rad)."""

    def __init__(self, machine: Machine) -> None:
        self._counts_per_unit = tuple(axis.counts_per_unit for axis in machine.axes)
        self._units_per_count = tuple(1.0 / axis.counts_per_unit for axis in machine.axes)
        self.setpoints = [0] * len(machine.axes)
        self.actual = [0.0] * len(machine.axes)

    def encode(self, joints: Joints) -> bool:
        """Rounds to counts; False (and nothing changed) if one does not fit into an int32."""
        counts = tuple(map(round, map(mul, joints, self._counts_per_unit)))
        if min(counts) < -INT32 or max(counts) >= INT32:
            return False
        self.setpoints[:] = counts
        return True

    def to_units(self, i: int, counts: int) -> float:
        """Counts of one axis in mm or rad."""
        return counts * self._units_per_count[i]

    def decode(self, positions: Sequence[int]) -> None:
        """Takes the drives' positions (counts)."""
        self.actual[:] = map(mul, positions, self._units_per_count)
