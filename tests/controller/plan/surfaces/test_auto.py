"""The placement ``auto`` is never worse than what it chooses from, as the check judges both."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from support.machines.stepped_runs import shipped
from support.machines.traced_programs import named, sentences, trace
from support.oracles import ruled_surfaces
from support.parts.random_surfaces import Pair, compound

from controller.geometry.placement import Placed
from controller.geometry.splines import BSpline
from controller.plan.surfaces import free_axis, placements, placing
from controller.runtime import checked

MACHINE = shipped()
TINY_MM = 1e-9


def program(pair: Pair, count: int, words: str, tool: int = 1) -> str:
    """One cubic surface as G6.2 with so many points a rail: it stays the same."""
    share = np.linspace(0.0, 1.0, 400)
    at = share[np.unique(np.linspace(0, 399, count).astype(int))]
    lines = ["G21 G90 G54 G61", f"T{tool} M6", "S8000 M3", words, "G6.2 P4 Q4 F600."]
    for points in pair:
        rail = make_interp_spline(at, ruled_surfaces.casteljau(points, at), 3)
        for knot, (x, y, z) in zip(rail.t, rail.c, strict=False):
            lines.append(f"K{knot:.12f} X{x:.9f} Y{y:.9f} Z{z:.9f}")
        lines += [f"K{knot:.12f}" for knot in rail.t[count:]]
    return "\n".join([*lines, "G40", "M5", "M30", ""])


def off_mm(text: str) -> float:
    """How far off the worst surface is, as the check says."""
    _, kept = checked.looked_at(checked.task(text.encode(), "part.ngc", MACHINE))
    return max(one.largest_mm for one in kept.verdicts)


def assert_never_worse(seed: int, count: int) -> None:
    rng = random.Random(seed)
    pair, side, tool = compound(seed, 1)[0], rng.choice(("G41", "G42")), rng.choice((1, 2))
    found = [off_mm(program(pair, count, f"{side} P{p} R0.5", tool)) for p in (1, 2, 3, 4)]
    print(f"seed {seed}, {count} points: {[round(1e3 * off, 3) for off in found]} um")
    assert found[3] <= min(found[:3]) + TINY_MM, (seed, count, found)


@pytest.mark.parametrize(("seed", "count"), [(1, 4), pytest.param(7, 6, marks=pytest.mark.slow)])
def test_auto_is_never_worse_than_what_it_chooses_from(seed: int, count: int) -> None:
    assert_never_worse(seed, count)


@pytest.mark.slow
def test_so_it_is_where_a_lead_cuts_deeper_than_the_best_cut() -> None:
    """Of 14 points a rail, ``optimal`` is the best but for its lead out, and ``double`` is taken."""
    assert_never_worse(5, 14)


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 6, 9, 14])
def test_so_it_is_on_random_surfaces(count: int) -> None:
    assert_never_worse(random.Random().randrange(10**6), count)


def forget() -> None:
    placing._double.cache_clear()
    placing._optimal.cache_clear()


def off_the_end(singles: Sequence[Placed], starts: Sequence[Sequence[Placed]]) -> free_axis.Found:
    """What ``optimal`` might come to: an axis as good as the paper's, and 50 um too deep at its end."""
    (single,) = singles
    u = np.linspace(0.0, 1.0, 33)
    pose = single.pose(u, single.offset_mm, np)
    tips, axes = (np.stack([np.broadcast_to(c, u.shape) for c in vector], axis=1) for vector in pose)
    out = np.stack([np.broadcast_to(c, u.shape) for c in single.normal(u, np)], axis=1)
    tips = tips - np.copysign(0.05, single.offset_mm) * (u > 0.99)[:, None] * out
    rails = [make_interp_spline(u, tips + height * axes, 5) for height in (40.0, 0.0)]
    through = tuple(BSpline.of(6, rail.t.tolist(), [tuple(map(float, p)) for p in rail.c]) for rail in rails)
    # Said to be as good as any.
    return free_axis.Found((replace(single, through=(through[0], through[1])),), 0.0, 0.0)


def test_what_is_better_in_the_middle_alone_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(placements, "_known", {})
    monkeypatch.setattr(free_axis, "best", off_the_end)
    forget()
    try:
        double, optimal, auto = (off_mm(program(compound(1, 1)[0], 4, f"G41 P{p} R0.5")) for p in (2, 3, 4))
    finally:
        forget()
    assert optimal > double + 0.02 and auto <= double + TINY_MM


def test_its_choice_is_found_again_without_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    text = program(compound(1, 1)[0], 4, "G41 P4 R0.02")
    (found,) = named(trace(text, MACHINE), "cut")
    _, kept = checked.looked_at(checked.task(text.encode(), "part.ngc", MACHINE))
    assert list(kept.placements) == [found.motion.surface.name]
    monkeypatch.setattr(placements, "_known", {})
    placements.learn(kept.placements)
    forget()
    monkeypatch.setattr(free_axis, "best", None)  # a search would be an error
    monkeypatch.setattr(placing, "_doubles", None)
    (again,) = named(trace(text, MACHINE), "cut")
    assert again.motion.surface == found.motion.surface


def test_optimal_that_finds_nothing_better_says_so_and_is_not_advised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(placements, "_known", {})
    monkeypatch.setattr(free_axis, "best", lambda singles, starts: None)
    forget()
    told = {}
    try:
        for p in (2, 3, 4):
            text = program(compound(3, 1)[0], 4, f"G41 P{p} R0.001")
            _, kept = checked.looked_at(checked.task(text.encode(), "part.ngc", MACHINE))
            (verdict,) = kept.verdicts
            assert not verdict.within
            told[p] = verdict.remedies, sentences(trace(text, MACHINE))
    finally:
        forget()
    assert "optimal" in told[2][0] and not {"double", "optimal"} & {*told[3][0], *told[4][0]}
    nothing_better = re.compile(r"P3 \(optimal\) finds nothing better here than P2 \(double\)")
    assert [bool(nothing_better.search(told[p][1])) for p in (2, 3, 4)] == [False, True, False]


def test_one_that_finds_something_better_does_not() -> None:
    text = program(compound(1, 1)[0], 4, "G41 P3 R0.02")
    assert "finds nothing better" not in sentences(trace(text, replace(MACHINE, gouge="warn")))
