"""Tools are changed by hand: M6 with another tool than the one in the spindle is a program stop.

The operator puts the tool in and lets the program go on. What is in the spindle at a start is known, or
is not (0): then the program stops before it moves with any. A program that names no tool means T1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from controller.machine import Machine
from controller.plan.route.stretch import Chain, Note, Pause
from controller.plan.text import modal
from controller.plan.text.program import Act, Modal

AT_POWER_ON = modal.power_on().modal.tool


def stopped(
    items: Iterable[Chain | Pause],
    machine: Machine,
    in_spindle: int,
    before: Modal | None = None,
    note: Callable[[Note], None] = lambda _: None,
) -> Iterator[Chain | Pause]:
    """The path with a stop behind every change to another tool than the one that is there.

    ``before``: the state in which the path begins; None: that of a whole program. ``note`` is told
    of every stop.
    """
    state = before or modal.power_on().modal
    for item in items:
        wanted = item.modal if isinstance(item, Pause) else state
        stops = wanted.tool != in_spindle
        if isinstance(item, Pause):
            yield item
            state, stops = wanted, stops and item.act is Act.TOOL
        if stops:
            place = item.place if isinstance(item, Pause) else item.stretches[0].place
            note(Note(place, f"Stops until {_named(wanted.tool, machine)} is in the spindle."))
            if not isinstance(item, Pause):
                yield Pause(place, state, act=Act.TOOL)
            yield Pause(place, state, act=Act.STOP)
            in_spindle = wanted.tool
        if not isinstance(item, Pause):
            yield item


def _named(number: int, machine: Machine) -> str:
    tool = machine.tool(number)
    return f"T{number} ({tool.name})" if tool is not None and tool.name else f"T{number}"
