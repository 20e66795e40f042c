"""When a path stands, for what and for how long: what its time is made of beside its motion.

The path clock counts motion and dwells; it stands in the pauses of ``events``. So from any time of it on

    what is left = until its end + what is waited for on the way

Of a check a timetable counts from the start of the whole program at 100 %, of a run it is that of the rest at
the overrides of the moment (``foresight``).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from controller.plan.segment import Pause, Wait

MAX_EVENTS = 20_000  # events of a program; what it waits for behind them is told as it comes near


Passed = tuple[int, float, int, float]  # order of the block, fraction of it, which way beside it, s on that


class Event(NamedTuple):
    """A pause in which the path clock stands."""

    at_s: float  # of the path clock
    line: int
    wait: Wait


class Timetable(NamedTuple):
    """``to``: the place of the program at which it ends for now, as far as is known; None: with the path.

    ``at``: the overrides of feed and of rapids at which it is planned.
    """

    from_s: float
    end_s: float
    events: tuple[Event, ...] = ()
    to: Passed | None = None
    at: tuple[float, float] = (1.0, 1.0)


def event_of(pause: Pause, at_s: float) -> Event | None:
    """None where it neither stands nor is a stop."""
    return Event(at_s, pause.place.line, pause.wait) if pause.wait != Wait() else None


def to_json(events: Iterable[Event]) -> list[list[Any]]:
    """Without loss."""
    return [[event.at_s, event.line, *event.wait] for event in events]


def from_json(rows: Any) -> tuple[Event, ...]:
    """Raises ValueError or TypeError for anything but what ``to_json`` makes."""
    return tuple(
        Event(float(at_s), int(line), Wait(str(name), float(seconds), str(stops)))
        for at_s, line, name, seconds, stops in rows
    )
