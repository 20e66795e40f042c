"""In which units a drive takes speeds and accelerations, from what it says of them (CiA 402-2, CiA 303-2).

Positions are in the drive's position units, which the machine file calls counts. With the objects of
CiA 402-2, "factor group":

    position = increments x feed constant (6092h) / (encoder resolution (608Fh) x gear ratio (6091h))
    velocity = d position / dt x velocity factor (6096h)         where 60A9h does not say otherwise

so a revolution of the motor is 6092h / 6091h counts, whatever the encoder has: 608Fh counts only where there
is no feed constant, or where 60A8h says that positions are increments, and 6090h cancels out. SI units
(60A8h, 60A9h, 60AAh) are

    31 ... 24 exponent   23 ... 16 numerator   15 ... 8 denominator   7 ... 0 reserved

What is meant is, in this order: the machine file's own word, which 60A9h must not contradict; 60A9h and
60AAh (without the latter, velocity units per second); the profile's; 6096h and 6097h on counts.
Inverted polarity (607Eh) inverts targets and actual positions alike inside of the drive, so counts are what
they are; the sign of the machine file's counts belongs to it. It is read, never written. Its bits 7
(position) and 6 (velocity) must agree, or velocity feed-forward had the wrong sign.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from drives.settings import INT32_MAX, NodeSettings, SpindleSettings
from drives.texts import Key, Message, TextError, message, several

# An object's value; None: the drive has no such object.
Read = Callable[[int, int], int | None]

# CiA 303-2, and C0h as makers use it for accelerations: revolutions per minute.
METRE, RADIAN, DEGREE, REVOLUTION, INCREMENT, REV_MIN = 0x01, 0x10, 0x41, 0xB4, 0xB5, 0xC0
PER_S = {0x03: 1.0, 0x47: 60.0, 0x48: 3600.0}  # second, minute, hour
PER_S2 = {0x57: 1.0, 0x58: 3600.0}  # their squares
ANGLES = {RADIAN: 1.0, DEGREE: math.pi / 180.0}

POLARITY, POSITION_BIT, VELOCITY_BIT = 0x607E, 1 << 7, 1 << 6
RESOLUTION, GEAR, FEED = 0x608F, 0x6091, 0x6092
VELOCITY_FACTOR, ACCELERATION_FACTOR = 0x6096, 0x6097
OLD_FACTORS = (0x6093, 0x6094)  # of CiA DSP 402 before version 2
SAME = 1e-6  # two units that differ by less are the same
FACTOR_SAME = 1e-3  # factors are ratios of integers, and rounded
SPEED, RATE = Key("unit.counts_s"), Key("unit.counts_s2")  # what values are told in


class UnitError(TextError):
    """A unit is not known, or a value cannot be told in it; the sentence names the object."""


@dataclass(frozen=True, slots=True)
class Units:
    """Sizes of the drive's units, in counts."""

    velocity_counts_s: float = 1.0
    acceleration_counts_s2: float = 1.0
    said: bool = False  # 60A9h says so: by some makers 6080h is in this unit, too
    inverted: bool = False  # 607Eh
    rev_min_counts_s: float = 0.0  # 1/min of the motor, as CiA 402-2 has 6080h, at most; 0 = nobody knows

    @property
    def motor_speeds_counts_s(self) -> tuple[float, ...]:
        """What one of 6080h may be: 1/min of the motor (CiA 402-2), or by some makers as 60A9h has it."""
        readings = (self.rev_min_counts_s, self.velocity_counts_s if self.said else 0.0)
        return tuple(unit for unit in readings if unit)

    def velocity(self, counts_s: float, where: Message) -> int:
        """A speed in the drive's units. Raises UnitError where none is near it."""
        return _nearest(counts_s, self.velocity_counts_s, where, SPEED)

    def acceleration(self, counts_s2: float, where: Message) -> int:
        """Likewise an acceleration."""
        return _nearest(counts_s2, self.acceleration_counts_s2, where, RATE)

    def see_fits(self, counts_s: float, where: Message) -> None:
        """Raises UnitError for a speed that no INTEGER32 takes in this unit."""
        if counts_s / self.velocity_counts_s > INT32_MAX:
            units, unit = counts_s / self.velocity_counts_s, self.velocity_counts_s
            raise UnitError(
                message("unit.too_fine", where=where, speed=counts_s, units=units, unit=unit, most=INT32_MAX)
            )


