"""TOML to ``Machine``: the edge where degrees, counts and the configured sense end.

``load(name_or_path)`` is the verb. Everything in a machine file is in millimetres, degrees and seconds;
a rotary's travel, homing position and counts are in its configured ``sense``; only ``direction`` is geometry:
the right-hand axis about which the carried body turns for positive *carried* angles.
Every refusal is a ``ConfigError`` in the form of ``toml_table``.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller.geometry.vectors import ZERO, Vector, X, Y, Z, cross, norm, scale, subtract
from controller.machine import (
    changer_table,
    compensation,
    deviation_tables,
    drive_profiles,
    equipment,
    macro_table,
    offset_table,
    program_table,
)
from controller.machine.kinematics import builds
from controller.machine.model import (
    ARC_TOLERANCE_MM,
    CALL_LEVELS,
    DIALECTS,
    JOINT_TOLERANCE_DEG,
    JOINT_TOLERANCE_MM,
    KEPT_OFFSETS,
    LONGEST_PROGRAM_H,
    MACRO_VARIABLES,
    MAX_CALL_LEVELS,
    MAX_PROGRAM_H,
    MAX_PROGRAM_PASSES,
    MAX_QUICK_STOP_S,
    MAX_WEAR_MM,
    PROGRAM_PASSES,
    START_STATES,
    TOOL_CHANGE_S,
    USUAL_BUILD,
    WITHOUT_POINT,
    Axis,
    Bus,
    Kind,
    Limits,
    Machine,
    Sense,
    Spindle,
    Tool,
)
from controller.machine.named_files import SHIPPED as SHIPPED
from controller.machine.named_files import NamedFiles, beside
from controller.machine.named_files import written as written
from controller.machine.nodes import all_settings as all_settings
from controller.machine.nodes import bus_settings as bus_settings
from controller.machine.nodes import eds_of as eds_of
from controller.machine.nodes import io_settings as io_settings
from controller.machine.nodes import master_settings as master_settings
from controller.machine.nodes import node_settings as node_settings
from controller.machine.nodes import spindle_settings as spindle_settings
from controller.machine.toml_table import ConfigError, Table, parse, read_text, span
from controller.messages import chain, said
from drives.settings import INT32_MAX

TOOL_TABLE = "tools.toml"
LINEAR = {"X": X, "Y": Y, "Z": Z}
PLACEMENTS = ("single", "double", "optimal", "auto")  # of the cutter on surfaces
PERIODS_S = (0.0005, 0.01)
STOCK_MS, MAX_STOCK_MS = 16.0, 500.0
LATE = ("stop", "count")  # what too many late ticks do
CONTOUR_ERROR = ("warn", "slow", "hold")  # what the tool off its path by more than its tolerance does
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)  # CiA 301, table 1
PARALLEL = 1e-6


def load(source: str | Path) -> Machine:
    """The machine of a file, or of a shipped file by its name ("trunnion").

    Raises ``ConfigError``. ``Machine.text`` is complete: the tool table that ``[tools] file`` names is
    appended, and what ``named_files`` takes along; so ``read(machine.text, ...)`` needs no other file.
    """
    path = _find(source)
    text = read_text(path)
    file = path.name
    top = parse(text, file)
    tools = top.table("tools", "[tools]", optional=True)
    if top.has("tool"):
        if tools.has("file"):
            tools.refuse("file", "tools_twice")
        return read(text, file, path.parent)
    table = beside(path.parent, tools.text("file", default=TOOL_TABLE), tools)
    entries = read_text(table)
    check = parse(entries, table.name)  # so that its mistakes are refused under its own name
    _tools(check)
    check.finish()
    return read(f"{text.rstrip()}\n\n# {table.name}\n{entries}", file, path.parent)


def read(text: str, file: str, folder: Path | None = None) -> Machine:
    """The machine of a complete text (with its ``[[tool]]`` tables).

    ``folder``: where files that it names and has not with it are looked for. Raises ``ConfigError``.
    """
    return read_table(parse(text, file), text, folder)


def alone(machine: Machine) -> str:
    """The text that ``load`` takes with no other file: the tools are in it, and their file is not named."""
    lines, section = [], ""
    for line in machine.text.splitlines():
        section = line.strip() if line.lstrip().startswith("[") else section
        named = section == "[tools]" and re.match(r"\s*file\s*=", line)
        lines.append(f"# {line}  # its tables stand below" if named else line)
    return "\n".join([*lines, ""])


def read_table(top: Table, text: str, folder: Path | None = None) -> Machine:
    """As ``read``; the table then knows which keys it was asked for, and in which range each is."""
    general = top.table("machine", "[machine]")
    tools = top.table("tools", "[tools]", optional=True)
    tools.text("file", default=TOOL_TABLE)  # its entries are in the text by now
    files, buses = NamedFiles(top, folder), _buses(top)
    axes = tuple(_axis(table, buses, files) for table in top.tables("axis"))
    offsets = top.table("offsets", "[offsets]", optional=True)
    found = offset_table.offsets(offsets, axes)
    _sync(general)
    dialect = general.text("dialect", DIALECTS, DIALECTS[0])
    machine = Machine(
        **_equipment(top, buses, axes, files),
        name=general.text("name"),
        period_s=general.number("period_s", *PERIODS_S, default=0.002),
        clearance_mm=general.positive("clearance_mm"),
        lead_mm=general.positive("lead_mm"),
        retract_mm=general.number("retract_mm"),
        rapid_share=general.number("rapid_share", 0.01, 1.0, default=1.0),
        gouge=general.text("gouge", ("refuse", "warn"), "refuse"),
        tool_lines=general.text("tool_lines", ("great_circle", "joints"), "great_circle"),
        max_bus_share=general.number("max_bus_share", 0.01, 1.0, default=0.8),
        stock_s=general.number("stock_ms", 0.0, MAX_STOCK_MS, default=STOCK_MS) / 1000.0,
        late=general.text("late", LATE, "stop"),
        contour_error=general.text("contour_error", CONTOUR_ERROR, CONTOUR_ERROR[0]),
        skip_limit_per_s=general.number("skip_limit_per_s", 0.0, default=25.0),
        axes=axes,
        buses=buses,
        tools=_tools(top),
        offsets=tuple(one.frame for one in found),
        turned_rad=tuple(one.turned_rad for one in found),
        unset=tuple(name for name in KEPT_OFFSETS[1:] if not offsets.has(name)),
        text=files.completed(text),
        tip_acceleration_mm_s2=general.positive_or_none("tip_acceleration_mm_s2"),
        axis_speed_rad_s=general.positive_or_none("axis_speed_deg_s", math.radians(1.0)),
        placement=general.text("placement", PLACEMENTS, "single"),
        max_quick_stop_s=general.number("max_quick_stop_s", 0.01, 60.0, default=MAX_QUICK_STOP_S),
        max_overcut_mm=general.positive_or_none("max_overcut_mm"),
        tolerance_mm=general.positive_or_none("tolerance_mm"),
        longest_program_h=general.number("longest_program_h", 0.01, MAX_PROGRAM_H, LONGEST_PROGRAM_H),
        tool_change_s=tools.number("change_s", 0.0, 3600.0, default=TOOL_CHANGE_S),
        joint_tolerance_mm=general.number("joint_tolerance_mm", 0.0, 1.0, default=JOINT_TOLERANCE_MM),
        joint_tolerance_deg=general.number("joint_tolerance_deg", 0.0, 5.0, default=JOINT_TOLERANCE_DEG),
        lead_feed_mm_s=general.positive_or_none("lead_feed", 1.0 / 60.0),
        link_mm=general.number("link_mm", 0.0, 100.0, default=0.0),
        arc_tolerance_mm=general.number("arc_tolerance_mm", 0.001, 3.0, default=ARC_TOLERANCE_MM),
        call_levels=general.integer("call_levels", 1, MAX_CALL_LEVELS, CALL_LEVELS),
        program_passes=general.integer("program_passes", 1, MAX_PROGRAM_PASSES, PROGRAM_PASSES),
        dialect=dialect,
        start_state=general.text("start_state", START_STATES, START_STATES[0]),
        kept=offset_table.kept(general, dialect),
        without_point=general.text("without_point", WITHOUT_POINT, ""),
        macro_variables=general.text("macro_variables", ("", *MACRO_VARIABLES), ""),
        sub_folders=program_table.sub_folders(general),
        own_codes=program_table.own_codes(general),
        kinematics=general.text("kinematics", tuple(builds()), USUAL_BUILD),
        straightness=deviation_tables.straightness(top.tables("straightness"), axes),
        thermal_shift_mm=deviation_tables.thermal_shift(top),
        macros=macro_table.macros(top.tables("macro")),
    )
    for table in (general, tools, top):
        table.finish()
    _audit(machine, top, general)
    return machine


def _sync(general: Table) -> None:
    """Nobody chooses it, but files from before the pump have the key."""
    if general.get("sync", '"tick"', "tick") != "tick":
        general.refuse("sync", "sync_chosen")


def _equipment(
    top: Table, buses: tuple[Bus, ...], axes: tuple[Axis, ...], files: NamedFiles
) -> dict[str, Any]:
    """Fields of ``Machine`` for what a machine has besides its axes; None where it has no such thing."""
    changes = top.has("changer")
    of_changer = changer_table.names_of(top.table("changer", "[changer]")) if changes else ((), ())
    io = equipment.io(top.table("io", "[io]"), buses, axes, files, of_changer) if top.has("io") else None
    return {
        "io": io,
        "spindle": _spindle(top, buses, files),
        "probe": equipment.sensor(top.table("probe", "[probe]"), True) if top.has("probe") else None,
        "setter": equipment.sensor(top.table("setter", "[setter]"), False) if top.has("setter") else None,
        "table": equipment.work_table(top.table("table", "[table]")) if top.has("table") else None,
        "changer": changer_table.changer(top.table("changer", "[changer]"), axes, io) if changes else None,
    }


def shipped() -> tuple[str, ...]:
    """Names of the machine files that come with Directrix, for ``load``."""
    return tuple(sorted(p.stem for p in SHIPPED.glob("*.toml") if p.name != TOOL_TABLE))


def shipped_program(name: str) -> Path:
    """Path of a program in ``config/programs``, with or without ``.ngc``; raises ``ConfigError``."""
    path = SHIPPED / "programs" / (name if name.endswith(".ngc") else f"{name}.ngc")
    if path.is_file():
        return path
    known = ", ".join(sorted(p.stem for p in path.parent.glob("*.ngc")))
    raise ConfigError(said("file.no_program", name=name, allowed=known))


def with_period(machine: Machine, period_s: float) -> Machine:
    """The same machine at another period; raises ``ConfigError``. ``text`` stays the file's."""
    if PERIODS_S[0] <= period_s <= PERIODS_S[1]:
        return replace(machine, period_s=period_s)
    wrong = said("file.out_of_range", allowed=said("file.may.number", span=span(*PERIODS_S)))
    raise ConfigError(said("file.period", name=machine.name, period=f"{period_s:g}", what=wrong))


