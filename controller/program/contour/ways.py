"""Lines and arcs of a contour with the cutter's way beside each: where two of them meet, join, or cross.

Points and directions are complex numbers: the first axis of the plane is real, the second
imaginary, so that ``1j * direction`` points to the left of the travel. All lengths in mm.
"""

from __future__ import annotations

import cmath
import math
from collections import deque
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


# Where the ways beside two neighbours of a contour join: on an arc around it, or cut short.

SLIGHT_MM = 1e-7  # a corner is none where the cutter leaves its way by no more ...
CLOSE_MM = 1e-4  # ... or by no more than this, where the rounding of words leaves no other way


class NoRoomError(ValueError):
    """The cutter does not reach the second of two neighbours; ``vanishes``: the first is gone before it."""

    def __init__(self, vanishes: bool) -> None:
        super().__init__("the first vanishes" if vanishes else "the ways do not meet")
        self.vanishes = vanishes


def joined(before: Way, after: Way) -> bool:
    """Make two ways end and begin where they join; True: on an arc around their corner instead.

    Raises NoRoomError where there is no such point.
    """
    turn = cmath.phase(after.into / before.out)
    bulge = abs(before.off) * turn * turn / 8.0
    if bulge < SLIGHT_MM:
        _meet(before, after)
        return False
    if turn * before.off < 0.0 or math.pi - abs(turn) < 1e-9:
        return True
    if _shortened(before, after):
        return False
    if bulge > CLOSE_MM:
        found = any(after.ahead(p) <= after.length + ROUNDING for p in meetings(before, after, at_end=True))
        raise NoRoomError(vanishes=found)
    _meet(before, after)
    return False


def _meet(before: Way, after: Way) -> None:
    """Between their ends, at the cutter's distance from the corner."""
    before.ends = after.begins = before.end + 1j * before.off * unit(before.out + after.into)


def _shortened(before: Way, after: Way) -> bool:
    """Cut both short where they meet; the point that takes least. Whether there is one."""
    best: tuple[float, float, complex] | None = None
    most = before.length - before.left_in + ROUNDING
    for point in meetings(before, after, at_end=True):
        out, ahead = before.behind(point), after.ahead(point)
        fits = -ROUNDING <= out <= most and -ROUNDING <= ahead <= after.length + ROUNDING
        if fits and (best is None or out < best[0]):
            best = out, ahead, point
    if best is None:
        return False
    before.left_out, after.left_in, before.ends = best
    after.begins = before.ends
    return True


# Whether the cutter's way crosses one that it has gone: then it cuts what it has left standing before.
#
# Neighbours of a contour are looked at where they meet (``joined``). What is looked for here is a neck
# that is narrower than the cutter: the ways cross, and the contour does not. A contour that crosses itself
# is meant so: as the cutter grows from nothing, the place where its ways cross moves away from there, along
# the contour so far as its two lines stay nearer than the cutter. Looked back over is one cut, from where
# the cutter comes down to where it is lifted.
#
# A contour crosses itself if it does however little one of the two is moved: at a corner that lies on the
# other line, too, and not where it only touches.

LOOKED_BACK = 200  # ways, arcs around corners among them
INSIDE_MM = 1e-5  # from the end of a way; what meets there is a corner
SLANTED = 0.01  # sine of the least angle; ways that run along each other do not cross
REACH = 10.0  # radii along the contour from where ways cross to where it does: lines 11 degrees apart
BESIDE = 3.0  # radii to a place where the contour crosses itself from whichever side
_MOVED_MM = tuple(1e-4 * cmath.rect(1.0, angle) for angle in (0.4, 2.0, 3.5, 5.1))


@dataclass(slots=True)
class Gone:
    """A way that the cutter goes."""

    number: int  # of the contour's line or arc, counted along it
    way: Way
    low: float  # along the normal of the plane
    high: float
    line: int  # of the program


@dataclass(slots=True)
class Piece:
    """A line or arc of the contour, and how far along it begins and ends."""

    number: int
    way: Way
    begins: float
    ends: float


@dataclass(slots=True)
class Doubt:
    """Two ways that cross: a neck, unless the contour is found to cross itself there, too."""

    old: Gone
    new: Gone
    at: complex
    near: list[Piece]  # of the contour, about the old one
    until: float  # along the contour, from where it can no longer cross itself there
    held: set[int] = field(default_factory=set)  # of _MOVED_MM, with which it does

    @property
    def meant(self) -> bool:
        return len(self.held) == len(_MOVED_MM)


