"""What a drive cannot do, from its data sheet and profile alone: nothing here speaks to a bus.

``problems`` is the verb. Commissioning asks it first, so that a wrong period, mapping or
supervision is refused before a frame is sent; ``directrix drives check`` asks it for a
profile as a whole (``of_profile``). ``warnings`` are what was accepted all the same: entries
of the sheet that were overridden, and drives that are unsupervised by the operator's word.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from canopen.objectdictionary import ODVariable

from drives.commissioning import identity, wanted
from drives.commissioning.sheet import INTEGERS, Sheet
from drives.commissioning.values import shown_at
from drives.commissioning.wanted import RPDO, Pdo, Setting, Settings
from drives.profile import Profile, Supervision
from drives.settings import IoSettings, MasterSettings, NodeSettings, SpindleSettings

INTO, OUT_OF = ("wo", "rw", "rww"), ("ro", "rw", "rwr")  # access of what an RPDO, a TPDO may hold
PERIOD = 0x60C2
MAX_BITS = 64  # of process data in a frame

# What a person can change about a value that does not go, by object.
REMEDIES = {
    0x60C2: "change period_s",
    0x6065: "change following_error of the axis",
    0x607D: "change the travel of the axis",
    0x6098: "choose another homing method",
    0x6099: "change the homing speeds",
    0x609A: "change the homing acceleration",
    0x1800: "change feedback_every",
    0x100C: "use a drive that notices a dead controller, or accept it with unsupervised = true",
    0x100D: "use a drive that notices a dead controller, or accept it with unsupervised = true",
    0x1016: "use a drive that notices a dead controller, or accept it with unsupervised = true",
    0x6007: "use a drive that stops by itself, or accept it with unsupervised = true",
}
OTHERWISE = "another profile or another drive is needed"
WRONG = "if the sheet is wrong about its drive, override it with a reason ([[override]])"
UNNOTICED = "such a drive does not notice a dead controller (neither heartbeat nor node guarding)"
MODE_UNSEEN = "that somebody else changes the drive's mode is noticed by its statusword and position only"
ACCEPTED = "accepted with unsupervised = true; see that it can do no harm"


def problems(settings: Settings, master: MasterSettings, sheet: Sheet, bit_rate: int = 0) -> list[str]:
    """A sentence for everything that this drive cannot be told; ``bit_rate`` 0 is not looked at."""
    found = [*_of_family(settings, master)]
    found += _of_device(settings, sheet, bit_rate)
    found += _of_mapping(settings, sheet)
    found += _of_homing(settings, sheet) if isinstance(settings, NodeSettings) else ()
    told = not any("60C2h" in sentence for sentence in found)  # otherwise there is no value to look up
    for step in wanted.steps_of(settings, master, sheet):
        for setting in step.outcome:
            if not (_is_mapping(setting) or setting.waived) and (told or setting.index != PERIOD):
                remedy = f"{REMEDIES.get(setting.index, OTHERWISE)}; {WRONG}"
                found += (f"{problem}; {remedy}" for problem in _of_setting(setting, settings, sheet))
    return list(dict.fromkeys(found))


def warnings(settings: Settings, master: MasterSettings, sheet: Sheet) -> list[str]:
    """A sentence for everything that paper speaks against and somebody has accepted."""
    found = list(sheet.overridden)
    family = None if isinstance(settings, IoSettings) else settings.profile
    if family and family.supervision is Supervision.NONE and settings.unsupervised:
        found.append(f"profile {family.name}: {UNNOTICED}; {ACCEPTED}")
    for used in wanted.pdos_of(settings):
        if used.optional and not wanted.carries(used, sheet):
            found.append(f"{used.title}: {sheet.name} does not let 6061h be mapped into it; {MODE_UNSEEN}")
    for step in wanted.steps_of(settings, master, sheet):
        for setting in step.outcome:
            if setting.waived:
                found += (f"{problem}; {ACCEPTED}" for problem in _of_setting(setting, settings, sheet))
    return list(dict.fromkeys(found))


def of_profile(
    profile: Profile, sheet: Sheet, master: MasterSettings, bit_rate: int = 0
) -> tuple[list[str], list[str]]:
    """Problems and remarks of a family against one of its data sheets, at the master's period."""
    methods = profile.homing_methods if sheet.writable(0x6098) else profile.homing_methods[:1]
    base = NodeSettings(profile.name, "", 1, sheet.name, period_s=master.period_s, profile=profile)
    variants = [replace(base, homing_method=method) for method in methods]
    found = [problems(each, master, sheet, bit_rate) for each in variants]
    least = min(range(len(found)), key=lambda i: len(found[i]))
    base, needed = variants[least], found[least]
    # What a machine file may choose and need not: where the sheet has no room for it, that is a remark.
    chosen = [replace(base, feedback_every=profile.most_feedback_every)]
    if profile.takes_feed_forward and (sheet.has(0x60B1) or 0x60B1 not in profile.optional):
        chosen.append(replace(base, feed_forward=True))
    found += [problems(each, master, sheet, bit_rate) for each in chosen]
    beside = (sentence for each in found for sentence in each if sentence not in needed)
    told = [*warnings(base, master, sheet), *identity.contradictions(sheet)]
    remarks = [*(f"{one}." for one in dict.fromkeys((*told, *beside))), *_remarks(profile, sheet)]
    return needed, [*remarks, *profile.quirks]


