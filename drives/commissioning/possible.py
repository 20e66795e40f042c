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
from typing import Any, NamedTuple

from drives.commissioning import identity, stopping, wanted
from drives.commissioning.network import CommissionError
from drives.commissioning.sheet import INTEGERS, Sheet, range_of
from drives.commissioning.units import UnitError, counts_of, si, units_of
from drives.commissioning.values import shown_at
from drives.commissioning.wanted import RPDO, Pdo, Setting, Settings, where
from drives.profile import Profile, Supervision
from drives.settings import IoSettings, MasterSettings, NodeSettings, SpindleSettings
from drives.texts import Key, Message, chain, message, once, plain

INTO, OUT_OF = ("wo", "rw", "rww"), ("ro", "rw", "rwr")  # access of what an RPDO, a TPDO may hold
PERIOD, PERIOD_PROBLEM = 0x60C2, "on_paper.period"
LAST_SEARCH = 34  # of the homing methods that move the axis
MAX_BITS = 64  # of process data in a frame

# Objects of which a person can change the value: what, is the text ``on_paper.do.60C2`` for one.
CHANGEABLE = (0x60C2, 0x6065, 0x607D, 0x6098, 0x6099, 0x609A, 0x1800, 0x100C, 0x100D, 0x1016, 0x6007)
# What a machine file may say of units, as one of these or another number.
UNITS_OF_A_MACHINE: tuple[dict[str, Any], ...] = (
    {"velocity_unit_counts_s": 1.0},
    {"counts_per_si": 1e6},
    {"counts_per_si": 1e6, "rotary": True},
)
OTHERWISE = message("on_paper.do.other")
WRONG = message("on_paper.do.override")
UNNOTICED = message("on_paper.unnoticed")


def problems(settings: Settings, master: MasterSettings, sheet: Sheet, bit_rate: int = 0) -> list[Message]:
    """What is to be said of everything that this drive cannot be told; ``bit_rate`` 0 is not looked at."""
    found = [*_of_family(settings, master)]
    found += _of_device(settings, sheet, bit_rate)
    found += _of_mapping(settings, sheet)
    found += _of_homing(settings, sheet) if isinstance(settings, NodeSettings) else ()
    told = all(one["key"] != PERIOD_PROBLEM for one in found)  # otherwise there is no value to look up
    for step in wanted.steps_of(settings, master, sheet):
        for setting in step.outcome:
            if not (_is_mapping(setting) or setting.waived) and (told or setting.index != PERIOD):
                do = message(f"on_paper.do.{setting.index:04X}") if setting.index in CHANGEABLE else OTHERWISE
                found += (_to_do(problem, do, WRONG) for problem in _of_setting(setting, sheet))
    return once(found)


def _to_do(problem: Message, *remedies: Message) -> Message:
    for do in remedies:
        problem = message("on_paper.to_do", problem=problem, do=do)
    return problem


def _bare(problem: Message) -> Message:
    """Without what is to be done about it: of what nobody has asked for."""
    while problem["key"] == "on_paper.to_do":
        problem = problem["values"]["problem"]
    return problem


def warnings(settings: Settings, master: MasterSettings, sheet: Sheet) -> list[Message]:
    """What is to be said of everything that paper speaks against and somebody has accepted."""
    found = list(sheet.overridden)
    family = None if isinstance(settings, IoSettings) else settings.profile
    if family and family.supervision is Supervision.NONE and settings.unsupervised:
        found.append(_of_profile(family, message("on_paper.accepted", problem=UNNOTICED)))
    if isinstance(settings, NodeSettings):
        found += _of_search(settings, sheet)
    for used in wanted.pdos_of(settings):
        if used.optional and not wanted.carries(used, sheet):
            key = "on_paper.mode_unseen" if used.event_ms else "on_paper.demand_unseen"
            found.append(message(key, pdo=used.title, sheet=sheet.name))
    for step in wanted.steps_of(settings, master, sheet):
        for setting in step.outcome:
            if setting.waived:
                problems = _of_setting(setting, sheet)
                found += (message("on_paper.accepted", problem=problem) for problem in problems)
    return once(found)


def _of_search(node: NodeSettings, sheet: Sheet) -> Iterator[Message]:
    """A search for a switch whose speeds nobody says: one of 0 never ends."""
    said = {(index, sub) for index, sub, _, _ in wanted.homing_speeds(node)}
    unsaid = [
        where(index, sub)
        for index, sub in ((0x6099, 1), (0x6099, 2), (0x609A, 0))
        if (index, sub) not in said and sheet.has(index, sub) and not sheet.default(index, sub)
    ]
    if unsaid and not node.absolute and 1 <= node.homing_method <= LAST_SEARCH:
        facts = {"method": node.homing_method, "sheet": sheet.name}
        yield message("on_paper.search", **facts, objects=chain("and", unsaid))


