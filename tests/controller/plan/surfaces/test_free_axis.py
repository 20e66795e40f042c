"""The free axis: the same whatever knots a surface is written with, and smooth over its parts."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import linprog
from support.machines.planned_laws import chains, laws_of
from support.machines.stepped_runs import shipped
from support.oracles import ruled_surfaces
from support.oracles.drawn_tools import border
from support.parts.paper_surfaces import example_2
from support.parts.random_surfaces import compound
from support.parts.twisted_blades import blade, normal_turns_deg, off_by_brute_force

from controller.geometry.curves import Bezier
from controller.geometry.placement import Placed, Strategy
from controller.geometry.splines import BSpline, splined
from controller.geometry.surfaces import RuledSurface
from controller.machine.model import Machine, Tool
from controller.machine.tool_profile import flank
from controller.memory import forget
from controller.plan.surfaces import cuts, free_axis, placements, placing
from controller.plan.surfaces.axis_curves import Basis, joined
from controller.plan.surfaces.banded_rows import Rows, least_largest
from controller.plan.surfaces.placing import Cutter, Row, place
from controller.program import blocks
from controller.program.program import CutRuled

PLAIN = Cutter(3.0, 0.0, 0.0)
SAME_MM, SAME_SHARE = 1e-3, 0.03  # of the deviation of one surface, however it is written


def written(surface: RuledSurface, count: int) -> RuledSurface:
    """A cubic surface with so many control points a rail: it stays the same."""
    share = np.linspace(0.0, 1.0, 400)
    at, rails = share[np.unique(np.linspace(0, 399, count).astype(int))], []
    for curve in (surface.upper, surface.lower):
        rail = make_interp_spline(at, ruled_surfaces.casteljau(np.array(curve.points), at), 3)
        rails.append(BSpline.of(4, rail.t.tolist(), [tuple(map(float, p)) for p in np.round(rail.c, 9)]))
    return RuledSurface(*rails)


def in_parts(surface: RuledSurface, places: list[float]) -> tuple[RuledSurface, ...]:
    """The same surface cut into parts."""
    ends = [0.0, *places, 1.0]
    rails = [BSpline((0.0, 1.0), (curve.points,)) for curve in (surface.upper, surface.lower)]
    return tuple(RuledSurface(*(rail.between(a, b) for rail in rails)) for a, b in pairwise(ends))


def off_mm(surface: RuledSurface, placed: Placed, radius: float) -> float:
    return float(np.abs(off_by_brute_force(surface, placed, radius)).max())


def blade_of(seed: int) -> RuledSurface:
    pair = compound(seed, 1)[0]
    return RuledSurface(*(Bezier(tuple(tuple(map(float, p)) for p in points)) for points in pair))


@pytest.mark.parametrize(
    ("seed", "counts"), [(21, (4, 14, 60)), pytest.param(None, (4, 9, 14, 26, 60), marks=pytest.mark.slow)]
)
def test_one_surface_is_cut_alike_however_many_points_it_is_written_with(
    seed: int | None, counts: tuple[int, ...]
) -> None:
    seed = random.Random().randrange(10**6) if seed is None else seed
    surface = blade_of(seed)
    found = [off_mm(surface, place(written(surface, n), PLAIN, Strategy.OPTIMAL), 3.0) for n in counts]
    print(f"seed {seed}: {[round(1e3 * off, 2) for off in found]} um")
    assert max(found) - min(found) <= max(SAME_MM, SAME_SHARE * max(found)), (seed, found)


@pytest.mark.parametrize("member", [1, pytest.param(0, marks=pytest.mark.slow)])
def test_a_surface_in_parts_is_placed_as_one_and_the_pose_runs_through_with_two_derivatives(
    member: int,
) -> None:
    whole = example_2()[member]
    places = [0.3, 0.75]
    parts = in_parts(whole, places)
    placed = Row(parts, parts, PLAIN).placed(Strategy.OPTIMAL)
    best = off_mm(whole, place(whole, PLAIN, Strategy.OPTIMAL), 3.0)
    off = _off_of_parts(whole, placed)
    print(f"{1e3 * best:.2f} um, in parts {1e3 * off:.2f}")
    assert off <= max(best + SAME_MM, 1.1 * best)
    widths = np.diff([0.0, *places, 1.0])
    for before, after, a, b in zip(placed, placed[1:], widths, widths[1:], strict=False):
        for one, other in zip(before.through, after.through, strict=True):
            assert one.at(1.0) == pytest.approx(other.at(0.0), abs=1e-9)
            assert np.array(one.derivative(1.0)) / a == pytest.approx(
                np.array(other.derivative(0.0)) / b, rel=1e-6
            )
            bends = (np.array(c.derivative(u, 2)) / w**2 for c, u, w in ((one, 1.0, a), (other, 0.0, b)))
            assert next(bends) == pytest.approx(next(bends), rel=1e-5, abs=1e-4)


def _off_of_parts(surface: RuledSurface, placed: tuple[Placed, ...]) -> float:
    """Of all poses of all parts."""
    u, v = (
        a.ravel() for a in np.meshgrid(np.linspace(0.0, 1.0, 97), np.linspace(0.0, 1.0, 25), indexing="ij")
    )
    points = np.array(surface.point(u, v, np))
    at, least = np.linspace(0.0, 1.0, 1001), np.full(len(u), np.inf)
    for one in placed:
        tips, axes = (np.array([np.broadcast_to(c, at.shape) for c in w]) for w in one.pose(at, 3.0, np))
        for rows in np.array_split(np.arange(len(u)), 40):
            away = points[:, rows, None] - tips[:, None, :]
            height = (away * axes[:, None, :]).sum(axis=0)
            gap = np.sqrt(np.maximum((away * away).sum(axis=0) - height**2, 0.0)).min(axis=1) - 3.0
            least[rows] = np.minimum(least[rows], gap)
    return float(np.abs(least).max())


def prolonged(surface: RuledSurface, mm: float) -> tuple[RuledSurface, ...]:
    """With straight pieces at both ends, as an import prolongs rulings: the edges' bends jump there."""
    ends = []
    for u, way in ((0.0, -mm), (1.0, mm)):
        per_mm, rails = way / float(np.linalg.norm(surface.lower.derivative(u))), []
        for curve in (surface.upper, surface.lower):
            at, rate = np.array(curve.at(u)), np.array(curve.derivative(u)) * per_mm
            points = [tuple(map(float, at + share * rate)) for share in (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)]
            rails.append(Bezier(tuple(points[:: 1 if u else -1])))
        ends.append(RuledSurface(*rails))
    return (ends[0], surface, ends[1])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4, 6])
