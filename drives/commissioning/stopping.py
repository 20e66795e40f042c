"""How a drive stops by itself: arranged as far as it lets itself be told, then believed as it reads.

What is offered, in the drive's own units, and what it is made of:

    6085h  quick stop deceleration     the machine file's word, else the axis' largest acceleration: for that
                                       its motor and mechanics are made, so the ramp needs nothing to spare
    6084h  profile deceleration        the axis' largest acceleration
    605Bh  605Ch  605Dh                1: ramps by 6084h, before the power goes
    605Eh  fault reaction              2: the quick stop's ramp
    6066h  following error time-out    five ticks, so that the drive trips before the axis has gone far
    607Fh  6080h  largest speed        the axis' and 5 % (6080h where a turn of the motor is known)
    60C5h  60C6h                       no less than path and quick stop need

6080h is the motor's, in 1/min (CiA 402-2) or, by some makers, in the unit of 60A9h: the larger number is
told, which holds nobody back, and it is never raised above what the drive or its sheet has. A drive that does
not take it, and would be too slow by one of the two readings, is refused.

A number out of the data sheet's range becomes the nearest in it: less deceleration makes the promise longer,
less time-out trips sooner. 605Ah is the profile's, and written before. What is refused, missing or fixed is
told, and what is read counts: a standstill is promised by 6085h, 6084h and 60C6h as they are, or, where they
tell nothing, by the longest stop that the machine file allows. A longer one is refused, and so is a drive
that holds its axis back (607Fh, 6080h, 60C5h, 60C6h): it would stand beside its command.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from drives.arranged import Arranged
from drives.commissioning.network import CommissionError
from drives.commissioning.remote import RefusedError
from drives.commissioning.sheet import Sheet, range_of
from drives.commissioning.units import RATE, SPEED, Units
from drives.commissioning.wanted import Setting, where
from drives.settings import NodeSettings, SpindleSettings
from drives.texts import Message, chain, message

QUICK_STOP, FAULT_REACTION = 0x605A, 0x605E  # option codes
SLOW, QUICK = (1, 5), (2, 6)  # their ramps: by 6084h, by 6085h
DECELERATION = {SLOW: (0x6084, 0x6083), QUICK: (0x6085,)}  # the first that is there (CiA 402-2, 6084h)
MARGIN = 1.05  # of the largest speed
HEADROOM = 1.2  # of 60C5h over the path's accelerations: rounding to counts, and the servo
STEEP = 1.3  # of what was offered: more than the coarsest unit makes of it, and any servo has to spare
TIME_OUT_TICKS = 5
FOLLOWING = 0x6066
MOTOR_SPEED = 0x6080
NEARLY = 1.0 - 1e-6  # of what is needed; the rest is rounding
MAX_UINT32 = 0xFFFF_FFFF
# Without these a drive stops as well as with them.
UNIMPORTANT = (0x605D, 0x6083, 0x6084, FOLLOWING, 0x6080, 0x60C5, 0x60C6)

Read = Mapping[int, int]  # by index


@dataclass(frozen=True, slots=True)
class Offer:
    """One object that a drive should have so."""

    index: int
    value: int
    why: Message
    at_least: bool = False


class Drive(Protocol):
    """One that is offered it: on the bus, or on paper."""

    @property
    def sheet(self) -> Sheet: ...

    def says(self, what: Message, /) -> Message: ...

    def find(self, index: int, /) -> int | None: ...

    def offer(self, setting: Setting, at_least: bool, /) -> tuple[int | None, Message | None]: ...


def arrange(drive: Drive, node: NodeSettings, units: Units) -> Arranged:
    """Offer all of it and read it back. Raises CommissionError, UnitError."""
    if node.feed_forward:
        units.see_fits(node.velocity_counts_s, where(0x60B1))
    if not node.velocity_counts_s:
        return _quick_stop_alone(drive, node, units)
    _see_motor(drive, node, units)
    found: dict[int, int] = {}
    wanted = tuple(offers(node, units))
    notes = [_note(drive, problem) for offer in wanted for problem in _made(drive, offer, found)]
    missing = [
        f"{one.index:04X}h" for one in wanted if one.index not in found and one.index not in UNIMPORTANT
    ]
    if missing:
        notes.append(_note(drive, message("stopping.missing", objects=", ".join(missing))))
    for index in (QUICK_STOP,) if 0x6084 in found else (QUICK_STOP, 0x6083):
        if (value := drive.find(index)) is not None:
            found[index] = value
    if held := _held_back(found, node, units):
        raise CommissionError(drive.says(held))
    stop = stop_counts_s2(found, node, units)
    stop_s = node.velocity_counts_s / stop if stop else node.most_quick_stop_s
    if not stop:
        notes.append(_note(drive, message("stopping.not_known", seconds=stop_s)))
    if stop_s > node.most_quick_stop_s:
        raise CommissionError(drive.says(_too_long(found, stop_s, node)))
    return _arranged(node, units, stop, stop_s, found, notes)


def _note(drive: Drive, what: Message) -> Message:
    return message("sentence", text=drive.says(what))


def _quick_stop_alone(drive: Drive, node: NodeSettings, units: Units) -> Arranged:
    """Of an axis of which no more is known. Raises CommissionError where it is not as it was written."""
    if not node.quick_stop_counts_s2:
        return _arranged(node, units)
    found: dict[int, int] = {}
    problems = list(_made(drive, _quick_stop(node, units), found))
    if problems or 0x6085 not in found:
        raise CommissionError(drive.says(problems[0] if problems else message("stopping.no_quick_stop")))
    return _arranged(node, units, found=found)


def _quick_stop(node: NodeSettings, units: Units) -> Offer:
    """How hard the drive is to brake in it. Raises UnitError."""
    quick = units.acceleration(node.quick_stop_counts_s2 or node.acceleration_counts_s2, where(0x6085))
    return Offer(0x6085, quick, message("setting.as_promised"))


def _made(drive: Drive, offer: Offer, found: dict[int, int]) -> Iterator[Message]:
    """Offer one object; what it is then goes into ``found``, and why it is not as it should be comes out."""
    value = _within(drive, offer)
    have, problem = drive.offer(Setting(offer.index, 0, value, offer.why), offer.at_least)
    if have is not None:
        found[offer.index] = have
    if problem:
        yield message("stopping.problem", problem=problem, need=offer.why)
    elif have == value != offer.value and offer.index != FOLLOWING:
        facts = {"where": where(offer.index), "most": value, "wanted": offer.value, "need": offer.why}
        yield message("stopping.goes_as_far", **facts)


def _arranged(
    node: NodeSettings | SpindleSettings,
    units: Units,
    stop: float = 0.0,
    stop_s: float = 0.0,
    found: Read | None = None,
    notes: list[Message] | None = None,
) -> Arranged:
    objects = tuple((f"{index:04X}h:00", value) for index, value in sorted((found or {}).items()))
    sizes = units.velocity_counts_s, units.acceleration_counts_s2
    return Arranged(node.name, node.node, *sizes, stop, stop_s, objects, tuple(notes or ()))


def of_spindle(node: SpindleSettings, units: Units) -> Arranged:
    """Its units; a spindle's ramps are its own. Raises UnitError."""
    units.see_fits(abs(node.counts_per_rev) * node.most_rev_min / 60.0, where(0x60FF))
    return _arranged(node, units)


