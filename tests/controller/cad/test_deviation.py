"""The written surface against the face, both ways, and what the measure itself finds."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("OCP", reason="OpenCASCADE is missing: the extra cad, and libGL", exc_type=ImportError)

from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
)
from support.parts import cad_parts as parts
from support.parts.cad_cases import ABOVE, CUBIC, HALF_TURN, ROW, blade, off, one_strip, written

from controller.cad import program
from controller.cad.deviation import deviation, distances
from controller.cad.strip import Strip

TENTH = [(4.0 * i, 6.0 * math.sin(0.7 * i), 0.0) for i in range(10)]

LONG = [*ABOVE, (40, 9, 15)]

OVER = [(x + 1.0, y + 2.0, 9.0) for x, y, _ in TENTH]

EXACT = [
    # name, shape, code it is written in, kind of the face
    ("frustum", lambda: BRepPrimAPI_MakeCone(10.0, 6.0, 8.0).Shape(), "G51", "cone"),
    ("frustum that widens upwards", lambda: BRepPrimAPI_MakeCone(5.0, 9.0, 7.0).Shape(), "G51", "cone"),
    ("a cone with a tip", lambda: BRepPrimAPI_MakeCone(7.0, 0.0, 9.0).Shape(), "G51", "cone"),
    ("cylinder", lambda: BRepPrimAPI_MakeCylinder(8.0, 12.0).Shape(), "G51", "cylinder"),
    (
        "a frustum that lies",
        lambda: parts.moved(BRepPrimAPI_MakeCone(10.0, 6.0, 8.0).Shape(), (1, 2, 3), (1, 1, 0), 1.1),
        "G6.2",
        "cone",
    ),
    (
        "a frustum upside down",
        lambda: parts.moved(BRepPrimAPI_MakeCone(10.0, 6.0, 8.0).Shape(), (0, 0, 8), (1, 0, 0), HALF_TURN),
        "G51",
        "cone",
    ),
    ("an extruded cubic", lambda: parts.extruded(parts.curve(4, CUBIC), (0, 0, 12)), "G52", "extrusion"),
    ("an oblique extrusion", lambda: parts.extruded(parts.curve(4, ROW), (2, 5, 12)), "G6.2", "extrusion"),
    (
        "a loft between two cubics",
        lambda: parts.lofted(parts.wire(parts.curve(4, CUBIC)), parts.wire(parts.curve(4, ABOVE))),
        "G52",
        "B-spline",
    ),
    (
        "a loft between two splines",
        lambda: parts.lofted(parts.wire(parts.curve(4, ROW)), parts.wire(parts.curve(4, LONG))),
        "G6.2",
        "B-spline",
    ),
    ("a blade", lambda: blade(1), "G6.2", "B-spline"),
    ("a rational blade", lambda: blade(2, rational=True), "G6.2", "B-spline"),
    ("a blade whose rows are raised to a cubic", lambda: blade(3, across=4), "G6.2", "B-spline"),
    (
        "degree nine, which is fitted",
        lambda: parts.patch(10, [TENTH, OVER]),
        "G6.2",
        "B-spline",
    ),
]


@pytest.mark.parametrize(("shape", "code", "kind"), [row[1:] for row in EXACT], ids=[row[0] for row in EXACT])
def test_the_written_surface_is_the_face(tmp_path: Path, shape: Any, code: str, kind: str) -> None:
    made = one_strip(shape(), tmp_path)
    assert (program.code(made), made.face.kind) == (code, kind)
    assert made.off_ruled_mm < 1e-6
    assert off(made) < 5e-5


def test_a_cone_agrees_with_its_formula(tmp_path: Path) -> None:
    """Independent of the kernel: distance of points of the written surface from the cone itself."""
    read = written(one_strip(BRepPrimAPI_MakeCone(10.0, 6.0, 8.0).Shape(), tmp_path))
    u, v = (m.ravel() for m in np.meshgrid(np.linspace(0, 1, 37), np.linspace(0, 1, 11)))
    x, y, z = read.point(u, v, np)
    slope = math.hypot(8.0, 4.0)
    assert np.abs((np.hypot(x, y) - (10.0 - 0.5 * z)) * 8.0 / slope).max() < 1e-8
    assert (z.min(), z.max()) == pytest.approx((0.0, 8.0), abs=1e-9)


def test_a_loft_agrees_with_the_curves_it_was_made_from(tmp_path: Path) -> None:
    loft = parts.lofted(parts.wire(parts.curve(4, CUBIC)), parts.wire(parts.curve(4, ABOVE)))
    read = written(one_strip(loft, tmp_path))
    low, high = (np.array(points, dtype=float) for points in (CUBIC, ABOVE))
    t = np.linspace(0.0, 1.0, 41)[:, None]
    basis = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
    for share in (0.0, 0.3, 1.0):
        assert distances(read, (1.0 - share) * basis @ low + share * basis @ high).max() < 1e-8


def test_a_closed_spline_that_bends_sharply_is_measured_where_it_is(tmp_path: Path) -> None:
    """The kernel's own search misses the nearest place of such a face."""
    angles = np.linspace(0.0, 2.0 * math.pi, 13)
    ring = [(20.0 * math.cos(a) + 3.0 * math.cos(3.0 * a), 12.0 * math.sin(a), 0.0) for a in angles]
    made = one_strip(parts.extruded(parts.curve(4, ring), (0, 0, 12)), tmp_path)
    assert off(made) < 1e-4


def test_a_deviation_that_was_put_in_is_found(tmp_path: Path) -> None:
    made = one_strip(blade(5), tmp_path)
    bent = replace(made.lower, points=made.lower.points + np.array((0.0, 0.004, 0.0)))
    read = Strip(made.face, made.upper, bent, 0.0, made.right).surface
    found = deviation(made, read)
    assert 2e-3 < found.to_face_mm < 4.1e-3
    assert 2e-3 < found.to_written_mm < 4.1e-3


def test_a_surface_that_is_too_short_is_found_from_the_other_side(tmp_path: Path) -> None:
    made = one_strip(parts.extruded(parts.curve(4, CUBIC), (0, 0, 12)), tmp_path)
    short = replace(made.upper, points=made.upper.points - np.array((0.0, 0.0, 0.5)))
    found = deviation(made, Strip(made.face, short, made.lower, 0.0, made.right).surface)
    assert found.to_face_mm < 1e-6
    assert found.to_written_mm == pytest.approx(0.5, abs=1e-6)