def test_edges_whose_bends_jump_near_their_ends_are_cut_as_well_as_without_these_ends(seed: int) -> None:
    """What the edges bend is no fault of the axis: blades of a wheel came to 69 um instead of 8."""
    surface = blade_of(seed)
    parts = prolonged(surface, 0.7)
    assert [len(row) for row in joined(parts)] == [3]
    alone = off_mm(surface, place(surface, PLAIN, Strategy.OPTIMAL), 3.0)
    off = _off_of_parts(surface, Row(parts, parts, PLAIN).placed(Strategy.OPTIMAL))
    print(f"{1e3 * alone:.2f} um, prolonged {1e3 * off:.2f}")
    assert off <= max(alone + SAME_MM, 1.1 * alone)


def program_of(blocks: Sequence[RuledSurface], words: str = "G42 P3") -> str:
    """Each surface as one G52 block."""
    rows = ["G21 G90 T50 M6", "S9000 M3", words]
    for k, one in enumerate(blocks):
        points = [p for rail in (one.upper, one.lower) for p in splined(rail).spans[0]]
        text = [" ".join(f"{a}{c:.6f}" for a, c in zip("XYZ", p, strict=True)) for p in points]
        rows += [f"G52 {text[0]}" + ("" if k else " F1500."), *text[1:]]
    return "\n".join([*rows, "M5", "M30", ""])


