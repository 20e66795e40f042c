"""G0 to G3 as joint moves: targets, arcs, full circles, helices, turned offsets."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from support.machines.traced_programs import assert_whole, mill, named, segments, trace

from controller.geometry.vectors import Frame
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Joints
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import Segment
from controller.program.program import ProgramError

START: Joints = (0.0, 0.0, 0.0, 0.0, 0.0)
MILL = mill()
TURNING = mill(axes=tuple(replace(axis, travel_min=-9e3, travel_max=9e3) for axis in MILL.axes))
KINEMATICS = kinematics_of(MILL)


def only(text: str) -> Segment:
    """The segment of a program of one move, in G55 (no offset) unless it says G54."""
    (segment,) = segments(trace(text if "G54" in text else "G55 " + text, MILL, START))
    return segment


def at(segment: Segment, share: float) -> tuple[float, float, float]:
    x, y, z, *_ = joints_along(segment, np.array([segment.motion.end * share]), KINEMATICS)[0]
    return float(x), float(y), float(z)


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("G0 X10. Y-5.", (10, -5, 0, 0, 0)),
        ("G0 Z3. C90.", (0, 0, 3, 0, math.pi / 2)),
        ("G54 G0 X0.", (8, 0, 0, 0, 0)),
        ("G54 G0 X1. Y2. Z3.", (9, 98, 123, 0, 0)),
        ("G54 G53 G0 X1. Y2.", (1, 2, 0, 0, 0)),
        ("G54 G91 G1 X1. Y2. F100.", (1, 2, 0, 0, 0)),
        ("G20 G0 X1.", (25.4, 0, 0, 0, 0)),
    ],
)
def test_targets_are_program_values_plus_offset(text: str, end: Joints) -> None:
    assert only(text).end == pytest.approx(end)


def test_g43_adds_the_tool_length_to_z_words_only() -> None:
    built = replace(MILL, tools=(replace(MILL.tools[0], length_mm=40.0),))
    traced = trace("G55 G43 G0 X5.\nZ10.\n", built, START)
    assert [s.end[:3] for s in segments(traced)] == [(5.0, 0.0, 0.0), (5.0, 0.0, 50.0)]


def test_in_a_turned_offset_words_run_along_its_axes() -> None:
    turned = Frame((10.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
    built = replace(MILL, offsets=(turned, *MILL.offsets[1:]))
    traced = trace("G0 X5. Y0.\nG91 G1 X1. F60.\nG90 G3 X0. Y6. I-6. F60.\n", built, START)
    ends = [s.end[:3] for s in segments(traced)]
    assert np.allclose(ends, [(10, 5, 0), (10, 6, 0), (4, 0, 0)])
    assert_whole(traced, built, START)


def test_feed_and_length_are_degrees_where_only_rotaries_move() -> None:
    segment = only("G1 C90. F360.")
    assert segment.motion.end == pytest.approx(90.0)
    assert segment.feed_mm_s == pytest.approx(6.0)


@pytest.mark.parametrize("before", ["", "G91 ", "G43 H1 ", "G43.4 H0 "])
@pytest.mark.parametrize("words", ["A90", "X1 A90", "X1 Y2 Z3 A90 C0", "Z3 A54 C72"])
@pytest.mark.parametrize("unit", ["G20", "G21"])
def test_f_is_degrees_a_minute_wherever_no_more_than_rotaries_move(
    unit: str, words: str, before: str
) -> None:
    """RS274/NGC 2.1.2.5 B and C, by what moves and not by the words; two rotaries by their root."""
    if before == "G91 ":
        words = " ".join(f"{word[0]}0" if word[0] in "XYZ" else word for word in words.split())
    text = f"{unit} G94 G55 {before.replace('G91', 'G90')}G0 X1 Y2 Z3\n{before}G1 {words} F10"
    turn = segments(trace(text, TURNING, START))[-1]
    seconds = turn.motion.end / float(turn.feed_at(np.array([0.5 * turn.motion.end]))[0])
    assert seconds == pytest.approx(540.0, rel=1e-6)


@pytest.mark.parametrize(("unit", "mm"), [("G20", 25.4), ("G21", 1.0)])
def test_f_is_of_lengths_wherever_a_length_moves_beside_rotaries(unit: str, mm: float) -> None:
    text = f"{unit} G94 G55 G0 X1 Y2 Z3\nG1 X1.5 A90 F10"
    both = segments(trace(text, TURNING, START))[-1]
    assert both.motion.end == pytest.approx(0.5 * mm)
    assert both.feed_mm_s == pytest.approx(10.0 * mm / 60.0)


def test_moves_to_where_the_axes_are_are_left_out() -> None:
    assert not segments(trace("G55 G1 X0. F100.\nG0 Y0.\n", MILL, START))


@pytest.mark.parametrize(
    ("text", "middle", "length"),
    [
        ("G3 X-10. Y0. I-5. F100.", (-5, 5, 0), 5 * math.pi),
        ("G2 X-10. Y0. I-5. F100.", (-5, -5, 0), 5 * math.pi),
        (
            "G3 X10. Y10. J10. F100.",
            (10 * math.sin(0.25 * math.pi), 10 - 10 * math.cos(0.25 * math.pi), 0),
            5 * math.pi,
        ),
        ("G2 X10. Y10. R-10. F100.", (10 - 10 * math.cos(0.25 * math.pi), 0, 0), 15 * math.pi),
        ("G3 I5. F100.", (10, 0, 0), 10 * math.pi),
        ("G3 I5. P3 F100.", (10, 0, 0), 30 * math.pi),
        ("G18 G3 Z-10. K-5. F100.", (5, 0, -5), 5 * math.pi),
        ("G18 G2 Z-10. K-5. F100.", (-5, 0, -5), 5 * math.pi),
        ("G19 G3 Y-10. J-5. F100.", (0, -5, 5), 5 * math.pi),
        ("G3 X-10. Y0. Z4. I-5. F100.", (-5, 5, 2), math.hypot(5 * math.pi, 4)),
    ],
)
def test_arcs_pass_their_middle_and_have_their_length(
    text: str, middle: tuple[float, float, float], length: float
) -> None:
    segment = only(text)
    if "R-10" not in text:
        assert at(segment, 0.5) == pytest.approx(middle, abs=1e-9)
    assert segment.motion.end == pytest.approx(length)
    assert at(segment, 0.0) == pytest.approx(segment.start[:3], abs=1e-9)
    assert at(segment, 1.0) == pytest.approx(segment.end[:3], abs=1e-9)


def test_r_form_takes_the_short_way_and_with_a_minus_the_long_way() -> None:
    seed = 77
    rng = random.Random(seed)
    for _ in range(50):
        x, y = rng.uniform(-9, 9), rng.uniform(-9, 9)
        radius = rng.uniform(0.51, 3.0) * math.hypot(x, y)
        for word in ("G2", "G3"):
            short, long = (only(f"{word} X{x:.6f} Y{y:.6f} R{r:.6f} F100.") for r in (radius, -radius))
            assert short.motion.end + long.motion.end == pytest.approx(2 * math.pi * radius, rel=1e-5), seed
            assert short.motion.end <= long.motion.end, seed
            # G2 keeps the centre of the short way on the right of the chord.
            mx, my, _ = at(short, 0.5)
            left = x * (my - y / 2) - y * (mx - x / 2)
            assert (left > 0.0) == (word == "G2"), seed


def test_rounded_centre_words_still_end_exactly_on_the_end_point() -> None:
    segment = only("G3 X7.071 Y2.929 J10. F100.")
    assert at(segment, 1.0) == pytest.approx((7.071, 2.929, 0.0), abs=1e-9)


@pytest.mark.parametrize(("radius", "most"), [(0.1, 0.0282), (20.0, 0.0282), (40.0, 0.0399), (80.0, 0.0499)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("degrees", [20.0, 90.0, 180.0, 270.0, 340.0, 359.9, 360.0])
def test_an_arc_whose_ends_differ_a_little_stays_near_its_circle_and_ends_on_its_end(
    degrees: float, sign: float, radius: float, most: float
) -> None:
    """0.0283 mm, or 0.1 % of the radius up to 0.05 mm: LinuxCNC's allowance, and the default of the key."""

    def ended(off: float) -> tuple[float, float, Segment]:
        angle, last = math.radians(degrees), radius + sign * off
        x, y = last * math.cos(angle) - radius, last * math.sin(angle)
        (arc,) = segments(trace(f"G55 G3 X{x:.9f} Y{y:.9f} I{-radius} F100.", TURNING, START))
        return x, y, arc

    x, y, arc = ended(most)
    joints = joints_along(arc, np.linspace(0.0, arc.motion.end, 201), KINEMATICS)
    off = np.hypot(joints[:, 0] + radius, joints[:, 1]) - radius
    assert np.abs(off).max() <= 1.2 * most
    assert joints[-1, :2] == pytest.approx((x, y), abs=1e-8)
    assert joints[0, :2] == pytest.approx((0.0, 0.0), abs=1e-9)
    turned = np.unwrap(np.arctan2(joints[:, 1], joints[:, 0] + radius))
    assert math.degrees(turned[-1] - turned[0]) == pytest.approx(degrees, abs=1e-5)
    with pytest.raises(ProgramError, match="from its centre and ends"):
        ended(most + 0.0006)


