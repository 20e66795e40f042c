"""The search beside the planner's: it finds what is known, and never less than nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.parts.paper_surfaces import example_1, example_2
from support.parts.twisted_blades import blade, off_by_brute_force

from controller.geometry.placement import Placed, Strategy
from controller.geometry.splines import BSpline
from controller.geometry.vectors import Frame
from controller.machine.model import Tool
from controller.plan.surfaces.placing import Cutter, place
from controller.verify import bound as searched
from controller.verify.bound import bound
from controller.verify.nominal import Nominal

KNOTS = (0.0,) * 4 + (1.0,) * 4


def nominal(surface, radius) -> Nominal:
    return Nominal(surface, Frame(), math.copysign(1.0, radius), Tool(1, "", abs(radius), 0.0, 50.0), 4)


def by_brute_force(surface, placed, radius) -> float:
    """Largest deviation (mm) without the ends."""
    return float(np.abs(off_by_brute_force(surface, placed, radius)[2:-2]).max())


@pytest.fixture
def few(monkeypatch):
    """Fewer windows, for tests that need no close look."""
    monkeypatch.setattr(searched, "CENTRES", 3)
    monkeypatch.setattr(searched, "HALVES", (0.08,))


@pytest.mark.parametrize("taper", [0.0, pytest.param(0.1, marks=pytest.mark.slow)])
def test_an_axis_that_is_off_where_none_need_be_is_seen(few, taper) -> None:
    """On a cone a cylinder, or a taper, can be right everywhere; here it stands 20 um too far off."""
    off = BSpline.of(4, KNOTS, [(0.02, 0.02, 0.0)] * 4)
    cone = replace(example_1(), sweep_rad=1.0)
    placed = Placed(cone, 3.0, taper_rad=taper, corrections=off)
    found = bound(nominal(placed, 3.0))
    assert found.off_mm == pytest.approx(0.02 * math.cos(taper), rel=0.02)
    assert found.best_mm < 1e-3 and found.ratio > 10.0 and found.why


def test_a_surface_whose_axis_is_along_its_rulings_has_none() -> None:
    assert bound(nominal(example_1(), 3.0)) is None


def test_what_was_found_is_stated_as_brute_force_sees_it_and_double_is_told_to_be_freer(few) -> None:
    surface, shares = example_2()[1], []
    placed = place(surface, Cutter(3.0, 0.0, 0.0), Strategy.DOUBLE)
    found = bound(nominal(placed, 3.0), shares.append)
    assert found.off_mm == pytest.approx(by_brute_force(surface, placed, 3.0), rel=0.05)
    assert found.ratio > 1.2 and "double keeps" in found.sentence and "P3" in found.sentence
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert found.to_dict()["ratio"] == pytest.approx(found.ratio, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2, 5])
def test_blades_are_placed_as_well_as_the_other_search_can(seed) -> None:
    surface, radius = blade(seed)
    placed = place(surface, Cutter(radius, 0.0, 0.0), Strategy.OPTIMAL)
    found = bound(nominal(placed, radius))
    print(found.sentence)
    assert found.off_mm == pytest.approx(by_brute_force(surface, placed, radius), rel=0.05)
    assert 1.0 / 1.02 <= found.ratio < 1.2
