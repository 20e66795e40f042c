"""Homing of a simulated drive (CiA 402-2, mode 6): every method is one edge, crossed one way.

    1, 2      limit switch, then index        17, 18   limit switch
    3 .. 14   home switch, then index         19 .. 30 home switch
    33, 34    next index below, above         35, 37   here and now

A switch is pressed in a window of positions; a limit switch's window has no far end.
Searching goes in three steps, whatever the method:

    fast until the switch is pressed ---> slowly across the edge, in the method's
    direction ---> (methods with index) slowly on to the next index pulse

An axis that meets a limit switch before the home switch turns round; one that meets
both, or moves on and on, ends with a homing error. At the homed point the actual
position becomes 607Ch. (Vendors differ in the sign of 607Ch; this is the reading of
maxon, Elmo and others: the value is the position.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from drives.bench.simulated.servo import Servo

HERE = (35, 37)
LEFT, RIGHT = 0, 1  # edges of the window in which a switch is pressed
NEGATIVE, POSITIVE, HOME = 0, 1, 2  # switches
# An axis that finds no switch within this many counts has none.
LONGEST_SEARCH = 2.0**32
SEARCH_S = 1.0  # that a search takes from where the axis of a machine was left
CAM_S = 0.05  # of the search, beyond twice its braking distance: so long is a cam


@dataclass(frozen=True, slots=True)
class Method:
    """``first``: direction of the search; ``edge`` of ``switch`` crossed in ``direction``."""

    switch: int
    edge: int
    direction: int
    first: int
    index: bool

    def mirrored(self) -> Method:
        """The same for a motor that counts the other way (607Eh)."""
        switch = {NEGATIVE: POSITIVE, POSITIVE: NEGATIVE}.get(self.switch, self.switch)
        edge = LEFT if self.edge == RIGHT else RIGHT
        return Method(switch, edge, -self.direction, -self.first, self.index)


# Of a vendor (maxon): the end stop, felt by its current, in place of the limit switch.
END_STOPS = {-1: 2, -2: 1, -3: 18, -4: 17}


def _table() -> dict[int, Method]:
    made = {
        17: Method(NEGATIVE, RIGHT, +1, -1, False),
        18: Method(POSITIVE, LEFT, -1, +1, False),
        33: Method(HOME, LEFT, -1, -1, True),  # no edge: index only
        34: Method(HOME, LEFT, +1, +1, True),
    }
    rows = (
        (3, LEFT, -1, +1),
        (4, LEFT, +1, +1),
        (5, RIGHT, +1, -1),
        (6, RIGHT, -1, -1),
        (7, LEFT, -1, +1),
        (8, LEFT, +1, +1),
        (9, RIGHT, -1, +1),
        (10, RIGHT, +1, +1),
        (11, RIGHT, +1, -1),
        (12, RIGHT, -1, -1),
        (13, LEFT, +1, -1),
        (14, LEFT, -1, -1),
    )
    for number, edge, direction, first in rows:
        made[number] = Method(HOME, edge, direction, first, True)
        made[number + 16] = Method(HOME, edge, direction, first, False)
    made[1] = Method(NEGATIVE, RIGHT, +1, -1, True)
    made[2] = Method(POSITIVE, LEFT, -1, +1, True)
    made |= {vendor: made[like] for vendor, like in END_STOPS.items()}
    return made


METHODS = _table()
INDEX_ONLY = (33, 34)
ONE_EDGED = (3, 4, 5, 6, 19, 20, 21, 22)  # their switch is pressed from its edge to the end of the travel
KNOWN = frozenset(METHODS) - frozenset(END_STOPS) | frozenset(HERE)


@dataclass(frozen=True, slots=True)
class Ground:
    """Where switches and index pulses are, in the drive's present counting."""

    windows: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    index_counts: float
    index_offset: float

    def pressed(self, switch: int, position: float) -> bool:
        """A limit switch is pressed on its edge, too."""
        low, high = self.windows[switch]
        return low <= position <= high

    def next_index(self, position: float, direction: int) -> float:
        turns = (position - self.index_offset) / self.index_counts
        whole = math.floor(turns) + 1 if direction > 0 else math.ceil(turns) - 1
        return self.index_offset + whole * self.index_counts


@dataclass(frozen=True, slots=True)
class Pace:
    """How a homing run moves: counts/s, counts/s^2."""

    fast: float
    slow: float
    acceleration: float


@dataclass(frozen=True, slots=True)
class Site:
    """Where an axis was left at power-on, and where its switches and one index pulse are (position units)."""

    stand: float
    limits: tuple[float, float]
    home: tuple[float, float]
    index: float


