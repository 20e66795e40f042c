"""Machine files as shops have them, drawn: tools with lengths, other work offsets, homing by any switch."""

from __future__ import annotations

import random
import re

# With a home switch or an index pulse; a limit switch as reference would end the travel where it is found.
METHODS = (*range(3, 15), *range(19, 31), 33, 34)
LONGEST_MM = 60.0  # beyond what the file has: the shortest of the shipped machines takes that
SPEEDS = {
    "mm": "fast_mm_s = 40.0, slow_mm_s = 5.0, acceleration_mm_s2 = 800.0",
    "deg": "fast_deg_s = 40.0, slow_deg_s = 5.0, acceleration_deg_s2 = 800.0",
}
ONE_OFFSET = re.compile(r"(?m)^G54 = \[([^\]]*)\](.*)$")
LENGTH = re.compile(r"(?m)^length_mm = 0\.0$")
HERE = re.compile(r"homing = \{ method = 3[57], group = (\d+), position_(mm|deg) = ([-0-9.]+) \}")


def drawn(rng: random.Random, text: str) -> str:
    """A machine file's text with what it has none of: lengths, a turned G55, a search for zero."""
    made = LENGTH.sub(lambda _: f"length_mm = {rng.uniform(0.0, LONGEST_MM):.3f}", text)
    if "G55" not in made:
        made = ONE_OFFSET.sub(lambda found: _offsets(rng, found), made, count=1)
    return HERE.sub(lambda found: _homing(rng, found), made) if rng.random() < 0.5 else made


def program(rng: random.Random, text: str) -> str:
    """A program in the one work offset or the other."""
    return text.replace("G54", "G55", 1) if rng.random() < 0.4 else text


def _offsets(rng: random.Random, found: re.Match[str]) -> str:
    origin = [float(word) + rng.uniform(-5.0, 5.0) for word in found[1].split(",")]
    other = [x + rng.uniform(-5.0, 5.0) for x in origin]
    rows = [", ".join(f"{x:.3f}" for x in one) for one in (origin, other)]
    turned = f"turned_deg = [0.0, 0.0, {rng.uniform(-180.0, 180.0):.3f}]"
    return f"G54 = [{rows[0]}]{found[2]}\nG55 = {{ origin_mm = [{rows[1]}], {turned} }}"


def _homing(rng: random.Random, found: re.Match[str]) -> str:
    group, unit, position = found.groups()
    method = rng.choice(METHODS)
    return f"homing = {{ method = {method}, group = {group}, position_{unit} = {position}, {SPEEDS[unit]} }}"
