"""``directrix fit``: the largest cutter that keeps a tolerance, held against a sum of its own."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.machines.stepped_runs import T2
from support.oracles.swept_cylinder import deepest, nominal, places
from support.parts.paper_surfaces import example_2
from typer.testing import CliRunner

from controller.__main__ import app
from controller.geometry.placement import Strategy
from controller.machine import machine_file
from controller.machine.model import Tool
from controller.program import blocks
from controller.program.program import CutBlock
from controller.verify import fits

TOLERANCE_MM = 0.02


def twisted() -> fits.SurfaceToFit:
    """The first surface of Example 2, from its left."""
    machine = machine_file.load("trunnion")
    program = machine_file.shipped_program("example2_ready")
    read = blocks.stream(program.read_bytes(), machine, str(program))
    return fits.SurfaceToFit(next(one for one in read if isinstance(one, CutBlock)), machine)


def test_a_cutter_of_the_radius_that_is_told_keeps_the_tolerance_and_a_larger_one_does_not() -> None:
    """By many cylinders, in the paper's placement, the one that sum knows."""
    surface = example_2()[0]
    shape = Tool(0, "", 1.0, 0.0, 1.0)
    radius, found = fits.largest(twisted(), shape, Strategy.SINGLE, TOLERANCE_MM, 20.0)
    assert 0.0 < radius < 20.0 and found.off_mm <= TOLERANCE_MM
    depths = []
    for share in (1.0, 1.25):
        one = nominal(surface, -1.0, fits.scaled(shape, share * radius))
        _, _, points, _ = places(one, 161, 9, (0.0, 1.0))
        depths.append(deepest(one, points))
    assert depths[0] <= TOLERANCE_MM + 1e-3
    assert 2.0 * depths[1] > TOLERANCE_MM, "at an edge twice the depth counts"


def test_a_better_placement_never_takes_a_smaller_cutter() -> None:
    shape = Tool(0, "", 1.0, 0.0, 1.0)
    single, double = (
        fits.largest(twisted(), shape, strategy, TOLERANCE_MM, 20.0)[0]
        for strategy in (Strategy.SINGLE, Strategy.DOUBLE)
    )
    assert double > 1.5 * single


def test_what_is_not_twisted_takes_any_radius_up_to_its_hollow(tmp_path: Path) -> None:
    """A cylinder's inside of 9 mm, and its outside."""
    cone = "G51 X9. Y0. Z0. I0. J0. K0. H10. R9. D90. F100."
    for side, radius in (("G42", None), ("G41", 9.0)):
        (tmp_path / "p.ngc").write_text(T2.format(side=side, cuts=cone))
        result = CliRunner().invoke(app, ["fit", str(tmp_path / "p.ngc"), "--json"])
        (surface,) = json.loads(result.stdout)["surfaces"]
        (best, *_) = surface["fits"]
        assert best["radius_mm"] == pytest.approx(radius or fits.LARGEST_MM, rel=0.01)
        assert best["placement"] == "single" and best["tool"] == 1, "the largest of the shipped table"


@pytest.mark.parametrize(("language", "cutter"), [("en", "cylinder"), ("de", "Zylinder")])
def test_it_is_read_at_80_columns(language: str, cutter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    words = ["fit", str(machine_file.shipped_program("example1_ready")), "--language", language]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0 and cutter in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 80


@pytest.mark.parametrize(
    ("text", "words", "sentence"),
    [("G21 G90\nG0 X1.\nM30\n", (), "cuts no surface"), ("M2\n", ("--tolerance", "0"), "is not held")],
)
def test_what_cannot_be_fitted_is_said(
    text: str, words: tuple[str, ...], sentence: str, tmp_path: Path
) -> None:
    (tmp_path / "p.ngc").write_text(text)
    result = CliRunner().invoke(app, ["fit", str(tmp_path / "p.ngc"), *words, "--json"])
    assert result.exit_code == 1 and sentence in json.loads(result.stdout)["error"]
