"""A path as points and rulings for a picture: nothing lost beyond the tolerance, memory bounded."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.plan.report import picture
from controller.plan.report.picture import FEED, RAPID, SURFACE, Picture, thin
from controller.runtime import checked

MACHINE = machine_file.load("trunnion")


def taken(text: bytes, most: int = picture.MAX_POINTS, machine: Machine = MACHINE) -> picture.Shape:
    task = checked.task(text, "part.ngc", machine)
    taker = Picture(machine, task.kinematics, most)
    for _ in taker.watched(checked.path_of(task, checked.chosen_for(task)).items):
        pass
    return taker.shape()


def away(points: np.ndarray, line: np.ndarray) -> float:
    """The largest distance of points to a polyline."""
    a, b = line[:-1], line[1:]
    way = b - a
    square = np.maximum((way * way).sum(axis=1), 1e-300)
    least = np.full(len(points), np.inf)
    for i in range(len(a)):
        share = np.clip(((points - a[i]) @ way[i]) / square[i], 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(points - a[i] - share[:, None] * way[i], axis=1))
    return float(least.max())


def test_thinning_keeps_every_point_within_the_tolerance_of_the_line() -> None:
    seed = random.randrange(2**32)
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(400, 3)) * [1.0, 0.1, 0.01], axis=0)
    for tolerance in (0.0, 0.05, 0.5, 5.0):
        kept, slack = thin(points, np.zeros(400, dtype=np.int64), tolerance)
        assert kept[0] == 0 and kept[-1] == 399
        assert away(points, points[kept]) <= tolerance + 1e-9, f"seed {seed}"
        assert slack.max() <= tolerance, f"seed {seed}"


def test_thinning_again_with_a_larger_tolerance_keeps_the_first_promise() -> None:
    t = np.linspace(0.0, 20.0, 3000)
    points = np.stack([np.cos(t), np.sin(t), 0.1 * t], axis=1)
    kinds = np.zeros(3000, dtype=np.int64)
    index, slack = np.arange(3000), np.zeros(3000)
    for tolerance in (1e-4, 1e-3, 1e-2):
        kept, slack = thin(points[index], kinds[index], tolerance, slack)
        index = index[kept]
        assert away(points, points[index]) <= tolerance
    assert len(index) < 300


def test_a_straight_line_becomes_two_points_and_kinds_stay_apart() -> None:
    points = np.stack([np.arange(9.0), np.zeros(9), np.zeros(9)], axis=1)
    kinds = np.array([0, 0, 0, 0, 1, 1, 1, 1, 1])
    assert thin(points, kinds, 1e-6)[0].tolist() == [0, 3, 8]


def test_example_2_shows_both_surfaces_with_their_rulings_and_its_ways() -> None:
    shape = taken(machine_file.shipped_program("example2_ready").read_bytes())
    assert set(shape.kinds.tolist()) == {RAPID, FEED, SURFACE}
    assert shape.surfaces.tolist() == [picture.PER_SURFACE] * 2
    # G54 of the trunnion lies at (8, 96, 120); the first contact is (15, 0), under (5, 0, 10).
    assert shape.rulings[0] - [8, 96, 120, 8, 96, 120] == pytest.approx([*_upper(), *_lower()], abs=1e-6)
    assert (np.diff(shape.motions) >= 0).all()
    assert shape.tolerance_mm <= picture.FIRST_TOLERANCE_MM


def _points() -> list[list[float]]:
    lines = machine_file.shipped_program("example2_ready").read_text().lower().splitlines()
    first = next(i for i, line in enumerate(lines) if "g52" in line)
    numbers = [
        [float(word[1:]) for word in line.split() if word[0] in "xyz" and len(word) > 1]
        for line in lines[first : first + 8]
    ]
    scale = 1.0 if "." in lines[first] else 0.01
    return [[scale * value for value in row] for row in numbers]


def _upper() -> list[float]:
    return _points()[0]


def _lower() -> list[float]:
    return _points()[4]


def test_many_lines_become_few_points_and_none_is_further_off_than_told() -> None:
    n = 3000
    t = np.linspace(0.0, 12.0, n)
    xyz = np.stack([20 * np.cos(t), 20 * np.sin(t), -0.5 * t], axis=1).round(4)
    lines = "\n".join(f"G1 X{x:.4f} Y{y:.4f} Z{z:.4f} F3000." for x, y, z in xyz)
    shape = taken(f"G21 G90 G54 G61\nG0 Z20.\n{lines}\nM30\n".encode(), most=250)
    assert len(shape.tips) <= 250
    assert shape.tolerance_mm < 0.2
    offset = np.array([8.0, 96.0, 120.0])  # joints less the work offset are the words
    fed = shape.tips[shape.kinds == FEED]
    assert away(xyz[1:] + offset, np.concatenate([fed[:1], fed])) <= shape.tolerance_mm + 1e-3
    assert shape.lines.max() == n + 2


def test_a_saved_picture_is_read_back_and_old_ones_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shape = taken(b"G21 G90\nG0 X1.\nG1 X5. F100.\nM30\n")
    monkeypatch.setattr(picture, "KEPT", 2)
    for name in ("a", "b", "c"):
        shape.save(tmp_path / f"{name}.npz")
    assert len(list(tmp_path.iterdir())) == 2
    again = picture.load(tmp_path / "c.npz")
    assert np.array_equal(again.tips, shape.tips) and again.tolerance_mm == shape.tolerance_mm


def test_a_program_that_moves_nothing_has_an_empty_picture() -> None:
    shape = taken(b"G21\nG4 P0.1\nM30\n")
    assert len(shape.tips) == 0 and len(shape.rulings) == 0


def test_the_tool_stands_along_the_ruling_at_every_point_of_a_surface() -> None:
    shape = taken(machine_file.shipped_program("example1_ready.ngc").read_bytes())
    assert np.linalg.norm(shape.axes, axis=1) == pytest.approx(1.0)
    on = shape.kinds == SURFACE
    # The paper's Example 1: a cone whose half angle has the tangent (15 - 10) / 10.
    assert on.sum() > 20 and shape.axes[on][2:-2, 2] == pytest.approx(np.cos(np.arctan(0.5)), abs=1e-6)


@pytest.mark.parametrize("path", ["G61", "G64 P0.1"])
def test_the_tip_of_the_tool_in_the_spindle_is_drawn_also_where_axes_are_programmed(path: str) -> None:
    """T1 is 50 mm long: lines under G49 lead the gauge line, and the picture shows the tip."""
    long = replace(MACHINE, tools=tuple(replace(tool, length_mm=50.0) for tool in MACHINE.tools))
    text = f"G21 G90 G54 {path}\nG1 X0 Y0 Z60 F900\nX10\nY10\nX0\nM30\n".encode()
    one, other = (np.min(taken(text, machine=machine).tips[-3:, 2]) for machine in (MACHINE, long))
    assert one - other == pytest.approx(50.0 - MACHINE.tools[0].length_mm)
