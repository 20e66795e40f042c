"""The short way from a plain G1 line to its block: what programs from CAM systems are made of.

Exactly what ``blocks`` makes of such a line by its general way, at a tenth of the time;
whatever is not plain, or would be refused, is left to that.
"""

from __future__ import annotations

import math
from dataclasses import replace

from controller.machine import STILL, Machine
from controller.plan.text import points
from controller.plan.text.line import Line
from controller.plan.text.modal import State
from controller.plan.text.points import POINTLESS
from controller.plan.text.program import Block, JointLine, Place, Tip, TipLine

LARGEST = 1e9  # as words
MOST_FEEDS = 1000  # that are remembered
SHORTEST_VECTOR = 1e-6  # as blocks


class PlainLines:
    """Reads plain lines for one machine."""

    def __init__(self, machine: Machine) -> None:
        self._factors = [(a.name, a.shown_per_unit if a.is_rotary else 0.0) for a in machine.axes]
        axes = frozenset(axis.name for axis in machine.axes)
        self._allowed = {
            Tip.OFF: axes | {"F"},
            Tip.ROTARIES: axes | {"F"},
            Tip.VECTORS: frozenset("XYZIJKF"),
        }
        self._first, self._second = (machine.axes[i].name for i in machine.rotary())
        self._per = dict(self._factors)
        self._points_count = points.count(machine)
        self._by_feed: dict[float, State] = {}  # of states that differ from ``_last`` in their feed alone
        self._last: State | None = None

    def read(self, line: Line, state: State) -> tuple[Block, State] | None:
        """The block of a plain G1 line and the state after it; None where the general way is needed."""
        if state.motion != "G1" or _for_surfaces(state) or state.per_turn or (plain := line.plain) is None:
            return None
        if state.modal.turned_rad != STILL or (self._points_count and POINTLESS.search(line.text)):
            return None
        if state.begun is not None:
            return None
        words = dict(plain.pairs)
        tip = state.modal.tip
        if len(words) < len(plain.pairs) or not words.keys() <= self._allowed[tip]:
            return None
        if plain.pairs[0][0] == "F" and (len(words) == 1 or not plain.with_g1):
            return None
        if max(words.values()) > LARGEST or min(words.values()) < -LARGEST:
            return None
        feed = words.pop("F", None)
        if feed is not None and feed <= 0.0:
            return None
        if state.modal.tilted and tip is Tip.OFF and (self._first in words or self._second in words):
            return None
        found = self._with_feed(state, feed)
        if found is None:
            return None
        state, time = found
        place = line.place(plain.column)
        if tip is Tip.OFF:
            return self._joint_line(place, words, state, time), state
        block = self._tip_line(place, words, state, time)
        return None if block is None else (block, state)

    def _with_feed(self, state: State, feed: float | None) -> tuple[State, float | None] | None:
        """The state with a line's F, and the time it takes under G93; None where a feed is missing."""
        if state.inverse:
            return None if feed is None else (state, 60.0 / feed)
        if feed is not None:
            state = self._fed(state, feed)
        return None if state.modal.feed_mm_s is None else (state, None)

    def _fed(self, state: State, feed: float) -> State:
        """The state with another F, made once for each: CAM systems take turns with a few."""
        if state is not self._last:
            self._by_feed.clear()
        found = self._by_feed.get(feed)
        if found is None:
            mm_s, deg_s = feed * state.mm_per_unit / 60.0, feed / 60.0
            found = state
            if (mm_s, deg_s) != (state.modal.feed_mm_s, state.feed_deg_s):
                modal = replace(state.modal, feed_mm_s=mm_s)
                found = state._replace(modal=modal, feed_deg_s=deg_s)
            if len(self._by_feed) >= MOST_FEEDS:
                self._by_feed.clear()
            self._by_feed[feed] = found
        self._last = found
        return found

    def _joint_line(self, place: Place, words: dict[str, float], state: State, time: float | None) -> Block:
        unit = state.mm_per_unit
        targets = tuple(
            [
                None if (value := words.get(name)) is None else value / per if per else value * unit
                for name, per in self._factors
            ]
        )
        mm, degrees = (0.0, 0.0) if time else (state.modal.feed_mm_s, state.feed_deg_s)
        return JointLine(place, state.modal, targets, not state.absolute, False, mm, degrees, time)

    def _tip_line(
        self, place: Place, words: dict[str, float], state: State, time: float | None
    ) -> Block | None:
        get, unit = words.get, state.mm_per_unit
        tip: tuple[float | None, float | None, float | None] = (get("X"), get("Y"), get("Z"))
        if unit != 1.0:
            x, y, z = (None if value is None else value * unit for value in tip)
            tip = (x, y, z)
        i, j, k = get("I"), get("J"), get("K")
        axis = None
        if i is not None and j is not None and k is not None:
            axis = (i, j, k)
            if math.sqrt(i * i + j * j + k * k) < SHORTEST_VECTOR or not state.absolute:
                return None
        elif not i is j is k is None:
            return None
        first, second = get(self._first), get(self._second)
        rotaries = (
            None if first is None else first / self._per[self._first],
            None if second is None else second / self._per[self._second],
        )
        mm, degrees = (0.0, 0.0) if time else (state.modal.feed_mm_s, state.feed_deg_s)
        return TipLine(place, state.modal, tip, rotaries, axis, not state.absolute, mm, degrees, time)


def _for_surfaces(state: State) -> bool:
    """Whether a side of the cutter is on that is not, or not yet, for lines."""
    planar = state.modal.planar
    return state.side != "G40" and (planar is None or not planar.lines or state.modal.tip is not Tip.OFF)
