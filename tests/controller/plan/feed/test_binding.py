"""What binds where: the codes and marks against motions whose binding limit is known beforehand."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support.machines.shipped_kinds import machine
from support.machines.traced_programs import segments, trace

from controller.ipc.handoff import Law
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Limits, Machine
from controller.plan.feed import binding, profile
from controller.plan.feed.course import FeedCourse
from controller.plan.feed.law import straight
from controller.state.modes import Binding, axis_binding

V, A, J = 0, 1, 2


def limited(name: str, limits: Limits) -> Machine:
    """A machine on which one axis has other limits."""
    built = machine(rapid_share=1.0)
    axes = tuple(replace(a, limits=limits) if a.name == name else a for a in built.axes)
    return replace(built, axes=axes)


def line(text: str, built: Machine) -> FeedCourse:
    """The course of the last move of a program."""
    return FeedCourse(segments(trace(text, built))[-1:], built, kinematics_of(built))


def even(course: FeedCourse, feed: float, acceleration: float, jerk: float) -> list[tuple[int, Law]]:
    return [(0, straight(course.length, feed, acceleration, jerk))]


def codes_of(course: FeedCourse, laws: list[tuple[int, Law]]) -> set[int]:
    return {code for marks in binding.marks(course, laws) for _, code in marks}


def test_a_cruise_at_the_programmed_feed_is_bound_by_the_feed() -> None:
    course = line("G1 X50 F600\n", machine())
    marks = binding.marks(course, even(course, 10.0, 500.0, 1e4))[0]
    middle = [code for t, code in marks if t < 2.0][-1]
    assert middle == Binding.FEED


def test_with_an_override_it_is_the_feed_times_override_that_binds() -> None:
    built = machine()
    half = line("G1 X50 F600\n", built)
    half = FeedCourse(half.segments, built, kinematics_of(built), override=0.5)
    assert Binding.FEED in codes_of(half, even(half, 5.0, 500.0, 1e4))
    full = FeedCourse(half.segments, built, kinematics_of(built))
    assert codes_of(full, even(full, 5.0, 500.0, 1e4)) == {Binding.NOTHING}


LIMITS = Limits(40.0, 100.0, 400.0)
BINDING = [
    # of X: what it is, feed of the law, its acceleration and jerk
    (V, 40.0, 20.0, 100.0),
    (A, 35.0, 100.0, 300.0),
    (J, 30.0, 95.0, 400.0),
]


@pytest.mark.parametrize("kind, v, a, j", BINDING, ids=["velocity", "acceleration", "jerk"])
def test_an_axis_that_is_used_to_its_limit_is_named_with_the_kind(
    kind: int, v: float, a: float, j: float
) -> None:
    course = line("G1 X90 F6000\n", limited("X", LIMITS))
    found = codes_of(course, even(course, v * 0.998, a * 0.998, j * 0.998))
    assert found - {Binding.NOTHING} == {axis_binding(0, kind)}


def test_rapids_bind_at_their_share_of_the_limits() -> None:
    built = machine(rapid_share=0.5)
    course = line("G0 X90\n", built)
    found = codes_of(course, even(course, 0.5 * 200.0 * 0.998, 500.0, 1e4))
    assert axis_binding(0, V) in found and Binding.FEED not in found


def test_of_two_axes_the_one_that_is_nearer_to_its_limit_is_named() -> None:
    built = limited("Y", Limits(40.0, 100.0, 400.0))
    course = line("G1 X60 Y60 F6000\n", built)
    v = 40.0 * math.sqrt(2.0) * 0.998
    assert codes_of(course, even(course, v, 50.0, 200.0)) - {Binding.NOTHING} == {axis_binding(1, V)}


def test_a_junction_passed_as_fast_as_its_jump_allows_is_a_corner() -> None:
    built = machine()
    pair = segments(trace("G1 X20 F600\nG1 X40 Y0.02\n", built))[-2:]
    course = FeedCourse(pair, built, kinematics_of(built))
    speed = course.junctions[0]
    assert speed < 10.0
    laws = [(0, Law((0.0, pair[0].motion.end / speed), ((0.0, speed, 0, 0, 0, 0),)))]
    laws.append((1, Law((0.0, pair[1].motion.end / speed), ((0.0, speed, 0, 0, 0, 0),))))
    first, second = binding.marks(course, laws)
    assert first[-1][1] == Binding.CORNER and second[0] == (0.0, Binding.CORNER)
    assert first[0] == (0.0, Binding.NOTHING) and second[-1][1] == Binding.NOTHING


def test_marks_begin_at_zero_rise_differ_and_last_long_enough_to_be_read() -> None:
    course = line("G1 X90 F6000\n", limited("X", LIMITS))
    laws = even(course, 39.9, 99.8, 399.0)
    (marks,) = binding.marks(course, laws)
    times = [t for t, _ in marks] + [laws[0][1].duration_s]
    assert times[0] == 0.0 and np.diff(times).min() >= 0.020
    assert all(a[1] != b[1] for a, b in itertools.pairwise(marks))


def test_pieces_shorter_than_a_window_and_empty_ones_have_their_marks_too() -> None:
    course = line("G1 X0.01 F6000\n", machine())
    (marks,) = binding.marks(course, even(course, 10.0, 1000.0, 4e4))
    assert len(marks) == 1 and marks[0][0] == 0.0
    nothing = Law((0.0, 0.0), ((0.0,) * 6,))
    assert binding.marks(course, [*even(course, 10.0, 1000.0, 4e4), (0, nothing)])[1] == ()


def test_the_limits_of_the_tool_itself_bind_where_the_machine_file_has_them() -> None:
    built = machine()
    kinematics = kinematics_of(built)
    ring = line("G0 X0 Y0\nG3 X20 Y0 I10 F3000\n", built)
    tip = replace(built, tip_acceleration_mm_s2=90.0)
    slow = FeedCourse(ring.segments, tip, kinematics)
    planned = profile.plan(slow)
    assert planned is not None and planned.duration_s > ring.length / 30.0 * 0.99  # sqrt(90 * 10) = 30 mm/s
    assert Binding.TIP_ACCELERATION in codes_of(slow, planned.laws(slow))
    turn = line("G1 X5 C90 F3000\nG1 X10 A30 C180 F3000\n", built)
    lazy = FeedCourse(turn.segments, replace(built, axis_speed_rad_s=0.2), kinematics)
    planned = profile.plan(lazy)
    assert planned is not None and Binding.AXIS_ANGULAR_SPEED in codes_of(lazy, planned.laws(lazy))
