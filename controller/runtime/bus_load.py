"""What a machine's nodes put on its buses, and whether a tick has room for it."""

from __future__ import annotations

from typing import Any

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import Message, several
from drives.load import budget
from drives.load.budget import BusBudget


def budgets(machine: Machine) -> list[BusBudget]:
    """What each bus of a machine carries, in the file's order. Raises ConfigError."""
    return budget.of(**_plan(machine))


def overload(machine: Machine) -> Message | None:
    """A text for each bus that its tick does not fit on, with what would fit; None if all fit."""
    found = budget.advice(**_plan(machine), max_share=machine.max_bus_share)
    return several(*(Message(key=one["key"], values=one["values"]) for one in found)) if found else None


def _plan(machine: Machine) -> dict[str, Any]:
    return {
        "nodes": machine_file.node_settings(machine),
        "buses": machine_file.bus_settings(machine),
        "master": machine_file.master_settings(machine),
        "spindle": machine_file.spindle_settings(machine),
        "io": machine_file.io_settings(machine),
    }
