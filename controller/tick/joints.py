"""Joints to drive counts and back: the last step before the wire."""

from __future__ import annotations

from collections.abc import Sequence

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
        a, b, c, d, e = self._counts_per_unit
        counts = (
            round(joints[0] * a),
            round(joints[1] * b),
            round(joints[2] * c),
            round(joints[3] * d),
            round(joints[4] * e),
        )
        if min(counts) < -INT32 or max(counts) >= INT32:
            return False
        self.setpoints[:] = counts
        return True

    def to_units(self, i: int, counts: int) -> float:
        """Counts of one axis in mm or rad."""
        return counts * self._units_per_count[i]

    def decode(self, positions: Sequence[int]) -> None:
        """Takes the drives' positions (counts)."""
        actual, units = self.actual, self._units_per_count
        actual[0] = positions[0] * units[0]
        actual[1] = positions[1] * units[1]
        actual[2] = positions[2] * units[2]
        actual[3] = positions[3] * units[3]
        actual[4] = positions[4] * units[4]
