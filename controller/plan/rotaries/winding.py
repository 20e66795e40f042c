"""Branch and whole turns of every row of cuts, chosen over the whole program.

Two rotaries give each tool axis in up to two ways (branches) and each of these in any
whole turn inside travel. Inside a row of cuts there is no choice; between rows there
is, and the nearest way to begin one row may lead to the farther end of the next:

      start --- row 1 --- G0 C90 --- row 2 --- row 3
            `-- other branch --'

Every row adds by how much its cuts take longer than on its other branch, and what the rotaries turn
to its start and along it; the way through the program with the least sums, in this order, is found
row by row, as each row needs to know of all before it only where they left the rotaries (Viterbi).
Equal sums are decided for positive tilt, then smaller abs(rotary), then positive rotary, summed up
over the rows.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from controller.geometry.vectors import ROUNDING
from controller.machine.model import Machine
from controller.motion.motions import Rotaries
from controller.plan.rotaries.turns import SAME_ROTARY_RAD, TURN

MAX_STATES = 64  # places of the rotaries that are kept in mind; the least travelled ones

RankKey = tuple[float, float, int, float, int]  # by which costs are compared


class Rank(NamedTuple):
    """Cost of a choice, or the sum of many; the lower ``key`` is taken."""

    slower_s: float = 0.0
    travel: float = 0.0
    negative_tilts: int = 0
    turned: float = 0.0
    negative_turns: int = 0

    def plus(self, other: Rank) -> Rank:
        return Rank(
            self.slower_s + other.slower_s,
            self.travel + other.travel,
            self.negative_tilts + other.negative_tilts,
            self.turned + other.turned,
            self.negative_turns + other.negative_turns,
        )

    @property
    def key(self) -> RankKey:
        """Times agree to the millisecond, sums of many angles to eight digits, not to the last bit."""
        angles = round(self.travel, 8), self.negative_tilts, round(self.turned, 8), self.negative_turns
        return round(self.slower_s, 3), *angles


@dataclass(frozen=True, slots=True)
class Way:
    """A row of cuts on one branch, as it comes out in some whole turn; radians.

    ``low`` and ``high`` are the extremes of each rotary along the row, ``travel`` the sum
    of what both turn from its start to its end, and ``inside``: the linear axes keep
    their travel (whole turns of the rotaries do not move them). ``slower_s``: by so much its cuts
    take longer than on the other branch.
    """

    start: Rotaries
    end: Rotaries
    low: Rotaries
    high: Rotaries
    travel: float
    negative: bool  # the tilt, where it is largest
    inside: bool
    tilt: int  # which of the two rotaries tilts
    slower_s: float = 0.0

    def shifts(self, machine: Machine, near: Rotaries) -> Iterator[Rotaries]:
        """Whole turns (rad) that keep the row inside travel and begin it next to ``near``, on either side."""
        found = []
        for k, (least, most) in enumerate(machine.turns()):
            first = math.ceil((least - self.low[k] - ROUNDING) / TURN)
            last = math.floor((most - self.high[k] + ROUNDING) / TURN)
            if first > last:
                return
            nearest = (near[k] - self.start[k]) / TURN
            found.append({min(max(n, first), last) for n in (math.floor(nearest), math.ceil(nearest))})
        for a, b in itertools.product(*found):
            yield a * TURN, b * TURN

    def rank(self, shift: Rotaries, near: Rotaries) -> Rank:
        """What taking this way in these turns costs from ``near``."""
        start = moved(self.start, shift)
        turned = start[1 - self.tilt]
        travel = apart(start, near) + self.travel
        return Rank(self.slower_s, travel, int(self.negative), abs(turned), int(turned < 0.0))


def moved(rotaries: Rotaries, by: Rotaries) -> Rotaries:
    return rotaries[0] + by[0], rotaries[1] + by[1]


def apart(a: Rotaries, b: Rotaries) -> float:
    """Rotary travel from one position to another, rad."""
    return abs(a[0] - b[0]) + abs(a[1] - b[1])


@dataclass(frozen=True, slots=True)
class Row:
    """Cuts with a free choice at their start; ``line`` is that of their first block.

    ``ways`` gives each branch as it comes out next to the position before the row (a
    rotary that a row leaves free stays where it is).
    """

    line: int
    ways: Callable[[Rotaries], Sequence[Way]]


@dataclass(frozen=True, slots=True)
class Turned:
    """A move that names positions (or, ``relative``, distances) of the rotaries; None: it stays."""

    to: tuple[float | None, float | None]
    relative: bool


@dataclass(frozen=True, slots=True)
class _Chosen:
    """A row and where it begins, with all those before it."""

    line: int
    start: Rotaries
    before: _Chosen | None


class _State(NamedTuple):
    """The rotaries somewhere in the program, and the cheapest way to have come there."""

    rotaries: Rotaries
    cost: Rank
    chosen: _Chosen | None = None


def choose(steps: Iterable[Row | Turned], now: Rotaries, machine: Machine) -> dict[int, Rotaries]:
    """Rotaries (rad) at the start of each row, by its line, for the least time of its cuts, and travel.

    Ends before a step that cannot be taken in any way: the path refuses it with its reason.
    """
    states = [_State(now, Rank())]
    for step in steps:
        taken = _over_row(states, step, machine) if isinstance(step, Row) else _over(states, step, machine)
        following = _best(taken)
        if not following:
            break
        states = following
    return _choices(states[0])


def _over_row(states: Sequence[_State], row: Row, machine: Machine) -> Iterator[_State]:
    for state in states:
        for way in row.ways(state.rotaries):
            for shift in way.shifts(machine, state.rotaries) if way.inside else ():
                cost = state.cost.plus(way.rank(shift, state.rotaries))
                chosen = _Chosen(row.line, moved(way.start, shift), state.chosen)
                yield _State(moved(way.end, shift), cost, chosen)


def _over(states: Sequence[_State], move: Turned, machine: Machine) -> Iterator[_State]:
    for state in states:
        a, b = (
            q if to is None else (q + to if move.relative else to)
            for q, to in zip(state.rotaries, move.to, strict=True)
        )
        ends = zip(machine.turns(), (a, b), strict=True)
        if all(least - ROUNDING <= q <= most + ROUNDING for (least, most), q in ends):
            turned = Rank(travel=apart((a, b), state.rotaries))
            yield _State((a, b), state.cost.plus(turned), state.chosen)


def _best(states: Iterable[_State]) -> list[_State]:
    """Of the states in one place the cheapest; of all places the cheapest ones, in order."""
    best: dict[tuple[int, int], _State] = {}
    for state in states:
        a, b = state.rotaries
        place = (round(a / SAME_ROTARY_RAD), round(b / SAME_ROTARY_RAD))
        known = best.get(place)
        if known is None or state.cost.key < known.cost.key:
            best[place] = state
    return sorted(best.values(), key=lambda state: state.cost.key)[:MAX_STATES]


def _choices(last: _State) -> dict[int, Rotaries]:
    found: dict[int, Rotaries] = {}
    chosen = last.chosen
    while chosen is not None:
        found[chosen.line] = chosen.start
        chosen = chosen.before
    return dict(sorted(found.items()))