def mill_of(radius: float) -> Machine:
    """The shipped trunnion with a cutter of that radius as T50."""
    made = shipped()
    return replace(made, tools=(*made.tools, Tool(50, "end mill", radius, 60.0, 70.0)))


def cuts_of(source: str) -> tuple[list[Placed], float]:
    """The surfaces that are cut, all in one chain, and how long that takes."""
    made = mill_of(3.0)
    (chain,) = (c for c in chains(source, made) if any(s.cutting for s in c.segments))
    laws = zip(chain.segments, laws_of(chain.segments, made), strict=True)
    seconds = sum(law.duration_s for segment, law in laws if "lead" not in segment.name)
    return [s.motion.surface for s in chain.segments if s.cutting], seconds


@pytest.mark.parametrize(
    ("seed", "places"),
    [(21, [0.5]), *(pytest.param(seed, [0.3, 0.7], marks=pytest.mark.slow) for seed in (3, 4, 6))],
)
def test_a_surface_in_several_blocks_is_cut_as_in_one(seed: int, places: list[float]) -> None:
    """Placed block by block it was up to 4.6 times as far off, with a pivot at each joint."""
    whole = blade_of(seed)
    (one, seconds), (several, longer) = (cuts_of(program_of(in_parts(whole, at))) for at in ([], places))
    assert len(one) == 1 and len(several) == 1 + len(places)
    best, off = _off_of_parts(whole, tuple(one)), _off_of_parts(whole, tuple(several))
    print(f"seed {seed}: {1e3 * best:.2f} um in {seconds:.3f} s, in blocks {1e3 * off:.2f} in {longer:.3f}")
    assert abs(off - best) <= max(SAME_MM, SAME_SHARE * best)
    assert longer <= 1.01 * seconds


def test_a_wall_that_its_rulings_cut_exactly_stays_so_beside_a_twisted_one() -> None:
    legs = {0.0: (0.0, 8.0, 16.0, 24.0), 12.0: (0.0, 8.0, 16.0, 24.0)}
    sways = {0.0: (0.0, 0.0, 0.0, 2.0), 12.0: (0.0, 0.0, 3.0, 9.0)}
    flat = (Bezier(tuple((x - 24.0, 0.0, z) for x in legs[z])) for z in (12.0, 0.0))
    twisted = (Bezier(tuple((x, y, z) for x, y in zip(legs[z], sways[z], strict=True))) for z in (12.0, 0.0))
    walls = RuledSurface(*flat), RuledSurface(*twisted)
    assert len(joined(walls)) == 1
    first, second = cuts_of(program_of(walls))[0]
    assert not isinstance(first, Placed) or first.through is None
    assert isinstance(second, Placed) and second.through is not None


def test_what_was_searched_ahead_for_blocks_is_what_their_path_asks_for(monkeypatch) -> None:
    source = program_of(in_parts(blade_of(21), [0.5]))
    made = mill_of(3.0)
    read = [b for b in blocks.read(source.encode(), made, "p").blocks if isinstance(b, CutRuled)]
    (group,) = cuts.placed_together(read, made)
    for wanted in cuts.required_placements(group, made):
        placements.learn(placing.searched(wanted))
    forget()
    monkeypatch.setattr(free_axis, "best", lambda *_: pytest.fail("searched again"))
    assert all(one.through is not None for one in cuts_of(source)[0])


