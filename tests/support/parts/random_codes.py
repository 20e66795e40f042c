"""Random programs of offsets, shifts, reference points, tool lengths, arcs and canned cycles."""

from __future__ import annotations

import random

CYCLES = ("G81", "G82", "G83", "G73", "G85", "G86", "G89", "G84")


def program(rng: random.Random, lines: int = 14) -> str:
    """Sound lines, most of them; whatever state they make is part of the game."""
    unit = rng.choice(("G21", "G21", "G21", "G20"))
    turns = rng.random() < 0.5
    rows = [unit, "G90 G94 G98 F100 T1 M6", "S100 M3 G0 X1 Y2 Z50"]
    rows += [line(rng, turns) for _ in range(lines)]
    return "\n".join([*rows, "M2", ""])


def number(rng: random.Random, low: float = -40.0, high: float = 40.0) -> str:
    return f"{rng.uniform(low, high):.{rng.randrange(4)}f}"


def _places(rng: random.Random, letters: str = "XYZ", rotary: float = 0.2) -> str:
    chosen = [letter for letter in letters if rng.random() < 0.6] or [rng.choice(letters)]
    chosen += ["A"] if rng.random() < rotary else []
    return " ".join(letter + number(rng) for letter in chosen)


def line(rng: random.Random, turns: bool) -> str:
    """Offsets are turned, or all are shifted: of both together the interpreter of LinuxCNC 2.9 loses one."""
    return rng.choice(
        (
            lambda: f"G0 {_places(rng)}",
            lambda: f"G1 {_places(rng)}",
            lambda: f"G1 {_places(rng)} F{rng.randrange(50, 500)}",
            lambda: rng.choice(("G90", "G91", "G90", "G98", "G99", "G80")),
            lambda: rng.choice(("G54", "G55", "G57", "G59", "G59.1", "G59.3")),
            lambda: f"G10 L2 P{rng.randrange(10)} {_places(rng)}",
            lambda: _turned(rng) if turns else f"G92 {_places(rng)}",
            lambda: f"G10 L20 P{rng.randrange(10)} {_places(rng)}",
            lambda: _turned(rng) if turns else f"G52 {_places(rng)}\nG0 {_places(rng)}",
            lambda: rng.choice(("G92.1", "G92.2", "G92.3")),
            lambda: rng.choice(("G28", "G30", "G28.1", "G30.1")),
            lambda: f"{rng.choice(('G28', 'G30'))} X{number(rng)} Y{number(rng)} {_places(rng, 'Z')}",
            lambda: f"G90\nG53 {rng.choice(('G0', 'G1'))} {_places(rng)}",
            lambda: rng.choice(("G43 H1", "G43 H2", "G49", "G43.1 Z12.5", "G43.2 H1")),
            lambda: rng.choice(("G10 L1 P1 Z17", "G10 L10 P2 Z5", "G10 L11 P1 Z3", "G43")),
            lambda: _cycle(rng),
            lambda: _cycle(rng),
            lambda: _cycle(rng),
        )
    )()


def _turned(rng: random.Random) -> str:
    return f"G10 L2 P{rng.randrange(10)} {_places(rng)} R{number(rng, -180.0, 180.0)}"


def _cycle(rng: random.Random) -> str:
    """A whole series in a plane, absolute or in steps."""
    plane, drill, across = rng.choice((("G17", "Z", "XY"), ("G18", "Y", "ZX"), ("G19", "X", "YZ")))
    code, steps = rng.choice(CYCLES), rng.random() < 0.4
    ends = rng.choice(("G98", "G99"))
    if code == "G84" or (code == "G85" and plane != "G17"):
        # The interpreter of LinuxCNC 2.9 confuses R and level there, and in tapping the axes as well.
        plane, drill, across, ends = "G17", "Z", "XY", "G99"
    clearance = -rng.uniform(0.0, 5.0) if steps else rng.uniform(0.0, 10.0)
    bottom = -rng.uniform(2.0, 9.0) if steps else clearance - rng.uniform(1.0, 12.0)
    words = f"{drill}{bottom:.3f} R{clearance:.3f}"
    if code in ("G82", "G86", "G89"):
        words += " P0.2"
    if code in ("G83", "G73"):
        words += f" Q{rng.uniform(0.7, 4.0):.2f}"
    rows = [f"{plane} {'G91' if steps else 'G90'} {ends} M3"]
    repeats = f" L{rng.randrange(1, 4)}" if rng.random() < 0.3 else ""
    rows.append(f"{code} {_places(rng, across, 0.0)} {words}{repeats}")
    rows += [_places(rng, across, 0.0) for _ in range(rng.randrange(3))]
    return "\n".join([*rows, "G80 G90 G17"])
