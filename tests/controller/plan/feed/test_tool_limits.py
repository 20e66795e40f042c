"""Limits of the tool itself: what its tip and axis do in the part frame, and laws that keep them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.stepped_runs import program, shipped
from support.machines.traced_programs import trace

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.plan.feed import profile, tool_limits
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.search import Search
from controller.plan.segment import ContinuousPath


def courses(machine: Machine) -> list[FeedCourse]:
    """The runs of Example 2 at 3000 mm/min that have a feed, each surface as it is: G61 blends nothing."""
    home = tuple(axis.homing.position for axis in machine.axes)
    source = "G61\n" + program("example2.ngc", "3000.")
    items = trace(source, machine, home).items  # type: ignore[arg-type]
    kinematics = kinematics_of(machine)
    return [
        FeedCourse(run, machine, kinematics)
        for chain in items
        if isinstance(chain, ContinuousPath)
        for run in profile.split_at_stops(chain.segments, machine, kinematics)
        if run[0].feed_mm_s is not None
    ]


def test_the_tools_rates_are_those_of_the_pose() -> None:
    """Differences of the exact pose along the second surface agree with the series."""
    course = courses(shipped())[3]
    cut = course.segments[0].motion
    assert isinstance(cut, SurfaceCut)
    s, h = np.linspace(2.0, 30.0, 15), 1e-3
    found = tool_limits.rates(course, s, course.index(s))
    for i, at in enumerate(s):
        low, here, high = (cut.pose(float(x)) for x in (at - h, at, at + h))
        first = (np.array(high.tip) - low.tip) / (2 * h)
        second = (np.array(high.tip) - 2 * np.array(here.tip) + low.tip) / h**2
        assert found.along[i] == pytest.approx(np.linalg.norm(first), rel=1e-5)
        bend = np.hypot(found.bend_along[i], found.bend_across[i])
        assert bend == pytest.approx(np.linalg.norm(second), rel=1e-3, abs=1e-6)
        turn = np.linalg.norm((np.array(high.axis) - low.axis) / (2 * h))
        assert found.turn[i] == pytest.approx(turn, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize(("tip", "turn"), [(300.0, None), (None, 0.5), (150.0, 0.3)])
def test_a_law_keeps_the_limits_of_tip_and_axis_and_uses_them(tip: float | None, turn: float | None) -> None:
    machine = replace(shipped(), tip_acceleration_mm_s2=tip, axis_speed_rad_s=turn)
    used = [0.0, 0.0]
    for course in courses(machine):
        planned = profile.plan(course)
        assert planned is not None
        s, v, a, _ = planned.along(np.linspace(0.0, planned.duration_s, 3000))
        rates = tool_limits.rates(course, s, course.index(s))
        used[0] = max(used[0], float(rates.tip_acceleration(v, a).max()))
        used[1] = max(used[1], float((rates.turn * v).max()))
    if tip is not None:
        assert 0.97 * tip <= used[0] <= 1.001 * tip
    if turn is not None:
        assert 0.97 * turn <= used[1] <= 1.001 * turn


def test_without_such_limits_nothing_is_asked_of_the_tool() -> None:
    course = courses(shipped())[0]
    assert not tool_limits.has_limits(course.machine)
    assert tool_limits.rates_in(course, np.array([1.0]), np.array([0])) is None


def test_a_straight_line_needs_no_search_under_a_limit_of_the_tip() -> None:
    """It is no slower than what the search finds, and keeps the limit, also in a tilted direction."""
    machine = replace(shipped(), tip_acceleration_mm_s2=150.0, axis_speed_rad_s=0.3)
    home, kinematics = tuple(axis.homing.position for axis in machine.axes), kinematics_of(machine)
    for way in ("X0.3 Y0.1", "X9 Y-7 Z-3", "X0.004"):
        items = trace(f"G91 G1 {way} F3000\n", machine, home).items  # type: ignore[arg-type]
        (chain,) = (item for item in items if isinstance(item, ContinuousPath))
        course = FeedCourse(chain.segments, machine, kinematics)
        planned, searched = profile.plan(course), Search(course, 0.0, 0.0, 0.0, course.length).law()
        assert planned is not None and searched is not None and len(planned.pieces) <= 7
        assert planned.duration_s <= searched[0][-1] + 1e-9
        _, _, a, _ = planned.along(np.linspace(0.0, planned.duration_s, 3000))
        assert np.abs(a).max() <= 150.0
        (law,) = profile.straights(course)
        assert law.duration_s == planned.duration_s
