"""What stands between the machine's positions and the program's: work offset, shifts and turns.

    table frame -> work offset (the machine's or of G10) -> shift of G92 -> local shift of G52
                -> tilted plane of G68.2 -> shifts made inside of it -> turn of G68

Under G254 and G54.2 the origin of the work offset is carried along with the turned part, while X Y Z stay
parallel to the axes of the machine (``Following``).

All of it is one frame for X Y Z and one shift for each rotary. State is replaced, never edited.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from controller.geometry.vectors import ZERO, Frame, Vector, X, Y, Z, add, rotate
from controller.machine.model import KEPT_OFFSETS, OFFSETS, Machine, Offset, Pair, Shift

NONE = Shift()
AT_ZERO = Frame()
Mirror = tuple[float | None, float | None, float | None]  # the place (mm) at which each of X Y Z is mirrored


@dataclass(frozen=True, slots=True)
class Plane:
    """A tilted work plane; the shifts that it stands in rest here until G69 takes them up again."""

    frame: Frame  # seen from the work offset as these shifts have moved it
    shift: Shift
    suspended: bool
    local: Shift


@dataclass(frozen=True, slots=True)
class Following:
    """The origin follows the turned part: G254 carries the work offset, G54.2 adds a vector that turns along.

    Frames are those of the table, seen from where its rotaries are at zero.
    """

    code: str
    number: int  # P of G54.2
    table: Frame  # as it stands
    reference: Frame = AT_ZERO  # of G54.2: as it stood where the vector was measured
    is_current: bool = True  # False: rotaries have turned since the table was seen

    def carried(self, frame: Frame, vector: Vector) -> Frame:
        """A work offset as it is read; ``vector``: of G54.2."""
        if self.code == "G254":
            return frame._replace(origin=self.table.to_parent(frame.origin))
        turned = self.table.turn(self.reference.turn_back(vector))
        return frame._replace(origin=add(frame.origin, turned))

    def set_down(self, way: Vector) -> Vector:
        """By how much the work offset moves where its origin as it is read moves by ``way``."""
        return self.table.turn_back(way) if self.code == "G254" else way


@dataclass(frozen=True, slots=True)
class Origins:
    """Everything that makes program coordinates out of positions of the machine."""

    index: int = 0  # of the work offset, as ``machine.OFFSETS``
    written: Mapping[int, Offset] = field(default_factory=lambda: MappingProxyType({}))  # by G10
    shift: Shift = NONE  # G92
    suspended: bool = False  # G92.2
    local: Shift = NONE  # G52
    turn: Frame | None = None  # G68, seen from the shifted frame
    plane: Plane | None = None  # G68.2 to G68.4
    waiting: Frame | None = None  # as ``Plane.frame``; under rs274 it counts from G53.1 on
    following: Following | None = None  # G254, G54.2
    mirror: Mirror | None = None  # G51.1, inside of all others
    aside: tuple[float, float] = (0.0, 0.0)  # G43.1 X Y: the tool's offset across Z, mm

    @classmethod
    def begun(cls, machine: Machine) -> Origins:
        """With which a program begins: G54, and the shift that an earlier one has left."""
        return cls(shift=machine.shift, suspended=machine.suspended)

    def offset(self, index: int, machine: Machine) -> Offset:
        """A work offset as it is now; an unset one is that of the machine's zero."""
        return self.written[index] if index in self.written else machine.offset(index)

    def is_set(self, index: int, machine: Machine) -> bool:
        """Whether the machine file, the operator or the program has set a work offset."""
        if index in self.written:
            return True
        return index < len(machine.offsets) and KEPT_OFFSETS[index] not in machine.unset

    def with_offset(self, index: int, offset: Offset) -> Origins:
        return replace(self, written=MappingProxyType({**self.written, index: offset}))

    def untouched(self, machine: Machine) -> bool:
        """Whether positions are read in the work offset exactly as the machine has it."""
        plain = self.index not in self.written and self.index < len(machine.offsets) and self.turn is None
        shifted = self.local != NONE or (not self.suspended and self.shift != NONE)
        inside = self.plane is None and self.following is None and self.mirror is None
        return plain and not shifted and inside and self.aside == (0.0, 0.0)

    def frame(self, machine: Machine) -> Frame:
        """The program's frame seen from the table frame at zero."""
        if self.plane is None:
            frame = self._moved(self.base(machine))
            if self.aside == (0.0, 0.0):
                return frame
            return frame._replace(origin=add(frame.origin, (*self.aside, 0.0)))
        return within(self.outside().frame(machine), self._moved(self.plane.frame))

    def base(self, machine: Machine) -> Frame:
        """The work offset, carried along where it follows the part."""
        frame = self.offset(self.index, machine).frame
        if self.following is None:
            return frame
        vector = ZERO
        if self.following.number:
            vector = self.offset(fixture_index(self.following.number), machine).frame.origin
        return self.following.carried(frame, vector)

    def _moved(self, frame: Frame) -> Frame:
        """A frame shifted and turned by what stands in it."""
        shift = ZERO if self.suspended else self.shift.xyz
        frame = frame._replace(origin=frame.to_parent(add(shift, self.local.xyz)))
        frame = frame if self.turn is None else within(frame, self.turn)
        return frame if self.mirror is None else within(frame, mirrored(self.mirror))

    def outside(self) -> Origins:
        """As G69 leaves them: no turn and no tilted plane, but the shifts that it stood in."""
        if self.plane is None:
            return replace(self, turn=None, waiting=None)
        shift, suspended, local = self.plane.shift, self.plane.suspended, self.plane.local
        return Origins(self.index, self.written, shift, suspended, local)

    def tilted(self, frame: Frame) -> Origins:
        """With a tilted plane, as seen from ``outside``, and nothing that shifts inside of it."""
        out = self.outside()
        plane = Plane(frame, out.shift, out.suspended, out.local)
        return Origins(
            self.index,
            self.written,
            plane=plane,
            following=self.following,
            mirror=self.mirror,
            aside=self.aside,
        )

    def inside(self) -> Frame:
        """The program's frame as seen from ``outside``: the tilted plane and what stands in it."""
        return self._moved(self.plane.frame if self.plane is not None else Frame())

    def turned_rad(self, machine: Machine) -> Pair:
        """What is added to the words of the rotaries (carried sense)."""
        of = self.offset(self.index, machine).turned_rad
        under = of if self.plane is None else self.outside().turned_rad(machine)
        a, b = (sum(pair) for pair in zip(under, self.local.turned_rad, strict=True))
        return (a, b) if self.suspended else (a + self.shift.turned_rad[0], b + self.shift.turned_rad[1])


