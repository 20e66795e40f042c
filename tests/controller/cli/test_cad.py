"""``directrix import``: from a STEP file to a program that the controller checks, and what it refuses."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

pytest.importorskip("OCP", reason="OpenCASCADE is missing: the extra cad, and libGL", exc_type=ImportError)

from OCP.Standard import Standard_ConstructionError
from support.parts import cad_parts, step_text, trimmed_walls

from controller.__main__ import app
from controller.cad import kernel

SVG = "{http://www.w3.org/2000/svg}"
LOW = [(0, 0, 0), (10, 9, 0), (20, -6, 0), (30, 0, 0)]
HIGH = [(1, 2, 14), (9, 8, 14), (21, 3, 15), (31, 6, 16)]


@pytest.fixture
def blade(tmp_path: Path) -> Path:
    file = tmp_path / "blade.step"
    file.write_text(step_text.ruled_face(LOW, HIGH))
    return file


def run(*words: object) -> tuple[int, dict[str, Any]]:
    """Exit code and the JSON object of ``directrix import``."""
    result = CliRunner().invoke(app, ["import", *map(str, words), "--json"])
    return result.exit_code, json.loads(result.stdout)


def test_a_face_written_by_hand_is_listed_and_written(blade: Path) -> None:
    code, told = run(blade, "--list")
    (face,) = told["faces"]
    assert (code, face["cut_as"]) == (0, "G52")
    assert face["off_ruled_mm"] < 1e-9
    assert face["twist_deg"] > 10.0
    code, told = run(blade, "--faces", "1")
    assert code == 0
    assert max(told["faces"][0]["to_face_mm"], told["faces"][0]["to_written_mm"]) < 1e-6
    text = blade.with_suffix(".ngc").read_text()
    assert "G52 X31. Y6. Z16. F300." in text
    assert "G41 P2" in text


@pytest.mark.parametrize("beyond", [3e-8, 1e-6])
def test_edges_that_lie_beyond_their_surface_are_taken_at_its_bounds(beyond: float, tmp_path: Path) -> None:
    file = tmp_path / "beyond.step"
    file.write_text(step_text.ruled_face(LOW, HIGH, beyond))
    code, told = run(file, "--list")
    assert code == 0 and [face["cut_as"] for face in told["faces"]] == ["G52"], told
    code, told = run(file, "--faces", "1")
    assert code == 0 and told["faces"][0]["to_written_mm"] < 30.0 * beyond


@pytest.mark.parametrize("refuses", ["edge_points", "triangles", "outlines", "spline", "_adaptor"])
def test_a_face_that_the_kernel_refuses_is_listed_with_the_reason(
    refuses: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its exceptions have no class in common but Python's own."""
    wall, other = (cad_parts.moved(cad_parts.patch(4, [LOW, HIGH]), (0.0, y, 0.0)) for y in (0.0, 50.0))
    file = cad_parts.save(cad_parts.together(wall, other), tmp_path / "two.step")
    whole = getattr(kernel.Face, refuses)

    def refused(face: kernel.Face, *how: Any) -> Any:
        if face.number == 2:
            raise Standard_ConstructionError("parameters out of range")
        return whole.func(face) if refuses == "_adaptor" else whole(face, *how)

    monkeypatch.setattr(kernel.Face, refuses, property(refused) if refuses == "_adaptor" else refused)
    code, told = run(file, "--list", "--plot", tmp_path / "two.svg")
    assert code == 0, told
    first, second = told["faces"]
    assert first["cut_as"] == "G52"
    if refuses in ("edge_points", "_adaptor"):  # only picture and kind need them
        assert second["cut_as"] == "G52"
        return
    assert second["cut_as"] is None
    assert second["why_not"] == "OpenCASCADE cannot evaluate it (parameters out of range)"
    shown = CliRunner().invoke(app, ["import", str(file), "--list"])
    assert shown.exit_code == 0 and "parameters out of range" in shown.stdout.replace("\n", " ")


