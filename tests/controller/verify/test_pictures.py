"""Pictures have their size, show cut and path, and come out for traces without a cut too."""

from __future__ import annotations

import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from support.machines.shipped_kinds import machine
from typer.testing import CliRunner

from controller.__main__ import app
from controller.plan.report.picture import FEED, RAPID, Picture, Shape
from controller.runtime import checked, refused_path
from controller.verify import pictures, trace
from controller.verify.pictures import Mark


def size_of(png: Path) -> tuple[int, int]:
    data = png.read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def test_the_picture_of_a_cut_is_1600_by_1000_pixels(ruled_run, tmp_path):
    run = ruled_run
    cut = trace.from_rows(run.rows, run.machine, run.kinematics, run.segments)
    pictures.cut_picture(cut, run.machine, run.segments, tmp_path / "cut.png")
    assert size_of(tmp_path / "cut.png") == (1600, 1000)
    assert (tmp_path / "cut.png").stat().st_size > 50_000


def test_a_program_without_a_cut_has_a_picture_too(ruled_run, tmp_path):
    run = ruled_run
    moves = trace.from_rows(run.rows[:180], run.machine, run.kinematics, {0: run.segments[0]})
    assert not moves.cutting.any()
    pictures.cut_picture(moves, run.machine, {0: run.segments[0]}, tmp_path / "moves.png")
    assert size_of(tmp_path / "moves.png") == (1600, 1000)


def test_the_time_axis_shows_the_cut_and_little_around_it(ruled_run):
    run = ruled_run
    cut = trace.from_rows(run.rows, run.machine, run.kinematics, run.segments)
    shown = pictures._window(cut)
    assert cut.cutting[shown].sum() == cut.cutting.sum()
    assert cut.cutting[shown].mean() > 0.9
    still = replace(cut, cutting=np.zeros_like(cut.cutting))
    assert pictures._window(still) == slice(0, len(cut.time_s))


def test_matplotlib_is_loaded_only_when_a_picture_is_drawn():
    code = "import sys, controller.verify.pictures; sys.exit('matplotlib' in sys.modules)"
    root = Path(__file__).parents[3]
    assert subprocess.run([sys.executable, "-c", code], cwd=root).returncode == 0


TEXT = """S500 M3 F600 G43 H1
G0 X5 Y6 Z50
G1 Z2
X25
Y16
G0 Z60
X500 Y6
M30
"""


def shape_of(text: str) -> Shape:
    task = checked.task(text.encode(), "part.ngc", machine())
    taker = Picture(task.machine, task.kinematics)
    for _ in taker.watched(checked.path_of(task).items):
        pass
    return taker.shape()


def drawn(shape: Shape, named: list[Mark]) -> tuple[Any, Any]:
    top, front = Figure().subplots(1, 2)
    pictures.views(top, front, shape, machine(), named)
    return top, front


def ways(axes: Any, kind: int) -> np.ndarray:
    """Segments (N, 2, 2) in the colour of a kind of way."""
    colour = pictures.WAYS[kind][1].lower()
    sets = [one for one in axes.collections if isinstance(one, LineCollection)]
    return np.concatenate([one.get_segments() for one in sets if to_hex(one.get_colors()[0]) == colour])


def test_both_views_have_the_feeds_and_the_rapids_in_the_coordinates_of_g54() -> None:
    top, front = drawn(shape_of(TEXT.replace("X500", "X90")), [])
    corners = {tuple(point) for point in np.round(ways(top, FEED).reshape(-1, 2), 6)}
    assert {(5.0, 6.0), (25.0, 6.0), (25.0, 16.0)} == corners
    assert ways(front, FEED)[:, :, 1].min() == pytest.approx(2.0)
    assert ways(front, RAPID)[:, :, 1].max() >= 60.0 - 1e-6


def test_what_is_fed_fills_the_view_however_far_the_rapids_go() -> None:
    top, _ = drawn(shape_of(TEXT.replace("X500", "X90")), [])
    top.apply_aspect()
    low, high = top.get_xlim()
    assert low < 5.0 and 25.0 < high < 60.0


def test_a_line_is_marked_where_its_feed_ends_or_where_the_path_was_before_it() -> None:
    shape = shape_of(TEXT.replace("X500", "X90"))
    top, _ = drawn(shape, [Mark(4, refused=False), Mark(8, refused=True)])
    marks = {line.get_label(): (*line.get_xydata()[0],) for line in top.lines}
    assert marks["note, line 4"] == pytest.approx((25.0, 6.0))
    assert marks["refused, line 8"] == pytest.approx((90.0, 6.0))
    assert pictures.place_of(Mark(7, refused=True), shape) == len(shape.tips) - 1


def test_of_many_named_lines_the_first_are_marked_once() -> None:
    assert [one.line for one in pictures.marks([5, 3, 0, 5, *range(10, 40)], refused=False)] == [
        *(3, 5),
        *range(10, 20),
    ]


def test_a_refused_program_is_drawn_behind_its_guilty_line_with_the_line_marked(tmp_path: Path) -> None:
    text = TEXT.replace("X25\n", "X25 Q9\n").replace("X500", "X90")
    task = checked.task(text.encode(), "part.ngc", machine())
    shape = refused_path.shape_of(task)
    assert shape is not None and shape.tips[shape.kinds == FEED][:, 1].max() > 15.0, (
        "it goes on behind line 4"
    )
    (tmp_path / "part.ngc").write_text(text)
    words = ["check", str(tmp_path / "part.ngc"), "--plot", str(tmp_path / "p.png")]
    done = CliRunner().invoke(app, [*words, "--store", str(tmp_path)])
    assert done.exit_code == 1 and "Q9" in done.output
    head = (tmp_path / "p.png").read_bytes()[:24]
    assert head.startswith(b"\x89PNG") and int.from_bytes(head[16:20]) == 1600


def test_the_guilty_line_of_a_called_file_is_that_which_calls_it() -> None:
    facts = {"refusals": [{"file": "sub.ngc", "line": 3, "called_at": 7}, {"file": "part.ngc", "line": 2}]}
    assert refused_path.guilty_lines(facts, "part.ngc") == [2, 7]
    assert refused_path.guilty_lines({"file": "part.ngc", "line": 5}, "part.ngc") == [5]