def _axis(table: Table, buses: tuple[Bus, ...], files: NamedFiles) -> Axis:
    kind = Kind(table.text("kind", [k.value for k in Kind]))
    unit = "mm" if kind is Kind.LINEAR else "deg"
    sense = Sense.CARRIED
    if unit == "deg":
        sense = Sense(table.text("sense", [s.value for s in Sense], "carried"))
    flipped = kind is Kind.TABLE and sense is Sense.ISO
    inner = 1.0 if unit == "mm" else math.radians(-1.0 if flipped else 1.0)  # per shown unit
    lower, upper = _travel(table, f"travel_{unit}")
    axis = Axis(
        name=table.text("name", ("X", "Y", "Z") if unit == "mm" else ("A", "B", "C")),
        kind=kind,
        direction=_direction(table),
        point_mm=table.vector("point_mm") if unit == "deg" else ZERO,
        sense=sense,
        travel_min=min(lower * inner, upper * inner),
        travel_max=max(lower * inner, upper * inner),
        limits=Limits(
            velocity=table.positive(f"velocity_{unit}_s") * abs(inner),
            acceleration=table.positive(f"acceleration_{unit}_s2") * abs(inner),
            jerk=table.positive(f"jerk_{unit}_s3") * abs(inner),
        ),
        counts_per_unit=_counts(table, unit, max(abs(lower), abs(upper))) / inner,
        bus=table.text("bus", [b.name for b in buses], buses[0].name),
        node=table.integer("node", 1, 126),
        profile=files.profile(table),
        eds=files.sheet(table),
        serial=table.integer("serial", 0, 0xFFFF_FFFF, 0),
        homing=equipment.homing(table, unit, (lower, upper), inner),
        following_error=table.positive(f"following_error_{unit}") * abs(inner),
        following=equipment.following(table, unit, abs(inner)),
        brake=table.flag("brake", False),
        feedback_every=table.integer("feedback_every", 1, 240, 1),
        feed_forward=table.flag("feed_forward", False),
        enable_group=table.integer("enable_group", 0, 99, 0),
        unsupervised=table.flag("unsupervised", False),
        clamp=equipment.clamp(table),
        temperature=equipment.temperature(table),
        demand=equipment.demand(table),
        setpoint_deadline_s=1e-3 * table.number("setpoint_deadline_ms", 0.0, 10_000.0, default=0.0),
        stopping=equipment.stopping(table, unit, inner),
        overrides=drive_profiles.overrides(table),
        reference=_reference(table, f"reference_{unit}", (lower, upper), inner),
        second_reference=_reference(table, f"second_reference_{unit}", (lower, upper), inner),
        pitch=deviation_tables.pitch(table, unit, (lower, upper), inner),
    )
    deviation_tables.within_limits(table, axis)
    table.finish()
    return compensation.reserved(axis)


