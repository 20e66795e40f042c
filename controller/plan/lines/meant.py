"""Lines without G64 P: which of their corners are meant, and which are but the rounding of a CAM system.

What the machine file lets surfaces be apart where they meet counts for lines, too: where two of them meet
within ``joint_tolerance_deg``, or the corner lies within ``joint_tolerance_mm`` of the way past it, they run
through as under G64 with P that tolerance. The axis has G64's own. Every other corner is exact.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple, TypeGuard

import numpy as np

from controller.geometry.arrays import Array, Flags, columns
from controller.geometry.vectors import Vector
from controller.machine.model import Joints
from controller.motion.motions import Rotaries
from controller.plan.context import Context
from controller.plan.lines import lines, moves, rows
from controller.plan.lines.corners import Feed
from controller.plan.lines.lines import Stand
from controller.plan.lines.rows import Part
from controller.plan.segment import STANDS_MM, rotaries_of, xyz_of
from controller.program.program import Block, JointLine, Tip, TipLine

Line = JointLine | TipLine

FIRST_LOOK, MAX_LOOK = (
    2,
    16,
)  # lines after which the corners are looked at: at first, and twice as many each time
EVEN = 1e-9  # of a line's way and turn: two that go on alike run through exactly


class _At(NamedTuple):
    """Where a line begins, as far as corners ask: tip and axis in the table frame, rotaries, joints."""

    tip: Vector
    axis: Vector
    rotaries: Rotaries
    joints: Joints


class Waiting:
    """Collects lines until it is known which of their corners are meant."""

    def __init__(self, context: Context) -> None:
        self._context, self._joint_tolerance_mm = context, context.machine.joint_tolerance_mm
        self.forget()

    def forget(self) -> None:
        """None of them is wanted any more."""
        self._blocks: list[Line] = []
        self._look = FIRST_LOOK
        self._at: _At | None = None  # where they begin, if they go on with the row before them

    def takes(self, block: Block) -> TypeGuard[Line]:
        """Whether a block is a feed line whose corners no word has said anything of."""
        if not isinstance(block, (JointLine, TipLine)) or self._joint_tolerance_mm == 0.0:
            return False
        if block.modal.exact_joints or block.modal.blend_mm > 0.0:
            return False
        if isinstance(block, JointLine) and (block.machine_frame or block.thread is not None):
            return False
        return block.feed_mm_s is not None and block.probe is None

    def __bool__(self) -> bool:
        return bool(self._blocks)

    @property
    def length_mm(self) -> float:
        """Of their tool."""
        return self._blocks[0].modal.length_mm

    def goes_with(self, block: Feed) -> bool:
        """Whether it may stand in one row with those that wait."""
        first = self._blocks[0]
        return type(block) is type(first) and rows.alike(block.modal, first.modal)

    def add(self, block: Line) -> bool:
        """Whether it is time to look at the corners."""
        self._blocks.append(block)
        return len(self._blocks) >= self._look

    def parts(self, standing: Callable[[], Stand], final: bool) -> list[Part]:
        """What is certain by now, ``final``: all; the path has come to ``standing``, or is in their row."""
        blocks, in_row, here = self._blocks, self._at is not None, standing()
        places, ats = self._places(blocks, self._at or _At(here.tip, here.axis, here.rotaries, here.joints))
        runs_on, bends = self._corners(places)
        firsts = [0, *(np.flatnonzero(~runs_on) + 1).tolist(), len(blocks)]
        found: list[Part] = []
        for low, high in itertools.pairwise(firsts):
            ends = high < len(blocks) or final
            if not ends and len(blocks) < rows.WINDOW:
                break
            blended = in_row or bool(bends[low : high - 1].any())
            in_row = blended and not ends
            # Whether the last one is run on from is not known yet.
            found.append(Part(blocks[low : high if ends else high - 1], blended, in_row))
        taken = sum(len(part.blocks) for part in found)
        if taken or final:
            self._at = ats[taken] if in_row else None
        self._blocks = blocks[taken:]
        more = max(min(2 * self._look, MAX_LOOK), 2 * len(self._blocks))
        self._look = rows.WINDOW if in_row else min(more, rows.WINDOW)
        return found

    # ---- corners -----------------------------------------------------------------------

    def _corners(self, places: Array) -> tuple[Flags, Flags]:
        """Of each corner between two lines, (n - 1,): whether it is run through, whether it is one at all.

        The corner is seen beside the straight way (tip and axis together) from the line's beginning
        to the end of the next, each in shares of its tolerance.
        """
        machine = self._context.machine
        tip = places[:, :3]
        way = np.diff(tip, axis=0)
        length = np.sqrt((way * way).sum(axis=1))
        moved = (length[:-1] > STANDS_MM) & (length[1:] > STANDS_MM)
        cross = np.cross(way[:-1], way[1:])
        sine, cosine = np.sqrt((cross * cross).sum(axis=1)), (way[:-1] * way[1:]).sum(axis=1)
        angle = np.arctan2(sine, cosine)
        share = length[:-1] / np.maximum(length[:-1] + length[1:], STANDS_MM)
        axis_rad = math.radians(rows.BLEND_DEG)
        scale = np.array([1.0 / machine.joint_tolerance_mm] * 3 + [1.0 / axis_rad] * (places.shape[1] - 3))
        a, b, c = (part * scale for part in (places[:-2], places[1:-1], places[2:]))
        # The axis turns on as it did, tips seen by their angle alone ...
        turned = (b - a - share[:, None] * (c - a))[:, 3:]
        slight = moved & (angle <= math.radians(machine.joint_tolerance_deg))
        slight &= (turned * turned).sum(axis=1) <= 1.0
        # ... or all of it is near the way past the corner.
        past = c - a
        along = ((b - a) * past).sum(axis=1) / np.maximum((past * past).sum(axis=1), 1e-300)
        off = b - a - np.clip(along, 0.0, 1.0)[:, None] * past
        away = (off * off).sum(axis=1)
        even = moved & (angle <= moves.TANGENT_RAD) & ((turned * turned).sum(axis=1) <= EVEN)
        stands = (length[:-1] <= STANDS_MM) & (length[1:] <= STANDS_MM)
        even |= stands & (along > 0.0) & (along < 1.0) & (away <= EVEN)
        return slight | (away <= 1.0), ~even

    # ---- places ------------------------------------------------------------------------

    def _places(self, blocks: list[Line], begin: _At) -> tuple[Array, list[_At]]:
        """Tip and axis (or X Y Z and rotaries of the machine) where the lines meet, (n + 1, 6 or 5)."""
        if isinstance(blocks[0], TipLine):
            return self._of_tips([b for b in blocks if isinstance(b, TipLine)], begin)
        kinematics, ats = self._context.kinematics, [begin]
        for block in blocks:
            if isinstance(block, JointLine):
                ats.append(begin._replace(joints=moves.target(block, self._context, ats[-1].joints)))
        rows_of = [(*xyz_of(at.joints, kinematics), *rotaries_of(at.joints, kinematics)) for at in ats]
        return np.array(rows_of), ats

    def _of_tips(self, blocks: list[TipLine], begin: _At) -> tuple[Array, list[_At]]:
        part = blocks[0].modal.frame(self._context.machine)
        here, tips, ats = part.from_parent(begin.tip), [], [begin]
        for block in blocks:
            here = lines.tip_of(block, here)
            tips.append(here)
        frame = np.array([part.x, part.y, part.z])
        table = np.concatenate(([begin.tip], np.array(part.origin) + np.array(tips) @ frame))
        turned = [begin.rotaries]
        if blocks[0].modal.tip is Tip.VECTORS:
            axes = _vectors(blocks, begin, frame)
            turned *= len(axes)  # none that corners ask for
        else:
            for block in blocks:
                turned.append(lines.rotaries_to(block, turned[-1]))
            axes = self._axes(np.array(turned))
        ats += [
            _At(tuple(tip), tuple(axis), pair, begin.joints)
            for tip, axis, pair in zip(table[1:].tolist(), axes[1:].tolist(), turned[1:], strict=True)
        ]
        return np.hstack([table, axes]), ats

    def _axes(self, turned: Array) -> Array:
        """Tool axes (N, 3) of rotaries (N, 2)."""
        none = np.zeros(len(turned))
        joints = self._context.kinematics.arrange((none, none, none, turned[:, 0], turned[:, 1]))
        return columns(self._context.kinematics.forward(joints, 0.0, np).axis, len(turned))


def _vectors(blocks: list[TipLine], begin: _At, frame: Array) -> Array:
    """Tool vectors in the table frame, (n + 1, 3); a line without one keeps that before it."""
    given = np.array([False, *(block.axis is not None for block in blocks)])
    found = np.concatenate(([begin.axis], lines.vectors(blocks, frame)))
    return np.asarray(found[np.maximum.accumulate(np.where(given, np.arange(len(given)), 0))])
