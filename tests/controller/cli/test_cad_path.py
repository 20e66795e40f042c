"""``directrix import`` of a CAM system's lines: the ruled surface that they cut, and what is none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree
from support.parts.swarf_files import along, cl_file, goto, random_surface
from typer.testing import CliRunner

from controller.__main__ import app
from controller.geometry.surfaces import RuledSurface
from controller.machine import machine_file
from controller.plan.surfaces.cuts import surface_of
from controller.program import blocks
from controller.program.program import CutNurbs, CutRuled

MACHINE = machine_file.load("trunnion")
TOOL = MACHINE.tool(1)
assert TOOL is not None
RADIUS = TOOL.radius_mm


def run(*words: object) -> tuple[int, dict[str, Any]]:
    result = CliRunner().invoke(app, ["import", *map(str, words), "--json"])
    return result.exit_code, json.loads(result.stdout)


def cut(file: Path) -> list[RuledSurface]:
    read = blocks.stream(file.read_bytes(), MACHINE, str(file))
    return [surface_of(block) for block in read if isinstance(block, CutRuled | CutNurbs)]  # type: ignore[misc]


def apart_mm(one: RuledSurface, other: RuledSurface, v: float) -> float:
    """How far places of the one at ``v`` (mm from its lower curve along the ruling) are from the other's."""
    u = np.linspace(0.0, 1.0, 20001)
    rows = []
    for surface in (one, other):
        axis, low = (np.stack(c, axis=1) for c in (surface.axis(u, np), surface.lower.at(u, np)))
        rows.append(low + v * axis)
    return float(cKDTree(rows[1]).query(rows[0][::100])[0].max())


@pytest.mark.parametrize(("seed", "right"), [(1, False), (2, True), (3, False)])
def test_rows_of_a_cl_file_are_the_surface_that_they_were_made_for(
    seed: int, right: bool, tmp_path: Path
) -> None:
    surface = random_surface(seed)
    file = tmp_path / "wall.cls"
    file.write_text(cl_file([along(surface, RADIUS if right else -RADIUS, 60)], RADIUS, 4))
    words = ("--direction", "conventional") if right else ()
    code, told = run(file, "--faces", "all", "--tolerance", 0.002, *words)
    assert code == 0, told
    (face,) = told["faces"]
    tool = MACHINE.tool(told["tool"])
    assert (face["kind"], face["cut_as"]) == ("lines", "G6.2") and tool is not None
    assert tool.radius_mm == RADIUS
    assert face["tip_off_mm"] < 0.003 and face["axis_off_deg"] < 0.01
    (found,) = cut(tmp_path / "wall.ngc")
    assert max(apart_mm(found, surface, v) for v in (0.0, 12.0)) < 0.01
    side = "G42" if right else "G41"
    assert f"{side} P1" in (tmp_path / "wall.ngc").read_text()


def test_bottom_and_top_of_an_operation_are_one_surface_as_high_as_they_are_apart(tmp_path: Path) -> None:
    surface = random_surface(4)
    rows = [along(surface, -RADIUS, 90, above) for above in (0.0, 7.0)]
    file = tmp_path / "pair.apt"
    file.write_text(cl_file(rows, RADIUS))
    code, told = run(file, "--list", "--tolerance", 0.002)
    assert code == 0, told
    (row,) = told["rows"]
    assert row["kind"] == "pair" and row["why_not"] is None, row
    assert row["height_mm"] == pytest.approx(7.0, abs=0.01)


