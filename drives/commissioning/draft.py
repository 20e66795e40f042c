"""A profile drafted from a data sheet alone, for a family of drives that has none.

``draft`` is the verb. Each key takes what the sheet lists or limits; of several values that would do, the
first with the fewest problems as ``possible`` finds them: draft, check and commissioning judge alike.
What the sheet cannot say, and what it costs that the drive lacks something, goes with the key as a note.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from drives.commissioning import possible
from drives.commissioning.sheet import Sheet, range_of
from drives.profile import STANDARD_HOMING, CyclicMode, Profile, Supervision
from drives.settings import MasterSettings, NodeSettings
from drives.texts import Message, message

# What a drive may lack: whatever reads them does without (CiA 402-2; 6502h, 60F4h: the feedback says it).
DISPENSABLE = (0x603F, 0x6066, 0x6099, 0x609A, 0x60B1, 0x60C4, 0x60C5, 0x60F4, 0x6502)
BUFFER = 0x60C4  # of setpoints, of the interpolated position mode alone
# Values in the order of preference, and the keys in the order in which they are chosen.
CHOICES: dict[str, tuple[Any, ...]] = {
    "mode": (CyclicMode.CSP, CyclicMode.IP),
    "rpdo": (1, 2, 3, 4),
    "tpdo": (1, 2, 3, 4),
    "quick_stop_code": (2, 6, 1, 5, None),  # by 6085h before by 6084h, off before on (CiA 402-2, 605Ah)
    "abort_code": (3, 1, 2, None),  # quick stop, fault, power off (CiA 402-2, 6007h)
    # With the last of them all supervision is waived.
    "supervision": (Supervision.HEARTBEAT, Supervision.GUARDING, Supervision.NONE),
    "home_offset": (0x607C, None),
}
ANY_EXPONENT = (-128, 63)  # limits of 60C2h:02 that every drive may write (CiA 402-2)
MILLISECONDS = -3
SHORTEST_S, LONGEST_S = Profile().period_min_s, Profile().period_max_s


@dataclass(frozen=True, slots=True)
class Draft:
    """A profile, what is to be said of its keys, and what no profile can mend."""

    profile: Profile
    notes: dict[str, Message]  # by key of the profile file
    problems: tuple[Message, ...]  # none: drives with this sheet are commissioned by it


def draft(name: str, sheet: Sheet, master: MasterSettings) -> Draft:
    """The profile of a sheet, judged at the master's period or the shortest that the sheet allows."""
    notes: dict[str, Message] = {}
    missing = tuple(index for index in DISPENSABLE if not sheet.holds(index))
    profile = Profile(name=name, vendor=sheet.identity(1), optional=missing, takes_feed_forward=False)
    profile = replace(profile, **_homing(sheet, notes), **_periods(sheet, notes))
    if (window := _most(sheet, 0x6065, 0)) is not None:
        profile = replace(profile, most_following_error=window)
    if profile.period_min_s > master.period_s:
        master = replace(master, period_s=profile.period_min_s)
    for key, choices in CHOICES.items():
        tried = [replace(profile, **{key: value}) for value in choices]
        profile = min(tried, key=lambda one: len(_problems(one, sheet, master)))
    profile = _feed_forward(profile, sheet, master)
    if profile.mode is CyclicMode.CSP:
        profile = replace(profile, optional=tuple(index for index in profile.optional if index != BUFFER))
    if not sheet.default(0x60A9) and not sheet.default(0x6096, 1):
        notes["velocity_unit_counts_s"] = message("draft.velocity_unit_counts_s")
    notes["mode"] = message(f"draft.mode.{profile.mode.name.lower()}")
    notes["supervision"] = message(f"draft.supervision.{profile.supervision.value}")
    for key in ("quick_stop_code", "abort_code", "home_offset"):
        notes[key] = message(f"draft.{key}.{'none' if getattr(profile, key) is None else 'known'}")
    notes["feed_forward"] = message(f"draft.feed_forward.{'yes' if profile.takes_feed_forward else 'no'}")
    return Draft(profile, notes, tuple(_problems(profile, sheet, master)))


