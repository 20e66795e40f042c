"""Modes of operation of a simulated drive (CiA 402-2): what the demand follows, and three status bits.

    1 pp   to 607Ah by a profile        7 ip   60C1h, one position per SYNC
    3 pv   at 60FFh by a profile        8 csp  607Ah, one position per SYNC
    6 hm   homing, see homing.py        9 csv  60FFh, one speed per SYNC

A mode lives while it is selected. ``begin`` is called when the drive is enabled in it
or goes on after a stop, ``word`` when the controlword's upper bits change; ``bits``
are statusword bits 10, 12 and 13, asked for when something has changed.
"""

from __future__ import annotations

import math
from operator import itemgetter
from typing import ClassVar

from drives.bench.simulated.data_sheet import key
from drives.bench.simulated.homing import HERE, Pace, Search
from drives.bench.simulated.motion import Demand, Profile, Speed, ramp_down
from drives.bench.simulated.power_stage import PowerStage
from drives.settings import INT32_MAX, INT32_MIN

PP, PV, HOMING, IP, CSP, CSV = 1, 3, 6, 7, 8, 9
BIT_4, BIT_5, BIT_6, HALT = 1 << 4, 1 << 5, 1 << 6, 1 << 8
REACHED, BIT_12, BIT_13 = 1 << 10, 1 << 12, 1 << 13
ENDLESS = 0xFFFF_FFFF
UNLIMITED = 0xFFFF  # 6072h
OFFSETS = (0x60B0, 0x60B1, 0x60B2)
# What stands between target and demand of csp, of a dictionary's values.
_between = itemgetter(*(key(index) for index in (0x607F, 0x60C5, 0x60C6, *OFFSETS)))


class Mode:
    """No mode: the demand stands."""

    number: ClassVar[int] = 0
    cyclic: ClassVar[bool] = False  # the demand comes with every SYNC
    at_first: ClassVar[int] = 0  # of ``bits``

    def __init__(self, axis: PowerStage) -> None:
        self.axis = axis
        self.bits = self.at_first

    def begin(self) -> Demand | None:
        """The demand, period by period; None = the axis's target as it is."""
        return self.axis.hold

    def word(self, word: int, before: int) -> None:
        """Bits 4 .. 6 and 9 of the controlword have changed."""

    def set_bits(self, bits: int) -> None:
        if bits != self.bits:
            self.bits = bits
            self.axis.refresh()

    def profile(self, speed: float) -> Profile:
        """Acceleration and deceleration of profile motion within 60C5h and 60C6h; 0 is as good as none."""
        at, limit = self.axis.units.acceleration_at, self.axis.units.most_acceleration_at
        most = self.strongest
        up = min(most, at(0x6083) or ENDLESS, limit(0x60C5))
        down = min(most, at(0x6084) or ENDLESS, limit(0x60C6))
        return Profile(min(speed, self.fastest), up, down)

    @property
    def strongest(self) -> float:
        """Acceleration that the motor and 6072h (FFFFh = as much as it can) give."""
        nature, thousandths = self.axis.parameters, self.axis.dictionary.get(0x6072)
        limit = math.inf if thousandths == UNLIMITED else max(1, thousandths) * nature.torque_counts_s2
        return min(nature.most_acceleration, limit)

    @property
    def fastest(self) -> float:
        """Speed of profiles and of csv: 607Fh, and 6080h of the motor; 0 is none."""
        at = self.axis.units.speed_at
        return min(at(0x607F) or ENDLESS, at(0x6080) or ENDLESS)

    def turned(self, speed: float) -> float:
        """The demand one period on at a speed: within 607Dh, or for ever round where that is no limit."""
        axis = self.axis
        if axis.servo.limited:
            axis.servo.anchor()
        if axis.low != INT32_MIN or axis.high != INT32_MAX:
            return axis.bounded(axis.servo.end + speed * axis.period_s)
        if not INT32_MIN <= axis.servo.position <= INT32_MAX:
            axis.recount(-math.copysign(2.0**32, axis.servo.position))
        return axis.servo.end + speed * axis.period_s

    def lead(self) -> None:
        """Velocity and torque offset, 60B1h and 60B2h, act on the position loop."""
        axis = self.axis
        torque = axis.dictionary.get(0x60B2) * axis.parameters.torque_counts_s2
        axis.servo.offset(axis.units.velocity_at(0x60B1), math.copysign(torque, torque * axis.units.position))


