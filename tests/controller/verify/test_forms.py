"""The verdict on a surface: against sums that share nothing with it, and in both languages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.oracles.swept_cylinder import by_brute_force, deepest, nominal, places, single
from support.parts.paper_surfaces import example_2
from support.parts.random_surfaces import compound

from controller.geometry import arc_length
from controller.geometry.curves import Bezier, Line
from controller.geometry.surfaces import RuledSurface, Surface
from controller.machine.model import Tool
from controller.messages import text
from controller.plan.report.verdict import Verdict
from controller.verify import wording
from controller.verify.envelope import ASIDE_MM
from controller.verify.gouges import gouges
from controller.verify.judge import judge
from controller.verify.nominal import Nominal, peaks
from controller.verify.sweep import Pass

CLOSE_MM = 1e-3

WALL = RuledSurface(Line((0.0, 0.0, 10.0), (30.0, 0.0, 10.0)), Line((0.0, 0.0, 0.0), (30.0, 0.0, 0.0)))


def asked(
    surface: Surface, side: float = 1.0, tolerance_mm: float = 0.02, allowance_mm: float = 0.0
) -> Nominal:
    one = nominal(surface, side)
    return Nominal(surface, one.part, side, one.tool, one.line, 0, allowance_mm, tolerance_mm)


def along(one: Nominal, off_mm: float = 0.0) -> Pass:
    """The paper's way over length, so much further off the surface."""
    own = single(one)
    normals = one.normals(own.s, np.ones(len(own.s)))
    s = np.asarray(arc_length.s_at(arc_length.of(one.surface.lower), own.s))
    return replace(own, s=s, tips=own.tips + off_mm * normals)


def judged(one: Nominal, *passes: Pass) -> Verdict:
    (verdict,) = gouges([one], {one.tool: list(passes)}).verdicts
    return verdict


UNSEEN = [
    RuledSurface(Bezier(tuple(map(tuple, upper))), Bezier(tuple(map(tuple, lower))))  # type: ignore[arg-type]
    for seed in (61, 62, 63)
    for upper, lower in compound(seed)[:1]
]


@pytest.mark.parametrize("surface", [*UNSEEN, example_2()[1]])
def test_the_overcut_of_a_verdict_is_that_of_many_cylinders(surface: Surface) -> None:
    """Where a line along the normal leaves the part over an edge, no more than twice the depth is told."""
    one = asked(surface)
    made = judged(one, along(one))
    _, _, points, _ = places(one, 161, 9, (0.0, 1.0))
    depth = deepest(one, points)
    assert depth - CLOSE_MM <= made.overcut_mm <= 2.0 * depth + CLOSE_MM
    _, v, points, normals = places(one, 41, 9, (0.1, 0.9))
    lines = by_brute_force(one, points, normals, 4001)[(v > 0.1) & (v < 0.9)]
    assert made.overcut_mm >= -np.nanmin(lines) - CLOSE_MM
    assert made.within == (made.largest_mm <= 0.02)


@pytest.mark.parametrize("off_mm", [-0.05, 0.0, 0.07])
def test_what_is_cut_too_deep_or_left_standing_is_told_with_its_amount(off_mm: float) -> None:
    one = asked(WALL, tolerance_mm=0.06)
    made = judged(one, along(one, off_mm))
    assert made.overcut_mm == pytest.approx(max(0.0, -off_mm), abs=1e-5)
    assert made.undercut_mm == pytest.approx(max(0.0, off_mm), abs=1e-5)
    assert made.within == (abs(off_mm) <= 0.06)
    assert made.exceeds_mm == pytest.approx(max(0.0, abs(off_mm) - 0.06), abs=1e-5)


def test_what_is_to_stay_is_no_deviation_and_a_finishing_cut_counts_for_the_roughing_one() -> None:
    rough = asked(WALL, allowance_mm=0.3)
    assert judged(rough, along(rough, 0.3)).within
    assert judged(asked(WALL), along(rough, 0.3)).undercut_mm == pytest.approx(0.3, abs=1e-5)
    assert judged(asked(WALL), along(rough, 0.3), replace(along(rough), line=7, motion=1)).within


