"""G0 and G1 under G43.4 and G43.5 as exact lines: tip, axis, feed, poles, branches, refusals."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from support.machines.shipped_kinds import ROTARIES
from support.machines.traced_programs import HOME, assert_whole, mill, segments, trace

from controller.geometry.arrays import Array
from controller.geometry.vectors import angle_between, norm, subtract
from controller.machine.kinematics import kinematics_of
from controller.motion.motions import JointMove, ToolLine
from controller.plan.path import path
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Segment
from controller.plan.surfaces.rates import derivatives
from controller.program import blocks
from controller.program.program import ProgramError

MILL = mill()
TWO_NAMES = {name: rows[0][0] + rows[1][0] for name, rows in ROTARIES.items()}


def feeds(text: str, kind: str = "fig4a", **changes: object) -> list[Segment]:
    """The feed segments of a program, whole and inside travel."""
    built = mill(kind, **changes)
    traced = trace(text, built)
    assert_whole(traced, built)
    return [s for s in segments(traced) if s.feed_mm_s is not None]


def poses(segment: Segment, kind: str = "fig4a", count: int = 21) -> tuple[Array, Array]:
    """Tips and axes in the table frame at even places of a segment, from its joints."""
    kinematics = kinematics_of(mill(kind))
    rows = joints_along(segment, np.linspace(0.0, segment.motion.end, count), kinematics)
    tip, axis = kinematics.forward(rows.T, 0.0, np)
    return np.array([c + np.zeros(count) for c in tip]).T, np.array([c + np.zeros(count) for c in axis]).T


def refused(text: str, **changes: object) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        trace(text, mill(**changes))
    return caught.value


def assert_straight(tips: Array) -> None:
    share = np.linspace(0.0, 1.0, len(tips))[:, None]
    assert np.abs(tips - (tips[0] + share * (tips[-1] - tips[0]))).max() < 1e-9


def assert_great_circle(axes: Array) -> None:
    """One plane, even angles."""
    turns = [angle_between(tuple(a), tuple(b)) for a, b in itertools.pairwise(axes)]
    assert np.ptp(turns) < 1e-7
    assert angle_between(tuple(axes[0]), tuple(axes[-1])) == pytest.approx(sum(turns), abs=1e-7)


@pytest.mark.parametrize("kind", ["fig4a", "fig4b", "table_head", "head_head", "oblique"])
def test_under_tool_vectors_the_tip_is_straight_and_the_axis_on_the_great_circle(kind: str) -> None:
    text = "G55 G43.5 G0 X1 Y2 Z3 I.1 J.2 K1\nG1 X20 Y-5 Z4 I.3 J-.2 K1 F600\nX25 I.35 J-.1 K1\n"
    found = feeds(text, kind)
    ends = [((1, 2, 3), (0.1, 0.2, 1)), ((20, -5, 4), (0.3, -0.2, 1)), ((25, -5, 4), (0.35, -0.1, 1))]
    for segment, (first, last) in zip(found, itertools.pairwise(ends), strict=True):
        tips, axes = poses(segment, kind)
        assert_straight(tips)
        assert_great_circle(axes)
        for k, (tip, axis) in ((0, first), (-1, last)):
            assert norm(subtract(tuple(tips[k]), tip)) < 1e-9
            assert angle_between(tuple(axes[k]), axis) < 1e-9
        assert segment.motion.end == pytest.approx(math.dist(first[0], last[0]))
        assert segment.feed_mm_s == 10.0


@pytest.mark.parametrize("kind", ["fig4a", "table_head", "head_head", "oblique"])
def test_rotary_words_are_met_on_the_great_circle_or_evenly_as_the_machine_says(kind: str) -> None:
    a, b = TWO_NAMES[kind]
    text = f"G55 G43.4 G0 X0 Y0 Z0 {a}10 {b}5\nG1 X10 {a}30 {b}40 F600\n"
    (great,) = feeds(text, kind)
    (even,) = feeds(text, kind, tool_lines="joints")
    for segment in (great, even):
        assert np.allclose(np.degrees(segment.end[3:]), (30.0, 40.0))
        assert_straight(poses(segment, kind)[0])
    assert_great_circle(poses(great, kind)[1])
    rows = joints_along(even, np.linspace(0.0, even.motion.end, 11), kinematics_of(mill(kind)))
    assert np.abs(np.diff(rows[:, 3:], 2, axis=0)).max() < 1e-12


def test_where_the_great_circle_does_not_lead_to_the_words_the_rotaries_turn_evenly() -> None:
    for words in ("A10 C365", "A0 C90", "A20 C-300"):  # a whole turn, to the pole, the long way round
        (line,) = feeds(f"G55 G43.4 G0 X0 Y0 Z0 A10 C5\nG1 X10 {words} F600\n")
        assert isinstance(line.motion, ToolLine) and line.motion.even


def test_words_that_are_missing_keep_tip_rotaries_and_axis() -> None:
    first, second = feeds("G55 G43.4 G0 X1 Y2 Z3 A10 C5\nG1 X4 F600\nA12\n")
    tips, axes = poses(first)
    assert np.allclose(tips[-1], (4, 2, 3)) and np.ptp(axes, axis=0).max() < 1e-12
    tips, _ = poses(second)
    assert np.ptp(tips, axis=0).max() < 1e-9
    (vector,) = feeds("G55 G43.5 G0 X1 Y2 Z3 I1 J1 K2\nG1 X4 F600\n")
    assert np.ptp(poses(vector)[1], axis=0).max() < 1e-12


def test_a_turn_of_the_standing_tip_is_fed_in_degrees() -> None:
    (turn,) = feeds("G55 G43.5 G0 X1 Y2 Z3 I0 J0.1 K1\nG1 I0 J1 K1 F360\n")
    assert turn.motion.end == pytest.approx(45.0 - math.degrees(math.atan(0.1)))
    assert turn.feed_mm_s == 6.0


def test_the_feed_is_that_of_the_tip_also_where_the_turn_sets_the_measure() -> None:
    (line,) = feeds("G55 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 X0.1 C90 F600\n", tool_lines="joints")
    assert line.motion.end == pytest.approx(9.0)  # 10 degrees for each unit of s
    speed = float(line.feed_at(np.array([4.0]))[0])
    tips, _ = poses(line, count=101)
    assert speed * norm(subtract(tuple(tips[1]), tuple(tips[0]))) / 0.09 == pytest.approx(10.0)


def test_inverse_time_is_the_time_of_the_line() -> None:
    found = feeds("G55 G43.4 G0 X0 Y0 Z0 A10 C0\nG93 G1 X10 F30\nA30 F60\nX10.1 C90 F15\nG49 X30 F10\n")
    times = [s.motion.end / float(s.feed_at(np.array([0.0]))[0]) for s in found]
    assert times == pytest.approx([2.0, 1.0, 4.0, 6.0])


def test_distances_move_tip_and_rotaries_on() -> None:
    found = feeds("G55 G43.4 G0 X1 Y2 Z3 A10 C0\nG91 G1 X1 A5 F600\nG90 A20\n")
    assert np.degrees(found[0].end[3]) == pytest.approx(15.0)
    assert np.allclose(poses(found[0])[0][-1], (2, 2, 3))


def test_a_rapid_takes_the_tip_there_by_a_line_of_the_joints() -> None:
    traced = trace("G55 G43.4 G0 X1 Y2 Z3 A10 C20\nG53 G0 Z200\nG0 X1 Y2 Z3\n", MILL)
    moves = segments(traced)
    assert all(isinstance(s.motion, JointMove) and s.feed_mm_s is None for s in moves)
    assert moves[0].end == pytest.approx(moves[2].end) and moves[1].end[2] == 200.0


def test_the_tool_length_is_that_of_the_tool_named() -> None:
    tools = tuple(
        tool.__class__(tool.number, tool.name, 3.0, 40.0 * tool.number, 15.0) for tool in MILL.tools
    )
    built = mill(tools=tools)
    for words, length in (("G43.4", 40.0), ("G43.4 H2", 80.0), ("G43.4 H0", 0.0)):
        (move,) = segments(trace(f"G55 {words} G0 X1 Y2 Z3 A10 C20\n", built))
        tip = kinematics_of(built).forward(move.end, length).tip
        assert norm(subtract(tip, (1.0, 2.0, 3.0))) < 1e-9


# ---- poles and branches ------------------------------------------------------------


def test_a_line_through_the_pole_goes_on_without_a_turn() -> None:
    (line,) = feeds("G55 G43.5 G0 X0 Y0 Z0 I-.2 J-.1 K1\nG1 X10 I.2 J.1 K1 F600\n")
    assert line.start[4] == pytest.approx(line.end[4]) and line.start[3] == pytest.approx(-line.end[3])


def test_a_line_beside_the_pole_turns_about_it() -> None:
    traced = trace("G55 G43.5 G0 X0 Y0 Z0 I-.2 J-.1 K1\nG1 X10 I.2 J.1001 K1 F600\n", MILL)
    line = segments(traced)[-1]
    assert abs(line.start[4] - line.end[4]) > 3.0


def test_at_the_pole_the_rotary_turns_under_the_standing_tool() -> None:
    found = feeds("G55 G43.5 G0 X0 Y0 Z0 I-.2 J-.1 K1\nG1 X10 I0 J0 K1 F600\nX20 I.2 J-.15 K1\n")
    assert [s.name for s in found] == ["line", "swivel", "line"]
    assert np.ptp(poses(found[1])[0], axis=0).max() < 1e-9


def test_a_rapid_to_the_pole_turns_the_free_rotary_for_the_lines_to_come() -> None:
    found = feeds("G55 G43.5 G0 X0 Y0 Z0 I0 J0 K1\nG1 X5 F600\nX10 I.3 J.2 K1\n")
    assert [s.name for s in found] == ["line", "line"]


def test_the_branch_is_the_one_on_which_the_lines_to_come_stay_inside_the_travel() -> None:
    narrow = mill()
    axes = list(narrow.axes)
    axes[3] = axes[3].__class__(
        **{f: getattr(axes[3], f) for f in axes[3].__slots__} | {"travel_min": -0.2, "travel_max": 2.0}
    )
    built = mill(axes=tuple(axes))
    text = "G55 G43.5 G0 X0 Y0 Z0 I0 J.1 K1\nG1 X10 I0 J1 K1 F600\n"
    ends = [segments(trace(text, on))[-1].end[3] for on in (built, narrow)]
    assert ends[0] == pytest.approx(math.pi / 4) and abs(ends[1]) == pytest.approx(math.pi / 4)


def test_a_choice_from_outside_is_taken() -> None:
    text = b"G55 G43.5 G0 X0 Y0 Z0 I0 J.1 K1\nG1 X10 I0 J.2 K1 F600\n"
    tilt = math.atan(0.1)
    kinematics = kinematics_of(MILL)
    for wanted in ((tilt, 0.0), (tilt, 2.0 * math.pi), (-tilt, math.pi)):
        made = blocks.stream(text, MILL, "part.ngc")
        items = list(path.stream(made, "part.ngc", MILL, kinematics, HOME, {1: wanted}))
        first = items[0]
        assert isinstance(first, ContinuousPath)
        assert first.segments[0].end[3:] == pytest.approx(wanted)


# ---- running through and refusals ----------------------------------------------------


def test_exact_lines_run_through_slight_corners_and_stop_at_others() -> None:
    text = "G55 G61 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 X1 A10.1 F600\nX2 Y0.002 A10.2\nX3 Y1\n"
    chains = [item for item in trace(text).items if isinstance(item, ContinuousPath)]
    assert [len(chain.segments) for chain in chains] == [1, 2, 1]


def test_an_endless_row_of_exact_lines_comes_in_parts() -> None:
    rows = "".join(f"X{0.3 * k:.4f} A{10 + 0.03 * k:.4f}\n" for k in range(1, 200))
    traced = trace("G55 G61 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 F600\n" + rows)
    chains = [item for item in traced.items if isinstance(item, ContinuousPath)][1:]
    assert sum(len(chain.segments) for chain in chains) == 199
    assert [chain.runs_on for chain in chains] == [True] * (len(chains) - 1) + [False]
    assert max(len(chain.segments) for chain in chains) < 100


@pytest.mark.parametrize(
    ("text", "line", "phrase"),
    [
        ("G43.5 G0 X0 Y0 Z0 I0 J0 K1\nG1 X1 I0 J0 K-1 F60\n", 2, "turns over"),
        ("G43.5 G0 X0 Y0 Z0 I0 J0 K1\nG1 X1 I0 J1 K-1 F60\n", 2, "A would reach 135.000 deg"),
        ("G43.4 G0 X0 Y0 Z0\nG1 A121 F60\n", 2, "A would reach 121.000 deg"),
        ("G43.4 G0 X0 Y0 Z0 A121\n", 1, "A would reach 121.000 deg"),
        ("G64 P0.01\nG43.4 G0 X0 Y0 Z0\nG1 X1 A30 F60\nX2 A121\nX3 A10\n", 4, "A would reach"),
        ("G64 P0.01\nG43.5 G0 X0 Y0 Z0 I0 J0 K1\nG1 X1 F60\nX2 I0 J0 K-1\nX3\n", 4, "turns over"),
    ],
)
def test_lines_that_cannot_be_run_are_refused_with_their_line(text: str, line: int, phrase: str) -> None:
    error = refused(text)
    assert error.line == line and phrase in error.sentence


def test_an_axis_that_no_rotaries_give_is_refused() -> None:
    error = None
    for axis in ("I0 J0 K-1", "I0 J-1 K-.2"):
        try:
            trace(f"G55 G43.5 G0 X0 Y0 Z0 {axis}\n", mill("oblique"))
        except ProgramError as caught:
            error = caught
    assert error is not None and "no position of the rotary axes" in error.sentence


@pytest.mark.parametrize("words", ["I.3 J-.2 K1", "I0 J.3 K1", "I-.4 J.1 K.5"])
def test_derivatives_of_a_tool_line_are_those_of_its_joints(words: str) -> None:
    (line,) = feeds(f"G55 G43.5 G0 X0 Y0 Z0 I.2 J.1 K1\nG1 X10 {words} F600\n")
    kinematics, h = kinematics_of(MILL), 1e-3
    s = np.linspace(0.5, line.motion.end - 0.5, 9)
    found = derivatives(line, s, kinematics)

    def at(by: float) -> Array:
        return joints_along(line, s + by, kinematics)

    assert np.allclose(found.first, (at(h) - at(-h)) / (2 * h), rtol=1e-5, atol=1e-7)
    assert np.allclose(found.second, (at(h) - 2 * at(0.0) + at(-h)) / h**2, rtol=1e-4, atol=1e-6)
    far = 0.02
    third = (at(2 * far) - 2 * at(far) + 2 * at(-far) - at(-2 * far)) / (2 * far**3)
    assert np.allclose(found.third, third, rtol=1e-2, atol=1e-5)
