"""Where the ways beside two neighbours of a contour join: on an arc around it, or cut short."""

from __future__ import annotations

import cmath
import math

from controller.geometry.vectors import ROUNDING
from controller.program.contour.ways import Way, meetings, unit

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
