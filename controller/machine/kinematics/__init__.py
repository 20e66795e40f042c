"""Joints from a pose and a pose from joints: one protocol, and who keeps it for which build of machine.

A machine of another build is a module of this room with a class that keeps ``Kinematics``, and a machine file
whose ``kinematics`` is the module's name.
"""

from __future__ import annotations

import functools
import pkgutil
from importlib import import_module

from controller.machine.kinematics.protocol import Kinematics, Pair
from controller.machine.kinematics.two_rotaries import NEAR_POLE
from controller.machine.model import Machine

__all__ = ["NEAR_POLE", "Kinematics", "Pair", "builds", "kinematics_of"]


@functools.cache
def builds() -> dict[str, type[Kinematics]]:
    """The builds by what machine files call them: those with the most axes first."""
    names = [module.name for module in pkgutil.iter_modules(__path__)]
    members = [(name, vars(import_module(f"{__name__}.{name}")).values()) for name in names]
    found = [(name, kind) for name, values in members for kind in values if _is_build(kind, name)]
    return dict(sorted(found, key=lambda row: -row[1].turning))


def _is_build(value: object, module: str) -> bool:
    is_kinematics = isinstance(value, type) and value is not Kinematics and Kinematics in value.__mro__
    return is_kinematics and value.__module__ == f"{__name__}.{module}"


def kinematics_of(machine: Machine) -> Kinematics:
    """The kinematics of a machine. Raises ValueError for axes that its build cannot have."""
    return builds()[machine.kinematics](machine)
