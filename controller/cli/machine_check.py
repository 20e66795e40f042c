"""``directrix check`` of a machine: its drives by their data sheets, and its buses."""

from __future__ import annotations

import json

from controller import messages
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.runtime.bus_load import overload
from controller.verify.console import Refused, say, show, spoken, tell


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


def warnings(machine: Machine) -> list[str]:
    """What works but not well, in words."""
    return [messages.text(one, spoken.get()) for one in machine_file.warnings(machine)]


def alone(machine: Machine, warned: list[str], as_json: bool) -> None:
    """The rest of it where no program is named; ``warned`` by the sheets. Raises Refused."""
    if sentence := overload(machine):
        raise Refused(sentence)
    told = warnings(machine)
    if as_json:
        print(json.dumps({"ok": True, "machine": machine.name, "sheets": warned, "warnings": told}))
        return
    for sentence in told:
        tell.print(sentence, markup=False)
    show.print(say("machine.sound", machine=machine.name), markup=False)
