"""Random programs with cutter compensation, for the comparison with another interpreter."""

from __future__ import annotations

import cmath
import random

from support.parts.random_contours import Piece

BETWEEN = ("M8", "(a remark)", "S200", "F300", "G4 P0.1", "G90", "T1", "M9")
MIN_TURN = 0.06  # rad; LinuxCNC cuts corners that are flatter


def program(rng: random.Random) -> str:
    """A contour in G17 or G18 with what posts write around it."""
    plane, unit = rng.choice(("G17", "G17", "G18")), rng.choice((1.0, 1.0, 25.4))
    rows = [f"{plane} {'G21' if unit == 1.0 else 'G20'} G90 T1 M6", "F300"]
    names = "XYIJ" if plane == "G17" else "ZXKI"
    here = complex(rng.uniform(-9, 9), rng.uniform(-9, 9))
    rows.append(f"G0 {_place(here, names, unit)}")
    for _ in range(rng.randrange(1, 3)):
        here = _contour(rng, rows, here, names, unit)
    return "\n".join([*rows, "M2", ""])


def _contour(rng: random.Random, rows: list[str], here: complex, names: str, unit: float) -> complex:
    code = rng.choice(
        ("G41 D1", "G42 D1", "G41", "G42 D2", f"G41.1 D{9 / unit:.4f}", f"G42.1 D-{7 / unit:.4f}")
    )
    alone, heading = rng.random() < 0.5, cmath.rect(1.0, rng.uniform(-3.1, 3.1))
    if alone:
        rows.append(code)
    end = here + heading * rng.uniform(5.0, 30.0)
    rows.append(f"{'' if alone else code + ' '}{rng.choice(('G1', 'G0'))} {_place(end, names, unit)}")
    rows.append("G1")
    here = end
    for _ in range(rng.randrange(1, 9)):
        if rng.random() < 0.2:
            rows.append(rng.choice(BETWEEN))
        turn = rng.choice((0.0, rng.uniform(MIN_TURN, 2.4), -rng.uniform(MIN_TURN, 2.4)))
        heading *= cmath.rect(1.0, turn)
        piece = _piece(rng, here, heading)
        rows.append(_row(rng, piece, names, unit))
        here, heading = piece.end, piece.heading(at_end=True)
    end = here + heading * cmath.rect(rng.uniform(5.0, 30.0), rng.uniform(-1.0, 1.0))
    rows.append(f"G40 G1 {_place(end, names, unit)}")
    return end


def _piece(rng: random.Random, here: complex, heading: complex) -> Piece:
    if rng.random() < 0.6:
        return Piece(here, here + heading * rng.uniform(1.0, 30.0))
    radius, sweep = rng.uniform(2.0, 25.0), rng.uniform(0.3, 4.5) * rng.choice((1.0, -1.0))
    centre = here + 1j * heading * radius * (1.0 if sweep > 0.0 else -1.0)
    return Piece(here, centre + (here - centre) * cmath.rect(1.0, sweep), centre, sweep)


def _row(rng: random.Random, piece: Piece, names: str, unit: float) -> str:
    normal = "Y" if names[0] == "Z" else "Z"
    along = f" {normal}{rng.uniform(-3.0, 3.0) / unit:.4f}" if rng.random() < 0.15 else ""
    if piece.centre is None:
        if rng.random() < 0.2:
            step = piece.end - piece.start
            return f"G91 G1 {_place(step, names, unit)}\nG90"
        return f"G1 {_place(piece.end, names, unit)}{along}"
    to = (piece.centre - piece.start) / unit
    code = "G3" if piece.sweep > 0.0 else "G2"
    return f"{code} {_place(piece.end, names, unit)} {names[2]}{to.real:.7f} {names[3]}{to.imag:.7f}{along}"


def _place(point: complex, names: str, unit: float) -> str:
    return f"{names[0]}{point.real / unit:.7f} {names[1]}{point.imag / unit:.7f}"
