"""Chords of a cut: within the tolerance as the reader interpolates them, and no more of them than needed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from controller.geometry.arrays import Array
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut
from controller.plan.rotaries.branch import joints_along
from controller.plan.segment import ContinuousPath, Segment
from controller.post.chords import Form, corners, poses
from controller.post.text import PostOptions, height_mm, post
from controller.runtime import checked

TWISTED = b"""G21 G90 G54 G61
T1 M6
S8000 M3
G41 P1
G52 X30. Y6. Z12. F600.
X20. Y3. Z12.
X9. Y8. Z12.
X1. Y3. Z12.
X30. Y0. Z0.
X20. Y-2. Z0.
X10. Y4. Z0.
X0. Y0. Z0.
M5
M30
"""


def task(text: bytes, machine: Machine) -> checked.Task:
    return checked.task(text, "part.ngc", machine)


def items(asked: checked.Task) -> list:
    return list(checked.path_of(asked, checked.chosen_for(asked)).items)


def segments(asked: checked.Task) -> list[Segment]:
    return [one for item in items(asked) if isinstance(item, ContinuousPath) for one in item.segments]


def held(asked: checked.Task, row: list[Segment], height: float, count: int) -> Array:
    """Tip and top (N, 6) of the tool along motions, densely, table frame."""
    found = []
    for one in row:
        joints = joints_along(one, np.linspace(0.0, one.motion.end, count), asked.kinematics)
        tips, axes = poses(joints, 0.0, asked.kinematics)
        found.append(np.hstack([tips, tips + height * axes]))
    return np.concatenate(found)


def apart(wanted: Array, there: Array) -> float:
    """How far tip or top of the tool is at most from where a finely sampled way has both of them (N, 6)."""
    there = there[np.append(True, np.abs(np.diff(there, axis=0)).max(axis=1) > 0.0)]  # corners once
    nearest = cKDTree(there).query(wanted)[1]
    found = np.full(len(wanted), np.inf)
    for step in (-1, 0):
        i = np.clip(nearest + step, 0, len(there) - 2)
        way = there[i + 1] - there[i]
        share = ((wanted - there[i]) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300)
        off = wanted - there[i] - np.clip(share, 0.0, 1.0)[:, None] * way
        found = np.minimum(found, np.linalg.norm(off.reshape(-1, 2, 3), axis=2).max(axis=1))
    return float(found.max())


@pytest.mark.parametrize("form", Form)
@pytest.mark.parametrize("chord_mm", [0.01, 0.001])
def test_the_lines_as_the_reader_takes_them_stay_within_the_chord_of_the_cut(
    form: Form, chord_mm: float
) -> None:
    machine = machine_file.load("trunnion")
    ours = task(TWISTED, machine)
    (cut,) = [one for one in segments(ours) if isinstance(one.motion, SurfaceCut)]
    height = height_mm(cut, machine.tools[0])
    text = post(
        items(ours), [(0, machine.tools[0])], PostOptions(machine, ours.kinematics, form, chord_mm, 0, False)
    )
    read = task(text.encode(), machine)
    lines = [one for one in segments(read) if one.feed_mm_s is not None]
    there = held(read, lines, height, 60)
    wanted = held(ours, [cut], height, 4001)
    assert 0.5 * chord_mm < apart(wanted, there) <= 1.02 * chord_mm + 1e-5
    assert "G64" not in text


def test_chords_are_as_long_as_they_may_be() -> None:
    """On a cylinder a chord of sagitta e spans 2 acos(1 - e / r): the tip runs on r + tool radius."""
    machine = machine_file.load("trunnion")
    whole = b"T1 M6\nS8000 M3\nG51 X10. Y0. Z0. I0. J0. K0. H6. R10. D180. F600.\nM30\n"
    ours = task(whole, machine)
    (cut,) = [one for one in segments(ours) if isinstance(one.motion, SurfaceCut)]
    s, joints = corners(cut, ours.kinematics, Form.TIP, 0.0, 6.0, 0.01)
    radius = 10.0 + machine.tools[0].radius_mm
    least = np.pi / (2.0 * np.arccos(1.0 - 0.01 / radius))
    assert least <= len(s) - 1 <= 1.06 * least + 1
    assert (s[0], s[-1]) == (0.0, cut.motion.end)
    assert joints[-1] == pytest.approx(np.array(cut.end), abs=1e-9)


def test_spindle_tool_and_end_are_written_where_they_were(tmp_path: object) -> None:
    machine = machine_file.load("trunnion")
    ours = task(TWISTED, machine)
    asked = PostOptions(machine, ours.kinematics, Form.TIP, 0.01, 0, True)
    text = post(items(ours), [(0, machine.tools[0])], asked).splitlines()
    assert text[0].startswith("G21 G90 G17 G54 G64 P0.01 Q")
    assert text[1:3] == ["T1 M6", "S8000 M3"]
    assert text[-2:] == ["M5", "M30"]
    assert sum("G43.4" in line for line in text) == 1
