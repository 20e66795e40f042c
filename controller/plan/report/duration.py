"""How long a path takes at the least; one that takes too long is refused.

At its feeds, at the axes' largest speeds and with its dwells; what it takes to speed up and slow down comes
on top. So nothing has to be planned for it. What it waits for beside its motion does not count here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from controller.machine.model import MAX_PROGRAM_H, Machine
from controller.messages import Key, message
from controller.plan.segment import PathItem, Pause, Segment
from controller.program.program import Place, ProgramError

HOUR_S = 3600.0


def _parts(item: PathItem, machine: Machine) -> list[tuple[Place, float]]:
    if isinstance(item, Pause):
        return [(item.place, item.seconds)]
    return [(segment.place, _least_s(segment, machine)) for segment in item.segments]


def _least_s(segment: Segment, machine: Machine) -> float:
    share = machine.rapid_share if segment.feed_mm_s is None else 1.0
    ways = zip(segment.start, segment.end, machine.axes, strict=True)
    turned_s = max(abs(b - a) / (axis.limits.velocity * share) for a, b, axis in ways)
    if segment.feed_mm_s is None:
        return turned_s
    if (feed := segment.even_feed) is not None:
        return max(turned_s, segment.motion.end / feed)
    starts = np.array([0.0, *(s for s, _ in segment.feed_steps if 0.0 < s < segment.motion.end)])
    lengths = np.diff(starts, append=segment.motion.end)
    return max(turned_s, float((lengths / segment.feed_at(starts)).sum()))


def bounded(items: Iterable[PathItem], machine: Machine, name: str, whole: bool = True) -> Iterator[PathItem]:
    """The same path; raises ProgramError where it takes longer than ``machine.longest_program_h``.

    ``whole``: the rest of it is read before, so that its whole time can be told.
    """
    total_s, passed = 0.0, None
    for item in items:
        for place, seconds in _parts(item, machine):
            total_s += seconds
            if passed is None and total_s > machine.longest_program_h * HOUR_S:
                passed = place
        if passed is None:
            yield item
        elif not whole:
            break
    if passed is not None:
        raise _refusal(total_s / HOUR_S, passed, machine, name, whole)


def _refusal(hours: float, place: Place, machine: Machine, name: str, whole: bool) -> ProgramError:
    allowed = machine.longest_program_h
    what = Key("path.whole_takes" if whole else "path.so_far_takes")
    more = message("path.allow_longer", most=MAX_PROGRAM_H) if hours <= MAX_PROGRAM_H else ""
    why = message("path.too_long", what=what, hours=hours, allowed=allowed, more=more)
    return place.refusal(name, why)
