"""Random contours of lines and arcs in a plane, with corners of both kinds and radii near the cutter's."""

from __future__ import annotations

import cmath
import itertools
import math
import random
from dataclasses import dataclass

import shapely

LEAD_MM = 40.0


@dataclass(frozen=True, slots=True)
class Piece:
    """A line, or an arc with its centre and its sweep (rad, counter-clockwise positive)."""

    start: complex
    end: complex
    centre: complex | None = None
    sweep: float = 0.0

    def points(self, step_mm: float) -> list[complex]:
        """Points along it, ends included."""
        if self.centre is None:
            count = max(1, math.ceil(abs(self.end - self.start) / step_mm))
            return [self.start + (self.end - self.start) * k / count for k in range(count + 1)]
        spoke = self.start - self.centre
        count = max(1, math.ceil(abs(self.sweep) * abs(spoke) / step_mm))
        return [self.centre + spoke * cmath.rect(1.0, self.sweep * k / count) for k in range(count + 1)]

    def heading(self, at_end: bool) -> complex:
        if self.centre is None:
            return (self.end - self.start) / abs(self.end - self.start)
        spoke = (self.end if at_end else self.start) - self.centre
        return math.copysign(1.0, self.sweep) * 1j * spoke / abs(spoke)


def contour(rng: random.Random, radius: float) -> list[Piece]:
    """A contour that does not cross itself, and does not end behind its own back."""
    while True:
        if rng.random() < 0.4:
            made, free = _ring(rng, radius), True
        else:
            made = _walk(rng, radius)
            ends = (made[0].start, made[2:]), (made[-1].end, made[:-2])
            free = all(_apart(end, others) > 2.0 * radius for end, others in ends)
        if free and _line(made, 0.01 * radius).is_simple:
            return made


def _line(pieces: list[Piece], step_mm: float) -> shapely.LineString:
    return shapely.LineString([(p.real, p.imag) for piece in pieces for p in piece.points(step_mm)])


def _apart(end: complex, others: list[Piece]) -> float:
    """How far an end of a contour is from all but its own piece."""
    return float(_line(others, 0.1).distance(shapely.Point(end.real, end.imag)))


def _walk(rng: random.Random, radius: float) -> list[Piece]:
    """Open, from left to right by and large."""
    here, heading, made = 0j, 1 + 0j, []
    for _ in range(rng.randrange(3, 12)):
        if made and rng.random() < 0.6:
            heading = cmath.rect(1.0, rng.uniform(-1.7, 1.7))
        if rng.random() < 0.55:
            made.append(Piece(here, here + heading * rng.uniform(0.3, 8.0) * radius))
        else:
            made.append(_arc(here, heading, rng.uniform(0.7, 6.0) * radius, rng.uniform(0.3, 2.0), rng))
        here, heading = made[-1].end, made[-1].heading(at_end=True)
    return made


def _arc(start: complex, heading: complex, radius: float, angle: float, rng: random.Random) -> Piece:
    sense = rng.choice((1.0, -1.0))
    centre = start + sense * 1j * heading * radius
    spoke = start - centre
    return Piece(start, centre + spoke * cmath.rect(1.0, sense * angle), centre, sense * angle)


def _ring(rng: random.Random, radius: float) -> list[Piece]:
    """Closed, from the middle of a side: a polygon about the origin, some of its corners rounded."""
    count, sense = rng.randrange(4, 9), rng.choice((1.0, -1.0))
    angles = [sense * 2.0 * math.pi * (k + rng.uniform(-0.25, 0.25)) / count for k in range(count)]
    corners = [cmath.rect(rng.uniform(4.0, 14.0) * radius, angle) for angle in angles]
    begin = (corners[-1] + corners[0]) / 2.0
    made, here = [], begin
    for k, corner in enumerate(corners):
        after = corners[k + 1] if k + 1 < count else begin
        rounded = _rounded(here, corner, after, rng.uniform(0.8, 3.0) * radius) if rng.random() < 0.6 else []
        made.append(Piece(here, rounded[0].start if rounded else corner))
        made += rounded
        here = rounded[-1].end if rounded else corner
    return [*made, Piece(here, begin)]


