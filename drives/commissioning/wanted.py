"""Everything a node is told at commissioning, in order, as values: nothing here speaks to a bus.

A ``Step`` is what belongs together, so that a step that is already so is left alone:
CiA 301's order of remapping goes through states (off, count 0) that must not be seen as
settings of their own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from drives import pdo
from drives.commissioning.sheet import NO_REMOTE, Sheet
from drives.commissioning.units import Units
from drives.profile import CyclicMode, Profile, Supervision
from drives.settings import (
    MODE_EVERY_MS,
    TEMPERATURE_EVERY_MS,
    IoSettings,
    MasterSettings,
    NodeSettings,
    SpindleSettings,
)
from drives.texts import Message, message

Settings = NodeSettings | SpindleSettings | IoSettings

OFF = 0x8000_0000  # COB-ID bit 31
COB_ID_MASK = 0x8000_07FF
GENERATES = 0x4000_0000  # of 1005h: the device sends SYNC itself
CONTROLWORD, TARGET, SETPOINT = 0x6040_0010, 0x607A_0020, 0x60C1_0120
VELOCITY_OFFSET, TARGET_VELOCITY = 0x60B1_0020, 0x60FF_0020
MODE_DISPLAY = 0x6061_0008
STATUSWORD, POSITION, VELOCITY = 0x6041_0010, 0x6064_0020, 0x606C_0020
EVERY_TOUCH = 0x13  # 60B8h: probe 1 on, continuous, rising edge of its input
TORQUE = 0x6077_0010
PROBE_STATUS, PROBE_POSITION = 0x60B9_0010, 0x60BA_0020
SYNCHRONOUS, ON_CHANGE = 1, 255  # transmission types
RPDO, TPDO = (0x1400, 0x1600, pdo.RPDO1), (0x1800, 0x1A00, pdo.TPDO1)
TEMPERATURE_MS = 1000  # between two that tell the same
PREDEFINED = 4  # PDOs with an identifier of the pre-defined connection set
LINEAR = 0  # 60C0h: linear interpolation


def where(index: int, sub: int = 0) -> Message:
    """An object by its index and sub-index."""
    return message("drive.object", index=index, sub=sub)


@dataclass(frozen=True, slots=True)
class Setting:
    """One object to write and read back."""

    index: int
    sub: int
    value: int
    why: Message | str  # completes "... is needed"; words where they are those of a profile
    optional: bool = False  # only where the data sheet has it
    mask: int = -1  # what must agree when read back
    waived: bool = False  # unsupervised = true: a drive that does not take it is accepted, with a warning

    @property
    def place(self) -> tuple[int, int]:
        return self.index, self.sub

    @property
    def where(self) -> Message:
        return where(self.index, self.sub)


@dataclass(frozen=True, slots=True)
class Step:
    """Settings that are written together, in this order, unless all of their last values are there."""

    settings: tuple[Setting, ...]

    @property
    def outcome(self) -> tuple[Setting, ...]:
        """What must read so afterwards: the last word on every object."""
        last = {setting.place: setting for setting in self.settings}
        return tuple(last.values())


def steps_of(
    settings: Settings, master: MasterSettings, sheet: Sheet, units: Units | None = None
) -> Iterator[Step]:
    """All that a node is told, in order; process data off before it is changed.

    Without ``units``, which the drive itself must be asked for, nothing that is told in them. How it stops
    is ``stopping``'s. Raises UnitError.
    """
    if isinstance(settings, IoSettings):
        yield from _io(settings, master, sheet)
        return
    if isinstance(settings, NodeSettings):
        steps = _axis(settings, master, sheet, units)
    else:
        steps = _spindle(settings, master, sheet)
    for step in steps:
        yield _with_optional(step, settings.profile.optional)


def _with_optional(step: Step, indexes: tuple[int, ...]) -> Step:
    """What the family does without, where the drive lacks it."""
    return Step(tuple(replace(one, optional=one.optional or one.index in indexes) for one in step.settings))


def _axis(node: NodeSettings, master: MasterSettings, sheet: Sheet, units: Units | None) -> Iterator[Step]:
    used = [each for each in axis_pdos(node) if not each.optional or carries(each, sheet)]
    yield from _process_data(used, node.node, sheet)
    yield from _interpolation(node.profile, node.period_s)
    yield from _supervision(node.profile, master, sheet, node.unsupervised, node.brake)
    yield from _limits(node)
    yield from _homing(node)
    if units is not None:
        yield from homing_in_units(node, units)
    if node.probe_tpdo:
        yield _one(0x60B8, 0, EVERY_TOUCH, message("setting.touch_stored"))
    for write in node.profile.writes:
        yield _one(write.index, write.sub, write.value, write.why)


def _spindle(node: SpindleSettings, master: MasterSettings, sheet: Sheet) -> Iterator[Step]:
    yield from _process_data(spindle_pdos(node), node.node, sheet)
    value, exponent = interpolation_time(master.period_s) or (0, 0)
    if value:
        why = message("setting.with_tick")
        yield Step(
            (Setting(0x60C2, 1, value, why, optional=True), Setting(0x60C2, 2, exponent, why, optional=True))
        )
    yield from _supervision(node.profile, master, sheet, node.unsupervised)
    for write in node.profile.writes:
        yield _one(write.index, write.sub, write.value, write.why)


def _io(node: IoSettings, master: MasterSettings, sheet: Sheet) -> Iterator[Step]:
    yield from _process_data(io_pdos(node), node.node, sheet)
    yield _one(0x6005, 0, 1, message("setting.inputs_on_change"), optional=True)
    for sub in range(1, node.outputs + 1):
        why = message("setting.outputs_off")
        yield _one(0x6206, sub, 0xFF, why, optional=True)
        yield _one(0x6207, sub, 0, why, optional=True)
    for sub, counts in enumerate(node.analogue, 1):
        why = message("setting.analogue_to_rest")
        yield _one(0x6443, sub, 1, why, optional=True)
        yield _one(0x6444, sub, counts, why, optional=True)
    yield from _heartbeats(master, sheet, node.unsupervised, produced_s=node.heartbeat_s)


# --- process data ----------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Pdo:
    """One process data object: which, how it is sent, and what is in it."""

    kind: tuple[int, int, int]  # RPDO or TPDO: parameters, mapping, identifier of the first
    number: int
    transmission: int
    entries: tuple[int, ...]
    what: Message
    event_ms: int = 0  # event timer, sub 5
    quiet_ms: int = 0  # at least between two of them, sub 3
    optional: bool = False  # only where the drive can

    @property
    def parameters(self) -> int:
        return self.kind[0] + self.number - 1

    @property
    def mapping(self) -> int:
        return self.kind[1] + self.number - 1

    @property
    def title(self) -> str:
        return f"{'RPDO' if self.kind is RPDO else 'TPDO'} {self.number}"

    def can_id(self, node: int) -> int:
        return self.kind[2] + 0x100 * (self.number - 1) + node


def axis_pdos(node: NodeSettings) -> Iterator[Pdo]:
    """What goes to and comes from a drive that takes part in the path."""
    profile = node.profile
    deadline_s = node.setpoint_deadline_s or MasterSettings().consumer_s
    silence_ms = math.ceil(1e3 * deadline_s - 1e-6)  # 1400h:05, where there is one
    target = TARGET if profile.mode is CyclicMode.CSP else SETPOINT
    if node.feed_forward:
        entries, what = (TARGET, VELOCITY_OFFSET), message("setting.setpoints", number=profile.rpdo)
        yield Pdo(RPDO, profile.rpdo, SYNCHRONOUS, entries, what, silence_ms)
        what = message("setting.controlword", number=profile.command_rpdo)
        yield Pdo(RPDO, profile.command_rpdo, ON_CHANGE, (CONTROLWORD,), what)
    else:
        what = message("setting.setpoints", number=profile.rpdo)
        yield Pdo(RPDO, profile.rpdo, SYNCHRONOUS, (CONTROLWORD, target), what, silence_ms)
    what = message("setting.feedback", number=profile.tpdo)
    yield Pdo(TPDO, profile.tpdo, node.feedback_every, (STATUSWORD, POSITION), what)
    if node.probe_tpdo:
        entries = (PROBE_STATUS, PROBE_POSITION)
        what = message("setting.touches", number=node.probe_tpdo)
        yield Pdo(TPDO, node.probe_tpdo, ON_CHANGE, entries, what)
    if node.temperature_tpdo:
        what = message("setting.temperature", number=node.temperature_tpdo)
        warmth = (node.temperature_entry,)
        times_ms = TEMPERATURE_MS, TEMPERATURE_EVERY_MS
        yield Pdo(TPDO, node.temperature_tpdo, ON_CHANGE, warmth, what, *times_ms)
    if node.demand_tpdo:
        what = message("setting.demand", number=node.demand_tpdo)
        demand = (node.demand_index << 16 | 32,)
        yield Pdo(TPDO, node.demand_tpdo, node.demand_every, demand, what, optional=True)
    if node.load_tpdo and not node.load_node:
        what = message("setting.load_encoder", number=node.load_tpdo)
        yield Pdo(TPDO, node.load_tpdo, node.load_every, (node.load_entry,), what)
    if not node.mode_tpdo:
        return
    what = message("setting.mode", number=node.mode_tpdo)
    yield Pdo(TPDO, node.mode_tpdo, ON_CHANGE, (MODE_DISPLAY,), what, MODE_EVERY_MS, optional=True)


def carries(used: Pdo, sheet: Sheet) -> bool:
    """Whether a drive can send a TPDO as it is wanted: it has it, and lets its objects be mapped."""
    if not (sheet.holds(used.parameters) and sheet.holds(used.mapping)):
        return False
    for place, entry in enumerate(used.entries, 1):
        found, held = sheet.find(entry >> 16, entry >> 8 & 0xFF), sheet.find(used.mapping, place)
        fixed = held is not None and not held.writable and sheet.default(used.mapping, place) != entry
        if found is None or not found.pdo_mappable or fixed:
            return False
    return True


def spindle_pdos(node: SpindleSettings) -> tuple[Pdo, ...]:
    """What goes to and comes from the spindle's drive."""
    out = message("setting.speed", number=node.profile.rpdo)
    back = message("setting.actual_speed", number=node.profile.tpdo)
    turned = (node.position_entry, TORQUE) if node.tells_load else (node.position_entry,)
    angle = message("setting.spindle_position", number=node.position_tpdo)
    return (
        Pdo(RPDO, node.profile.rpdo, ON_CHANGE, (CONTROLWORD, TARGET_VELOCITY), out),
        Pdo(TPDO, node.profile.tpdo, node.feedback_every, (STATUSWORD, VELOCITY), back),
        *((Pdo(TPDO, node.position_tpdo, SYNCHRONOUS, turned, angle),) if node.position_tpdo else ()),
    )