COARSEST = 0.25  # a value may be larger by this share than what is wanted, for want of a finer unit


def _nearest(wanted: float, unit: float, where: Message, name: Key) -> int:
    """Never 0, which many objects take for "none" or "as fast as it goes"; else less is safer than more."""
    exact = wanted / unit
    near = round(exact)
    if near > (1.0 + COARSEST) * exact:
        near = math.floor(exact)
    if near < 1:
        raise UnitError(message("unit.too_coarse", where=where, wanted=wanted, unit=unit, name=name))
    return near


class Si(NamedTuple):
    """An SI unit as 60A8h, 60A9h, 60AAh have it."""

    exponent: int
    numerator: int
    denominator: int

    @property
    def prefix(self) -> float:
        return float(10.0**self.exponent)


def si(word: int) -> Si:
    """The parts of an object's value."""
    exponent = word >> 24 & 0xFF
    return Si(exponent - 256 if exponent > 127 else exponent, word >> 16 & 0xFF, word >> 8 & 0xFF)


def counts_of(position: Si) -> tuple[str, float] | None:
    """The key of an axis that has its counts, and what a position in SI units makes of it."""
    if position.numerator == METRE:
        return "counts_per_mm", 1e-3 / position.prefix
    if position.numerator in ANGLES:
        return "counts_per_deg", math.radians(1.0) / (ANGLES[position.numerator] * position.prefix)
    return None


def units_of(settings: NodeSettings | SpindleSettings, read: Read) -> Units:
    """The units of a drive. Raises UnitError, and what ``read`` raises."""
    return _Reading(settings, read).units()


