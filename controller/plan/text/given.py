"""What the control says of itself by parameters: LinuxCNC's predefined ones, numbered and named.

The reader is ahead of the machine, so positions are those of the program: where its last move
ends. Where that cannot be known (before the first move of an axis, behind a surface, whose
departure is the controller's) they have no value, and a program that asks for one is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

from controller.geometry import Frame, Vector, add, subtract
from controller.machine import Machine
from controller.plan.text.modal import State
from controller.plan.text.parameters import Key, NoValue
from controller.plan.text.program import (
    Action,
    Block,
    Dwell,
    JointArc,
    JointLine,
    Message,
    Remark,
    Tip,
    TipLine,
)

LETTERS = "xyzabcuvw"  # of positions, in the order of their numbers
FIRST_OFFSET, OFFSET_STEP = 5221, 20  # G54's X, and from one work offset to the next
_OFFSETS = range(5221, 5391)
_TOOL_OFFSETS, _POSITIONS = range(5401, 5410), range(5420, 5429)
_TOOL, _DIAMETER, _SYSTEM = 5400, 5410, 5220
_DEGREES = frozenset("abc")


class Given:
    """The state of a program at the line that is read next."""

    def __init__(self, machine: Machine, state: State) -> None:
        self.state = state
        self._machine = machine
        self._where: dict[str, float | None] = {}  # of axes, mm and shown degrees; None: unknown
        self._tip: list[float | None] = [None, None, None]  # under G43.4 and G43.5, part frame, mm

    # ---- positions

    def moved(self, block: Block) -> None:
        """A block of the program has been read."""
        if isinstance(block, JointLine | JointArc):
            self._tip = [None, None, None]
            self._move(block)
        elif isinstance(block, TipLine):
            self._move_tip(block)
        elif not isinstance(block, Action | Dwell | Remark | Message):
            self._where, self._tip = {}, [None, None, None]

    def _move(self, block: JointLine | JointArc) -> None:
        in_machine = isinstance(block, JointLine) and block.machine_frame
        frame = Frame() if in_machine else self._machine.offsets[block.modal.offset]
        length = 0.0 if in_machine else block.modal.length_mm
        linear = self._machine.linear()
        for i, (axis, value) in enumerate(zip(self._machine.axes, block.targets, strict=True)):
            if value is not None and i not in linear:
                shown = value * axis.shown_per_unit
                before = self._where.get(axis.name)
                self._where[axis.name] = _plus(before, shown) if block.relative else shown
        words = [block.targets[i] for i in linear]
        if any(word is not None for word in words):
            self._move_linear(words, block.relative, frame, length)

    def _move_tip(self, block: TipLine) -> None:
        rotary = [self._machine.axes[i] for i in self._machine.rotary()]
        turned = {axis.name: self._where.get(axis.name) for axis in rotary}
        for axis, value in zip(rotary, block.rotaries, strict=True):
            if value is not None:
                shown = value * axis.shown_per_unit
                turned[axis.name] = _plus(turned[axis.name], shown) if block.relative else shown
        self._where = {} if block.axis is not None else turned
        for i, value in enumerate(block.tip):
            if value is not None:
                self._tip[i] = _plus(self._tip[i], value) if block.relative else value

    def _move_linear(self, words: list[float | None], relative: bool, frame: Frame, length: float) -> None:
        here = self._linear()
        if relative:
            way = frame.turn(_whole([word or 0.0 for word in words]))
            there: list[float | None] = [_plus(q, d) for q, d in zip(here, way, strict=True)]
        elif frame[1:] == Frame()[1:]:
            ups = (0.0, 0.0, length)
            there = [
                q if word is None else word + origin + up
                for q, word, origin, up in zip(here, words, frame.origin, ups, strict=True)
            ]
        else:
            there = self._placed(words, here, frame, length)
        for i, value in zip(self._machine.linear(), there, strict=True):
            self._where[self._machine.axes[i].name] = value

    @staticmethod
    def _placed(
        words: list[float | None], here: list[float | None], frame: Frame, length: float
    ) -> list[float | None]:
        """In a part frame that is turned an axis without a word needs to be known with the others."""
        up = (0.0, 0.0, length)
        if any(word is None for word in words):
            if any(q is None for q in here):
                return [None, None, None]
            part = frame.from_parent(subtract(_whole(here), up))
            words = [p if word is None else word for p, word in zip(part, words, strict=True)]
        return list(add(frame.to_parent(_whole(words)), up))

    def _linear(self) -> list[float | None]:
        return [self._where.get(self._machine.axes[i].name) for i in self._machine.linear()]

    def _position(self, letter: str, key: Key) -> float:
        """Of an axis in program coordinates and the active unit; 0 of one that the machine does not have."""
        if letter not in "xyz" and letter.upper() not in (axis.name for axis in self._machine.axes):
            return 0.0
        found = self._in_part(letter)
        if found is None:
            raise NoValue(
                f"{_written(key)} is the position of {letter.upper()}, which is not known here: the reader "
                "is ahead of the machine and knows what the program's own moves say, not where it starts "
                "nor where a surface leaves the tool; move the axis with G0 or G1 before"
            )
        return found if letter in _DEGREES else found / self.state.mm_per_unit

    def _in_part(self, letter: str) -> float | None:
        if letter not in "xyz":
            return self._where.get(letter.upper())
        i, modal = "xyz".index(letter), self.state.modal
        if modal.tip is not Tip.OFF:
            return self._tip[i]
        here, frame = self._linear(), self._machine.offsets[modal.offset]
        if frame[1:] != Frame()[1:]:
            known = all(q is not None for q in here)
            up = (0.0, 0.0, modal.length_mm)
            return frame.from_parent(subtract(_whole(here), up))[i] if known else None
        q = here[i]
        return None if q is None else q - frame.origin[i] - (modal.length_mm if i == 2 else 0.0)

    def _of_machine(self, letter: str, key: Key) -> float:
        if letter.upper() not in (axis.name for axis in self._machine.axes):
            return 0.0
        if (found := self._where.get(letter.upper())) is None:
            raise NoValue(
                f"{_written(key)} is a position of the machine that the program's own moves do not tell "
                "here; move the axis with G0 or G1 before"
            )
        return found if letter in _DEGREES else found / self.state.mm_per_unit

    # ---- by number and name

    def value(self, key: Key) -> float | None:
        """Of one of LinuxCNC's predefined parameters; None of any other. Raises NoValue."""
        if isinstance(key, int):
            return self._numbered(key)
        if (found := _NAMED.get(key)) is not None:
            return found(self)
        if len(key) == 2 and key[1] in LETTERS:
            return self._position(key[1], key)
        if len(key) == 6 and key.startswith("_abs_") and key[5] in LETTERS:
            return self._of_machine(key[5], key)
        return None

    def _numbered(self, key: int) -> float | None:
        if key in _POSITIONS:
            return self._position(LETTERS[key - _POSITIONS.start], key)
        if key in _OFFSETS:
            return self._offset(*divmod(key - FIRST_OFFSET, OFFSET_STEP))
        if key in _TOOL_OFFSETS:
            return self.length if key - _TOOL_OFFSETS.start == LETTERS.index("z") else 0.0
        return {_TOOL: float(self.state.modal.tool), _DIAMETER: self.diameter, _SYSTEM: self.system}.get(key)

    def _offset(self, system: int, letter: int) -> float:
        """Of G54 to G59.3 and X Y Z; the turn of a part frame is not told by LinuxCNC's numbers."""
        if system >= len(self._machine.offsets) or letter > 2:
            return 0.0
        origin: tuple[float, ...] = self._machine.offsets[system].origin
        return origin[letter] / self.state.mm_per_unit

    @property
    def length(self) -> float:
        """Of the tool in the spindle, as its table has it."""
        tool = self._machine.tool(self.state.modal.tool)
        return tool.length_mm / self.state.mm_per_unit if tool is not None else 0.0

    @property
    def diameter(self) -> float:
        tool = self._machine.tool(self.state.modal.tool)
        return 2.0 * tool.radius_mm / self.state.mm_per_unit if tool is not None else 0.0

    @property
    def system(self) -> float:
        """1 is G54."""
        return float(self.state.modal.offset + 1)

    @property
    def coordinate_code(self) -> float:
        """540, 550 ... 590, 591, 592, 593: ten times the code."""
        offset = self.state.modal.offset
        return 540.0 + 10.0 * offset if offset < 6 else 585.0 + offset


