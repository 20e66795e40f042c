"""Series of canned cycles with other codes, heights, G98 and G99, and shifts of Z between their holes."""

from __future__ import annotations

import random
from dataclasses import dataclass


@dataclass
class _Series:
    """Heights, mm: where Z is, where the series began (None outside of one), R and Z of the line before."""

    z: float
    level: float | None = None
    code: str = ""
    clearance: float = 0.0
    steps: bool = False  # G91


def program(rng: random.Random) -> str:
    """Up to ten lines. No R is above the height of the start, and under G99 none above where Z is."""
    lines = ["G21 G90 S100 M3 F60", "G0 X0 Z10"]
    at = _Series(10.0)
    for _ in range(rng.randrange(3, 10)):
        lines.append(_line(rng, at))
    return "\n".join([*lines, "M2\n"])


def _line(rng: random.Random, at: _Series) -> str:
    if (drawn := rng.random()) < 0.15 and at.level is not None:
        at.z = float(rng.randrange(0, 12))
        return f"G92 Z{at.z:g}"
    if drawn < 0.25:
        at.z, at.level = float(rng.randrange(8, 13)), None
        return f"G90 G0 X{rng.randrange(9)} Z{at.z:g}"
    if drawn < 0.3 and at.z >= 8.0:
        at.level = None
        return "G80"
    return _hole(rng, at)


def _hole(rng: random.Random, at: _Series) -> str:
    steps, named = rng.random() < 0.3, at.level is None or rng.random() < 0.5
    at.level = at.z if at.level is None else at.level
    code = rng.choice(("G81", "G82", "G83", "G86", "G89")) if named else at.code
    whole = named or steps != at.steps or rng.random() < 0.5
    base = at.level if steps else 0.0
    r = float(rng.randrange(0, 8)) if whole else at.clearance
    at.code, at.steps, at.clearance = code, steps, r
    to_r = at.z >= r and rng.random() < 0.5
    words = (
        f"{'G99' if to_r else 'G98'} {'G91' if steps else 'G90'} {code if named else ''} X{rng.randrange(9)}"
    )
    if whole:
        words += f" R{r - base:g} Z{-rng.randrange(1, 8):g}"
    words += {"G82": " P0.1", "G86": " P0.1", "G89": " P0.1", "G83": " Q3"}.get(code if named else "", "")
    at.z = r if to_r else max(at.level, r)
    return words + rng.choice(("", "", "", " L2"))