def _reference(table: Table, key: str, travel: tuple[float, float], inner: float) -> float | None:
    """A position that G28 or G30 leads to; None where the file has none."""
    return table.number(key, *travel) * inner if table.has(key) else None


def _travel(table: Table, key: str) -> tuple[float, float]:
    lower, upper = table.numbers(key, 2)
    if lower >= upper:
        table.refuse(key, "no_travel")
    return lower, upper


def _direction(table: Table) -> Vector:
    direction = table.vector("direction")
    length = norm(direction)
    if length < PARALLEL:
        table.refuse("direction", "no_direction")
    return scale(direction, 1.0 / length)


def _counts(table: Table, unit: str, farthest: float) -> float:
    """Counts per shown unit; a setpoint is an int32, so all of the travel must fit (607Ah)."""
    key = f"counts_per_{unit}"
    counts = table.number(key)
    if counts == 0.0:
        table.refuse(key, "zero_drive")
    if abs(counts) * farthest > INT32_MAX:
        table.refuse(
            f"travel_{unit}",
            "travel_fits",
            farthest=farthest,
            unit=unit,
            counts=abs(counts),
            most=INT32_MAX / abs(counts),
            key=key,
        )
    return counts


def _buses(top: Table) -> tuple[Bus, ...]:
    found: list[Bus] = []
    for table in top.tables("bus"):
        bus = Bus(
            name=table.text("name"),
            interface=table.text("interface", default="virtual"),
            channel=table.text("channel", default=""),
            bit_rate=table.integer("bit_rate", 0, BIT_RATES[-1], BIT_RATES[-1]),
        )
        virtual = bus.interface == "virtual"
        if bus.bit_rate not in BIT_RATES and not (virtual and bus.bit_rate == 0):
            rates = said("file.may.bit_rate", rates=", ".join(map(str, BIT_RATES)))
            table.refuse("bit_rate", "no_bit_rate", allowed=rates)
        if not virtual and not bus.channel:
            table.refuse("channel", "no_channel")
        if any(bus.name == other.name for other in found):
            table.refuse("name", "bus_twice")
        table.finish()
        found.append(bus)
    if not found:
        top.refuse("bus", "no_bus")
    return tuple(found)


