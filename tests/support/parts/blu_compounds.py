"""Compound surfaces in few decimals, as CAD and CAM write them: normals meet at hundredths of a degree."""

from __future__ import annotations

import itertools
import random

import numpy as np
from support.parts.random_surfaces import Pair, compound

BLU = 2  # decimals of the paper's own unit, 0.01 mm


def split(points: np.ndarray, at: float) -> tuple[np.ndarray, np.ndarray]:
    """Control points of both halves of a Bezier, by de Casteljau."""
    rows, left, right = np.asarray(points, dtype=float), [], []
    while len(rows):
        left.append(rows[0])
        right.insert(0, rows[-1])
        rows = rows[:-1] + at * np.diff(rows, axis=0)
    return np.array(left), np.array(right)


def parts(surface: Pair, count: int, decimals: int) -> list[Pair]:
    """One pair of Beziers as so many blocks, every coordinate rounded."""
    rest, made = surface, []
    for k in range(count, 1, -1):
        (a, rest_upper), (b, rest_lower) = (split(points, 1.0 / k) for points in rest)
        made.append((a, b))
        rest = (rest_upper, rest_lower)
    return [(np.round(a, decimals), np.round(b, decimals)) for a, b in (*made, rest)]


def general(seed: int, decimals: int = BLU) -> list[Pair]:
    """Random Beziers in 2 to 6 blocks."""
    rng = random.Random(seed)
    members = compound(seed, rng.choice((1, 1, 2)))
    counts = rng.choice((2, 3, 4, 5, 6)) if len(members) == 1 else rng.choice((1, 2, 3))
    return [part for surface in members for part in parts(surface, counts, decimals)]


def like_the_papers(seed: int, decimals: int = BLU) -> list[Pair]:
    """A scaled arch over an arch, as Eq. 7, in 2 to 6 blocks: rulings that meet far above or below."""
    rng = random.Random(seed)
    size, height = rng.uniform(8.0, 30.0), rng.uniform(6.0, 15.0)
    arch = np.array([[1.0, 0.0], [1.0, rng.uniform(0.45, 0.6)], [rng.uniform(0.45, 0.6), 1.0], [0.0, 1.0]])
    turn = rng.uniform(-np.pi, np.pi)
    way = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    lower = np.hstack([size * arch @ way, np.zeros((4, 1))])
    upper = lower * [rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.9), 1.0] + [0.0, 0.0, height]
    return parts((upper, lower), rng.choice((2, 3, 4, 5, 6)), decimals)


def angles(surfaces: list[Pair], v: float = 1.0) -> list[float]:
    """Between the normals of neighbours at ``v`` of the rulings they share (1: the lower end), degrees."""
    found = []
    for before, after in itertools.pairwise(surfaces):
        ruling = before[0][3] - before[1][3]
        ends = [(before[k][3] - before[k][2], after[k][1] - after[k][0]) for k in (0, 1)]
        ways = [(1.0 - v) * upper + v * lower for upper, lower in zip(*ends, strict=True)]
        a, b = (n / np.linalg.norm(n) for n in (np.cross(way, ruling) for way in ways))
        found.append(float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))))
    return found


def creases(surfaces: list[Pair]) -> list[float]:
    """The largest of these anywhere on each ruling: only the lower curves are made to run on."""
    return [max(one) for one in zip(*(angles(surfaces, v) for v in np.linspace(0.0, 1.0, 17)), strict=True)]


def text(surfaces: list[Pair], feed_mm_min: float, side: str, tool: str = "T2 M6", head: str = "") -> str:
    """A program that cuts them, without a word of path control unless ``head`` has one."""
    lines = ["G21 G90 G54", tool, "S12000 M3", head, side]
    for i, (upper, lower) in enumerate(surfaces):
        for k, p in enumerate([*upper, *lower]):
            words = " ".join(
                f"{axis}{round(float(value), 9)!r}" for axis, value in zip("XYZ", p, strict=True)
            )
            feed = f" F{feed_mm_min:.3f}" if k == 0 and i == 0 else ""
            lines.append(("G52 " if k == 0 else "") + words + feed)
    return "\n".join([*lines, "G40", "M5", "M30", ""])
