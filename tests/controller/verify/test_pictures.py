"""The picture has its size, shows the cut, and comes out for traces without one too."""

from __future__ import annotations

import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.verify import pictures, trace


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