def io_pdos(node: IoSettings) -> tuple[Pdo, ...]:
    """What goes to and comes from a node with inputs and outputs (CiA 401)."""
    outputs = tuple(0x6200_0008 | sub << 8 for sub in range(1, node.outputs + 1))
    inputs = tuple(0x6000_0008 | sub << 8 for sub in range(1, node.inputs + 1))
    analogue = tuple(0x6411_0010 | sub << 8 for sub in range(1, len(node.analogue) + 1))
    analogue += (node.speed_entry,) if node.speed_entry else ()
    number, often_ms = node.feedback_tpdo, round(node.feedback_every_s * 1e3)
    measured = Pdo(
        TPDO,
        number,
        ON_CHANGE,
        (node.feedback_entry,),
        message("setting.spindle_measured", number=number),
        often_ms,
        often_ms // 2,
    )
    every_ms = round(node.inputs_every_s * 1e3)
    return (
        Pdo(RPDO, 1, ON_CHANGE, outputs, message("setting.outputs", number=1)),
        *((Pdo(RPDO, 2, ON_CHANGE, analogue, message("setting.analogue", number=2)),) if analogue else ()),
        Pdo(TPDO, 1, ON_CHANGE, inputs, message("setting.inputs", number=1), every_ms),
        *((measured,) if node.feedback_entry else ()),
    )


