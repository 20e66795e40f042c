"""Rows of lines under G64 P: near the lines everywhere, smooth, in parts, with feeds and line numbers."""

from __future__ import annotations

import itertools
import math
import pickle
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
from support.machines.traced_programs import HOME, assert_whole, mill, segments, sentences, trace
from support.parts import cam_lines

from controller.geometry.arrays import Array
from controller.geometry.vectors import Frame
from controller.machine.kinematics import kinematics_of
from controller.motion.motions import ROW, JointMove, ToolLine, ToolSpline
from controller.plan.lines import rows
from controller.plan.path import path
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Path, Segment, tip_rate
from controller.plan.surfaces.rates import derivatives
from controller.program import blocks

MILL = mill()
KINEMATICS = kinematics_of(MILL)
START = "G55 G64 P0.02 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 F600\n"


def splines(traced: Path) -> list[Segment]:
    return [s for s in segments(traced) if isinstance(s.motion, ToolSpline)]


def cam(count: int, vectors: bool, **changes: object) -> tuple[Path, Array]:
    """A traced CAM program in G55 (no offset) and its places."""
    at = cam_lines.places(count)
    text = "".join(cam_lines.program(at, vectors, head="G55 G21 G90 G64 P0.01"))
    return trace(text, mill(**changes)), at


def poses(found: list[Segment], per_mm: float = 30.0) -> tuple[Array, Array]:
    tips, axes = [], []
    for segment in found:
        s = np.linspace(0.0, segment.motion.end, 2 + int(segment.motion.end * per_mm))
        tip, axis = KINEMATICS.forward(joints_along(segment, s, KINEMATICS).T, 0.0, np)
        tips.append(np.array(tip).T)
        axes.append(np.array([c + 0.0 * s for c in axis]).T)
    return np.concatenate(tips), np.concatenate(axes)


@pytest.mark.parametrize("vectors", [False, True], ids=["rotary words", "tool vectors"])
def test_the_tip_stays_within_p_of_the_lines_and_the_axis_near_theirs(vectors: bool) -> None:
    traced, at = cam(1800, vectors)
    assert_whole(traced, MILL)
    tips, axes = poses(splines(traced), 12.0)
    assert cam_lines.distance(tips, cam_lines.corners(at)).max() <= 0.01
    cut = cam_lines.distance(tips, at[:, :3]) < 0.02  # not the plunge
    nearest = [int(((at[:, :3] - tip) ** 2).sum(axis=1).argmin()) for tip in tips[cut]]
    half_a_line = 0.02
    assert cam_lines.degrees_between(axes[cut], at[nearest, 3:]).max() <= 0.05 + half_a_line
    assert not any(chain.runs_on for chain in traced.items[-2:] if isinstance(chain, ContinuousPath))


def test_a_smooth_row_is_few_spans_and_moves_as_far_as_its_lines() -> None:
    traced, at = cam(2000, True)
    found = splines(traced)
    count = sum(len(s.motion.knots) - 1 for s in found if isinstance(s.motion, ToolSpline))
    assert count < 300
    length = sum(s.motion.end for s in found)
    assert length == pytest.approx(cam_lines.length_mm(at) + 5.0, rel=1e-4)


def test_rows_of_any_length_come_in_parts_that_fit_without_a_jump() -> None:
    traced, _ = cam(9000, False)
    chains = [item for item in traced.items if isinstance(item, ContinuousPath)]
    assert len(chains) > 4
    assert [c.runs_on for c in chains] == [False] + [True] * (len(chains) - 2) + [False]
    for before, after in itertools.pairwise(splines(traced)):
        a = derivatives(before, np.array([before.motion.end]), KINEMATICS)
        b = derivatives(after, np.array([0.0]), KINEMATICS)
        assert np.allclose(before.end, after.start, rtol=0.0, atol=1e-9)
        assert np.allclose(a.first, b.first, rtol=0.0, atol=1e-9)
        assert np.allclose(a.second, b.second, rtol=0.0, atol=1e-7)


