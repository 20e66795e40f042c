"""Unseen surfaces between tool lines that meet them at any angle, nearly, on any machine."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass

import numpy as np
from support.oracles.ruled_surfaces import Ruled, casteljau
from support.parts.random_surfaces import compound

RADIUS_MM = 1.5
SHARPEST_RAD = 1.2


@dataclass(frozen=True, eq=False)
class Part:
    """A program and what it programs: the tips' way, (N, 3), part frame, and the tolerance."""

    source: str
    way: np.ndarray
    tolerance_mm: float


def part(seed: int) -> Part:
    """One or two lines, a surface or two, one or two lines; the corners lead away from the surface."""
    rng = random.Random(seed)
    tolerance, side = rng.choice((0.005, 0.01, 0.05)), rng.choice(("G41", "G42"))
    offset = RADIUS_MM if side == "G42" else -RADIUS_MM
    pairs = compound(40_000 + seed, 1)
    surfaces = [Ruled(*one) for one in pairs]
    start, first, onto = _end(surfaces[0], 0.0, offset)
    end, last, off = _end(surfaces[-1], 1.0, offset)
    into, away = (_corner(rng, *one) for one in (onto, off))
    axes = _tilted(rng, first), _tilted(rng, last)
    gap = rng.choice((0.0, 0.3 * tolerance)) * _unit(np.array([rng.uniform(-1.0, 1.0) for _ in range(3)]))
    before = [start - rng.uniform(3.0, 25.0) * into, start + gap]
    behind = [end, end + rng.uniform(3.0, 25.0) * away]
    if rng.random() < 0.5:
        before.insert(0, before[0] - 10.0 * into + np.array([rng.uniform(-4.0, 4.0), 0.0, 3.0]))
        behind.append(behind[-1] + np.array([5.0, 3.0, 4.0]))
    feed = f" F{10.0 ** rng.uniform(2.3, 3.7):.1f}"
    lines = [
        "G21 G90 G54",
        f"G64 P{tolerance} Q{rng.choice((0.05, 0.2, 1.0))}",
        "T2 M6",
        "S12000 M3",
        "G43.5",
    ]
    lines += ["G0 X0 Y0 Z50. I0 J0 K1.", f"G0 {_words(before[0] + 30.0 * axes[0], axes[0])}"]
    lines += [f"G0 {_words(before[0], axes[0])}"]
    lines += [f"G1 {_words(p, axes[0])}{feed}" for p in before[1:-1]] + [
        f"G1 {_words(before[-1], first)}{feed}"
    ]
    lines.append(f"{side} P1 R5.")
    for upper, lower in pairs:
        rows = [" ".join(f"{a}{c:.12f}" for a, c in zip("XYZ", p, strict=True)) for p in (*upper, *lower)]
        lines += [f"G52 {rows[0]}{feed}", *rows[1:]]
    lines += ["G40", *(f"G1 {_words(p, axes[1])}{feed}" for p in behind[1:])]
    u = np.linspace(0.0, 1.0, 6001)
    way = np.vstack([_dense(before), *(one.tip(u, offset) for one in surfaces), _dense(behind)])
    return Part("\n".join([*lines, "G49", "M5", "M30", ""]), way, tolerance)


def _end(surface: Ruled, u: float, offset: float) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """Tip and axis at an end of a surface, and the tip's direction with one square to it off the surface."""
    inner = np.array([u, abs(u - 1e-5)])
    tips, axis = surface.tip(inner, offset), surface.axis(inner)[0]
    ahead = _unit(tips[1] - tips[0]) * (1.0 if u == 0.0 else -1.0)
    square = np.cross(axis, ahead)
    out = tips[0] - casteljau(surface.lower, inner)[0]
    leads = -1.0 if u == 0.0 else 1.0
    return tips[0], axis, (ahead, leads * math.copysign(1.0, float(square @ out)) * square)


def _corner(rng: random.Random, ahead: np.ndarray, aside: np.ndarray) -> np.ndarray:
    angle = rng.choice((0.0, 0.0, rng.uniform(0.0, SHARPEST_RAD)))
    return _unit(math.cos(angle) * ahead + math.sin(angle) * aside)


def _tilted(rng: random.Random, axis: np.ndarray) -> np.ndarray:
    most = rng.choice((0.0, 0.05, 0.15))
    return _unit(axis + np.array([rng.uniform(-most, most) for _ in range(3)]))


def _unit(v: np.ndarray) -> np.ndarray:
    return np.asarray(v / np.linalg.norm(v))


def _words(tip: np.ndarray, axis: np.ndarray) -> str:
    return " ".join(f"{a}{c:.9f}" for a, c in zip("XYZIJK", (*tip, *axis), strict=True))


def _dense(points: list[np.ndarray]) -> np.ndarray:
    return np.vstack([np.linspace(p, q, 400) for p, q in itertools.pairwise(points)])
