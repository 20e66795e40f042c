"""The one modal state of the machine, between its lines, programs and operators.

A line typed by hand begins with it and leaves it changed, a program as ``start_state`` of the machine file
says. What turns and flows is the tick's to say, which tool is in the spindle the service's.
"""

from __future__ import annotations

from dataclasses import replace

from controller.ipc.handoff import Snapshot
from controller.machine.model import Machine
from controller.program import carried, modal
from controller.program.modal import State


class ModalState:
    """What is in force; replaced as a whole, so that any thread may read it."""

    def __init__(self, machine: Machine) -> None:
        """As at power-on."""
        self._left = modal.begun(machine)

    def see(self, state: State) -> None:
        """A program has come to a block that runs in that state."""
        self._left = state

    def end_line(self, state: State | None, machine: Machine) -> None:
        """A line by hand is done; None: it left nothing new."""
        self._left = carried.after_line(state or self._left, machine)

    def end_program(self, state: State | None, machine: Machine) -> None:
        """A program has come to its end."""
        self._left = carried.after_program(state or self._left, machine)

    def stop(self, machine: Machine) -> None:
        """What ran was stopped, or ended by a fault, where it was."""
        self._left = carried.after_stop(self._left, machine)

    def reset(self, machine: Machine) -> None:
        """The operator has reset the control."""
        if machine.dialect == "fanuc":
            self._left = carried.cleared(self._left, machine)

    def restore(self, state: State) -> None:
        """Lines of the control's own have run: it is as it was before them."""
        self._left = state

    @property
    def left(self) -> State:
        """As the last block has left it."""
        return self._left

    def at(self, now: Snapshot, machine: Machine, tool: int) -> State:
        """With the offsets and tools that ``machine`` has now; ``tool``: in the spindle, 0 = not known."""
        origins = self._left.origins
        if origins.plane is None:  # the operator may have set or cleared a shift of G92
            origins = replace(origins, shift=machine.shift, suspended=machine.suspended)
        left = self._left.with_origins(origins, machine)
        turning = (now.spindle_rev_min > 0.0) - (now.spindle_rev_min < 0.0)
        speed = left.speed_rev_min
        if turning != left.turning or (turning and not left.modal.spindle_rev_min):
            speed = abs(now.spindle_rev_min) / (now.spindle_override or 1.0) if turning else speed
        found = machine.tool(left.length_tool) if left.length_tool else None
        now_modal = replace(
            left.modal,
            tool=tool or left.modal.tool,
            length_mm=left.modal.length_mm if found is None else found.length_mm,
            spindle_rev_min=turning * speed,
            coolant=now.coolant,
        )
        return left._replace(modal=now_modal, turning=turning, speed_rev_min=speed)
