"""Touches on a part that lies on the table as nobody knows, made from its nominal features."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import numpy as np

from controller.calibration.touch_table import Touches
from controller.geometry.vectors import Frame, add, rotate, unit
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine

LENGTH_MM, RADIUS_MM = 120.0, 2.0


def moved(frame: Frame, shift, turn_deg) -> Frame:
    """A frame moved and turned a little, about its own axes."""
    axes = (frame.x, frame.y, frame.z)
    for about, angle in zip(axes, turn_deg, strict=True):
        axes = tuple(rotate(about, math.radians(angle), v) for v in axes)
    return Frame(add(frame.origin, shift), *axes)


def touched(
    machine: Machine,
    part: Frame,
    places: Sequence[tuple[str, Sequence[float], Sequence[float]]],
    rng: random.Random,
    scatter_mm: float = 0.0,
    off_mm: float = 0.0,
    tilts=((0.0, 0.0),),
) -> Touches:
    """``places``: (feature, point, normal out of the material), part frame; ``off_mm``: too much material."""
    kinematics, linear, rows = kinematics_of(machine), list(machine.linear()), []
    for k, (name, point, normal) in enumerate(places):
        out = unit(tuple(float(c) for c in normal))
        reach = RADIUS_MM + off_mm + rng.gauss(0.0, 1.0) * scatter_mm
        pair = tilts[k % len(tilts)]
        joints = []
        for far in (reach, reach + 1.0):
            ball = part.to_parent(add(tuple(float(c) for c in point), tuple(far * c for c in out)))
            xyz = kinematics.linear(ball, pair, LENGTH_MM)
            joints.append(np.array(kinematics.arrange((*xyz, *pair))))
        rows.append((name, joints[0], (joints[0] - joints[1])[linear]))
    n = len(rows)
    ways = np.array([way for _, _, way in rows])
    joints = np.array([joint for _, joint, _ in rows])
    flat = np.full(n, LENGTH_MM), np.full(n, RADIUS_MM)
    return Touches(joints, ways, *flat, np.zeros_like(joints), tuple(name for name, _, _ in rows))
