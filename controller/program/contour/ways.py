"""Lines and arcs of a contour with the cutter's way beside each, and where two such ways meet.

Points and directions are complex numbers: the first axis of the plane is real, the second
imaginary, so that ``1j * direction`` points to the left of the travel. All lengths in mm.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from controller.geometry.vectors import ROUNDING

TURN = 2.0 * math.pi


@dataclass(slots=True)
class Way:
    """A line (``centre`` None) or an arc of a contour, and what its neighbours leave of the way beside it."""

    start: complex  # of the contour
    end: complex
    off: float  # the way lies so far left of the contour
    into: complex  # unit directions at start and end
    out: complex
    centre: complex | None = None  # of the way
    sweep: float = 0.0  # rad, counter-clockwise positive
    begins: complex = field(init=False)  # of the way
    ends: complex = field(init=False)
    left_in: float = 0.0  # so much of the way is left out at its start, and its end
    left_out: float = 0.0

    def __post_init__(self) -> None:
        self.begins = self.start + 1j * self.off * self.into
        self.ends = self.end + 1j * self.off * self.out

    @property
    def radius(self) -> float:
        """Of an arc's way, as it begins."""
        return 0.0 if self.centre is None else abs(self.begins - self.centre)

    @property
    def length(self) -> float:
        """Of the whole way."""
        if self.centre is None:
            return abs(self.end - self.start)
        return abs(self.sweep) * abs(self.start + 1j * self.off * self.into - self.centre)

    @property
    def rest(self) -> float:
        """What is left of the way."""
        return self.length - self.left_in - self.left_out

    def ahead(self, point: complex) -> float:
        """How far along the way a point of it lies behind the begin of the whole way."""
        begin = self.start + 1j * self.off * self.into
        if self.centre is None:
            return ((point - begin) * self.into.conjugate()).real
        return _turned(begin - self.centre, point - self.centre, self.sweep)

    def behind(self, point: complex) -> float:
        """How far along the way the end of the whole way lies behind a point of it."""
        end = self.end + 1j * self.off * self.out
        if self.centre is None:
            return ((end - point) * self.into.conjugate()).real
        return _turned(point - self.centre, end - self.centre, self.sweep)

    def heading(self, point: complex) -> complex:
        """Unit direction of the way at a point of it."""
        if self.centre is None or point == self.centre:
            return self.into
        return math.copysign(1.0, self.sweep) * 1j * unit(point - self.centre)

    def box(self) -> tuple[float, float, float, float]:
        """Least and greatest coordinates that the way stays within."""
        a, b, c, r = self.begins, self.ends, self.centre, self.radius
        if c is None:
            return min(a.real, b.real), min(a.imag, b.imag), max(a.real, b.real), max(a.imag, b.imag)
        return c.real - r, c.imag - r, c.real + r, c.imag + r

    def alone(self) -> Way:
        """The way that is left, as a contour of its own."""
        if self.centre is None:
            return line(self.begins, self.ends, 0.0)
        radius = self.radius
        sweep = math.copysign(self.rest / radius, self.sweep) if radius > ROUNDING else 0.0
        return arc(self.begins, self.ends, self.centre, sweep, 0.0)

    def contour(self) -> Way:
        """Line or arc of the contour itself."""
        if self.centre is None:
            return line(self.start, self.end, 0.0)
        return arc(self.start, self.end, self.centre, self.sweep, 0.0)


def unit(direction: complex) -> complex:
    """The direction alone; of none that of the first axis."""
    size = abs(direction)
    return direction / size if size else 1.0 + 0.0j


def line(start: complex, end: complex, off: float) -> Way:
    """A line of the contour."""
    heading = unit(end - start)
    return Way(start, end, off, heading, heading)


def arc(start: complex, end: complex, centre: complex, sweep: float, off: float) -> Way:
    """An arc of the contour; the way beside it has the same centre."""
    left = math.copysign(1.0, sweep) * 1j
    return Way(start, end, off, left * unit(start - centre), left * unit(end - centre), centre, sweep)


def onto(start: complex, end: complex, out: complex, sweep: float, off: float) -> Way | None:
    """The arc from ``start`` itself that ends beside ``end`` with the direction ``out``; None: there is none.

    ``sweep``: of the programmed arc; the way goes round in the same sense.
    """
    ends = end + 1j * off * out
    chord, left = start - ends, 1j * out
    towards = (chord * left.conjugate()).real
    if abs(towards) < ROUNDING or towards * sweep <= 0.0:
        return None
    centre = ends + left * (abs(chord) ** 2 / (2.0 * towards))
    sense = math.copysign(1.0, sweep)
    angle = cmath.phase((ends - centre) / (start - centre)) * sense % TURN
    made = Way(start, end, off, sense * 1j * unit(start - centre), out, centre, sense * angle)
    made.start, made.begins = start - 1j * off * made.into, start
    return made


def _turned(first: complex, second: complex, sweep: float) -> float:
    """Length of the arc from one radius to another, in the sense of ``sweep``; 0 just before a full turn."""
    radius = abs(first)
    if radius < ROUNDING or abs(second) < ROUNDING:
        return 0.0
    angle = cmath.phase(second / first) * math.copysign(1.0, sweep) % TURN
    return 0.0 if (TURN - angle) * radius < 2.0 * ROUNDING else angle * radius


# ---- where two ways meet -------------------------------------------------------------


def meetings(one: Way, two: Way, at_end: bool = False) -> Iterator[complex]:
    """Points that the lines and circles of two ways share; ``at_end``: those near the end of the first."""
    if one.centre is None:
        if two.centre is None:
            yield from _of_lines(one, two)
        else:
            yield from _of_line(one, two.centre, two.radius)
        return
    radius = abs(one.ends - one.centre) if at_end else one.radius
    if two.centre is None:
        yield from _of_line(two, one.centre, radius)
    else:
        yield from _of_circles(one.centre, radius, two.centre, two.radius)


def _of_lines(one: Way, two: Way) -> Iterator[complex]:
    a, b = one.into, two.into
    across = (a.conjugate() * b).imag
    if abs(across) > 1e-12:
        yield one.begins + a * (((two.begins - one.begins).conjugate() * b).imag / across)


def _of_line(one: Way, centre: complex, radius: float) -> Iterator[complex]:
    """Of a line with a circle."""
    from_foot = (centre - one.begins) * one.into.conjugate()
    square = radius * radius - from_foot.imag * from_foot.imag
    if square >= 0.0:
        half = math.sqrt(square)
        yield one.begins + one.into * (from_foot.real - half)
        yield one.begins + one.into * (from_foot.real + half)


def _of_circles(first: complex, r: float, second: complex, q: float) -> Iterator[complex]:
    apart = abs(second - first)
    if apart < ROUNDING:
        return
    along = (apart * apart + r * r - q * q) / (2.0 * apart)
    square = r * r - along * along
    if square >= 0.0:
        foot, half = unit(second - first), math.sqrt(square)
        yield first + foot * complex(along, half)
        yield first + foot * complex(along, -half)