def test_both_ways_to_write_an_axis_give_the_same_path() -> None:
    ends = [splines(cam(600, vectors)[0])[-1].end for vectors in (False, True)]
    assert np.allclose(ends[0], ends[1], rtol=0.0, atol=1e-3)


def test_every_place_knows_its_program_line() -> None:
    traced, at = cam(1500, False)
    for segment in splines(traced):
        motion = segment.motion
        assert isinstance(motion, ToolSpline)
        for s in np.linspace(0.01, motion.end - 0.01, 40).tolist():
            tip = KINEMATICS.forward(joints_along(segment, np.array([s]), KINEMATICS)[0], 0.0).tip
            line = motion.line_at(s)
            if line > 4:  # line 5 goes from at[0] to at[1]
                near = cam_lines.distance(np.array([tip]), at[line - 5 : line - 3, :3])
                assert near[0] < 0.02, (s, line)
    assert splines(traced)[0].place.line == 4


def test_a_part_frame_that_is_turned_turns_tips_and_vectors() -> None:
    part = Frame((5.0, 6.0, 7.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    built = mill(offsets=(part,) + (Frame(),) * 5)
    at = cam_lines.places(300)
    traced = trace("".join(cam_lines.program(at, True, head="G54 G21 G90 G64 P0.01")), built)
    assert_whole(traced, built)
    tips, axes = poses(splines(traced), 5.0)
    back = np.array([part.from_parent(tuple(tip)) for tip in tips])
    assert cam_lines.distance(back, cam_lines.corners(at)).max() <= 0.01
    last = np.array(part.turn_back(tuple(axes[-1])))
    assert np.abs(last - at[-1, 3:]).max() < 1e-5


def test_the_feed_of_the_tip_is_f_also_where_a_corner_is_cut() -> None:
    traced = trace(START + "X20\nY20\nX0 A14\nY0\n", MILL)
    slowest = []
    for segment in splines(traced):
        s = np.linspace(0.0, segment.motion.end, 4001)
        speed = segment.feed_at(s) * tip_rate(segment.motion, s)
        assert np.allclose(speed, 10.0, rtol=1e-12)
        tips = np.array(KINEMATICS.forward(joints_along(segment, s, KINEMATICS).T, 0.0, np).tip).T
        rate = np.sqrt((np.diff(tips, axis=0) ** 2).sum(axis=1)) / (s[1] - s[0])
        middle = 0.5 * (s[1:] + s[:-1])
        assert np.allclose(rate, tip_rate(segment.motion, middle), atol=2e-3)
        assert rate.max() < 1.2
        slowest.append(rate.min())
    assert min(slowest) < 0.8


def test_a_feed_that_changes_changes_where_its_line_begins() -> None:
    (row,) = splines(trace(START + "X10\nX20 F300\nX30\nX40 F600\n", MILL))
    assert row.feed_steps == ((0.0, 10.0), (10.0, 5.0), (30.0, 10.0))
    assert row.feed_at(np.array([5.0, 15.0, 35.0])) == pytest.approx([10.0, 5.0, 10.0], rel=1e-3)


@pytest.mark.parametrize("mode", ["", "G43.4"], ids=["joints", "tip"])
@pytest.mark.parametrize(("unit", "words"), [("G21", ""), ("G20", ""), ("G20", "X1 Y0 ")])
def test_a_row_of_small_turns_of_a_standing_tip_is_fed_in_degrees(mode: str, unit: str, words: str) -> None:
    turns = "".join(f"{words}A{10 + 0.5 * k:g} C{0.25 * k:g}\n" for k in range(1, 41))
    text = f"G55 {unit} G64 P0.001 {mode} G0 X1 Y0 Z0 A10 C0\nG1 F60\n{turns}"
    total = 0.0
    for row in splines(trace(text, MILL)):
        s = np.linspace(0.0, row.motion.end, 5001)
        total += float((np.diff(s) / row.feed_at(0.5 * (s[1:] + s[:-1]))).sum())
    assert total == pytest.approx(math.hypot(20.0, 10.0), rel=1e-3)


def test_a_small_turn_between_two_lines_takes_its_own_time_and_the_lines_theirs() -> None:
    (row,) = splines(trace(START + "X10\nA10.5 F60\nX20 F600\nG93 A11 F60\nX30 F60\n", MILL))
    s = np.linspace(0.0, row.motion.end, 200_001)
    seconds = np.diff(s) / row.feed_at(0.5 * (s[1:] + s[:-1]))
    assert seconds.sum() == pytest.approx(1.0 + 0.5 + 1.0 + 1.0 + 1.0, rel=0.01)


def test_inverse_times_hold_line_by_line() -> None:
    (row,) = splines(trace(START + "G93 X10 F60\nX20 F30\nX30 A20 F6\n", MILL))
    assert np.allclose(row.feed_steps, ((0.0, 10.0), (10.0, 5.0), (20.0, 1.0)))


def test_the_axis_turning_at_a_standing_tip_stops_the_row_unless_it_is_little() -> None:
    traced = trace(START + "X10\nA20 C40\nX20\nX21 A20.5\nA20.9\nX30\n", MILL)
    assert_whole(traced, MILL)
    kinds = [type(s.motion) for s in segments(traced)]
    assert kinds == [JointMove, ToolSpline, ToolLine, ToolSpline]
    turn = segments(traced)[2]
    tips, _ = poses([turn])
    assert np.ptp(tips, axis=0).max() < 1e-9


def test_tool_vectors_through_and_beside_the_pole_keep_the_axis() -> None:
    for last in ("I.2 J.1 K1", "I.2 J.11 K1"):
        text = f"G55 G64 P0.02 Q0.1\nG43.5 G0 X0 Y0 Z0 I-.2 J-.1 K1\nG1 X10 {last} F600\nX20\n"
        tips, axes = poses(splines(trace(text, MILL)), 50.0)
        axes = axes[tips[:, 0] < 9.0]  # before the corner, where one great circle is to be followed
        a = np.array([-0.2, -0.1, 1.0])
        b = np.array([float(word[1:]) for word in last.split()])
        across = np.cross(a, b)
        off = np.degrees(np.arcsin(axes @ across / np.linalg.norm(across)))
        assert np.abs(off).max() <= 0.1


def test_at_the_pole_a_row_stops_for_a_turn_of_the_free_rotary() -> None:
    text = "G55 G64 P0.02 G43.5 G0 X0 Y0 Z0 I-.2 J-.1 K1\nG1 X5 I-.1 J-.05 K1 F600\n"
    text += "X10 I0 J0 K1\nX20 I.2 J-.15 K1\n"
    traced = trace(text, MILL)
    assert_whole(traced, MILL)
    assert [s.name for s in segments(traced)] == ["line", "line", "swivel", "line"]


def test_without_p_and_under_g61_lines_stay_exact() -> None:
    for code in ("G61", "G64"):
        traced = trace(START.replace("G64 P0.02", code) + "X10\nY10\n", MILL)
        assert [type(s.motion) for s in segments(traced)] == [JointMove, ToolLine, ToolLine]
        assert ("G64 without P blends" in sentences(traced)) == (code == "G64")


def test_one_line_alone_stays_exact_under_p() -> None:
    traced = trace(START + "X10 A20\nG0 Z10\nG1 X0\n", MILL)
    assert [type(s.motion) for s in segments(traced)] == [JointMove, ToolLine, JointMove, ToolLine]


def off_segment(points: Array, a: Array, b: Array) -> Array:
    way = b - a
    share = np.clip((points - a) @ way / (way @ way), 0.0, 1.0)
    return np.linalg.norm(points - a - share[:, None] * way, axis=1)


def off_bow(points: Array, centre: Array, radius: float, ends: tuple[float, float]) -> Array:
    """Distance of points in a plane from an arc between two angles, counter-clockwise."""
    out = points - centre
    angle = (np.arctan2(out[:, 1], out[:, 0]) - ends[0]) % (2 * math.pi)
    tips = [centre + radius * np.array([math.cos(at), math.sin(at)]) for at in ends]
    beyond = np.min([np.linalg.norm(points - tip, axis=1) for tip in tips], axis=0)
    return np.where(angle <= ends[1] - ends[0], np.abs(np.linalg.norm(out, axis=1) - radius), beyond)


def test_lines_and_arcs_of_joints_are_blended_in_machine_positions() -> None:
    traced = trace("G55 G64 P0.05\nG0 X0 Y0 Z0\nG1 X10 F600\nX20 Y5\nY10 A5\nG2 X30 Y10 I5\nG1 X40\n", MILL)
    assert_whole(traced, MILL)
    (row,) = splines(traced)
    assert not row.motion.tips  # type: ignore[union-attr]
    machine = joints_along(row, np.linspace(0.0, row.motion.end, 6000), KINEMATICS)[:, :2]
    corners = np.array([[0.0, 0], [10, 0], [20, 5], [20, 10], [30, 10], [40, 10]])
    sides = [off_segment(machine, corners[k], corners[k + 1]) for k in (0, 1, 2, 4)]
    sides.append(off_bow(machine, np.array([25.0, 10.0]), 5.0, (0.0, math.pi)))
    assert np.min(sides, axis=0).max() <= 0.05
    assert np.linalg.norm(machine - np.array([25.0, 15.0]), axis=1).min() <= 0.05, "the whole arc is gone"
    assert "G64 without P blends" not in sentences(traced)
    assert [row.motion.line_at(s) for s in (1.0, 12.0, 24.0, 35.0, row.motion.end)] == [3, 4, 5, 6, 7]  # type: ignore[union-attr]


@pytest.mark.parametrize("blend_mm", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("radius", [0.2, 3.0, 80.0])
def test_a_rounded_contour_is_one_row_within_p_and_as_smooth_as_its_arcs(
    radius: float, blend_mm: float
) -> None:
    """A square with rounded corners, a whole circle at its end: tangent everywhere."""
    r, side = radius, 3.0 * radius
    text = f"G55 G64 P{blend_mm}\nG0 X0 Y0 Z0\nG1 X{side} F600\nG3 X{side + r} Y{r} J{r}\nG1 Y{side + r}\n"
    text += f"G3 X{side} Y{side + 2 * r} I{-r}\nG1 X0\nG3 X0 Y{side + 2 * r} J{-r}\n"
    traced = trace(text, MILL)
    assert_whole(traced, MILL)
    row = splines(traced)
    assert sum(s.motion.end for s in row) == pytest.approx(
        3 * side + 3 * math.pi * r, rel=1e-3, abs=2 * blend_mm
    )
    machine = np.concatenate(
        [joints_along(s, np.linspace(0.0, s.motion.end, 4001), KINEMATICS) for s in row]
    )[:, :2]
    top = side + 2 * r
    corners = [(0, 0), (side, 0), (side + r, r), (side + r, side + r), (side, top), (0, top)]
    ends = [np.array(corner, float) for corner in corners]
    found = [off_segment(machine, ends[k], ends[k + 1]) for k in (0, 2, 4)]
    found.append(off_bow(machine, np.array([side, r]), r, (-math.pi / 2, 0.0)))
    found.append(off_bow(machine, np.array([side, side + r]), r, (0.0, math.pi / 2)))
    found.append(np.abs(np.linalg.norm(machine - np.array([0.0, side + r]), axis=1) - r))
    assert np.min(found, axis=0).max() <= blend_mm
    bends = [
        np.linalg.norm(derivatives(s, np.linspace(0.0, s.motion.end, 4001), KINEMATICS).second[:, :2], axis=1)
        for s in row
    ]
    assert np.concatenate(bends).max() <= 2.0 / (r - blend_mm), (
        "the spline bends much more than the arcs that it follows"
    )


def test_moves_that_lead_nowhere_are_left_out_of_a_row() -> None:
    (row,) = splines(trace(START + "X10\nX10\nX10 A10\nY10\nY10\n", MILL))
    assert row.motion.end == pytest.approx(20.0)


def test_joints_on_a_tick_are_those_of_the_plan_and_cost_no_more_on_a_long_motion() -> None:
    for segment in splines(cam(1500, True)[0]):
        motion = segment.motion
        assert isinstance(motion, ToolSpline)
        assert len(motion.spans) == ROW * (len(motion.knots) - 1) <= ROW * rows.SPANS
        s = np.linspace(0.0, motion.end, 50)
        found = joints_along(segment, s, KINEMATICS)
        for at, row in zip(s.tolist(), found, strict=True):
            assert motion.joints(at, (9.0, 9.0), KINEMATICS) == pytest.approx(row, abs=1e-11)
        copied = pickle.loads(pickle.dumps(motion))
        assert copied.joints(1.0, (0.0, 0.0), KINEMATICS) == motion.joints(1.0, (0.0, 0.0), KINEMATICS)


@pytest.mark.parametrize("tips", [True, False])
def test_derivatives_of_a_spline_are_those_of_its_joints(tips: bool) -> None:
    text = START if tips else START.replace("G43.4", "G49")
    row = splines(
        trace(
            text + "".join(f"X{k} Y{k * k / 90:.4f} A{10 + k / 3:.4f} C{2 * k}\n" for k in range(1, 30)), MILL
        )
    )[0]
    knots = np.array(row.motion.knots)  # type: ignore[union-attr]
    s, h = 0.5 * (knots[1:] + knots[:-1]), 1e-3
    found = derivatives(row, s, KINEMATICS)

    def at(by: float) -> Array:
        return joints_along(row, s + by, KINEMATICS)

    assert np.allclose(found.first, (at(h) - at(-h)) / (2 * h), rtol=1e-5, atol=1e-7)
    assert np.allclose(found.second, (at(h) - 2 * at(0.0) + at(-h)) / h**2, rtol=1e-3, atol=1e-6)
    far = 0.01
    third = (at(2 * far) - 2 * at(far) + 2 * at(-far) - at(-2 * far)) / (2 * far**3)
    assert np.allclose(found.third, third, rtol=1e-2, atol=2e-5)


def test_a_stream_keeps_no_more_than_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows, "WINDOW", 200)

    def endless(count: int) -> Iterator[bytes]:
        at = cam_lines.places(700)
        text = "".join(cam_lines.program(at, False)).encode().splitlines(keepends=True)
        yield b"".join(text[:4])
        for _ in range(count):
            yield b"".join(text[4:-1])
            yield b"".join(reversed(text[4:-1]))

    peaks = []
    for count in (1, 3):
        made = blocks.stream(b"".join(endless(count)), mill(), "part.ngc")
        tracemalloc.start()
        for item in path.stream(made, "part.ngc", mill(), KINEMATICS, HOME):
            del item
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.3 * peaks[0]


def test_the_turn_of_a_line_with_few_millimetres_sets_its_measure() -> None:
    traced = trace(START + "X10\nX10.01 A20\nX20\n", MILL)
    assert_whole(traced, MILL)
    length = sum(s.motion.end for s in splines(traced))
    assert length == pytest.approx(10.0 + 1.0 + 9.99, abs=1e-9)
    rates = np.concatenate(
        [derivatives(s, np.linspace(0.0, s.motion.end, 500), KINEMATICS).first[:, 3] for s in splines(traced)]
    )
    assert np.abs(rates).max() < math.radians(25.0)