def offers(node: NodeSettings, units: Units) -> Iterator[Offer]:
    """What a drive should have. Raises UnitError."""
    most = node.acceleration_counts_s2
    quick = node.quick_stop_counts_s2 or most
    yield _quick_stop(node, units)
    slow = units.acceleration(most, where(0x6084))
    yield Offer(0x6084, slow, message("setting.own_ramps"))
    for index, code, why in (
        (0x605B, 1, message("setting.shutdown_brakes")),
        (0x605C, 1, message("setting.disable_brakes")),
        (0x605D, 1, message("setting.halt_brakes")),
        (FAULT_REACTION, 2, message("setting.fault_brakes")),
    ):
        yield Offer(index, code, why)
    late_ms = max(1, round(TIME_OUT_TICKS * node.period_s * 1e3))
    yield Offer(FOLLOWING, late_ms, message("setting.trips"))
    fastest = _fastest(node.velocity_counts_s / units.velocity_counts_s)
    yield Offer(0x607F, fastest, message("setting.not_faster"))
    if speeds := units.motor_speeds_counts_s:
        most_turns = _fastest(node.velocity_counts_s / min(speeds))
        yield Offer(MOTOR_SPEED, most_turns, message("setting.not_faster"))
    why = message("setting.not_held_back")
    needed = math.ceil(HEADROOM * max(most, quick) / units.acceleration_counts_s2)
    yield Offer(0x60C5, min(needed, MAX_UINT32), why, at_least=True)
    yield Offer(0x60C6, min(needed, MAX_UINT32), why, at_least=True)


