"""A spindle that stands is told of: feed moves before it was ever started."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from controller.machine.model import Machine
from controller.messages import message
from controller.motion.motions import ThreadMove
from controller.plan.stretch import Chain, Note, Pause
from controller.program.program import Place


def noted(
    items: Iterable[Chain | Pause], machine: Machine, note: Callable[[Note], None]
) -> Iterator[Chain | Pause]:
    """The path as it is; ``note`` is told of the first feed move before the spindle ever turns.

    Surfaces are refused without it. Where no spindle is, and where the operator switches it as he likes,
    nothing is told.
    """
    waits = machine.spindle is not None and machine.spindle.is_driven
    for item in items:
        if waits and isinstance(item, Pause):
            waits = item.modal.spindle_rev_min == 0.0
        elif waits and (place := _fed(item)) is not None:
            note(Note(place, message("note.spindle_off")))
            waits = False
        yield item


def _fed(item: Chain | Pause) -> Place | None:
    """Where a chain first moves at a feed."""
    stretches = item.stretches if isinstance(item, Chain) else ()
    fed = (one for one in stretches if one.feed_mm_s is not None and not isinstance(one.motion, ThreadMove))
    return next((one.place for one in fed), None)
