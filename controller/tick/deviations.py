"""What axes miss of where they are told to be: taken off before a setpoint is sent, put back on feedback.

A machine without tables has none of this. The sense of an axis changes where it has come back from its
farthest place by more than ``STILL_COUNTS``; from then on the reversal is put on along the ramp of
``compensation``, which a second reversal waits for. An axis that has not moved yet is half way between them.
"""

from __future__ import annotations

from collections.abc import Sequence

from controller.machine import compensation
from controller.machine.compensation import Deviation
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Joints, Machine

STILL_COUNTS = 2.0  # back from the farthest place: no reversal yet


class AxisDeviation:
    """Of one axis with a table: ``now`` is what was taken off its last setpoint."""

    def __init__(self, machine: Machine, index: int, table: Deviation) -> None:
        axis = machine.axes[index]
        assert axis.pitch is not None
        self.index = index
        self.now = 0.0
        self._at = table.at
        self._ramp = compensation.ramp(axis.pitch, axis.limits, machine.period_s)
        self.reversal_ticks = len(self._ramp)
        self._still = STILL_COUNTS / abs(axis.counts_per_unit)
        self._farthest: float | None = None
        self._up = 0.0  # the sense of its last motion
        self._from = self._to = self._sense = 0.0
        self._tick = len(self._ramp)  # of the ramp

    def go_on_as(self, other: AxisDeviation) -> None:
        """Takes over the sense and the ramp of another one."""
        self.now, self._farthest, self._up = other.now, other._farthest, other._up
        self._from, self._to, self._sense, self._tick = other._from, other._to, other._sense, other._tick

    def real(self, position: float) -> float:
        """Where the axis is where its drive says ``position``, near the last setpoint."""
        return position + self._at(position + self.now, self._sense)

    def step(self, q: float) -> float:
        """What its drive is told in this tick, so that the axis comes to ``q``."""
        farthest, up = self._farthest, self._up
        if farthest is None:
            self._farthest = q
        elif up == 0.0:
            if not -self._still < q - farthest < self._still:
                self._farthest, self._up = q, 1.0 if q > farthest else -1.0
        else:
            ahead = (q - farthest) * up
            if ahead > 0.0:
                self._farthest = q
            elif ahead < -self._still:
                self._farthest, self._up = q, -up
        if self._tick < len(self._ramp):
            self._sense = self._from + (self._to - self._from) * self._ramp[self._tick]
            self._tick += 1
        elif self._to != self._up:
            self._from, self._to, self._tick = self._sense, self._up, 0
        self.now = now = self._at(q, self._sense)
        return q - now


class Deviations:
    """Of all axes; ``found`` tells whether there are any."""

    def __init__(self, machine: Machine) -> None:
        rows = ((i, compensation.deviation(axis)) for i, axis in enumerate(machine.axes))
        self._axes = tuple(AxisDeviation(machine, i, table) for i, table in rows if table is not None)
        self._crossings = compensation.crossings(machine)
        self._slides = Slides(machine.axes)
        shift_mm = self._slides.shares(machine.thermal_shift_mm)
        self._shift = tuple(zip(machine.linear(), shift_mm, strict=True))
        self.found = bool(self._axes or self._crossings or any(shift_mm) or not self._slides.are_square)
        ticks = {axis.index: axis.reversal_ticks for axis in self._axes}
        self.reversal_ticks = tuple(ticks.get(i, 0) for i in range(len(machine.axes)))

    def go_on_as(self, other: Deviations) -> None:
        """What comes next follows what another one has sent last."""
        for mine, others in zip(self._axes, other._axes, strict=True):
            mine.go_on_as(others)

    def compensated(self, joints: Joints) -> Sequence[float]:
        """The joints to command, once per tick, so that the axes come to be at ``joints``."""
        slides = self._slides.sent(joints)
        drives = list(slides)
        for axis in self._axes:
            i = axis.index
            drives[i] = axis.step(slides[i])
        for along, moves, off in self._crossings:
            drives[moves] -= off.at(slides[along])
        for i, by in self._shift:
            drives[i] -= by
        return drives

    def real(self, positions: Sequence[float]) -> Sequence[float]:
        """Where the axes are where the drives say ``positions``: to a share of a count."""
        real = list(positions)
        for i, by in self._shift:
            real[i] += by
        shifted = tuple(real)
        for along, moves, off in self._crossings:
            real[moves] += off.at(shifted[along])
        for axis in self._axes:
            i = axis.index
            real[i] = axis.real(real[i])
        return self._slides.real(real)
