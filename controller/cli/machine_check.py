"""``directrix check`` of a machine: its drives by their data sheets, and its buses."""

from __future__ import annotations

import json

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.runtime.bus_load import overload
from controller.verify.console import Refused, show, tell


def sheets(machine: Machine, quiet: bool) -> list[str]:
    """What the drives' data sheets warn of. Raises ConfigError, Refused as commissioning would."""
    from controller.runtime import drive_sheets

    problems, warned = drive_sheets.look(machine)
    if problems:
        raise Refused("\n".join(f"{problem}." for problem in problems), sheets=problems)
    if not quiet:
        for sentence in warned:
            tell.print(f"{sentence}.", markup=False)
    return warned


def alone(machine: Machine, warned: list[str], as_json: bool) -> None:
    """The rest of it where no program is named; ``warned`` by the sheets. Raises Refused."""
    if sentence := overload(machine):
        raise Refused(sentence)
    warnings = machine_file.warnings(machine)
    if as_json:
        print(json.dumps({"ok": True, "machine": machine.name, "sheets": warned, "warnings": warnings}))
        return
    for sentence in warnings:
        tell.print(sentence, markup=False)
    title = f"{machine.name}: the drives' data sheets have all that it needs, and its buses carry it."
    show.print(title, markup=False)
