"""Where a program has brought the axes, as far as its text tells.

The reader needs it for what depends on where the tool stands: canned cycles, G92, G10 L20, G28.1.
It is known from the start on, and lost where the path itself chooses it: behind a surface, whose
departure is planned, and for the rotaries under tool vectors. What is lost is None until words say it again.
"""

from __future__ import annotations

from collections.abc import Sequence

from controller.geometry import Frame, Vector, add, subtract
from controller.kinematics import Kinematics
from controller.machine import Joints, Machine
from controller.plan.text.program import (
    Block,
    CutCone,
    CutNurbs,
    CutRuled,
    JointArc,
    JointLine,
    Modal,
    Tip,
    TipLine,
)

Known = float | None
Place3 = tuple[Known, Known, Known]

_UNTURNED = Frame()[1:]
MOST_DUE = 4096  # lines that are put off


def homed(machine: Machine) -> Joints:
    """The joints where a homed machine stands (mm, rad)."""
    a, b, c, d, e = (axis.homing.position for axis in machine.axes)
    return a, b, c, d, e


def placed(words: Sequence[Known], here: Vector, frame: Frame, length_mm: float) -> Vector:
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


def shifted(words: Sequence[Known], here: Vector, frame: Frame) -> Vector:
    """Distances (G91) from ``here``."""
    x, y, z = (0.0 if word is None else word for word in words)
    return add(here, frame.turn((x, y, z)))


