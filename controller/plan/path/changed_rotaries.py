"""A tool changer that leaves a rotary elsewhere is told of: M6 names no axis, and the tool may stand askew.

The places are those of the changer's steps in the machine file (``move_deg`` of ``[changer]``); a change by
hand, or one whose steps name no rotary, leaves them where they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from controller.machine.model import Joints, Machine
from controller.messages import message
from controller.plan.rotaries.turns import SAME_ROTARY_RAD
from controller.plan.stretch import Chain, Note, Pause


def noted(
    items: Iterable[Chain | Pause], machine: Machine, start: Joints, note: Callable[[Note], None]
) -> Iterator[Chain | Pause]:
    """The path as it is; ``note`` is told of each change that ends with a rotary elsewhere."""
    before = now = start
    for item in items:
        if isinstance(item, Chain):
            now = item.stretches[-1].end
        elif item.changing is not None:
            before = now if item.changing.step == 0 else before
            if item.changing.last and (turned := _turned(machine, before, now)):
                key = "note.change_leaves_plane" if item.modal.tilted else "note.change_turns"
                note(Note(item.place, message(key, axes=", ".join(turned))))
        yield item


def _turned(machine: Machine, before: Joints, now: Joints) -> list[str]:
    """The rotaries that are elsewhere, each with its place before and after, in degrees as programmed."""
    found = []
    for i in machine.rotary():
        axis = machine.axes[i]
        if abs(now[i] - before[i]) > SAME_ROTARY_RAD:
            places = (f"{joints[i] * axis.shown_per_unit:.6g}" for joints in (before, now))
            found.append(f"{axis.name} {' -> '.join(places)}")
    return found