def pdos_of(settings: Settings) -> tuple[Pdo, ...]:
    """The process data of any kind of node."""
    if isinstance(settings, NodeSettings):
        return tuple(axis_pdos(settings))
    return spindle_pdos(settings) if isinstance(settings, SpindleSettings) else io_pdos(settings)


def _process_data(used: Iterable[Pdo], node: int, sheet: Sheet) -> Iterator[Step]:
    """Every PDO that is not used goes off, then those that are used are mapped."""
    used = tuple(used)
    yield _one(0x1005, 0, pdo.SYNC, message("setting.sync"), optional=True, mask=GENERATES | 0x7FF)
    taken = {each.parameters for each in used}
    for kind in (RPDO, TPDO):
        for number in range(1, 0x201):
            parameters = kind[0] + number - 1
            if sheet.holds(parameters) and parameters not in taken:
                unused = Pdo(kind, number, 0, (), message("setting.unused"))
                yield _switched_off(unused, node, sheet)
    for each in used:
        yield _mapped(each, node, sheet)


def _switched_off(unused: Pdo, node: int, sheet: Sheet) -> Step:
    """By its identifier; where that is fixed, by taking all objects out of it."""
    if sheet.writable(unused.parameters, 1):
        beyond = unused.number > PREDEFINED
        can_id = sheet.default(unused.parameters, 1) or 0 if beyond else unused.can_id(node)
        return _one(unused.parameters, 1, OFF | can_id, unused.what, mask=OFF)
    return _one(unused.mapping, 0, 0, unused.what, optional=True)