@pytest.mark.parametrize(("radius_mm", "flute_mm"), [(0.5, 9.0), (1.5, 6.0), (5.0, 2.0)])
def test_what_stands_above_the_flute_is_as_high_in_verdict_and_zone(
    radius_mm: float, flute_mm: float
) -> None:
    """Whatever the radius: nothing decides there but how far the point is from what cuts."""
    one = replace(asked(WALL), tool=Tool(1, "short", radius_mm, 0.0, flute_mm))
    way = along(one)
    made, (found,) = judged(one, way), judge([one], {one.tool: [way]})
    assert made.undercut_mm == pytest.approx(10.0 - flute_mm, abs=1.01 * ASIDE_MM)
    for zone in (found.inside, found.ends, found.whole):
        assert zone.undercut is not None
        assert zone.undercut.mm == pytest.approx(made.undercut_mm, abs=1e-4)


def test_a_crease_between_points_of_a_grid_is_looked_for_at_a_lower_one_beside_it() -> None:
    x = np.linspace(0.0, 1.0, 21)
    broad, crease = 0.9 * np.exp(-(((x - 0.2) / 0.2) ** 2)), np.maximum(0.0, 1.0 - 10.0 * np.abs(x - 0.725))
    size = np.stack([np.maximum(broad, crease), 0.0 * x], axis=1)
    assert size[:, 0].argmax() == 4
    found = peaks(size.ravel(), 2, 5) // 2
    assert 4 in found and {14, 15} & set(found.tolist())
    assert peaks(np.full(6, -np.inf), 2, 5).size == 0


def test_a_motion_beside_the_cut_is_in_the_verdict_with_its_name_and_line() -> None:
    one = asked(WALL)
    deeper = replace(along(one, -0.1), line=9, name="line", motion=4)
    made = judged(one, along(one), deeper)
    assert not made.within and (made.by, made.by_line) == ("line", 9)
    assert made.overcut_mm == pytest.approx(0.1, abs=1e-5)


def test_a_surface_without_a_tolerance_gets_no_verdict() -> None:
    one = nominal(WALL)
    assert gouges([one], {one.tool: [along(one)]}).verdicts == []
    assert wording.to_json([]) is None and wording.summed([]) is None


def test_the_height_of_the_place_counts_from_the_lower_edge_along_the_ruling() -> None:
    one = asked(example_2()[1])
    made = judged(one, along(one))
    upper, lower = (one.points(np.array([made.u]), np.array([v]))[0] for v in (0.0, 1.0))
    assert made.height_mm == pytest.approx((1.0 - made.v) * np.linalg.norm(upper - lower))


FAR = Verdict(19, 2, 0.05, 0.4831, 0.0, 1.0, 0.0, 10.0, (38.0, 22.0, 10.0), "lead out", 19, ("double",), 0.0)
NEAR = replace(FAR, line=10, overcut_mm=0.03, undercut_mm=0.04)


@pytest.mark.parametrize(
    ("language", "words"), [("en", "exceeds its form tolerance"), ("de", "überschreitet")]
)
def test_what_exceeds_is_said_with_amount_place_and_what_helps(language: str, words: str) -> None:
    sentence = text(wording.summed([NEAR, FAR]), language)
    for part in (words, "0.4331 mm", "0.4831 mm", "u = 1.0000", "10.000 mm", "(P2)", "19"):
        assert part in sentence, part
    assert sentence.endswith(".")


def test_all_within_names_the_surface_that_comes_nearest() -> None:
    told = wording.to_json([NEAR, replace(NEAR, line=3, tolerance_mm=0.2)])
    assert told is not None and told["within"] and told["largest_mm"] == 0.04
    assert all(words in text(told) for words in ("line 10", "40.0 µm", "50 µm"))
    assert "Zeile 10" in text(told, "de")
