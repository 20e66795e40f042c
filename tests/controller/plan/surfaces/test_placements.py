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
from controller.geometry.splines import BSpline, simplest
from controller.plan.surfaces import free_axis, placements, placing
from controller.plan.surfaces.placements import Recipe
from controller.plan.surfaces.placing import Cutter, place
from controller.runtime import checked

CUTTER = Cutter(1.5, 0.0, 0.0)


def free(knots: tuple[float, ...] = (0.3, 0.7)) -> Placed:
    """On an axis through two curves of its own."""
    rng, size = np.random.default_rng(3), 6 + len(knots)
    rails = (
        BSpline.of(
            6, (0.0,) * 6 + knots + (1.0,) * 6, [tuple(map(float, row)) for row in rng.normal(size=(size, 3))]
        )
        for _ in range(2)
    )
    upper, lower = map(simplest, rails)
    return Placed(example_2()[1], -2.0, taper_rad=0.07, shift_mm=0.4, through=(upper, lower))


def hung() -> Placed:
    return replace(free(), points_v=(0.1, 0.9), normals_v=(0.1, 0.9), through=None)


def forget() -> None:
    placing._double.cache_clear()
    placing._optimal.cache_clear()


@pytest.fixture(autouse=True)
def nothing_known(monkeypatch):
    monkeypatch.setattr(placements, "_known", {})
    forget()
    yield
    forget()


def no_search(monkeypatch) -> None:
    """From here on a search would be an error."""
    for room, name in ((placing, "_doubles"), (free_axis, "best")):
        monkeypatch.setattr(room, name, lambda *_: pytest.fail("searched again"))


@pytest.mark.parametrize("placed", [free(), free(()), hung()])
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
        {"upper": []},
        {"breaks": None},
        {"upper": [[[0.0, 0.0]]] * 3},
        {"lower": [[[0.0, 0.0, 0.0]]] * 3},
        {"lower": None},
    ],
)
def test_a_damaged_recipe_is_never_believed(damage):
    with pytest.raises((ValueError, TypeError, KeyError)):
        Recipe.from_dict({**Recipe.of(free()).to_dict(), **damage})


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
    forget()
    placements.learn({found.name: Recipe.of(found)})
    no_search(monkeypatch)
    again = place(surface, CUTTER, Strategy.DOUBLE)
    assert again == found and again.pose(0.4, 1.5) == found.pose(0.4, 1.5)


def test_the_first_that_were_learnt_are_forgotten_and_no_program_loses_one_of_its_own(monkeypatch):
    recipe = Recipe.of(free())
    monkeypatch.setattr(placements, "_known", {})
    monkeypatch.setattr(placements, "MAX_PLACEMENTS", 3)
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
    forget()
    placements._known.clear()
    found, warning = checked.find(task, tmp_path)
    assert found == kept and not warning
    no_search(monkeypatch)
    cuts = [one for one in checked.segments(checked.walk_of(task, found, False)).values() if one.cutting]
    (name,) = kept.placements
    assert [one.motion.surface.name for one in cuts] == [name]
