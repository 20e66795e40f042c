"""Polylines as C2 cubics: in tolerance everywhere, smooth across windows, exact ends, sparse if smooth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.geometry.arrays import Array
from controller.plan.lines.spline_fit import BASE_MM, Polyline, Row, Spans, Tolerance

ALLOWED = Tolerance(0.01, math.radians(0.05), None)


def polyline(xyz: Array, rotaries: Array | None = None) -> Polyline:
    """Corners with s the length of X Y Z."""
    turned = np.zeros((len(xyz), 2)) if rotaries is None else rotaries
    step = np.sqrt((np.diff(xyz, axis=0) ** 2).sum(axis=1))
    return Polyline(np.concatenate(([0.0], np.cumsum(step))), np.hstack([xyz, turned]), np.ones(len(xyz)))


def fitted(line: Polyline, allowed: Tolerance = ALLOWED, window: int = 2000) -> list[Spans]:
    """The row grown ``window`` corners at a time."""
    row, found = Row(allowed, line.between(0, 0)), []
    last = len(line.s) - 1
    for first in range(0, last, window):
        end = min(first + window, last)
        row.extend(line.between(first, end))
        while (spans := row.take(end == last)) is not None:
            found.append(spans)
    return found


def joined(parts: list[Spans]) -> tuple[Array, Array]:
    knots = np.concatenate([*(part.knots[:-1] for part in parts), parts[-1].knots[-1:]])
    return knots, np.concatenate([part.c for part in parts])


def at(parts: list[Spans], s: Array) -> Array:
    knots, c = joined(parts)
    i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(c) - 1)
    h = (s - knots[i])[:, None]
    return np.asarray(c[i, :, 0] + h * (c[i, :, 1] + h * (c[i, :, 2] + h * c[i, :, 3])))


def deviation(line: Polyline, parts: list[Spans]) -> tuple[float, float]:
    """Largest distance of the tip (mm) and change of a rotary (rad) over dense samples."""
    knots, _ = joined(parts)
    s = np.unique(np.concatenate((np.linspace(0.0, line.s[-1], 60_001), line.s, knots)))
    programmed = np.stack([np.interp(s, line.s, column) for column in line.values.T], axis=1)
    off = at(parts, s) - programmed
    return float(np.sqrt((off[:, :3] ** 2).sum(axis=1)).max()), float(np.abs(off[:, 3:]).max())


def jumps(parts: list[Spans]) -> tuple[float, float, float]:
    """Largest jump of value, rate and curvature between spans that run through."""
    knots, c = joined(parts)
    h = np.diff(knots)[:, None]
    ends = (
        c[..., 0] + h * (c[..., 1] + h * (c[..., 2] + h * c[..., 3])),
        c[..., 1] + h * (2.0 * c[..., 2] + 3.0 * h * c[..., 3]),
        2.0 * c[..., 2] + 6.0 * h * c[..., 3],
    )
    starts = (c[..., 0], c[..., 1], 2.0 * c[..., 2])
    rests = np.cumsum([len(part.c) for part in parts])[[part.rests for part in parts]]
    inner = np.setdiff1d(np.arange(1, len(c)), rests)
    a, b, d = (
        float(np.abs(e[inner - 1] - t[inner]).max(initial=0.0)) for e, t in zip(ends, starts, strict=True)
    )
    return a, b, d


def circle(count: int, decimals: int | None = None) -> tuple[Array, Array]:
    """A helix of 0.1 mm lines round 30 mm with turning rotaries, rounded as CAM systems do."""
    a = np.arange(count) * 0.1 / 30.0
    xyz = np.stack([30.0 * np.cos(a), 30.0 * np.sin(a), 0.5 * a], axis=1)
    turned = np.stack([0.3 * np.sin(a), a], axis=1)
    if decimals is not None:
        xyz, turned = np.round(xyz, decimals), np.radians(np.round(np.degrees(turned), decimals))
    return xyz, turned


def zigzag(rows: int) -> Array:
    return np.array([[30.0 * (i % 4 in (1, 2)), 0.5 * (i // 2), 0.0] for i in range(2 * rows)])


RANDOM = np.cumsum(np.random.default_rng(5).normal(size=(120, 3)), axis=0)
LONG_THEN_TINY = np.array([[0.0, 0.0, 0.0], *([500.0 + 0.01 * k, 1e-5 * k * k, 0.0] for k in range(300))])
SMALL_STEPS = np.array([[0.002 * k, 0.002 * (k % 2), 0.0] for k in range(400)])

SHAPES = [
    ("a corner", np.array([[0.0, 0, 0], [50, 0, 0], [50, 50, 0]])),
    ("a slight corner", np.array([[0.0, 0, 0], [50, 0, 0], [100, 1, 0]])),
    ("rows to and fro", zigzag(6)),
    ("a circle of short lines", circle(3000)[0]),
    ("a circle of rounded lines", circle(3000, 3)[0]),
    ("a long line and tiny ones", LONG_THEN_TINY),
    ("steps far below the tolerance", SMALL_STEPS),
    ("a random walk", RANDOM),
    ("a line back on itself", np.array([[0.0, 0, 0], [10, 0, 0], [3, 0.01, 0], [3, 5, 0]])),
    ("one line", np.array([[0.0, 0, 0], [1.0, 2.0, 3.0]])),
    ("a line far shorter than the tolerance", np.array([[0.0, 0, 0], [1e-4, 0, 0], [2e-4, 1e-4, 0]])),
]


@pytest.mark.parametrize(("name", "xyz"), SHAPES, ids=[name for name, _ in SHAPES])
@pytest.mark.parametrize("tip_mm", [0.05, 0.01, 0.001])
def test_the_spline_stays_within_the_tolerance_and_is_smooth(name: str, xyz: Array, tip_mm: float) -> None:
    line = polyline(xyz)
    parts = fitted(line, Tolerance(tip_mm, math.radians(0.05), None))
    off, _ = deviation(line, parts)
    assert off <= tip_mm
    value, rate, curvature = jumps(parts)
    assert value < 1e-11 and rate < 1e-9 and curvature < 1e-6
    assert np.allclose(at(parts, line.s[[0, -1]]), line.values[[0, -1]], rtol=0.0, atol=1e-11)


def test_rotaries_are_followed_within_their_own_tolerance() -> None:
    xyz = np.stack([np.linspace(0.0, 100.0, 11), np.zeros(11), np.zeros(11)], axis=1)
    turned = np.radians(np.array([[5.0 * (k % 2), 30.0 * abs(k - 5)] for k in range(11)]))
    line = polyline(xyz, turned)
    for degrees in (1.0, 0.05, 0.002):
        _, off = deviation(line, fitted(line, Tolerance(0.01, math.radians(degrees), None)))
        assert off <= math.radians(degrees)


def test_near_the_pole_the_works_rotary_counts_by_what_it_turns_the_axis() -> None:
    xyz = np.stack([np.linspace(0.0, 100.0, 11), np.zeros(11), np.zeros(11)], axis=1)
    turned = np.stack([np.zeros(11), np.radians(20.0 * (np.arange(11) % 2))], axis=1)
    line = polyline(xyz, turned)
    near_pole = Polyline(line.s, line.values, np.full(11, 1e-3))
    counts = [
        sum(len(part.c) for part in fitted(seen, Tolerance(0.01, math.radians(0.05), 1)))
        for seen in (line, near_pole)
    ]
    assert counts[1] < counts[0]


def test_windows_make_no_difference_that_matters() -> None:
    line = polyline(*circle(6000, 3))
    whole, parts = fitted(line, window=6000), fitted(line, window=700)
    assert len(parts) > 3
    s = np.linspace(0.0, line.s[-1], 5001)
    assert np.abs(at(whole, s) - at(parts, s)).max() < 1e-3
    assert max(deviation(line, parts)) <= 0.01
    assert jumps(parts)[2] < 1e-9


def test_rounding_of_the_program_does_not_become_jerk() -> None:
    third = [
        6.0 * np.abs(joined(fitted(polyline(*circle(5000, decimals))))[1][..., 3]).max(axis=0)
        for decimals in (None, 3)
    ]
    assert third[1][0] < 2.0 * third[0][0]
    assert third[1][0] * 50.0**3 < 500.0  # mm/s^3 at 3000 mm/min; 1 um in 0.1 mm lines would give 1e8


def test_smooth_lines_have_long_spans_and_corners_short_ones() -> None:
    knots, _ = joined(fitted(polyline(*circle(5000, 3))))
    assert np.diff(knots).min() > 0.4 * BASE_MM
    knots, _ = joined(fitted(polyline(SHAPES[0][1])))
    size = np.diff(knots)
    assert size.min() < 0.2 and size.max() == BASE_MM
    assert (np.maximum(size[1:], size[:-1]) / np.minimum(size[1:], size[:-1])).max() < 2.02


def test_a_line_back_on_itself_and_a_corner_without_blend_are_stops() -> None:
    assert [part.rests for part in fitted(polyline(SHAPES[8][1]))] == [True, True]
    parts = fitted(polyline(SHAPES[0][1]), Tolerance(1e-4, math.radians(0.05), None))
    assert [part.rests for part in parts] == [True, True]
    assert parts[0].knots[-1] == pytest.approx(50.0)
