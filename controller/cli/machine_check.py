"""``directrix check`` of a machine: its drives by their data sheets, and its buses."""

from __future__ import annotations

from controller.machine.model import Machine
from controller.runtime.bus_load import overload
from controller.verify.console import Refused, answered, in_words, say, show, tell


def sheets(machine: Machine, quiet: bool) -> list[str]:
    """What the drives' data sheets warn of. Raises ConfigError, Refused as commissioning would."""
    from controller.runtime import drive_sheets

    problems, warned = drive_sheets.look(machine)
    if problems:
        whole = "\n".join(say("sentence", text=problem) for problem in problems)
        raise Refused(whole, sheets=[in_words(problem) for problem in problems])
    if not quiet:
        for warning in warned:
            tell.print(say("sentence", text=warning))
    return [in_words(warning) for warning in warned]


def warnings(machine: Machine) -> list[str]:
    """What its file says and hardly any machine has: it is asked whether that is meant."""
    from controller.machine import plausible

    return [say("machine.doubt", doubt=doubt) for doubt in plausible.doubts(machine)]


def alone(machine: Machine, warned: list[str], as_json: bool) -> None:
    """The rest of it where no program is named; ``warned`` by the sheets. Raises Refused."""
    if why := overload(machine):
        raise Refused(in_words(why))
    told = warnings(machine)
    if answered(as_json, machine=machine.name, sheets=warned, warnings=told):
        return
    for sentence in told:
        tell.print(sentence)
    show.print(say("machine.sound", machine=machine.name))