def _remarks(profile: Profile, sheet: Sheet) -> Iterator[str]:
    """What is worth knowing and stops nobody."""
    for index in profile.optional:
        if not sheet.holds(index):
            yield f"object {index:04X}h is not in the data sheet; the profile does without it."
    for index, code in ((0x6007, profile.abort_code), (0x605A, profile.quick_stop_code)):
        if code is None and sheet.holds(index):
            yield f"object {index:04X}h is in the data sheet and the profile leaves it alone."
    missing = [f"{index:04X}h" for index in (0x60B8, 0x60B9, 0x60BA) if not sheet.holds(index)]
    if missing:
        yield f"the drive has no touch probe ({', '.join(missing)} not in the data sheet)."


# --- by the profile ------------------------------------------------------------------


def _of_family(settings: Settings, master: MasterSettings) -> Iterator[str]:
    if isinstance(settings, IoSettings):
        return
    profile = settings.profile
    if isinstance(settings, NodeSettings):
        yield from _of_period(settings.period_s, profile)
        yield from _of_axis(settings, profile)
    else:
        yield from _of_period(master.period_s, profile)
    if profile.supervision is Supervision.NONE and not settings.unsupervised:
        yield (
            f"profile {profile.name}: {UNNOTICED}; allowed with unsupervised = true in its table; see that it"
            " can do no harm"
        )


def _of_period(period_s: float, profile: Profile) -> Iterator[str]:
    steps = period_s / profile.period_step_s
    inside = profile.period_min_s - 1e-9 <= period_s <= profile.period_max_s + 1e-9
    fits = abs(steps - round(steps)) < 1e-6
    told = wanted.interpolation_time(period_s, profile.period_exponents)
    if not (inside and fits and told):
        units = ", ".join(f"10^{exponent} s" for exponent in profile.period_exponents)
        yield (
            f"profile {profile.name}: a period of {period_s * 1e3:g} ms cannot be told to the drive"
            f" (object 60C2h); allowed are multiples of {profile.period_step_s * 1e3:g} ms from"
            f" {profile.period_min_s * 1e3:g} to {profile.period_max_s * 1e3:g} ms that are 1 .. 255 times"
            f" {units}; change period_s"
        )


