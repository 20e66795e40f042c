"""A motion as chords: the fewest straight lines that stay within a tolerance of it.

The tool is held at two places, its tip and the top of what its flank cuts; both stay within the
tolerance of where they would be, whatever the lines' own interpolation makes of the axis between
two corners. Each line is as long as it may be, as a CAM system makes them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from controller.geometry.arrays import Array
from controller.machine.kinematics import Kinematics
from controller.motion.motions import JointMove
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment

Ends = tuple[Array, Array]  # tips and tops, each (N, 3), table frame

FIRST_SAMPLES, MAX_SAMPLES = 2001, 128_001
PER_CHORD = 12  # samples that a chord has at least on the average, so that none hides between them


class Form(Enum):
    """How the lines are written."""

    TIP = "tip"  # G43.4: tool tip and rotaries, the axis on the great circle
    JOINTS = "joints"  # positions of the machine's axes


@dataclass(frozen=True, eq=False)
class Samples:
    """A motion on a dense row of places."""

    s: Array  # (N,)
    joints: Array  # (N, axes)
    tips: Array  # (N, 3), table frame
    axes: Array  # (N, 3)
    height_mm: float  # from tip to top

    @property
    def tops(self) -> Array:
        return self.tips + self.height_mm * self.axes


def corners(
    segment: Segment, kinematics: Kinematics, form: Form, length_mm: float, height_mm: float, chord_mm: float
) -> tuple[Array, Array]:
    """Places s (N + 1,) and joints (N + 1, axes) of the corners of a motion's chords, its start too."""
    if isinstance(segment.motion, JointMove) and segment.feed_mm_s is None:
        return np.array([0.0, segment.motion.end]), np.array([segment.start, segment.end])
    count = FIRST_SAMPLES
    while True:
        found = sampled(segment, kinematics, length_mm, height_mm, count)
        row = _longest(found, kinematics, form, length_mm, chord_mm)
        if count >= MAX_SAMPLES or count >= PER_CHORD * len(row):
            return found.s[row], found.joints[row]
        count = 4 * (count - 1) + 1


def sampled(
    segment: Segment, kinematics: Kinematics, length_mm: float, height_mm: float, count: int
) -> Samples:
    """Evenly along a motion."""
    s = np.linspace(0.0, segment.motion.end, count)
    joints = joints_along(segment, s, kinematics)
    return Samples(s, joints, *poses(joints, length_mm, kinematics), height_mm)


def poses(joints: Array, length_mm: float, kinematics: Kinematics) -> Ends:
    """Tips and axes (N, 3) in the table frame."""
    pose: Any = kinematics.forward([*joints.T], length_mm, np)
    tip, axis = (
        np.stack([np.broadcast_to(np.asarray(x, dtype=float), (len(joints),)) for x in vector], axis=1)
        for vector in (pose.tip, pose.axis)
    )
    return tip, axis


def _longest(
    found: Samples, kinematics: Kinematics, form: Form, length_mm: float, chord_mm: float
) -> list[int]:
    """Rows at which chords meet: each ends at the last row to which it may lead."""

    def line(i: int, j: int) -> Ends:
        share = (found.s[i : j + 1] - found.s[i]) / (found.s[j] - found.s[i])
        if form is Form.JOINTS:
            joints = found.joints[i] + share[:, None] * (found.joints[j] - found.joints[i])
            tips, axes = poses(joints, length_mm, kinematics)
        else:
            tips = found.tips[i] + share[:, None] * (found.tips[j] - found.tips[i])
            axes = great_circle(found.axes[i], found.axes[j], share)
        return tips, tips + found.height_mm * axes

    last, row, step = len(found.s) - 1, [0], 16
    while row[-1] < last:
        row.append(_furthest(row[-1], last, step, lambda i, j: error(found, i, j, line) <= chord_mm))
        step = row[-1] - row[-2]
    return row


def _furthest(i: int, last: int, step: int, sound: Callable[[int, int], bool]) -> int:
    """The furthest row that is sound from i, seen from a first guess: doubled, then halved."""
    low, high = i + 1, min(i + max(step, 2), last)
    while sound(i, high):
        low = high
        if high == last:
            return last
        high = min(i + 2 * (high - i), last)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if sound(i, middle) else (low, middle)
    return low


def error(found: Samples, i: int, j: int, line: Callable[[int, int], Ends]) -> float:
    """How far a line between two rows leaves the motion, mm: across the way, at the tip and at the top.

    The line runs at a pace of its own; what it is ahead along the way is no error.
    """
    if j <= i + 1:
        return 0.0
    rows = slice(i, j + 1)
    s, tips, tops = found.s[rows], found.tips[rows], found.tops[rows]
    off, off_top = (here - there for here, there in zip((tips, tops), line(i, j), strict=True))
    way, way_top = np.gradient(tips, s, axis=0), np.gradient(tops, s, axis=0)
    size = (way * way).sum(axis=1)
    ahead = ((off * way).sum(axis=1) / np.maximum(size, 1e-12))[:, None]
    across = np.linalg.norm(off - ahead * way, axis=1).max()
    return float(max(across, np.linalg.norm(off_top - ahead * way_top, axis=1).max()))


def great_circle(a: Array, b: Array, share: Array) -> Array:
    """Unit vectors (N, 3) from a to b, evenly."""
    angle = float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    if angle < 1e-12:
        return np.broadcast_to(a, (len(share), 3))
    weights = np.sin((1.0 - share) * angle), np.sin(share * angle)
    return np.asarray((weights[0][:, None] * a + weights[1][:, None] * b) / np.sin(angle))
