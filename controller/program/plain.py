"""The short way from a common line to its block: what programs from CAM systems are made of.

Exactly what ``blocks`` makes of such a line by its general way, at a tenth of the time; whatever is not
common, or would be refused, is left to that.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import MappingProxyType

from controller.geometry.vectors import Vector
from controller.machine.model import STILL, Machine
from controller.program import points
from controller.program.given import Given
from controller.program.line import (
    AXES,
    CENTRE,
    COMMON,
    FEED,
    FUNCTION,
    MAX_RUN,
    MOTION,
    PARTS,
    RADIUS,
    SPEED,
    Line,
    Other,
    Part,
    Rows,
    Word,
    common,
)
from controller.program.modal import FEEDS, State
from controller.program.motion_words import PLANES, SHORTEST_VECTOR
from controller.program.points import POINTLESS
from controller.program.program import Action, Block, JointArc, JointLine, Place, Targets, Tip, TipLine

_SHORT = frozenset(("G0", "G1", "G2", "G3"))
_MOTIONS: MappingProxyType[Part, str] = MappingProxyType(
    {key: f"G{k}" for k in range(4) for key in (str(k), f"0{k}", float(k))}
)
_NO_VECTOR = (None, None, None)
_new = tuple.__new__  # as Place._make, for millions of lines
_NO_ARC = (None, None, None, None)
_Feed = tuple[str, float | None, float | None]  # motion, mm/s, degrees/s: what common lines change of a state


class _Ready:
    """A state, and what common lines need of it at hand."""

    __slots__ = (
        "beside",
        "degrees",
        "follows",
        "is_line",
        "is_usual",
        "mm",
        "modal",
        "motion",
        "relative",
        "state",
        "unit",
    )

    def __init__(self, state: State) -> None:
        self.state, self.modal, self.motion = state, state.modal, state.motion
        self.beside: dict[str, _Ready] = {}  # those with other motions, as they are asked for
        self.relative, self.unit = not state.absolute, state.mm_per_unit
        is_feed = self.motion != "G0"
        self.follows = state.origins.following is not None  # where rotaries turn, the origin does, too
        self.mm = self.modal.feed_mm_s if is_feed else None
        self.degrees = state.feed_deg_s if is_feed else None
        self.is_usual = (  # its lines can be common
            not (state.per_turn or state.cycle or state.begun or state.polar or _for_surfaces(state))
            and self.modal.turned_rad == STILL
            and self.motion in _SHORT
        )
        self.is_line = (  # those of axes alone are JointLines
            self.is_usual
            and self.motion in ("G0", "G1")
            and self.modal.tip is Tip.OFF
            and not (self.modal.tilted or state.inverse or self.follows)
            and (self.mm is not None or not is_feed)
        )


class _Family:
    """States that differ in motion and F alone: programs take turns with a few."""

    __slots__ = ("by_feed", "by_words")

    def __init__(self) -> None:
        self.by_feed: dict[_Feed, _Ready] = {}
        self.by_words: dict[tuple[str, Part], _Ready] = {}  # the same by motion and F as written

    def add(self, ready: _Ready) -> None:
        if len(self.by_feed) >= MAX_STATES:
            self.by_feed.clear()
            self.by_words.clear()
        self.by_feed[_feed_of(ready.state)] = ready


class CommonLines:
    """Reads G0 to G3 with words of axes, centre, radius and feed for one machine."""

    def __init__(self, machine: Machine, given: Given) -> None:
        self._axes = tuple((PARTS[a.name], a.shown_per_unit if a.is_rotary else 0.0) for a in machine.axes)
        names = {axis.name for axis in machine.axes}
        self._lacking = tuple(PARTS[letter] for letter in "XYZABC" if letter not in names)
        self._common = common("".join(sorted(names)))
        self._linear, self._rotary = machine.linear(), machine.pair(range(len(machine.axes)), None)
        self._turning = [PARTS[machine.axes[i].name] for i in machine.rotary()]
        self._points_count = points.count(machine)
        self._given = given
        self.functions = Functions(self.one_of)
        self.rests = False  # while another line is carried out: what follows may belong to it
        self._ready = _Ready(given.state)  # the state that was seen last ...
        self._family = _Family()  # ... its family ...
        self._families: list[_Family] = []  # ... and some others

    def take(self, rows: Rows, run: list[Block]) -> Other | None:
        """Reads lines to blocks of ``run``, the state then being that after them, up to the first that is no
        common one, which it gives; None where ``run`` is full, or the lines are at their end.
        """
        given, axes, count, find = self._given, self._axes, len(self._axes), self._common.fullmatch
        now, counts_points, rests = self._seen(), self._points_count, self.rests
        values: list[float | None]
        block: Block | None
        for number, raw in rows:
            found = find(raw)
            last = found.lastindex if found is not None else None
            if found is None or last is None or rests:
                if found is not None and last is None and raw.lstrip()[:1] not in ("N", "n"):
                    continue  # nothing but a comment
                return number, raw, COMMON.fullmatch(raw)
            parts = found.groups()
            if last > FEED + 1:
                done = self.functions.done(parts, given.state, found, number)
                if done is None or len(run) >= MAX_RUN - len(done[0]):
                    return number, raw, found
                run += done[0]
                given.state = done[1]
                now = self._seen()
                continue
            code, feed = parts[MOTION], parts[FEED]
            at = MOTION if code is not None else AXES if parts[AXES] is not None else _first(parts)
            place = _new(Place, (number, found.start(at + 1), 0, (), "", 0))
            motion = now.motion if code is None else _MOTIONS[code]
            if feed is not None:
                ready = self._family.by_words.get((motion, feed))
            else:
                ready = now if motion == now.motion else now.beside.get(motion)
            if ready is None:
                ready = self._after(now, motion, feed)
            if ready is None or not ready.is_usual or (counts_points and POINTLESS.search(raw) is not None):
                return number, raw, found
            unit, values = ready.unit, []
            for at, per in axes:  # as _targets, with no call on the way
                if (word := parts[at]) is None:
                    values.append(None)
                else:
                    values.append(float(word) / per if per else float(word) * unit)
            if not ready.is_line or (last > CENTRE and parts[CENTRE:FEED] != _NO_ARC):
                block = self._block(place, parts, tuple(values), ready)
            elif values.count(None) < count:
                mm, degrees = ready.mm, ready.degrees
                block = JointLine(place, ready.modal, tuple(values), ready.relative, False, mm, degrees)
            else:
                block = None
            if block is None:
                return number, raw, found
            run.append(block)
            if ready is not now:
                given.state, now = ready.state, ready
            if len(run) == MAX_RUN:
                break
        return None

    def read(self, line: Line) -> Block | None:
        """The block of any line that is a common one."""
        parts = line.parts
        if parts is None and line.words:
            line = line.with_words(_without_codes_in_force(line.words, self._given.state))
            parts = line.parts
        if parts is None or parts[FUNCTION] is not None or parts[SPEED] is not None:
            return None
        if not any_of(parts[AXES:RADIUS]) or any(parts[at] is not None for at in self._lacking):
            return None
        if self._points_count and (not line.text or POINTLESS.search(line.text) is not None):
            return None
        now, code = self._seen(), parts[MOTION]
        ready = self._after(now, now.motion if code is None else _MOTIONS.get(code, ""), parts[FEED])
        if ready is None or not ready.is_usual:
            return None
        block = self._block(_place(line, parts), parts, self._targets(parts, ready.unit), ready)
        if block is not None:
            self._given.state = ready.state
        return block

    def _targets(self, parts: Sequence[Part], unit: float) -> Targets:
        words = [(parts[at], per) for at, per in self._axes]
        return tuple(
            [
                None if word is None else float(word) / per if per else float(word) * unit
                for word, per in words
            ]
        )

    # ---- states

    def _seen(self) -> _Ready:
        """The state, seen anew where it is another than the lines before left."""
        state = self._given.state
        if state is self._ready.state:
            return self._ready
        key = _feed_of(state)
        for family in self._families:
            ready = family.by_feed.get(key)
            if ready is not None and ready.state is state:
                self._family, self._ready = family, ready
                return ready
        self._family, self._ready = _Family(), _Ready(state)
        self._family.add(self._ready)
        self._families = [*self._families[-7:], self._family]
        return self._ready

    def _after(self, now: _Ready, motion: str, word: Part) -> _Ready | None:
        """The state with another motion or F, made once for each."""
        state, feed = now.state, None if word is None else float(word)
        mm_s, deg_s = state.modal.feed_mm_s, state.feed_deg_s
        if motion not in _SHORT or (feed is not None and feed <= 0.0):
            return None
        if feed is not None and not state.inverse:
            mm_s, deg_s = feed * state.mm_per_unit / 60.0, feed / 60.0
        found = self._family.by_feed.get((motion, mm_s, deg_s))
        if found is None:
            if feed is not None and not state.inverse and not FEEDS[0] <= feed <= FEEDS[1]:
                return None
            found = _Ready(_with_feed(state, (motion, mm_s, deg_s)))
            self._family.add(found)
        if feed is None:
            now.beside[motion] = found
        elif len(self._family.by_words) < MAX_STATES:
            self._family.by_words[motion, word] = found
        return found

    def one_of(self, state: State) -> State:
        """The same state, of those that are remembered if it is among them."""
        key = _feed_of(state)
        for family in self._families:
            known = family.by_feed.get(key)
            if known is None and family.by_feed:
                known = _Ready(_with_feed(next(iter(family.by_feed.values())).state, key))
            if known is not None and known.state == state:
                family.by_feed.setdefault(key, known)
                return known.state
        return state

    # ---- blocks

    def _block(self, place: Place, parts: Sequence[Part], targets: Targets, ready: _Ready) -> Block | None:
        """Of a line of words that belong together; None where it would be refused."""
        if ready.follows and self._turns(parts):
            return None
        if ready.motion in ("G2", "G3"):
            return _arc(place, parts, targets, ready)
        return self._line(place, parts, targets, ready)

    def _line(self, place: Place, parts: Sequence[Part], targets: Targets, ready: _Ready) -> Block | None:
        """G0 or G1; None where it would be refused."""
        modal, mm, degrees, relative = ready.modal, ready.mm, ready.degrees, ready.relative
        time: float | None = None
        if ready.motion == "G1":
            if ready.state.inverse:
                mm, degrees, time = 0.0, 0.0, _time(parts)
            if mm is None or (ready.state.inverse and time is None):
                return None
        has_vector = tuple(parts[CENTRE:RADIUS]) != _NO_VECTOR
        if parts[RADIUS] is not None or not (has_vector or any_of(targets)):
            return None
        if modal.tip is Tip.OFF:
            if has_vector or (modal.tilted and self._turns(parts)):
                return None
            return JointLine(place, modal, targets, relative, False, mm, degrees, time)
        if self._turns(parts) if modal.tip is Tip.VECTORS else has_vector:
            return None
        axis = _vector(parts) if has_vector else None
        if has_vector and (axis is None or relative):
            return None
        x, y, z = [targets[i] for i in self._linear]
        a, b = [None if i is None else targets[i] for i in self._rotary]
        return TipLine(place, modal, (x, y, z), (a, b), axis, relative, mm, degrees, time)

    def _turns(self, parts: Sequence[Part]) -> bool:
        """Whether a rotary has a word."""
        return any([parts[i] is not None for i in self._turning])


def _without_codes_in_force(words: Sequence[Word], state: State) -> tuple[Word, ...]:
    """Without G90 and others that say what is so already, which change nothing; each may stand once."""
    plane = float(state.modal.plane[1:])
    in_force = {90.0 if state.absolute else 91.0, plane, 21.0 if state.mm_per_unit == 1.0 else 20.0}
    left: list[Word] = []
    for word in words:
        if word.letter == "G" and word.value in in_force:
            in_force.remove(word.value)
        else:
            left.append(word)
    return tuple(left)


def _time(parts: Sequence[Part]) -> float | None:
    """Seconds of a line under G93; None where its F is missing."""
    word = parts[FEED]
    return None if word is None else 60.0 / float(word)


def _vector(parts: Sequence[Part]) -> Vector | None:
    """I J K along the tool axis; None unless they are whole and surely long enough."""
    i, j, k = parts[CENTRE:RADIUS]
    if i is None or j is None or k is None:
        return None
    x, y, z = float(i), float(j), float(k)
    return None if math.sqrt(x * x + y * y + z * z) < SHORTEST_VECTOR else (x, y, z)


def _arc(place: Place, parts: Sequence[Part], targets: Targets, ready: _Ready) -> Block | None:
    """G2 or G3; None where it would be refused, or asks where the axes stand."""
    state, modal, unit = ready.state, ready.modal, ready.unit
    first, second, normal = plane = PLANES[modal.plane]
    i, j, radius = parts[CENTRE + first], parts[CENTRE + second], parts[RADIUS]
    mm, time = (0.0, _time(parts)) if state.inverse else (modal.feed_mm_s, None)
    if mm is None or (state.inverse and time is None):
        return None
    if modal.tip is not Tip.OFF or modal.tilted or parts[CENTRE + normal] is not None:
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
    clockwise = ready.motion == "G2"
    return JointArc(place, modal, plane, clockwise, targets, ready.relative, centre, radius_mm, 1, mm, time)


def _place(line: Line, parts: Sequence[Part]) -> Place:
    """Of the motion's word, or of the one that stands first of those that it takes."""
    if parts[MOTION] is not None:
        return line.place(line.column(MOTION))
    return line.place(min(line.column(at) for at in range(AXES, RADIUS) if parts[at] is not None))