def _plus(a: float | None, b: float) -> float | None:
    return None if a is None else a + b


def _whole(values: list[float | None] | list[float]) -> Vector:
    x, y, z = (value if value is not None else 0.0 for value in values)
    return x, y, z


def _written(key: Key) -> str:
    return f"#<{key}>" if isinstance(key, str) else f"#{key}"


def _code(code: str) -> float:
    """Ten times the number of a code, as LinuxCNC tells it."""
    return round(10.0 * float(code[1:])) if code else 800.0


def _feed(given: Given) -> float:
    """The number of the last F, whatever unit is active now."""
    return (given.state.feed_deg_s or 0.0) * 60.0


_NAMED: MappingProxyType[str, Callable[[Given], float]] = MappingProxyType(
    {
        "_metric": lambda g: float(g.state.mm_per_unit == 1.0),
        "_imperial": lambda g: float(g.state.mm_per_unit != 1.0),
        "_absolute": lambda g: float(g.state.absolute),
        "_incremental": lambda g: float(not g.state.absolute),
        "_inverse_time": lambda g: float(g.state.inverse),
        "_units_per_minute": lambda g: float(not g.state.inverse),
        "_units_per_rev": lambda g: 0.0,
        "_coord_system": lambda g: g.coordinate_code,
        "_plane": lambda g: _code(g.state.plane),
        "_motion_mode": lambda g: _code(g.state.motion),
        "_ccomp": lambda g: _code(g.state.side),
        "_tool_offset": lambda g: float(g.state.modal.length_mm != 0.0 or g.state.modal.tip is not Tip.OFF),
        "_feed": _feed,
        "_rpm": lambda g: g.state.speed_rev_min,
        "_spindle_on": lambda g: float(g.state.turning != 0),
        "_spindle_cw": lambda g: float(g.state.turning > 0),
        "_spindle_rpm_mode": lambda g: 1.0,
        "_spindle_css_mode": lambda g: 0.0,
        "_mist": lambda g: float(g.state.modal.coolant & 1 != 0),
        "_flood": lambda g: float(g.state.modal.coolant & 2 != 0),
        "_current_tool": lambda g: float(g.state.modal.tool),
        "_current_pocket": lambda g: float(g.state.modal.tool),
        "_selected_tool": lambda g: float(-1 if g.state.selected is None else g.state.selected),
        "_selected_pocket": lambda g: float(-1 if g.state.selected is None else g.state.selected),
        "_ijk_absolute_mode": lambda g: 0.0,
        "_lathe_diameter_mode": lambda g: 0.0,
        "_lathe_radius_mode": lambda g: 0.0,
        "_feed_override": lambda g: 1.0,
        "_speed_override": lambda g: 1.0,
        "_adaptive_feed": lambda g: 0.0,
        "_feed_hold": lambda g: 0.0,
        "_remap_level": lambda g: 0.0,
        "_task": lambda g: 1.0,
    }
)
