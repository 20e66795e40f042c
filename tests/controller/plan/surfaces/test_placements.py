"""Placements that a check has found are used again as they were, and nothing else is."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from support.machines.stepped_runs import shipped
from support.oracles.placed_cuts import small
from support.parts.paper_surfaces import example_2

from controller.geometry.placement import Placed, Strategy
from controller.geometry.splines import BSpline
from controller.plan.surfaces import placements, placing
from controller.plan.surfaces.placements import Recipe
from controller.plan.surfaces.placing import Cutter, place
from controller.runtime import checked

CUTTER = Cutter(1.5, 0.0, 0.0)


def corrected() -> Placed:
    rng = np.random.default_rng(3)
    knots = (0.0,) * 4 + (0.3, 0.7) + (1.0,) * 4
    curve = BSpline.of(4, knots, [tuple(map(float, row)) for row in rng.uniform(-0.01, 0.01, (6, 3))])
    return Placed(example_2()[1], -2.0, (0.1, 0.9), (0.1, 0.9), 0.07, 0.4, curve)


@pytest.fixture(autouse=True)
def nothing_known(monkeypatch):
    monkeypatch.setattr(placements, "_known", {})
    placing._better.cache_clear()
    yield
    placing._better.cache_clear()


def over_the_ends() -> Placed:
    """With the lower point sliding, too."""
    curve = corrected().corrections
    run = BSpline.of(4, (0.0,) * 4 + (0.3, 0.7) + (1.0,) * 4, [(0.1 * k * k, 0.0, 0.0) for k in range(6)])
    assert curve.breaks == run.breaks
    return replace(corrected(), run=run)


@pytest.mark.parametrize("placed", [corrected(), replace(corrected(), corrections=None), over_the_ends()])
def test_a_recipe_gives_the_same_poses_to_the_last_bit_after_a_way_through_a_file(placed):
    kept = Recipe.from_dict(json.loads(json.dumps(Recipe.of(placed).to_dict())))
    again = kept.on(placed.base, "name")
    assert again == placed
    for u in (0.0, 0.31, 0.7, 1.0):
        assert again.pose(u, -2.0) == placed.pose(u, -2.0)


@pytest.mark.parametrize(
    "damage",
    [
        {"points_v": [0.1]},
        {"offset_mm": "wide"},
        {"spans": []},
        {"breaks": None},
        {"spans": [[[0.0, 0.0]]] * 3},
        {"run": [[[0.0, 0.0, 0.0]]] * 3},
        {"run": None},
    ],
)
def test_a_damaged_recipe_is_never_believed(damage):
    with pytest.raises((ValueError, TypeError, KeyError)):
        Recipe.from_dict({**Recipe.of(corrected()).to_dict(), **damage})


def test_a_name_belongs_to_one_surface_one_cutter_and_one_strategy():
    first, second = example_2()
    asked = [
        (first, CUTTER, Strategy.DOUBLE),
        (second, CUTTER, Strategy.DOUBLE),
        (first, replace(CUTTER, offset_mm=1.5000001), Strategy.DOUBLE),
        (first, CUTTER, Strategy.OPTIMAL),
    ]
    assert len({placements.name_of(*one) for one in asked}) == len(asked)
    assert placements.name_of(*asked[0]) == placements.name_of(example_2()[0], CUTTER, Strategy.DOUBLE)


def test_what_is_known_is_not_searched_again(monkeypatch):
    surface = example_2()[0]
    found = place(surface, CUTTER, Strategy.DOUBLE)
    assert isinstance(found, Placed) and found.name
    placing._better.cache_clear()
    placements.learn({found.name: Recipe.of(found)})
    monkeypatch.setattr(placing, "_found", lambda *_: pytest.fail("searched again"))
    again = place(surface, CUTTER, Strategy.DOUBLE)
    assert again == found and again.pose(0.4, 1.5) == found.pose(0.4, 1.5)


def test_the_first_that_were_learnt_are_forgotten_and_no_program_loses_one_of_its_own(monkeypatch):
    recipe = Recipe.of(corrected())
    monkeypatch.setattr(placements, "_known", {})
    monkeypatch.setattr(placements, "MOST", 3)
    for name in "abacd":
        placements.learn({name: replace(recipe, taper_rad=float(ord(name)))})
    assert [placements.known(name) is not None for name in "abcd"] == [True, False, True, True]
    assert placements.known("c") == replace(recipe, taper_rad=float(ord("c")))
    placements.learn(dict.fromkeys("efghi", recipe))
    assert all(placements.known(name) == recipe for name in "efghi") and placements.known("d") is None


@pytest.mark.parametrize("strategy", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_check_keeps_what_was_found_and_a_start_takes_it_from_there(tmp_path, monkeypatch, strategy):
    task = checked.task(small(strategy, "800.").encode(), "small.ngc", shipped())
    _, kept, warning = checked.check(task, tmp_path)
    assert not warning and len(kept.placements) == 1
    placing._better.cache_clear()
    placements._known.clear()
    found, warning = checked.find(task, tmp_path)
    assert found == kept and not warning
    monkeypatch.setattr(placing, "_found", lambda *_: pytest.fail("searched again"))
    cuts = [one for one in checked.stretches(checked.walk_of(task, found, False)).values() if one.cutting]
    (name,) = kept.placements
    assert [one.motion.surface.name for one in cuts] == [name]
