"""Drives set up at random: mechanics, units, polarity and delivered values, and what they physically mean.

Sizes of units are worked out here from the mechanics (CiA 402-2, factor group; CiA 303-2), in mm or degrees
of the axis, never by ``drives``.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass

from support.drives.axis_in_units import Axis, Mechanics, Sheet

REV, INC, METRE, DEGREE, RADIAN = 0xB4, 0xB5, 0x01, 0x41, 0x10
PER_MINUTE, PER_SECOND, SQUARE_SECOND = 0x47, 0x03, 0x57
MOST = 0xFFFF_FFFF
FASTEST_REV_MIN = 6000.0
DELIVERED = (0x6085, 0x6084, 0x60C5, 0x60C6, 0x607F)


def word(exponent: int, numerator: int, denominator: int = 0) -> int:
    """An SI unit as 60A8h, 60A9h and 60AAh have it."""
    return (exponent & 0xFF) << 24 | numerator << 16 | denominator << 8


@dataclass(frozen=True)
class Drive:
    """One drive, and what commissioning should make of it."""

    mechanics: Mechanics
    axis: Axis
    sheet: Sheet
    velocity_unit: float | None  # mm/s or degrees/s in one of its units; None: nobody knows
    acceleration_unit: float | None
    switches: tuple[float, float]  # mm or degrees from where it is switched on
    told: str  # for people
    sound: bool  # nothing is wrong with it: it must not be refused


def any_drive(seed: int, faults: bool = True) -> Drive:
    """As chance has it; ``faults``: also such as must be refused."""
    chance = random.Random(seed)
    while True:
        made = _Source(chance, faults).drive()
        fine = abs(made.axis.counts) * made.axis.velocity * 0.002  # counts in a tick
        if fine > 200.0 and abs(made.axis.counts) < 1e7:
            return made


class _Source:
    def __init__(self, chance: random.Random, faults: bool) -> None:
        self.chance, self.faults = chance, faults
        self.sheet = Sheet()
        self.sound = True
        self.told: list[str] = []

    def drive(self) -> Drive:
        chance = self.chance
        self.epos = chance.random() < 0.2
        rotary = chance.random() < 0.3
        increments = chance.choice([2000, 4096] if self.epos else [2000, 4096, 10_000, 65_536, 1 << 20])
        gear = chance.choice([(1, 1), (1, 1), (3, 1), (10, 1), (7, 3), (50, 1)])
        lead = chance.choice([360.0, 90.0, 12.0] if rotary else [2.0, 5.0, 10.0, 25.4])
        self.mechanics = Mechanics(increments, gear, lead, rotary)
        self.counts = self._positions()
        velocity, acceleration = self._velocity(), self._acceleration()
        self.fastest = min(300.0, FASTEST_REV_MIN / 60.0 * self.mechanics.per_turn * chance.uniform(0.3, 1.0))
        polarity = chance.choice([*[0] * 6, *[0xC0] * 6, 0x80, 0x40] if self.faults else [0, 0xC0])
        self.set(0x607E, 0, polarity)
        if polarity in (0x80, 0x40):
            self.spoil(f"polarity {polarity:02X}h")
        self._delivered()
        axis, switches = self._axis(-1 if chance.random() < 0.5 else 1)
        told = ", ".join([f"{self.mechanics}", *self.told])
        self._fits(axis, velocity, acceleration)
        self._turns(axis, velocity)
        return Drive(self.mechanics, axis, self.sheet, velocity, acceleration, switches, told, self.sound)

    def set(self, index: int, sub: int, value: int) -> None:
        self.sheet.values[index, sub] = value
        self.told.append(f"{index:04X}h:{sub:02X} = {value:X}h")

    def spoil(self, why: str) -> None:
        self.sound = False
        self.told.append(f"({why})")

    # -- positions

    def _positions(self) -> float:
        """Position units per mm or degree."""
        made, chance = self.mechanics, self.chance
        self._encoder()
        how = (
            "plain"
            if self.epos
            else chance.choice(["plain", "plain", "feed", "feed", "si", "turns", "increments"])
        )
        self.how = how
        if how == "plain":
            self.feed_there = self._no_feed()
            if self.epos:
                self.set(0x60A8, 0, word(0, INC))
            return 1.0 / made.per_increment
        if how == "increments":
            exponent = chance.choice([0, 0, 1])
            self.feed_there = self._no_feed()
            self.set(0x60A8, 0, word(exponent, INC))
            return 10.0**-exponent / made.per_increment
        self._gear()
        if how == "turns":
            exponent = chance.choice([-6, -5, -4])
            self.feed_there = self._no_feed()
            self.set(0x60A8, 0, word(exponent, REV))
            return 10.0**-exponent / made.per_turn
        if how == "si":
            exponent = chance.choice([-4, -5]) if made.rotary else chance.choice([-6, -7, -8])
            counts = 10.0**-exponent * (1.0 if made.rotary else 1e-3)
            self.set(0x60A8, 0, word(exponent, DEGREE if made.rotary else METRE))
        else:
            counts = float(chance.choice([1000, 10_000, 12_500, 200_000]))
        shafts = chance.choice([1, 5, 10])
        self.set(0x6092, 1, round(made.lead * counts * shafts))
        self.set(0x6092, 2, shafts)
        return round(made.lead * counts * shafts) / made.lead / shafts

    def _no_feed(self) -> bool:
        """Nobody has set 6092h, or it is not there at all."""
        if self.epos or self.chance.random() < 0.7:
            self.sheet.missing.add(0x6092)
            return False
        return True

    def _gear(self) -> None:
        motor, shaft = self.mechanics.gear
        times = self.chance.choice([1, 2, 7])
        self.set(0x6091, 1, motor * times)
        self.set(0x6091, 2, shaft * times)

    def _encoder(self) -> None:
        increments, chance = self.mechanics.increments, self.chance
        if self.epos:
            self.sheet.missing.add(0x608F)
            if increments == 2000:
                self.sheet.added |= {(0x3000, 5): 0, (0x3010, 1): 500}
            else:
                self.sheet.added |= {(0x3000, 5): increments}
            self.told.append(f"EPOS4 with {increments}")
            return
        turns = chance.choice([1, 1, 4])
        self.set(0x608F, 1, increments * turns)
        self.set(0x608F, 2, turns)
        self.set(0x6090, 1, chance.choice([1, 60, increments]))

    # -- units

    def _velocity(self) -> float | None:
        made, chance = self.mechanics, self.chance
        kinds = [
            "none",
            "rpm",
            "rpm",
            "rps",
            "increments",
            "metre",
            "factor",
            "unknown" if self.faults else "rpm",
        ]
        kind = "rpm" if self.epos else chance.choice(kinds)
        exponent = chance.choice([0, 0, -1, -3, -6])
        self.said = True
        if kind in ("none", "factor"):
            self.said = False
            factor = 1.0
            if kind == "factor":
                above, below = chance.choice([(60, made.increments), (1, 10), (100, 7)])
                self.set(0x6096, 1, above)
                self.set(0x6096, 2, below)
                factor = above / below
            return 1.0 / factor / self.counts
        if kind == "rpm":
            self.set(0x60A9, 0, word(exponent, REV, PER_MINUTE))
            return self._turn(10.0**exponent / 60.0)
        if kind == "rps":
            exponent = min(exponent, -1)
            self.set(0x60A9, 0, word(exponent, REV, PER_SECOND))
            return self._turn(10.0**exponent)
        if kind == "increments":
            self.set(0x60A9, 0, word(0, INC, PER_SECOND))
            return made.per_increment
        if kind == "metre":
            exponent = chance.choice([-2, -3]) if made.rotary else chance.choice([-4, -5, -6])
            self.set(0x60A9, 0, word(exponent, DEGREE if made.rotary else METRE, PER_SECOND))
            return 10.0**exponent * (1.0 if made.rotary else 1e3)
        unit = chance.choice([word(0, 0xFF, PER_SECOND), word(0, REV, 0xFF), word(0, 0x22, PER_SECOND)])
        self.set(0x60A9, 0, unit)
        self.spoil("unit unknown")
        return None

    def _turn(self, share: float) -> float:
        if self.feed_there:
            self.spoil("6092h is 1: is a position unit a turn?")
        return share * self.mechanics.per_turn

    feed_there = False

    def _acceleration(self) -> float | None:
        made, chance = self.mechanics, self.chance
        kind = (
            "rpm/s"
            if self.epos
            else chance.choice(["none", "none", "rpm/s", "rps2", "increments", "metre", "factor"])
        )
        if kind == "rpm/s":
            self.set(0x60AA, 0, word(0, 0xC0, PER_SECOND))
            return self._turn(1.0 / 60.0)
        if kind == "rps2":
            exponent = chance.choice([-1, -3])
            self.set(0x60AA, 0, word(exponent, REV, SQUARE_SECOND))
            return self._turn(10.0**exponent)
        if kind == "increments":
            self.set(0x60AA, 0, word(0, INC, SQUARE_SECOND))
            return made.per_increment
        if kind == "metre":
            self.set(0x60AA, 0, word(-3, DEGREE if made.rotary else METRE, SQUARE_SECOND))
            return 1e-3 * (1.0 if made.rotary else 1e3)
        if kind == "factor" and not self.said:
            above, below = chance.choice([(1, 100), (60, made.increments)])
            self.set(0x6097, 1, above)
            self.set(0x6097, 2, below)
            return below / above / self.counts
        return None if self.said else 1.0 / self.counts

    def _fits(self, axis: Axis, velocity: float | None, acceleration: float | None) -> None:
        """What an object with 32 bits can tell in whole units."""
        if velocity is None:
            return
        acceleration = acceleration or velocity
        texts = " ".join([axis.homing, *axis.extra])
        speeds = [axis.velocity, *map(float, re.findall(r"(?:fast|slow)\w* = ([\d.]+)", texts))]
        rates = [axis.acceleration, *map(float, re.findall(r"(?:acceleration|stop)\w* = ([\d.]+)", texts))]
        for wanted, unit in [(v, velocity) for v in speeds] + [(a, acceleration) for a in rates]:
            if wanted / unit < 4.0:
                self.spoil("coarse units")
            if wanted / unit > 2.0**31 / 1.3:
                self.spoil("fine units")

    def _turns(self, axis: Axis, velocity: float | None) -> None:
        """6080h: the motor's largest speed, in 1/min or in the drive's unit."""
        most = self.sheet.values.get((0x6080, 0), MOST)
        unit = max(self.mechanics.per_turn / 60.0, (velocity or 0.0) if self.said else 0.0)
        if most * unit < axis.velocity:
            self.spoil("the motor is too slow")

    # -- as delivered

    def _delivered(self) -> None:
        chance = self.chance
        for index in DELIVERED:
            self.set(index, 0, chance.choice([MOST, round(10.0 ** chance.uniform(0.0, 9.5))]))
        self.set(0x6099, 1, round(10.0 ** chance.uniform(0.0, 8.0)))
        self.set(0x6099, 2, round(10.0 ** chance.uniform(0.0, 8.0)))
        self.set(0x609A, 0, round(10.0 ** chance.uniform(0.0, 9.0)))
        self.set(0x6080, 0, chance.choice([MOST, 3000, 50_000]))
        if not self.faults or chance.random() < 0.5:
            return
        index = chance.choice([0x6085, 0x6085, 0x6084, 0x60C5, 0x60C6, 0x607F, 0x6080])
        kind = chance.choice(["fixed", "range", "refusing", "missing"])
        if kind == "range":
            self.sheet.ranges[index] = (1, self.sheet.values[index, 0])
        else:
            getattr(self.sheet, kind).add(index)
        if kind == "missing":
            del self.sheet.values[index, 0]
        self.spoil(f"{index:04X}h {kind}")

    def _axis(self, sign: int) -> tuple[Axis, tuple[float, float]]:
        chance, unit = self.chance, "deg" if self.mechanics.rotary else "mm"
        velocity = round(self.fastest, 3)
        acceleration = round(velocity * chance.choice([5.0, 10.0, 20.0]), 3)
        home, extra = "method = 37", []
        if chance.random() < 0.4:
            # one and the same switch, whatever the drive counts
            method = chance.choice([17, 18])
            fast, slow = round(velocity * 0.3, 3), round(velocity * 0.05, 3)
            home = (
                f"method = {method}, fast_{unit}_s = {fast}, slow_{unit}_s = {slow},"
                f" acceleration_{unit}_s2 = {round(acceleration * 0.5, 3)}"
            )
        if chance.random() < 0.5:
            extra.append("feed_forward = true")
        if chance.random() < 0.3:
            extra.append(f"quick_stop_{unit}_s2 = {round(acceleration * chance.choice([0.5, 1.5, 4.0]), 3)}")
        general = ("max_quick_stop_s = 15.0",) if chance.random() < 0.3 else ()
        profile = "maxon_epos4" if self.epos else "generic"
        way = 0.3 * velocity
        self.told += [home, *extra, f"counts {sign * self.counts:g}", f"velocity {velocity}"]
        axis = Axis(sign * self.counts, velocity, acceleration, home, tuple(extra), general, profile)
        return axis, (-way, way)
