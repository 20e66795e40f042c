"""What the control says of itself by parameters: LinuxCNC's predefined ones, numbered and named.

The reader is ahead of the machine, so positions are those of the program: where its last move
ends. Where that cannot be known (behind a surface, whose departure is the controller's) they have
no value, and a program that asks for one is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from types import MappingProxyType

from controller.geometry.vectors import Vector
from controller.machine.model import Machine, Sensor
from controller.messages import Key, message
from controller.program.line import Line
from controller.program.modal import State
from controller.program.motion_words import reference
from controller.program.origins import NONE
from controller.program.parameters import Name, NoValue, written
from controller.program.position import Position
from controller.program.program import Block, JointLine, Tip, TipLine

LETTERS = "xyzabcuvw"  # of positions, in the order of their numbers
FIRST_OFFSET, OFFSET_STEP = 5221, 20  # G54's X, and from one work offset to the next
_OFFSETS = range(5221, 5391)
_REFERENCES = {"G28": range(5161, 5170), "G30": range(5181, 5190)}
_SHIFT, _TOOL_OFFSETS, _POSITIONS = range(5211, 5220), range(5401, 5410), range(5420, 5429)
_TOOL, _DIAMETER, _SYSTEM, _SHIFTED = 5400, 5410, 5220, 5210
_ANSWER = 5399
_PROBED, _SUCCEEDED = range(5061, 5070), 5070
_TURN = 9  # number of R behind the nine letters of a work offset
_DEGREES = frozenset("abc")
UPRIGHT_DEG = 0.01  # a rotary above the tool setter stands at 0: its face is 2 um off at 10 mm


class Given:
    """The state of a program at the line that is read next."""

    def __init__(self, machine: Machine, state: State, position: Position) -> None:
        self.state, self.position = state, position
        self._machine = machine
        self._probed: dict[str, float | None] = {}  # of the last probing move, as ``_in_part``
        self._probed_z, self._touched = 0.0, False  # of the machine; whether that move was made
        self._succeeded = 0.0

    # ---- probing

    def see_probed(self, made: Sequence[Block], line: Line) -> bool:
        """Whether the line has probed; then reading goes on from where the axes are. Raises ProgramError."""
        last = made[-1] if made else None
        probe = last.probe if isinstance(last, JointLine | TipLine) else None
        if probe is None:
            return False
        came, position = probe.came, self.position
        if came is not None:
            position.stand(came.at)
        self._probed = {letter: self._in_part(letter) for letter in LETTERS[:6]}
        self._probed_z, self._touched = self._joint("z") or 0.0, came is not None and came.touched
        self._succeeded = float(came is None or came.touched)
        if came is not None:
            position.stand(came.rest)
            if probe.must and not came.touched:
                code = next(word for word in line.words if word.letter == "G")
                key = "probe.not_free" if probe.away else "probe.not_touched"
                raise line.refusal(code, key, code=probe.code)
        return True

    def _of_probing(self, key: int) -> float:
        letter = LETTERS[key - _PROBED.start]
        found = self._probed.get(letter, 0.0)
        if found is None:
            raise _unknown(key, letter)
        return found if letter in _DEGREES else found / self.state.mm_per_unit

    @property
    def probed_z(self) -> float:
        """Of the machine, mm: where the last probing move was."""
        return self._probed_z

    @property
    def touched(self) -> float:
        """1 where the last probing move has touched; 0 in a check, where it is taken to have."""
        return float(self._touched)

    # ---- the tool setter

    def setter_radius(self) -> float:
        """Of its face, mm. Raises NoValue."""
        return self._setter("_setter_radius").radius_mm

    def setter_z(self) -> float:
        """How high its face lies, mm: where the tool stands above it. Raises NoValue."""
        setter = self._setter("_setter_z")
        x, y = (self._of_machine(letter, "_setter_z") * self.state.mm_per_unit for letter in "xy")
        turned = max(abs(self._of_machine(letter, "_setter_z")) for letter in "abc")
        off = math.hypot(x - setter.point[0], y - setter.point[1])
        if off > setter.radius_mm or turned > UPRIGHT_DEG:
            values = {"off": off, "most": setter.radius_mm, "turned": turned}
            place = {"x": setter.point[0], "y": setter.point[1]}
            raise NoValue("value.not_above", **{"name": "#<_setter_z>", **values, **place})
        z: float = setter.point[2]
        return z

    def touch_radius(self) -> float:
        """Of what touches, mm: of the probe's ball, or above the tool setter of the tool. Raises NoValue.

        Any other tool would be led into the part, and nothing would tell.
        """
        tool, probe = self.state.modal.tool, self._machine.probe
        if probe is None or tool != probe.tool:
            try:
                self.setter_z()
            except NoValue:
                known = Key("probe.is_none") if probe is None else message("probe.is_tool", number=probe.tool)
                raise NoValue("value.no_probe", name="#<_touch_radius>", tool=tool, known=known) from None
        return self.diameter / 2.0

    def _setter(self, name: str) -> Sensor:
        if (setter := self._machine.setter) is None:
            raise NoValue("value.no_setter", name=f"#<{name}>")
        return setter

    # ---- positions

    def _position(self, letter: str, key: Name) -> float:
        """Of an axis in program coordinates and the active unit; 0 of one that the machine does not have."""
        if letter not in "xyz" and letter.upper() not in (axis.name for axis in self._machine.axes):
            return 0.0
        found = self._in_part(letter)
        if found is None:
            raise _unknown(key, letter)
        return found if letter in _DEGREES else found / self.state.mm_per_unit

    def _in_part(self, letter: str) -> float | None:
        """Of a linear axis in mm, of a rotary in degrees as shown."""
        if letter not in "xyz":
            return self._joint(letter, self.state.modal.turned_rad)
        return self.position.in_frame(self.state.modal)["xyz".index(letter)]

    def _joint(self, letter: str, shifts: Sequence[float] = ()) -> float | None:
        """Of the machine, or less the ``shifts`` of the rotaries; linear axes in mm, rotaries as shown."""
        off = dict(zip(self._machine.rotary(), shifts, strict=False))
        for i, (axis, q) in enumerate(zip(self._machine.axes, self.position.joints(), strict=True)):
            if axis.name == letter.upper() and q is not None:
                return (q - off.get(i, 0.0)) * axis.shown_per_unit
        return None

    def _of_machine(self, letter: str, key: Name) -> float:
        if letter.upper() not in (axis.name for axis in self._machine.axes):
            return 0.0
        if (found := self._joint(letter)) is None:
            raise _unknown(key, letter)
        return found if letter in _DEGREES else found / self.state.mm_per_unit

    # ---- by number and name

    def value(self, key: Name) -> float | None:
        """Of one of LinuxCNC's predefined parameters; None of any other. Raises NoValue."""
        if isinstance(key, int):
            return self._numbered(key)
        if (found := _NAMED.get(key)) is not None:
            return found(self)
        if len(key) == 2 and key[0] == "_" and key[1] in LETTERS:
            return self._position(key[1], key)
        if len(key) == 6 and key.startswith("_abs_") and key[5] in LETTERS:
            return self._of_machine(key[5], key)
        return None

    def _numbered(self, key: int) -> float | None:
        if key in _POSITIONS:
            return self._position(LETTERS[key - _POSITIONS.start], key)
        if key in _PROBED:
            return self._of_probing(key)
        if key == _SUCCEEDED:
            return self._succeeded
        if key == _ANSWER and self.state.answer is None:
            raise NoValue("value.at_run")
        if key == _ANSWER:
            return self.state.answer
        if key in _OFFSETS:
            return self._offset(*divmod(key - FIRST_OFFSET, OFFSET_STEP))
        if key in _SHIFT:
            shift = self.state.origins.shift
            return self._of_offset(key - _SHIFT.start, shift.xyz, shift.turned_rad)
        for code, numbers in _REFERENCES.items():
            if key in numbers:
                return self._reference(code, LETTERS[key - numbers.start], key)
        if key in _TOOL_OFFSETS:
            return self.length if key - _TOOL_OFFSETS.start == LETTERS.index("z") else 0.0
        return {
            _TOOL: float(self.state.modal.tool),
            _DIAMETER: self.diameter,
            _SYSTEM: self.system,
            _SHIFTED: float(self.state.origins.shift != NONE and not self.state.origins.suspended),
        }.get(key)

    # Offsets, reference points and tools are told in the unit of the machine file, as LinuxCNC does: mm.

    def _offset(self, system: int, number: int) -> float:
        """Of G54 to G59.3, as G10 has set it: nine letters and R, the turn about Z."""
        offset = self.state.origins.offset(system, self._machine)
        if number == _TURN:
            return math.degrees(math.atan2(offset.frame.x[1], offset.frame.x[0]))
        return self._of_offset(number, offset.frame.origin, offset.turned_rad)

    def _of_offset(self, number: int, xyz: Vector, turned_rad: tuple[float, float]) -> float:
        """A letter of a work offset or a shift; 0 of axes that the machine does not have."""
        if number < len(xyz):
            value: float = xyz[number]
            return value
        letter = LETTERS[number].upper() if number < len(LETTERS) else ""
        for i, turned in zip(self._machine.rotary(), turned_rad, strict=False):
            if self._machine.axes[i].name == letter:
                return turned * self._machine.axes[i].shown_per_unit
        return 0.0

    def _reference(self, code: str, letter: str, key: Name) -> float:
        """Of an axis, where G28 or G30 leads it."""
        for axis, value in zip(self._machine.axes, reference(self.state, self._machine, code), strict=True):
            if axis.name == letter.upper():
                if value is None:
                    raise _unknown(key, letter)
                return value * axis.shown_per_unit
        return 0.0

    @property
    def length(self) -> float:
        """Of the tool in the spindle, as its table has it, mm."""
        tool = self.state.modal.tool_in(self._machine)
        return tool.length_mm if tool is not None else 0.0

    @property
    def diameter(self) -> float:
        """Likewise."""
        tool = self.state.modal.tool_in(self._machine)
        return 2.0 * tool.radius_mm if tool is not None else 0.0

    @property
    def system(self) -> float:
        """1 is G54."""
        return float(self.state.modal.offset + 1)

    @property
    def coordinate_code(self) -> float:
        """540, 550 ... 590, 591, 592, 593: ten times the code."""
        offset = self.state.modal.offset
        return 540.0 + 10.0 * offset if offset < 6 else 585.0 + offset