def test_where_the_contact_stands_still_or_a_crease_is_an_axis_is_not_led_on() -> None:
    first, second = in_parts(example_2()[0], [0.5])
    still = RuledSurface(second.upper, Bezier((second.lower.points[0],) * 2 + second.lower.points[2:]))
    points = [(x, y + 2.0 * k, z) for k, (x, y, z) in enumerate(second.lower.points)]
    creased = RuledSurface(second.upper, Bezier(tuple(points)))
    assert len(joined([first, second, first])[0]) == 2
    assert [len(row) for row in joined([first, still])] == [1, 1]
    assert [len(row) for row in joined([first, creased])] == [1, 1]


@pytest.mark.slow
def test_a_surface_whose_normal_turns_by_122_degrees_keeps_its_tolerance() -> None:
    upper = ((-5.632, 0.964, 2.548), (-6.588, -1.032, 2.624), (-5.08, 1.58, 2.15), (-4.904, -0.624, 2.132))
    lower = ((-5.35, 1.71, -0.058), (-5.978, -0.258, 0.014), (-5.852, 0.79, 0.096), (-5.396, -1.224, 0.078))
    size = 5.0  # a surface like one of a program of old, a little larger
    surface = RuledSurface(
        *(Bezier(tuple(tuple(size * c for c in p) for p in points)) for points in (upper, lower))
    )
    assert normal_turns_deg(surface).max() > 110.0
    placed = place(surface, Cutter(1.5, 0.0, 0.0), Strategy.OPTIMAL)
    off = off_by_brute_force(surface, placed, 1.5)
    print(f"{1e3 * off.min():.1f} to {1e3 * off.max():.1f} um")
    assert np.abs(off).max() < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_tool_is_on_its_side_of_every_point(seed: int) -> None:
    surface, radius = blade(seed)
    placed = place(surface, Cutter(radius, 0.0, 0.0), Strategy.OPTIMAL)
    for u in np.linspace(0.01, 0.99, 33):
        pose = placed.pose(float(u), radius)
        for v in (0.1, 0.5, 0.9):
            away = np.array(pose.tip) - np.array(surface.point(float(u), v))
            away -= (away @ np.array(pose.axis)) * np.array(pose.axis)
            rate = (1.0 - v) * np.array(surface.upper.derivative(u)) + v * np.array(
                surface.lower.derivative(u)
            )
            out = np.cross(rate, np.array(surface.ruling(u)))
            assert math.copysign(1.0, radius) * (out @ away) > 0.0


def test_the_basis_sums_up_to_one_and_gives_a_polynomial_back() -> None:
    basis = Basis.over(in_parts(example_2()[0], [0.4]), 7)
    t = np.linspace(0.0, 1.0, 101)
    values, _ = basis.values(t)
    assert values.sum(axis=1) == pytest.approx(np.ones(101), abs=1e-9)
    slopes, first = basis.values(np.clip(t, 1e-6, 1.0 - 1e-6), 1)
    points = np.random.default_rng(2).normal(size=(basis.size, 3))
    curve, at = basis.curve(points), first[:, None] + np.arange(basis.width)
    for i in (3, 40, 77):
        assert curve.at(float(t[i])) == pytest.approx(basis.at(t[i : i + 1], points)[0], abs=1e-12)
        assert curve.derivative(float(t[i])) == pytest.approx(slopes[i] @ points[at[i]], abs=1e-8)


@pytest.mark.parametrize("count", [52, 120, 124])
def test_the_least_largest_residual_is_that_of_a_linear_program(count: int) -> None:
    dice, rows, width = np.random.default_rng(count), 300, 24
    first = 4 * dice.integers(0, (count - width) // 4 + 1, rows)
    values, y = dice.normal(size=(rows, width)), dice.normal(size=rows) + 1.0
    both = dice.uniform(size=rows) < 0.8
    whole = np.zeros((rows, count))
    for i, at in enumerate(first):
        whole[i, at : at + width] = values[i]
    banded = Rows.of(values, first, count)
    price = banded.squares(np.zeros(rows)).scaled(0.0, 1e-7)
    x = least_largest(banded, y, both, price, np.zeros(count))
    rest = y + whole @ x
    found = max(float(np.abs(rest[both]).max()), -float(rest.min()))
    limits = np.vstack(
        [np.hstack([whole[both], -np.ones((both.sum(), 1))]), np.hstack([-whole, -np.ones((rows, 1))])]
    )
    wanted = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=limits,
        b_ub=np.concatenate([-y[both], y]),
        bounds=[(None, None)] * count + [(0.0, None)],
    ).fun
    assert wanted <= found + 1e-9 and found <= 1.005 * wanted + 1e-4


