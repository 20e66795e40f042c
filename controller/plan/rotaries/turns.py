"""Angles up to whole turns: what following a rotary along a path needs everywhere."""

from __future__ import annotations

import math

import numpy as np

from controller.geometry.arrays import Array

TURN = 2.0 * math.pi
JUMP_RAD = 0.5  # largest change between two samples that needs no further halving
SAME_ROTARY_RAD = (
    1e-6  # rotaries nearer than this are in one place, and at a joint run through as the poses do
)
SAME_AXIS_RAD = 1e-8  # two tool axes nearer than this are one: what jumps there, jumps
NAN = (math.nan, math.nan)


def wrapped(angle: Array) -> Array:
    """Angles in (-pi, pi]."""
    return np.asarray(angle - TURN * np.round(angle / TURN))
