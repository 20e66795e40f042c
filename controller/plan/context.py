"""What all parts of a trace work with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Machine
from controller.messages import Message
from controller.program.program import Place

Tell = Callable[[Place, Message], None]


@dataclass(frozen=True, slots=True)
class Context:
    """One machine, and how the parts of a trace refuse a block of a program or note something about it."""

    machine: Machine
    kinematics: Kinematics
    program: str  # its name
    tell: Tell

    @staticmethod
    def silent(machine: Machine, program: str = "", kinematics: Kinematics | None = None) -> Context:
        """A context whose notes nobody reads; refusals are raised."""
        return Context(machine, kinematics or kinematics_of(machine), program, lambda place, note: None)

    def refuse(self, place: Place, why: Message) -> NoReturn:
        """Raises ProgramError."""
        raise place.refusal(self.program, why)
