"""Tools are changed by hand: M6 with another tool than the one in the spindle is a program stop.

The operator puts the tool in and lets the program go on. What is in the spindle at a start is known, or
is not (0): then the program stops before it moves with any. A program that names no tool means T1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from controller.machine.model import Machine
from controller.messages import Key, Message, message
from controller.plan.segment import Note, PathItem, Pause
from controller.program import modal
from controller.program.program import Act, Modal, ProgramError


def stopped(
    items: Iterable[PathItem],
    machine: Machine,
    in_spindle: int,
    before: Modal | None = None,
    typed: bool = False,
    note: Callable[[Note], None] = lambda _: None,
    name: str = "",
) -> Iterator[PathItem]:
    """The path with a stop behind every change to another tool than the one that is there.

    Where that one must not turn, or not so fast, it is changed before the spindle does; a line by hand
    that names no tool is refused (ProgramError, with the ``name`` of the program).

    ``before``: the state in which the path begins; None: that of a whole program. ``typed`` by hand:
    until it names a tool it means the one that is there. ``note`` is told of every stop.
    A machine with a changer stops nowhere for this.
    """
    if machine.changer is not None:  # its steps stand in the path itself
        yield from items
        return
    state, is_open = before or modal.power_on().modal, 0
    asks = not typed
    for item in items:
        why = _turning_refusal(item, machine, in_spindle) if isinstance(item, Pause) else None
        if isinstance(item, Pause) and why is not None and not asks:
            raise ProgramError(name, item.place.line, item.place.column, why)
        if isinstance(item, Pause) and why is None:
            yield item
            state, is_open = item.modal, item.open_clamps
            asks = asks or item.act is Act.TOOL
            if item.act is not Act.TOOL or state.tool == in_spindle:
                continue
            place = item.place
        else:
            if why is None and (state.tool == in_spindle or not asks):
                yield item
                continue
            place = item.place
            yield Pause(place, state, act=Act.TOOL, open_clamps=is_open)
        note(Note(place, message("note.stops_for", tool=_named(state.tool, machine))))
        yield Pause(place, state, act=Act.STOP, open_clamps=is_open)
        in_spindle = state.tool
        if isinstance(item, Pause) and why is None:
            continue
        yield item
        if isinstance(item, Pause):
            state, is_open = item.modal, item.open_clamps


def _turning_refusal(pause: Pause, machine: Machine, in_spindle: int) -> Message | None:
    """Why the spindle must not turn as it does from here on with the tool that is there; None: it may."""
    rev_min = pause.modal.spindle_rev_min
    if not rev_min:
        return None
    return modal.turning_refusal(machine, in_spindle, 1 if rev_min > 0.0 else -1, abs(rev_min))


def _named(number: int, machine: Machine) -> str:
    if number == 0:
        return Key("note.no_tool")
    tool = machine.tool(number)
    return f"T{number} ({tool.name})" if tool is not None and tool.name else f"T{number}"
