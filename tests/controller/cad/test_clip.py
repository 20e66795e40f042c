"""Rulings clipped to what a face is trimmed to, against surfaces known by their formula."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("OCP", reason="OpenCASCADE is missing: the extra cad, and libGL", exc_type=ImportError)

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeCylinder
from support.parts import cad_parts as parts
from support.parts import trimmed_walls as walls
from support.parts.cad_cases import HALF_TURN, faces, off, one_strip, written

from controller.cad.deviation import deviation
from controller.cad.strip import How, NotRuled, Strip, strip, strips
from controller.messages import text

FIT_MM = 1e-4
SHARES = np.linspace(0.0, 1.0, 9)


def ends(made: Strip) -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """The places on the wall of the lower and the upper end of some of its rulings."""
    rows = zip(made.lower.at(SHARES), made.upper.at(SHARES), strict=True)
    return [(walls.place_on_wall(low), walls.place_on_wall(high)) for low, high in rows]


@pytest.mark.parametrize("name", list(walls.TRIMS))
@pytest.mark.parametrize("face", [walls.upright, walls.swapped, walls.reversed_], ids=["v", "u", "reversed"])
def test_rulings_stay_rulings_and_end_where_the_face_is_trimmed(name: str, face: Any, tmp_path: Path) -> None:
    trim = walls.TRIMS[name]
    (found,) = faces(walls.trimmed(face(), trim), tmp_path)
    made = strip(found)
    for (u_low, v_low, off_low), (u_high, v_high, off_high) in ends(made):
        assert max(off_low, off_high) < FIT_MM
        assert u_low == pytest.approx(u_high, abs=1e-5), "one ruling of the wall"
        assert v_low < v_high
        if made.prolonged_mm <= 0.0:
            for v, at in ((v_low, walls.wall(u_low, v_low)), (v_high, walls.wall(u_high, v_high))):
                assert min(abs(v), abs(v - 1.0)) < 1e-5 or trim.off(at) < FIT_MM
    assert off(made) < FIT_MM, "all of the face is cut, and nothing beside its surface"


def test_the_material_is_on_the_side_that_the_file_says(tmp_path: Path) -> None:
    trim = walls.TRIMS["a slanting plane"]
    sides = [
        strip(*faces(walls.trimmed(face(), trim), tmp_path)).right
        for face in (walls.upright, walls.reversed_)
    ]
    assert sides[0] is not sides[1]


def test_an_outline_that_runs_along_rulings_is_left_where_it_turns_too_steep(tmp_path: Path) -> None:
    """A disc: its rulings shrink to nothing at two ends, at which no cutter has a way across them."""
    (found,) = faces(walls.trimmed(walls.upright(), walls.TRIMS["a cylinder across"]), tmp_path)
    made = strip(found)
    assert 0.0 < made.prolonged_mm < 1.1
    assert "prolonged" in " ".join(map(text, made.remarks))
    lengths = np.linalg.norm(made.upper.at(SHARES) - made.lower.at(SHARES), axis=1)
    assert lengths.min() > 0.9
    assert lengths.max() == pytest.approx(20.5, abs=0.1)


def test_rulings_are_prolonged_where_it_is_wished_and_nothing_is_in_the_way(tmp_path: Path) -> None:
    solid = walls.blade_on_hub()
    (side, _) = (face for face in faces(solid, tmp_path) if face.kind == "B-spline" and face.area_mm2 > 100.0)
    plain, longer = strip(side), strip(side, How(prolong_mm=3.0))
    for a, b in ((plain.lower, longer.lower), (plain.upper, longer.upper)):
        assert (
            np.abs(
                np.cross(a.at(SHARES) - b.at(SHARES), plain.upper.at(SHARES) - plain.lower.at(SHARES))
            ).max()
            < 1e-2
        )
    moved = [
        np.linalg.norm(b.at(SHARES) - a.at(SHARES), axis=1)
        for a, b in ((plain.lower, longer.lower), (plain.upper, longer.upper))
    ]
    assert moved[0].max() < FIT_MM, "the hub is in the way"
    assert moved[1] == pytest.approx(3.0, abs=1e-3)
    assert off(longer) < FIT_MM


def test_blades_stand_on_their_hub_and_end_at_their_shroud(tmp_path: Path) -> None:
    sides = [face for face in faces(walls.blade_on_hub(), tmp_path) if face.kind == "B-spline"]
    assert len(sides) == 4
    for face in sides:
        made = strip(face)
        assert made.stands == 1.0
        low, high = made.lower.at(SHARES), made.upper.at(SHARES)
        assert np.abs(np.linalg.norm(low - np.array((0.0, 0.0, -80.0)), axis=1) - 80.0).max() < FIT_MM, (
            "the dome"
        )
        slope = np.hypot(high[:, 0], high[:, 1]) - (60.0 - (high[:, 2] + 16.0) * 58.0 / 34.0)
        assert np.abs(slope).max() < 2.0 * FIT_MM, "the cone"


def test_lower_is_where_rulings_stand_though_it_is_higher(tmp_path: Path) -> None:
    upside_down = parts.moved(walls.blade_on_hub(), (0, 0, 0), (1, 0, 0), HALF_TURN)
    for face in faces(upside_down, tmp_path):
        if face.kind == "B-spline":
            made = strip(face)
            assert made.lower.at(SHARES)[:, 2].min() > made.upper.at(SHARES)[:, 2].max()


def test_what_another_body_hides_is_not_cut(tmp_path: Path) -> None:
    """Blade and hub as two bodies that go into each other, as assemblies have them."""
    found = faces(parts.together(walls.hub(), walls.blade()), tmp_path)
    sides = [strip(face) for face in found if face.kind == "B-spline"]
    assert len(sides) == 4
    for made in sides:
        assert np.abs(made.lower.at(SHARES)[:, 2]).max() < FIT_MM, "on the hub's top, not at the blade's foot"
        assert made.stands == 1.0
        assert "9.1 % of it are inside of other bodies" in text(made.remarks[0])
        assert off(made) < FIT_MM
    (foot,) = [face for face in found if face.kind == "plane" and not face.exposed()]
    with pytest.raises(NotRuled, match="all of it is inside of other bodies"):
        strip(foot)


def test_material_in_the_middle_of_rulings_is_refused_with_its_place(tmp_path: Path) -> None:
    block = BRepPrimAPI_MakeBox(40.0, 30.0, 20.0).Shape()
    boss = parts.moved(BRepPrimAPI_MakeCylinder(4.0, 12.0).Shape(), (20, 36, 10), (1, 0, 0), HALF_TURN / 2.0)
    found = faces(parts.together(block, boss), tmp_path)
    with pytest.raises(
        NotRuled, match=r"other material is in the middle of its rulings, near X20.00 Y30.00 Z"
    ):
        strip(max(found, key=lambda face: face.area_mm2 * (face.outward(1.0, 1.0)[1] > 0.5)))


def test_a_face_that_a_rib_cuts_apart_is_two_strips(tmp_path: Path) -> None:
    block = BRepPrimAPI_MakeBox(60.0, 10.0, 20.0).Shape()
    rib = parts.moved(BRepPrimAPI_MakeBox(6.0, 30.0, 40.0).Shape(), (20.0, -15.0, -5.0))
    found = faces(parts.together(block, rib), tmp_path)
    (wall,) = [face for face in found[:6] if face.outward(1.0, 1.0)[1] < -0.5]
    assert [round(made.size()[0], 6) for made in strips(wall, How())] == [34.0, 20.0]


def test_a_whole_turn_is_cut_off_aslant(tmp_path: Path) -> None:
    """A periodic surface, from its seam to its seam."""
    over = parts.moved(BRepPrimAPI_MakeBox(60.0, 60.0, 40.0).Shape(), (-30, -30, 12), (1, 0, 0), 0.2)
    made = one_strip(BRepAlgoAPI_Cut(BRepPrimAPI_MakeCone(12.0, 5.0, 20.0).Shape(), over).Shape(), tmp_path)
    high = made.upper.at(SHARES)
    assert np.abs(np.hypot(high[:, 0], high[:, 1]) - (12.0 - 0.35 * high[:, 2])).max() < FIT_MM
    assert np.linalg.norm(high[0] - high[-1]) < FIT_MM
    assert deviation(made, written(made)).largest_mm < FIT_MM


def test_beside_a_step_in_what_it_stands_on_the_edge_stays_up_for_the_cutter(tmp_path: Path) -> None:
    """A blade on a floor at Z = 0 that rises to Z = 6 at X = 5."""
    high = parts.moved(BRepPrimAPI_MakeBox(60.0, 80.0, 16.0).Shape(), (5.0, -40.0, -10.0))
    found = faces(parts.together(walls.blade(), walls.hub(), high), tmp_path)
    sides = [face for face in found if face.kind == "B-spline" and face.area_mm2 > 500.0]
    assert len(sides) == 2
    for face in sides:
        made = strip(face, How(clear_mm=3.0))
        edge = made.lower.at(np.linspace(0.0, 1.0, 2001))
        floor = np.where(edge[:, 0] > 5.0, 6.0, 0.0)
        assert (edge[:, 2] > floor - FIT_MM).all(), "never into the floor"
        beside = (edge[:, 0] > 2.6) & (edge[:, 0] < 5.0)
        assert beside.any() and edge[beside, 2].min() > 5.0
        away = (edge[:, 0] < 1.0) | (edge[:, 0] > 6.0)
        assert np.abs(edge[away, 2] - floor[away]).max() < FIT_MM
        assert "left uncut beside other material" in " ".join(map(text, made.remarks))


def test_of_two_families_of_rulings_the_other_can_be_wished(tmp_path: Path) -> None:
    corners = np.array([[(0, 0, 0), (40, 3, 0)], [(2, 6, 20), (42, -4, 22)]], dtype=float)
    (face,) = faces(parts.patch(2, list(corners)), tmp_path)
    steep, flat = strip(face), strip(face, How(other=True))
    assert steep.size()[1] == pytest.approx(float(np.linalg.norm(corners[1, 1] - corners[0, 1])), abs=1e-6)
    assert flat.size()[1] == pytest.approx(float(np.linalg.norm(corners[1, 1] - corners[1, 0])), abs=1e-6)
    assert max(off(steep), off(flat)) < FIT_MM
    (wall,) = faces(walls.upright(), tmp_path)
    with pytest.raises(NotRuled, match="no second family of rulings"):
        strip(wall, How(other=True))
