"""Line programs of CAM systems: the tip within G64's P of the polyline, at the feed, within all limits."""

from __future__ import annotations

import random
from typing import NamedTuple

import numpy as np
import pytest
from support.machines import random_operators
from support.machines.stepped_runs import SHIPPED, Cut, cut, shipped
from support.oracles import tool_paths
from support.oracles.trace_limits import assert_in_limits
from support.parts import cam_programs

from controller.machine.model import Machine
from controller.runtime.events import Event

PERIOD_S = 0.004

EXACT_MM, EXACT_DEG = 1e-6, 1e-6
ROUNDING = 1e-6  # mm over P


class Followed(NamedTuple):
    """What a run of a line program shows."""

    off_mm: float  # largest distance of the tip from the polyline, at and between ticks
    missed_mm: float  # largest distance of a point of the polyline from the way of the tip
    feed_mm_s: np.ndarray  # of the tip, at every tick along the polyline
    done: Cut


def follow(
    source: str, cloud: cam_programs.Cloud, machine: Machine | None = None, events: list[Event] | None = None
) -> Followed:
    done = cut(source, machine or shipped(period_s=PERIOD_S), events=events or [])
    assert done.run.result == "completed", done.run.fault_text
    assert_in_limits(done, f"{len(cloud)} points", events or [])
    rows = on_lines(done, cloud)
    fine = tool_paths.between_ticks(done.joints[rows[0] - 1 : rows[-1] + 2])
    tips, _ = tool_paths.tool(fine, done.machine, 0.0)
    off, _, _ = tool_paths.off_polyline(tips, cloud.tips)
    missed = tool_paths.off_points(cloud.tips, tips)
    speed = np.linalg.norm(np.diff(tips[::4], axis=0), axis=1) / done.machine.period_s
    return Followed(float(off.max()), float(missed.max()), speed, done)


def on_lines(done: Cut, cloud: cam_programs.Cloud) -> np.ndarray:
    """Rows of the ticks that run on the program's G1 lines, the point where they begin left out."""
    lines = done.trace.line
    rows = np.flatnonzero((lines > cloud.lines[0]) & (lines <= cloud.lines[-1]))
    assert len(rows) > 4, "no tick runs on the lines"
    return rows


def assert_exact(source: str, cloud: cam_programs.Cloud, machine: Machine | None = None) -> Cut:
    """G61: tip on its line, axis on the great circle or from evenly turning rotaries, at every tick."""
    done = cut(source, machine or shipped(period_s=PERIOD_S))
    assert done.run.result == "completed", done.run.fault_text
    assert_in_limits(done, "exact lines")
    rows = on_lines(done, cloud)
    tips, axes = tool_paths.tool(done.joints[rows], done.machine, 0.0)
    off, segment, share = tool_paths.off_polyline(tips, cloud.tips)
    assert off.max() < EXACT_MM, (off.max(), rows[off.argmax()])
    for k in np.unique(segment):
        here = segment == k
        a, b = cloud.axes[k], cloud.axes[k + 1]
        circle = tool_paths.great_circle(a, b, share[here])
        turns = np.unwrap(np.radians(cam_programs.trunnion_degrees(np.stack([a, b]))), axis=0)
        even = cam_programs.axes_of_trunnion(
            np.degrees(turns[0] + share[here][:, None] * (turns[1] - turns[0]))
        )
        apart = np.minimum(*(tool_paths.degrees_between(axes[here], x) for x in (circle, even)))
        assert apart.max() < EXACT_DEG, (k, apart.max())
    return done


SQUARE = (
    [(0, 0, 0), (6, 0, 0.5), (6, 6, 0), (0, 5, -0.5)],
    [(0, 0.4, 1), (0.1, 0.5, 1), (0.2, 0.4, 1), (0.1, 0.3, 1)],
)


@pytest.mark.parametrize("vectors", [False, True])
def test_short_segments_of_a_smooth_surface_are_followed_within_p_at_the_feed(vectors: bool) -> None:
    source, cloud = cam_programs.text(cam_programs.bowl(2, 15.0, 3.0), 1000.0, vectors)
    found = follow(source, cloud)
    assert found.off_mm <= 0.01 + ROUNDING and found.missed_mm <= 0.01 + ROUNDING
    assert np.median(found.feed_mm_s) == pytest.approx(1000.0 / 60.0, rel=0.01)
    assert found.feed_mm_s.max() <= 1000.0 / 60.0 * 1.01


@pytest.mark.parametrize("vectors", [False, True])
def test_exact_lines_hold_the_tip_and_the_axis_on_their_lines(vectors: bool) -> None:
    source, cloud = cam_programs.text(cam_programs.polygon(*SQUARE, step_mm=2.0), 1000.0, vectors, "G61")
    assert_exact(source, cloud)


