"""Limit switches on the inputs of the I/O node: an axis that goes on into one that is pressed has a fault.

Away from it an axis may go at any time. Where the path leads, also to a stop for another fault, its command
says which way it goes; a drive that homes by itself is seen by its position, and may give ``GIVE`` meanwhile.
An input reads 1 where the switch is free, so a broken wire is a switch that is pressed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from controller.geometry.vectors import ROUNDING
from controller.machine.kinematics.slides import Slides
from controller.machine.model import Axis, Machine
from controller.state.modes import Fault, Mode
from controller.tick.mode import Modes

GIVE = 0.1  # mm or degrees
_HOMING: Final = Mode.HOMING


class LimitSwitches:
    """Of all axes. Read ``present``: there are any."""

    def __init__(self, machine: Machine) -> None:
        self._ends = [
            end for i, axis in enumerate(machine.axes) for end in _ends(machine, i, axis, machine.period_s)
        ]
        self.present = bool(self._ends)
        self._slides = Slides(machine.axes)

    def watch(
        self,
        inputs: int,
        modes: Modes,
        new: Sequence[float],
        last: Sequence[float],
        actual: Sequence[float],
        ticks: int,
    ) -> None:
        """``inputs``: 1 = free; ``new``, ``last``: the joints of the last two ticks; ``actual``: mm, rad."""
        homes, on_path, slides = modes.mode is _HOMING, modes.on_path, self._slides
        if not slides.are_square:  # a switch is on a slide, which moves for the others, too
            new, last, actual = slides.sent(new), slides.sent(last), slides.sent(actual)
        for end in self._ends:
            i = end.index
            given = end.follow(bool(inputs & end.bit), actual[i], ticks)
            into = end.sense * (new[i] - last[i]) > ROUNDING if on_path else homes and given
            if into and not inputs & end.bit:
                modes.fail(Fault.LIMIT_SWITCH, i)


class End:
    """One switch. Read: ``index`` (of its axis), ``bit`` (of the inputs), ``sense`` (1: above)."""

    def __init__(self, index: int, bit: int, sense: float, give: float, most: float) -> None:
        """``give``, and ``most`` that the axis moves between two positions: mm or rad."""
        self.index, self.bit, self.sense = index, bit, sense
        self._give, self._most = give, most
        self._at, self._gone = math.nan, 0.0

    def follow(self, free: bool, actual: float, ticks: int) -> bool:
        """Whether the axis has gone on into it by more than it may; a new zero is no motion."""
        step = self.sense * (actual - self._at)
        self._at = actual
        if free:
            self._gone = 0.0
        elif abs(step) <= self._most * ticks:
            self._gone = max(0.0, self._gone + step)
        return self._gone > self._give


def _ends(machine: Machine, index: int, axis: Axis, period_s: float) -> list[End]:
    """The switches of an axis; the senses of a rotary are those in which it is shown."""
    if axis.limit_inputs is None or machine.io is None:
        return []
    per = axis.shown_per_unit
    give, most = GIVE / abs(per), 2.0 * axis.limits.velocity * period_s * axis.feedback_every
    senses = ((axis.limit_inputs.lower, -1.0), (axis.limit_inputs.upper, 1.0))
    rows = [(machine.io.input(name), math.copysign(sense, sense * per)) for name, sense in senses if name]
    return [End(index, 1 << bit, sense, give, most) for bit, sense in rows if bit is not None]
