"""Simulated drives of a family: what its ``Profile`` says that such drives lack or refuse.

    supervision     no 1016h, or neither that nor 100Ch and 100Dh
    mode            "ip": no modes 8, 9 and 10 (6502h, 6060h)
    feed-forward    no 60B0h - 60B2h
    periods         60C2h takes the family's units and steps only
    option codes    no 605Ah, no 6007h: such a drive makes a quick stop of its own
    homing          6098h takes the family's methods only; another object than 607Ch
    units           those of speed and acceleration that no object of such a drive says
    identity        vendor and product, where the data sheet does not say them

A family's real data sheet says more (objects, types, ranges); it may be given as well.
"""

from __future__ import annotations

from collections.abc import Callable

from drives.bench.simulated import homing
from drives.bench.simulated.axis import Axis
from drives.bench.simulated.data_sheet import EDS, defaults, key
from drives.bench.simulated.dictionary import Abort, Code, Dictionary
from drives.bench.simulated.drive import SimulatedDrive
from drives.profile import GENERIC, CyclicMode, Profile, Supervision

HEARTBEAT_CONSUMER, GUARDING, OFFSETS = {0x1016}, {0x100C, 0x100D}, {0x60B0, 0x60B1, 0x60B2}
CYCLIC_MODES = 0x380  # bits of 6502h: csp, csv, cst
FIRST_CYCLIC = 8
TPDOS = 4
VALUE_AT, UNIT_AT = key(0x60C2, 1), key(0x60C2, 2)
MAX_IN_U8 = 255


def restrict(drive: SimulatedDrive, profile: Profile, bare: bool = False) -> SimulatedDrive:
    """Make the drive one of the family. ``bare``: without what the profile calls optional, too."""
    if profile == GENERIC and not bare:
        return drive
    dictionary = drive.dictionary
    dictionary.believe(profile.overrides)
    dictionary.leave_out(missing(profile) | (set(profile.optional) if bare else set()))
    _settle_identity(dictionary, profile)
    _restrict_modes(dictionary, profile)
    _restrict_periods(dictionary, profile)
    _restrict_homing(drive.axis, profile)
    units = drive.axis.units
    units.of_shaft = profile.revolution == "shaft"
    units.set_own(profile.velocity_unit_counts_s, profile.acceleration_unit_counts_s2)
    _refuse_above(dictionary, key(0x6065), profile.most_following_error)
    for n in range(TPDOS):
        _check_first(dictionary, key(0x1800 + n, 2), _counts_to(profile.most_feedback_every))
    dictionary.reset(0x1000, 0xFFFF)
    drive.configure()
    return drive


def missing(profile: Profile) -> set[int]:
    """Indexes of objects that the family lacks."""
    away: set[int] = set()
    if profile.supervision is not Supervision.HEARTBEAT:
        away |= HEARTBEAT_CONSUMER
    if profile.supervision is Supervision.NONE:
        away |= GUARDING
    if not profile.takes_feed_forward:
        away |= OFFSETS
    if profile.quick_stop_code is None:
        away.add(0x605A)
    if profile.abort_code is None:
        away.add(0x6007)
    return away


def _settle_identity(dictionary: Dictionary, profile: Profile) -> None:
    """Who the drive is, and how it stops where nothing can tell it to."""
    for sub, said in ((1, profile.vendor), (2, profile.product)):
        variable = dictionary.variables.get(key(0x1018, sub))
        if said is not None and variable is not None and not variable.default:
            dictionary.factory[key(0x1018, sub)] = said
    if profile.abort_code is None:
        dictionary.factory[key(0x6007)] = 3
    if profile.quick_stop_code is None:
        dictionary.factory[key(0x605A)] = 2


def supported_modes(profile: Profile) -> int:
    """6502h of the family."""
    own = defaults(EDS, 1)[key(0x6502)]
    return own & ~CYCLIC_MODES if profile.mode is CyclicMode.IP else own


def _restrict_modes(dictionary: Dictionary, profile: Profile) -> None:
    if profile.mode is not CyclicMode.IP:
        return
    supported = supported_modes(profile)
    dictionary.readers[key(0x6502)] = lambda: supported

    def not_cyclic(mode: int) -> None:
        if mode >= FIRST_CYCLIC:
            raise Abort(Code.VALUE)

    _check_first(dictionary, key(0x6060), not_cyclic)


def _restrict_periods(dictionary: Dictionary, profile: Profile) -> None:
    """60C2h: the value must do in some unit, the unit with the value that is there."""

    def check_value(value: int) -> None:
        if not any(_takes(profile, value, unit) for unit in profile.period_exponents):
            raise Abort(Code.VALUE)

    def check_unit(unit: int) -> None:
        if unit not in profile.period_exponents or not _takes(profile, dictionary.values[VALUE_AT], unit):
            raise Abort(Code.VALUE)

    first = next(
        (value, unit)
        for unit in profile.period_exponents
        for value in range(1, MAX_IN_U8 + 1)
        if _takes(profile, value, unit)
    )
    dictionary.factory |= {VALUE_AT: first[0], UNIT_AT: first[1]}
    _check_first(dictionary, VALUE_AT, check_value)
    _check_first(dictionary, UNIT_AT, check_unit)


def _takes(profile: Profile, value: int, unit: int) -> bool:
    period_s = value * 10.0**unit
    steps = period_s / profile.period_step_s
    inside = profile.period_min_s - 1e-9 <= period_s <= profile.period_max_s + 1e-9
    return inside and abs(steps - round(steps)) < 1e-6


def _restrict_homing(axis: Axis, profile: Profile) -> None:
    here = frozenset(homing.HERE)
    axis.homing_methods = frozenset(profile.homing_methods) & (frozenset(homing.METHODS) | here | {0})
    axis.home_offset = profile.home_offset or 0


def _refuse_above(dictionary: Dictionary, where: int, highest: int) -> None:
    def check(value: int) -> None:
        if value > highest:
            raise Abort(Code.TOO_HIGH)

    _check_first(dictionary, where, check)


def _counts_to(most: int) -> Callable[[int], None]:
    """A TPDO's transmission type: synchronous ones up to every so many SYNCs."""

    def check(kind: int) -> None:
        if most < kind <= 240:
            raise Abort(Code.VALUE)

    return check


def _check_first(dictionary: Dictionary, where: int, check: Callable[[int], None]) -> None:
    """Another condition on writing an object, before its own."""
    own = dictionary.writers.get(where)

    def write(value: int) -> None:
        check(value)
        if own is not None:
            own(value)

    dictionary.writers[where] = write
