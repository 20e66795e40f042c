"""Which placement is found for a surface, held against a plain search over many cutter positions."""

import itertools
import math
import random

import numpy as np
import pytest
from support.oracles.swept_cylinder import nominal, single
from support.parts.paper_surfaces import example_1, example_2
from support.parts.random_surfaces import compound
from support.suite.seed import SEED

from controller.geometry.curves import Bezier
from controller.geometry.placement import Placed, Strategy
from controller.geometry.surfaces import RuledSurface
from controller.machine.model import Tool
from controller.plan.surfaces import deviation, placing
from controller.plan.surfaces.placing import Cutter, Row, place
from controller.verify.judge import judge

DENSE = 4001
SEARCHED = placing.CHOSEN_FROM


def deviations(surface, cutter, u, v):
    """What is left (mm) on a grid of points, from every one of many positions: no series, no Newton.

    A place of the wall may be cut from far away along the path: where a tool turns, its end is elsewhere.
    """
    at = np.linspace(0.0, 1.0, DENSE)
    tip, axis = (
        np.array([np.broadcast_to(c, at.shape) for c in vector])
        for vector in surface.pose(at, cutter.offset_mm, np)
    )
    rows = []
    for x in u:
        points = np.array([np.broadcast_to(c, v.shape) for c in surface.point(np.full(v.shape, x), v, np)])
        away = points[:, :, None] - tip[:, None, :]
        height = (away * axis[:, None, :]).sum(axis=0)
        across = np.sqrt(np.maximum((away * away).sum(axis=0) - height * height, 0.0))
        radius = abs(cutter.offset_mm) + (height - cutter.shift_mm) * math.tan(cutter.taper_rad)
        rows.append(((across - radius) * math.cos(cutter.taper_rad)).min(axis=1))
    return np.array(rows)


def largest(surface, cutter, along=65):
    grid = deviations(surface, cutter, np.linspace(0.02, 0.98, along), np.linspace(0.0, 1.0, 15))
    return float(np.abs(grid).max()) * 1e3  # um


def plain(radius):
    return Cutter(radius, 0.0, 0.0)


@pytest.mark.parametrize(
    ("member", "radius", "paper", "double"),
    [(0, 3.0, 183, 8), (1, 3.0, 312, 60), (0, -3.0, 29, 8), (1, -3.0, 311, 70)],
)
def test_double_cuts_example_2_to_the_figures_of_the_issue(member, radius, paper, double):
    surface, cutter = example_2()[member], plain(radius)
    assert paper - 3 < largest(place(surface, cutter, Strategy.SINGLE), cutter) < paper
    assert largest(place(surface, cutter, Strategy.DOUBLE), cutter) < double


# A plain least-squares trial reached 1.4, 8.5, 0.8 and 17 um, by a judge that missed places beside a pivot.
BEYOND_TRIAL = pytest.mark.xfail(
    strict=True,
    reason="8.67 um by today's judge, with four times the spans, too; 8.62 where bends cost next to nothing",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("member", "radius", "strategy", "most"),
    [
        (0, 3.0, Strategy.DOUBLE, 8.0),
        (1, 3.0, Strategy.DOUBLE, 60.0),
        (0, -3.0, Strategy.DOUBLE, 8.0),
        (1, -3.0, Strategy.DOUBLE, 70.0),
        (0, 3.0, Strategy.OPTIMAL, 1.4),
        pytest.param(1, 3.0, Strategy.OPTIMAL, 8.5, marks=BEYOND_TRIAL),
        (0, -3.0, Strategy.OPTIMAL, 0.8),
        (1, -3.0, Strategy.OPTIMAL, 17.0),
    ],
)
def test_the_verifier_finds_the_figures_of_the_issue_with_the_end_of_the_cutter(
    member, radius, strategy, most
):
    surface, cutter = example_2()[member], plain(radius)
    one = nominal(place(surface, cutter, strategy), math.copysign(1.0, radius))
    found = judge([one], {one.tool: [single(one)]})[0].inside
    print(f"{strategy.name} {radius}: {found.overcut} {found.undercut}")
    assert found.uncut == 0.0
    assert found.largest_mm * 1e3 < most


@pytest.mark.parametrize(
    ("cutter", "member"),
    [
        (Cutter(3.0, 0.0, 0.0), 0),
        (Cutter(-3.0, 0.0, 0.0), 1),
        (Cutter(-2.0, 0.06, 1.0, 1.0), 0),  # a tapered bull nose
    ],
)
def test_the_flank_and_not_the_corner_cuts_the_lower_edge(cutter, member):
    placed = place(example_2()[member], cutter, Strategy.DOUBLE)
    u = np.linspace(0.0, 1.0, 301)
    seen = deviation.of(placed, deviation.points(placed, u, np.ones(u.shape)))
    assert seen.height.min() > cutter.flank_mm + 0.5e-3
    assert cutter.shift_mm < placed.shift_mm < cutter.shift_mm + 0.05
    # Nothing else has changed: the axis stays where it was, but for the taper's larger radius.
    slid = placed.shift_mm - cutter.shift_mm
    assert abs(placed.offset_mm) == pytest.approx(abs(cutter.offset_mm) + slid * math.tan(cutter.taper_rad))


