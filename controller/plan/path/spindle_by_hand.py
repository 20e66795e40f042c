"""A spindle that the operator switches: where the program turns it otherwise, it stops until he has done so.

    M3 --> S8000 --> [stop: M3, 8000 1/min] --> G1 ...      one stop for all that comes before the next motion

A stop of the program that comes first, such as M0 or a change of the tool by hand, is that stop. Before the
program's end nothing is asked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from controller.machine.model import Machine
from controller.messages import Message, message
from controller.plan.segment import Note, PathItem, Pause
from controller.program.program import Act

_BEFORE = (Act.SPINDLE, Act.COOLANT, Act.OUTPUT, Act.TOOL, Act.END)  # for these nothing has to turn yet


def instruction(rev_min: float) -> Message:
    """What the operator is to do, at a signed speed, 0: it is to stand."""
    if rev_min == 0.0:
        return message("spindle_change.off")
    return message("spindle_change.right" if rev_min > 0.0 else "spindle_change.left", rev_min=abs(rev_min))


def stopped(
    items: Iterable[PathItem],
    machine: Machine,
    rev_min: float = 0.0,
    typed: bool = False,
    note: Callable[[Note], None] = lambda _: None,
) -> Iterator[PathItem]:
    """The path with the stops at which the operator switches the spindle; ``note`` gets one of each.

    ``rev_min``: as it turns before. ``typed``: a line by hand, at whose end he is asked, too. A spindle that
    the controller turns, and one that is not there, needs none.
    """
    if machine.spindle is None or machine.spindle.by != "hand":
        yield from items
        return
    last: Pause | None = None  # that has said how the spindle is to turn
    is_open = 0
    for item in items:
        if last is not None and not (isinstance(item, Pause) and item.act in _BEFORE):
            rev_min = last.modal.spindle_rev_min
            note(Note(last.place, message("note.stops_for_spindle", what=instruction(rev_min))))
            if isinstance(item, Pause) and item.act is Act.STOP and item.changing is None:
                item = replace(item, turns=True)
            else:
                yield _stop(last, is_open)
            last = None
        if isinstance(item, Pause):
            is_open = item.open_clamps
            if item.modal.spindle_rev_min == rev_min:
                last = None
            elif last is None or item.modal.spindle_rev_min != last.modal.spindle_rev_min:
                last = item
        yield item
    if last is not None and typed:
        yield _stop(last, is_open)


def _stop(last: Pause, is_open: int) -> Pause:
    return Pause(last.place, last.modal, act=Act.STOP, open_clamps=is_open, turns=True)