def default_problems(settings: Settings, sheet: Sheet) -> Iterator[Message]:
    """What commissioning would refuse of units, speeds and stops of a drive with the sheet's defaults.

    Whoever has set a drive up by its maker's tool says so by an override of the default.
    """
    if isinstance(settings, IoSettings):
        return
    try:
        units = units_of(settings, sheet.default)
        if isinstance(settings, NodeSettings):
            tuple(wanted.homing_in_units(settings, units))
            stopping.arrange(PaperDrive(settings, sheet), settings, units)
        else:
            stopping.of_spindle(settings, units)
    except UnitError as error:
        yield message("on_paper.units", sheet=sheet.name, problem=error.said)
    except CommissionError as error:
        yield message("on_paper.as_delivered", sheet=sheet.name, problem=error.said)


class PaperDrive:
    """A drive as its sheet has it after power-on; what may be written, it takes."""

    def __init__(self, settings: NodeSettings, sheet: Sheet) -> None:
        self.settings = settings
        self.sheet = sheet

    def says(self, what: Message) -> Message:
        return what

    def find(self, index: int, sub: int = 0) -> int | None:
        return self.sheet.default(index, sub)

    def offer(self, setting: Setting, at_least: bool = False) -> tuple[int | None, Message | None]:
        before = self.find(*setting.place)
        enough = at_least and before is not None and before > setting.value
        return (setting.value if self.sheet.writable(*setting.place) and not enough else before), None


class Verdict(NamedTuple):
    """Of a family against a sheet: what is refused, worth knowing, and left to a machine file to decide."""

    problems: list[Message]
    remarks: list[Message]
    undecided: list[Message]


def of_profile(profile: Profile, sheet: Sheet, master: MasterSettings, bit_rate: int = 0) -> Verdict:
    """A family against one of its data sheets, at the master's period."""
    methods = profile.homing_methods if sheet.writable(0x6098) else profile.homing_methods[:1]
    base = NodeSettings(profile.name, "", 1, sheet.name, period_s=master.period_s, profile=profile)
    variants = [replace(base, homing_method=method) for method in methods]
    found = [problems(each, master, sheet, bit_rate) for each in variants]
    least = min(range(len(found)), key=lambda i: len(found[i]))
    base, needed = variants[least], found[least]
    # What a machine file may choose and need not: where the sheet has no room for it, that is a remark.
    seldom = f"feedback_every = {profile.most_feedback_every}"
    chosen = [(f"method = {each.homing_method}", each) for each in variants]
    chosen.append((seldom, replace(base, feedback_every=profile.most_feedback_every)))
    if profile.takes_feed_forward and (sheet.has(0x60B1) or 0x60B1 not in profile.optional):
        chosen.append(("feed_forward = true", replace(base, feed_forward=True)))
    beside = (
        message("on_paper.not_chosen", choice=choice, problem=_bare(one))
        for choice, each in chosen
        for one in problems(each, master, sheet, bit_rate)
        if one not in needed
    )
    units = [*default_problems(base, sheet)]
    is_refused = units and all(
        any(default_problems(replace(base, **one), sheet)) for one in UNITS_OF_A_MACHINE
    )
    undecided = [*([] if is_refused else units), *_counts(sheet)]
    told = [*warnings(base, master, sheet), *identity.contradictions(sheet)]
    remarks = [*(message("sentence", text=one) for one in once((*told, *beside))), *_remarks(profile, sheet)]
    remarks += map(plain, profile.quirks)
    return Verdict([*needed, *(units if is_refused else ())], remarks, undecided)


def _counts(sheet: Sheet) -> Iterator[Message]:
    """What a position in SI units leaves a machine file no choice of."""
    word = sheet.default(0x60A8, 0) or 0
    if (found := counts_of(si(word))) is not None:
        key, counts = found
        yield message("on_paper.counts", sheet=sheet.name, word=word, key=key, counts=counts)


def _remarks(profile: Profile, sheet: Sheet) -> Iterator[Message]:
    """What is worth knowing and stops nobody."""
    for index in profile.optional:
        if not sheet.holds(index):
            yield message("on_paper.done_without", index=index)
    for index, code in ((0x6007, profile.abort_code), (0x605A, profile.quick_stop_code)):
        if code is None and sheet.holds(index):
            yield message("on_paper.left_alone", index=index)
    missing = [f"{index:04X}h" for index in (0x60B8, 0x60B9, 0x60BA) if not sheet.holds(index)]
    if missing:
        yield message("on_paper.no_touch_probe", missing=", ".join(missing))


# --- by the profile ------------------------------------------------------------------


