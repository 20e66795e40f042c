"""What spindle, clamps and tool changes may take beside the path: the controller waits for them at rest.

How long they take nobody knows ahead, so it is no part of a program's duration. Of spindle and clamps
there is a bound: what takes longer than the machine file allows is a fault. For a change by hand it
counts on what the machine file says.
"""

from __future__ import annotations

from controller.machine.model import Machine
from controller.plan.stretch import Pause
from controller.program.program import Act, Place


class Waits:
    """Sums up the pauses of a path in their order; everything is off and clamped before it."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._rev_min, self._open = 0.0, 0
        self._change: Place | None = None  # of the last M6
        self.seconds = 0.0  # at most

    def take(self, pause: Pause) -> None:
        """The next pause of the path."""
        self.seconds += max(self._spindle_s(pause), self._clamps_s(pause), self._change_s(pause))
        if pause.act is Act.TOOL:
            self._change = pause.place
        self._rev_min, self._open = pause.modal.spindle_rev_min, pause.open_clamps

    def _spindle_s(self, pause: Pause) -> float:
        spindle = self._machine.spindle
        if spindle is None or not spindle.is_driven or pause.modal.spindle_rev_min == self._rev_min:
            return 0.0
        return spindle.spin_up_s

    def _change_s(self, pause: Pause) -> float:
        """A stop that stands where the tool is changed is for the change."""
        return self._machine.tool_change_s if pause.act is Act.STOP and pause.place == self._change else 0.0

    def _clamps_s(self, pause: Pause) -> float:
        """They move side by side."""
        changed = pause.open_clamps ^ self._open
        axes = enumerate(self._machine.axes)
        return max((axis.clamp.open_s for i, axis in axes if axis.clamp and changed >> i & 1), default=0.0)
