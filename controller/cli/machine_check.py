"""``directrix check`` of a machine: its drives by their data sheets, and its buses."""

from __future__ import annotations

import json

from controller.machine.model import Axis, Machine
from controller.runtime.bus_load import overload
from controller.verify.console import Refused, in_words, say, show, tell

QUANTISATION_SHARE = 0.1  # of the jerk limit that rounding to counts may look like


def sheets(machine: Machine, quiet: bool) -> list[str]:
    """What the drives' data sheets warn of. Raises ConfigError, Refused as commissioning would."""
    from controller.runtime import drive_sheets

    problems, warned = drive_sheets.look(machine)
    if problems:
        whole = "\n".join(say("sentence", text=problem) for problem in problems)
        raise Refused(whole, sheets=[in_words(problem) for problem in problems])
    if not quiet:
        for warning in warned:
            tell.print(say("sentence", text=warning), markup=False)
    return [in_words(warning) for warning in warned]


def warnings(machine: Machine) -> list[str]:
    """What works but not well.

    A setpoint is rounded to counts, and the third difference of rounded values is
    wrong by up to (1 + 3 + 3 + 1) / 2 = 4 counts: the drive sees that as jerk.
    """
    return [told for axis in machine.axes if (told := _resolution(axis, machine.period_s))]


def _resolution(axis: Axis, period_s: float) -> str | None:
    shown, unit = abs(axis.shown_per_unit), "deg" if axis.is_rotary else "mm"
    noise = 4.0 / abs(axis.counts_per_unit) / period_s**3
    share = noise / axis.limits.jerk
    if share <= QUANTISATION_SHARE:
        return None
    needed = abs(axis.counts_per_unit) / shown * share / QUANTISATION_SHARE
    figures = {"ms": period_s * 1e3, "jerk": noise * shown, "share": share, "needed": needed}
    return say("machine.rounding", axis=axis.name, unit=unit, **figures)


def alone(machine: Machine, warned: list[str], as_json: bool) -> None:
    """The rest of it where no program is named; ``warned`` by the sheets. Raises Refused."""
    if why := overload(machine):
        raise Refused(in_words(why))
    told = warnings(machine)
    if as_json:
        print(json.dumps({"ok": True, "machine": machine.name, "sheets": warned, "warnings": told}))
        return
    for sentence in told:
        tell.print(sentence, markup=False)
    show.print(say("machine.sound", machine=machine.name), markup=False)