def test_every_face_of_a_list_is_numbered_on_a_picture_with_its_place_and_normal(
    blade: Path, tmp_path: Path
) -> None:
    drawn = tmp_path / "faces.svg"
    code, told = run(blade, "--list", "--plot", drawn)
    (face,) = told["faces"]
    assert code == 0 and math.isclose(math.hypot(*face["normal"]), 1.0, abs_tol=1e-5)
    assert all(0.0 < at < most for at, most in zip(face["middle_mm"][::2], (31, 16), strict=True))
    tree = ElementTree.fromstring(drawn.read_text())
    texts = [one.text for one in tree.iter(f"{SVG}text")]
    assert [text for text in texts if text == "1"]
    assert texts[-2:] == ["T3 (end mill 6 mm, long) and thinner tools", "not cut along rulings"]
    assert len(list(tree.iter(f"{SVG}line"))) >= 26, "its rulings, in pieces"
    points = [one.get("points", "") for one in tree.iter("{http://www.w3.org/2000/svg}polygon")]
    numbers = [float(word) for row in points for pair in row.split() for word in pair.split(",")]
    assert len(points) > 20 and min(numbers) >= 29.9 and max(numbers) <= 670.1
    assert run(blade, "--list", "--plot", drawn)[0] == 1, "what is there is not replaced unasked"
    assert run(blade, "--faces", "1", "--plot", tmp_path / "other.svg")[0] == 1


@pytest.mark.parametrize("language", ["en", "de"])
def test_a_list_says_what_each_face_is_within_80_columns(language: str, tmp_path: Path) -> None:
    file = cad_parts.save(trimmed_walls.filleted(), tmp_path / "filleted.step")
    shown = CliRunner().invoke(
        app, ["import", str(file), "--list", "--language", language], env={"COLUMNS": "80"}
    )
    assert shown.exit_code == 0
    assert max(map(len, shown.stdout.splitlines())) <= 80
    if language == "en":
        code, told = run(file, "--list")
        found = {face["number"]: face["role"] for face in told["faces"]}
        assert code == 0 and list(found.values()).count("blade") == 4
        assert list(found.values()).count("fillet") == 8
        assert list(found.values()).count("hub") == 1


@pytest.mark.slow
def test_one_command_leads_from_step_to_the_verdict(tmp_path: Path) -> None:
    file = cad_parts.save(trimmed_walls.blade_on_hub(), tmp_path / "wheel.step")
    code, told = run(file, "--faces", "blades", "--tool", "3", "--verify")
    assert code == 0, told
    assert len(told["faces"]) == 4
    assert max(max(face["to_face_mm"], face["to_written_mm"]) for face in told["faces"]) < 1e-4
    assert told["check"]["ok"] and told["check"]["duration_s"] > 0.0
    assert len(told["verify"]["surfaces"]) == 4 and not told["verify"]["gouges"]


def test_a_program_that_is_not_cut_well_ends_with_the_verdict(blade: Path) -> None:
    """A twist of 20 degrees, placed as the paper has it: written, and refused with the figures of both."""
    code, told = run(blade, "--faces", "1", "--tool", "3", "--placement", "single", "--verify")
    assert code == 1 and blade.with_suffix(".ngc").is_file()
    assert told["check"]["ok"] is False and "tolerance" in told["error"]
    assert told["verify"]["surfaces"][0]["line"] == told["check"]["line"]


@pytest.mark.parametrize("sides", [5, 8, 9])
def test_a_regular_prism_whose_corners_face_each_other_is_listed(sides: int, tmp_path: Path) -> None:
    """Shares of the two sides that rounding alone told apart were two knots, and an error of ours."""
    turns = [2.0 * math.pi * k / sides for k in range(sides)]
    ring = [(20.0 * math.cos(turn), 12.0 * math.sin(turn), 0.0) for turn in turns]
    file = cad_parts.save(cad_parts.polygon_prism(ring, (3.0, 0.0, 15.0)), tmp_path / "prism.step")
    code, told = run(file, "--list", "--plot", tmp_path / "prism.svg")
    assert code == 0 and len(told["faces"]) == sides + 2
    (tree,) = [ElementTree.fromstring((tmp_path / "prism.svg").read_text())]
    numbers = [int(text) for one in tree.iter(f"{SVG}text") if (text := one.text or "").isdigit()]
    assert set(numbers) <= set(range(1, sides + 3)) and len(numbers) == len(set(numbers)), (
        "once, where it is seen"
    )
    assert len(numbers) >= sides
    for face in told["faces"]:
        away = [a - b for a, b in zip(face["middle_mm"], (1.5, 0.0, 7.5), strict=True)]
        assert sum(a * n for a, n in zip(away, face["normal"], strict=True)) > 0.0


