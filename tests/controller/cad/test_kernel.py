"""STEP files as they are read: units, place, and text that no kernel has written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.parts import step_text

pytest.importorskip("OCP", reason="OpenCASCADE is missing: the extra cad, and libGL", exc_type=ImportError)

from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeCone,
)
from support.parts import cad_parts as parts
from support.parts.cad_cases import ABOVE, CUBIC, HALF_TURN, off, one_strip

from controller.cad import kernel
from controller.cad.strip import strip
from controller.geometry.vectors import Frame


@pytest.mark.parametrize("unit", ["MM", "INCH", "M"])
def test_whatever_the_unit_of_the_file_the_part_is_in_mm(tmp_path: Path, unit: str) -> None:
    made = one_strip(BRepPrimAPI_MakeCone(10.0, 6.0, 8.0).Shape(), tmp_path, unit=unit)
    assert made.cone is not None
    assert made.cone.height_mm == pytest.approx(8.0, abs=1e-9)
    assert made.cone.upper_radius_mm == pytest.approx(6.0, abs=1e-9)


def test_a_placed_part_is_cut_where_it_is_placed(tmp_path: Path) -> None:
    # The file's X is up: a cone about X becomes one about Z.
    placed = Frame((5.0, 6.0, 7.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
    lying = parts.moved(BRepPrimAPI_MakeCone(10.0, 6.0, 8.0).Shape(), (0, 0, 0), (0, 1, 0), HALF_TURN / 2.0)
    made = one_strip(lying, tmp_path, placed=placed)
    assert made.cone is not None
    assert made.cone.centre == pytest.approx((5.0, 6.0, 7.0), abs=1e-9)
    assert off(made) < 1e-5


def test_a_placed_part_is_drawn_where_it_is_placed(tmp_path: Path) -> None:
    placed = Frame((5.0, 6.0, 7.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
    file = parts.save(BRepPrimAPI_MakeCone(10.0, 6.0, 8.0).Shape(), tmp_path / "cone.step")
    corners = np.concatenate([face.triangles(0.1).reshape(-1, 3) for face in kernel.read(file, placed).faces])
    assert corners[:, 0].min() == pytest.approx(5.0 - 8.0) and corners[:, 0].max() == pytest.approx(5.0)


def test_a_face_written_by_hand_is_read_as_the_standard_says_it(tmp_path: Path) -> None:
    file = tmp_path / "hand.step"
    file.write_text(step_text.ruled_face(CUBIC, ABOVE))
    (face,) = kernel.read(file).faces
    made = strip(face)
    assert not face.in_solid
    assert np.abs(np.array(sorted(made.lower.points.tolist())) - np.array(sorted(CUBIC))).max() < 1e-12
    assert off(made) < 1e-8
