"""Machines whose axes miss something, as a shop has measured it."""

from __future__ import annotations

import random
from dataclasses import replace

from controller.machine.compensation import reserved
from controller.machine.deviation_tables import Pitch
from controller.machine.model import Machine

MOST_MM = 0.02  # of pitch
PLAY_MM = 0.03
REACH_MM = 250.0  # from zero, of a table


def with_tables(rng: random.Random, machine: Machine) -> Machine:
    """Each linear axis has pitch and play; what they need is off its limits, as of a machine file's."""
    axes = [axis if axis.is_rotary else replace(axis, pitch=_pitch(rng)) for axis in machine.axes]
    return replace(machine, axes=reserved(axes))


def _pitch(rng: random.Random) -> Pitch:
    many = rng.randrange(2, 6)
    at = [REACH_MM * (2.0 * k / (many - 1) - 1.0) for k in range(many)]
    means, play = [rng.uniform(-MOST_MM, MOST_MM) for _ in at], rng.uniform(-PLAY_MM, PLAY_MM)
    up, down = (tuple(mean + sense * 0.5 * play for mean in means) for sense in (-1.0, 1.0))
    return Pitch(tuple(at), up, down)
