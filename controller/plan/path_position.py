"""Where on the path the tick is, out of a snapshot and what it was sent."""

from __future__ import annotations

from collections.abc import Sequence

from controller.geometry.vectors import ROUNDING
from controller.ipc.handoff import Snapshot
from controller.plan.look_ahead import Place, Sent
from controller.plan.path.path import Pause
from controller.plan.track import Track


def place_at(track: Track, queue: Sequence[Sent], after: Place, epoch: int, now: Snapshot) -> Place | None:
    """The place of the path at which the tick is, or stands; None where it is on none.

    ``queue``: what was sent for ``epoch``, and ``after`` it. A pause is begun again, also where
    it has just ended: whether its mark was passed cannot be told, and to set twice is no harm.
    """
    number = track.number_of(now.motion_id) if now.motion_id >= 0 else None
    if now.epoch != epoch or (number is not None and not now.at_rest):
        return None if number is None else Place(number, now.s)
    for sent in queue:
        unit = track.at(sent.first)
        pauses = unit is not None and isinstance(unit.what, Pause) and unit.line == now.line
        past_s = now.plan_time_s - sent.end_s
        if past_s < -ROUNDING or (pauses and past_s < ROUNDING):
            return sent.place_at(now.plan_time_s)
    return after if track.at(after.unit) is not None else None
