"""Faces of CAD files for the tests of ``controller.cad``; import after ``importorskip``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from support.parts import cad_parts as parts

from controller.cad import kernel, program
from controller.cad.deviation import deviation, surfaces
from controller.cad.strip import Strip, strip
from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Frame
from controller.machine.machine_file import load
from controller.program import blocks

HALF_TURN = math.pi

CUBIC = [(0, 0, 0), (10, 9, 0), (20, -6, 0), (30, 0, 0)]

ABOVE = [(1, 2, 14), (9, 8, 14), (21, 3, 15), (31, 6, 16)]

ROW = [(0, 0, 0), (8, 5, 0), (20, -6, 0), (30, 0, 0), (41, 4, 1)]


def faces(shape: Any, folder: Path, unit: str = "MM", placed: Frame | None = None) -> list[kernel.Face]:
    return kernel.read(parts.save(shape, folder / "part.step", unit), placed or Frame()).faces


def one_strip(shape: Any, folder: Path, **how: Any) -> Strip:
    """Of the only face that is not plane."""
    (face,) = [face for face in faces(shape, folder, **how) if face.kind != "plane"]
    return strip(face)


def written(made: Strip) -> Surface:
    """What our reader makes of the program of one strip."""
    machine = load("trunnion")
    wanted = program.Wanted(300.0, 8000.0, False, "double")
    text = program.write(["a test"], [made], machine.tools[0], wanted).text
    (read,) = surfaces(blocks.stream(text.encode(), machine, "test.ngc"))
    return read


def off(made: Strip) -> float:
    """Largest distance of the written surface and the face, both ways, mm."""
    return deviation(made, written(made)).largest_mm


def blade(seed: int, rational: bool = False, across: int = 2) -> Any:
    """A twisted B-spline face like a blade's, straight across: middle rows of points lie between."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 60.0, 9)
    low = np.stack([x, 8.0 * np.sin(x / 15.0) + rng.uniform(-0.8, 0.8, 9), rng.uniform(-1.0, 1.0, 9)], axis=1)
    high = low + np.stack(
        [rng.uniform(-2.0, 2.0, 9), 4.0 + rng.uniform(-1.0, 1.0, 9), 18.0 + rng.uniform(-1.0, 1.0, 9)], axis=1
    )
    share = np.linspace(0.0, 1.0, across)[:, None, None]
    rows = (1.0 - share) * low + share * high
    weights = np.tile(rng.uniform(0.6, 1.6, 9), (across, 1)) if rational else None
    return parts.patch(4, list(rows), weights)
