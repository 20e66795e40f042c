"""What the data sheets of a machine's drives say against it, before anybody is on the bus."""

from __future__ import annotations

from controller.machine import machine_file
from controller.machine.model import Machine
from drives import commission


def look(machine: Machine) -> tuple[list[str], list[str]]:
    """What commissioning would refuse, and what it would warn of, drive by drive. Raises ConfigError."""
    master = machine_file.master_settings(machine)
    rates = {bus.name: bus.bit_rate for bus in machine.buses}
    problems: list[str] = []
    warnings: list[str] = []
    for node in machine_file.all_settings(machine):
        against, warned = commission.on_paper(node, master, rates[node.bus])
        problems += against
        warnings += warned
    return problems, warnings


def refusal(machine: Machine) -> str:
    """The problems as sentences, a line each; "" where there are none. Raises ConfigError."""
    return "\n".join(f"{problem}." for problem in look(machine)[0])
