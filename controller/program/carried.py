"""The one modal state of a machine: what a line, a program or a stop leaves in force for whatever comes next.

``InForce`` knows the state at each line of a program that is read ahead of the machine. What of it goes on
after a line typed by hand, after the end of a program and after a stop is decided here (RS-274/NGC 3.6.1 and
3.5.17; on controls as Fanuc's the cleared state of M30 and reset), and its form as JSON, for records.

``changes_between`` has what a line changes for good: beyond its program, and a loss of power. ``Saved`` keeps
the state for M70 to M73 (as LinuxCNC): M70 keeps it, M72 gives it back, M71 forgets it; M73 keeps it and has
it given back when the sub ends. Each call of a sub has its own. The motion mode stays as it is, and so does
the tool.
"""

from __future__ import annotations

import copyreg
import types
import typing
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from controller.machine.changes import Change, Shifted
from controller.machine.model import KEPT_OFFSETS, Machine
from controller.program.line import CommonRun, Line, Word
from controller.program.modal import Cycle, State, power_on
from controller.program.origins import Origins, Plane
from controller.program.program import UNSAID, Act, Action, Block, JointArc, JointLine, Modal, Side, TipLine

MAX_ROWS = 20_000  # states that are remembered: more lines than are ever read ahead
# Of a state what belongs to the text that is read, or is known again from the machine.
_OF_THE_TEXT = (
    "tools",
    "references",
    "noted",
    "marks",
    "cleared",
    "answer",
)
_FOUND_AGAIN = ("part", "turned_rad", "cutter", "tilted", "planar", "outputs", "beside_mm", "written")


