"""What the faces of a part are to each other."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("OCP", reason="OpenCASCADE is missing: the extra cad, and libGL", exc_type=ImportError)

from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from support.parts import cad_parts as parts
from support.parts import trimmed_walls as walls

from controller.cad import kernel
from controller.cad.roles import roles
from controller.cad.strip import NotRuled, strips


def found(shape: Any, folder: Path) -> tuple[kernel.Part, dict[int, str]]:
    part = kernel.read(parts.save(shape, folder / "part.step"))
    cut = {}
    for face in part.faces:
        try:
            cut[face.number] = strips(face)
        except NotRuled:
            continue
    return part, roles(part.faces, cut, part.meetings())


def test_fillets_are_told_from_the_blade_and_the_hub_that_they_are_between(tmp_path: Path) -> None:
    part, told = found(walls.filleted(), tmp_path)
    assert Counter(told.values()) == {"fillet": 8, "blade": 4, "turned": 3, "hub": 1}
    (hub,) = [face for face in part.faces if told[face.number] == "hub"]
    assert hub.kind == "plane" and hub.outward(1.0, 1.0)[2] > 0.0, "the side that the blade stands on"


@pytest.mark.parametrize("lies", [0.0, 1.1], ids=["upright", "askew"])
def test_a_blade_stands_on_a_hub_of_any_shape_whichever_way_the_part_lies(
    lies: float, tmp_path: Path
) -> None:
    part, told = found(parts.moved(walls.blade_on_hub(), (3, 4, 5), (1, 2, 0), lies), tmp_path)
    kinds = {face.kind: told[face.number] for face in part.faces}
    assert kinds == {"B-spline": "blade", "cone": "turned", "sphere": "hub", "plane": "turned"}


def test_a_blade_that_is_a_body_of_its_own_stands_on_its_hub(tmp_path: Path) -> None:
    part, told = found(parts.together(walls.hub(), walls.blade()), tmp_path)
    assert [told[face.number] for face in part.faces if face.kind == "B-spline"] == ["blade"] * 4
    assert Counter(told.values())["hub"] == 1


def test_without_anything_turned_a_side_is_a_wall(tmp_path: Path) -> None:
    floor = parts.moved(BRepPrimAPI_MakeBox(100.0, 60.0, 10.0).Shape(), (-50.0, -30.0, -10.0))
    part, told = found(parts.together(floor, walls.blade()), tmp_path)
    assert [told[face.number] for face in part.faces if face.kind == "B-spline"] == ["wall"] * 4
    assert set(told.values()) == {"wall", ""}
    assert math.isclose(sum(face.area_mm2 for face in part.faces[:6]), 2 * (6000.0 + 1000.0 + 600.0))
