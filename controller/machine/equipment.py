"""The tables of a machine file beside its axes: spindle, inputs and outputs, clamps.

Every refusal is a ``ConfigError`` in the form of ``toml_table``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from controller.geometry.vectors import Z, norm, scale
from controller.machine import drive_profiles
from controller.machine.model import (
    AdaptiveFeed,
    AnalogueOut,
    Axis,
    Bus,
    Clamp,
    Demand,
    Following,
    Homing,
    Io,
    Machine,
    Orient,
    Sensor,
    Spindle,
    SpindlePosition,
    Stopping,
    Temperature,
    WorkTable,
)
from controller.machine.named_files import NamedFiles
from controller.machine.toml_table import Table
from controller.messages import Key, Said, said
from drives.settings import DEMAND, OFF_DEMAND

SENSORS = ("probe", "setter")  # on = touched
INPUTS = (
    "estop",
    "door",
    "power",
    "tool_clamped",
    "coolant_flow",
    "feed_stop",
    *SENSORS,
)  # beside those that clamps name
OUTPUTS = ("coolant", "mist")
# Of the drive's own window (following_error): what the controller allows at rest, and of that in position.
REST_SHARE = IN_POSITION_SHARE = 0.1
MAX_BITS = 64  # of a PDO
MAX_CHANNELS = 4  # of 16 bits in one
INT16 = -(2**15), 2**15 - 1
# That programs have for what is the machine's own.
M_CODE = re.compile(r"M(1[0-8]|2[0-8]|3[1-9]|4[0-7]|5[4-9]|69|7[4-9]|8[0-9]|9[0-7]|[1-9][0-9][0-9])")
M_CODES = "M10-M18, M20-M28, M31-M47, M54-M59, M69, M74-M97, M100-M999"
MODES = {"csv": 9, "pv": 3}
TAPPING_REV_S2 = 50.0  # along a thread, where the file says nothing


def spindle(table: Table, buses: Sequence[Bus], files: NamedFiles) -> Spindle:
    """``[spindle]``: without ``node`` only what programs need, with it also its drive."""
    most = table.positive("max_rev_min")
    if not table.has("node"):
        table.finish()
        return Spindle(most)
    found = Spindle(
        max_rev_min=most,
        bus=table.text("bus", [bus.name for bus in buses], buses[0].name),
        node=table.integer("node", 1, 126),
        profile=files.profile(table),
        counts_per_rev=table.number("counts_per_rev"),
        mode=MODES[table.text("mode", tuple(MODES), "csv")],
        at_speed_share=table.number("at_speed_share", 0.001, 0.5, default=0.05),
        spin_up_s=table.number("spin_up_s", 0.1, 120.0, default=10.0),
        acceleration_rev_s2=table.positive("acceleration_rev_s2", default=50.0),
        eds=files.sheet(table),
        stopping=Stopping(0.0, *_units(table)),
        unsupervised=table.flag("unsupervised", False),
        overrides=drive_profiles.overrides(table),
    )
    found = replace(found, position=_position(table, found))
    found = replace(found, adaptive=_adaptive(table, found))
    _fits(table, found)
    table.finish()
    return found


def _position(table: Table, of: Spindle) -> SpindlePosition | None:
    """``position = { counts_per_rev, index, sub, tpdo, load, ... }``: the spindle's angle at every SYNC."""
    if not table.has("position"):
        return None
    entry = table.table("position", f"{table.name} position")
    gentle = min(of.acceleration_rev_s2, TAPPING_REV_S2)
    found = SpindlePosition(
        counts_per_rev=entry.number("counts_per_rev", default=of.counts_per_rev),
        index=entry.integer("index", 0x2000, 0x6FFF, 0x6064),
        sub=entry.integer("sub", 0, 254, 0),
        tpdo=entry.integer("tpdo", 1, 4, 2),
        load=entry.flag("load", False),
        gain_per_s=entry.number("gain_per_s", 1.0, 50.0, default=10.0),
        acceleration_rev_s2=entry.positive("acceleration_rev_s2", gentle),
        most_lag_rev=entry.number("most_lag_rev", 0.01, 10.0, default=0.5),
    )
    entry.finish()
    if found.counts_per_rev == 0.0:
        entry.refuse("counts_per_rev", "zero_encoder")
    if of.mode != MODES["csv"]:
        table.refuse("position", "thread_of_pv")
    if found.tpdo == drive_profiles.load(of.profile).tpdo:
        entry.refuse("tpdo", "tpdo_taken")
    return found