def barrel_off_mm(surface: RuledSurface, placed: Placed, tool: Tool) -> float:
    """Of a barrel, by many poses; its arc is the circle through three points of the drawn outline."""
    drawn = border(tool)
    rise = drawn[:, 1] / tool.flute_mm
    a, b, c = (complex(*drawn[int(np.argmax(rise >= share))]) for share in (0.3, 0.6, 0.9))
    w = (c - a) / (b - a)
    centre = (b - a) * (w - abs(w) ** 2) / (2j * w.imag) + a
    far = abs(a - centre)
    assert far == pytest.approx(tool.barrel_mm, rel=1e-3)
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(0.0, 1.0, 49), np.linspace(0.0, 1.0, 13)))
    points, at = np.array(surface.point(u, v, np)), np.linspace(0.0, 1.0, 2001)
    tips, axes = (np.array(w) for w in placed.pose(at, placed.offset_mm, np))
    away = points[:, :, None] - tips[:, None, :]
    h = (away * axes[:, None, :]).sum(axis=0)
    rho = np.sqrt(np.maximum((away * away).sum(axis=0) - h * h, 0.0))
    return float(np.abs((np.hypot(rho - centre.real, h - centre.imag) - far).min(axis=1)).max())


@pytest.mark.parametrize(
    "taper", [0.0, pytest.param(0.15, marks=pytest.mark.slow)], ids=["barrel", "conical barrel"]
)
def test_the_axis_of_a_barrel_is_found_for_its_own_form(taper: float) -> None:
    """It stands better than one that is found for the cone which the barrel touches in its middle."""
    surface = example_2()[1]
    tool = Tool(1, "", 3.0, 0.0, 30.0, corner_mm=1.0, taper_rad=taper, barrel_mm=500.0)
    middle = flank(tool).barrel.middle_mm
    cutter = Cutter.of(tool, 1.0, shift_mm=middle - 9.0)
    own, straight, plain = (
        barrel_off_mm(surface, place(surface, one, kind), tool)
        for one, kind in (
            (cutter, Strategy.OPTIMAL),
            (replace(cutter, barrel=None), Strategy.OPTIMAL),
            (cutter, Strategy.SINGLE),
        )
    )
    print(f"{1e3 * own:.1f} um; as a cone {1e3 * straight:.1f}, along the ruling {1e3 * plain:.1f}")
    assert own < 0.9 * min(straight, plain)


@pytest.mark.slow
@pytest.mark.parametrize("waves", [3, 6])
def test_a_long_wall_that_winds_has_spans_enough(waves: int) -> None:
    at, rails = np.linspace(0.0, 1.0, 60), []
    for lag, height in ((0.6, 25.0), (0.0, 0.0)):
        sway = 6.0 * np.sin(2.0 * math.pi * waves * at + lag)
        rail = make_interp_spline(at, np.stack([220.0 * at, sway, 0.0 * at + height], axis=1), 3)
        rails.append(BSpline.of(4, rail.t.tolist(), [tuple(map(float, p)) for p in rail.c]))
    surface, cutter = RuledSurface(*rails), Cutter(2.0, 0.0, 0.0)
    double, best = (
        off_mm(surface, place(surface, cutter, s), 2.0) for s in (Strategy.DOUBLE, Strategy.OPTIMAL)
    )
    print(f"{1e3 * double:.1f} um, {1e3 * best:.1f}")
    assert best < 0.3 * double
