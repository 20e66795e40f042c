"""Where laws are sought: samples see narrow places, knots gather where much happens in time."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from support.machines.stepped_runs import program, shipped
from support.machines.traced_programs import trace

from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.feed import mesh
from controller.plan.feed.course import FeedCourse
from controller.plan.segment import ContinuousPath, Segment


def cuts(feed: str, machine: Machine) -> list[Segment]:
    home = tuple(axis.homing.position for axis in machine.axes)
    source = "G61\n" + program("example2.ngc", feed)  # the surfaces themselves, without a blend
    items = trace(source, machine, home).items  # type: ignore[arg-type]
    return [s for item in items if isinstance(item, ContinuousPath) for s in item.segments if s.cutting]


def second_cut(feed: str = "3000.") -> mesh.Parts:
    machine = shipped()
    course = FeedCourse(cuts(feed, machine)[1:], machine, kinematics_of(machine))
    return mesh.Parts.of(course, 0.0, course.length)


def test_neighbouring_samples_allow_about_the_same() -> None:
    parts = second_cut()
    found = mesh.survey(parts)
    assert (np.diff(found.s) > 0.0).all() and found.s[0] == 0.0 and found.s[-1] == parts.course.length
    assert (np.abs(np.diff(np.log(found.allowed))) <= np.log(mesh.ROUGH) + 1e-12).all()


def test_the_estimate_begins_and_ends_at_rest_and_is_nowhere_above_feed_and_limits() -> None:
    parts = second_cut()
    found = mesh.survey(parts)
    v = mesh.estimate(parts, found)
    assert v[0] == v[-1] == 0.0 and (v[1:-1] > 0.0).all()
    assert (v <= np.minimum(found.feed, found.allowed) * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("j", [1.0, 5e4])
def test_times_of_a_start_with_constant_jerk_are_those_of_s_as_t_cubed(j: float) -> None:
    t = np.linspace(0.0, 0.1, 200)
    found = mesh.times(j * t**3 / 6.0, j * t**2 / 2.0)
    np.testing.assert_allclose(found[1:], t[1:], rtol=0.01, atol=2e-4)


def test_knots_lie_evenly_in_time_where_something_happens() -> None:
    parts = second_cut()
    found = mesh.survey(parts)
    v = mesh.estimate(parts, found)
    s, part = mesh.knots(found, v, 0.005)
    assert s[0] == 0.0 and s[-1] == parts.course.length and (np.diff(s) > 0.0).all()
    assert len(part) == len(s) - 1
    step = np.diff(np.interp(s, found.s, mesh.times(found.s, v)))
    busy = found.allowed < mesh.HEADROOM * found.feed
    there = np.interp(0.5 * (s[1:] + s[:-1]), found.s, busy.astype(float)) == 1.0
    assert np.count_nonzero(there) > 20 and step[:-1][there[:-1]].max() <= 0.006
    assert step[0] == pytest.approx(mesh.FROM_REST * 0.005, rel=0.4)


def test_an_even_feed_takes_few_knots_however_long_the_course() -> None:
    counts = []
    for feed in ("10.", "1."):
        parts = second_cut(feed)
        found = mesh.survey(parts)
        counts.append(len(mesh.knots(found, mesh.estimate(parts, found), 0.003)[0]))
    assert max(counts) < 400 and counts[1] < counts[0] + 50


def test_braking_slows_from_the_present_motion_to_the_feed() -> None:
    parts = second_cut("100.")
    found = mesh.survey(parts, 16.0, 300.0)
    s, v = mesh.braking(found, 16.0, 300.0)
    assert v[0] == 16.0 and v[1] > 16.0  # it still gains a little
    assert v[-1] == pytest.approx(100.0 / 60.0, rel=1e-6) and (np.diff(s) >= 0.0).all()
    inside = (found.s > s[0]) & (found.s < s[-1])
    assert np.count_nonzero(inside) > 20


def test_smoothing_takes_kinks_out_and_keeps_even_speeds() -> None:
    parts = second_cut("100.")
    found = mesh.survey(parts)
    v = mesh.estimate(parts, found)
    smooth = mesh.smoothed(found, v, 0.0, 0.05)
    middle = np.abs(found.s - 15.0) < 5.0
    np.testing.assert_allclose(smooth[middle], v[middle], rtol=1e-6)


@pytest.mark.parametrize("ulps", range(-3, 4))
def test_a_mark_that_is_off_an_end_by_rounding_makes_no_part(ulps: int) -> None:
    """Or the law would look for the time that no way takes: an array too big for any computer."""
    first, last = 0.0, 40.0
    for _ in range(abs(ulps)):
        first, last = np.nextafter(first, ulps), np.nextafter(last, 99.0 * ulps)
    course = SimpleNamespace(marks=np.array([0.0, 10.0, 40.0]), index=lambda s: np.searchsorted([10.0], s))
    parts = mesh.Parts.of(course, first, last)  # type: ignore[arg-type]
    assert parts.ends.tolist() == [first, 10.0, last] and parts.index.tolist() == [0, 1]