def _rounded(before: complex, corner: complex, after: complex, radius: float) -> list[Piece]:
    """The arc in a corner, where there is room for it."""
    a, b = (corner - before) / abs(corner - before), (after - corner) / abs(after - corner)
    turn = cmath.phase(b / a)
    back = radius * math.tan(abs(turn) / 2.0)
    if not 0.05 < back < 0.45 * min(abs(corner - before), abs(after - corner)):
        return []
    start = corner - a * back
    return [Piece(start, corner + b * back, start + math.copysign(1.0, turn) * 1j * a * radius, turn)]


def crossing(rng: random.Random, radius: float) -> list[Piece]:
    """A contour that crosses itself on purpose: a ring whose last line cuts its first, an eight, or a loop.

    Where it crosses there is a corner on the other line, now and then, and its lines come in short ones.
    """
    made = _overrun(rng, radius) if rng.random() < 0.6 else _looped(rng, radius)
    if rng.random() < 0.4:
        made = [part for piece in made for part in _parts(piece, rng.uniform(0.3, 2.0) * radius)]
    return made


def _overrun(rng: random.Random, radius: float) -> list[Piece]:
    """Around a ring, from its last side but one through a place of its first line, and on."""
    first, *others, _ = _ring(rng, 2.0 * radius)
    sides = [k for k, piece in enumerate(others) if piece.centre is None]
    side = others[sides[-1]]
    turns_off = side.start + (side.end - side.start) * rng.uniform(0.4, 0.9)
    through = first.start + (first.end - first.start) * rng.uniform(0.2, 0.8)
    heading = (through - turns_off) / abs(through - turns_off)
    bent = heading * cmath.rect(1.0, rng.choice((0.0, 0.0, rng.uniform(-0.5, 0.5))))
    across = cmath.phase(heading / first.heading(False)) * cmath.phase(bent / first.heading(False)) > 0.0
    if not across or not 0.3 < abs(cmath.phase(bent / first.heading(False))) < math.pi - 0.3:
        bent = heading
    end = through + bent * rng.uniform(1.0, 6.0) * radius
    made = [first, *others[: sides[-1]], Piece(side.start, turns_off)]
    if _apart(end, made[1:]) < 2.0 * radius:  # it would end in a neck
        return _overrun(rng, radius)
    if rng.random() < 0.5 and bent == heading:
        return [*made, Piece(turns_off, end)]
    return [*made, Piece(turns_off, through), Piece(through, end)]


def _looped(rng: random.Random, radius: float) -> list[Piece]:
    """Two lines that cross, and one or two that lead from the first to the second."""
    turned = cmath.rect(1.0, rng.uniform(0.5, 2.6) * rng.choice((1.0, -1.0)))
    a, b, c, d = (rng.uniform(9.0, 20.0) * radius for _ in range(4))
    corners = [-a + 0j, b + 0j, turned * c, -turned * d]
    if rng.random() < 0.5:
        corners.insert(2, (corners[1] + corners[2]) * rng.uniform(0.7, 1.2))
    return [Piece(*pair) for pair in itertools.pairwise(corners)]


def _parts(piece: Piece, step: float) -> list[Piece]:
    """A line as short ones."""
    if piece.centre is not None:
        return [piece]
    return [Piece(*pair) for pair in itertools.pairwise(piece.points(step))]


def text(pieces: list[Piece], code: str, digits: int, head: str = "G17") -> str:
    """The contour with a lead-in that runs on into its first piece, and a lead-out."""
    first, last = pieces[0], pieces[-1]
    begin = first.start - first.heading(at_end=False) * LEAD_MM
    rows = [f"{head} G21 G90 F600", f"G0 {_place(begin, digits)}", f"{code} G1 {_place(first.start, digits)}"]
    rows += [_row(piece, digits) for piece in pieces]
    return "\n".join([*rows, f"G40 G1 {_place(last.end + last.heading(True) * LEAD_MM, digits)}", "M2", ""])


def _row(piece: Piece, digits: int) -> str:
    if piece.centre is None:
        return f"G1 {_place(piece.end, digits)}"
    to = piece.centre - piece.start
    code = "G3" if piece.sweep > 0.0 else "G2"
    return f"{code} {_place(piece.end, digits)} I{to.real:.{digits}f} J{to.imag:.{digits}f}"


def _place(point: complex, digits: int) -> str:
    return f"X{point.real:.{digits}f} Y{point.imag:.{digits}f}"
