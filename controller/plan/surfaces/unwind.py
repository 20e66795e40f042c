"""A rotary wound up beyond its travel: the refusal, and the position from which it would go.

A rotary stands alike after every whole turn, so a block that would leave the travel can
often be cut from a start some turns back. Between cuts the machine finds such a start by
itself; here is what is said where it cannot, because nothing lets it turn back in time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NoReturn

import numpy as np

from controller.geometry.arrays import Array
from controller.geometry.vectors import ROUNDING
from controller.machine.model import Axis, Machine
from controller.messages import Message, message
from controller.motion.motions import Rotaries
from controller.plan.context import Context
from controller.plan.rotaries.turns import TURN
from controller.plan.rotaries.winding import RankKey, Way
from controller.plan.surfaces import audit
from controller.plan.surfaces.legs import CutSegment, Option


def refuse(options: Sequence[Option], context: Context, now: Rotaries) -> NoReturn:
    """Refuse a train that leaves the travel on every branch, shown where it gets farthest."""
    legs = _farthest_legs(options, context.machine, now)
    for i, leg in enumerate(legs):
        excess = audit.outside(context.machine, leg.u, leg.joints)
        if excess is not None:
            axis = context.machine.axes[excess.axis]
            where = audit.at_place(leg.cut, float(leg.u[excess.sample]))
            advice = _advice(legs, i, excess.axis, context.machine) if axis.is_rotary else audit.MOVE
            context.refuse(leg.cut.block.place, audit.describe(axis, excess, where, advice))
    raise AssertionError("a train was refused for its travel but is inside")


def _farthest_legs(options: Sequence[Option], machine: Machine, now: Rotaries) -> list[CutSegment]:
    """The branch and turns in which the most samples come before the first outside of travel."""
    found: list[tuple[int, RankKey, int, list[CutSegment]]] = []
    for option in options:
        for by in _shifts(option.way, machine):
            legs = option.shifted(machine, by)
            found.append((-_inside(legs, machine), option.way.rank(by, now).key, len(found), legs))
    return min(found)[-1]


def _shifts(way: Way, machine: Machine) -> Iterator[Rotaries]:
    """Every turn in which the row begins inside travel, or the one nearest to that."""
    turns = []
    for start, (least, most) in zip(way.start, machine.turns(), strict=True):
        first = math.ceil((least - start - ROUNDING) / TURN)
        last = math.floor((most - start + ROUNDING) / TURN)
        middle = round((0.5 * (least + most) - start) / TURN)
        turns.append(range(first, last + 1) if first <= last else [middle])
    for a, b in itertools.product(*turns):
        yield a * TURN, b * TURN


def _inside(legs: Sequence[CutSegment], machine: Machine) -> int:
    """Samples before the first outside of travel."""
    low, high = (np.array([getattr(a, name) for a in machine.axes]) for name in ("travel_min", "travel_max"))
    count = 0
    for leg in legs:
        beyond = (leg.joints < low - ROUNDING) | (leg.joints > high + ROUNDING)
        outside = np.flatnonzero(beyond.any(axis=1))
        if len(outside):
            return count + int(outside[0])
        count += len(leg.u)
    return count


def start_in_travel(axis: Axis, start: float, low: float, high: float) -> float | None:
    """``start`` moved by the fewest whole turns that bring ``low`` .. ``high`` inside travel; or None."""
    first = math.ceil((axis.travel_min - low - ROUNDING) / TURN)
    last = math.floor((axis.travel_max - high + ROUNDING) / TURN)
    return start + TURN * min(max(0, first), last) if first <= last else None


def offer(axis: Axis, start: float, low: float, high: float) -> Message:
    """Advice for a move whose rotary leaves its travel between ``low`` and ``high`` (rad)."""
    better = start_in_travel(axis, start, low, high)
    return audit.MOVE if better is None else _first(axis, better)


def _first(axis: Axis, start: float) -> Message:
    return message("travel.unwind", axis=axis.name, at=start * axis.shown_per_unit)


def _advice(legs: Sequence[CutSegment], i: int, index: int, machine: Machine) -> Message:
    """What to do about a rotary that leaves its travel in leg ``i`` of a train."""
    axis, block = machine.axes[index], legs[i].cut.block
    first = next(k for k, leg in enumerate(legs) if leg.cut.block is block)
    behind = next((k for k in range(i, len(legs)) if legs[k].cut.block is not block), len(legs))
    if first > 0:  # cuts before this block: a move between ends their train
        for last in (len(legs), behind):
            low, high = _range(legs[first:last], index)
            better = start_in_travel(axis, float(legs[first].joints[0, index]), low, high)
            if better is not None:
                return _first(axis, better)
    return _split(legs[first:behind], index, axis)


def _range(legs: Sequence[CutSegment], index: int) -> tuple[float, float]:
    ends = [audit.extremes(leg.u, leg.joints[:, index : index + 1]) for leg in legs]
    return min(float(e[0][0]) for e in ends), max(float(e[2][0]) for e in ends)


def _split(legs: Sequence[CutSegment], index: int, axis: Axis) -> Message:
    """Where to split a block that turns farther than the travel, and where its second part begins."""
    low, high = _range(legs, index)
    k = abs(axis.shown_per_unit)
    u = np.concatenate([leg.cut.block_u(leg.u) for leg in legs])
    values = np.concatenate([leg.joints[:, index] for leg in legs])
    at, _ = _farthest(values, axis)
    rest, start = _farthest(values[at:], axis)
    then = audit.MOVE
    if at > 0 and rest > 0 and abs(start - values[at]) >= 1e-6:
        then = message("travel.split", axis=axis.name, u=float(u[at]), start=start * axis.shown_per_unit)
    return message("travel.turns", axis=axis.name, turned=(high - low) * k, then=then)


def _farthest(values: Array, axis: Axis) -> tuple[int, float]:
    """(samples that stay inside, start) in the turn in which the rotary goes farthest before it leaves."""
    turns = range(
        math.ceil((axis.travel_min - values[0]) / TURN), math.floor((axis.travel_max - values[0]) / TURN) + 1
    )
    found = [(0, float(values[0]))]
    for n in turns:
        shifted = values + n * TURN
        outside = np.flatnonzero((shifted < axis.travel_min) | (shifted > axis.travel_max))
        found.append(((int(outside[0]) if len(outside) else len(values)) - 1, float(shifted[0])))
    return max(found)
