"""Machines with limits of any size, and paths that turn the tool far: what a feed law may be asked for."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
from support.machines.stepped_runs import shipped
from support.parts import random_nurbs
from support.parts.random_nurbs import Nurbs

from controller.machine.model import Limits, Machine

NAMES = ("trunnion", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique45")

# Of X Y Z and of A and C in the published case: mm or rad, and seconds.
PUBLISHED_LINEAR = Limits(100.0, 500.0, 3000.0)
PUBLISHED_ROTARY = {"A": Limits(0.4, 0.5, 1.5), "C": Limits(0.8, 0.5, 1.5)}

# Powers of ten between which velocity, acceleration and jerk are drawn.
LINEAR = ((0.7, 2.7), (1.0, 5.0), (2.0, 6.0))
ROTARY = ((-1.0, 1.0), (-1.0, 3.0), (0.0, 4.0))
OWN = 0.3  # power of ten by which an axis differs from the others of its kind


def published(jerk: float = 1.0) -> Machine:
    """The trunnion with the limits of the published two-rail case, the jerk ``jerk`` times."""
    machine = shipped()
    axes = []
    for axis in machine.axes:
        limits = PUBLISHED_ROTARY.get(axis.name, PUBLISHED_LINEAR)
        axes.append(replace(axis, limits=replace(limits, jerk=limits.jerk * jerk)))
    return replace(machine, axes=tuple(axes))


def drawn(seed: int) -> Machine:
    """A shipped machine with limits drawn over decades, and travel for anything."""
    rng = random.Random(seed)
    machine = shipped(rng.choice(NAMES))
    linear, rotary = ([10.0 ** rng.uniform(*decades) for decades in kind] for kind in (LINEAR, ROTARY))
    axes = []
    for axis in machine.axes:
        values = rotary if axis.is_rotary else linear
        limits = Limits(*(value * 10.0 ** rng.uniform(-OWN, OWN) for value in values))
        travel = 150.0 if axis.is_rotary else 2000.0  # rad or mm, within what the drives can count
        axes.append(replace(axis, limits=limits, travel_min=-travel, travel_max=travel))
    return replace(machine, axes=tuple(axes), max_quick_stop_s=60.0)  # slow ones brake as slowly


def rails(
    rng: random.Random, degree: int, count: int, turn_deg: float, tilt_deg: float, size: float = 1.0
) -> tuple[Nurbs, Nurbs]:
    """(upper, lower) of ``count`` points: an S of 100 mm times ``size`` on which the tool turns."""
    spans = count - degree
    knots = [0.0] * (degree + 1) + [round(k / spans, 4) for k in range(1, spans)] + [1.0] * (degree + 1)
    sway, points = rng.uniform(-20.0, 20.0), []
    for k in range(count):
        share = sum(knots[k + 1 : k + degree + 1]) / degree
        foot = size * np.array(
            [80.0 * share - 40.0, sway * math.sin(math.tau * share) + rng.uniform(-1.0, 1.0), 0.0]
        )
        way, tilt = math.radians(turn_deg * (share - 0.5)), math.radians(tilt_deg + rng.uniform(-3.0, 3.0))
        lean = (math.sin(tilt) * math.cos(way), math.sin(tilt) * math.sin(way), math.cos(tilt))
        points.append((foot + 20.0 * np.array(lean), foot))
    upper, lower = (np.round([pair[i] for pair in points], 4) for i in (0, 1))
    return Nurbs(upper, knots, [1.0] * count, degree), Nurbs(lower, knots, [1.0] * count, degree)


def two_rails() -> str:
    """A path as the published one: curves of order 4 with eight points, the tool turning by 180 degrees."""
    return random_nurbs.text(*rails(random.Random(7), 3, 8, 180.0, 35.0), 60_000.0)


def any_path(seed: int) -> str:
    """A blade, or rails of one span or several, at any feed."""
    rng = random.Random(seed)
    feed, kind = 10.0 ** rng.uniform(2.5, 5.0), rng.choice(("blade", "one span", "spans"))
    if kind == "blade":
        return random_nurbs.text(*random_nurbs.blade(seed, rng.choice((1, 2, 3, 16))), feed)
    degree = rng.choice((3, 5, 7)) if kind == "one span" else 3
    count = degree + 1 if kind == "one span" else 8
    turn, tilt, size = rng.uniform(-180.0, 180.0), rng.uniform(10.0, 40.0), 10.0 ** rng.uniform(-0.5, 0.3)
    return random_nurbs.text(*rails(rng, degree, count, turn, tilt, size), feed)