def _mapped(used: Pdo, node: int, sheet: Sheet) -> Step:
    """CiA 301's order of remapping (7.5.2.36): off, type, count 0, entries, count, on."""
    parameters, mapping, what = used.parameters, used.mapping, used.what
    can_id = used.can_id(node)
    remote = (sheet.default(parameters, 1) or 0) & NO_REMOTE if used.kind is TPDO else 0
    settings = []
    if sheet.writable(parameters, 1) or not sheet.has(parameters, 1):
        settings.append(Setting(parameters, 1, OFF | remote | can_id, what, mask=COB_ID_MASK))
    settings.append(Setting(parameters, 2, used.transmission, _when(used)))
    if used.kind is TPDO:
        # Left over times would hold feedback back, or send it between SYNCs.
        key = "setting.at_most_every" if used.quiet_ms else "setting.not_held"
        held = message(key, what=what, ms=used.quiet_ms)
        settings.append(Setting(parameters, 3, 10 * used.quiet_ms, held, optional=not used.quiet_ms))
        key = "setting.again" if used.event_ms else "setting.not_again"
        event = message(key, what=what, ms=used.event_ms)
        needed = used.event_ms and not used.optional
        settings.append(Setting(parameters, 5, used.event_ms, event, optional=not needed))
    elif used.event_ms:
        overdue = message("setting.overdue", what=what, ms=used.event_ms)
        settings.append(Setting(parameters, 5, used.event_ms, overdue, optional=True))
    settings.append(Setting(mapping, 0, 0, what))
    settings += [Setting(mapping, sub, entry, what) for sub, entry in enumerate(used.entries, 1)]
    settings.append(Setting(mapping, 0, len(used.entries), what))
    settings.append(Setting(parameters, 1, remote | can_id, what, mask=COB_ID_MASK))
    return Step(tuple(settings))


def _when(used: Pdo) -> Message:
    if used.transmission == ON_CHANGE:
        return message("setting.on_change", what=used.what)
    key = "setting.every_sync" if used.transmission == 1 else "setting.every_nth_sync"
    return message(key, what=used.what, count=used.transmission)


# --- the rest ----------------------------------------------------------------------


def interpolation_time(
    period_s: float, exponents: tuple[int, ...] = (-3, -4, -5, -6)
) -> tuple[int, int] | None:
    """A period as 60C2h wants it: (value 1 .. 255, power of ten), in the coarsest unit that is exact.

    Many drives take milliseconds only. None for what has no such form.
    """
    for exponent in sorted(exponents, reverse=True):
        value = period_s * 10.0**-exponent
        if abs(value - round(value)) < 1e-6 and 1 <= round(value) <= 255:
            return round(value), exponent
    return None


def _interpolation(profile: Profile, period_s: float) -> Iterator[Step]:
    value, exponent = interpolation_time(period_s, profile.period_exponents) or (0, 0)
    why = message("setting.interpolates", ms=period_s * 1e3)
    yield Step((Setting(0x60C2, 1, value, why), Setting(0x60C2, 2, exponent, why)))
    if profile.mode is CyclicMode.IP:
        # Clearing the buffer (60C4h:06) cannot be read back: it goes along when the mode is set up.
        why, empty = message("setting.on_a_line"), message("setting.empty_buffer")
        clear, enable = (Setting(0x60C4, 6, on, empty, optional=True) for on in (0, 1))
        yield Step((clear, Setting(0x60C0, 0, LINEAR, why), enable))