class Cut:
    """The ways of one cut, as far back as they are looked at."""

    def __init__(self, radius: float) -> None:
        self._radius = radius
        # With the box that each stays within: most lie apart, and this is asked for every way.
        self._gone: deque[tuple[float, float, float, float, Gone]] = deque(maxlen=LOOKED_BACK)
        self._contour: deque[Piece] = deque(maxlen=LOOKED_BACK)
        self.doubts: list[Doubt] = []

    def lift(self) -> None:
        """What follows is another cut; the contour's next line or arc has been taken."""
        self._gone.clear()
        self._contour = deque([*self._contour][-1:], maxlen=LOOKED_BACK)

    def takes(self, number: int, contour: Way) -> None:
        """A line or arc of the contour, before its way is gone."""
        begins = self._contour[-1].ends if self._contour else 0.0
        piece = Piece(number, contour, begins, begins + contour.length)
        self._contour.append(piece)
        for doubt in self.doubts:
            self._look(doubt, piece)

    def goes(self, number: int, way: Way, low: float, high: float, line: int) -> list[Doubt]:
        """Go a way; what it crosses is doubted, unless the contour crosses itself there, too."""
        new = Gone(number, way, low, high, line)
        x, y, to_x, to_y = way.box()
        near = [g for a, b, c, d, g in self._gone if a <= to_x and x <= c and b <= to_y and y <= d]
        self._gone.append((x, y, to_x, to_y, new))
        found = [
            self._doubt(old, new, point)
            for old in near
            if old.high >= new.low and new.high >= old.low
            for point in crossings(old.way, way, INSIDE_MM, SLANTED)
        ]
        found = [doubt for doubt in found if not doubt.meant]
        self.doubts += found
        return found

    def settled(self, at_end: bool) -> Doubt | None:
        """The first neck that is one for sure; those that are none are doubted no more."""
        self.doubts = [doubt for doubt in self.doubts if not doubt.meant]
        far = self._contour[-1].begins if self._contour else 0.0
        return next((doubt for doubt in self.doubts if at_end or doubt.until < far), None)

    def _doubt(self, old: Gone, new: Gone, at: complex) -> Doubt:
        latest = self._near(new.number)
        until = max((piece.ends for piece in latest if piece.number <= new.number), default=0.0)
        doubt = Doubt(old, new, at, self._near(old.number), until + REACH * self._radius)
        for piece in latest:
            self._look(doubt, piece)
        return doubt

    def _near(self, number: int) -> list[Piece]:
        """Of the contour: a piece of this number with its neighbours, and those within reach."""
        here = [piece for piece in self._contour if abs(piece.number - number) <= 1]
        if not here:
            return here
        low, high = here[0].begins, here[-1].ends
        reach = REACH * self._radius
        return [
            piece for piece in self._contour if piece.ends >= low - reach and piece.begins <= high + reach
        ]

    def _look(self, doubt: Doubt, piece: Piece) -> None:
        """Whether the contour crosses itself with this piece."""
        turns = _turns(doubt.old.way, doubt.new.way, doubt.at)
        for k, by in enumerate(_MOVED_MM):
            moved = _moved(piece.way, by) if k not in doubt.held else None
            for other in doubt.near if moved is not None else ():
                if abs(other.number - piece.number) < 2 or moved is None:
                    continue
                for point in crossings(other.way, moved, -ROUNDING, 0.0):
                    beside = abs(point - doubt.at) < BESIDE * self._radius
                    if beside or _turns(other.way, moved, point) == turns:
                        doubt.held.add(k)


def crossings(one: Way, two: Way, inside: float, slanted: float) -> Iterator[complex]:
    """Where two ways cross, so far from their ends; ``slanted``: sine of the least angle."""
    for point in meetings(one, two):
        within = all(inside < way.ahead(point) < way.length - inside for way in (one, two))
        if within and abs(_sine(one, two, point)) > slanted:
            yield point


def _sine(one: Way, two: Way, point: complex) -> float:
    return (one.heading(point).conjugate() * two.heading(point)).imag


def _turns(one: Way, two: Way, point: complex) -> bool:
    """Whether the second comes across the first to its left."""
    return _sine(one, two, point) > 0.0


def _moved(way: Way, by: complex) -> Way:
    if way.centre is None:
        return line(way.start + by, way.end + by, 0.0)
    return arc(way.start + by, way.end + by, way.centre + by, way.sweep, 0.0)
