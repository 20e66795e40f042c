"""The corners of a row's lines: tip in the table frame (or X Y Z of the machine) and both rotaries.

Between two corners all of them run evenly; a line whose great circle is not so gets more of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from controller.geometry.arrays import Array
from controller.geometry.curves import Arc
from controller.geometry.vectors import Vector, norm
from controller.machine.model import Joints
from controller.motion.motions import JointMove
from controller.plan.context import Context
from controller.plan.lines import lines, moves
from controller.plan.lines.lines import Stand
from controller.plan.rotaries.tool_axes import AxisLost, GreatCircles, follow
from controller.plan.segment import joints_of, rotaries_of, xyz_of
from controller.program.program import JointArc, JointLine, Modal, Tip, TipLine

Index = npt.NDArray[np.intp]
Row = tuple[float, ...]  # X Y Z and both rotaries
Feed = TipLine | JointLine | JointArc

CIRCLE_SHARE = 0.1  # of the axis' tolerance for corners between great circles, the rest for the fit
CHORD_SHARE = 0.02  # of the tip's tolerance for the chords of arcs, likewise
MIN_CHORDS = 4  # of an arc, however small


@dataclass(frozen=True, slots=True)
class Corners:
    """Samples of a window in order: line of the window, share of it, tip and rotaries, sine to the pole."""

    line: Index
    share: Array
    values: Array  # (M, 5): X Y Z of the tip (or of the machine), first and second rotary
    sine: Array


class CornerMaker:
    """Makes the corners of lines that share one modal state; ``axis_rad`` is the axis' tolerance."""

    def __init__(self, modal: Modal, axis_rad: float, context: Context) -> None:
        self._modal, self._axis_rad = modal, axis_rad
        self._context = context

    def of(self, blocks: list[Feed], stand: Stand) -> tuple[Corners, Stand]:
        """Corners of lines that begin at ``stand``, and where they end."""
        if self._modal.tip is Tip.OFF:
            return self._joint_corners([b for b in blocks if not isinstance(b, TipLine)], stand)
        return self._tip_corners([b for b in blocks if isinstance(b, TipLine)], stand)

    def _tip_corners(self, blocks: list[TipLine], stand: Stand) -> tuple[Corners, Stand]:
        part = self._modal.frame(self._context.machine)
        here = part.from_parent(stand.tip)
        tips = [here]
        for block in blocks:
            here = lines.tip_of(block, here)
            tips.append(here)
        frame = np.array([part.x, part.y, part.z])
        table = np.array(part.origin) + np.array(tips) @ frame
        table[0] = stand.tip
        if self._modal.tip is Tip.VECTORS:
            return self._vector_corners(blocks, table, frame, stand)
        return self._rotary_corners(blocks, table, stand)

    def _vector_corners(
        self, blocks: list[TipLine], tips: Array, frame: Array, stand: Stand
    ) -> tuple[Corners, Stand]:
        axes: list[Vector | None] = [block.axis for block in blocks]
        given = np.array([axis is not None for axis in axes])
        vectors = np.array([axis or (0.0, 0.0, 1.0) for axis in axes]) @ frame
        vectors /= np.sqrt((vectors * vectors).sum(axis=1))[:, None]
        held = np.maximum.accumulate(np.where(given, np.arange(1, len(axes) + 1), 0))
        vectors = np.concatenate(([stand.axis], vectors))[np.concatenate(([0], held))]
        try:
            found = follow(
                GreatCircles.of(vectors),
                stand.rotaries,
                self._context.kinematics,
                CIRCLE_SHARE * self._axis_rad,
            )
        except AxisLost as lost:
            lines.refuse_lost(lost, blocks[lost.line].place, self._context)
        values = np.hstack([_between(tips, found.line, found.share), found.rotaries])
        end = (float(values[-1, 3]), float(values[-1, 4]))
        axis = (float(vectors[-1, 0]), float(vectors[-1, 1]), float(vectors[-1, 2]))
        return Corners(found.line, found.share, values, found.sine), self.standing(tips[-1], end, axis)

    def _rotary_corners(self, blocks: list[TipLine], tips: Array, stand: Stand) -> tuple[Corners, Stand]:
        now = stand.rotaries
        rotaries = [now]
        for block in blocks:
            now = lines.rotaries_to(block, now)
            rotaries.append(now)
        turned = np.array(rotaries)
        zero = np.zeros(len(turned))
        values = (zero, zero, zero, turned[:, 0], turned[:, 1])
        axes = self._context.kinematics.forward(self._context.kinematics.arrange(values), 0.0, np).axis
        sine = zero + self._context.kinematics.off_pole(axes, np)
        line = np.arange(len(blocks))
        found = Corners(
            np.concatenate((line, line[-1:])),
            np.concatenate((0.0 * line, [1.0])),
            np.hstack([tips, turned]),
            sine,
        )
        ends = self.standing(tips[-1], now, lines.axis_of(now, self._context.kinematics))
        return self._with_circles(found), ends

    def standing(self, tip: Array, rotaries: tuple[float, float], axis: Vector) -> Stand:
        place = (float(tip[0]), float(tip[1]), float(tip[2]))
        xyz = self._context.kinematics.linear(place, rotaries, self._modal.length_mm)
        joints = joints_of(xyz, rotaries, self._context.kinematics)
        return Stand(joints, place, axis, rotaries, self._modal.length_mm)

    def _with_circles(self, found: Corners) -> Corners:
        """More corners on lines whose great circle leaves evenly turning rotaries."""
        if self._context.machine.tool_lines != lines.GREAT:
            return found
        turned = np.abs(np.diff(found.values[:, 3:], axis=0))
        work = self._context.kinematics.work
        tilt, spin = turned[:, 1 - work], turned[:, work]
        sine = np.maximum(found.sine[:-1], found.sine[1:])
        off = (tilt * tilt + 2.0 * tilt * spin + sine * spin * spin) / 8.0
        parts = [found]
        for i in np.flatnonzero(off > CIRCLE_SHARE * self._axis_rad):
            parts += self._great(found, int(i))
        if len(parts) == 1:
            return found
        line, share, sines = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("line", "share", "sine")
        )
        order = np.lexsort((share, line))
        values = np.concatenate([part.values for part in parts])[order]
        return Corners(line[order], share[order], values, sines[order])

    def _great(self, found: Corners, i: int) -> list[Corners]:
        """Inner corners of one line on the great circle; none where that does not lead to its end."""
        (a, b), kinematics = found.values[i : i + 2], self._context.kinematics
        first, last = (float(a[3]), float(a[4])), (float(b[3]), float(b[4]))
        stand = self.standing(a[:3], first, lines.axis_of(first, kinematics))
        axis = lines.axis_of(last, kinematics)
        circles = lines.great_circle(stand, axis, last, self._context)
        if circles is None:
            return []
        way = follow(circles, first, kinematics, CIRCLE_SHARE * self._axis_rad)
        inner = slice(1, -1)
        share = way.share[inner]
        tips = a[:3] + share[:, None] * (b[:3] - a[:3])
        values = np.hstack([tips, way.rotaries[inner]])
        return [Corners(way.line[inner] + i, share, values, way.sine[inner])]

    def _joint_corners(self, blocks: list[JointLine | JointArc], stand: Stand) -> tuple[Corners, Stand]:
        """Lines and arcs of joint space (no G43.4): X Y Z are machine positions."""
        now = stand.joints
        rows: list[Row] = []
        line: list[int] = []
        share: list[float] = []
        for number, block in enumerate(blocks):
            end, inner = self._joint_way(block, now)
            rows += [self._row(now), *inner]
            line += [number] * (1 + len(inner))
            share += [k / (1 + len(inner)) for k in range(1 + len(inner))]
            now = end
        values = np.array([*rows, self._row(now)])
        found = Corners(
            np.array([*line, len(blocks) - 1]), np.array([*share, 1.0]), values, np.ones(len(values))
        )
        return found, Stand.at(now, self._modal.length_mm, self._context.kinematics)

    def _joint_way(self, block: JointLine | JointArc, now: Joints) -> tuple[Joints, list[Row]]:
        """Where a block ends, and its corners on the way there: an arc is cut into chords."""
        if isinstance(block, JointLine):
            return moves.target(block, self._context, now), []
        bow = moves.arc(block, self._context, now)
        if bow is None or not isinstance(bow.motion, JointMove) or not isinstance(bow.motion.curve, Arc):
            return moves.target(block, self._context, now), []
        arc, first, last = (
            bow.motion.curve,
            *(np.array(r) for r in (bow.motion.start_rotaries, bow.motion.end_rotaries)),
        )
        # A chord over the angle t leaves a circle of radius r by r (1 - cos(t / 2)), at most r t^2 / 8.
        off_mm = CHORD_SHARE * self._modal.blend_mm
        chords = max(MIN_CHORDS, math.ceil(arc.sweep_rad * math.sqrt(norm(arc.first) / (8.0 * off_mm))))
        u = np.arange(1, chords) / chords
        xyz = np.stack(np.broadcast_arrays(*arc.at(u, np)), axis=1)
        return bow.end, [tuple(row) for row in np.hstack([xyz, first + u[:, None] * (last - first)]).tolist()]

    def _row(self, joints: Joints) -> Row:
        return (*xyz_of(joints, self._context.kinematics), *rotaries_of(joints, self._context.kinematics))


def _between(tips: Array, line: Index, share: Array) -> Array:
    return np.asarray(tips[line] + share[:, None] * (tips[line + 1] - tips[line]))
