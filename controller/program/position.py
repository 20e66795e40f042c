"""Where a program has brought the axes, as far as its text tells.

The reader needs it for what depends on where the tool stands: canned cycles, G92, G10 L20, G28.1.
It is known from the start on, and lost where the path itself chooses it: behind a surface, whose
departure is planned, and for the rotaries under tool vectors. What is lost is None until words say it again.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import cast

from controller.geometry.vectors import Frame, Vector, add, subtract
from controller.machine.kinematics import Kinematics, Pair, kinematics_of
from controller.machine.model import Joints, Machine
from controller.program.line import CommonRun
from controller.program.program import (
    Action,
    Block,
    CutCone,
    CutNurbs,
    CutRuled,
    JointMotion,
    Modal,
    Tip,
    TipLine,
)

Coordinate = float | None
Place3 = tuple[Coordinate, Coordinate, Coordinate]

_UNTURNED = Frame()[1:]
MAX_PENDING = 120


def homed(machine: Machine) -> Joints:
    """The joints where a homed machine stands (mm, rad)."""
    return tuple(axis.homing.position for axis in machine.axes)


def placed(words: Sequence[Coordinate], here: Vector, frame: Frame, length_mm: float) -> Vector:
    """Absolute words (G90) as X Y Z; axes without a word stay, in the part frame if it is turned."""
    lifted = (0.0, 0.0, length_mm)
    if frame[1:] == _UNTURNED:
        x, y, z = (
            q if word is None else word + origin + up
            for q, word, origin, up in zip(here, words, frame.origin, lifted, strict=True)
        )
        return x, y, z
    part = frame.from_parent(subtract(here, lifted))
    x, y, z = (p if word is None else word for p, word in zip(part, words, strict=True))
    return add(frame.to_parent((x, y, z)), lifted)


def shifted(words: Sequence[Coordinate], here: Vector, frame: Frame) -> Vector:
    """Distances (G91) from ``here``."""
    x, y, z = (0.0 if word is None else word for word in words)
    return add(here, frame.turn((x, y, z)))


def read_in(modal: Modal, machine: Machine, kinematics: Kinematics, rotaries: Pair) -> tuple[Frame, float]:
    """The frame in which X Y Z of joint moves are positions of the axes, and what G43 adds to Z there.

    In a tilted plane it depends on where the rotaries (rad) stand, and holds the tool's length.
    """
    frame = modal.frame(machine)
    if not modal.tilted:
        return frame, modal.length_mm
    return kinematics.of_axes(frame, rotaries, modal.length_mm), 0.0


class Position:
    """Follows the blocks of a program as they are read; never wrong, at most not known."""

    __slots__ = (
        "_kinematics",
        "_length_mm",
        "_linear",
        "_machine",
        "_pending",
        "_place",
        "_rotaries",
        "_rotary",
        "_tips",
        "_xyz",
    )

    def __init__(self, machine: Machine, start: Joints) -> None:
        self._machine = machine
        self._kinematics: Kinematics | None = None
        self._linear, self._rotary = machine.linear(), machine.rotary()
        self._xyz: list[Coordinate] = [start[i] for i in self._linear]  # axes, or the tip in the table frame
        self._rotaries: list[Coordinate] = [*machine.pair(start, 0.0)]
        self._tips, self._length_mm = False, 0.0
        # Not gone yet, for most are never asked for: a line that alone says where all axes are, absolute
        # moves behind it.
        self._place: TipLine | None = None
        self._pending: list[JointMotion] = []

    def copied(self) -> Position:
        """The same place, which goes on by itself."""
        made = copy(self)
        made._xyz, made._rotaries, made._pending = [*self._xyz], [*self._rotaries], [*self._pending]
        return made

    def stand(self, joints: Joints) -> None:
        """There it stands (mm, rad), as the machine has told."""
        self._place, self._pending, self._tips = None, [], False
        self._xyz, self._rotaries = [joints[i] for i in self._linear], [*self._machine.pair(joints, 0.0)]

    def take(self, block: Block) -> None:
        """Go where a block leads."""
        if isinstance(block, JointMotion) and _is_position(block):
            self._put_off((block,))
        elif isinstance(block, JointMotion):
            self._go()
            self._joint_move(block)
        elif isinstance(block, TipLine) and self._is_place(block):
            self._place, self._pending = block, []
        elif isinstance(block, TipLine):
            self._go()
            self._tip_line(block)
        elif isinstance(block, CutCone | CutRuled | CutNurbs):
            self._place, self._pending = None, []
            self._xyz, self._rotaries = [None] * 3, self._lost()

    def take_run(self, run: CommonRun) -> None:
        """Go where common lines lead, which count all alike."""
        motions = [block for block in run.blocks if not isinstance(block, Action)]
        if not motions:
            return
        first = motions[0]
        if isinstance(first, JointMotion) and _is_position(first):
            self._put_off(cast(Sequence[JointMotion], motions))
            return
        last = motions[-1]
        for block in (last,) if isinstance(last, TipLine) and self._is_place(last) else motions:
            self.take(block)

    def _put_off(self, motions: Sequence[JointMotion]) -> None:
        """Positions of one frame: where they lead is looked at when it is asked for."""
        pending = self._pending
        if (pending and not _in_one_frame(motions[0].modal, pending[-1].modal)) or len(pending) > MAX_PENDING:
            self._go()
        self._pending.extend(motions)

    def _is_place(self, line: TipLine) -> bool:
        """Whether its words alone say where all axes are then."""
        turns = line.rotaries[: len(self._rotary)]
        return not line.relative and line.axis is None and None not in line.tip and None not in turns

    def _go(self) -> None:
        """Go where all pending lines lead, which are of one frame: the last word of each axis counts."""
        place, pending = self._place, self._pending
        self._place, self._pending = None, []
        if place is not None:
            self._tip_line(place)
        if not pending:
            return
        last = pending[-1]
        if len(pending) > 1:
            columns = zip(*[line.targets for line in reversed(pending)], strict=True)
            last = replace(last, targets=tuple([_first(column) for column in columns]))
        self._joint_move(last)

    def _lost(self) -> list[Coordinate]:
        """Nobody knows where the rotaries are; one that the machine has not stands still."""
        return [*self._machine.pair([None] * len(self._machine.axes), 0.0)]

    @property
    def rotaries(self) -> list[Coordinate]:
        """The two rotaries (rad, carried)."""
        self._go()
        return self._rotaries

    def joints(self) -> tuple[Coordinate, ...]:
        """The joints in the machine's order (mm, rad)."""
        self._go()
        self._as_axes()
        found: list[Coordinate] = [None] * len(self._machine.axes)
        for i, value in zip((*self._linear, *self._rotary), (*self._xyz, *self._rotaries), strict=False):
            found[i] = value
        return tuple(found)

    def in_frame(self, modal: Modal) -> Place3:
        """X Y Z as words under G90 would lead here (mm)."""
        self._go()
        if modal.tip is Tip.OFF and not modal.tilted:
            self._as_axes()
            lifted = (0.0, 0.0, modal.length_mm)
        else:
            self._as_tip(modal.length_mm)
            lifted = (0.0, 0.0, 0.0)
        frame = modal.frame(self._machine)
        x, y, z = self._xyz
        if frame[1:] == _UNTURNED:
            x, y, z = (
                None if q is None else q - origin - up
                for q, origin, up in zip(self._xyz, frame.origin, lifted, strict=True)
            )
            return x, y, z
        if x is None or y is None or z is None:
            return None, None, None
        return frame.from_parent(subtract((x, y, z), lifted))

    # ---- moves -----------------------------------------------------------------------

    def _joint_move(self, block: JointMotion) -> None:
        self._as_axes()
        for k, i in enumerate(self._rotary):
            self._rotaries[k] = _moved(self._rotaries[k], block.targets[i], block.relative)
        words = tuple([block.targets[i] for i in self._linear])
        if words == (None, None, None):
            return
        here, (a, b) = self._xyz, self._rotaries
        if block.machine_frame:
            frame, length = Frame(), 0.0
        elif not block.modal.tilted:
            frame, length = block.modal.frame(self._machine), block.modal.length_mm
        elif a is None or b is None:
            self._xyz = [None] * 3
            return
        else:
            frame, length = read_in(block.modal, self._machine, self.chain(), (a, b))
        x, y, z = (q or 0.0 for q in here)
        if block.relative:
            there = shifted(words, (x, y, z), frame)
        else:
            there = placed(words, (x, y, z), frame, length)
        self._xyz = _masked(there, here, words, block.relative, frame)

    def _tip_line(self, block: TipLine) -> None:
        self._as_tip(block.modal.length_mm)
        frame, here = block.modal.frame(self._machine), self._xyz
        part = frame.from_parent((here[0] or 0.0, here[1] or 0.0, here[2] or 0.0))
        if block.relative:
            x, y, z = (p + (word or 0.0) for p, word in zip(part, block.tip, strict=True))
        else:
            x, y, z = (p if word is None else word for p, word in zip(part, block.tip, strict=True))
        self._xyz = _masked(frame.to_parent((x, y, z)), here, block.tip, block.relative, frame)
        if block.axis is not None:
            self._rotaries = self._lost()
            return
        for k, word in enumerate(block.rotaries):
            self._rotaries[k] = _moved(self._rotaries[k], word, block.relative)

    # ---- axes or tip -----------------------------------------------------------------

    def _as_axes(self) -> None:
        """The same place as positions of X Y Z."""
        if not self._tips:
            return
        self._tips = False
        (x, y, z), (a, b) = self._xyz, self._rotaries
        if x is None or y is None or z is None or a is None or b is None:
            self._xyz = [None] * 3
            return
        self._xyz = [*self.chain().linear((x, y, z), (a, b), self._length_mm)]

    def _as_tip(self, length_mm: float) -> None:
        """The same place as that of the tip of a tool so long, in the table frame."""
        if self._tips and length_mm == self._length_mm:
            return
        known = self.joints()
        self._tips, self._length_mm = True, length_mm
        here = [q for q in known if q is not None]
        if len(here) < len(known):
            self._xyz = [None] * 3
            return
        self._xyz = [float(q) for q in self.chain().forward(here, length_mm).tip]

    def chain(self) -> Kinematics:
        """The machine's, made when it is first asked for."""
        if self._kinematics is None:
            self._kinematics = kinematics_of(self._machine)
        return self._kinematics


def _is_position(block: JointMotion) -> bool:
    """Whether its words say where it ends, whatever comes before it."""
    return not (block.relative or block.modal.tilted or block.machine_frame)


def _in_one_frame(a: Modal, b: Modal) -> bool:
    """Whether words of absolute lines lead to the same places under both."""
    return a is b or (a.offset, a.part, a.length_mm) == (b.offset, b.part, b.length_mm)


def _first(column: Sequence[Coordinate]) -> Coordinate:
    """The first value that is one."""
    if column.count(None) == len(column):
        return None
    return next(q for q in column if q is not None)


def _moved(here: Coordinate, word: Coordinate, relative: bool) -> Coordinate:
    if word is None or not relative:
        return here if word is None else word
    return None if here is None else here + word


def _masked(
    there: Vector, here: Sequence[Coordinate], words: Sequence[Coordinate], relative: bool, frame: Frame
) -> list[Coordinate]:
    """``there`` without what hangs on a position that is not known."""
    lost = [q is None and (relative or word is None) for q, word in zip(here, words, strict=True)]
    if frame[1:] != _UNTURNED and any(lost):
        return [None] * 3
    return [None if gone else value for gone, value in zip(lost, there, strict=True)]
