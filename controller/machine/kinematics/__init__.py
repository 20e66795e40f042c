"""Joints from a pose and a pose from joints: one protocol, and who keeps it for which build of machine.

A machine of another build is a class that keeps ``Kinematics``, its row here and in ``machine.BUILDS``, and
a machine file that says ``kinematics = ...``.
"""

from __future__ import annotations

from controller.machine.kinematics.no_rotary import NoRotary
from controller.machine.kinematics.one_rotary import OneRotary
from controller.machine.kinematics.protocol import Kinematics, Pair
from controller.machine.kinematics.two_rotaries import NEAR_POLE, TwoRotaries
from controller.machine.model import Machine

__all__ = ["NEAR_POLE", "Kinematics", "Pair", "kinematics_of"]

IMPLEMENTATIONS: dict[str, type[Kinematics]] = {  # by ``machine.BUILDS``
    "two_rotaries": TwoRotaries,
    "one_rotary": OneRotary,
    "no_rotary": NoRotary,
}


def kinematics_of(machine: Machine) -> Kinematics:
    """The kinematics of a machine. Raises ValueError for axes that its build cannot have."""
    return IMPLEMENTATIONS[machine.kinematics](machine)
