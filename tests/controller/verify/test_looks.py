"""What is a gouge beside a cut, and what is the twist of that cut itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.oracles.swept_cylinder import nominal, single
from support.parts.paper_surfaces import example_2
from support.parts.random_surfaces import compound

from controller.geometry import arc_length
from controller.geometry.curves import Bezier
from controller.geometry.placement import Placed
from controller.geometry.surfaces import RuledSurface
from controller.machine.tool_profile import cutter
from controller.verify import looks
from controller.verify.envelope import nearest
from controller.verify.gouges import Findings, gouges
from controller.verify.nominal import Nominal
from controller.verify.sweep import Pass, Sweep


def found(one: Nominal, *passes: Pass, most_mm: float | None = None) -> Findings:
    return gouges([one], {one.tool: [along(one), *passes]}, most_mm)


def along(one: Nominal) -> Pass:
    """The paper's way over length, as motions have it."""
    own = single(one)
    return replace(own, s=np.asarray(arc_length.s_at(arc_length.of(one.surface.lower), own.s)))


def beside(one: Nominal, u: tuple[float, float], deeper_mm: float) -> Pass:
    """A line of another block: straight between two poses of the cut, so much further into the part."""
    own = single(one)
    ends = [int(np.argmin(np.abs(own.s - at))) for at in u]
    normals = one.normals(np.array(u), np.ones(2))
    tips = own.tips[ends] - deeper_mm * normals
    share = np.linspace(0.0, 1.0, 9)[:, None]
    between = (1.0 - share) * tips[0] + share * tips[1]
    return Pass(share[:, 0], between, np.repeat(own.axes[ends[:1]], 9, axis=0), 7, "line")


def onward(one: Nominal, deeper_mm: float = 0.0) -> Pass:
    """The run-on of a cut: straight on from its last pose."""
    own = single(one)
    a, b = one.points(np.array([1.0 - 1e-3, 1.0]), np.ones(2))
    way = (b - a) / np.linalg.norm(b - a)
    s = np.linspace(0.0, 4.0, 9)
    tips = own.tips[-1] + s[:, None] * way - deeper_mm * one.normals(np.ones(1), np.ones(1))
    return Pass(s, tips, np.repeat(own.axes[-1:], 9, axis=0), one.line, "lead out")


def test_a_line_is_held_against_what_the_cut_takes_at_that_place_not_anywhere() -> None:
    """The cut itself costs 0.31 mm near its end, and next to nothing here."""
    one = nominal(example_2()[1])
    assert found(one).gouges == []
    (gouge,) = found(one, beside(one, (0.3, 0.31), 0.1)).gouges
    assert gouge.kind == "other motion" and gouge.by == "line" and gouge.by_line == 7
    assert gouge.depth_mm == pytest.approx(0.1, abs=0.02) and gouge.u == pytest.approx(0.305, abs=0.05)
    assert found(one, beside(one, (0.3, 0.301), 0.0)).gouges == []


def placed(seed: int) -> Nominal:
    """An unseen surface with the axis through two points: little overcut inside, more over its ends."""
    upper, lower = compound(seed, 1)[0]
    surface = RuledSurface(
        *(Bezier(tuple(tuple(map(float, p)) for p in points)) for points in (upper, lower))
    )
    side = -1.0 if seed % 2 else 1.0
    pair = (0.2, 0.8)
    return nominal(Placed(surface, side * 3.0, points_v=pair, normals_v=pair), side)


# Surfaces whose last ruling the flank reaches over by more than the cut takes anywhere.
@pytest.mark.parametrize("seed", [1, 2, 7])
def test_what_twist_costs_beside_the_end_of_a_placed_cut_is_told_and_no_gouge(seed: int) -> None:
    one = placed(seed)
    alone = found(one)
    told = found(one, onward(one))
    assert alone.ends == [] and told.gouges == []
    (end,) = told.ends
    assert end.by == "lead out" and end.u == pytest.approx(1.0, abs=0.02)
    assert end.depth_mm > alone.overcuts[0].mm + 1e-3
    assert "beside" in end.sentence and "lead out of line 1" in end.sentence
    (bounded,) = found(one, onward(one), most_mm=end.depth_mm - 1e-3).gouges
    assert bounded.kind == "overcut" and "max_overcut_mm" in bounded.sentence
    assert found(one, onward(one), most_mm=end.depth_mm + 1e-3).gouges == []


@pytest.mark.parametrize("seed", [1, 2, 7])
def test_a_lead_that_goes_deeper_than_twist_can_is_a_gouge_whatever_the_placement_promised(seed: int) -> None:
    one = placed(seed)
    told = found(one, onward(one, 0.1))
    (gouge,) = told.gouges
    assert gouge.kind == "other motion" and gouge.depth_mm > 0.1 - 1e-2
    assert told.ends == []


def test_a_run_on_that_leaves_the_surface_alone_is_not_told() -> None:
    one = placed(1)
    away = onward(one, -1.0)
    assert found(one, away) == found(one)


def test_the_overcut_of_every_surface_is_told_with_its_place() -> None:
    (overcut,) = found(nominal(example_2()[0])).overcuts
    assert overcut.line == 1 and overcut.mm == pytest.approx(0.183, abs=2e-3) and overcut.v == 0.0


def test_points_close_to_others_are_those_that_any_of_them_is_within_reach_of() -> None:
    rng = np.random.default_rng(7)
    points, others = rng.uniform(-5.0, 5.0, (300, 3)), rng.uniform(-4.0, 9.0, (200, 3))
    away = np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1)
    for within in (0.1, 1.0, 3.0):
        assert (looks._close(points, others, within) == (away <= within)).all()
    assert not looks._close(points, others[:0], 1.0).any()


def test_what_is_asked_for_below_a_bound_is_exact_there_and_infinite_elsewhere() -> None:
    one = placed(3)
    own, rng = along(one), np.random.default_rng(7)
    by = looks.ToolSweep(Sweep([own], 40.0), cutter(one.tool), 1, "cut", one.tool)
    points = own.tips[rng.integers(len(own.tips), size=400)] + rng.normal(0.0, 6.0, (400, 3))
    exact, below = nearest(points, by.sweep, by.body).distance, rng.normal(0.0, 5.0, 400)
    found = by.distance(points, below)
    assert (found[exact < below] == exact[exact < below]).all() and (exact < below).sum() > 50
    assert np.isin(found, [*exact, np.inf]).all() and np.isinf(found).sum() > 50