def _tools(top: Table) -> tuple[Tool, ...]:
    found: list[Tool] = []
    for table in top.tables("tool"):
        one = tool(table)
        if any(one.number == other.number for other in found):
            table.refuse("number", "tool_twice")
        found.append(one)
    if not any(tool.number == 1 for tool in found):
        top.refuse("tool", "no_tool_1")
    return tuple(found)


def tool(table: Table, name: str | None = None, before: Tool | None = None, shortest_mm: float = 0.0) -> Tool:
    """A tool of the tool table; its shape, where the table has none, is that of ``before``."""
    shape = before or Tool(1, "", 1.0, 0.0, 1.0)
    radius = table.positive("radius_mm")
    found = Tool(
        number=table.integer("number", 1, 99999),
        name=table.text("name", default=name),
        radius_mm=radius,
        length_mm=table.number("length_mm", shortest_mm),
        flute_mm=table.positive("flute_mm"),
        corner_mm=table.number("corner_mm", 0.0, radius, default=min(shape.corner_mm, radius)),
        taper_rad=math.radians(table.number("taper_deg", 0.0, 45.0, default=math.degrees(shape.taper_rad))),
        holder=_holder(table, shape),
        placement=table.text("placement", ("", *PLACEMENTS), shape.placement),
        below_mm=table.number("below_mm", 0.0, 1000.0, default=shape.below_mm),
        wear_radius_mm=_wear(table, "wear_radius_mm", min(MAX_WEAR_MM, 0.5 * radius), shape.wear_radius_mm),
        wear_length_mm=_wear(table, "wear_length_mm", MAX_WEAR_MM, shape.wear_length_mm),
        tolerance_mm=table.positive_or_none("tolerance_mm") or shape.tolerance_mm,
        may_turn=table.flag("may_turn", True) if table.has("may_turn") else shape.may_turn,
        centre_cutting=table.flag("centre_cutting", shape.centre_cutting),
    )
    table.finish()
    return found