def _of_axis(node: NodeSettings, profile: Profile) -> Iterator[str]:
    if node.feed_forward and not profile.takes_feed_forward:
        yield (
            f"profile {profile.name}: such a drive takes no velocity beside the target (object 60B1h);"
            " write feed_forward = false"
        )
    if node.feedback_every > profile.most_feedback_every:
        yield (
            f"profile {profile.name}: feedback_every = {node.feedback_every} is too seldom; allowed are"
            f" 1 .. {profile.most_feedback_every} SYNCs; change it"
        )
    homes = node.homing_method and not node.absolute
    if homes and node.homing_method not in profile.homing_methods:
        methods = ", ".join(map(str, profile.homing_methods))
        yield (
            f"profile {profile.name}: homing method {node.homing_method} (object 6098h) is not one of the"
            f" drive's; allowed are {methods}; choose one of these"
        )
    if node.following_error_counts > profile.most_following_error:
        yield (
            f"profile {profile.name}: a following error window of {node.following_error_counts} counts"
            f" (object 6065h) is too large; allowed is up to {profile.most_following_error};"
            " change following_error"
        )
    if node.probe_tpdo and node.probe_tpdo == profile.tpdo:
        yield f"profile {profile.name}: TPDO {profile.tpdo} carries the feedback already; change probe_tpdo"
    if node.temperature_tpdo and node.temperature_tpdo in (profile.tpdo, node.probe_tpdo):
        yield (
            f"profile {profile.name}: TPDO {node.temperature_tpdo} carries something else already;"
            " change tpdo of temperature"
        )


# --- by the data sheet ---------------------------------------------------------------


def _of_device(settings: Settings, sheet: Sheet, bit_rate: int) -> Iterator[str]:
    kind = 401 if isinstance(settings, IoSettings) else 402
    said = sheet.default(0x1000)
    if said is not None and said & 0xFFFF != kind:
        yield (
            f"object 1000h: {sheet.name} is of device profile {said & 0xFFFF}, needed is {kind};"
            f" name this node's own data sheet; {WRONG}"
        )
    needed = (0x1000,) if kind == 401 else (0x1000, 0x6040, 0x6041, 0x6060, 0x6061)
    for index in needed:
        if not sheet.has(index):
            yield f"object {index:04X}h:00 is not in {sheet.name}; {OTHERWISE}"
    rates = sheet.dictionary.device_information.allowed_baudrates
    if bit_rate and rates and bit_rate not in rates:
        allowed = ", ".join(f"{rate // 1000}" for rate in sorted(rates))
        yield (
            f"{sheet.name}: {bit_rate // 1000} kbit/s is none of its bit rates; allowed are {allowed};"
            " change bit_rate of the bus"
        )
    if not isinstance(settings, IoSettings):
        yield from _of_kind(settings, sheet)


def _of_kind(settings: NodeSettings | SpindleSettings, sheet: Sheet) -> Iterator[str]:
    profile = settings.profile
    for sub, wants in ((1, profile.vendor), (2, profile.product)):
        said = sheet.identities(sub)
        if wants and said and wants not in said:
            yield (
                f"object 1018h:{sub:02X}: {sheet.name} says {said[0]:#x}, profile {profile.name} is for"
                f" {wants:#x}; name the profile of this drive; {WRONG}"
            )
    mode = profile.mode.value if isinstance(settings, NodeSettings) else settings.mode
    modes = sheet.default(0x6502)
    if modes and not modes & 1 << (mode - 1):
        yield (
            f"object 6502h: {sheet.name} says {modes:#x}, which is without mode of operation {mode};"
            f" {OTHERWISE}; {WRONG}"
        )


def _of_homing(node: NodeSettings, sheet: Sheet) -> Iterator[str]:
    """60E3h lists the methods, where the sheet fills it in; some write them as unsigned."""
    listed = [sheet.default(0x60E3, sub) for sub in sheet.subs(0x60E3)]
    methods = [(method + 128) % 256 - 128 for method in listed if method]
    homes = node.homing_method and not node.absolute
    if methods and homes and node.homing_method not in methods:
        allowed = ", ".join(map(str, methods))
        yield (
            f"object 60E3h: {sheet.name} lists the homing methods {allowed}, wanted is {node.homing_method};"
            f" choose one of these; {WRONG}"
        )


