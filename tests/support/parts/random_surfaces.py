"""Unseen compound surfaces for tests: pairs of cubic Beziers with twisted rulings, and their program text."""

from __future__ import annotations

import random

import numpy as np

Pair = tuple[np.ndarray, np.ndarray]  # four upper and four lower control points


def pair(
    rng: random.Random, start: np.ndarray, heading: float, lean: np.ndarray
) -> tuple[Pair, float, np.ndarray]:
    """One surface from ``start`` along ``heading`` (rad) with the ruling ``lean``; and both at its end."""
    size = rng.uniform(5.0, 14.0)
    turn = [heading, heading + rng.uniform(-0.5, 0.5)]
    turn.append(turn[1] + rng.uniform(-0.5, 0.5))
    lower = [start]
    for way in turn:
        step = size * rng.uniform(0.7, 1.3)
        lower.append(lower[-1] + step * np.array([np.cos(way), np.sin(way), rng.uniform(-0.05, 0.05)]))
    lower[1][2] = lower[0][2]
    lower[2][2] = lower[3][2]  # level at both ends, so that neighbours meet without a corner
    leans = [lean, lean + _sway(rng), lean + _sway(rng), lean + _sway(rng)]
    upper = [p + ruling for p, ruling in zip(lower, leans, strict=True)]
    return (np.round(upper, 3), np.round(lower, 3)), turn[-1], leans[-1]


def _sway(rng: random.Random) -> np.ndarray:
    return np.array([rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), rng.uniform(-0.5, 0.5)])


def compound(seed: int, members: int = 2) -> list[Pair]:
    """Surfaces one after the other, each beginning with the last one's ruling and direction."""
    rng = random.Random(seed)
    start = np.array([rng.uniform(-15.0, 15.0), rng.uniform(-15.0, 15.0), 0.0])
    heading = rng.uniform(-np.pi, np.pi)
    lean = np.array([rng.uniform(-4.0, 4.0), rng.uniform(-4.0, 4.0), rng.uniform(8.0, 14.0)])
    made: list[Pair] = []
    for _ in range(members):
        surface, heading, lean = pair(rng, start, heading, lean)
        if made:
            _join(made[-1], surface)
        made.append(surface)
        start = surface[1][3]
    return made


def _join(before: Pair, after: Pair) -> None:
    """The same ruling, and rounding taken out of the direction of travel at the joint."""
    after[0][0], after[1][0] = before[0][3], before[1][3]
    way = before[1][3] - before[1][2]
    step = float(np.linalg.norm(after[1][1] - after[1][0]))
    shift = after[1][0] + way * (step / float(np.linalg.norm(way))) - after[1][1]
    after[1][1] += shift
    after[0][1] += shift


def text(surfaces: list[Pair], feed_mm_min: float, side: str = "G42", head: str = "") -> str:
    """A program that cuts them with the 3 mm end mill."""
    lines = ["G21 G90 G54 G61", "T2 M6", "S12000 M3", head, side]
    for i, (upper, lower) in enumerate(surfaces):
        points = [*upper, *lower]
        for k, p in enumerate(points):
            words = " ".join(f"{axis}{value:.12f}" for axis, value in zip("XYZ", p, strict=True))
            start = "G52 " if k == 0 else ""
            feed = f" F{feed_mm_min:.3f}" if k == 0 and i == 0 else ""
            lines.append(start + words + feed)
    return "\n".join([*lines, "G40", "M5", "M30", ""])