def _of_profile(profile: Profile, problem: Message) -> Message:
    return message("on_paper.of_profile", profile=profile.name, problem=problem)


def _of_family(settings: Settings, master: MasterSettings) -> Iterator[Message]:
    if isinstance(settings, IoSettings):
        return
    profile = settings.profile
    if isinstance(settings, NodeSettings):
        yield from _of_period(settings.period_s, profile)
        yield from (_of_profile(profile, problem) for problem in _of_axis(settings, profile))
    else:
        yield from _of_period(master.period_s, profile)
    if profile.supervision is Supervision.NONE and not settings.unsupervised:
        yield _of_profile(profile, message("on_paper.unsupervised", problem=UNNOTICED))


def _of_period(period_s: float, profile: Profile) -> Iterator[Message]:
    steps = period_s / profile.period_step_s
    inside = profile.period_min_s - 1e-9 <= period_s <= profile.period_max_s + 1e-9
    fits = abs(steps - round(steps)) < 1e-6
    told = wanted.interpolation_time(period_s, profile.period_exponents)
    if not (inside and fits and told):
        units = ", ".join(f"10^{exponent} s" for exponent in profile.period_exponents)
        spans = {
            "ms": period_s * 1e3,
            "step": profile.period_step_s * 1e3,
            "low": profile.period_min_s * 1e3,
            "high": profile.period_max_s * 1e3,
        }
        yield message(PERIOD_PROBLEM, profile=profile.name, **spans, units=units)


def _of_axis(node: NodeSettings, profile: Profile) -> Iterator[Message]:
    if node.feed_forward and not profile.takes_feed_forward:
        yield message("on_paper.no_feed_forward")
    if node.feedback_every > profile.most_feedback_every:
        yield message("on_paper.too_seldom", every=node.feedback_every, most=profile.most_feedback_every)
    homes = node.homing_method and not node.absolute
    if homes and node.homing_method not in profile.homing_methods:
        methods = ", ".join(map(str, profile.homing_methods))
        yield message("on_paper.homing_method", method=node.homing_method, methods=methods)
    if node.following_error_counts > profile.most_following_error:
        yield message(
            "on_paper.window", counts=node.following_error_counts, most=profile.most_following_error
        )
    if node.probe_tpdo and node.probe_tpdo == profile.tpdo:
        yield message("on_paper.probe_taken", tpdo=profile.tpdo)
    if node.temperature_tpdo and node.temperature_tpdo in (profile.tpdo, node.probe_tpdo):
        yield message("on_paper.temperature_taken", tpdo=node.temperature_tpdo)
    others = (profile.tpdo, node.probe_tpdo, node.temperature_tpdo)
    if node.demand_tpdo and node.demand_tpdo in others:
        yield message("on_paper.demand_taken", tpdo=node.demand_tpdo)
    if node.load_tpdo and not node.load_node and node.taken_tpdos.count(node.load_tpdo) > 1:
        yield message("on_paper.load_encoder_taken", tpdo=node.load_tpdo)


# --- by the data sheet ---------------------------------------------------------------


