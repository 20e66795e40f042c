"""Curves of G5, G5.1 and G5.2 on the stepped machine: path, feed and limits; restarts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.machines.interrupted_runs import ACCELERATION, JERK, VELOCITY, rest_of
from support.machines.stepped_runs import Cut, cut, largest, off_the_plan, shipped

from controller.machine.kinematics import kinematics_of
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.plan.segment import ContinuousPath

TEXT = """G21 G90 G54 G61 G17
G0 X0 Y0 Z40
G5 X20 Y8 I8 J12 P-6 Q6 F1500
G5 X40 Y0 P-8 Q8
G5.1 X60 Y10 I10 J-10
G5.2 P1 L4
X75 Y22 P2
X80 Y-10 P1
X60 Y-30 P0.5
X45 Y-12 P1
X30 Y-20 P1
G5.3
G5 X20 Y-28 I0 J0 P0 Q0
G5 X21 Y-24 I-9 J6 P10 Q6
M30
"""
# A slow start (I J nothing), a straight one on which the speed grows, and a hairpin of 0.05 mm.
FIRST, NURBS, HAIRPIN = 3, 6, 13


def run(name: str, **changes: object) -> Cut:
    return cut(TEXT, shipped(name, **changes))


@pytest.mark.parametrize("name", ["trunnion", "three_axes"])
def test_curves_are_run_on_the_path_within_the_limits_at_the_feed(name: str) -> None:
    done = run(name, period_s=0.004)
    assert off_the_plan(done, np.arange(0, len(done.joints), 7)) < 1e-6
    velocity, acceleration, jerk = largest(done.joints, done.machine)
    assert velocity < VELOCITY and acceleration < ACCELERATION and jerk < JERK
    curves = [i for i, s in done.segments.items() if s.name == "curve"]
    assert len(curves) == 8
    feeds = done.column("feed_mm_s")[np.isin(done.column("motion_id"), curves)]
    assert feeds.max() == pytest.approx(25.0, rel=1e-3)


CUSPS = {
    "cusp": "G5 X10 Y0 I10 J10 P-10 Q10",
    "nearly one": "G5 X10 Y0 I10.00001 J10 P-10 Q10",
    "hairpin": "G5 X10 Y0 I10.3 J10 P-10 Q10",
    "to and fro": "G5.1 X5 Y0 I20 J0",
    "and back": "G5.1 X0 Y0 I20 J0",
    "rational": "G5.2 X20 Y0 P3 L3\nX5 Y0 P1\nG5.3",
    "no way": "G5 X0 Y0 I0 J0 P0 Q0",
    "slow ends": "G5.2 X0 Y0 P1 L4\nX0 Y0 P1\nX10 Y10 P1\nX10 Y10 P1\nX10 Y10 P1\nG5.3",
}


@pytest.mark.parametrize("text", CUSPS.values(), ids=CUSPS)
def test_where_a_curve_turns_back_on_the_spot_the_limits_hold(text: str) -> None:
    done = cut(f"G21 G90 G54 G61 G17\nG0 X0 Y0 Z40\nF3000\n{text}\nM30\n", shipped(period_s=0.004))
    velocity, acceleration, jerk = largest(done.joints, done.machine)
    assert velocity < VELOCITY and acceleration < ACCELERATION and jerk < JERK
    assert off_the_plan(done, np.arange(0, len(done.joints), 7)) < 1e-6


def test_a_way_to_and_fro_goes_as_far_as_the_curve_does() -> None:
    done = cut("G21 G90 G54 G61 G17\nG0 X0 Y0 Z40\nF3000\nG5.1 X5 Y0 I20 J0\nM30\n", shipped())
    x = done.joints[:, done.machine.linear()[0]] - done.machine.offsets[0].origin[0]
    # x = 40 u (1 - u) + 5 u^2 is greatest at u = 4/7
    assert x.max() == pytest.approx(80.0 / 7.0, abs=1e-6)


def test_the_commanded_speed_of_the_tip_is_the_feed() -> None:
    done = run("trunnion")
    linear = list(done.machine.linear())
    speed = np.linalg.norm(np.diff(done.joints[:, linear], axis=0), axis=1) / done.machine.period_s
    told = done.column("feed_mm_s")
    ids = done.column("motion_id")
    steady = (np.abs(np.diff(told)) < 1e-9) & (told[1:] > 1.0) & (np.diff(ids) == 0)
    steady &= np.isin(ids[1:], [i for i, s in done.segments.items() if s.name == "curve"])
    assert steady.sum() > 100
    assert np.abs(speed[steady] / told[1:][steady] - 1.0).max() < 1e-4


@pytest.mark.parametrize(("line", "fraction"), [(FIRST, 0.4), (NURBS, 0.1), (NURBS, 0.7)])
def test_a_fraction_of_a_curve_is_that_share_of_its_length(line: int, fraction: float) -> None:
    machine = shipped()
    rest = rest_of(TEXT, Spot(line, fraction), machine)
    assert rest.what == "curve" and rest.spot.line == line
    assert rest.spot.fraction == pytest.approx(fraction, abs=1e-9)
    items = [
        item for item in rest.entered((0.0, 0.0, 260.0, 0.0, 0.0), 1) if isinstance(item, ContinuousPath)
    ]
    k = next(i for i, chain in enumerate(items) if (chain.first_id or 0) < ENTRY_ID)
    motion = items[k].segments[0].motion
    there = motion.joints(items[k].from_s, (0.0, 0.0), kinematics_of(machine))
    assert there is not None and np.abs(np.subtract(there, rest.target.joints)).max() < 1e-9
    lengths = [s.motion.end for s in items[k].segments if s.place.line == line]
    left = sum(lengths) - items[k].from_s
    assert left > 0.0 and math.isfinite(left)