def _adaptive(table: Table, of: Spindle) -> AdaptiveFeed | None:
    """``adaptive = { load_percent, ... }``: the load that the drive tells leads the feed under M52 P1."""
    if not table.has("adaptive"):
        return None
    if of.position is None or not of.position.load:
        table.refuse("adaptive", "load_untold")
    entry = table.table("adaptive", f"{table.name} adaptive")
    target = entry.number("load_percent", 5.0, 150.0) / 100.0
    fall_s = entry.number("fall_s", 0.1, 10.0, default=0.3)
    found = AdaptiveFeed(
        target=target,
        min_share=entry.number("min_share", 0.05, 1.0, default=0.2),
        max_share=entry.number("max_share", 1.0, 1.5, default=1.0),
        fall_s=fall_s,
        rise_s=entry.number("rise_s", 0.1, 100.0, default=3.0),
        overload=entry.number("overload_percent", 10.0, 400.0) / 100.0,
        overload_s=entry.number("overload_s", 0.0, 10.0, default=0.5),
    )
    entry.finish()
    if found.rise_s < found.fall_s:
        entry.refuse("rise_s", "rise_short", fall_s=fall_s)
    if found.overload <= found.target:
        entry.refuse("overload_percent", "overload_low", percent=100.0 * target)
    return found


def _fits(table: Table, found: Spindle) -> None:
    """The target is at most an int32 (60FFh), in counts per second where the drive has no other unit."""
    if found.counts_per_rev == 0.0:
        table.refuse("counts_per_rev", "zero_encoder")
    most = (2**31 - 1) / abs(found.counts_per_rev) * 60.0
    if found.max_rev_min > most:
        table.refuse("max_rev_min", "speed_fits", speed=found.max_rev_min, most=most)


def stopping(table: Table, unit: str, inner: float) -> Stopping:
    """``quick_stop_mm_s2`` and the drive's units of an axis; ``unit`` is mm or deg, ``inner`` its size."""
    return Stopping(table.positive_or_none(f"quick_stop_{unit}_s2", abs(inner)) or 0.0, *_units(table))


def _units(table: Table) -> tuple[float, float]:
    """One unit of the drive's velocity and acceleration, where the drive cannot say what they are."""
    velocity, acceleration = "velocity_unit_counts_s", "acceleration_unit_counts_s2"
    if table.has(acceleration) and not table.has(velocity):
        table.refuse(acceleration, "unit_alone")
    return table.positive_or_none(velocity) or 0.0, table.positive_or_none(acceleration) or 0.0


def homing(table: Table, unit: str, travel: tuple[float, float], inner: float) -> Homing:
    """``homing = { ... }`` of an axis; ``unit`` is mm or deg, ``inner`` its size (sign: sense).

    Method 0 is CiA 402's "no homing required": the encoder is absolute.
    """
    entry = table.table("homing", f"{table.name} homing", optional=True)
    absolute, method = entry.flag("absolute", False), entry.integer("method", -128, 127, 37)

    def rate(key: str) -> float:
        return entry.positive_or_none(key, abs(inner)) or 0.0

    found = Homing(
        method=0 if absolute else method,
        group=entry.integer("group", 0, 99, 0),
        position=entry.number(f"position_{unit}", *travel, default=0.0) * inner,
        absolute=absolute or method == 0,
        fast=rate(f"fast_{unit}_s"),
        slow=rate(f"slow_{unit}_s"),
        acceleration=rate(f"acceleration_{unit}_s2"),
    )
    entry.finish()
    return found


