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
