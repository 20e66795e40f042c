"""Rows of joined surfaces of any length for tests: a wall along a spiral, cut into pieces."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

PITCH_MM = 14.0  # of the spiral: its turns keep apart
INNER_MM = 20.0
HEIGHT_MM = 10.0


def program(
    count: int, turned_rad: float = 0.0, corners: int = 0, length_mm: float = 4.0, decimals: int = 9
) -> str:
    """A program of ``count`` joined G52 surfaces, each ``length_mm`` long, cut on the inside with P1.

    ``turned_rad`` turns all of it about Z. With ``corners`` the wall is one of chords, cut on the outside,
    where every so many of them meet in a corner. Written in few ``decimals`` they meet at small angles.
    """
    surfaces = _chords(count, length_mm, corners) if corners else _smooth(count, length_mm)
    c, s = math.cos(turned_rad), math.sin(turned_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    lines = ["G21 G90 G54 G61", "T2 M6", "S12000 M3", "G42 P1" if corners else "G41 P1"]
    for k, points in enumerate(surfaces):
        rows = [
            " ".join(f"{a}{v:.{decimals}f}" for a, v in zip("XYZ", p, strict=True)) for p in points @ turn
        ]
        lines += [f"G52 {rows[0]}" + ("" if k else " F1000."), *rows[1:]]
    return "\n".join([*lines, "G40", "M5", "M30", ""])


def _angles(count: int, length_mm: float) -> list[float]:
    """Along the spiral, about ``length_mm`` from each other."""
    angles = [0.0]
    for _ in range(count):
        angles.append(angles[-1] + length_mm / _radius(angles[-1]))
    return angles


def _radius(angle: float) -> float:
    return INNER_MM + PITCH_MM * angle / (2.0 * math.pi)


def _lower(angle: float) -> np.ndarray:
    return _radius(angle) * np.array([math.cos(angle), math.sin(angle), 0.0])


def _upper(angle: float) -> np.ndarray:
    """The ruling leans and sways by some degrees along the wall."""
    out, along = 0.15 + 0.05 * math.sin(1.3 * angle), 0.06 * math.cos(0.9 * angle)
    c, s = math.cos(angle), math.sin(angle)
    return _lower(angle) + HEIGHT_MM * np.array([out * c - along * s, out * s + along * c, 1.0])


def _smooth(count: int, length_mm: float) -> list[np.ndarray]:
    """Cubics with the spiral's own places and tangents at their ends, (8, 3) each."""
    angles, made = _angles(count, length_mm), []
    for a, b in pairwise(angles):
        third = (b - a) / 3.0
        rows = []
        for at in (_upper, _lower):
            rows += [at(a), at(a) + third * _rate(at, a), at(b) - third * _rate(at, b), at(b)]
        made.append(np.array(rows))
    return made


def _rate(at: object, angle: float, step: float = 1e-5) -> np.ndarray:
    return (at(angle + step) - at(angle - step)) / (2.0 * step)  # type: ignore[operator]


def _chords(count: int, length_mm: float, corners: int) -> list[np.ndarray]:
    """Upright walls along chords of the spiral, each of so many pieces."""
    places = [_lower(a) for a in _angles(math.ceil(count / corners), corners * length_mm)]
    made = []
    for start, end in pairwise(places):
        for k in range(corners):
            share = [(k + i / 3.0) / corners for i in range(4)]
            low = np.array([start + x * (end - start) for x in share])
            made.append(np.concatenate([low + np.array([0.0, 0.0, HEIGHT_MM]), low]))
    return made[:count]
