"""How far beside the path a machine stands whose drives stopped by ramps of their own.

The path is looked along from a place at or before the true one; what is nearest counts. The
distance is the tip's, with the tool that cuts there; the angle is that of the tool axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics
from controller.machine.model import Joints
from controller.plan.restart.restart import Rest
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Segment

AHEAD_MM = 200.0  # of the path, from the place on: more than a second of cut and the drives' ramps
STEP_MM = 0.25
FINE = 201  # samples between two neighbours of the nearest


@dataclass(frozen=True, slots=True)
class Beside:
    """The nearest place of the path, and how far the machine is off it."""

    line: int
    off_mm: float
    off_deg: float


def beside(rest: Rest, joints: Joints, kinematics: Kinematics) -> Beside | None:
    """Of a machine that stands at ``joints``; None where nothing of the path is left. Raises ProgramError."""
    tool = rest.target.modal.tool_in(rest.source.machine)
    length_mm = tool.length_mm if tool is not None else 0.0
    best: tuple[float, Beside] | None = None
    for segment, from_s in _ahead(rest):
        found = _nearest(segment, from_s, joints, length_mm, kinematics)
        if best is None or found[0] < best[0]:
            best = found
    return best[1] if best is not None else None


def _ahead(rest: Rest) -> list[tuple[Segment, float]]:
    """(segment, s from which on) of the path ahead."""
    made: list[tuple[Segment, float]] = []
    left_mm = AHEAD_MM
    for item in rest.items:
        for k, segment in enumerate(item.segments):
            from_s = item.from_s if k == 0 and isinstance(item, ContinuousPath) else 0.0
            made.append((segment, from_s))
            left_mm -= segment.motion.end - from_s
        if left_mm <= 0.0:
            break
    return made


def _nearest(
    segment: Segment, from_s: float, joints: Joints, length_mm: float, kinematics: Kinematics
) -> tuple[float, Beside]:
    end = min(segment.motion.end, from_s + AHEAD_MM)
    s = np.linspace(from_s, end, max(2, math.ceil((end - from_s) / STEP_MM) + 1))
    i = int(np.argmin(_distances(segment, s, joints, length_mm, kinematics)[0]))
    s = np.linspace(s[max(i - 1, 0)], s[min(i + 1, len(s) - 1)], FINE)
    off_mm, off_deg = _distances(segment, s, joints, length_mm, kinematics)
    i = int(np.argmin(off_mm))
    return float(off_mm[i]), Beside(segment.line_at(float(s[i])), float(off_mm[i]), float(off_deg[i]))


def _distances(
    segment: Segment, s: Array, joints: Joints, length_mm: float, kinematics: Kinematics
) -> tuple[Array, Array]:
    """Of the tips (mm) and between the tool axes (degrees) at the places ``s`` (N,)."""
    there = kinematics.forward(tuple(joints_along(segment, s, kinematics).T), length_mm, np)
    here = kinematics.forward(joints, length_mm)
    off = np.sqrt(sum((np.asarray(a) - b) ** 2 for a, b in zip(there.tip, here.tip, strict=True)))
    chord = np.sqrt(sum((np.asarray(a) - b) ** 2 for a, b in zip(there.axis, here.axis, strict=True)))
    turned = np.degrees(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))
    return np.broadcast_to(off, s.shape), np.broadcast_to(turned, s.shape)