def _fastest(exact: float) -> int:
    """Within 5 % above the axis' speed, if the unit is fine enough for that; never below it."""
    return max(math.floor(MARGIN * exact), math.ceil(exact))


def _see_motor(drive: Drive, node: NodeSettings, units: Units) -> None:
    """6080h protects the motor. Raises CommissionError where the axis is faster, however it is read."""
    unit = max(units.motor_speeds_counts_s, default=0.0)
    try:
        most = drive.find(MOTOR_SPEED)
    except RefusedError:
        return
    if not most or most == MAX_UINT32:
        return
    most = max(most, drive.sheet.default(MOTOR_SPEED) or 0)
    if most * unit and most * unit < NEARLY * node.velocity_counts_s:
        speeds = {"speed": most * unit, "needed": node.velocity_counts_s}
        raise CommissionError(drive.says(message("stopping.slow_motor", most=most, **speeds)))


def _held_back(found: Read, node: NodeSettings, units: Units) -> Message | None:
    """What keeps the axis from its speed or acceleration; 0 and FFFFFFFFh are none."""
    speed, rate = node.velocity_counts_s, node.acceleration_counts_s2
    for index, unit, needed, name in (
        (0x607F, units.velocity_counts_s, speed, SPEED),
        *((MOTOR_SPEED, unit, speed, SPEED) for unit in units.motor_speeds_counts_s),
        (0x60C5, units.acceleration_counts_s2, rate, RATE),
        (0x60C6, units.acceleration_counts_s2, rate, RATE),
    ):
        value = found.get(index)
        if value not in (None, 0, MAX_UINT32) and value * unit < NEARLY * needed:
            facts = {"index": index, "value": value, "size": value * unit, "name": name}
            return message("stopping.held_back", **facts, needed=needed)
    return None


def _within(drive: Drive, offer: Offer) -> int:
    """The nearest that the data sheet allows."""
    entry = drive.sheet.find(offer.index)
    least, most = range_of(entry) if entry is not None else (None, None)
    value = offer.value if least is None else max(least, offer.value)
    return value if most is None else min(most, value)


def stop_counts_s2(found: Read, node: NodeSettings, units: Units) -> float:
    """The weakest of the ramps by which the drive may stop, as read; 0 = it does not tell.

    A steeper one than was offered is not believed: the axis is not made for it, overshoots, and comes back.
    """
    offered = node.quick_stop_counts_s2 or node.acceleration_counts_s2
    slowest = [offered]
    for index, otherwise in ((QUICK_STOP, node.profile.quick_stop_code), (FAULT_REACTION, 2)):
        code = found.get(index, otherwise)
        if (ramp := _ramp(code, found)) is not None:
            slowest.append(_believed(ramp * units.acceleration_counts_s2, offered))
        elif index == QUICK_STOP:
            # A drive that has no such object stops as its makers have it; the machine file may know.
            return 0.0 if 0x6085 in found else node.quick_stop_counts_s2
    if limit := found.get(0x60C6):
        slowest.append(limit * units.acceleration_counts_s2)
    return min(slowest)


def _believed(ramp: float, offered: float) -> float:
    """A ramp steeper than the axis is made for ends before its motor does.

    That brakes by what was offered, is too far by d = v^2 / 2a - v^2 / 2r, and comes back in 2 sqrt(d / a).
    """
    too_steep = 1.0 - STEEP * offered / ramp
    return ramp if too_steep <= 0.0 else offered / (1.0 + math.sqrt(2.0 * too_steep))


def _ramp(code: int | None, found: Read) -> float | None:
    """In the drive's units. None: it coasts, brakes as hard as it can, or does not tell."""
    for codes, objects in DECELERATION.items():
        if code in codes or (code is None and codes is QUICK):
            return next((float(found[index]) for index in objects if found.get(index)), None)
    return None


def _too_long(found: Read, stop_s: float, node: NodeSettings) -> Message:
    reads = [
        message("stopping.reads", index=index, value=found[index])
        for index in (0x6085, 0x6084, 0x60C6)
        if index in found
    ]
    objects = chain("comma", reads) if reads else ""
    return message("stopping.too_long", seconds=stop_s, objects=objects, most=node.most_quick_stop_s)