class CyclicPosition(Mode):
    """csp. Bit 12: the target is followed."""

    number: ClassVar[int] = CSP
    cyclic: ClassVar[bool] = True
    at_first: ClassVar[int] = BIT_12

    def begin(self) -> Demand | None:
        self._speed = Speed(self.axis.servo, self.axis.period_s)
        self._before = self.axis.servo.end
        self._told: tuple[int, ...] = ()
        self._seen = -1  # of the dictionary's changes
        return self._limited if self.limits else None

    @property
    def limits(self) -> bool:
        """Whether anything stands between target and demand: 607Fh, 60C5h, 60C6h, 60B0h - 60B2h."""
        get = self.axis.dictionary.get
        endless = get(0x607F) == get(0x60C5) == get(0x60C6) == ENDLESS
        return not endless or self.axis.offsets_mapped or any(get(index) for index in OFFSETS)

    def _look(self) -> None:
        """Something has been written: what stands between target and demand may have been."""
        self._seen = self.axis.dictionary.changes
        if (told := _between(self.axis.dictionary.values)) != self._told:
            self._told = told
            self._take()

    def _take(self) -> None:
        units = self.axis.units
        limit = units.most_acceleration_at
        self._profile = profile = Profile(units.speed_at(0x607F) or ENDLESS, limit(0x60C5), limit(0x60C6))
        endless = profile.acceleration == profile.deceleration == math.inf
        self._most_at_once = profile.speed if endless else -1.0  # a speed that comes at once
        self._offset = units.position_at(0x60B0)
        self.lead()

    def _limited(self) -> float:
        axis = self.axis
        if axis.dictionary.changes != self._seen:
            self._look()
        aim, before, most = axis.target + self._offset, self._before, self._most_at_once
        stays = aim == before == axis.servo.end and axis.low <= aim <= axis.high
        if stays and most > 0.0 and not axis.clamped:
            self._speed.now = 0.0  # what follows comes to that
            return before
        wanted = aim if axis.low <= aim <= axis.high else max(axis.low, min(axis.high, aim))
        if axis.units.plain:
            wanted = float(round(wanted))
        period_s = axis.period_s
        distance = wanted - axis.servo.end
        speed = distance / period_s
        own, self._before = (wanted - before) / period_s, wanted
        if -most <= speed <= most:
            reached = self._speed.now = speed
        else:
            reached = self._speed.after(speed, own, distance, self._profile)
        if reached != speed or wanted != aim or axis.clamped:
            axis.say_limit(reached != speed or wanted != aim)
        return wanted if reached == speed else axis.servo.end + reached * period_s


class CyclicVelocity(Mode):
    """csv: 60FFh plus 60B1h, with 60B2h; the position demand is its integral, kept within 607Dh."""

    number: ClassVar[int] = CSV
    cyclic: ClassVar[bool] = True
    at_first: ClassVar[int] = BIT_12

    def begin(self) -> Demand | None:
        self._speed = Speed(self.axis.servo, self.axis.period_s)
        return self._demand

    def _demand(self) -> float:
        axis = self.axis
        units = axis.units
        most, strongest = self.fastest, self.strongest
        wanted = max(-most, min(most, units.velocity_at(0x60FF) + units.velocity_at(0x60B1)))
        up, down = (min(ENDLESS, units.most_acceleration_at(index)) for index in (0x60C5, 0x60C6))
        self._speed.towards(wanted, Profile(most, min(strongest, up), min(strongest, down)))
        torque = axis.dictionary.get(0x60B2) * axis.parameters.torque_counts_s2
        axis.servo.offset(0.0, math.copysign(torque, torque * units.velocity))
        return self.turned(self._speed.now)


class Interpolated(Mode):
    """ip, linear: controlword bit 4 switches it on, bit 12 says that it is.

    Without a buffer (60C4h:02 = 0) the newest 60C1h counts; with one, a record for each
    period is taken from it, and an empty buffer holds the axis where it is.
    """

    number: ClassVar[int] = IP
    cyclic: ClassVar[bool] = True

    def begin(self) -> Demand | None:
        self.axis.records.clear()
        self.axis.dictionary.values[0x60C1_01] = self.axis.units.reported_position(self.axis.actual())
        self._switch(self.axis.controlword)
        return self._demand

    def word(self, word: int, before: int) -> None:
        if (word ^ before) & BIT_4:
            self._switch(word)

    def _switch(self, word: int) -> None:
        self.set_bits(BIT_12 if word & BIT_4 else 0)

    def _demand(self) -> float:
        axis = self.axis
        if not self.bits & BIT_12:
            return axis.servo.end
        self.lead()
        if not axis.records.size:
            return axis.bounded(axis.units.increments(axis.dictionary.values[0x60C1_01]))
        record = axis.records.take()
        return axis.servo.end if record is None else axis.bounded(axis.units.increments(record))


