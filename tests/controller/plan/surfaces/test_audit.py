"""Audits over samples: extremes between them, travel, depth of a cylinder in points."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.machines.traced_programs import mill

from controller.machine.model import Sense, Tool
from controller.messages import text
from controller.plan.surfaces import audit


def test_extremes_between_samples_are_seen() -> None:
    x = np.linspace(0.0, 2.0 * math.pi, 40) ** 1.1
    values = np.stack([np.sin(x + 0.123), np.cos(x)], axis=1)
    low, i, high, j = audit.extremes(x, values)
    assert values[:, 0].max() < 1.0 - 1e-4
    assert high[0] == pytest.approx(1.0, abs=2e-5)
    assert low[0] == pytest.approx(-1.0, abs=2e-4)
    assert x[j[0]] == pytest.approx(math.pi / 2.0 - 0.123, abs=0.2)
    assert (i[1], j[1]) == (int(np.argmin(values[:, 1])), 0)


def test_two_samples_and_straight_rows_have_their_ends_as_extremes() -> None:
    for n in (2, 3, 9):
        x = np.linspace(0.0, 1.0, n)
        low, _, high, _ = audit.extremes(x, np.stack([3.0 * x, -x], axis=1))
        assert (low.tolist(), high.tolist()) == ([0.0, -1.0], [3.0, 0.0])


def test_the_joint_farthest_outside_is_named_with_its_excess() -> None:
    built = mill()
    joints = np.zeros((5, 5))
    joints[3, 1], joints[2, 0] = 1010.0, -1002.0
    x = np.arange(5.0)
    excess = audit.outside(built, x, joints)
    assert excess is not None
    assert excess.axis == 1
    assert excess.by >= 10.0
    assert audit.outside(built, x, np.zeros((5, 5))) is None


def test_a_sentence_shows_the_configured_sense() -> None:
    axis = replace(mill().axes[4], sense=Sense.ISO, travel_min=math.radians(-10), travel_max=math.radians(20))
    excess = audit.Excess(4, 0, math.radians(25), math.radians(5))
    told = text(audit.describe(axis, excess))
    assert told.startswith("C would reach -25.000 deg, 5.000 deg beyond its travel of -20.000 to 10.000 deg")


def test_depth_counts_only_what_lies_above_the_end_of_the_cutter() -> None:
    points = np.array([[2.0, 0.0, 5.0], [0.5, 0.0, -1.0]]).T
    tips, axes = np.zeros((3, 1)), np.array([[0.0], [0.0], [1.0]])
    assert audit.depth(points, tips, axes, Tool(1, "", 3.0, 0.0, 9.0)) == pytest.approx(1.0)
    assert audit.depth(points, tips, axes, Tool(1, "", 1.5, 0.0, 9.0)) == 0.0


def test_what_is_surely_inside_is_never_outside() -> None:
    built, rng, sure = mill(), np.random.default_rng(5), 0
    low = np.array([axis.travel_min for axis in built.axes])
    high = np.array([axis.travel_max for axis in built.axes])
    for _ in range(2000):
        count = int(rng.integers(2, 6))
        middle = low + (high - low) * rng.uniform(-0.02, 1.02, len(low))
        joints = middle + (high - low) * rng.choice([1e-3, 0.03, 0.3]) * rng.uniform(-1, 1, (count, len(low)))
        if audit.surely_inside(built, [tuple(row) for row in joints.tolist()]):
            sure += 1
            assert audit.outside(built, np.linspace(0.0, 1.0, count), joints) is None
    assert sure > 200