def _first(parts: Sequence[Part]) -> int:
    """Of words in their usual order, the first that a motion takes."""
    return next((at for at in range(AXES, RADIUS) if parts[at] is not None), MOTION)


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


# The short way of lines that are spindle and coolant alone (M3 to M5, M7 to M9, S).
#
# What such a line does depends on the state before it alone: it is carried out once, and then known.

MAX_STATES = 1000  # that are remembered
_FUNCTIONS = frozenset((3.0, 4.0, 5.0, 7.0, 8.0, 9.0))  # M
_Known = tuple[State, State, list[tuple[int, Action]]]  # before, after, and by which word


class Functions:
    """What was learnt: by state, M and S."""

    def __init__(self, one_of: Callable[[State], State]) -> None:
        """``one_of``: the same state, of those that are known."""
        self._one_of = one_of
        self._known: dict[tuple[int, Part, Part], _Known] = {}

    def done(
        self, parts: Sequence[Part], state: State, found: re.Match[str], number: int
    ) -> tuple[list[Action], State] | None:
        """What a line that COMMON has found does, if that was learnt, and the state after it."""
        known = self._of(parts, state)
        if known is None:
            return None
        _, after, acts = known
        return [
            Action(_new(Place, (number, found.start(part + 1), 0, (), "", 0)), act.modal, act.act)
            for part, act in acts
        ], after

    def read(self, line: Line, state: State) -> tuple[list[Block], State] | None:
        """The same of any line."""
        parts = line.parts
        known = None if parts is None else self._of(parts, state)
        if known is None:
            return None
        _, after, acts = known
        return [Action(line.place(line.column(part)), act.modal, act.act) for part, act in acts], after

    def _of(self, parts: Sequence[Part], state: State) -> _Known | None:
        if parts[FUNCTION] is None and parts[SPEED] is None:
            return None
        known = self._known.get((id(state), parts[FUNCTION], parts[SPEED]))
        return known if known is not None and _is_function(parts) else None

    def learnt(self, line: Line, before: State, after: State, made: Sequence[Block]) -> State:
        """The state after a line that was carried out, which is noted for the next time."""
        parts = line.parts
        if parts is None or (parts[FUNCTION] is None and parts[SPEED] is None) or not _is_function(parts):
            return after
        acts: list[tuple[int, Action]] = []
        for block in made:
            if not isinstance(block, Action):
                return after
            of_m = parts[FUNCTION] is not None and block.place.column == line.column(FUNCTION)
            acts.append((FUNCTION if of_m else SPEED, block))
        after = self._one_of(after)
        if len(self._known) >= MAX_STATES:
            self._known.clear()
        self._known[(id(before), parts[FUNCTION], parts[SPEED])] = (before, after, acts)
        return after


def any_of(values: Sequence[object]) -> bool:
    """Whether one of them is there."""
    return values.count(None) < len(values)


def _is_function(parts: Sequence[Part]) -> bool:
    """Whether it has nothing but S and an M of spindle or coolant."""
    if any_of(parts[:SPEED]):
        return False
    code = parts[FUNCTION]
    return code is None or float(code) in _FUNCTIONS
