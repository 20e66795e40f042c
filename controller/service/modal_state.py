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
from controller.service.jobs import Job


class ModalState:
    """What is in force; replaced as a whole, so that any thread may read it."""

    def __init__(self, machine: Machine) -> None:
        """As at power-on."""
        self._left = modal.begun(machine)
        self._parameters = self._left.parameters  # of lines by hand, which alone find them
        self._measured = self._length(machine)

    def see(self, state: State) -> None:
        """A program has come to a block that runs in that state."""
        self._left = state

    def end(self, job: Job, result: str, machine: Machine) -> None:
        """What the end of a run leaves in force."""
        left = job.news.left or self._left
        if job.is_own and job.state_before is not None:
            self._left = job.state_before
            return
        if result != "completed":
            self._left = carried.after_stop(self._left, machine)
        elif job.is_mdi:
            self._left, self._parameters = carried.after_line(left, machine), left.parameters
        else:
            self._left = carried.after_program(left, machine)
        self._measured = self._length(machine)

    def _length(self, machine: Machine) -> tuple[int, float | None]:
        """Number of the tool whose length is in force (0: none's), and its length in the table."""
        number = self._left.length_tool
        found = self._left.named(number, machine) if number else None
        return number, None if found is None else found.length_mm

    def reset(self, machine: Machine) -> None:
        """The operator has reset the control."""
        if machine.dialect == "fanuc":
            self._left = carried.cleared(self._left, machine)

    @property
    def left(self) -> State:
        """As the last block has left it."""
        return self._left

    def at(self, now: Snapshot, machine: Machine, tool: int) -> State:
        """With the offsets and tools that ``machine`` has now; ``tool``: in the spindle, 0 = not known,
        or, where there is a changer, none.

        A length that has been touched off since is in force; one that a line has written to the table
        (G10 L1) is from the next G43 on, as in a program.
        """
        origins = self._left.origins
        if origins.plane is None:  # the operator may have set or cleared a shift of G92
            origins = replace(origins, shift=machine.shift, suspended=machine.suspended)
        left = self._left.with_origins(origins, machine)
        turning = (now.spindle_rev_min > 0.0) - (now.spindle_rev_min < 0.0)
        speed = left.speed_rev_min
        if turning != left.turning or (turning and not left.modal.spindle_rev_min):
            speed = abs(now.spindle_rev_min) / (now.spindle_override or 1.0) if turning else speed
        number, length_mm = self._length(machine)
        if length_mm is None or (number, length_mm) == self._measured:
            length_mm = left.modal.length_mm
        now_modal = replace(
            left.modal,
            tool=tool if machine.changer is not None else tool or left.modal.tool,
            length_mm=length_mm,
            spindle_rev_min=turning * speed,
            coolant=now.coolant,
        )
        return left._replace(modal=now_modal, turning=turning, speed_rev_min=speed)

    def begin_of(self, job: Job, now: Snapshot, machine: Machine, tool: int) -> State | None:
        """The modal state in which a job begins; None: that of power-on."""
        if job.entry is not None:
            return job.program.begin  # as the run that was interrupted
        keeps = not job.is_own if job.is_mdi else machine.start_state == "keep"
        if not keeps:
            return None
        left = carried.after_line(self.at(now, machine, tool), machine)
        if job.is_mdi:
            return left._replace(parameters=self._parameters)
        return left._replace(parameters=(), begun=None)