def following(table: Table, unit: str, inner: float) -> Following:
    """``following = { ... }`` of an axis; by default the drive's window at full speed, a tenth at rest."""
    drives_own = table.positive(f"following_error_{unit}")
    entry = table.table("following", f"{table.name} following", optional=True)
    tightens = not entry.has(f"at_speed_{unit}")
    rest = entry.positive(f"rest_{unit}", REST_SHARE * drives_own)
    found = Following(
        rest=rest * inner,
        at_speed=entry.number(f"at_speed_{unit}", 0.0, default=drives_own) * inner,
        in_position=entry.number(f"in_position_{unit}", 0.0, rest, IN_POSITION_SHARE * rest) * inner,
        ticks=entry.integer("ticks", 1, 10, 3),
        tightens=tightens,
    )
    entry.finish()
    return found


def clamp(table: Table) -> Clamp | None:
    """``clamp = { output, input, open_s }`` of an axis."""
    if not table.has("clamp"):
        return None
    entry = table.table("clamp", f"{table.name} clamp")
    found = Clamp(
        output=entry.text("output"),
        input=entry.text("input", default=""),
        open_s=entry.number("open_s", 0.01, 30.0, default=0.5),
    )
    entry.finish()
    return found


def temperature(table: Table) -> Temperature | None:
    """``temperature = { index, sub, bits, tpdo, per_degree }`` of an axis' drive."""
    if not table.has("temperature"):
        return None
    entry = table.table("temperature", f"{table.name} temperature")
    found = Temperature(
        index=entry.integer("index", 0x2000, 0x6FFF),
        sub=entry.integer("sub", 0, 254, 0),
        bits=entry.integer("bits", 8, 32, 16),
        tpdo=entry.integer("tpdo", 1, 4),
        per_degree=entry.positive("per_degree", 1.0),
    )
    if found.bits not in (8, 16, 32):
        entry.refuse("bits", "no_bits")
    entry.finish()
    return found


def demand(table: Table) -> Demand | None:
    """``demand = { tpdo, index, every, per_count }`` of an axis' drive."""
    if not table.has("demand"):
        return None
    entry = table.table("demand", f"{table.name} demand")
    found = Demand(
        index=entry.integer("index", OFF_DEMAND, DEMAND, DEMAND),
        tpdo=entry.integer("tpdo", 1, 4),
        every=entry.integer("every", 1, 240, 1),
        per_count=entry.positive("per_count", 1.0),
    )
    if found.index not in (OFF_DEMAND, DEMAND):
        entry.refuse("index", "no_demand")
    entry.finish()
    return found


def io(
    table: Table,
    buses: Sequence[Bus],
    axes: Sequence[Axis],
    files: NamedFiles,
    of_changer: tuple[Sequence[str], Sequence[str]] = ((), ()),
) -> Io:
    """``[io]``; every bit has a name that something uses. ``of_changer``: its outputs and inputs."""
    clamps = [axis.clamp for axis in axes if axis.clamp is not None]
    digital_in, digital_out = table.names("digital_in"), table.names("digital_out")
    orient = _orient(table)
    spindles = ((orient.output, orient.input),) if orient else ()
    known = (*OUTPUTS, *(c.output for c in clamps), *(output for output, _ in spindles))
    watched = (*INPUTS, *(c.input for c in clamps if c.input), *(one for _, one in spindles))
    inputs = _bits(table, "inputs", (*watched, *of_changer[1], *digital_in))
    outputs = _bits(table, "outputs", (*known, *of_changer[0], *digital_out))
    _of_programs(table, "digital_in", digital_in, inputs, ())
    _of_programs(table, "digital_out", digital_out, outputs, (*known, *of_changer[0]))
    found = Io(
        bus=table.text("bus", [bus.name for bus in buses], buses[0].name),
        node=table.integer("node", 1, 126),
        eds=files.sheet(table),
        inputs=inputs,
        outputs=outputs,
        inverted=_inverted(table, [name for name, _ in (*inputs, *outputs)]),
        unsupervised=table.flag("unsupervised", False),
        overrides=drive_profiles.overrides(table),
        digital_in=digital_in,
        digital_out=digital_out,
        held=_held(table, digital_out),
        m_codes=_m_codes(table, digital_out),
        analogue_out=_analogue_out(table),
        orient=orient,
        changer_out=tuple(of_changer[0]),
        changer_in=tuple(name for name in of_changer[1] if name in dict(inputs)),
    )
    _has_its_bits(table, found)
    table.finish()
    return found


