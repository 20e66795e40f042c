"""Whether the cutter's way crosses one that it has gone: then it cuts what it has left standing before.

Neighbours of a contour are looked at where they meet (``corners``). What is looked for here is a neck
that is narrower than the cutter: the ways cross, and the contour does not. A contour that crosses itself
is meant so. Looked back over is one cut, from where the cutter comes down to where it is lifted.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from controller.program.contour.ways import Way, meetings

LOOKED_BACK = 200  # ways, arcs around corners among them
INSIDE_MM = 1e-5  # from the end of a way; what meets there is a corner
SLANTED = 0.01  # sine of the least angle; ways that run along each other do not cross


@dataclass(slots=True)
class Gone:
    """A way that the cutter goes."""

    number: int  # of the contour's line or arc, counted along it
    way: Way
    low: float  # along the normal of the plane
    high: float
    line: int  # of the program


class Cut:
    """The ways of one cut, as far back as they are looked at."""

    def __init__(self) -> None:
        # With the box that each stays within: most lie apart, and this is asked for every way.
        self._gone: deque[tuple[float, float, float, float, Gone]] = deque(maxlen=LOOKED_BACK)
        self._contour: deque[tuple[int, Way]] = deque(maxlen=LOOKED_BACK)

    def lift(self) -> None:
        """What follows is another cut; the contour's next line or arc has been taken."""
        self._gone.clear()
        self._contour = deque([*self._contour][-1:], maxlen=LOOKED_BACK)

    def takes(self, number: int, contour: Way) -> None:
        """A line or arc of the contour, before its way is gone."""
        self._contour.append((number, contour))

    def goes(self, number: int, way: Way, low: float, high: float, line: int) -> Gone | None:
        """Go a way; the one it crosses, if the contour does not cross itself there, too."""
        new = Gone(number, way, low, high, line)
        x, y, to_x, to_y = way.box()
        near = [g for a, b, c, d, g in self._gone if a <= to_x and x <= c and b <= to_y and y <= d]
        self._gone.append((x, y, to_x, to_y, new))
        return next((old for old in near if self._crossed(old, new)), None)

    def _crossed(self, old: Gone, new: Gone) -> bool:
        if old.high < new.low or new.high < old.low or not cross(old.way, new.way):
            return False
        return not self._meant(old.number, new.number)

    def _meant(self, one: int, two: int) -> bool:
        """Whether the contour crosses itself about there."""
        near = [[way for n, way in self._contour if abs(n - at) <= 1] for at in (one, two)]
        return any(a is not b and cross(a, b) for a in near[0] for b in near[1])


def cross(one: Way, two: Way) -> bool:
    """Whether two ways cross, away from their ends."""
    return any(
        _within(one, point)
        and _within(two, point)
        and abs((one.heading(point).conjugate() * two.heading(point)).imag) > SLANTED
        for point in meetings(one, two)
    )


def _within(way: Way, point: complex) -> bool:
    ahead = way.ahead(point)
    return INSIDE_MM < ahead < way.length - INSIDE_MM
