"""The circle that the words of a G2 or G3 mean; points lie in the plane, from its start."""

from __future__ import annotations

import math
from typing import NamedTuple

from controller.messages import message, text

ROUND_MM = 0.005  # by which R may be too small for its end (rounded words)
# By which start and end may differ in their distance from a centre, as LinuxCNC has it: what words of
# two decimals give away in mm, or this share of the radius, up to ``arc_tolerance_mm``.
ARC_ROUND_MM = 0.02 * math.sqrt(2.0)
ARC_SHARE = 0.001
SAME_MM = 1e-6  # ends of an arc nearer than this are one point: a full circle

Point = tuple[float, float]


class NoCircleError(ValueError):
    """Why the words make no arc."""

    def __init__(self, key: str, **values: float) -> None:
        self.said = message(key, **values)
        super().__init__(text(self.said))


class Circle(NamedTuple):
    """From the start about ``centre``; ``drift`` carries its end to the programmed one, along the radius."""

    centre: Point
    sweep: float  # rad, positive; all turns
    drift: Point


def meant(
    centre: Point | None, radius: float | None, chord: Point, way: float, turns: int, most_mm: float
) -> Circle:
    """The circle of an arc to ``chord``, ``way`` 1 counter-clockwise, by its centre or its radius.

    ``most_mm``: by which its ends may differ in their distance from the centre. Raises NoCircleError.
    """
    found = _of_radius(radius or 0.0, chord, way) if centre is None else _of_centre(centre, chord, most_mm)
    return _fitted(found, chord, way, max(turns, 1) - 1)


def _sweep(centre: Point, chord: Point, way: float) -> float:
    """Angle from start to end in the sense of ``way``; a full turn where both are in one direction."""
    if math.hypot(*chord) < SAME_MM:
        return 2.0 * math.pi
    start = math.atan2(-centre[1], -centre[0])
    end = math.atan2(chord[1] - centre[1], chord[0] - centre[0])
    angle = (way * (end - start)) % (2.0 * math.pi)
    return angle if angle * math.hypot(*centre) >= SAME_MM else 2.0 * math.pi


def _fitted(centre: Point, chord: Point, way: float, turns: int) -> Circle:
    """The arc about ``centre`` that ends on the end of ``chord``.

    The centre is moved between the ends; on more than half a turn, where that would carry the arc
    away, and far where the ends lie near each other, it drifts along its radius instead.
    """
    sweep, size = _sweep(centre, chord, way) + 2.0 * math.pi * turns, math.hypot(*chord)
    if size < SAME_MM:
        return Circle(centre, sweep, (0.0, 0.0))
    if sweep > math.pi and math.hypot(chord[0] - centre[0], chord[1] - centre[1]) > SAME_MM:
        return Circle(centre, sweep, _drift(centre, chord))
    centre = _between(centre, chord)
    return Circle(centre, _sweep(centre, chord, way) + 2.0 * math.pi * turns, (0.0, 0.0))


def _between(centre: Point, chord: Point) -> Point:
    """The nearest centre that is as far from one end as from the other."""
    (x, y), size = centre, math.hypot(*chord)
    along = (x * chord[0] + y * chord[1]) / size - size / 2.0
    return x - along * chord[0] / size, y - along * chord[1] / size


def _drift(centre: Point, chord: Point) -> Point:
    """From the circle's end to the programmed one, along the radius."""
    x, y = chord[0] - centre[0], chord[1] - centre[1]
    share = 1.0 - math.hypot(*centre) / math.hypot(x, y)
    return x * share, y * share


def _of_centre(centre: Point, chord: Point, most_mm: float) -> Point:
    """A centre that fits the end."""
    x, y = centre
    start, end = math.hypot(x, y), math.hypot(chord[0] - x, chord[1] - y)
    if start < SAME_MM:
        raise NoCircleError("arc.centre_is_start")
    allowed = min(most_mm, max(ARC_ROUND_MM, ARC_SHARE * max(start, end)))
    if abs(start - end) > allowed:
        raise NoCircleError("arc.two_radii", start=start, end=end, allowed=allowed)
    return centre


def _of_radius(radius: float, chord: Point, way: float) -> Point:
    """R form: of the two centres the one of the short way (R > 0) or the long way (R < 0)."""
    size = math.hypot(*chord)
    if size < SAME_MM:
        raise NoCircleError("arc.full_with_radius")
    if size / 2.0 > abs(radius) + ROUND_MM:
        raise NoCircleError("arc.out_of_reach", radius=abs(radius), away=size)
    height = math.sqrt(max(0.0, radius * radius - size * size / 4.0))
    height *= way * math.copysign(1.0, radius)  # the centre of a short way round lies on this side
    return chord[0] / 2.0 - height * chord[1] / size, chord[1] / 2.0 + height * chord[0] / size
