"""Strips in cut order, each with the cutter out of the material."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("OCP", reason="OpenCASCADE is missing: the extra cad, and libGL", exc_type=ImportError)

from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
)
from support.parts import cad_parts as parts
from support.parts import trimmed_walls as walls
from support.parts.cad_cases import blade, faces, off, one_strip

from controller.cad import program
from controller.cad.strip import NotRuled, strip


def test_the_sides_of_a_prism_make_one_row_round_it(tmp_path: Path) -> None:
    corners = [(0, 0, 0), (30, 0, 0), (36, 20, 0), (10, 28, 0), (-4, 15, 0)]
    sides = []
    for face in faces(parts.polygon_prism(corners, (0, 0, 10)), tmp_path):
        try:
            sides.append(strip(face))
        except NotRuled:
            assert face.kind == "plane"
    assert len(sides) == 5
    for right in (True, False):
        row = program.ordered([one if one.right is right else one.turned() for one in sides])
        assert all(program.meets(a, b) for a, b in pairwise(row))


def test_the_cutter_is_outside_of_a_boss_and_inside_of_a_bore(tmp_path: Path) -> None:
    block = BRepPrimAPI_MakeBox(40.0, 40.0, 10.0).Shape()
    bore = parts.moved(BRepPrimAPI_MakeCylinder(8.0, 30.0).Shape(), (20, 20, -5))
    found = [
        strip(face)
        for face in faces(BRepAlgoAPI_Cut(block, bore).Shape(), tmp_path)
        if face.kind == "cylinder"
    ]
    (hole,) = found
    assert hole.concave_mm() == pytest.approx(8.0, rel=1e-6)
    boss = one_strip(BRepPrimAPI_MakeCylinder(8.0, 12.0).Shape(), tmp_path)
    assert boss.concave_mm() == math.inf


@pytest.mark.parametrize("seed", range(2))
def test_a_strip_run_the_other_way_is_the_same_surface_with_the_cutter_on_the_other_side(
    tmp_path: Path, seed: int
) -> None:
    made = one_strip(blade(seed, rational=bool(seed % 2)), tmp_path)
    turned = made.turned()
    share = np.linspace(0.0, 1.0, 13)
    assert np.abs(turned.lower.at(share) - made.lower.at(1.0 - share)).max() < 1e-12
    assert turned.right is not made.right
    assert turned.concave_mm() == pytest.approx(made.concave_mm(), rel=1e-6)


def split_wall(height: float) -> Any:
    """A wall that a level plane splits in two faces, as sheets."""
    body = parts.moved(BRepPrimAPI_MakeBox(200.0, 200.0, 50.0).Shape(), (-50.0, -100.0, height - 50.0))
    under = BRepAlgoAPI_Common(walls.upright(), body).Shape()
    return parts.together(under, BRepAlgoAPI_Cut(walls.upright(), body).Shape())


def test_a_side_that_is_split_across_its_rulings_is_one_surface(tmp_path: Path) -> None:
    low, high = (strip(face) for face in faces(split_wall(9.0), tmp_path))
    (whole,) = program.stacked([high, low])
    share = np.linspace(0.0, 1.0, 9)
    for curve, v in ((whole.lower, 0.0), (whole.upper, 1.0)):
        assert max(abs(walls.place_on_wall(point)[1] - v) for point in curve.at(share)) < 1e-5
    assert [part.face.number for part in whole.joined] == [low.face.number, high.face.number]
    assert off(whole) < 1e-4
    assert len(program.stacked([low, high.turned()])) == 2, "the cutter is on the other side of the other"


def test_two_walls_that_meet_at_an_angle_are_not_one(tmp_path: Path) -> None:
    """The one leans on the other's upper edge."""
    upper = parts.patch(4, [walls.HIGH, walls.HIGH + np.array((0.0, 6.0, 15.0))])
    found = [strip(face) for face in faces(parts.together(walls.upright(), upper), tmp_path)]
    assert len(program.stacked(found)) == 2
