"""The cutter beside one contour: moves in the plane as ways, and ways as blocks again."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from controller.geometry.vectors import ROUNDING
from controller.machine.model import Machine
from controller.messages import Message, message, text
from controller.program.contour import circles, ways
from controller.program.contour.ways import Cut, Doubt, Way
from controller.program.motion_words import PLANES, to_place
from controller.program.position import Coordinate, Place3
from controller.program.program import (
    Block,
    JointArc,
    JointLine,
    Modal,
    Place,
    Planar,
    Remark,
    Targets,
    TipLine,
)

MOTIONS = (JointLine, JointArc, TipLine)
MAX_BETWEEN = 1000  # blocks between two moves in the plane
SHORTEST_ARC_MM = 2e-6  # shorter ones could be taken for whole circles
ROUND_MM = 1e-3  # by which the cutter may be larger than an arc that it fills (rounded words)
UNKNOWN = message("beside.unknown")


class NotBesideError(Exception):
    """Why a contour has no way beside it, and where."""

    def __init__(self, place: Place, why: Message) -> None:
        super().__init__(text(why))
        self.place, self.said = place, why


@dataclass(frozen=True, slots=True)
class Held:
    """A block, and for a motion where it begins and ends as programmed (frame of the program; joints)."""

    block: Block
    before: Place3 = (None, None, None)
    after: Place3 = (None, None, None)
    joints: tuple[Coordinate, ...] = ()


@dataclass(slots=True)
class Step:
    """A move in the plane with its way."""

    held: Held
    block: JointLine | JointArc
    way: Way
    number: int  # 0 is the lead-in


class Cutter:
    """From a G41 or G42 to the G40."""

    def __init__(self, planar: Planar, modal: Modal, machine: Machine) -> None:
        self.planar, self.plane = planar, modal.plane
        self._machine = machine
        self._axes = PLANES[modal.plane]
        self._last: Step | None = None
        self._between: list[Held] = []
        self._cut = Cut(abs(planar.off_mm))
        self._doubted: list[tuple[Doubt, Step]] = []
        self._waiting: list[Block] = []  # until it is known that what is doubted is no neck

    @property
    def begun(self) -> bool:
        """Whether the cutter stands beside the contour."""
        return self._last is not None

    def take(self, held: Held) -> Iterator[Block]:
        """What is cut for a block: all but the last move in the plane, whose end the next one says, and what
        follows ways that may lie in a neck.
        """
        for block in self._taken(held):
            self._waiting.append(block)
            yield from self._known()

    def finish(self) -> Iterator[Block]:
        """The last way to its own end."""
        if self._last is not None:
            for block in self._gone(self._last):
                self._waiting.append(block)
                yield from self._known()
        self._settle(at_end=True)
        yield from self._known()

    def _known(self) -> Iterator[Block]:
        """What waits, once nothing is doubted."""
        if not self._cut.doubts:
            waiting, self._waiting = self._waiting, []
            yield from waiting

    def _taken(self, held: Held) -> Iterator[Block]:
        if not self._moves(held):
            if self._last is None:
                yield held.block
                return
            if len(self._between) >= MAX_BETWEEN:
                raise self._wrong(held, "beside.nothing_moves", most=MAX_BETWEEN)
            self._between.append(held)
            return
        step = self._step(held)
        if self._last is not None:
            yield from self._joined(self._last, step)
        self._last = step

    # ---- moves as ways ---------------------------------------------------------------

    def _moves(self, held: Held) -> bool:
        """Whether a block moves in the plane."""
        if isinstance(held.block, JointArc):
            return True
        if not isinstance(held.block, MOTIONS):
            return False
        pairs = [(held.before[axis], held.after[axis]) for axis in self._axes[:2]]
        return any(a is None or b is None or abs(b - a) > ROUNDING for a, b in pairs)

    def _step(self, held: Held) -> Step:
        block = held.block
        if not isinstance(block, JointLine | JointArc) or block.machine_frame:
            raise self._wrong(held, "beside.no_plane_of_machine")
        start, end = self._point(held, held.before), self._point(held, held.after)
        number = 0 if self._last is None else self._last.number + 1
        if number == 0:
            way = self._lead_in(held, block, start, end)
        elif isinstance(block, JointArc):
            way = self._arc(held, block, start, end)
        else:
            way = ways.line(start, end, self.planar.off_mm)
        return Step(held, block, way, number)

    def _point(self, held: Held, place: Place3) -> complex:
        first, second = (place[axis] for axis in self._axes[:2])
        if first is None or second is None:
            raise NotBesideError(held.block.place, UNKNOWN)
        return complex(first, second)

    def _lead_in(self, held: Held, block: JointLine | JointArc, start: complex, end: complex) -> Way:
        off, radius = self.planar.off_mm, abs(self.planar.off_mm)
        if radius > 0.0 and abs(end - start) < radius - ROUNDING:
            raise self._wrong(held, "beside.short_lead_in", length=abs(end - start), radius=radius)
        if not isinstance(block, JointArc):
            return ways.line(start, end, off)
        circle, centre = self._circle(held, block, start, end)
        out = math.copysign(1.0, circle) * 1j * ways.unit(end - centre)
        way = None if self.planar.joins else ways.onto(start, end, out, circle, off)
        if way is None:
            raise self._wrong(held, "beside.arc_first")
        return way

    def _arc(self, held: Held, block: JointArc, start: complex, end: complex) -> Way:
        sweep, centre = self._circle(held, block, start, end)
        inside = abs(start - centre) - math.copysign(1.0, sweep) * self.planar.off_mm
        if inside < -ROUND_MM:
            raise self._wrong(
                held, "beside.inside_an_arc", arc=abs(start - centre), radius=abs(self.planar.off_mm)
            )
        return ways.arc(start, end, centre, sweep, self.planar.off_mm)

    def _circle(self, held: Held, block: JointArc, start: complex, end: complex) -> tuple[float, complex]:
        """Sweep, counter-clockwise positive, and centre."""
        way, chord = -1.0 if block.clockwise else 1.0, (end.real - start.real, end.imag - start.imag)
        most = self._machine.arc_tolerance_mm
        try:
            found = circles.meant(block.centre_mm, block.radius_mm, chord, way, block.turns, most)
        except circles.NoCircleError as error:
            raise NotBesideError(held.block.place, error.said) from None
        return way * found.sweep, start + complex(*found.centre)

    # ---- ways as blocks --------------------------------------------------------------

    def _joined(self, last: Step, step: Step) -> Iterator[Block]:
        """The last way, what stands behind it, and the way around the corner to the next one."""
        around = False
        if last.number == 0 and self.planar.joins:
            last.way.ends = step.way.begins
        else:
            around = self._corner(last, step)
        self._cut.takes(step.number, step.way.contour())
        self._settle()
        yield from self._gone(last)
        if around:
            yield from self._around(last, step)

    def _corner(self, last: Step, step: Step) -> bool:
        try:
            return ways.joined(last.way, step.way)
        except ways.NoRoomError as error:
            here, there = last.block.place.line, step.block.place.line
            if error.vanishes:
                raise self._wrong(
                    last.held, "beside.vanishes", radius=abs(self.planar.off_mm), there=there
                ) from None
            raise self._wrong(
                step.held, "beside.corner", here=here, there=there, radius=abs(self.planar.off_mm)
            ) from None

    def _gone(self, step: Step) -> Iterator[Block]:
        """A way as its block, and the blocks behind it."""
        if step.number > 0:
            self._cross(step, step.way.alone())
        yield self._block(step)
        between, self._between = self._between, []
        for held in between:
            block = held.block
            if isinstance(block, JointLine | JointArc | TipLine):
                if isinstance(block, JointLine) and block.feed_mm_s is None:
                    self._lift()
                yield self._standing(held, step.way.ends)
            else:
                yield block

    def _block(self, step: Step) -> Block:
        block, way = step.block, step.way
        targets = self._to(step.held, way.ends)
        if isinstance(block, JointLine):
            if block.feed_mm_s is None:
                self._lift()
            return replace(block, targets=targets, relative=False)
        rest = abs(way.sweep) * way.radius if step.number == 0 else way.rest
        if way.centre is None or way.radius < ROUND_MM or rest < SHORTEST_ARC_MM:
            mm = block.feed_mm_s
            return JointLine(block.place, block.modal, targets, False, False, mm, mm, block.time_s)
        turns = max(1, math.ceil(rest / (ways.TURN * way.radius) - 1e-6))
        centre = way.centre - way.begins
        return replace(
            block,
            targets=targets,
            relative=False,
            centre_mm=(centre.real, centre.imag),
            radius_mm=None,
            turns=turns,
        )

    def _around(self, last: Step, step: Step) -> Iterator[Block]:
        """From one way to the next around the corner of an outside."""
        block = step.block
        if isinstance(block, JointLine) and block.feed_mm_s is None:
            yield from self._tangents(last.way, step)
            return
        feed = block.feed_mm_s or 0.0
        if block.time_s:
            feed = step.way.length / block.time_s
        off, corner = self.planar.off_mm, step.way.start
        centre = corner - last.way.ends
        sweep = cmath.phase((step.way.begins - corner) / -centre)
        sweep = -math.copysign(abs(sweep), off)
        self._cross(step, ways.arc(last.way.ends, step.way.begins, corner, sweep, 0.0))
        yield JointArc(
            block.place,
            block.modal,
            self._axes,
            off > 0.0,
            self._only(step.way.begins),
            False,
            (centre.real, centre.imag),
            None,
            1,
            feed,
        )

    def _tangents(self, last: Way, step: Step) -> Iterator[Block]:
        """Around a corner at rapid: along lines outside of the arc."""
        turn = cmath.phase(step.way.into / last.out)
        count = math.ceil(abs(turn) / (math.pi / 2.0) - 1e-9)
        part = -math.copysign(abs(turn), self.planar.off_mm) / count
        for k in range(count):
            away = 1j * self.planar.off_mm * last.out * cmath.rect(1.0, part * (k + 0.5))
            point = step.way.start + away / math.cos(part / 2.0)
            yield replace(step.block, targets=self._only(point), relative=False)

    def _cross(self, step: Step, way: Way) -> None:
        """Note a way that is cut, and what it crosses."""
        _, _, normal = self._axes
        heights = [z for z in (step.held.before[normal], step.held.after[normal]) if z is not None] or [0.0]
        for doubt in self._cut.goes(step.number, way, min(heights), max(heights), step.block.place.line):
            self._doubted.append((doubt, step))

    def _lift(self) -> None:
        self._settle(at_end=True)
        self._cut.lift()

    def _settle(self, at_end: bool = False) -> None:
        """A way in a neck is refused, or told with gouge = "warn"."""
        while (neck := self._cut.settled(at_end)) is not None:
            self._cut.doubts.remove(neck)
            step = next(step for doubt, step in self._doubted if doubt is neck)
            radius = abs(self.planar.off_mm)
            if self._machine.gouge == "refuse":
                raise self._wrong(step.held, "beside.gouge", radius=radius, there=neck.old.line)
            told = message("beside.gouge_told", radius=radius, there=neck.old.line)
            self._waiting.append(Remark(step.block.place, step.block.modal, told))

    # ---- targets ---------------------------------------------------------------------

    def _to(self, held: Held, point: complex) -> Targets:
        """The targets of a move that ends at a point of the plane."""
        made = list(_absolute(held, self._machine))
        linear = self._machine.linear()
        for axis, value in zip(self._axes, (point.real, point.imag), strict=False):
            made[linear[axis]] = value
        return tuple(made)

    def _only(self, point: complex) -> Targets:
        return to_place(self._machine, (point.real, point.imag), self._axes)

    def _standing(self, held: Held, point: complex) -> Block:
        """A move that moves nothing in the plane, beside the contour."""
        block = held.block
        if not isinstance(block, JointLine):
            raise self._wrong(held, "beside.no_plane")
        linear = self._machine.linear()
        if all(block.targets[linear[axis]] is None for axis in self._axes[:2]):
            return block
        return replace(block, targets=self._to(held, point), relative=False)

    def _wrong(self, held: Held, key: str, **values: object) -> NotBesideError:
        planar = self.planar
        return NotBesideError(
            held.block.place, message(key, code=planar.code, line=planar.place.line, **values)
        )


def to_end(held: Held, axes: Sequence[int], machine: Machine) -> Block:
    """A move to where it ends as programmed, with a word for each of ``axes`` (of X Y Z)."""
    block = held.block
    if isinstance(block, TipLine):
        return _tip_to_end(held, block, axes, machine)
    assert isinstance(block, JointLine)
    made, linear = list(_absolute(held, machine)), machine.linear()
    for axis in axes:
        value = held.joints[linear[axis]] if block.machine_frame else held.after[axis]
        if value is None:
            raise NotBesideError(block.place, UNKNOWN)
        made[linear[axis]] = value
    return replace(block, targets=tuple(made), relative=False)


def _tip_to_end(held: Held, block: TipLine, axes: Sequence[int], machine: Machine) -> Block:
    given = (word is not None or axis in axes for axis, word in enumerate(block.tip))
    x, y, z = (value if there else None for there, value in zip(given, held.after, strict=True))
    if any((x, y, z)[axis] is None for axis in axes):
        raise NotBesideError(block.place, UNKNOWN)
    a, b = block.rotaries
    if block.relative:
        first, second = machine.pair(held.joints, 0.0)
        a, b = (None if a is None else first), (None if b is None else second)
    return replace(block, tip=(x, y, z), rotaries=(a, b), relative=False)


def _absolute(held: Held, machine: Machine) -> Targets:
    """The targets of a move as positions, whether they are distances or not."""
    block = held.block
    assert isinstance(block, JointLine | JointArc)
    if not block.relative:
        return block.targets
    made: list[Coordinate] = [
        None if word is None else joint for word, joint in zip(block.targets, held.joints, strict=True)
    ]
    for axis, i in enumerate(machine.linear()):
        made[i] = None if block.targets[i] is None else held.after[axis]
    lost = (word is not None and value is None for word, value in zip(block.targets, made, strict=True))
    if any(lost):
        raise NotBesideError(block.place, UNKNOWN)
    return tuple(made)
