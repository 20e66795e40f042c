"""Programs of short chords in a plane, as CAM systems write adaptive clearing: loops of many corners."""

from __future__ import annotations

import math
import random

CHORD_MM = 0.2
LOOP = 20, 120  # chords that bend to one side


def program(
    count: int,
    corners_deg: tuple[float, float],
    path: str = "G64 P0.001",
    feed: float = 3000.0,
    seed: int = 1,
) -> str:
    """So many chords, each at such an angle to the one before; ``path``: G64 P, G61 or none of both."""
    rng = random.Random(seed)
    lines = [f"G21 G90 G54 G17 {path}", "G0 X0 Y0 Z5", f"G1 Z-1 F{feed:g}"]
    x = y = heading = 0.0
    left, side = 0, 1
    for _ in range(count):
        if left == 0:
            left, side = rng.randrange(*LOOP), rng.choice((-1, 1))
        left -= 1
        heading += side * math.radians(rng.uniform(*corners_deg))
        x, y = x + CHORD_MM * math.cos(heading), y + CHORD_MM * math.sin(heading)
        lines.append(f"X{x:.3f} Y{y:.3f}")
    return "\n".join([*lines, "G0 Z5", "M30", ""])


def adaptive(count: int, seed: int = 1) -> str:
    """Some ``count`` lines of pockets as FreeCAD's Adaptive writes them, without any word for the path.

    A helix down as chords or as half turns, a round at depth, and passes that grow around it: arcs of short
    chords with a small round at both ends and a place that is written twice, linked by rapids at depth
    or a little above it. Every line has its feed, as the posts write them.
    Source: FreeCAD, src/Mod/CAM/Path/Op/Adaptive.py, and what public files of its posts look like.
    """
    rng, top, lines = random.Random(seed), 0.0, ["G17 G90", "G21", "G54"]
    while len(lines) < count:
        x, y, bottom, radius = rng.uniform(-40.0, 40.0), rng.uniform(-40.0, 40.0), top - 1.0, 1.0
        lines += _helix(x, y, rng.uniform(0.1, 2.0), top, bottom, arcs=rng.random() < 0.5)
        for _ in range(rng.randrange(20, 60)):
            radius = min(radius + rng.uniform(0.0, 0.4), 12.0)
            link = f"G0 X{x + rng.uniform(-0.3, 0.3):.3f} Y{y + rng.uniform(-0.3, 0.3):.3f}"
            lifted = [f"G0 Z{bottom + 0.5:.3f}", link, f"G1 Z{bottom:.3f} F400.000"]
            lines += [*_pass(rng, x, y, radius), *(lifted if rng.random() < 0.5 else [link])]
        lines.append("G0 Z6.000")
        top = bottom if bottom > -5.0 else 0.0
    return "\n".join([*lines, "M2", ""])


def _helix(x: float, y: float, radius: float, top: float, bottom: float, arcs: bool) -> list[str]:
    """From above down to ``bottom``, three degrees steep, and once around there."""
    turns = (top - bottom) / (2.0 * math.pi * radius * math.tan(math.radians(3.0)))
    start, per_turn = f"X{x + radius:.3f} Y{y:.3f}", 2 if arcs else 32
    lines = ["G0 Z6.000", f"G0 {start} Z6.000", f"G0 {start} Z4.000", f"G1 {start} Z{top:.3f} F400.000"]
    down = per_turn * math.ceil(turns)
    for k in range(1, down + per_turn + 1):
        at, z = 2.0 * math.pi * k / per_turn, max(bottom, top + (bottom - top) * k / down)
        place = f"X{x + radius * math.cos(at):.3f} Y{y + radius * math.sin(at):.3f} Z{z:.3f}"
        center = f" I{-radius if k % 2 else radius:.3f} J0.000" if arcs else ""
        lines.append(f"{'G3' if arcs else 'G1'} {place}{center} F{400.0 if k <= down else 1200.0:.3f}")
    return lines


def _pass(rng: random.Random, x: float, y: float, radius: float) -> list[str]:
    """One bite: into the wall by a small round, along it in chords of no even length, and out of it."""
    at, chord = rng.uniform(0.0, 2.0 * math.pi), min(0.5, 0.25 * radius)
    points, end = [(radius - 0.2, at - 0.1), (radius - 0.08, at - 0.03)], at + rng.uniform(1.0, 5.0)
    while at < end:
        points.append((radius, at))
        at += rng.uniform(0.3, 1.5) * chord / radius
    points += [points[-1], (radius - 0.05, at + 0.02), (radius - 0.15, at + 0.06)]
    return [f"G1 X{x + r * math.cos(a):.3f} Y{y + r * math.sin(a):.3f} F1200.000" for r, a in points]
