"""CAD faces as strips of rulings: what is found, and what is refused with which reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("OCP", reason="OpenCASCADE is missing: the extra cad, and libGL", exc_type=ImportError)

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
    BRepPrimAPI_MakeWedge,
)
from support.parts import cad_parts as parts
from support.parts.cad_cases import HALF_TURN, ROW, faces, off, one_strip, written

from controller.cad import program
from controller.cad.deviation import deviation
from controller.cad.strip import How, NotRuled, strip
from controller.messages import text


def test_every_side_of_a_tapered_block_is_a_plane_between_its_own_corners(tmp_path: Path) -> None:
    """Trapezoids, whichever way round their edges stand in the file."""
    wedge = BRepPrimAPI_MakeWedge(30.0, 20.0, 10.0, 12.0).Shape()
    turned = parts.moved(wedge, (1.0, 2.0, 3.0), (1, 2, 3), 0.7)
    for face in faces(turned, tmp_path):
        made = strip(face)
        assert program.code(made) == "G52"
        assert off(made) < 1e-6


def test_a_plane_between_two_straight_edges_may_end_on_any_curve(tmp_path: Path) -> None:
    """A wall under an arched top, lying askew: its own parameters run along no edge of it."""
    low, top = np.array([(0, 0, 0), (20, 0, 0)]), [(20, 0, 9), (14, 0, 15), (5, 0, 15), (0, 0, 9)]
    outline = parts.wire(
        parts.curve(2, low),
        parts.curve(2, [low[1], top[0]]),
        parts.curve(4, top),
        parts.curve(2, [top[3], low[0]]),
    )
    wall = parts.moved(parts.filled(outline), (1, 2, 3), (1, 2, 3), 0.4)
    (face,) = faces(wall, tmp_path)
    made = strip(face)
    assert program.code(made) == "G6.2"
    assert off(made) < 1e-4
    rulings = made.upper.at(np.linspace(0.0, 1.0, 9)) - made.lower.at(np.linspace(0.0, 1.0, 9))
    assert np.abs(np.cross(rulings[1:], rulings[:-1])).max() < 1e-3


def test_a_level_face_that_rulings_do_not_fill_is_a_floor(tmp_path: Path) -> None:
    half = BRepPrimAPI_MakeCylinder(10.0, 5.0, 2.2).Shape()
    flat = [face for face in faces(half, tmp_path) if face.kind == "plane"]
    reasons = []
    for face in flat:
        try:
            strip(face)
        except NotRuled as error:
            reasons.append(text(error.said))
    assert len(reasons) == 2
    assert all("mill it with the end of a cutter" in reason for reason in reasons)


def test_a_cylinder_that_is_cut_off_at_an_angle_keeps_its_rulings(tmp_path: Path) -> None:
    over = parts.moved(BRepPrimAPI_MakeBox(60.0, 60.0, 40.0).Shape(), (-30, -30, 12), (1, 0, 0), 0.3)
    made = one_strip(BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(8.0, 20.0).Shape(), over).Shape(), tmp_path)
    assert program.code(made) == "G6.2"
    assert "fitted" in text(made.remarks[0])
    assert off(made) < 1e-4
    way = made.upper.at(np.linspace(0.0, 1.0, 30)) - made.lower.at(np.linspace(0.0, 1.0, 30))
    assert np.abs(way[:, :2]).max() < 1e-4


def holed() -> Any:
    block = BRepPrimAPI_MakeCylinder(20.0, 20.0).Shape()
    drill = parts.moved(BRepPrimAPI_MakeCylinder(3.0, 60.0).Shape(), (0, 0, 10), (1, 0, 0), HALF_TURN / 2.0)
    return BRepAlgoAPI_Cut(block, drill).Shape()


def test_a_hole_is_cut_over(tmp_path: Path) -> None:
    (face,) = [one for one in faces(holed(), tmp_path) if one.kind == "cylinder" and len(one.outlines()) > 1]
    made = strip(face)
    assert made.bridges and not made.is_whole_box
    assert "holes are cut over" in " ".join(map(text, made.remarks))
    assert deviation(made, written(made)).largest_mm < 1e-4
    assert made.size() == pytest.approx((2.0 * HALF_TURN * 20.0, 20.0), abs=2e-3)


@pytest.mark.parametrize(
    "shape",
    [lambda: BRepPrimAPI_MakeSphere(10.0).Shape(), lambda: BRepPrimAPI_MakeTorus(20.0, 4.0).Shape()],
    ids=["sphere", "torus"],
)
def test_what_bends_in_both_directions_is_refused_with_how_much(tmp_path: Path, shape: Any) -> None:
    (face,) = faces(shape(), tmp_path)
    with pytest.raises(NotRuled, match="straight lines by") as refused:
        strip(face)
    assert refused.value.off_ruled_mm > 1.0


def test_a_face_that_bulges_is_ruled_within_a_tolerance_only(tmp_path: Path) -> None:
    low, high = np.array(ROW, dtype=float), np.array(ROW, dtype=float) + np.array((0.0, 3.0, 14.0))
    middle = 0.5 * (low + high) + np.array((0.0, 0.02, 0.0))
    (face,) = faces(parts.patch(4, [low, middle, high]), tmp_path)
    with pytest.raises(NotRuled):
        strip(face, How(5e-3))
    made = strip(face, How(0.02))
    assert 5e-3 < made.off_ruled_mm <= 0.01
    # The middle of three rows has half the weight there, and the normal is not along Y.
    assert deviation(made, written(made)).largest_mm == pytest.approx(made.off_ruled_mm, rel=0.3)