def test_a_cutter_that_reaches_below_anyway_goes_no_further_down():
    placed = place(example_2()[0], Cutter(3.0, 0.0, 0.5), Strategy.DOUBLE)
    assert placed.shift_mm == 0.5


def test_a_surface_without_twist_stays_with_the_papers_place():
    cone = example_1()
    for strategy in SEARCHED:
        assert place(cone, plain(3.0), strategy) is cone


def test_a_tool_with_a_corner_goes_so_far_down_that_the_flank_cuts_the_lower_edge():
    ball = Tool(1, "ball", 3.0, 0.0, 20.0, corner_mm=3.0)
    cutter = Cutter.of(ball, -1.0)
    assert (cutter.offset_mm, cutter.shift_mm) == (-3.0, 3.0)
    bull = Tool(1, "bull", 3.0, 0.0, 20.0, corner_mm=1.0, taper_rad=0.1)
    cutter = Cutter.of(bull, 1.0, allowance_mm=0.2, shift_mm=0.5)
    assert cutter.shift_mm == pytest.approx(1.0 - math.sin(0.1) + 0.5)
    # The flank leaves the corner's circle (about rho 2, h 1) where its normal leans down by the taper.
    where, height = 2.0 + math.cos(0.1), 1.0 - math.sin(0.1)
    flank = where + (cutter.shift_mm - height) * math.tan(0.1)
    assert cutter.offset_mm == pytest.approx(flank + 0.2 * math.cos(0.1))


def test_a_tapered_cutter_is_placed_on_a_cone_without_any_deviation():
    cutter = Cutter(2.0, 0.1, 0.0)
    assert largest(place(example_1(), cutter, Strategy.DOUBLE), cutter, 17) < 0.05


@pytest.mark.slow
def test_tapered_cutters_are_placed_as_well():
    surface = example_2()[0]
    for side in (1.0, -1.0):
        cutter = Cutter(side * 2.0, 0.06, 1.0)
        found = [largest(place(surface, cutter, strategy), cutter) for strategy in SEARCHED]
        assert found[2] <= found[1] < 0.3 * found[0] and found[2] < 3.0, found


def test_the_deviation_is_that_of_a_plain_search():
    rng = random.Random(11)
    surface = example_2()[1]
    for cutter in (plain(3.0), Cutter(-2.0, 0.05, 0.0)):
        placed = Placed(surface, cutter.offset_mm, (0.1, 0.8), (0.1, 0.8), taper_rad=cutter.taper_rad)
        u, v = np.array([rng.uniform(0.1, 0.9) for _ in range(12)]), np.linspace(0.0, 1.0, 7)
        grid = deviations(placed, cutter, u, v)
        points = deviation.points(placed, np.repeat(u, len(v)), np.tile(v, len(u)))
        assert deviation.of(placed, points).left == pytest.approx(grid.ravel(), abs=1e-4)


def surfaces(seeds):
    for seed in seeds:
        for upper, lower in compound(seed):
            yield seed, RuledSurface(*(Bezier(tuple(map(tuple, c.tolist()))) for c in (upper, lower)))


def assert_better_placements_are_never_worse(first_seed, count):
    """Of ``count`` random surfaces, by the plain search."""
    rng = random.Random(first_seed)
    seeds = range(first_seed, first_seed + count)
    for at, surface in itertools.islice(surfaces(seeds), count):
        cutter = plain(rng.choice((3.0, -3.0, 1.5)))
        paper, double, optimal = (largest(place(surface, cutter, s), cutter, 49) for s in SEARCHED)
        print(f"seed {at}, r {cutter.offset_mm}: {paper:.2f} {double:.2f} {optimal:.3f} um")
        assert optimal <= double + 0.05 and double <= paper + 0.05, (at, cutter, paper, double, optimal)


def test_an_upper_edge_that_stands_still_at_its_end_has_no_normal_there():
    """Hostile program 701529: the normal turns by 150 degrees, and no double is better than the paper's."""
    end = (-10.055, -8.08, 6.775)
    upper = Bezier(((0.535, 2.663, 7.2317), (-1.994, -2.04, 6.8657), end, end))
    lower = Bezier(
        ((-0.23, 0.2597, 0.0), (-0.23, 0.26, 0.0), (-0.2296, 0.2597, 0.0), (-11.608, -11.057, 0.0))
    )
    surface = RuledSurface(upper, lower)
    paper, double, optimal = (placing.off_mm(Row.of(surface, plain(1.5)), one) for one in SEARCHED)
    assert 0.0 < optimal <= double <= paper < 0.05


@pytest.mark.slow
def test_optimal_is_never_worse_than_double_and_double_never_worse_than_single():
    seed = random.Random(f"placings {SEED}").randrange(10**6)
    print(f"seeds from {seed}")
    assert_better_placements_are_never_worse(seed, 4)


@pytest.mark.slow
def test_so_it_is_where_the_end_of_the_tool_cuts_elsewhere_than_its_flank():
    assert_better_placements_are_never_worse(919677, 1)


@pytest.mark.soak
def test_so_it_is_on_thirty_random_surfaces():
    assert_better_placements_are_never_worse(7000, 30)