def test_the_machine_file_says_how_far_the_ends_of_an_arc_may_differ() -> None:
    text = "G55 G3 X-20.05 Y0. I-10. F100.\n"
    strict, wide = replace(TURNING, arc_tolerance_mm=0.02), replace(TURNING, arc_tolerance_mm=2.8)
    with pytest.raises(ProgramError, match=r"they may differ by 0.0283 mm"):
        trace(text, TURNING, START)
    with pytest.raises(ProgramError, match=r"they may differ by 0.0200 mm"):
        trace(text, strict, START)
    assert segments(trace("G55 G3 X-400. Y0. I-199.91 F100.\n", wide, START))


def test_turns_that_nearly_close_stay_about_their_centre() -> None:
    """A centre moved between ends 0.02 mm apart would be half a radius off."""
    traced = trace("G55 G3 X-0.02 Y0.0001 I-50. P3 F100.\n", TURNING, START)
    (arc,) = segments(traced)
    joints = joints_along(arc, np.linspace(0.0, arc.motion.end, 401), KINEMATICS)
    assert np.abs(np.hypot(joints[:, 0] + 50.0, joints[:, 1]) - 50.0).max() < 0.021
    assert arc.motion.end == pytest.approx(2.0 * 2.0 * math.pi * 50.0, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("G3 X10. Y0. I4. F100.", "begins 4.0000 mm from its centre and ends 6.0000 mm from it"),
        ("G3 X10. Y0. R4. F100.", "R 4.0000 mm cannot reach an end 10.0000 mm away"),
        ("G3 X0. Y0. R4. F100.", "needs an end point other than its start"),
        ("G3 X1. I0. J0. F100.", "the centre of this arc is its start"),
    ],
)
def test_arcs_without_a_circle_are_refused(text: str, sentence: str) -> None:
    with pytest.raises(ProgramError, match=sentence) as refused:
        only(text)
    assert (refused.value.line, refused.value.column) == (1, 5)


def test_an_arc_turns_its_rotaries_evenly() -> None:
    built = MILL
    traced = trace("G55 G3 X-10. Y0. C90. I-5. F100.\n", built, START)
    assert_whole(traced, built, START)
    (arc,) = named(traced, "arc")
    half = joints_along(arc, np.array([arc.motion.end / 2.0]), KINEMATICS)[0]
    assert half[4] == pytest.approx(math.pi / 4.0)
