"""Operators at random: holds, overrides, single block, stops, at any tick of a run."""

from __future__ import annotations

import random

from controller.runtime.events import Event
from controller.state.modes import Request

KINDS = ("hold", "quick hold", "override", "double override", "rapid", "single block", "optional stop")


def events(rng: random.Random, ticks: int, count: int, kinds: tuple[str, ...] = KINDS) -> list[Event]:
    """``count`` doings of an operator in a run that takes ``ticks`` undisturbed; the last ones let it end."""
    made: list[Event] = []
    for tick in sorted(rng.randrange(ticks) for _ in range(count)):
        made += _doing(rng, tick, rng.choice(kinds))
    made.sort(key=lambda event: event.tick)
    end = max([ticks, *(event.tick for event in made)]) + 200
    made += [Event(end + i, request, value) for i, (request, value) in enumerate(_let_go())]
    return made


def _doing(rng: random.Random, tick: int, kind: str) -> list[Event]:
    if kind == "hold":
        return [Event(tick, Request.HOLD), Event(tick + rng.randrange(100, 400), Request.RESUME)]
    if kind == "quick hold":  # resumed, and held again, while it still slows down
        gaps = [tick + g for g in sorted(rng.sample(range(1, 40), 3))]
        words = (Request.HOLD, Request.RESUME, Request.HOLD, Request.RESUME)
        return [Event(t, word) for t, word in zip([tick, *gaps], words, strict=True)]
    if kind == "override":
        back = tick + rng.randrange(5, 400)
        return [
            Event(tick, Request.OVERRIDE, _share(rng)),
            Event(back, Request.OVERRIDE, rng.choice((1.0, 2.0))),
        ]
    if kind == "double override":  # the second before the first is reached
        again = Event(tick + rng.randrange(1, 30), Request.OVERRIDE, _share(rng))
        return [Event(tick, Request.OVERRIDE, 2.0), again, Event(tick + 300, Request.OVERRIDE, 1.0)]
    if kind == "rapid":
        back = tick + rng.randrange(5, 300)
        return [Event(tick, Request.RAPID_OVERRIDE, _share(rng)), Event(back, Request.RAPID_OVERRIDE, 1.0)]
    return _switch(rng, tick, kind.replace(" ", "_").upper())


def _switch(rng: random.Random, tick: int, name: str) -> list[Event]:
    """A switch on and off again; with single block the operator goes on every 400 ticks."""
    if name not in Request.__members__:
        return []
    off = tick + rng.randrange(50, 1500)
    made = [Event(tick, Request[name], 1.0), Event(off, Request[name], 0.0)]
    return made + [Event(t, Request.RESUME) for t in range(tick + 400, off + 800, 400)]


def _share(rng: random.Random) -> float:
    return rng.choice((0.0, 0.0, 0.02, 0.1, 0.5, 1.0, 1.5, 2.0, rng.uniform(0.0, 2.0)))


def _let_go() -> list[tuple[Request, float]]:
    switches = [
        (Request[name], 0.0)
        for name in ("SINGLE_BLOCK", "OPTIONAL_STOP", "ADAPTIVE_FEED")
        if name in Request.__members__
    ]
    return [(Request.OVERRIDE, 1.0), (Request.RAPID_OVERRIDE, 1.0), *switches, (Request.RESUME, 0.0)]