def _unknown(key: Name, letter: str) -> NoValue:
    return NoValue("value.not_known", name=written(key), axis=letter.upper())


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
        "_units_per_minute": lambda g: float(not g.state.inverse and not g.state.per_turn),
        "_units_per_rev": lambda g: float(g.state.per_turn),
        "_coord_system": lambda g: g.coordinate_code,
        "_plane": lambda g: _code(g.state.modal.plane),
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
        "_ijk_absolute_mode": lambda g: float(g.state.centres_absolute),
        "_retract_r_plane": lambda g: float(g.state.to_clearance),
        "_retract_old_z": lambda g: float(not g.state.to_clearance),
        "_lathe_diameter_mode": lambda g: 0.0,
        "_lathe_radius_mode": lambda g: 0.0,
        "_feed_override": lambda g: float(g.state.modal.overrides.feed),
        "_speed_override": lambda g: 1.0,
        "_adaptive_feed": lambda g: float(g.state.modal.overrides.adaptive),
        "_feed_hold": lambda g: float(g.state.modal.overrides.stop),
        "_remap_level": lambda g: 0.0,
        "_task": lambda g: 1.0,
        "_probed_z": lambda g: g.probed_z,
        "_touched": lambda g: g.touched,
        "_touch_radius": Given.touch_radius,
        "_setter_radius": Given.setter_radius,
        "_setter_z": Given.setter_z,
        # The LinuxCNC whose language this is; programs refuse to run under one that is too old for them.
        "_vmajor": lambda g: 2.9,
        "_vminor": lambda g: 0.0,
    }
)
