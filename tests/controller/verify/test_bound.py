"""The search beside the planner's: it finds what is known, and never less than nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from support.parts.paper_surfaces import example_1, example_2
from support.parts.twisted_blades import blade, off_by_brute_force

from controller.geometry.placement import Placed, Strategy
from controller.geometry.splines import BSpline
from controller.geometry.vectors import Frame
from controller.machine.model import Tool
from controller.plan.surfaces.placing import Cutter, place
from controller.verify.bound import bound
from controller.verify.nominal import Nominal


def pushed_off(surface, taper, by):
    """The curves of an axis that stands further off along the normals than the right one."""
    u, right = np.linspace(0.0, 1.0, 33), Placed(surface, 3.0, taper_rad=taper)
    pose, normal = right.pose(u, 3.0, np), surface.normal(u, np)
    tips, axes, out = (np.stack([np.broadcast_to(c, u.shape) for c in v], axis=1) for v in (*pose, normal))
    rails = (make_interp_spline(u, tips + h * axes + by * out, 5) for h in (30.0, 0.0))
    return tuple(BSpline.of(6, rail.t.tolist(), [tuple(map(float, p)) for p in rail.c]) for rail in rails)


def nominal(surface, radius) -> Nominal:
    return Nominal(surface, Frame(), math.copysign(1.0, radius), Tool(1, "", abs(radius), 0.0, 50.0), 4)


def by_brute_force(surface, placed, radius) -> float:
    """Largest deviation (mm) without the ends."""
    return float(np.abs(off_by_brute_force(surface, placed, radius)[2:-2]).max())


@pytest.mark.parametrize("taper", [0.0, pytest.param(0.1, marks=pytest.mark.slow)])
def test_an_axis_that_is_off_where_none_need_be_is_seen(taper) -> None:
    """On a cone a cylinder, or a taper, can be right everywhere; here it stands 20 um too far off."""
    cone = replace(example_1(), sweep_rad=1.0)
    placed = Placed(cone, 3.0, taper_rad=taper, through=pushed_off(cone, taper, 0.02))
    found = bound(nominal(placed, 3.0))
    assert found.off_mm == pytest.approx(0.02 * math.cos(taper), rel=0.02)
    assert found.best_mm < 1e-3 and found.ratio > 10.0


def test_a_surface_whose_axis_is_along_its_rulings_has_none() -> None:
    assert bound(nominal(example_1(), 3.0)) is None


def test_what_was_found_is_stated_as_brute_force_sees_it_and_double_is_told_to_be_freer() -> None:
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
    assert 1.0 <= found.ratio < 1.2