def _of_mapping(settings: Settings, sheet: Sheet) -> Iterator[str]:
    for used in wanted.pdos_of(settings):
        if used.optional:
            continue
        if not (sheet.holds(used.parameters) and sheet.holds(used.mapping)):
            yield (
                f"{used.title}: objects {used.parameters:04X}h and {used.mapping:04X}h are not both in"
                f" {sheet.name}, but {used.what}; choose a PDO that the drive has"
            )
            continue
        room = len(sheet.subs(used.mapping))
        if len(used.entries) > room:
            yield (
                f"{used.title}: {len(used.entries)} objects are to be mapped, {sheet.name} has room for"
                f" {room}; {OTHERWISE}"
            )
        if sum(entry & 0xFF for entry in used.entries) > MAX_BITS:
            yield f"{used.title}: more than {MAX_BITS} bits are to be mapped; map less"
        for place, entry in enumerate(used.entries, 1):
            yield from _of_entry(used, place, entry, sheet)


def _of_entry(used: Pdo, place: int, entry: int, sheet: Sheet) -> Iterator[str]:
    index, sub, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
    where = f"object {index:04X}h:{sub:02X}"
    found = sheet.find(index, sub)
    if found is None:
        yield f"{where} is not in {sheet.name}, but {used.what}; {OTHERWISE}"
        return
    if not found.pdo_mappable or found.access_type not in (INTO if used.kind is RPDO else OUT_OF):
        yield (
            f"{where}: {sheet.name} does not let it be mapped into {used.title} (access {found.access_type},"
            f" mappable {'yes' if found.pdo_mappable else 'no'}), but {used.what}; {OTHERWISE}; {WRONG}"
        )
    if found.data_type not in INTEGERS or INTEGERS[found.data_type][0] != bits:
        yield (
            f"{where}: {sheet.name} gives it data type {found.data_type:#06x}, needed are {bits} bits;"
            f" {OTHERWISE}; {WRONG}"
        )
    held = sheet.find(used.mapping, place)
    if held is not None and not held.writable and sheet.default(used.mapping, place) != entry:
        yield (
            f"object {used.mapping:04X}h:{place:02X}: {sheet.name} lets nobody change what is mapped, but"
            f" {used.what}; {OTHERWISE}; {WRONG}"
        )


def _is_mapping(setting: Setting) -> bool:
    return 0x1600 <= setting.index < 0x1800 or 0x1A00 <= setting.index < 0x1C00


def _of_setting(setting: Setting, settings: Settings, sheet: Sheet) -> Iterator[str]:
    """What is in the way of one value."""
    found = sheet.find(setting.index, setting.sub)
    if found is None:
        needed = setting.waived or not setting.optional
        if needed and not _may_be_missing(setting, settings):
            yield f"{setting.where} is not in {sheet.name}, but {setting.why}"
        return
    told = partial(shown_at, setting.index, setting.sub)
    default = sheet.default(setting.index, setting.sub)
    if not found.writable:
        if default is not None and (default ^ setting.value) & setting.mask:
            yield (
                f"{setting.where}: {sheet.name} has it read only with {told(default)}, needed is"
                f" {told(setting.value)}: {setting.why}"
            )
        return
    least, most = range_of(found)
    if least is not None and most is not None and not least <= setting.value <= most:
        yield (
            f"{setting.where}: {told(setting.value)} is needed ({setting.why}), {sheet.name} allows"
            f" {told(least)} to {told(most)}"
        )


def _may_be_missing(setting: Setting, settings: Settings) -> bool:
    return not isinstance(settings, IoSettings) and setting.index in settings.profile.optional


def range_of(found: ODVariable) -> tuple[int | None, int | None]:
    """What the type holds, narrowed by the limits; zeros, or turned round, were not meant."""
    if found.data_type not in INTEGERS:
        return None, None
    bits, signed = INTEGERS[found.data_type]
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if found.min == found.max == 0 or (found.min or least) > (most if found.max is None else found.max):
        return least, most
    return max(least, least if found.min is None else found.min), min(
        most, most if found.max is None else found.max
    )