class Position:
    """Follows the blocks of a program as they are read; never wrong, at most not known."""

    __slots__ = (
        "_due",
        "_kinematics",
        "_length_mm",
        "_linear",
        "_machine",
        "_rotary",
        "_tips",
        "rotaries",
        "xyz",
    )

    def __init__(self, machine: Machine, start: Joints) -> None:
        self._machine = machine
        self._kinematics: Kinematics | None = None
        self._linear, self._rotary = machine.linear(), machine.rotary()
        self.xyz: list[Known] = [start[i] for i in self._linear]  # axes, or the tip in the table frame
        self.rotaries: list[Known] = [start[i] for i in self._rotary]
        self._tips, self._length_mm = False, 0.0
        self._due: list[JointLine | JointArc] = []  # moves that nobody has asked behind yet

    def take(self, block: Block) -> None:
        """Go where a block leads; moves of the axes are put off, as of thousands only the last ones tell."""
        if isinstance(block, JointLine | JointArc):
            self._due.append(block)
            if len(self._due) >= MOST_DUE:
                self._catch_up()
        elif isinstance(block, TipLine | CutCone | CutRuled | CutNurbs):
            self._catch_up()
            self._go(block)

    def _catch_up(self) -> None:
        """Go where the lines lead that were put off: for each axis the last that has an absolute word of "
        "it."""
        due, self._due = self._due, []
        last: dict[int, int] = {}
        for k in range(len(due) - 1, -1, -1):
            block = due[k]
            if block.relative or block.modal.frame(self._machine)[1:] != _UNTURNED:
                last = dict(enumerate(range(len(due))))
                break
            for i, target in enumerate(block.targets):
                if target is not None:
                    last.setdefault(i, k)
            if len(last) == len(block.targets):
                break
        for k in sorted(set(last.values())):
            self._go(due[k])

    def _go(self, block: Block) -> None:
        if isinstance(block, JointLine | JointArc):
            self._joint_move(block)
        elif isinstance(block, TipLine):
            self._tip_line(block)
        elif isinstance(block, CutCone | CutRuled | CutNurbs):
            self.xyz, self.rotaries = [None] * 3, [None] * 2

    def joints(self) -> tuple[Known, ...]:
        """The joints in the machine's order (mm, rad)."""
        self._catch_up()
        self._as_axes()
        found: list[Known] = [None] * 5
        for i, value in zip((*self._linear, *self._rotary), (*self.xyz, *self.rotaries), strict=True):
            found[i] = value
        return tuple(found)

    def in_frame(self, modal: Modal) -> Place3:
        """X Y Z as words under G90 would lead here (mm)."""
        self._catch_up()
        if modal.tip is Tip.OFF:
            self._as_axes()
            lifted = (0.0, 0.0, modal.length_mm)
        else:
            self._as_tip(modal.length_mm)
            lifted = (0.0, 0.0, 0.0)
        frame = modal.frame(self._machine)
        x, y, z = self.xyz
        if frame[1:] == _UNTURNED:
            x, y, z = (
                None if q is None else q - origin - up
                for q, origin, up in zip(self.xyz, frame.origin, lifted, strict=True)
            )
            return x, y, z
        if x is None or y is None or z is None:
            return None, None, None
        return frame.from_parent(subtract((x, y, z), lifted))

    # ---- moves -----------------------------------------------------------------------

    def _joint_move(self, block: JointLine | JointArc) -> None:
        self._as_axes()
        for k, i in enumerate(self._rotary):
            self.rotaries[k] = _moved(self.rotaries[k], block.targets[i], block.relative)
        words = tuple([block.targets[i] for i in self._linear])
        if words == (None, None, None):
            return
        frame, length = block.modal.frame(self._machine), block.modal.length_mm
        if isinstance(block, JointLine) and block.machine_frame:
            frame, length = Frame(), 0.0
        here = self.xyz
        x, y, z = (q or 0.0 for q in here)
        if block.relative:
            there = shifted(words, (x, y, z), frame)
        else:
            there = placed(words, (x, y, z), frame, length)
        self.xyz = _masked(there, here, words, block.relative, frame)

    def _tip_line(self, block: TipLine) -> None:
        self._as_tip(block.modal.length_mm)
        frame, here = block.modal.frame(self._machine), self.xyz
        part = frame.from_parent((here[0] or 0.0, here[1] or 0.0, here[2] or 0.0))
        if block.relative:
            x, y, z = (p + (word or 0.0) for p, word in zip(part, block.tip, strict=True))
        else:
            x, y, z = (p if word is None else word for p, word in zip(part, block.tip, strict=True))
        self.xyz = _masked(frame.to_parent((x, y, z)), here, block.tip, block.relative, frame)
        if block.axis is not None:
            self.rotaries = [None, None]
            return
        for k, word in enumerate(block.rotaries):
            self.rotaries[k] = _moved(self.rotaries[k], word, block.relative)

    # ---- axes or tip -----------------------------------------------------------------

    def _as_axes(self) -> None:
        """The same place as positions of X Y Z."""
        if not self._tips:
            return
        self._tips = False
        (x, y, z), (a, b) = self.xyz, self.rotaries
        if x is None or y is None or z is None or a is None or b is None:
            self.xyz = [None] * 3
            return
        self.xyz = [*self._chain().linear((x, y, z), (a, b), self._length_mm)]

    def _as_tip(self, length_mm: float) -> None:
        """The same place as that of the tip of a tool so long, in the table frame."""
        if self._tips and length_mm == self._length_mm:
            return
        known = self.joints()
        self._tips, self._length_mm = True, length_mm
        a, b, c, d, e = known
        if a is None or b is None or c is None or d is None or e is None:
            self.xyz = [None] * 3
            return
        self.xyz = [float(q) for q in self._chain().forward((a, b, c, d, e), length_mm).tip]

    def _chain(self) -> Kinematics:
        if self._kinematics is None:
            self._kinematics = Kinematics(self._machine)
        return self._kinematics


def _moved(here: Known, word: Known, relative: bool) -> Known:
    if word is None or not relative:
        return here if word is None else word
    return None if here is None else here + word


def _masked(
    there: Vector, here: Sequence[Known], words: Sequence[Known], relative: bool, frame: Frame
) -> list[Known]:
    """``there`` without what hangs on a position that is not known."""
    lost = [q is None and (relative or word is None) for q, word in zip(here, words, strict=True)]
    if frame[1:] != _UNTURNED and any(lost):
        return [None] * 3
    return [None if gone else value for gone, value in zip(lost, there, strict=True)]
