"""What of a wall a tool cuts and what it hits, by brute force: a tool is a stack of discs, pose by pose.

A disc of the flute cuts; one of the neck, the shank or the holder does not. A point of the wall is cut
when a disc that cuts has been over it, hit when one that does not is in the wall, or comes to it before it
is cut. No distance is measured and no time between poses: whether a point is inside of a disc is all.
Kinematics by rotation matrices (``tool_paths``); of ``controller`` the planned path and the tool's figures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from support.oracles import tool_paths

from controller.machine.model import Machine, Tool
from controller.plan.rotaries.branch import joints_along
from controller.runtime import checked
from controller.verify import passes

STEP_MM = 0.2  # of the tip, from pose to pose
LEVEL_MM = 5e-3  # the ends of a flute: a normal that leans leaves them by a hair


class Found(NamedTuple):
    """Shares of the points of a wall, with what is within ``slack_mm`` held against the tool or for it."""

    uncut: int
    hit: int
    uncut_in_doubt: int
    hit_in_doubt: int

    @property
    def is_bad(self) -> bool:
        return bool(self.uncut or self.hit)

    @property
    def is_good(self) -> bool:
        return not (self.uncut_in_doubt or self.hit_in_doubt)


def judged(text: str, machine: Machine, walls: Sequence[np.ndarray], within_mm: float) -> Found:
    """Of a program: each wall is points and normals (N, 2, 3) out of the part, in the frame of G54.

    Bad is what is off by more than 1.2 ``within_mm``, good what is off nowhere by more than half of it.
    """
    tips, axes, tools = _poses(text, replace(machine, gouge="warn"))
    points, normals = np.concatenate(walls).transpose(1, 0, 2)
    figures = []
    for cut_mm, stock_mm, wall_mm in (
        (1.2 * within_mm, -5e-3, -1.2 * within_mm),
        (0.5 * within_mm, 5e-3, -0.5 * within_mm),
    ):
        never = len(tips)
        ways = (points + share * cut_mm * normals for share in (0.02, 0.3, 1.0))
        cut = np.min([_first(way, tips, axes, tools, True) for way in ways], axis=0)
        at_wall = _first(points + stock_mm * normals, tips, axes, tools, False)
        in_wall = _first(points + wall_mm * normals, tips, axes, tools, False)
        figures += [int((cut == never).sum()), int(((at_wall < cut) | (in_wall < never)).sum())]
    return Found(*figures)


def _poses(text: str, machine: Machine) -> tuple[np.ndarray, np.ndarray, list[tuple[int, Tool]]]:
    """Tips and axes (M, 3) of every motion in turn, and from which pose on which tool is in the spindle."""
    task = checked.task(text.encode(), "wall.ngc", machine)
    walk = checked.path_of(task, checked.chosen_for(task))
    fitted = passes.Fitted.of(checked._blocks(task), machine)
    tips, axes, tools = list[np.ndarray](), list[np.ndarray](), list[tuple[int, Tool]]()
    for segment in checked.segments(walk).values():
        tool, end = fitted.at(segment.place.order), segment.motion.end
        s = np.linspace(0.0, end, max(8, int(end / STEP_MM)))
        joints = joints_along(segment, s, task.kinematics)
        tip, axis = tool_paths.tool(joints, machine, tool.length_mm)
        tools.append((sum(map(len, tips)), tool))
        tips.append(tip)
        axes.append(axis)
    return np.concatenate(tips), np.concatenate(axes), tools


def _first(
    points: np.ndarray, tips: np.ndarray, axes: np.ndarray, tools: list[tuple[int, Tool]], cuts: bool
) -> np.ndarray:
    """The first pose (N,) at which a point is inside of what cuts, or of what does not; M where none is."""
    found = np.full(len(points), len(tips))
    ends = [start for start, _ in tools[1:]] + [len(tips)]
    for (start, tool), stop in zip(tools, ends, strict=True):
        for first in range(start, stop, 256):
            here = slice(first, min(first + 256, stop))
            away = points[:, None, :] - tips[here]
            h = np.einsum("nmk,mk->nm", away, axes[here])
            rho = np.sqrt(np.maximum(np.einsum("nmk,nmk->nm", away, away) - h * h, 0.0))
            inside = _disc(tool, h, cuts) > rho
            any_ = inside.any(axis=1) & (found == len(tips))
            found[any_] = first + np.argmax(inside[any_], axis=1)
    return found


def _disc(tool: Tool, h: np.ndarray, cuts: bool) -> np.ndarray:
    """The radius of the disc at heights above the tip; below 0 where there is none."""
    corner, slope = tool.corner_mm, np.tan(tool.taper_rad)
    straight = tool.radius_mm - corner + corner / np.cos(tool.taper_rad)
    flank = straight + (np.maximum(h, 0.0) - corner) * slope
    if cuts:
        dip = np.sqrt(np.maximum(corner**2 - (corner - h) ** 2, 0.0))
        radius = np.where(h < corner * (1.0 - np.sin(tool.taper_rad)), tool.radius_mm - corner + dip, flank)
        return np.where((h >= -LEVEL_MM) & (h <= tool.flute_mm + LEVEL_MM), radius, -1.0)
    found = np.full(h.shape, -1.0)
    shank = straight + (tool.flute_mm - corner) * slope
    top = tool.holder[0][0] if tool.holder else np.inf
    found[(h > tool.flute_mm) & (h < top)] = shank
    for low, high, radius in tool.holder:
        found[(h > low) & (h < high)] = np.maximum(found[(h > low) & (h < high)], radius)
    return found