def site(number: int, point: float, travel: tuple[float, float], pace: Pace, index: float) -> Site:
    """An axis on which a method with a switch ends at ``point`` of its ``travel`` (position units, as homed).

    It was left so far off that the search takes ``SEARCH_S``; ``index``: from one pulse to the next.
    A cam is longer than the braking distance of the search, as it must be on a machine.
    """
    method, (low, high) = METHODS[number], travel
    cam = pace.fast * (pace.fast / pace.acceleration + CAM_S) if pace.acceleration else 0.0
    edge = point - method.direction * index / 4.0 if method.index else point
    off = min(SEARCH_S * pace.fast, (high - low) / 4.0)
    stand = edge - method.first * off
    if method.switch == HOME and not low <= stand <= high:
        stand = edge + method.first * off
    limits = (
        edge if method.switch == NEGATIVE else low - cam,
        edge if method.switch == POSITIVE else high + cam,
    )
    far = math.inf if number in ONE_EDGED else cam
    home = (edge, edge + far) if method.edge == LEFT else (edge - far, edge)
    return Site(stand, limits, home, point)


class Phase(Enum):
    SEEK = auto()  # the switch
    ENTER = auto()  # through the switch's window to the side from which the edge is crossed
    CROSS = auto()  # the edge
    INDEX = auto()
    STOP = auto()
    DONE = auto()


class Search:
    """A homing run; ``demand`` is one value per period, one of the two ends is called once."""

    def __init__(
        self,
        number: int,
        servo: Servo,
        ground: Ground,
        pace: Pace,
        period_s: float,
        found: Callable[[float], None],
        failed: Callable[[], None],
        inverted: bool = False,
    ) -> None:
        self._method = METHODS[number].mirrored() if inverted else METHODS[number]
        self._servo = servo
        self._ground = ground
        self._pace = pace
        self._period_s = period_s
        self._found = found
        self._failed = failed
        self._speed = 0.0
        self._begun = servo.position
        self._way = self._method.first
        self._turned = False
        self._point: float | None = None  # the homed point, once known
        self._phase = Phase.INDEX if number in INDEX_ONLY else Phase.SEEK
        if self._phase is Phase.INDEX:
            self._point = ground.next_index(servo.position, self._method.direction)

    def demand(self) -> float:
        """The demand for the end of the next period."""
        self._look()
        change = self._pace.acceleration * self._period_s
        self._speed += max(-change, min(change, self._target_speed() - self._speed))
        return self._servo.end + self._speed * self._period_s

    def _target_speed(self) -> float:
        method, pace = self._method, self._pace
        if self._phase is Phase.SEEK:
            return pace.fast * self._way
        if self._phase is Phase.ENTER:
            return -pace.slow * method.direction
        if self._phase in (Phase.CROSS, Phase.INDEX):
            return pace.slow * method.direction
        return 0.0

    def _look(self) -> None:
        """Go on to the next phase when this one has reached its end."""
        pressed = self._ground.pressed(self._method.switch, self._servo.position)
        if self._phase is Phase.SEEK:
            self._seek(pressed)
        elif self._phase is Phase.ENTER and not pressed and self._speed * self._method.direction < 0.0:
            self._phase = Phase.CROSS
        elif self._phase is Phase.CROSS and self._crossed(pressed):
            self._cross()
        elif self._phase is Phase.INDEX and self._beyond():
            self._phase = Phase.STOP
        elif self._phase is Phase.STOP and self._speed == 0.0 and self._settled():
            self._finish()
        if abs(self._servo.position - self._begun) > LONGEST_SEARCH:
            self._lose()

    def _seek(self, pressed: bool) -> None:
        if pressed:
            self._phase = Phase.CROSS if self._leaves() else Phase.ENTER
        elif self._method.switch == HOME:
            end = POSITIVE if self._way > 0 else NEGATIVE
            if self._ground.pressed(end, self._servo.position):
                self._turn()

    def _turn(self) -> None:
        """At the end of the travel without the home switch: the other way, once."""
        if self._turned:
            self._lose()
        self._turned = True
        self._way = -self._way

    def _leaves(self) -> bool:
        """Whether the edge is crossed from inside of the window to outside."""
        return self._method.direction == (-1 if self._method.edge == LEFT else +1)

    def _crossed(self, pressed: bool) -> bool:
        moving = self._speed * self._method.direction > 0.0
        return moving and pressed != self._leaves()

    def _cross(self) -> None:
        edge = self._ground.windows[self._method.switch][self._method.edge]
        self._point = edge
        self._phase = Phase.STOP
        if self._method.index:
            self._point = self._ground.next_index(edge, self._method.direction)
            self._phase = Phase.INDEX

    def _beyond(self) -> bool:
        assert self._point is not None
        return (self._servo.position - self._point) * self._method.direction >= 0.0

    def _settled(self) -> bool:
        return abs(self._servo.end - self._servo.position) < 1.0

    def _finish(self) -> None:
        self._phase = Phase.DONE
        if self._point is None:
            self._failed()
        else:
            self._found(self._point)

    def _lose(self) -> None:
        if self._phase not in (Phase.STOP, Phase.DONE):
            self._point = None
            self._phase = Phase.STOP
