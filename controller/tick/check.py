"""The last look at a setpoint before it is sent: travel, velocity, acceleration.

The plan has audited the whole path; what is caught here is an error of ours. It is
caught before the wire, and the answer is a value.
"""

from __future__ import annotations

import math
from typing import Final

from controller.machine.model import Joints, Machine
from controller.state.modes import Fault

TOLERANCE = 1.001  # of velocity and acceleration
TRAVEL_SLACK = 1e-6  # mm or rad

_FINE: Final = (Fault.NONE, -1)


class Check:
    """Judges the joints of one tick by those of the two before."""

    def __init__(self, machine: Machine, anywhere: int = 0) -> None:
        """``anywhere``: bit mask of axes whose travel is not known yet (not homed)."""
        T = machine.period_s
        self._rows = tuple(
            (
                i,
                -math.inf if anywhere >> i & 1 else axis.travel_min - TRAVEL_SLACK,
                math.inf if anywhere >> i & 1 else axis.travel_max + TRAVEL_SLACK,
                axis.limits.velocity * T * TOLERANCE,
                axis.limits.acceleration * T * T * TOLERANCE,
            )
            for i, axis in enumerate(machine.axes)
        )
        self._stands: Joints | None = None  # and it was found that they may

    def judge(self, new: Joints, last: Joints, before: Joints) -> tuple[Fault, int]:
        """(fault, axis index): what is wrong with ``new``, or (NONE, -1). NaN is wrong, too."""
        if new is last is before is self._stands:
            return _FINE
        for i, low, high, velocity, acceleration in self._rows:
            q0, q1 = new[i], last[i]
            # An axis switched on outside of its travel may stand there and come back.
            if not low <= q0 <= high and not min(low, q1) <= q0 <= max(high, q1):
                return Fault.TRAVEL, i
            step = q0 - q1
            if not -velocity <= step <= velocity:
                return Fault.VELOCITY, i
            bend = step - q1 + before[i]
            if not -acceleration <= bend <= acceleration:
                return Fault.ACCELERATION, i
        self._stands = new if new is last is before else None
        return _FINE

    def stops_within(self, new: Joints, last: Joints) -> float:
        """Ticks in which every axis could be at rest from the speed of this step."""
        return max([abs(new[i] - last[i]) / acceleration for i, _, _, _, acceleration in self._rows])