def fixture_index(number: int) -> int:
    """Where the vector of G54.2 P is among the offsets."""
    return len(OFFSETS) + number - 1


def within(outer: Frame, inner: Frame) -> Frame:
    """``inner``, seen from ``outer``, as seen from the parent of ``outer``."""
    return Frame(outer.to_parent(inner.origin), outer.turn(inner.x), outer.turn(inner.y), outer.turn(inner.z))


def mirrored(mirror: Mirror) -> Frame:
    """The frame whose positions are mirrored at the places of its axes: it may be left-handed."""
    x, y, z = (0.0 if at is None else 2.0 * at for at in mirror)
    signs = [1.0 if at is None else -1.0 for at in mirror]
    axes = [(v[0] * sign, v[1] * sign, v[2] * sign) for v, sign in zip((X, Y, Z), signs, strict=True)]
    return Frame((x, y, z), axes[0], axes[1], axes[2])


def about(centre: Vector, direction: Vector, angle_rad: float) -> Frame:
    """The frame that is turned about a line through ``centre``."""
    x, y, z = (rotate(direction, angle_rad, v) for v in (X, Y, Z))
    turned = Frame(ZERO, x, y, z)
    return turned._replace(origin=add(centre, turned.turn((-centre[0], -centre[1], -centre[2]))))


def turned_about_z(frame: Frame, degrees: float) -> Frame:
    """The same origin with X and Y turned by the right hand from those of the table (G10 R)."""
    angle = math.radians(degrees)
    return Frame(frame.origin, *(rotate(Z, angle, v) for v in (X, Y, Z)))
