"""Figures of a cut surface: zones, worst places, percentiles, and how well they have settled."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from support.oracles.swept_cylinder import nominal, single
from support.parts.paper_surfaces import example_1, example_2
from support.parts.random_surfaces import compound

from controller.geometry import arc_length
from controller.geometry.curves import Bezier
from controller.geometry.surfaces import RuledSurface
from controller.verify import judge as judging
from controller.verify import looks
from controller.verify.gouges import gouges
from controller.verify.judge import FIRST_GRID, SETTLED_MM, judge
from controller.verify.nominal import Nominal, grid
from controller.verify.passes import longest, step_mm
from controller.verify.sweep import Pass


def judged(one: Nominal, *more: Pass):
    return judge([one], {one.tool: [single(one), *more]})[0]


def test_a_cone_comes_out_without_deviation() -> None:
    found = judged(nominal(example_1()))
    for zone in (found.inside, found.ends, found.whole):
        assert zone.largest_mm < 1e-4 and zone.uncut == 0.0


def test_the_worst_place_of_the_second_example_is_found_and_has_settled() -> None:
    one = nominal(example_2()[1])
    found = judged(one).inside
    assert found.overcut is not None and found.settled_mm < SETTLED_MM
    assert found.overcut.mm == pytest.approx(-0.31264, abs=1e-4)
    assert (found.overcut.u, found.overcut.v) == (pytest.approx(0.932, abs=2e-3), 0.0)
    assert found.overcut.place == pytest.approx(one.surface.point(found.overcut.u, 0.0))
    assert found.percentiles_mm["50"] < found.percentiles_mm["90"] < found.percentiles_mm["99"] < 0.3126
    assert found.mean_mm < found.percentiles_mm["90"]


def test_a_pass_beside_the_cut_counts_in_the_whole_and_not_alone() -> None:
    """The same cylinder once more, half a millimetre deeper along the first half of the way."""
    one = nominal(example_1())
    whole = single(one)
    half = slice(0, len(whole.s) // 2)
    inward = np.array([0.0, 0.0, 0.0]) - whole.tips[half] * [1.0, 1.0, 0.0]
    inward *= 0.5 / np.linalg.norm(inward, axis=1)[:, None]
    deeper = Pass(whole.s[half], whole.tips[half] + inward, whole.axes[half], 2, "line")
    found = judged(one, deeper)
    assert found.inside.largest_mm < 1e-4
    assert found.whole.overcut is not None
    # The cone's normal climbs with its flank; the shift is level.
    level = math.cos(math.atan2(5.0, 10.0))
    assert found.whole.overcut.mm == pytest.approx(-0.5 * level, abs=1e-3)
    assert found.whole.overcut.u < 0.5


def test_figures_are_json_and_the_map_is_the_last_grid() -> None:
    found = judged(nominal(example_2()[0], -1.0))
    told = json.loads(json.dumps(found.to_dict()))
    assert told["side"] == "left" and told["inside"]["largest_mm"] > 0.02
    assert found.map.t.size == found.whole.points and found.map.points.shape == (*found.map.t.shape, 3)


def test_a_surface_that_is_half_cut_says_what_share_is_not() -> None:
    one = nominal(example_1())
    whole = single(one)
    third = slice(0, len(whole.s) // 3)
    found = judge(
        [one], {one.tool: [Pass(whole.s[third], whole.tips[third], whole.axes[third], 1, "cut", 0)]}
    )[0]
    assert 0.5 < found.inside.uncut < 0.67


def unseen(seed: int) -> Nominal:
    upper, lower = (Bezier(tuple(tuple(map(float, p)) for p in points)) for points in compound(seed, 1)[0])
    return nominal(RuledSurface(upper, lower), -1.0 if seed % 2 else 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [31, 32, 33])
def test_at_twice_the_resolution_an_unseen_surface_comes_out_the_same(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice as many points both ways, and twice as many poses."""
    one, found = unseen(seed), []
    for finer in (1, 2):
        along, across = FIRST_GRID
        monkeypatch.setattr(judging, "FIRST_GRID", (finer * (along - 1) + 1, finer * (across - 1) + 1))
        cutting = judging.Cutting({one.tool: [single(one, step_mm(one.tool) / finer)]}, [one])
        found.append(judging.Field(one, cutting).zone(*judging.INSIDE)[0])
    coarse, fine = found
    assert fine.points > 2 * coarse.points or fine.settled_mm < coarse.settled_mm
    assert fine.largest_mm == pytest.approx(coarse.largest_mm, abs=SETTLED_MM)
    assert fine.mean_mm == pytest.approx(coarse.mean_mm, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [31, 32, 33])