def test_conventional_cutting_runs_the_other_way_on_the_other_side(blade: Path) -> None:
    assert run(blade, "--faces", "1", "--direction", "conventional", "--placement", "machine")[0] == 0
    text = blade.with_suffix(".ngc").read_text()
    assert "G52 X1. Y2. Z14." in text
    assert "G42\n" in text


def test_a_cone_written_by_hand_becomes_a_g51_that_the_controller_checks(tmp_path: Path) -> None:
    file = tmp_path / "cone.step"
    file.write_text(step_text.cone_face((3, 4, -5), 5.0, 9.0, 12.0, 2.0))
    assert run(file, "--faces", "all", "--move", "0,0,5")[0] == 0
    program = file.with_suffix(".ngc")
    assert f"Z0. I3. J4. K0. H12. R9. D-{math.degrees(2.0):.6f}"[:-3] in program.read_text()
    words = ["check", str(program), "--store", str(tmp_path / "store"), "--json"]
    result = CliRunner().invoke(app, words)
    found = json.loads(result.stdout)
    assert found["ok"], found
    assert found["cuts_mm"] == pytest.approx([10.0])


def test_a_turned_part_is_cut_where_it_was_turned_to(blade: Path) -> None:
    assert run(blade, "--faces", "1", "--turn", "Z90", "--move", "1,2,3")[0] == 0
    assert "G52 X-5. Y33. Z19." in blade.with_suffix(".ngc").read_text()


REFUSED = [
    # options, what the sentence says, why
    (["--list", "--faces", "1"], "either --list", "both"),
    ([], "either --list", "neither"),
    (["--faces", "2"], "'2' is no face of the file, which has 1 to 1", "a number that is not there"),
    (["--faces", "one"], "'one' is no face", "no number"),
    (["--faces", "1", "--feed", "0"], "--feed 0: it must be greater than 0", "no feed"),
    (["--faces", "1", "--turn", "Q9"], "write axis and degrees", "no axis"),
    (["--faces", "1", "--move", "1,2"], "three numbers", "too few"),
    (["--faces", "1", "--tool", "9"], "the tool table has T1, T2, T3, T4", "unknown tool"),
    (["--faces", "1", "--out", "nowhere/at/all.ngc"], "there is no folder", "no such folder"),
]


@pytest.mark.parametrize(("options", "sentence", "why"), REFUSED, ids=[row[2] for row in REFUSED])
def test_what_cannot_be_done_is_refused_and_nothing_is_written(
    blade: Path, options: list[str], sentence: str, why: str
) -> None:
    code, told = run(blade, *options)
    assert code == 1, why
    assert sentence in told["error"]
    assert list(blade.parent.iterdir()) == [blade]


def test_a_program_that_is_there_is_left_alone(blade: Path) -> None:
    program = blade.with_suffix(".ngc")
    program.write_text("(mine)")
    code, told = run(blade, "--faces", "1")
    assert (code, program.read_text()) == (1, "(mine)")
    assert "--overwrite" in told["error"]
    assert run(blade, "--faces", "1", "--overwrite")[0] == 0
    assert "G52" in program.read_text()


@pytest.mark.parametrize("content", [b"", b"no STEP at all", step_text.HEAD.encode(), b"\xff\x00" * 50])
def test_a_file_that_is_no_step_is_refused_in_one_sentence(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "bad.step"
    file.write_bytes(content)
    code, told = run(file, "--list")
    assert code == 1
    assert str(file) in told["error"]
    assert "export the part" in told["error"]


def test_without_opencascade_the_extra_is_named(blade: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith(("OCP", "controller.cad"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "OCP", None)
    code, told = run(blade, "--list")
    assert code == 1
    assert "pip install 'directrix[cad]'" in told["error"]


def test_a_tool_that_fits_is_chosen_or_its_size_is_told(tmp_path: Path) -> None:
    file = tmp_path / "tall.step"
    file.write_text(step_text.ruled_face(LOW, [(x, y, 40.0) for x, y, _ in LOW]))
    code, told = run(file, "--faces", "1")
    assert code == 1
    assert "a flute of at least 40.000 mm" in told["error"]
    assert run(file, "--faces", "1", "--tool", "1")[0] == 0