def _proxy(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(values)


# States are pickled on their way between processes.
copyreg.pickle(MappingProxyType, lambda proxy: (_proxy, (dict(proxy),)))


class InForce:
    """The modal state by the order of lines, the newest ``MAX_ROWS`` of them."""

    def __init__(self) -> None:
        self._orders: list[int] = []
        self._states: list[State] = []

    def add(self, order: int, state: State) -> None:
        """From that line (``Place.order``) on."""
        if self._states and self._states[-1] is state:
            return
        if len(self._orders) >= 2 * MAX_ROWS:
            del self._orders[:MAX_ROWS], self._states[:MAX_ROWS]
        self._orders.append(order)
        self._states.append(state)

    def add_run(self, run: CommonRun, after: State) -> None:
        """The same of common lines: they change motion, F, spindle and coolant alone."""
        before = self._states[-1] if self._states else after
        for block in run.blocks:
            motion = _motion(block) or before.motion
            if block.modal is not before.modal or motion != before.motion:
                before = before._replace(modal=block.modal, motion=motion)
                self.add(block.place.order, before)
        if run.blocks:
            self.add(run.blocks[-1].place.order, after)

    def at(self, order: int) -> State | None:
        """The state in which a line is carried out; None before the first."""
        i = bisect_right(self._orders, order)
        return self._states[i - 1] if i else None

    @property
    def last(self) -> State | None:
        """After all that has been read."""
        return self._states[-1] if self._states else None


def _motion(block: object) -> str:
    if isinstance(block, JointArc):
        return "G2" if block.clockwise else "G3"
    if isinstance(block, JointLine | TipLine):
        return "G0" if block.feed_mm_s is None else "G1"
    return ""


# ---- what goes on


def after_line(state: State, machine: Machine) -> State:
    """After a line by hand all goes on but G41, for which the lines that follow must be known."""
    modal = replace(state.modal, planar=None, side=Side.RIGHT, outputs=UNSAID, cutter=None)
    origins = replace(state.origins, written=MappingProxyType({}))
    left = State(modal)._replace(
        **{name: getattr(state, name) for name in State._fields if name not in (*_OF_THE_TEXT, "modal")}
    )
    return left._replace(side="G40", radius_tool=0, cleared=state.cleared).with_origins(origins, machine)


def after_program(state: State, machine: Machine) -> State:
    """After M2, M30 or the end of the file: RS-274/NGC 3.6.1; as Fanuc's, the cleared state.

    G54, G17, G90, G94, G40, the overrides on, spindle and coolant off, G1; F must be said anew, as
    LinuxCNC has it, length and unit stay.
    """
    if machine.dialect == "fanuc":
        return cleared(state, machine)
    first, left = power_on(), after_line(state, machine)
    modal = replace(
        left.modal,
        plane=first.modal.plane,
        overrides=first.modal.overrides,
        spindle_rev_min=0.0,
        coolant=0,
        feed_mm_s=None,
    )
    left = left._replace(modal=modal, motion="G1", cycle=None, absolute=True, inverse=False, per_turn=False)
    left = left._replace(turn_feed=None, feed_deg_s=None, turning=0, parameters=())
    left = left._replace(begun=None, curve_goes=None, offset_number=None, length_number=None)
    return left.with_origins(replace(_default(left.origins), aside=left.origins.aside), machine)


def after_stop(state: State, machine: Machine) -> State:
    """After a stop, a fault or an e-stop: spindle and coolant are off, what the codes mean stays.

    What the next line was to go on with is over: a canned cycle, a curve, half a plane.
    """
    left = after_line(state, machine)
    left = left._replace(turning=0, cycle=None, curve_goes=None, begun=None)
    return left._replace(modal=replace(left.modal, spindle_rev_min=0.0, coolant=0))


def cleared(state: State, machine: Machine) -> State:
    """The state of power-on, with unit and tool as they are: a reset on controls as Fanuc's."""
    left = power_on()._replace(mm_per_unit=state.mm_per_unit, selected=state.selected)
    modal = replace(left.modal, tool=state.modal.tool)
    return left._replace(modal=modal).with_origins(_default(state.origins), machine)


def _default(origins: Origins) -> Origins:
    """G54 and G69; a shift of G92 stays."""
    outside = origins.outside()
    return Origins(shift=outside.shift, suspended=outside.suspended)


# ---- as JSON


def to_json(state: State) -> dict[str, Any]:
    """Without loss, but for what belongs to one text alone."""
    plain: dict[str, Any] = _plain(state)
    return plain


def from_json(values: Any) -> State:
    """Raises KeyError, TypeError or ValueError for anything but what ``to_json`` makes."""
    state: State = _made(State, values)
    return state


def _names(kind: Any) -> list[str]:
    names = kind._fields if hasattr(kind, "_fields") else [field.name for field in fields(kind)]
    return [name for name in names if name not in (*_OF_THE_TEXT, *_FOUND_AGAIN)]


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value) or hasattr(value, "_fields"):
        return {name: _plain(getattr(value, name)) for name in _names(type(value))}
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, tuple | list) else value


def _made(kind: Any, value: Any) -> Any:
    if get_origin(kind) in (types.UnionType, typing.Union):
        inner = next(one for one in get_args(kind) if one is not types.NoneType)
        return None if value is None else _made(inner, value)
    if get_origin(kind) is tuple:
        kinds = get_args(kind)
        return tuple(_made(kinds[0 if kinds[-1] is ... else i], one) for i, one in enumerate(value))
    if get_origin(kind) is Mapping:
        key, one = get_args(kind)
        return {key(name): _made(one, part) for name, part in value.items()}
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        hints, later = _HINTS.get(kind) or get_type_hints(kind), _LATER.get(kind, ())
        names = [name for name in _names(kind) if name in value or name not in later]
        return kind(**{name: _made(hints[name], value[name]) for name in names})
    if kind is Any:  # of numbers that may be numpy's elsewhere
        return tuple(value) if isinstance(value, list) else value
    return kind(value)