def test_at_twice_the_resolution_no_other_gouge_is_found(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of an unseen surface, and of one with a hollow: the second of Example 2 on its left."""
    told = []
    for finer in (1, 2):
        monkeypatch.setattr(looks, "SPACING_MM", 0.5 / finer)
        monkeypatch.setattr(looks, "ALONG", (9, 129 * finer))
        monkeypatch.setattr(looks, "ACROSS", (5, 33 * finer))
        both = [gouges([one], {one.tool: [along_it(one)]}) for one in (unseen(seed), hollow())]
        told.append(both)
    for coarse, fine in zip(*told, strict=True):
        assert [one.kind for one in fine.gouges] == [one.kind for one in coarse.gouges]
        for a, b in zip((*coarse.gouges, *coarse.overcuts), (*fine.gouges, *fine.overcuts), strict=True):
            depths = [getattr(one, "depth_mm", None) or one.mm for one in (a, b)]
            assert depths[0] == pytest.approx(depths[1], abs=1e-3)


def hollow() -> Nominal:
    return nominal(example_2()[1], -1.0)


def along_it(one: Nominal) -> Pass:
    """The paper's way, its places by length as motions have it."""
    own = single(one, 0.2)
    return replace(own, s=np.asarray(arc_length.s_at(arc_length.of(one.surface.lower), own.s)))


# ---- the nominal surface -------------------------------------------------------------


def test_normals_point_to_the_cutter_and_stand_on_the_surface() -> None:
    for surface, side in ((example_1(), 1.0), (example_2()[0], -1.0)):
        one = nominal(surface, side)
        u, v = grid(9, 5, (0.05, 0.95))
        n, step = one.normals(u, v), 1e-6
        assert np.linalg.norm(n, axis=1) == pytest.approx(np.ones(len(u)))
        along = (one.points(u + step, v) - one.points(u - step, v)) / step
        across = (one.points(u, np.clip(v + step, 0, 1)) - one.points(u, np.clip(v - step, 0, 1))) / step
        assert np.abs((n * along).sum(axis=1)).max() < 1e-4 * np.abs(along).max()
        assert np.abs((n * across).sum(axis=1)).max() < 1e-4 * np.abs(across).max()
        lower = v == 1.0
        tip = single(one).tips
        towards = np.array([tip[np.argmin(np.linalg.norm(tip - p, axis=1))] - p for p in one.points(u, v)])
        assert ((towards * n).sum(axis=1)[lower] > 0.99 * one.tool.radius_mm).all()


def test_the_hollow_of_a_cone_is_one_over_its_radius_across_the_ruling() -> None:
    """Meusnier: the section across the ruling of a cone with half angle a has radius rho / cos a."""
    one = nominal(example_1(), -1.0)  # from inside
    u, v = grid(5, 5)
    rho = 10.0 + 5.0 * v
    expected = math.cos(math.atan2(5.0, 10.0)) / rho
    assert one.hollow(u, v) == pytest.approx(expected, rel=1e-9)
    assert nominal(example_1()).hollow(u, v) == pytest.approx(-expected, rel=1e-9)


def test_lengths_on_the_surface_are_measured_at_their_height() -> None:
    one = nominal(example_1())
    u, v = np.zeros(3), np.array([0.0, 0.5, 1.0])
    turn = one.length_between(u, np.full(3, 0.5), v)
    assert turn == pytest.approx(math.pi * np.array([10.0, 12.5, 15.0]), rel=1e-4)
    assert longest([one]) > one.size[1] == pytest.approx(math.hypot(5.0, 10.0))
