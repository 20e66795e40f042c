"""Walls that lines under G41 or G42 leave, and where a thicker tool would cut into one beside its own.

             ___________________________     the wall of another contour
        new  . . . . . . . . . . . . . .     a tool that is thicker goes further off its own wall,
        old  - - - - - - - - - - - - - -     and may reach into another that the one before was clear of
             ---------------------------     the wall of this one

A wall is a row of points of the programmed contour at the levels at which the program cuts. A point stands
that the tool before does not reach anywhere. Contours are compared with those of the same tool axis.
How high the part is beside them nobody says: no higher than where the program begins to go down at feed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array, rows
from controller.geometry.vectors import Pose
from controller.machine.model import Tool
from controller.plan.path.path import PathBuilder
from controller.plan.restart.program_position import line_of, order_of
from controller.plan.restart.restart import Source
from controller.plan.rotaries.branch import joints_along
from controller.plan.stretch import Chain, Stretch
from controller.program.program import Block, JointMotion, Modal

SPACING_MM = 0.3  # of samples along lines
LEVEL_MM = 0.05  # heights that are one level
MAX_LEVELS = 40
SAME_AXIS = 1e-4  # of unit vectors


class Deeper(NamedTuple):
    """How deep a tool gets into what stands, and along which line."""

    depth_mm: float
    line: int


class Samples(NamedTuple):
    """Places of the tip at feed: ``beside`` (N,) signed millimetres to the left of the contour, 0 off it."""

    tips: Array  # (N, 3), table frame
    axes: Array  # (N, 3)
    left: Array  # (N, 3) unit vectors to the left of the way
    beside: Array
    lines: Array  # of the program


class Found(NamedTuple):
    """Of the whole way, and where the tool stands before it."""

    on_the_way: Deeper | None
    standing: Deeper | None


def cut_deeper(source: Source, tool: Tool, thicker_mm: float, deeper_mm: float, now: Pose) -> Found:
    """How deep (mm) the tool of a source reaches into a wall that one thinner by ``thicker_mm`` leaves
    standing, and along which line; None where it does not by ``deeper_mm``. Raises ProgramError.

    ``now``: its pose (mm, table frame) before it moves.
    """
    made = [_along(stretch, beside, source, tool.length_mm) for stretch, beside in _fed(source, tool.number)]
    if not made:
        return Found(None, None)
    fed = Samples(*(np.concatenate(parts) for parts in zip(*made, strict=True)))
    worst = standing = Deeper(0.0, 0)
    for axis in np.unique(np.round(fed.axes / SAME_AXIS), axis=0) * SAME_AXIS:
        here = np.abs(fed.axes - axis).max(axis=1) < 2.0 * SAME_AXIS
        one = Samples(*(part[here] for part in fed))
        tip = np.asarray(now.tip) if np.abs(now.axis - axis).max() < 2.0 * SAME_AXIS else None
        found = _deepest(one, axis, tool.radius_mm, thicker_mm, deeper_mm, tip)
        worst, standing = max(worst, found[0]), max(standing, found[1])
    return Found(*(one if one.depth_mm > deeper_mm else None for one in (worst, standing)))


def _deepest(
    fed: Samples, axis: Array, radius: float, thicker_mm: float, deeper_mm: float, tip: Array | None
) -> tuple[Deeper, Deeper]:
    """Of samples with one tool axis: on the way, and with the tip where it is before; None: another axis."""
    from scipy.spatial import cKDTree  # its package takes long to load, and few need it

    axis = axis / np.linalg.norm(axis)
    plane = np.linalg.svd(axis[None])[2][1:]
    high, beside = fed.tips @ axis, fed.beside
    contour = np.flatnonzero(beside)
    worst = standing = Deeper(0.0, 0)
    if not len(contour):
        return worst, standing
    walls = (fed.tips - beside[:, None] * fed.left)[contour] @ plane.T
    before = (fed.tips - (np.sign(beside) * thicker_mm)[:, None] * fed.left) @ plane.T
    after = fed.tips @ plane.T
    levels = np.unique(np.round(high[contour] / LEVEL_MM))
    levels = levels[np.linspace(0, len(levels) - 1, min(len(levels), MAX_LEVELS)).astype(int)] * LEVEL_MM
    is_low = tip is not None and float(tip @ axis) < float(high.max())
    for level in levels:
        low = high <= level + LEVEL_MM
        points = walls[high[contour] <= level + LEVEL_MM]
        stands = cKDTree(before[low]).query(points)[0] >= radius - thicker_mm - deeper_mm
        if stands.any():
            off, nearest = cKDTree(after[low]).query(points[stands])
            k = int(off.argmin())
            worst = max(worst, Deeper(radius - float(off[k]), int(fed.lines[low][nearest[k]])))
            if is_low:
                away = np.linalg.norm(points[stands] - plane @ tip, axis=1)
                k = int(away.argmin())
                line = int(fed.lines[contour][high[contour] <= level + LEVEL_MM][stands][k])
                standing = max(standing, Deeper(radius - float(away[k]), line))
    return worst, standing


def _fed(source: Source, tool: int) -> Iterator[tuple[Stretch, float]]:
    """Motions at feed with that tool, and how far beside the contour they are; of none of its leads."""
    modals = dict[int, Modal]()

    def read() -> Iterator[Block]:
        for block in source.again():
            if isinstance(block, JointMotion):
                modals[block.place.order] = block.modal
            yield block

    machine = source.machine
    tracer = PathBuilder(source.name, machine, source.kinematics, source.start, source.chosen or {})
    before = 0
    for item in tracer.items(read()):
        for stretch in item.stretches if isinstance(item, Chain) else ():
            modal = modals.get(order_of(stretch, stretch.motion.end))
            if modal is None or modal.tool != tool or stretch.feed_mm_s is None:
                before = 0
                continue
            leads_in = modal.beside_mm != 0.0 and before in (0, stretch.place.order)
            before = (stretch.place.order if leads_in else -1) if modal.beside_mm else 0
            yield stretch, 0.0 if leads_in else modal.beside_mm


def _along(stretch: Stretch, beside_mm: float, source: Source, length_mm: float) -> Samples:
    count = 2 + math.ceil(stretch.motion.end / SPACING_MM)
    s = np.linspace(0.0, stretch.motion.end, count)
    joints = joints_along(stretch, s, source.kinematics)
    pose = source.kinematics.forward(tuple(joints.T), length_mm, np)
    tips, axes = (rows(vector, (count,)).T for vector in pose)
    left = np.cross(axes, np.gradient(tips, axis=0))
    size = np.linalg.norm(left, axis=1, keepdims=True)
    left = np.where(size > 0.0, left / np.where(size > 0.0, size, 1.0), 0.0)
    lines = np.array([line_of(stretch, one) for one in s.tolist()])
    return Samples(tips, axes, left, np.full(count, beside_mm), lines)