def _wear(table: Table, key: str, most_mm: float, before_mm: float) -> float:
    """What is added to a tool's radius or length; one that has lost half of its radius is another tool."""
    return table.number(key, -most_mm, MAX_WEAR_MM, default=max(before_mm, -most_mm))


def _holder(table: Table, before: Tool) -> tuple[tuple[float, float, float], ...]:
    """Cylinders from the tip's end upwards: ``holder = [{ from_mm, length_mm, radius_mm }, ...]``."""
    if not table.has("holder"):
        return before.holder
    found: list[tuple[float, float, float]] = []
    for row in table.tables("holder"):
        start = row.number("from_mm", 0.0, default=found[-1][1] if found else None)
        found.append((start, start + row.positive("length_mm"), row.positive("radius_mm")))
        row.finish()
    return tuple(found)


def _spindle(top: Table, buses: tuple[Bus, ...], files: NamedFiles) -> Spindle | None:
    if not top.has("spindle"):
        return None
    table = top.table("spindle", "[spindle]")
    return equipment.spindle(table, buses, files)


def _audit(machine: Machine, top: Table, general: Table) -> None:
    """What only the whole file can show."""
    axes = Table(top.file, "[[axis]]", {"name": [axis.name for axis in machine.axes]})
    names = [axis.name for axis in machine.axes]
    rotaries, build = [axis for axis in machine.axes if axis.is_rotary], builds()[machine.kinematics]
    if len(rotaries) != build.turning or len(names) != 3 + build.turning or len(set(names)) != len(names):
        axes.refuse("name", "no_such_axes", kinematics=machine.kinematics, allowed=build.axes)
    for axis in machine.axes:
        _audit_axis(axis, machine, top)
    equipment.audit(machine.axes, (machine.spindle, machine.io), top)
    equipment.audit_sensors(machine, top)
    if machine.changer is not None:
        changer_table.audit(machine, top.table("changer", "[changer]"))
    z = machine.axes[names.index("Z")]
    if not z.travel_min <= machine.retract_mm <= z.travel_max:
        travel = said("file.may.z_travel", span=span(z.travel_min, z.travel_max))
        general.refuse("retract_mm", "retract_beyond", allowed=travel)
    if len(rotaries) == 2:
        _audit_rotaries(rotaries, top)


def _audit_axis(axis: Axis, machine: Machine, top: Table) -> None:
    table = top.entry("axis", axis.name)
    if not axis.is_rotary and norm(subtract(axis.direction, LINEAR[axis.name])) > PARALLEL:
        wanted = str(list(LINEAR[axis.name]))
        table.refuse("direction", "linear_frame", allowed=wanted)
    twins = [a.name for a in machine.axes if (a.bus, a.node) == (axis.bus, axis.node)]
    if len(twins) > 1:
        table.refuse("node", "nodes_shared", axes=chain("and", twins), bus=axis.bus)


def _audit_rotaries(rotaries: Sequence[Axis], top: Table) -> None:
    """Only two rotaries that can tilt the tool against the work make five axes.

    In every build the rotary next to the tool must not stand along the tool (Z at
    zero), or it would turn the cutter about itself, and the two must not be parallel.
    """
    first, second = rotaries
    # Tables are listed base to work, and the base is what stands nearer to the tool; heads base to tool.
    next_to_tool = first if second.kind is Kind.TABLE else second
    table = top.entry("axis", next_to_tool.name)
    if norm(cross(next_to_tool.direction, Z)) < PARALLEL:
        table.refuse("direction", "rotary_along")
    if norm(cross(first.direction, second.direction)) < PARALLEL:
        table.refuse("direction", "rotaries_parallel")


def _find(source: str | Path) -> Path:
    path = Path(source)
    if path.is_file():
        return path
    name = str(source).removesuffix(".toml")
    if name in shipped():
        return SHIPPED / f"{name}.toml"
    near = difflib.get_close_matches(name, shipped(), n=1)
    do = said("file.mean", near=near[0]) if near else said("file.give_machine")
    raise ConfigError(said("file.no_machine", source=source, known=", ".join(shipped()), do=do))
