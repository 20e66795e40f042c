"""The short way from a common line to its block: what programs from CAM systems are made of.

Exactly what ``blocks`` makes of such a line by its general way, at a tenth of the time; whatever is not
common, or would be refused, is left to that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from controller.geometry.vectors import Vector
from controller.machine.model import STILL, Machine
from controller.program import points
from controller.program.arc_words import PLANES
from controller.program.line import AXES, CENTRE, FEED, FUNCTION, MOTION, PARTS, RADIUS, SPEED, Line, Part
from controller.program.line_words import SHORTEST_VECTOR
from controller.program.modal import FEEDS, State
from controller.program.points import POINTLESS
from controller.program.program import Block, JointArc, JointLine, Place, Targets, Tip, TipLine

MAX_STATES = 1000  # that are remembered
_MOTIONS: MappingProxyType[Part, str] = MappingProxyType(
    {key: f"G{k}" for k in range(4) for key in (str(k), f"0{k}", float(k))}
)
_SHORT = frozenset(("G0", "G1", "G2", "G3"))
_Feed = tuple[str, float | None, float | None]  # motion, mm/s, degrees/s: what common lines change of a state


class CommonLines:
    """Reads G0 to G3 with words of axes, centre, radius and feed for one machine."""

    def __init__(self, machine: Machine) -> None:
        self._axes = [(PARTS[a.name], a.shown_per_unit if a.is_rotary else 0.0) for a in machine.axes]
        names = {axis.name for axis in machine.axes}
        self._lacking = [PARTS[letter] for letter in "XYZABC" if letter not in names]
        self._linear, self._pair = machine.linear(), machine.pair
        self._turning = [PARTS[machine.axes[i].name] for i in machine.rotary()]
        self._points_count = points.count(machine)
        self._state: State | None = None  # as it was seen last ...
        self._is_usual = False  # ... and whether its lines can be common
        self._states: dict[_Feed, State] = {}  # beside it: those that differ in this alone
        self._families: list[dict[_Feed, State]] = []

    def read(self, line: Line, state: State) -> tuple[Block, State] | None:
        """The block of a common line and the state after it; None where the general way is needed."""
        parts = line.parts
        if parts is None or parts[FUNCTION] is not None or parts[SPEED] is not None:
            return None
        if state is not self._state:
            self._see(state)
        code, feed = parts[MOTION], parts[FEED]
        motion = state.motion if code is None else _MOTIONS.get(code, "")
        if not self._is_usual or motion not in _SHORT or self._is_odd(line, parts):
            return None
        targets = self._targets(parts, state.mm_per_unit)
        after: State | None = state
        if feed is not None or motion != state.motion:
            after = self._after(state, motion, None if feed is None else float(feed))
        if after is None:
            return None
        block: Block | None
        if motion == "G0" or motion == "G1":
            block = self._line(line, parts, targets, motion, after)
        else:
            block = _arc(line, parts, targets, motion, after)
        return None if block is None else (block, after)

    def _is_odd(self, line: Line, parts: Sequence[Part]) -> bool:
        """Whether it names an axis that is not there, or has words whose value is not what they say."""
        for at in self._lacking:
            if parts[at] is not None:
                return True
        return self._points_count and (not line.text or POINTLESS.search(line.text) is not None)

    def _targets(self, parts: Sequence[Part], unit: float) -> Targets:
        return tuple(
            [
                None if (value := parts[at]) is None else float(value) / per if per else float(value) * unit
                for at, per in self._axes
            ]
        )

    # ---- states

    def _see(self, state: State) -> None:
        """Another state than the lines before it left."""
        self._state = state
        modal = state.modal
        self._is_usual = (
            not (state.per_turn or state.cycle or state.begun or _for_surfaces(state))
            and modal.turned_rad == STILL
        )
        key = _feed_of(state)
        for states in self._families:
            if states.get(key) is state:
                self._states = states
                return
        self._states = {key: state}
        self._families = [*self._families[-7:], self._states]

    def _after(self, state: State, motion: str, feed: float | None) -> State | None:
        """The state with another motion or F, made once for each: programs take turns with a few."""
        mm_s, deg_s = state.modal.feed_mm_s, state.feed_deg_s
        if feed is not None and feed <= 0.0:
            return None
        if feed is not None and not state.inverse:
            mm_s, deg_s = feed * state.mm_per_unit / 60.0, feed / 60.0
        found = self._states.get((motion, mm_s, deg_s))
        if found is None:
            if feed is not None and not state.inverse and not FEEDS[0] <= feed <= FEEDS[1]:
                return None
            found = _with_feed(state, (motion, mm_s, deg_s))
            if len(self._states) >= MAX_STATES:
                self._states.clear()
            self._states[(motion, mm_s, deg_s)] = found
        self._state = found
        return found

    def one_of(self, state: State) -> State:
        """The same state, of those that are remembered if it is among them."""
        key = _feed_of(state)
        for states in self._families:
            known = states.get(key)
            if known is None:
                known = _with_feed(next(iter(states.values())), key) if states else None
            if known == state:
                states.setdefault(key, known)
                return known
        return state

    # ---- blocks

    def _line(
        self, line: Line, parts: Sequence[Part], targets: Targets, motion: str, state: State
    ) -> Block | None:
        """G0 or G1; None where it would be refused."""
        modal, relative = state.modal, not state.absolute
        feed = _feed(parts, motion, state)
        if feed is None or parts[RADIUS] is not None:
            return None
        mm, degrees, time = feed
        has_vector = (
            parts[CENTRE] is not None or parts[CENTRE + 1] is not None or parts[CENTRE + 2] is not None
        )
        if not has_vector and targets.count(None) == len(targets):
            return None
        if modal.tip is Tip.OFF:
            if has_vector or (modal.tilted and self._turns(parts)):
                return None
            return JointLine(_place(line, parts), modal, targets, relative, False, mm, degrees, time)
        if self._turns(parts) if modal.tip is Tip.VECTORS else has_vector:
            return None
        axis = _vector(parts) if has_vector else None
        if has_vector and (axis is None or relative):
            return None
        x, y, z = [targets[i] for i in self._linear]
        turns = self._pair(targets, None)
        return TipLine(_place(line, parts), modal, (x, y, z), turns, axis, relative, mm, degrees, time)

    def _turns(self, parts: Sequence[Part]) -> bool:
        """Whether a rotary has a word."""
        return any([parts[i] is not None for i in self._turning])


def any_of(values: Sequence[object]) -> bool:
    """Whether one of them is there."""
    return values.count(None) < len(values)


def _feed(
    parts: Sequence[Part], motion: str, state: State
) -> tuple[float | None, float | None, float | None] | None:
    """Millimetres and degrees a second, and under G93 the time, of a line; None where a feed is missing."""
    if motion == "G0":
        return None, None, None
    if state.inverse:
        word = parts[FEED]
        return None if word is None else (0.0, 0.0, 60.0 / float(word))
    mm = state.modal.feed_mm_s
    return None if mm is None else (mm, state.feed_deg_s, None)


def _vector(parts: Sequence[Part]) -> Vector | None:
    """I J K along the tool axis; None unless they are whole and surely long enough."""
    i, j, k = parts[CENTRE:RADIUS]
    if i is None or j is None or k is None:
        return None
    x, y, z = float(i), float(j), float(k)
    return None if math.sqrt(x * x + y * y + z * z) < SHORTEST_VECTOR else (x, y, z)


def _arc(line: Line, parts: Sequence[Part], targets: Targets, motion: str, state: State) -> Block | None:
    """G2 or G3; None where it would be refused, or asks where the axes stand."""
    modal, unit = state.modal, state.mm_per_unit
    first, second, normal = plane = PLANES[modal.plane]
    i, j, radius = parts[CENTRE + first], parts[CENTRE + second], parts[RADIUS]
    feed = _feed(parts, motion, state)
    if feed is None or modal.tip is not Tip.OFF or modal.tilted or parts[CENTRE + normal] is not None:
        return None
    if (radius is None) == (i is None and j is None):
        return None
    centre = radius_mm = None
    if radius is not None:
        radius_mm = float(radius) * unit
        if radius_mm == 0.0 or (parts[AXES + first] is None and parts[AXES + second] is None):
            return None
    elif state.centres_absolute:
        return None
    else:
        centre = (float(i or 0.0) * unit or 0.0, float(j or 0.0) * unit or 0.0)
    place, clockwise, mm = _place(line, parts), motion == "G2", feed[0]
    assert mm is not None
    return JointArc(
        place, modal, plane, clockwise, targets, not state.absolute, centre, radius_mm, 1, mm, feed[2]
    )


def _place(line: Line, parts: Sequence[Part]) -> Place:
    """Of the motion's word, or of the first that it takes."""
    if parts[MOTION] is not None:
        return line.place_of(MOTION)
    if parts[AXES] is not None and line.is_plain:
        return line.place_of(AXES)
    return line.place(min(line.column(at) for at in range(AXES, RADIUS) if parts[at] is not None))


def _feed_of(state: State) -> _Feed:
    return state.motion, state.modal.feed_mm_s, state.feed_deg_s


def _with_feed(state: State, key: _Feed) -> State:
    motion, mm_s, deg_s = key
    modal = state.modal
    if mm_s != modal.feed_mm_s:
        modal = replace(modal, feed_mm_s=mm_s)
    return state._replace(motion=motion, modal=modal, feed_deg_s=deg_s)


def _for_surfaces(state: State) -> bool:
    """Whether a side of the cutter is on that is not, or not yet, for lines."""
    planar = state.modal.planar
    return state.side != "G40" and (planar is None or not planar.lines or state.modal.tip is not Tip.OFF)