def test_two_curves_of_movnrb_are_one_surface_and_the_lines_below_are_compared(tmp_path: Path) -> None:
    surface = random_surface(5)
    tips, axes = along(surface, -RADIUS, 40)
    from scipy.interpolate import make_interp_spline

    share = np.linspace(0.0, 1.0, 40)
    low, high = (make_interp_spline(share, points, k=3) for points in (tips, tips + 10.0 * axes))
    knots, count = low.t, len(low.c)
    listed = [",".join(f"{value:.7f}" for value in part.ravel()) for part in (knots, low.c, high.c)]
    text = ["UNITS/MM", f"CUTTER/{2.0 * RADIUS}", "MOVNRB/5AXIS,LENGTH,10.0"]
    text += [f"MOVNRB/ON,4,{len(knots)},0,{count},40.0"]
    for number, values in enumerate(listed, start=1):
        parts = values.split(",")
        text += [f"MOVNRB/{number}," + ",".join(parts[k : k + 24]) for k in range(0, len(parts), 24)]
    text += ["MOVNRB/NEXT", *goto(tips, axes), "MOVNRB/OFF", "FINI"]
    file = tmp_path / "curves.cl"
    file.write_text("\n".join(text))
    code, told = run(file, "--faces", "1")
    assert code == 0, told
    (face,) = told["faces"]
    assert face["kind"] == "nurbs" and face["lines"] == 40
    assert face["height_mm"] == pytest.approx(10.0, abs=0.01) and face["tip_off_mm"] < 1e-3
    file.with_name("alone.cl").write_text("\n".join(line for line in text if not line.startswith("GOTO")))
    code, told = run(file.with_name("alone.cl"), "--list")
    assert code == 0 and told["rows"][0]["tip_off_mm"] < 1e-3, told
    (found,) = cut(tmp_path / "curves.ngc")
    assert max(apart_mm(found, surface, v) for v in (0.0, 10.0)) < 0.005


def test_a_program_of_tool_vectors_is_read_as_well(tmp_path: Path) -> None:
    tips, axes = along(random_surface(6), -RADIUS, 50)
    file = tmp_path / "wall.nc"
    lines = [
        "X{:.4f} Y{:.4f} Z{:.4f} I{:.6f} J{:.6f} K{:.6f}".format(*tip, *axis)
        for tip, axis in zip(tips, axes, strict=True)
    ]
    file.write_text(
        "\n".join(["G21 G90 G94", "G43.5", f"G0 {lines[0]}", f"G1 {lines[1]} F300.", *lines[2:], "M30"])
    )
    code, told = run(file, "--faces", "all", "--tolerance", 0.002)
    assert code == 0 and told["faces"][0]["line"] == 3, told
    assert len(cut(tmp_path / "wall.ngc")) == 1


def test_passes_beside_each_other_and_a_contour_in_a_plane_are_not_offered(tmp_path: Path) -> None:
    surface = random_surface(7)
    tips, axes = along(surface, -RADIUS, 40)
    file = tmp_path / "passes.cl"
    file.write_text(cl_file([(tips + np.array([0.0, 0.5 * k, 0.0]), axes) for k in range(3)], RADIUS))
    code, told = run(file, "--list", "--tolerance", 0.01)
    assert code == 0 and all(row["passes_beside"] for row in told["rows"]), told
    code, told = run(file, "--faces", "all", "--tolerance", 0.01)
    assert code == 1 and "other passes lie beside" in told["error"]
    upright = np.broadcast_to((0.0, 0.0, 1.0), axes.shape)
    file.write_text(cl_file([(tips, upright)], RADIUS))
    code, told = run(file, "--list")
    assert code == 1 and "whose tool axis turns" in told["error"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("GOTO/1,2", "wall.cl:2: GOTO has 2 numbers"),
        ("GOTO/1,2,x", "wall.cl:2: 'X' is no number"),
        ("GOTO/1,2,3,0,0,0", "wall.cl:2: the tool axis"),
        ("CUTTER/10,0,0,0,5", "wall.cl:2: the cutter is tapered"),
        ("MOVNRB/5AXIS", "wall.cl:2"),
        ("MOVNRB/5AXIS,LENGTH,9\nMOVNRB/ON,1,2,0,1,5\nMOVNRB/OFF", "wall.cl:3: MOVNRB/ON takes order"),
        ("MOVNRB/5AXIS,LENGTH,9\nMOVNRB/ON,2,4,0,2,5\nMOVNRB/OFF", "wall.cl:3: curves of order 2"),
    ],
)
def test_what_is_wrong_in_a_cl_file_is_told_with_its_line(line: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "wall.cl"
    file.write_text(f"UNITS/MM\n{line}\n")
    code, told = run(file, "--list")
    assert code == 1 and said in told["error"], told


def test_options_of_cad_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "wall.cl"
    file.write_text("GOTO/1,2,3\n")
    for words in (("--turn", "X90"), ("--placement", "optimal")):
        code, told = run(file, "--list", *words)
        assert code == 1 and f"{words[0]} is for faces of a STEP file" in told["error"]