def _supervision(
    profile: Profile, master: MasterSettings, sheet: Sheet, unsupervised: bool, braked: bool = False
) -> Iterator[Step]:
    """The drive must stop by itself when the controller goes silent; by heartbeat or guarding, never both."""
    why = message("setting.dead_controller")
    if profile.supervision is Supervision.GUARDING:
        yield _one(0x1017, 0, 0, message("setting.either_guard"), optional=True)
        poll_ms, factor = guarding(master)
        yield _one(0x100C, 0, poll_ms, why, waived=unsupervised)
        yield _one(0x100D, 0, factor, why, waived=unsupervised)
    else:
        none = profile.supervision is Supervision.NONE
        yield from _heartbeats(master, sheet, unsupervised or none, master.heartbeat_s)
    if profile.abort_code is not None:
        yield _one(
            0x6007, 0, profile.abort_code, message("setting.dead_controller_stop"), waived=unsupervised
        )
    if profile.quick_stop_code is not None:
        yield _one(0x605A, 0, *_quick_stop(profile.quick_stop_code, braked))
    if profile.error_behaviour is not None:
        yield _one(0x1029, 1, profile.error_behaviour, message("setting.dead_controller_stay"))


def _quick_stop(code: int, braked: bool) -> tuple[int, Message]:
    """605Ah and why. Codes 1 .. 4 take the current at standstill while the brake is still closing;
    5 .. 8 are the same ramps, and keep it: the controller then disables the drive in the orderly way.
    """
    if braked and 1 <= code <= 4:
        return code + 4, message("setting.axis_falls")
    return code, message("setting.known_quick_stop")


def guarding(master: MasterSettings) -> tuple[int, int]:
    """Guard time (ms, 100Ch) and life time factor (100Dh) that together are the consumer's time."""
    poll_ms = round(master.heartbeat_s * 1e3)
    return poll_ms, max(2, round(master.consumer_s / master.heartbeat_s))


def _heartbeats(
    master: MasterSettings, sheet: Sheet, unsupervised: bool, produced_s: float
) -> Iterator[Step]:
    silence = master.node_id << 16 | round(master.consumer_s * 1e3)
    yield _one(0x1016, 1, silence, message("setting.dead_controller"), waived=unsupervised)
    for sub in sheet.subs(0x1016):
        if sub > 1:
            yield _one(0x1016, sub, 0, message("setting.nobody_elses"), optional=True)
    for index in (0x100C, 0x100D):
        yield _one(index, 0, 0, message("setting.either_guard"), optional=True)
    yield _one(0x1017, 0, round(produced_s * 1e3), message("setting.dead_drive"))


def _limits(node: NodeSettings) -> Iterator[Step]:
    yield _one(0x6065, 0, node.following_error_counts, message("setting.does_not_follow"))
    why = message("setting.travel")
    lower = Setting(0x607D, 1, node.counts_min, why, optional=True)
    yield Step((lower, Setting(0x607D, 2, node.counts_max, why, optional=True)))


def _homing(node: NodeSettings) -> Iterator[Step]:
    """Not of a drive that knows its place: absolute by the machine file, or by its family (method 0)."""
    if node.homing_method and not node.absolute:
        yield _one(0x6098, 0, node.homing_method, message("setting.how_to_home"))
        if node.profile.home_offset is not None:
            homed = message("setting.homed_position")
            yield _one(node.profile.home_offset, 0, node.homing_position_counts, homed)


def homing_speeds(node: NodeSettings) -> Iterator[tuple[int, int, float, Message]]:
    """What is asked of homing: index, sub-index, counts/s or counts/s2, and why."""
    for index, sub, counts, what in (
        (0x6099, 1, node.homing_fast_counts_s, "switch"),
        (0x6099, 2, node.homing_slow_counts_s, "zero"),
        (0x609A, 0, node.homing_acceleration_counts_s2, "homing"),
    ):
        if counts:
            yield index, sub, counts, message(f"setting.how_fast.{what}")


def homing_in_units(node: NodeSettings, units: Units) -> Iterator[Step]:
    """The same as the drive is told it. Raises UnitError."""
    for index, sub, counts, why in homing_speeds(node):
        convert = units.velocity if index == 0x6099 else units.acceleration
        yield _one(index, sub, convert(counts, where(index, sub)), why)


def _one(
    index: int,
    sub: int,
    value: int,
    why: Message | str,
    optional: bool = False,
    mask: int = -1,
    waived: bool = False,
) -> Step:
    return Step((Setting(index, sub, value, why, optional or waived, mask, waived),))