class ProfilePosition(Mode):
    """pp: bit 4 takes 607Ah over (bit 6: relative), bit 5 at once, else after the one that runs.

    Status bit 12 acknowledges, and stays while the one place for a next target is taken;
    bit 10: the target is reached, within 6067h for 6068h.
    """

    number: ClassVar[int] = PP

    def begin(self) -> Demand | None:
        axis = self.axis
        self._goal = axis.servo.end
        self._next: float | None = None
        self._near_s = 0.0
        self._speed = Speed(axis.servo, axis.period_s)
        return self._demand

    def word(self, word: int, before: int) -> None:
        if word & BIT_4 and not before & BIT_4:
            self._take(word)
        elif before & BIT_4 and not word & BIT_4 and self._next is None:
            self.set_bits(self.bits & ~BIT_12)

    def _take(self, word: int) -> None:
        axis = self.axis
        if self._next is not None and not word & BIT_5:
            return  # no room: not acknowledged anew
        target = float(axis.within(axis.target + (self._goal if word & BIT_6 else 0.0)))
        if word & BIT_5 or self._arrived():
            self._goal, self._next = target, None
        else:
            self._next = target
        self._near_s = 0.0
        self.set_bits(BIT_12)

    def _arrived(self) -> bool:
        return self.axis.servo.end == self._goal

    def _demand(self) -> float:
        axis = self.axis
        if self._arrived() and self._next is not None:
            self._goal = self._next
            self._next = None
            self.set_bits(BIT_12 if axis.controlword & BIT_4 else 0)
        self._look()
        speed = axis.units.speed_at(0x6081)
        return axis.bounded(self._speed.to_position(self._goal, self.profile(speed)))

    def _look(self) -> None:
        """Bit 10."""
        axis = self.axis
        near = self._arrived() and abs(axis.servo.position - self._goal) <= axis.units.distance_at(0x6067)
        self._near_s = self._near_s + axis.period_s if near else 0.0
        reached = near and self._near_s >= axis.dictionary.get(0x6068) * 1e-3
        self.set_bits(self.bits & ~REACHED | (REACHED if reached else 0))


class ProfileVelocity(Mode):
    """pv. Bit 10: 60FFh within 606Dh for 606Eh; bit 12: standing, below 606Fh for 6070h."""

    number: ClassVar[int] = PV

    def begin(self) -> Demand | None:
        self._speed = Speed(self.axis.servo, self.axis.period_s)
        self._near_s = self._slow_s = 0.0
        return self._demand

    def _demand(self) -> float:
        axis = self.axis
        most = self.fastest
        wanted = max(-most, min(most, axis.units.velocity_at(0x60FF)))
        self._speed.towards(wanted, self.profile(most))
        self._look(wanted)
        return self.turned(self._speed.now)

    def _look(self, wanted: float) -> None:
        get, servo, period_s = self.axis.dictionary.get, self.axis.servo, self.axis.period_s
        at = self.axis.units.velocity_at
        near = abs(servo.velocity - wanted) <= abs(at(0x606D))
        slow = abs(servo.velocity) <= abs(at(0x606F))
        self._near_s = self._near_s + period_s if near else 0.0
        self._slow_s = self._slow_s + period_s if slow else 0.0
        bits = REACHED if near and self._near_s >= get(0x606E) * 1e-3 else 0
        bits |= BIT_12 if slow and self._slow_s >= get(0x6070) * 1e-3 else 0
        self.set_bits(bits)


class Homing(Mode):
    """hm: bit 4 starts on its rising edge and breaks off on its falling one."""

    number: ClassVar[int] = HOMING
    RUNS: ClassVar[int] = 0
    IDLE: ClassVar[int] = REACHED
    DONE: ClassVar[int] = REACHED | BIT_12
    FAILED: ClassVar[int] = REACHED | BIT_13
    at_first: ClassVar[int] = REACHED

    def begin(self) -> Demand | None:
        if self.bits == self.RUNS:
            self.bits = self.IDLE
        return self.axis.hold

    def word(self, word: int, before: int) -> None:
        if not (word ^ before) & BIT_4:
            return
        if word & BIT_4:
            self._start()
        elif self.bits == self.RUNS:
            self._break_off()
        self.axis.refresh()

    def _break_off(self) -> None:
        """The search is given up; the axis stops by the homing acceleration."""
        axis = self.axis
        self.bits = self.IDLE
        steep = axis.units.acceleration_at(0x609A)
        axis.generator = ramp_down(axis.servo, steep, axis.period_s, lambda: None)

    def _start(self) -> None:
        axis = self.axis
        self.bits = self.RUNS
        method = axis.dictionary.get(0x6098)
        if method in HERE:
            self._found(axis.servo.position)
            return
        units = axis.units
        pace = Pace(units.speed_at(0x6099, 1), units.speed_at(0x6099, 2), units.acceleration_at(0x609A))
        ground, inverted = axis.sensors.ground(), units.position < 0.0
        search = Search(method, axis.servo, ground, pace, axis.period_s, self._found, self._failed, inverted)
        axis.generator = search.demand

    def _found(self, point: float) -> None:
        """``point`` (present counting) becomes 607Ch, or what this family of drives has instead."""
        axis = self.axis
        home = axis.units.position_at(axis.home_offset) if axis.home_offset else 0
        axis.recount(home - point)
        self._end(self.DONE)

    def _failed(self) -> None:
        self._end(self.FAILED)

    def _end(self, bits: int) -> None:
        self.axis.generator = self.axis.hold
        self.set_bits(bits)


MODES: dict[int, type[Mode]] = {
    mode.number: mode
    for mode in (
        Mode,
        ProfilePosition,
        ProfileVelocity,
        Homing,
        Interpolated,
        CyclicPosition,
        CyclicVelocity,
    )
}
HALTABLE = frozenset({PP, PV, HOMING})
