"""Lines that no G61 and no G64 P stands before: rounding is run through, corners that are meant are exact."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from support.machines.traced_programs import HOME, assert_whole, mill, segments, sentences, trace
from support.parts import cam_lines

from controller.geometry.arrays import Array
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import JointMove, ToolLine, ToolSpline
from controller.plan.feed.course import FeedCourse
from controller.plan.lines import meant
from controller.plan.lines.meant import Waiting
from controller.plan.look_ahead import Orders, TrackPlace, Windows
from controller.plan.path import path
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Path
from controller.plan.track import Track
from controller.program import blocks
from controller.program.program import ProgramError

MILL = mill()
KINEMATICS = kinematics_of(MILL)
KINDS = ("fig4a", "fig4b", "fig4c", "fig4d", "table_head", "head_head", "oblique")


def kinds(traced: Path) -> list[type]:
    return [type(segment.motion) for segment in segments(traced)]


def way(traced: Path, built: Machine, vectors: bool) -> Array:
    """Tips (or X Y Z of the machine) along the splines of a path, some places of each span."""
    kinematics, found = kinematics_of(built), []
    for segment in segments(traced):
        if isinstance(segment.motion, ToolSpline):
            knots = np.array(segment.motion.knots)
            s = np.unique(knots[:-1, None] + np.diff(knots)[:, None] * np.linspace(0.0, 1.0, 6))
            joints = joints_along(segment, s, kinematics)
            found.append(np.array(kinematics.forward(joints.T, 0.0, np).tip).T if vectors else joints[:, :3])
    return np.concatenate(found)


def dense(step_mm: float, decimals: int, seed: int) -> Array:
    """(N, 6) places on a smooth random curve, rounded as a CAM system would, with a leaning axis."""
    rng = np.random.default_rng(seed)
    phases, t = rng.uniform(0.0, 6.0, 6), step_mm * np.arange(400)
    waves = [np.sin(t / rng.uniform(2.0, 9.0) + phase) for phase in phases]
    x, y, z = t + waves[0], 3.0 * waves[1], waves[2]
    vector = np.stack([0.15 * waves[3] + 0.3, 0.15 * waves[4] - 0.2, np.ones(len(t))], axis=1)
    vector /= np.linalg.norm(vector, axis=1)[:, None]
    return np.column_stack([np.round(np.stack([x, y, z], axis=1), decimals), vector])


def by_vectors(at: Array, head: str = "") -> str:
    rows = "".join(f"X{x:.6f} Y{y:.6f} Z{z:.6f} I{i:.7f} J{j:.7f} K{k:.7f}\n" for x, y, z, i, j, k in at)
    return f"G55 {head} G43.5\nG0 {rows.splitlines()[0]}\nG1 F600\n{rows}"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("step_mm", "decimals"), [(0.02, 4), (0.02, 3), (0.1, 3), (0.002, 3)])
def test_dense_lines_are_one_row_within_the_machines_tolerance(
    kind: str, step_mm: float, decimals: int
) -> None:
    built, at = mill(kind), dense(step_mm, decimals, seed=round(1e4 * step_mm))
    traced = trace(by_vectors(at), built)
    assert_whole(traced, built)
    found = kinds(traced)
    assert found.count(ToolSpline) >= 1 and found.count(ToolLine) <= 2
    tips = way(traced, built, True)
    assert cam_lines.distance(tips, at[:, :3]).max() <= built.joint_tolerance_mm
    assert cam_lines.distance(at[:, :3], tips).max() <= 2.0 * built.joint_tolerance_mm, "a part is left out"


@pytest.mark.parametrize("seed", range(6))
def test_lines_of_three_axes_are_told_apart_alike(seed: int) -> None:
    at = dense(0.05, 3, seed)[:, :3]
    text = "G55\nG0 X0 Y0 Z0\nG1 F600\n" + "".join(f"X{x:.3f} Y{y:.3f} Z{z:.3f}\n" for x, y, z in at)
    traced = trace(text, MILL)
    assert_whole(traced, MILL)
    assert cam_lines.distance(way(traced, MILL, False), at).max() <= MILL.joint_tolerance_mm


def test_a_corner_that_is_meant_is_a_rest_on_the_corner() -> None:
    off = [2e-5 * (k % 3) for k in range(1, 200)] + [0.0]
    bows = [(0.02 * k, y) for k, y in enumerate(off, 1)] + [(4.0 + x, 0.02 * k) for k, x in enumerate(off, 1)]
    text = "G55\nG0 X0 Y0 Z0\nG1 F600\n" + "".join(f"X{x:.5f} Y{y:.5f}\n" for x, y in bows)
    traced = trace(text, MILL)
    assert_whole(traced, MILL)
    chains = [item for item in traced.items if isinstance(item, ContinuousPath)][1:]
    assert [kind for c in chains for kind in {type(s.motion) for s in c.segments}] == [ToolSpline] * 2
    assert chains[0].segments[-1].end[:2] == pytest.approx((4.0, 0.0), abs=1e-9)
    assert not chains[0].runs_on
    assert "Lines run through from here on" in sentences(traced)


@pytest.mark.parametrize("words", ["G61", "G64\nG61", "G64 P0.1\nG61.1"])
def test_under_g61_every_line_is_exact(words: str) -> None:
    at = dense(0.02, 4, seed=1)[:60]
    assert all(one.exact for one in segments(trace(by_vectors(at, words), MILL)))


def test_without_a_tolerance_every_line_is_exact() -> None:
    at = dense(0.02, 4, seed=1)[:60]
    assert all(one.exact for one in segments(trace(by_vectors(at), mill(joint_tolerance_mm=0.0))))


def test_g64_without_p_has_the_machines_tolerance() -> None:
    at = dense(0.02, 4, seed=1)
    with_it, without = (trace(by_vectors(at, head), MILL) for head in ("G64", ""))
    ends = [np.array([s.end for s in segments(each)]) for each in (with_it, without)]
    assert ToolSpline in kinds(with_it) and np.array_equal(*ends)
    assert "G64 without P blends" in sentences(with_it)


def test_lines_that_go_on_in_one_direction_stay_lines() -> None:
    text = "G55\nG0 X0 Y0 Z0\nG1 X1 F600\nX2\nX3\nG43.4 X4\nX5\nX6\n"
    assert kinds(trace(text, MILL)) == [JointMove] * 4 + [ToolLine] * 3


def test_rotaries_that_go_on_alike_under_standing_axes_stay_lines() -> None:
    traced = trace("G55\nG0 X0 Y0 Z0 A0 C0\nG1 A10 C5 F600\nA20 C10\nA30 C15\n", MILL)
    assert kinds(traced) == [JointMove] * 4
    assert [len(item.segments) for item in traced.items if isinstance(item, ContinuousPath)] == [1, 3]


def test_many_small_turns_of_a_standing_tip_are_a_row() -> None:
    turns = "".join(f"A{10 + 0.05 * k + 0.002 * (k % 3):.3f}\n" for k in range(1, 60))
    traced = trace("G55 G43.4 G0 X0 Y0 Z0 A10 C0\nG1 F600\n" + turns, MILL)
    assert_whole(traced, MILL)
    assert kinds(traced).count(ToolSpline) == 1 and kinds(traced).count(ToolLine) <= 1


@pytest.mark.parametrize(
    "text",
    [
        "X10\nX10 Y10\nX0 Y10\nX0 Y0",  # a square
        "X10\nX20 Y0.07",  # 0.4 degrees
        "X10\nX5",  # straight back
        "X10 A10\nX20 A10.2",  # the axis turns on at another rate
        "X0.05\nX0.05 Y0.05\nX0 Y0.05\nX0 Y0",  # as small as it is, it is no rounding
        "X10\nX10 A10\nX20",  # the axis turns while the tip stands
    ],
)
@pytest.mark.parametrize("mode", ["", "G43.4 "])
def test_corners_that_are_meant_stay_exact(mode: str, text: str) -> None:
    rows = text.replace("X10\n", "X10 A0\n", 1)
    traced = trace(f"G55 {mode}\nG0 X0 Y0 Z0 A0 C0\nG1 F600\n{rows}\n", MILL)
    assert_whole(traced, MILL)
    assert ToolSpline not in kinds(traced)


def test_a_slight_corner_between_long_lines_is_rounding() -> None:
    traced = trace("G55\nG0 X0 Y0 Z0\nG1 X10 F600\nX20 Y0.03\n", MILL)
    assert kinds(traced) == [JointMove, ToolSpline]
    corners = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0.03, 0]])
    assert cam_lines.distance(way(traced, MILL, False), corners).max() <= MILL.joint_tolerance_mm


def test_what_is_sound_comes_before_a_line_that_is_refused() -> None:
    at = dense(0.02, 4, seed=3)[:50]
    text = by_vectors(at) + "X9000 Y0 Z0\n"
    made = path.stream(blocks.stream(text.encode(), MILL, "part.ngc"), "part.ngc", MILL, KINEMATICS, HOME)
    found = []
    with pytest.raises(ProgramError, match="travel"):
        for item in made:
            found.append(item)
    ends = [item.segments[-1].motion for item in found if isinstance(item, ContinuousPath)]
    assert isinstance(ends[-1], ToolSpline) and ends[-1].lines[-1] == 53


def test_a_line_is_given_away_a_few_lines_behind_a_corner_that_is_meant() -> None:
    """A sender that waits for the machine is not waited for."""
    read = 0

    def lines() -> Iterator[str]:
        nonlocal read
        for k in range(4000):
            read += 1
            yield f"G1 X{10 * (k % 2)} Y{k} F600\n"

    text = "".join(lines())
    asked = blocks.stream(text.encode(), MILL, "part.ngc")
    read = 0

    def counted() -> Iterator[blocks.Block]:
        nonlocal read
        for block in asked:
            read += 1
            yield block

    items = path.stream(counted(), "part.ngc", MILL, KINEMATICS, HOME)
    for _ in range(100):
        next(items)
    assert read <= 116


def test_corners_are_looked_at_a_few_times_each(monkeypatch: pytest.MonkeyPatch) -> None:
    looked = 0
    corners = Waiting._corners

    def counted(self: Waiting, places: Array) -> object:
        nonlocal looked
        looked += len(places)
        return corners(self, places)

    monkeypatch.setattr(meant.Waiting, "_corners", counted)
    for count in (1000, 8000):
        looked = 0
        at = cam_lines.places(count, 0.02)
        trace("".join(cam_lines.program(at, False, "G55 G21 G90")), MILL)
        assert looked < 3.5 * count


def planned_places(count: int, monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """Places at which derivatives are asked for to plan so many lines, and units of the longest window."""
    asked, derivatives = 0, FeedCourse.derivatives

    def counted(self: FeedCourse, s: Array, index: object = None) -> object:
        nonlocal asked
        asked += len(s)
        return derivatives(self, s, index)  # type: ignore[arg-type]

    text = "".join(cam_lines.program(cam_lines.places(count, 0.02), False, "G55 G21 G90"))
    made = blocks.stream(text.encode(), MILL, "part.ngc")
    track = Track(path.stream(made, "part.ngc", MILL, KINEMATICS, HOME), MILL, KINEMATICS)
    windows, place, start_s, longest = Windows(MILL, KINEMATICS), TrackPlace(0, 0.0), 0.0, 0
    with monkeypatch.context() as patched:
        patched.setattr(FeedCourse, "derivatives", counted)
        while (sent := windows.from_rest(track, place, start_s, Orders())) is not None:
            place, start_s, longest = sent.after, sent.end_s, max(longest, len(sent.segments))
            track.forget(place.unit)
    return asked, longest


@pytest.mark.slow
def test_what_a_line_costs_does_not_grow_with_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = (4000, 16000, 64000)
    found = [planned_places(count, monkeypatch) for count in counts]
    for (few, _), (many, longest) in itertools.pairwise(found):
        assert many < 4.4 * few
        assert longest < 60