@pytest.mark.slow
@pytest.mark.parametrize("vectors", [False, True])
@pytest.mark.parametrize("link", ["arc", "corner"])
@pytest.mark.parametrize(("p", "noise"), [(0.01, 0.0), (0.01, 0.002), (0.002, 0.0), (0.1, 0.01)])
def test_rows_with_links_and_noise_stay_within_p(vectors: bool, link: str, p: float, noise: float) -> None:
    made = cam_programs.bowl(3, 20.0, 1.0, link=link).noisy(noise)
    source, cloud = cam_programs.text(made, 3000.0, vectors, f"G64 P{p}")
    found = follow(source, cloud)
    feed = np.median(found.feed_mm_s) * 60.0
    print(f"off {found.off_mm:.5f}, missed {found.missed_mm:.5f}, median feed {feed:.0f}")
    assert found.off_mm <= p + ROUNDING and found.missed_mm <= p + ROUNDING


@pytest.mark.parametrize("vectors", [False, True])
@pytest.mark.parametrize("decimals", [3, 4])
def test_dense_lines_that_no_path_word_stands_before_run_within_the_machines_tolerance(
    vectors: bool, decimals: int
) -> None:
    made = cam_programs.bowl(2, 6.0, 1.0, step_mm=0.02)
    source, cloud = cam_programs.text(made, 1000.0, vectors, "", decimals=decimals)
    found = follow(source, cloud)
    assert found.off_mm <= found.done.machine.joint_tolerance_mm + ROUNDING
    assert np.median(found.feed_mm_s) > 0.5 * 1000.0 / 60.0


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("seed", range(2))
def test_dense_lines_of_a_rough_part_keep_limits_and_tolerance_on_every_machine(name: str, seed: int) -> None:
    step = (0.004, 0.03)[seed]
    made = cam_programs.bowl(2, 200.0 * step, 20.0 * step, step_mm=step).noisy(0.001, seed)
    source, cloud = cam_programs.text(made, 2000.0, True, "", decimals=3)
    found = follow(source, cloud, shipped(name, period_s=PERIOD_S))
    assert found.off_mm <= found.done.machine.joint_tolerance_mm + ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.05, 0.1, 0.5])
@pytest.mark.parametrize("feed", [300.0, 3000.0])
def test_a_turn_of_c_round_a_leaning_wall_keeps_limits_and_tolerance(step: float, feed: float) -> None:
    source, cloud = cam_programs.text(cam_programs.wall(round(60 / step), step), feed)
    found = follow(source, cloud)
    print(f"off {found.off_mm:.5f}, median feed {np.median(found.feed_mm_s) * 60:.0f}")
    assert found.off_mm <= 0.01 + ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("vectors", [False, True])
def test_exact_short_segments_slow_down_as_the_limits_demand(vectors: bool) -> None:
    source, cloud = cam_programs.text(cam_programs.bowl(2, 6.0, 2.0), 3000.0, vectors, "G61")
    assert_exact(source, cloud)


@pytest.mark.slow
@pytest.mark.parametrize("path", ["G61", "G64 P0.01"])
def test_inverse_time_takes_its_time_per_line(path: str) -> None:
    made = cam_programs.bowl(1, 20.0, 2.0, step_mm=0.5)
    source, cloud = cam_programs.text(made, 600.0, False, path, inverse_time=True)
    if path == "G61":
        assert_exact(source, cloud)
        return
    found = follow(source, cloud)
    assert found.off_mm <= 0.01 + ROUNDING
    assert np.median(found.feed_mm_s) == pytest.approx(10.0, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_an_operator_in_the_way_of_short_lines_leaves_the_tolerance_and_the_limits(seed: int) -> None:
    source, cloud = cam_programs.text(cam_programs.bowl(3, 20.0, 2.0), 2000.0, seed % 2 == 1)
    events = random_operators.events(
        random.Random(seed), len(cut(source, shipped(period_s=PERIOD_S)).rows), 8
    )
    found = follow(source, cloud, events=events)
    assert found.off_mm <= 0.01 + ROUNDING and found.missed_mm <= 0.01 + ROUNDING


@pytest.mark.slow
def test_two_thousand_lines_run_at_the_feed_that_the_limits_allow() -> None:
    source, cloud = cam_programs.text(cam_programs.bowl(5, 40.0, 4.0), 3000.0)
    found = follow(source, cloud)
    mean = cloud.length / (len(found.feed_mm_s) * found.done.machine.period_s)
    print(f"mean feed {mean * 60:.0f} of 3000 mm/min over {len(cloud)} lines, off {found.off_mm:.5f} mm")
    assert found.off_mm <= 0.01 + ROUNDING