def _problems(
    profile: Profile, sheet: Sheet, master: MasterSettings, feed_forward: bool = False
) -> list[Message]:
    """What is in the way of an axis that asks for as little as it can."""
    node = NodeSettings(
        profile.name,
        "",
        1,
        sheet.name,
        period_s=master.period_s,
        profile=profile,
        homing_method=profile.homing_methods[0],
        unsupervised=profile.supervision is Supervision.NONE,
        feed_forward=feed_forward,
    )
    return possible.problems(node, master, sheet)


def _feed_forward(profile: Profile, sheet: Sheet, master: MasterSettings) -> Profile:
    """With velocity beside the target, and the RPDO for the controlword alone, where the drive has room."""
    if profile.mode is not CyclicMode.CSP:
        return profile
    as_it_is = len(_problems(profile, sheet, master))
    others = (number for number in CHOICES["rpdo"] if number != profile.rpdo)
    tried = (replace(profile, takes_feed_forward=True, command_rpdo=other) for other in others)
    fits = (one for one in tried if len(_problems(one, sheet, master, feed_forward=True)) == as_it_is)
    return next(fits, profile) if sheet.holds(0x60B1) else profile


def _homing(sheet: Sheet, notes: dict[str, Message]) -> dict[str, Any]:
    """By 60E3h, else by the limits of 6098h; the standard's where neither says it."""
    if not sheet.writable(0x6098):
        notes["homing_methods"] = message("draft.homing_methods.fixed")
        return {"homing_methods": (sheet.default(0x6098) or 0,)}
    least, most = _limits(sheet, 0x6098, 0)
    within = tuple(method for method in STANDARD_HOMING if least <= method <= most)
    known = sheet.homing_methods or (within if 0 < len(within) < len(STANDARD_HOMING) else ())
    notes["homing_methods"] = message(f"draft.homing_methods.{'listed' if known else 'unknown'}")
    return {"homing_methods": known or STANDARD_HOMING}


def _periods(sheet: Sheet, notes: dict[str, Message]) -> dict[str, Any]:
    """What 60C2h takes by the sheet; whole milliseconds where its limits are those of its types."""
    limits = _limits(sheet, 0x60C2, 2)
    said_so = limits[0] > ANY_EXPONENT[0] or limits[1] < ANY_EXPONENT[1]
    fixed = sheet.default(0x60C2, 2)
    exponents: Iterable[int] = (e for e in Profile().period_exponents if limits[0] <= e <= limits[1])
    if not sheet.writable(0x60C2, 2) and fixed is not None:
        exponents = (fixed,)
    elif not said_so:
        exponents = (MILLISECONDS,)
    found = tuple(exponents) or (MILLISECONDS,)
    least, most = _limits(sheet, 0x60C2, 1)
    finest, coarsest = 10.0 ** min(found), 10.0 ** max(found)
    step_s = max(finest, Profile().period_step_s)
    narrow = (least, most) != (0, 255)
    notes["period_ms"] = message(f"draft.period_ms.{'sheet' if said_so or narrow else 'unknown'}")
    shortest_s = max(SHORTEST_S, step_s, max(least, 1) * finest)
    return {
        "period_exponents": found,
        "period_step_s": step_s,
        "period_min_s": shortest_s,
        "period_max_s": max(shortest_s, min(LONGEST_S, most * coarsest)),
    }


def _limits(sheet: Sheet, index: int, sub: int) -> tuple[int, int]:
    """Least and largest value of an integer; those of one byte where the sheet has no such object."""
    found = sheet.find(index, sub)
    least, most = range_of(found) if found is not None else (None, None)
    return (-128, 255) if least is None or most is None else (least, most)


def _most(sheet: Sheet, index: int, sub: int) -> int | None:
    found = sheet.find(index, sub)
    most = range_of(found)[1] if found is not None else None
    return most if most and most < Profile().most_following_error else None