def _orient(table: Table) -> Orient | None:
    """``orient = { output, input, angle_deg, within_s, shift }``."""
    if not table.has("orient"):
        return None
    entry = table.table("orient", f"{table.name} orient")
    found = Orient(
        output=entry.text("output"),
        input=entry.text("input"),
        angle_deg=entry.number("angle_deg", 0.0, 360.0, default=0.0),
        within_s=entry.number("within_s", 0.1, 120.0, default=10.0),
        shift=entry.text("shift", ("X+", "X-", "Y+", "Y-")) if entry.has("shift") else "",
    )
    entry.finish()
    return found


def _has_its_bits(table: Table, io: Io) -> None:
    """The output and the input of ``orient`` are bits of the node, and no program switches them by number."""
    if io.orient is None:
        return
    for key, name, bits, others in (
        ("output", io.orient.output, io.outputs, io.digital_out),
        ("input", io.orient.input, io.inputs, io.digital_in),
    ):
        if name not in dict(bits) or name in others:
            allowed = ", ".join(one for one, _ in bits if one not in others) or Key("file.no_free_bit")
            table.refuse("orient", "orient_bit", key=key, name=name, allowed=allowed)


def _analogue_out(table: Table) -> tuple[AnalogueOut, ...]:
    """``analogue_out = { name = { channel, low, high, low_counts, high_counts } }`` in the order of E."""
    entries = table.table("analogue_out", f"{table.name} analogue_out", optional=True)
    found: dict[int, AnalogueOut] = {}
    for name in entries.written:
        entry = entries.table(name, f"{entries.name}.{name}")
        one = AnalogueOut(
            name,
            entry.integer("channel", 1, MAX_CHANNELS),
            entry.number("low", default=0.0),
            entry.number("high"),
            entry.integer("low_counts", *INT16, 0),
            entry.integer("high_counts", *INT16, INT16[1]),
        )
        entry.finish()
        if one.high <= one.low:
            entry.refuse("high", "high_low", low=one.low)
        if one.channel in found:
            twin = found[one.channel].name
            entry.refuse("channel", "channel_twice", other=twin)
        found[one.channel] = one
    return tuple(found.values())


def _of_programs(
    table: Table, key: str, names: Sequence[str], bits: Sequence[tuple[str, int]], taken: Sequence[str]
) -> None:
    """What programs switch or wait for has a bit, and is nobody else's."""
    known = [name for name, _ in bits if name not in taken]
    for name in names:
        if name not in known:
            allowed = ", ".join(known) or Key("file.no_named_bit")
            table.refuse(
                key,
                "not_of_programs",
                name=name,
                kind=Key("file.input" if key == "digital_in" else "file.output"),
                allowed=allowed,
            )


def _held(table: Table, digital_out: Sequence[str]) -> tuple[str, ...]:
    """``held``: outputs that stay as the program left them."""
    names = table.names("held")
    if any(name not in digital_out for name in names):
        allowed = ", ".join(digital_out) or Key("file.no_digital_out")
        table.refuse("held", "held_unknown", allowed=allowed)
    return names


def _m_codes(table: Table, digital_out: Sequence[str]) -> tuple[tuple[str, str, bool], ...]:
    """``m_codes = { M10 = { output = "vise", on = true } }``."""
    codes = table.table("m_codes", f"{table.name} m_codes", optional=True)
    found: list[tuple[str, str, bool]] = []
    for code in codes.written:
        if not M_CODE.fullmatch(code):
            codes.refuse(code, "no_m_code", allowed=M_CODES)
        entry = codes.table(code, f"{codes.name}.{code}")
        found.append((code, entry.text("output", digital_out), entry.flag("on", True)))
        entry.finish()
    return tuple(found)


def _bits(table: Table, key: str, known: Sequence[str]) -> tuple[tuple[str, int], ...]:
    """``{ name = bit, ... }`` in the order of the bits."""
    entry = table.table(key, f"{table.name} {key}", optional=True)
    found: dict[str, int] = {}
    for name in known:
        if entry.has(name) and name not in found:
            found[name] = entry.integer(name, 0, MAX_BITS - 1)
            twins = [other for other, bit in found.items() if bit == found[name] and other != name]
            if twins:
                entry.refuse(name, "bit_twice", other=twins[0])
    for name in known:
        entry.get(name, "", 0)  # known, so that ``finish`` lists it among what is allowed
    entry.finish()
    return tuple(sorted(found.items(), key=lambda row: row[1]))


