"""The surfaces of a whole program as walls: how deep a tool that is led beside the path would get into them.

The tool is its cutter, as thick upwards as its taper makes it, and its holder; endless upwards, and flat at
the tip's plane, which is on the safe side of every corner. A wall is a cloud of points of the nominal
surface, so close that a cylinder which reaches in between two of them is seen within less than ``APART_MM``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from controller.geometry.arrays import Array, rows
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Frame
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints, Machine, Tool
from controller.machine.tool_profile import flank
from controller.motion.motions import JointMove
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment
from controller.plan.surfaces import audit
from controller.plan.surfaces.cuts import surface_of
from controller.program.program import Block, CutBlock

SPACING_MM = 0.4  # of the points, along and across
MAX_SAMPLES = (2001, 201)  # of them, along and across
COARSE = (65, 3)  # points that tell where a wall is
STEP_MM, STEP_RAD = 0.5, math.radians(0.5)  # between poses that are looked at
LEAD_POSES = 49  # of anything but a straight way
APART_MM = 0.2  # off every wall a way aside stays so far, once it is; what lies between the points is less
DEEPER_MM = 2e-3  # by which it may seem to get deeper than it stood before it is


class Hit(NamedTuple):
    """Where a way gets into a wall: how deep (mm), and the line that cuts it."""

    depth_mm: float
    line: int

    @property
    def is_clear(self) -> bool:
        return self.depth_mm < -APART_MM


class Wall:
    """One surface in the table frame."""

    def __init__(self, surface: Surface, part: Frame, line: int) -> None:
        self._surface, self._part, self.line = surface, part, line
        coarse = self._points(*COARSE)
        # Between the coarse points it bulges by less than they are apart.
        table = coarse.reshape(3, *COARSE)
        self._along, self._across = (np.linalg.norm(np.diff(table, axis=k), axis=0) for k in (1, 2))
        spare = float(self._along.max())
        self.low, self.high = coarse.min(axis=1) - spare, coarse.max(axis=1) + spare

    @cached_property
    def points(self) -> Array:
        """(3, N)."""
        lengths = float(self._along.sum(axis=0).max()), float(self._across.sum(axis=1).max())
        along, across = (
            min(most, max(least, 2 + int(length / SPACING_MM)))
            for length, least, most in zip(lengths, COARSE, MAX_SAMPLES, strict=True)
        )
        return self._points(along, across)

    def _points(self, along: int, across: int) -> Array:
        u, v = np.meshgrid(np.linspace(0.0, 1.0, along), np.linspace(0.0, 1.0, across), indexing="ij")
        point = self._surface.point(u.ravel(), v.ravel(), np)
        return rows(self._part.to_parent(point), (along * across,))


class Walls:
    """All surfaces that a program cuts, before and after any of its places."""

    def __init__(self, walls: Sequence[Wall] = ()) -> None:
        self._walls = walls

    @staticmethod
    def of(blocks: Iterable[Block], machine: Machine) -> Walls:
        """Those of the blocks of a program. Raises ProgramError where one cannot be read."""
        cuts = (block for block in blocks if isinstance(block, CutBlock))
        return Walls([Wall(surface_of(one), one.modal.frame(machine), one.place.line) for one in cuts])

    def height(self, joints: Joints, length_mm: float, kinematics: Kinematics) -> float:
        """How far (mm) the highest of them is above the tip, along the tool axis; 0 where none is."""
        tip, axis = kinematics.forward(joints, length_mm)
        boxes = (np.where(np.array(axis) > 0.0, wall.high, wall.low) for wall in self._walls)
        return max(0.0, *(float(np.dot(corner - tip, axis)) for corner in boxes), 0.0)

    def depths(self, tips: Array, axes: Array, tool: Tool) -> tuple[Array, Array]:
        """How deep (mm) a tool on ``tips`` (3, M) along ``axes`` (3, M) is in the walls, and in which lines'.

        Below 0 so far off them; where that is more than ``APART_MM``, minus infinity.
        """
        depth, line = np.full(tips.shape[1], -np.inf), np.zeros(tips.shape[1], dtype=int)
        widest = max(flank(tool).radius_mm(0.0), *(wide for _, _, wide in tool.holder), 0.0)
        for wall in self._walls:
            far = np.linalg.norm(tips - wall.low[:, None], axis=0).max()
            height = float(np.linalg.norm(wall.high - wall.low) + far)
            reach = widest + height * math.tan(tool.taper_rad) + APART_MM
            tops = tips + height * axes
            low, high = np.minimum(tips, tops) - reach, np.maximum(tips, tops) + reach
            may = ((low <= wall.high[:, None]) & (high >= wall.low[:, None])).all(axis=0)
            for k in np.flatnonzero(may):
                one = _depth(wall.points, tips[:, k], axes[:, k], tool)
                if one > depth[k]:
                    depth[k], line[k] = one, wall.line
        depth[depth < -APART_MM] = -np.inf
        return depth, line

    def at(self, joints: Joints, tool: Tool, kinematics: Kinematics) -> Hit:
        """How deep the tool is where it stands."""
        return self._at(np.array([joints]), tool, kinematics)[0]

    def deepest(self, segment: Segment, s: Array, tool: Tool, kinematics: Kinematics) -> Hit:
        """How deep it gets at the places ``s`` (N,) of a motion."""
        return max(self._along(segment, s, tool, kinematics))

    def hit(
        self, way: Sequence[Segment], tool: Tool, kinematics: Kinematics, left: bool = False
    ) -> Hit | None:
        """Where a way that leaves the walls, or is ``left`` already, comes into them; None where it does not.

        A tool that stands in contact where it begins may go on in it, and no deeper, until it is clear;
        after that nothing comes nearer than ``APART_MM``.
        """
        if not self._walls:
            return None
        most = -APART_MM if left else math.inf
        for segment in way:
            for hit in self._along(segment, _places(segment), tool, kinematics):
                if most == math.inf:
                    most = max(hit.depth_mm, -APART_MM)
                if hit.depth_mm > most + DEEPER_MM:
                    return hit
                if hit.is_clear:
                    most = -APART_MM
        return None

    def _along(self, segment: Segment, s: Array, tool: Tool, kinematics: Kinematics) -> list[Hit]:
        return self._at(joints_along(segment, s, kinematics), tool, kinematics)

    @staticmethod
    def _poses(joints: Array, tool: Tool, kinematics: Kinematics) -> tuple[Array, Array]:
        """Tips and axes, (3, N) each."""
        pose = kinematics.forward(tuple(joints.T), tool.length_mm, np)
        tips, axes = (rows(vector, joints.shape[:1]) for vector in pose)
        return tips, axes

    def _at(self, joints: Array, tool: Tool, kinematics: Kinematics) -> list[Hit]:
        tips, axes = self._poses(joints, tool, kinematics)
        return [Hit(float(d), int(n)) for d, n in zip(*self.depths(tips, axes, tool), strict=True)]


NONE = Walls()  # of a program of lines


def _places(segment: Segment) -> Array:
    """Places of a way aside, so close that nothing is passed between them."""
    count, motion = LEAD_POSES, segment.motion
    if isinstance(motion, JointMove):
        turns = zip(motion.start_rotaries, motion.end_rotaries, strict=True)
        turned = max(abs(a - b) for a, b in turns)
        count = 2 + math.ceil(max(motion.end / STEP_MM, turned / STEP_RAD))
    return np.linspace(0.0, motion.end, count)


def _depth(points: Array, tip: Array, axis: Array, tool: Tool) -> float:
    """The deepest of ``points`` (3, N) in a tool; below 0 the nearest is so far off it."""
    height, off = audit.above(points, tip, axis)
    deepest = audit.in_flank(height, off, tool)
    for low, high, wide in tool.holder:
        there = (height >= low) & (height <= high)
        if there.any():
            deepest = max(deepest, wide - float(off[there].min()))
    return deepest
