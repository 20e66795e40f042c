"""System variables of Fanuc's custom macros, as far as they are known where a program is read.

Numbers and meanings are of Fanuc's operator's manual B-64484EN (series 30i, 16.2 system variables) and, for
tool offsets that Haas numbers otherwise, of Haas' operator's manual of mills (NGC, macros). Axes are counted
in the order of the machine file. Lengths are in the active unit.

    #1000 #1100         inputs (``read_on`` and ``read_off`` of [io]), outputs, by P of M66 and of M64
    #2001 ... #2800     tool offsets, by ``macro_variables`` of [machine]: Fanuc's memory C, or Haas'
    #3000 #3006         alarm, and stop with a message
    #3003 #3004 #3901   single block, holds, parts: what is written is kept, and does nothing
    #4001 ... #4130     modal codes (also #4201, #4401) and words
    #5001 #5021 #5041   positions: of the program, of the machine, of the program
    #5061 #5081         where the last skip was, the tool's offset
    #5201 #5221 ...     external offset (always 0), work offsets; #5521 vectors of G54.2
    #7001 #14001        work offsets of G54.1
    #10001 ... #13400   wear and geometry of H, then of D

What is only known while a program runs (clocks, inputs, loads) has no value here, and is refused with what to
write instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

from controller.geometry.vectors import Vector
from controller.machine.changes import Change
from controller.machine.model import MAX_WEAR_MM, OFFSETS, Machine, Offset
from controller.messages import Message, message
from controller.program import carried
from controller.program.given import LETTERS, Given
from controller.program.modal import State
from controller.program.offset_words import is_sound, with_radius
from controller.program.origins import fixture_index
from controller.program.parameters import ALARM, INPUTS, OUTPUTS, STOP, NoValue

FIRST = 1000
OURS = (  # as LinuxCNC has them
    *(range(5070, 5071), range(5161, 5200), range(5210, 5221), range(5390, 5500), range(5590, 6000)),
)
STEP = 20  # from one work offset to the next
NOTED = MappingProxyType(
    {3003: "note.single_block", 3004: "note.holds", 3901: "note.parts", 3902: "note.parts"}
)
_AT_RUN = (  # what is known only in the run, or not kept: M, N and O of the line before
    (range(INPUTS, OUTPUTS), "value.system_inputs"),
    (range(OUTPUTS, 1200), "value.system_outputs"),
    *(
        (clocks, "value.system_clocks")
        for clocks in (range(3001, 3003), range(3011, 3013), range(3020, 3030))
    ),
    (range(4113, 4116), "value.system_lines"),
    (range(5101, 5106), "value.system_following"),
)
_MODAL_STARTS = (4001, 4201, 4401)
_WORD_STARTS = (4101, 4301, 4501)


class Field(NamedTuple):
    """What a range of numbers, one a tool, is of it."""

    name: str
    per: float = 1.0  # what is written, of the field: a diameter is twice a radius


_LENGTH, _RADIUS = Field("length_mm"), Field("radius_mm")
_WEAR, _RADIUS_WEAR = Field("wear_length_mm"), Field("wear_radius_mm")
_TOOLS: tuple[tuple[range, Field], ...] = (
    (range(10001, 10401), _WEAR),
    (range(11001, 11401), _LENGTH),
    (range(12001, 12401), _RADIUS_WEAR),
    (range(13001, 13401), _RADIUS),
)
_TOOLS_BY = MappingProxyType(
    {
        "fanuc": ((range(2001, 2201), _WEAR), (range(2201, 2401), _LENGTH)),
        "haas": (
            (range(2001, 2201), _LENGTH),
            (range(2201, 2401), _WEAR),
            (range(2401, 2601), Field("radius_mm", 2.0)),
            (range(2601, 2801), Field("wear_radius_mm", 2.0)),
        ),
    }
)
_OF_ONE_OF_THEM = range(2001, 2801)


class SystemVariables:
    """Those of one run of a program."""

    def __init__(self, machine: Machine, given: Given) -> None:
        self._machine, self._given = machine, given
        self._plain: dict[int, float] = {}  # what was written and does nothing
        self.asks: dict[int, float] = {}  # ALARM or STOP of the line that is read
        self.notes: list[Message] = []
        self.changes: list[Change] = []
        self.reads: dict[int, bool] = {}
        self.is_modal_call = False  # G66
        axes = [axis.name.lower() for axis in machine.axes]
        self._axes = dict(enumerate(axes, start=1))

    def has(self, key: int) -> bool:
        """Whether a number means something of the control here."""
        return key >= FIRST and not any(key in one for one in OURS)

    # ---- reading

    def value(self, key: int) -> float:
        """Raises NoValue."""
        for read in (self._input, self._modal, self._word, self._position, self._offset, self._of_tool):
            if (found := read(key)) is not None:
                return found
        if key in NOTED or key == 3007:
            return self._plain.get(key, 0.0)
        raise self._none(key)

    def _none(self, key: int) -> NoValue:
        """Why a number has no value."""
        if key in (ALARM, STOP):
            return NoValue("value.only_written", number=key)
        for numbers, why in _AT_RUN:
            if key in numbers:
                return NoValue(why, number=key)
        if key in _OF_ONE_OF_THEM and not self._machine.macro_variables:
            return NoValue("value.system_builder", number=key)
        return NoValue("value.system", number=key)

    def _input(self, key: int) -> float | None:
        """As ``read_on`` and ``read_off`` of [io] say that it will be."""
        io, number = self._machine.io, key - INPUTS
        if io is None or not 0 <= number < len(io.digital_in):
            return None
        if (on := io.read_as(number)) is not None:
            self.reads[number] = on
        return None if on is None else float(on)

    def _is_output(self, key: int) -> bool:
        io = self._machine.io
        return io is not None and 0 <= key - OUTPUTS < len(io.digital_out)

    def _modal(self, key: int) -> float | None:
        groups = _MODAL_OF_HAAS if self._machine.macro_variables == "haas" else _MODAL
        for start in _MODAL_STARTS:
            if (code := groups.get(key - start + 1)) is not None and key >= start:
                return (66.0 if self.is_modal_call else 67.0) if code is _macro else code(self._given.state)
        return None

    def _word(self, key: int) -> float | None:
        for start in _WORD_STARTS:
            if (word := _WORDS.get(key - start + 1)) is not None and key >= start:
                return word(self._given.state)
        return None

    def _position(self, key: int) -> float | None:
        for start, name in ((5001, "_{}"), (5041, "_{}"), (5021, "_abs_{}")):
            if key - start + 1 in self._axes and key >= start:
                return self._given.value(name.format(self._axes[key - start + 1]))
        if (axis := self._axes.get(key - 5060)) is not None:
            return self._given.value(5061 + LETTERS.index(axis))
        if 5081 <= key <= 5100:
            length = self._given.state.modal.length_mm if self._axes.get(key - 5080) == "z" else 0.0
            return length / self._unit
        return None

    @property
    def _unit(self) -> float:
        return self._given.state.mm_per_unit

    def _offset(self, key: int) -> float | None:
        """Of a work offset, or a vector of G54.2; 0 of the external one."""
        if 5201 <= key <= 5200 + len(self._axes):
            return 0.0
        if key == 5500:
            following = self._given.state.origins.following
            return float(following.number if following is not None else 0)
        if (found := self._offset_of(key)) is None:
            return None
        index, axis = found
        offset = self._given.state.origins.offset(index, self._machine)
        if axis in "xyz":
            return float(offset.frame.origin["xyz".index(axis)]) / self._unit
        k, per = self._rotary(axis)
        return offset.turned_rad[k] * per

    def _offset_of(self, key: int) -> tuple[int, str] | None:
        """The offset that a number is of, as ``KEPT_OFFSETS`` counts, and its axis."""
        starts = ((5221, 0, 6), (7001, 9, 48), (14001, 9, 48), (5521, fixture_index(1), 8))
        for start, first, count in starts:
            n, k = divmod(key - start, STEP)
            if 0 <= n < count and k + 1 in self._axes:
                return first + n, self._axes[k + 1]
        return None

    def _rotary(self, axis: str) -> tuple[int, float]:
        """Which of the rotaries an axis is, and degrees as shown of its radians."""
        rows = [self._machine.axes[i] for i in self._machine.rotary()]
        k = next(k for k, row in enumerate(rows) if row.name.lower() == axis)
        return k, rows[k].shown_per_unit

    def _tool_of(self, key: int) -> tuple[int, Field] | None:
        for numbers, field in (*_TOOLS, *_TOOLS_BY.get(self._machine.macro_variables, ())):
            if key in numbers:
                return key - numbers.start + 1, field
        return None

    def _of_tool(self, key: int) -> float | None:
        if (found := self._tool_of(key)) is None:
            return None
        number, field = found
        tool = self._given.state.table_tool(number, self._machine)
        return 0.0 if tool is None else float(getattr(tool, field.name)) * field.per / self._unit

    # ---- writing

    def check_settable(self, key: int) -> None:
        """Raises NoValue for what a program cannot write."""
        if key in (ALARM, STOP) or key in NOTED or 5201 <= key <= 5200 + len(self._axes):
            return
        if self._is_output(key):
            return
        if self._offset_of(key) is not None or self._tool_of(key) is not None:
            planar = self._given.state.modal.planar
            if planar is not None and planar.lines:
                raise NoValue("value.system_beside", number=key, code=planar.code)
            return
        known = self._modal(key) is not None or self._word(key) is not None
        if known or 5001 <= key <= 5160 or key == 5500:
            raise NoValue("value.system_read", number=key)
        raise self._none(key)

    def set(self, key: int, value: float) -> None:
        """Carry out what a number is written for. Raises NoValue."""
        if key in (ALARM, STOP) or self._is_output(key):
            self.asks[key] = value
        elif key in NOTED:
            self._plain[key] = value
            self.notes.append(message(NOTED[key], number=key))
        elif (offset := self._offset_of(key)) is not None:
            self._set_offset(*offset, value)
        elif (tool := self._tool_of(key)) is not None:
            self._set_tool(key, *tool, value)
        elif value != 0.0:
            raise NoValue("value.system_external", number=key)

    def _set_offset(self, index: int, axis: str, value: float) -> None:
        state = self._given.state
        offset = state.origins.offset(index, self._machine)
        if axis in "xyz":
            xyz = list(offset.frame.origin)
            xyz["xyz".index(axis)] = value * self._unit
            origin: Vector = (xyz[0], xyz[1], xyz[2])
            offset = replace(offset, frame=offset.frame._replace(origin=origin))
        else:
            k, per = self._rotary(axis)
            turned = list(offset.turned_rad)
            turned[k] = value / per
            offset = Offset(offset.frame, (turned[0], turned[1]))
        self._take(state.with_origins(state.origins.with_offset(index, offset), self._machine))

    def _set_tool(self, key: int, number: int, field: Field, value: float) -> None:
        state = self._given.state
        tool = state.table_tool(number, self._machine)
        if tool is None:
            raise NoValue("value.system_no_tool", number=key, tool=number)
        written = value * self._unit / field.per
        worn = field.name.startswith("wear")
        values: dict[str, Any] = {field.name: written}
        changed = with_radius(tool, written) if field.name == "radius_mm" else replace(tool, **values)
        if not is_sound(changed):
            most = MAX_WEAR_MM if worn else 0.0
            raise NoValue("value.system_wear" if worn else "value.system_radius", number=key, most=most)
        self._take(state.with_table_tool(changed, self._machine))

    def _take(self, state: State) -> None:
        self.changes += carried.changes_between(self._given.state, state)
        self._given.state = state


# ---- modal codes and words, as B-64484EN counts their groups


def _number(code: str) -> float:
    return float(code[1:])


def _motion(state: State) -> float:
    """Group 1; under a cycle what was modal before it."""
    motion = state.beneath if state.cycle is not None else state.motion
    return _number(motion) if motion else 0.0


def _cycle(state: State) -> float:
    return _number(state.motion) if state.cycle is not None else 80.0


def _work_offset(state: State) -> float:
    index = state.modal.offset
    return 54.0 + index if index < 6 else 59.0 + (index - 5) / 10.0 if index < 9 else 54.1


def _turned(state: State) -> float:
    return 68.2 if state.modal.tilted else 68.0 if state.origins.turn is not None else 69.0


def _macro(state: State) -> float:
    """Of the flow of the program, not of its state."""
    raise NotImplementedError


def _feed(state: State) -> float:
    if state.per_turn:
        return state.turn_feed[0] / state.mm_per_unit if state.turn_feed is not None else 0.0
    return (state.modal.feed_mm_s or 0.0) * 60.0 / state.mm_per_unit


def _numbered(state: State) -> float:
    """P of G54.1, 0 of any other."""
    name = OFFSETS[state.modal.offset]
    return float(name.partition("P")[2] or 0.0)


_MODAL: MappingProxyType[int, Callable[[State], float]] = MappingProxyType(
    {
        1: _motion,
        2: lambda s: _number(s.modal.plane),
        3: lambda s: 90.0 if s.absolute else 91.0,
        4: lambda s: 23.0,
        5: lambda s: 93.0 if s.inverse else 95.0 if s.per_turn else 94.0,
        6: lambda s: 21.0 if s.mm_per_unit == 1.0 else 20.0,
        7: lambda s: _number(s.side),
        8: lambda s: _number(s.length_code),
        9: _cycle,
        10: lambda s: 99.0 if s.to_clearance else 98.0,
        11: lambda s: 50.0,
        12: _macro,
        13: lambda s: 97.0,
        14: _work_offset,
        15: lambda s: 61.0 if s.modal.exact_joints else 64.0,
        16: _turned,
        17: lambda s: 15.0 if s.polar is None else 16.0,
        22: lambda s: 50.1 if s.origins.mirror is None else 51.1,
    }
)
# Haas counts its work offsets as group 12 (mill operator's manual, list of G codes), and has no group 14.
_MODAL_OF_HAAS = MappingProxyType({**_MODAL, 12: _work_offset, 14: None})
_WORDS: MappingProxyType[int, Callable[[State], float]] = MappingProxyType(
    {
        7: lambda s: float(s.radius_tool),
        9: _feed,
        11: lambda s: float(s.length_tool),
        19: lambda s: s.speed_rev_min,
        20: lambda s: float(s.modal.tool if s.selected is None else s.selected),
        30: _numbered,
    }
)