def _of_device(settings: Settings, sheet: Sheet, bit_rate: int) -> Iterator[Message]:
    kind = 401 if isinstance(settings, IoSettings) else 402
    found = sheet.default(0x1000)
    if found is not None and found & 0xFFFF != kind:
        problem = message("on_paper.device_profile", sheet=sheet.name, found=found & 0xFFFF, needed=kind)
        yield _to_do(problem, message("on_paper.do.own_sheet"), WRONG)
    needed = (0x1000,) if kind == 401 else (0x1000, 0x6040, 0x6041, 0x6060, 0x6061)
    for index in needed:
        if not sheet.has(index):
            yield _to_do(message("on_paper.not_in_sheet", where=where(index), sheet=sheet.name), OTHERWISE)
    rates = sheet.dictionary.device_information.allowed_baudrates
    if bit_rate and rates and bit_rate not in rates:
        allowed = ", ".join(f"{rate // 1000}" for rate in sorted(rates))
        yield message("on_paper.bit_rate", sheet=sheet.name, rate=bit_rate // 1000, allowed=allowed)
    if not isinstance(settings, IoSettings):
        yield from _of_kind(settings, sheet)


def _of_kind(settings: NodeSettings | SpindleSettings, sheet: Sheet) -> Iterator[Message]:
    profile = settings.profile
    for sub, wants in ((1, profile.vendor), (2, profile.product)):
        found = sheet.identities(sub)
        if wants and found and wants not in found:
            facts = {"where": where(0x1018, sub), "sheet": sheet.name, "found": found[0], "wanted": wants}
            problem = message("on_paper.other_kind", **facts, profile=profile.name)
            yield _to_do(problem, message("on_paper.do.other_profile"), WRONG)
    mode = profile.mode.value if isinstance(settings, NodeSettings) else settings.mode
    modes = sheet.default(0x6502)
    if modes and not modes & 1 << (mode - 1):
        yield _to_do(message("on_paper.no_mode", sheet=sheet.name, modes=modes, mode=mode), OTHERWISE, WRONG)


def _of_homing(node: NodeSettings, sheet: Sheet) -> Iterator[Message]:
    """The method is one that the drive lists, and the speeds that are asked for are objects that it has."""
    for index, sub, _, why in wanted.homing_speeds(node):
        if not sheet.has(index, sub) and index not in node.profile.optional:
            problem = message(
                "on_paper.not_in_sheet_but", where=where(index, sub), sheet=sheet.name, need=why
            )
            yield _to_do(problem, message(f"on_paper.do.{index:04X}"), WRONG)
    methods = sheet.homing_methods
    homes = node.homing_method and not node.absolute
    if methods and homes and node.homing_method not in methods:
        allowed = ", ".join(map(str, methods))
        problem = message(
            "on_paper.homing_listed", sheet=sheet.name, allowed=allowed, wanted=node.homing_method
        )
        yield _to_do(problem, message("on_paper.do.one_of_these"), WRONG)


def _of_mapping(settings: Settings, sheet: Sheet) -> Iterator[Message]:
    for used in wanted.pdos_of(settings):
        if used.optional:
            continue
        facts = {"pdo": used.title, "sheet": sheet.name}
        if not (sheet.holds(used.parameters) and sheet.holds(used.mapping)):
            objects = {"parameters": used.parameters, "mapping": used.mapping}
            problem = message("on_paper.no_pdo", **facts, **objects, need=used.what)
            yield _to_do(problem, message("on_paper.do.other_pdo"))
            continue
        room = len(sheet.subs(used.mapping))
        if len(used.entries) > room:
            yield _to_do(message("on_paper.no_room", **facts, count=len(used.entries), room=room), OTHERWISE)
        if sum(entry & 0xFF for entry in used.entries) > MAX_BITS:
            yield message("on_paper.too_many_bits", pdo=used.title, most=MAX_BITS)
        for place, entry in enumerate(used.entries, 1):
            yield from _of_entry(used, place, entry, sheet)


def _of_entry(used: Pdo, place: int, entry: int, sheet: Sheet) -> Iterator[Message]:
    index, sub, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
    facts = {"where": where(index, sub), "sheet": sheet.name, "need": used.what}
    found = sheet.find(index, sub)
    if found is None:
        yield _to_do(message("on_paper.not_in_sheet_but", **facts), OTHERWISE)
        return
    if not found.pdo_mappable or found.access_type not in (INTO if used.kind is RPDO else OUT_OF):
        mappable = Key("on_paper.yes" if found.pdo_mappable else "on_paper.no")
        access = {"pdo": used.title, "access": found.access_type, "mappable": mappable}
        yield _to_do(message("on_paper.not_mappable", **facts, **access), OTHERWISE, WRONG)
    if found.data_type not in INTEGERS or INTEGERS[found.data_type][0] != bits:
        problem = message("on_paper.data_type", **facts, found=f"{found.data_type:#06x}", bits=bits)
        yield _to_do(problem, OTHERWISE, WRONG)
    held = sheet.find(used.mapping, place)
    if held is not None and not held.writable and sheet.default(used.mapping, place) != entry:
        problem = message("on_paper.mapping_fixed", **{**facts, "where": where(used.mapping, place)})
        yield _to_do(problem, OTHERWISE, WRONG)


def _is_mapping(setting: Setting) -> bool:
    return 0x1600 <= setting.index < 0x1800 or 0x1A00 <= setting.index < 0x1C00


def _of_setting(setting: Setting, sheet: Sheet) -> Iterator[Message]:
    """What is in the way of one value."""
    found = sheet.find(setting.index, setting.sub)
    facts = {"where": setting.where, "sheet": sheet.name, "need": setting.why}
    if found is None:
        if setting.waived or not setting.optional:
            yield message("on_paper.not_in_sheet_but", **facts)
        return
    shown = partial(shown_at, setting.index, setting.sub)
    default = sheet.default(setting.index, setting.sub)
    if not found.writable:
        if default is not None and (default ^ setting.value) & setting.mask:
            yield message("on_paper.read_only", **facts, default=shown(default), wanted=shown(setting.value))
        return
    least, most = range_of(found)
    if least is not None and most is not None and not least <= setting.value <= most:
        values = {"wanted": shown(setting.value), "least": shown(least), "most": shown(most)}
        yield message("on_paper.beyond_range", **facts, **values)