# What a state lacks that an earlier version has written: it is as by default.
_LATER = {
    Cycle: ("mm_per_unit",),
    State: (
        *("parameters", "length_code", "polar"),
        *("begun", "curve_goes", "offset_number", "length_number"),
    ),
    Origins: ("following", "mirror", "aside"),
}
# Resolved once: these name one another.
_HINTS = {kind: get_type_hints(kind) for kind in (State, Modal, Origins, Plane, Cycle)}


K = TypeVar("K")


def changes_between(before: State, after: State) -> tuple[Change, ...]:
    """From the state before a line to the one after it."""
    if before is after:
        return ()
    old, new = before.origins, after.origins
    made: list[Change] = []
    if new.written is not old.written:
        made += [Change("offsets", KEPT_OFFSETS[i], new.written[i]) for i in _fresh(old.written, new.written)]
    if (new.shift, new.suspended) != (old.shift, old.suspended):
        made.append(Change("shift", "G92", Shifted(new.shift, new.suspended)))
    if after.tools is not before.tools:
        made += [Change("tools", str(n), after.tools[n]) for n in _fresh(before.tools, after.tools)]
    if after.references is not before.references:
        made += [
            Change("references", code, tuple([q or 0.0 for q in after.references[code]]))
            for code in _fresh(before.references, after.references)
        ]
    return tuple(made)


def parameter_changes(values: Mapping[int, float]) -> tuple[Change, ...]:
    return tuple(Change("parameters", str(number), value) for number, value in values.items())


def _fresh(before: Mapping[K, Any], after: Mapping[K, Any]) -> list[K]:
    """The keys whose values are new; one that is set to what it was is set, too."""
    return [key for key, value in after.items() if before.get(key) is not value]


KEEP, FORGET, GIVE_BACK, KEEP_FOR_SUB = 70.0, 71.0, 72.0, 73.0
GIVEN_BACK = (
    *("mm_per_unit", "side", "absolute", "speed_rev_min", "turning", "feed_deg_s", "inverse", "per_turn"),
    *("turn_feed", "centres_absolute", "to_clearance"),
)
CODES = (KEEP, FORGET, GIVE_BACK, KEEP_FOR_SUB)


class Saved:
    """What is kept in one run of a program."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._kept: dict[int, State] = {}  # by the number of the call

    def carry_out(self, line: Line, state: State) -> tuple[State, list[Block], Line]:
        """The state, what it does to the machine, and the line without these codes."""
        words = [word for word in line.words if word.letter == "M" and word.value in CODES]
        if not words:
            return state, [], line
        if len(words) > 1:
            raise line.refusal(words[1], "saved.two", first=words[0].text)
        (word,), made = words, list[Block]()
        for ended in [call for call in self._kept if call > line.sub]:
            del self._kept[ended]
        if word.value in (KEEP, KEEP_FOR_SUB):
            self._kept[line.sub] = state
        elif word.value == FORGET:
            self._kept.pop(line.sub, None)
        elif line.sub not in self._kept:
            raise line.refusal(word, "saved.none")
        else:
            state, made = _given_back(line, word, state, self._kept[line.sub], self._machine)
        return state, made, line.with_words(tuple(one for one in line.words if one is not word))


def _given_back(
    line: Line, word: Word, now: State, kept: State, machine: Machine
) -> tuple[State, list[Block]]:
    """Of the kept state what LinuxCNC keeps: neither the motion mode nor what stands behind the offsets."""
    modal = replace(kept.modal, tool=now.modal.tool, cutter=now.modal.cutter, outputs=now.modal.outputs)
    state = now._replace(modal=modal, **{name: getattr(kept, name) for name in GIVEN_BACK})
    state = state.with_origins(replace(now.origins, index=kept.origins.index), machine)
    place, made = line.place(word.column), list[Block]()
    if modal.spindle_rev_min != now.modal.spindle_rev_min:
        made.append(Action(place, state.modal, Act.SPINDLE))
    if modal.coolant != now.modal.coolant:
        made.append(Action(place, state.modal, Act.COOLANT))
    return state, made
