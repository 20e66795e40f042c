"""What the data sheets of a machine's drives say against it, before anybody is on the bus."""

from __future__ import annotations

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import Message, message
from drives import commission


def look(machine: Machine) -> tuple[list[Message], list[Message]]:
    """What commissioning would refuse, and what it would warn of, drive by drive. Raises ConfigError."""
    master = machine_file.master_settings(machine)
    rates = {bus.name: bus.bit_rate for bus in machine.buses}
    problems: list[Message] = []
    warnings: list[Message] = []
    for node in machine_file.all_settings(machine):
        against, warned = commission.on_paper(node, master, rates[node.bus])
        problems += against
        warnings += warned
    return problems, warnings


def refusal(machine: Machine) -> list[Message]:
    """The problems as sentences; none where there are none. Raises ConfigError."""
    return [message("sentence", text=problem) for problem in look(machine)[0]]