def _inverted(table: Table, names: Sequence[str]) -> tuple[str, ...]:
    allowed = said("file.may.inverted", names=", ".join(names) or Key("file.bits"))
    value = table.get("inverted", allowed, [])
    if not isinstance(value, list) or not all(name in names for name in value):
        table.refuse("inverted", "inverted_unknown", allowed=allowed)
    return tuple(value)


def audit(axes: Sequence[Axis], devices: tuple[Spindle | None, Io | None], top: Table) -> None:
    """What only the whole file can show: nodes used twice, clamps without their bits."""
    turning, found = devices
    taken: dict[tuple[str, int], Said | str] = {
        (axis.bus, axis.node): said("file.axis", name=axis.name) for axis in axes
    }
    others = []
    if turning is not None and turning.is_driven:
        others.append(("spindle", turning.bus, turning.node))
    if found is not None:
        others.append(("io", found.bus, found.node))
    for key, bus, node in others:
        table = top.table(key, f"[{key}]")
        if (bus, node) in taken:
            table.refuse("node", "node_twice", other=taken[bus, node], bus=bus)
        taken[bus, node] = table.name
    for axis in axes:
        if axis.clamp is not None:
            _audit_clamp(axis.clamp, top.entry("axis", axis.name), found)


def _audit_clamp(its: Clamp, axis: Table, found: Io | None) -> None:
    table = axis.table("clamp", f"{axis.name} clamp")
    if found is None or found.output(its.output) is None:
        names = ", ".join(name for name, _ in found.outputs) if found else Key("file.no_io")
        table.refuse("output", "no_output", allowed=names)
    if its.input and found.input(its.input) is None:
        names = ", ".join(name for name, _ in found.inputs)
        table.refuse("input", "no_input", allowed=names)


def sensor(table: Table, in_spindle: bool) -> Sensor:
    """``[probe]``, a touch probe in the spindle, or ``[setter]``, which tools touch."""
    found = Sensor(
        input=table.text("input", SENSORS, SENSORS[not in_spindle]),
        overtravel_mm=table.number("overtravel_mm", 0.05, 50.0, default=2.0),
        latency_s=table.number("latency_ms", 0.0, 50.0, default=0.0) * 1e-3,
        latch_tpdo=table.integer("latch_tpdo", 0, 4, 0),
    )
    if in_spindle:
        tool, release_mm = table.integer("tool", 1, 99999), table.number("release_mm", 0.1, 20.0, default=2.0)
        found = replace(found, tool=tool, release_mm=release_mm)
    else:
        found = replace(found, point=table.vector("point_mm"), radius_mm=table.positive("radius_mm"))
    table.finish()
    return found


def audit_sensors(machine: Machine, top: Table) -> None:
    """Their inputs are bits of the node, of their own, and the probe is a tool of the table."""
    for key, one in (("probe", machine.probe), ("setter", machine.setter)):
        if one is None:
            continue
        table = top.table(key, f"[{key}]")
        table.text("input", default=one.input)
        names = [name for name, _ in machine.io.inputs] if machine.io is not None else []
        if one.input not in names:
            allowed = ", ".join(names) or Key("file.no_io")
            table.refuse("input", "no_input", allowed=allowed)
        if key == "probe" and machine.tool_as_told(one.tool) is None:
            table.integer("tool", 1, 99999)
            known = ", ".join(str(tool.number) for tool in machine.tools) or Key("file.no_tools")
            table.refuse("tool", "no_probe", allowed=known)


def work_table(table: Table) -> WorkTable:
    """``[table]``: the disc under the work, in the table frame with all rotaries at zero."""
    normal = table.vector("normal", Z)
    if norm(normal) < 1e-9:
        table.refuse("normal", "no_face")
    found = WorkTable(
        centre=table.vector("centre_mm"),
        normal=scale(normal, 1.0 / norm(normal)),
        radius_mm=table.positive("radius_mm"),
        thickness_mm=table.positive("thickness_mm", default=20.0),
    )
    table.finish()
    return found