class _Reading:
    """One drive's objects, as far as they are needed."""

    def __init__(self, settings: NodeSettings | SpindleSettings, read: Read) -> None:
        self._settings = settings
        self._ask = read
        self._found: dict[tuple[int, int], int | None] = {}
        self._refused: list[Message] = []

    def _read(self, index: int, sub: int) -> int | None:
        """Asked for once."""
        if (index, sub) not in self._found:
            self._found[index, sub] = self._ask(index, sub)
        return self._found[index, sub]

    def units(self) -> Units:
        """Raises UnitError with all that is wrong."""
        inverted, sizes = False, (1.0, 1.0, False)
        with self._collected():
            inverted = self._inverted()
        with self._collected():
            self._see_position()
        with self._collected():
            sizes = self._sizes()
        if self._refused:
            first = [message("sentence", text=one) for one in self._refused[:-1]]
            raise UnitError(several(*first, self._refused[-1]))
        return Units(*sizes, inverted, self._rev_min())

    @contextmanager
    def _collected(self) -> Iterator[None]:
        """What is refused is one of several things."""
        try:
            yield
        except UnitError as error:
            self._refused.append(error.said)

    def _sizes(self) -> tuple[float, float, bool]:
        """Of velocity and acceleration, and whether 60A9h says the former."""
        told, own = self._declared_velocity(), self._own()
        if told is not None and own is not None and abs(told - own[0]) > SAME * own[0]:
            raise UnitError(message("unit.not_the_files", word=self._word(0x60A9), told=told, own=own[0]))
        if own is not None:
            return *own, told is not None
        velocity, acceleration = self._of_family() or self._of_factors()
        if told is not None:
            velocity = acceleration = told
        if word := self._word(0x60AA):
            acceleration = self._acceleration(word)
        if told is not None or word:
            self._see_factor(ACCELERATION_FACTOR, acceleration, 0x60AA)
        return velocity, acceleration, told is not None

    def _rev_min(self) -> float:
        """Counts per second of a motor that turns once a minute; 0 where nobody says it.

        A feed constant of 1 / 1 is one that nobody has set, or one of a unit per turn of the shaft: then
        it is the most that it can be, so that what is too slow by it is too slow by any reading.
        """
        try:
            return self._counts_per_turn(0x6080, 0) / 60.0
        except UnitError:
            either_way = self._position is None and self._ratio(FEED) == 1.0
            return self._resolution / 60.0 if either_way else 0.0

    # -- objects

    def _word(self, index: int) -> int:
        return self._read(index, 0) or 0

    def _ratio(self, index: int) -> float | None:
        """Two integers as one number; None where they are missing, or not set."""
        above = self._read(index, 1)
        below = self._read(index, 2) if above is not None else None
        if not above and not below:
            return None
        if not above or not below:
            raise UnitError(message("unit.no_ratio", index=index, above=str(above), below=str(below)))
        return above / below

    @property
    def _position(self) -> Si | None:
        word = self._word(0x60A8)
        return si(word) if word else None

    def _inverted(self) -> bool:
        polarity = self._word(POLARITY)
        position, velocity = bool(polarity & POSITION_BIT), bool(polarity & VELOCITY_BIT)
        if position != velocity and isinstance(self._settings, NodeSettings):
            what = Key("unit.position" if position else "unit.velocity")
            raise UnitError(message("unit.half_inverted", polarity=polarity, what=what))
        return velocity

    # -- what says it

    def _own(self) -> tuple[float, float] | None:
        velocity = self._settings.velocity_unit_counts_s
        return (velocity, self._settings.acceleration_unit_counts_s2 or velocity) if velocity else None

    def _of_family(self) -> tuple[float, float] | None:
        profile = self._settings.profile
        velocity = profile.velocity_unit_counts_s
        return (velocity, profile.acceleration_unit_counts_s2 or velocity) if velocity else None

    def _declared_velocity(self) -> float | None:
        """By 60A9h; what the machine file says itself need not be understood."""
        word = self._word(0x60A9)
        if not word:
            return None
        try:
            velocity = self._velocity(word)
        except UnitError:
            if self._own() is not None:
                return None
            raise
        self._see_factor(VELOCITY_FACTOR, velocity, 0x60A9)
        return velocity

    def _of_factors(self) -> tuple[float, float]:
        for index in OLD_FACTORS:
            if self._ratio(index) not in (None, 1.0):
                raise UnitError(message("unit.old_factor", index=index, factor=self._ratio(index)))
        velocity = self._ratio(VELOCITY_FACTOR) or 1.0
        acceleration = self._ratio(ACCELERATION_FACTOR) or 1.0
        return 1.0 / velocity, 1.0 / acceleration

    def _see_factor(self, index: int, unit: float, by: int) -> None:
        """A factor of 1 is one that nobody set."""
        factor = self._ratio(index) or 1.0
        if factor != 1.0 and abs(factor * unit - 1.0) > FACTOR_SAME:
            raise UnitError(
                message("unit.other_factor", index=index, factor=factor, size=1.0 / factor, by=by, unit=unit)
            )

    # -- SI units

    def _velocity(self, word: int) -> float:
        unit = si(word)
        if unit.denominator not in PER_S:
            raise self._unknown(0x60A9, word)
        return self._length(unit, 0x60A9, word) / PER_S[unit.denominator]

    def _acceleration(self, word: int) -> float:
        unit = si(word)
        if unit.numerator == REV_MIN and unit.denominator in PER_S:
            rev_min = self._length(unit._replace(numerator=REVOLUTION), 0x60AA, word) / 60.0
            return rev_min / PER_S[unit.denominator]
        if unit.denominator not in PER_S2:
            raise self._unknown(0x60AA, word)
        return self._length(unit, 0x60AA, word) / PER_S2[unit.denominator]

    def _length(self, unit: Si, index: int, word: int) -> float:
        """Counts in one unit of way. What the position itself is measured in needs no more than prefixes."""
        position = self._position
        if position is not None and position.numerator == unit.numerator:
            return unit.prefix / position.prefix
        if unit.numerator == INCREMENT:
            return unit.prefix * self._counts_per_increment(index, word)
        if unit.numerator == REVOLUTION:
            return unit.prefix * self._counts_per_turn(index, word) * self._turns
        if unit.numerator == METRE and self._per_si(rotary=False):
            return unit.prefix * self._per_si(rotary=False)
        if unit.numerator in ANGLES and self._per_si(rotary=True):
            return unit.prefix * ANGLES[unit.numerator] * self._per_si(rotary=True)
        raise self._unknown(index, word)

    def _unknown(self, index: int, word: int) -> UnitError:
        choice = Key("unit.known_rate" if index == 0x60AA else "unit.known_speed")
        return UnitError(message("unit.unknown", index=index, word=word, choice=choice))

    def _per_si(self, rotary: bool) -> float:
        """Counts per metre or radian of the axis; 0 = it is of the other kind, or nobody said."""
        node = self._settings
        return node.counts_per_si if isinstance(node, NodeSettings) and node.rotary is rotary else 0.0

    def _see_position(self) -> None:
        """A position in SI units leaves the machine file no choice."""
        unit = self._position
        if unit is None:
            return
        if self._own() is None:
            self._see_turn(unit)
        rotary = unit.numerator in ANGLES
        known = self._per_si(rotary) * (math.radians(1.0) if rotary else 1e-3)
        if (by := counts_of(unit)) is not None and known and abs(known / by[1] - 1.0) > SAME:
            facts = {"word": self._word(0x60A8), "name": by[0], "counts": by[1], "known": known}
            raise UnitError(message("unit.other_position", **facts))

    @property
    def _turns(self) -> float:
        """Of the motor, for one revolution that the family speaks of: the driving shaft's, or its own."""
        return (self._ratio(GEAR) or 1.0) if self._settings.profile.revolution == "shaft" else 1.0

    @property
    def _resolution(self) -> float:
        """Increments per turn of the motor; 0 = nobody says it."""
        resolution = self._ratio(RESOLUTION)
        return self._of_encoder() if resolution in (None, 1.0) else resolution or 0.0

    def _counts_per_increment(self, index: int, word: int) -> float:
        position, feed = self._position, self._ratio(FEED)
        if position is not None and position.numerator == INCREMENT:
            return 1.0 / position.prefix
        if position is None and feed in (None, 1.0):
            return 1.0
        if not self._resolution:
            raise self._no_turn(index, word, Key("unit.increments"))
        return self._counts_per_turn(index, word) / self._resolution

    def _counts_per_turn(self, index: int, word: int) -> float:
        """Of the motor."""
        feed, position = self._ratio(FEED), self._position
        if by := self._turn_by_feed() or (self._turn_by_position(position) if position is not None else 0.0):
            return by
        plain = position is None and (feed is None or self._ratio(RESOLUTION) in (None, 1.0))
        if plain and self._resolution:
            return self._resolution
        raise self._no_turn(index, word, Key("unit.revolutions"))

    def _turn_by_feed(self) -> float:
        feed = self._ratio(FEED)
        return 0.0 if feed in (None, 1.0) or not feed else feed / (self._ratio(GEAR) or 1.0)

    def _see_turn(self, position: Si) -> None:
        """What 60A8h says of a turn of the motor, and what the feed constant does, must agree."""
        by_feed, by_position = self._turn_by_feed(), self._turn_by_position(position)
        if by_feed and by_position and abs(by_feed / by_position - 1.0) > FACTOR_SAME:
            raise UnitError(
                message("unit.other_turn", word=self._word(0x60A8), counts=by_position, by_feed=by_feed)
            )

    def _turn_by_position(self, position: Si) -> float:
        """By 60A8h alone: positions are revolutions, or increments of the encoder."""
        if position.numerator == REVOLUTION:
            return 1.0 / position.prefix / self._turns
        return self._resolution / position.prefix if position.numerator == INCREMENT else 0.0

    def _no_turn(self, index: int, word: int, way: Key) -> UnitError:
        facts = {
            "way": way,
            "position": self._word(0x60A8),
            "feed": self._ratio(FEED) or Key("unit.not_there"),
        }
        facts |= {"resolution": self._read(RESOLUTION, 1) or Key("unit.not_there")}
        return UnitError(message("unit.no_turn", index=index, word=word, **facts))

    def _of_encoder(self) -> float:
        """The family's objects, the first that has a value; of a spindle without any, the machine file."""
        for entry in self._settings.profile.encoder_resolution:
            if value := self._read(entry.index, entry.sub):
                return float(value * entry.times)
        return 0.0 if isinstance(self._settings, NodeSettings) else abs(self._settings.counts_per_rev)
