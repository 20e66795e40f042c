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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

from controller.geometry.vectors import Frame, Vector, X, Y, Z, angle_between, cross, norm, scale
from controller.machine import (
    axes,
    changer_table,
    compensation,
    deviation_tables,
    drive_profiles,
    equipment,
    model,
    offset_table,
    spindle,
)
from controller.machine.axes import PARALLEL
from controller.machine.declaration import key
from controller.machine.deviation_tables import Thermal
from controller.machine.forms import TEXT, Number, Rows, Sub
from controller.machine.kinematics import builds
from controller.machine.kinematics.slides import Slides
from controller.machine.model import (
    KEPT_OFFSETS,
    PERIODS_S,
    Axis,
    Bus,
    Changer,
    ChangerStep,
    Io,
    Kind,
    Machine,
    Macro,
    Offset,
    Sensor,
    Spindle,
    Straightness,
    Tool,
    WorkTable,
)
from controller.machine.named_files import SHIPPED as SHIPPED
from controller.machine.named_files import NamedFile, NamedFiles, beside
from controller.machine.named_files import written as written
from controller.machine.nodes import all_settings as all_settings
from controller.machine.nodes import bus_settings as bus_settings
from controller.machine.nodes import eds_of as eds_of
from controller.machine.nodes import io_settings as io_settings
from controller.machine.nodes import master_settings as master_settings
from controller.machine.nodes import node_settings as node_settings
from controller.machine.nodes import spindle_settings as spindle_settings
from controller.machine.reading import Check, File, Reading, Rules
from controller.machine.records_table import Records
from controller.machine.toml_table import ConfigError, Table, parse, read_text, span
from controller.messages import chain, message

TOOL_TABLE = "tools.toml"
LINEAR = {"X": X, "Y": Y, "Z": Z}
# Of a slide from its axis: with three such, no two are nearer to each other than 30 degrees.
MAX_LEAN_RAD = math.radians(30.0 + 1e-6)
RULES: Mapping[type, Rules] = {
    **axes.RULES,
    **changer_table.RULES,
    **deviation_tables.RULES,
    **drive_profiles.RULES,
    **equipment.RULES,
    **model.RULES,
    **spindle.RULES,
}


@dataclass(frozen=True, slots=True)
class ToolsTable:
    """``[tools]``."""

    file: str = key(TEXT, "the tool table, seen from the machine file", default=TOOL_TABLE)
    change_s: float = key(
        Number(0.0, 3600.0), "what a change by hand takes, for the time that `check` tells", default=60.0
    )


def _no_bus(here: Reading) -> NoReturn:
    here.table.refuse("bus", "no_bus")


class Buses(Rows):
    """One bus or more."""

    def read(self, here: Reading, name: str) -> tuple[Bus, ...]:
        found: tuple[Bus, ...] = super().read(here, name)
        return found or _no_bus(here)


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineFile:
    """The tables of a machine file."""

    machine: Machine = key(Sub(Machine, top=True), "the machine as a whole")
    tools: ToolsTable = key(Sub(ToolsTable, top=True, always=True), "the tool table, and changes by hand")
    offsets: Mapping[str, Offset] = key(
        offset_table.Offsets(always=True), "the work offsets: G54 to G59.3, G54.1 P1 to P48"
    )
    bus: tuple[Bus, ...] = key(Buses(Bus), "a CAN bus", silent=_no_bus)
    axis: tuple[Axis, ...] = key(Rows(Axis), "an axis and its drive", silent=())
    spindle: Spindle | None = key(
        Sub(Spindle, top=True), "what turns the tool; left out: S, M3 and M4 are refused", default=None
    )
    io: Io | None = key(Sub(Io, top=True), "a CiA 401 node", default=None)
    changer: Changer | None = key(Sub(Changer, top=True), "how M6 changes tools", default=None)
    probe: Sensor | None = key(Sub(Sensor, top=True), "a touch probe in the spindle", default=None)
    setter: Sensor | None = key(Sub(Sensor, top=True), "a tool setter on the table", default=None)
    table: WorkTable | None = key(Sub(WorkTable, top=True), "what no tool may touch", default=None)
    straightness: tuple[Straightness, ...] = key(Rows(Straightness), "how slides are off", silent=())
    records: Records = key(Sub(Records, top=True, always=True), "what runs leave on the disk")
    thermal: Thermal = key(Sub(Thermal, top=True, always=True), "what warmth does")
    macro: tuple[Macro, ...] = key(Rows(Macro), "a button with lines of program", silent=())
    file: tuple[NamedFile, ...] = key(Rows(NamedFile), "a file that is taken along", silent=())
    tool: tuple[Tool, ...] = key(Rows(Tool), "a tool", silent=())


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
    try:
        table = beside(path.parent, tools.text("file", default=TOOL_TABLE), tools)
        entries = read_text(table)
        wrong = _mistakes_of_tools(parse(entries, table.name))
    except ConfigError as error:  # what a tool of no number does not let tell is not told
        raise ConfigError.of_all([*_own_mistakes(text, file, path.parent), error]) from error
    try:
        machine = read(f"{text.rstrip()}\n\n# {table.name}\n{entries}", file, path.parent)
    except ConfigError as error:
        if not wrong:
            raise
        # The tools' mistakes are refused under the name of their own file.
        raise ConfigError.of_all([*_without_tools(error, text), *wrong]) from error
    if wrong:
        raise ConfigError.of_all(wrong)
    return machine


def _own_mistakes(text: str, file: str, folder: Path) -> list[ConfigError]:
    """Those of a machine file whose tool table is not to be had."""
    try:
        read(f"{text.rstrip()}\n\n[[tool]]\n", file, folder)
    except ConfigError as error:
        return _without_tools(error, text)
    return []


def _without_tools(error: ConfigError, text: str) -> list[ConfigError]:
    lines = len(text.splitlines())
    return [one for one in error.mistakes if one.line <= lines and one.place[:1] != ("tool",)]


@dataclass(frozen=True, slots=True)
class ToolFile:
    """A tool table in a file of its own."""

    tool: tuple[Tool, ...] = key(Rows(Tool), "a tool", silent=())


def _mistakes_of_tools(top: Table) -> list[ConfigError]:
    file = File(RULES)
    Reading(file, ToolFile, top).value()
    file.check({Tool: CHECKS[Tool], ToolFile: (_check_tools,)})
    return file.mistakes


def read(text: str, file: str, folder: Path | None = None) -> Machine:
    """The machine of a complete text (with its ``[[tool]]`` tables).

    ``folder``: where files that it names and has not with it are looked for. Raises ``ConfigError``.
    """
    top = parse(text, file)
    files = NamedFiles(top, folder)
    whole = File(RULES, files)
    found = Reading(whole, MachineFile, top)
    tables = found.value()
    whole.check(CHECKS)
    whole.finish()
    return _machine(found.one_below("machine").values, tables, files.completed(text))


def alone(machine: Machine) -> str:
    """The text that ``load`` takes with no other file: the tools are in it, and their file is not named."""
    lines, section = [], ""
    for line in machine.text.splitlines():
        section = line.strip() if line.lstrip().startswith("[") else section
        named = section == "[tools]" and re.match(r"\s*file\s*=", line)
        lines.append(f"# {line}  # its tables stand below" if named else line)
    return "\n".join([*lines, ""])


def _machine(general: Mapping[str, Any], tables: MachineFile, text: str) -> Machine:
    """The machine of its tables; ``general``: the fields that [machine] fills."""
    offsets = [tables.offsets.get(name, Offset(Frame())) for name in KEPT_OFFSETS]
    pointed = [_pointed(axis) for axis in tables.axis]
    return Machine(
        **{name: value for name, value in general.items() if name in Machine.__slots__},
        axes=Slides(tables.axis).limited(compensation.reserved(pointed, tables.straightness)),
        buses=tables.bus,
        tools=tables.tool,
        offsets=tuple(one.frame for one in offsets),
        turned_rad=tuple(one.turned_rad for one in offsets),
        unset=tuple(name for name in KEPT_OFFSETS[1:] if name not in tables.offsets),
        spindle=tables.spindle,
        io=tables.io,
        changer=tables.changer,
        probe=tables.probe,
        setter=tables.setter,
        table=tables.table,
        straightness=tables.straightness,
        records=tables.records,
        thermal_shift_mm=tables.thermal.shift_mm,
        tool_change_s=tables.tools.change_s,
        macros=tables.macro,
        text=text,
    )


def _pointed(axis: Axis) -> Axis:
    """An axis with a direction of length 1, whatever length the file gives it."""
    return replace(axis, direction=_unit(axis.direction))


def _unit(vector: Vector) -> Vector:
    return scale(vector, 1.0 / norm(vector))


# ---- what only the whole file can show


def _check_bus(bus: Reading) -> None:
    _check_twice(bus, "bus", "name", "bus_twice")


def _check_macro(macro: Reading) -> None:
    _check_twice(macro, "macro", "name", "macro_twice")


def _check_tool(tool: Reading) -> None:
    _check_twice(tool, "tool", "number", "tool_twice")


def _check_twice(row: Reading, kind: str, name: str, what: str) -> None:
    """No table of a kind before this one has the same name or number."""
    if _is_twice(row, kind, name):
        row.table.refuse(name, what)


def _is_twice(row: Reading, kind: str, name: str) -> bool:
    rows = row.top.below[kind]
    return any(getattr(one, "values", {}).get(name) == row[name] for one in rows[: rows.index(row)])


def _check_tools(top: Reading) -> None:
    if not any(tool.number == 1 for tool in top["tool"]):
        top.table.refuse("tool", "no_tool_1")


def _check_kinematics(general: Reading) -> None:
    general.table.text("kinematics", tuple(builds()), general["kinematics"])


def _check_axes(top: Reading) -> None:
    names, kinematics = [axis.name for axis in top["axis"]], top.one_below("machine")["kinematics"]
    rotaries, build = [axis for axis in top["axis"] if axis.is_rotary], builds().get(kinematics)
    if build is None or len(set(names)) != len(names):  # which is refused
        return
    if len(rotaries) != build.turning or len(names) != 3 + build.turning:
        table = Table(top.table.file, "[[axis]]", {"name": names})
        table.refuse("name", "no_such_axes", kinematics=kinematics, allowed=build.axes)


def _check_retract(top: Reading) -> None:
    z = next((axis for axis in top["axis"] if axis.name == "Z"), None)
    general = top.one_below("machine")
    if z is not None and not z.travel_min <= general["retract_mm"] <= z.travel_max:
        travel = message("file.may.z_travel", span=span(z.travel_min, z.travel_max))
        general.table.refuse("retract_mm", "retract_beyond", allowed=travel)


def _check_rotaries(top: Reading) -> None:
    """Only two rotaries that can tilt the tool against the work make five axes.

    In every build the rotary next to the tool must not stand along the tool (Z at
    zero), or it would turn the cutter about itself, and the two must not be parallel.
    """
    rows = [row for row in top.below.get("axis", ()) if row["kind"] is not Kind.LINEAR]
    if len(rows) != 2:
        return
    first, second = (row["direction"] for row in rows)
    # Tables are listed base to work, and the base is what stands nearer to the tool; heads base to tool.
    next_to_tool = rows[0] if rows[1]["kind"] is Kind.TABLE else rows[1]
    if _parallel(next_to_tool["direction"], Z):
        next_to_tool.table.refuse("direction", "rotary_along")
    if _parallel(first, second):
        next_to_tool.table.refuse("direction", "rotaries_parallel")


def _parallel(one: Vector, other: Vector) -> bool:
    return bool(norm(cross(_unit(one), _unit(other))) < PARALLEL)


def _check_name(axis: Reading) -> None:
    _check_twice(axis, "axis", "name", "axis_twice")


def _check_frame(axis: Reading) -> None:
    """A slide that is not square leans no further than makes X, Y and Z three directions."""
    if axis["kind"] is Kind.LINEAR and not _is_twice(axis, "axis", "name"):
        frame = LINEAR[axis["name"]]
        if angle_between(axis["direction"], frame) > MAX_LEAN_RAD:
            allowed = str([int(x) for x in frame])
            axis.table.refuse("direction", "linear_frame", allowed=allowed, most=math.degrees(MAX_LEAN_RAD))


def _check_still(axis: Reading) -> None:
    """Nothing clamps a slide that moves for the others."""
    slides = [one for one in axis.top["axis"] if not one.is_rotary]
    leaning = not all(_parallel(one.direction, LINEAR[one.name]) for one in slides)
    if axis["clamp"] is not None and axis["kind"] is Kind.LINEAR and leaning:
        axis.table.refuse("clamp", "clamp_leaning")


def _check_slopes(axis: Reading) -> None:
    """Refuses a table that would need too much of its axis' limits."""
    if axis["pitch"] is not None:
        share = compensation.own_share(axis["pitch"], axis["limits"])
        _check_share(axis.one_below("pitch"), f"up_{axis.unit}", axis["name"], share)


def _check_straight(row: Reading) -> None:
    """Likewise, with the axis' own table and the rows before this one."""
    axes, rows, name = row.top["axis"], row.top["straightness"], row["moves"]
    n = row.top.below["straightness"].index(row)
    axis = next(one for one in axes if one.name == name)
    before, share = (compensation.share(axis, axes, rows[:k]) for k in (n, n + 1))
    if before <= compensation.MAX_SHARE:
        _check_share(row, "off_mm", name, share)


def _check_share(table: Reading, key: str, axis: str, share: float) -> None:
    if share > compensation.MAX_SHARE:
        table.table.refuse(key, "table_steep", share=share, axis=axis, most=compensation.MAX_SHARE)


def _nodes(top: Reading) -> list[tuple[str, str, int]]:
    """Name, bus and node of the axes' drives, of each that has all three."""
    parts = ("name", "bus", "node")
    return [(one.name, one.bus, one.node) for one in top["axis"] if all(hasattr(one, part) for part in parts)]


def _check_node(axis: Reading) -> None:
    """A node is that of one drive; it is told at the first of them."""
    mine = axis["bus"], axis["node"]
    twins = [name for name, *place in _nodes(axis.top) if tuple(place) == mine]
    if len(twins) > 1 and twins[0] == axis["name"]:
        axis.table.refuse("node", "nodes_shared", axes=chain("and", twins), bus=axis["bus"])


def _check_encoder(axis: Reading) -> None:
    """An encoder that is a node of its own is no drive's."""
    encoder = axis["load_encoder"]
    for name, bus, node in _nodes(axis.top) if encoder is not None else ():
        if (bus, node) == (axis["bus"], encoder.node):
            other, table = message("file.axis", name=name), axis.one_below("load_encoder").table
            table.refuse("node", "node_twice", other=other, bus=bus)


def _check_devices(device: Reading) -> None:
    """The node of the spindle or of the inputs and outputs is nobody else's."""
    mine = device["bus"], device["node"]
    if mine[1] == 0:
        return
    for name, *place in _nodes(device.top):
        if tuple(place) == mine:
            device.table.refuse("node", "node_twice", other=message("file.axis", name=name), bus=mine[0])
    spindle_ = device.top["spindle"]
    if device.of is Io and spindle_ is not None and (spindle_.bus, spindle_.node) == mine:
        device.table.refuse("node", "node_twice", other="[spindle]", bus=mine[0])


def _check_file(file: Reading) -> None:
    """A file that is taken along is named by something; what was refused may have named it."""
    mistakes = {one.place[0].split("#")[0] for one in file.file.mistakes if one.place}
    known = mistakes.isdisjoint(("axis", "spindle", "io", "file"))
    if known and not file.file.files.is_named(file["name"]):
        file.table.refuse("name", "file_unnamed")


CHECKS: Mapping[type, Sequence[Check]] = {
    MachineFile: (_check_axes, _check_tools, _check_retract, _check_rotaries),
    Machine: (_check_kinematics,),
    Bus: (_check_bus,),
    Axis: (
        _check_name,
        _check_frame,
        _check_still,
        _check_node,
        _check_encoder,
        _check_slopes,
        equipment.check_clamp,
        equipment.check_limits,
    ),
    Straightness: (_check_straight,),
    Spindle: (_check_devices, spindle.check_outputs, spindle.check_gears),
    Io: (_check_devices,),
    Sensor: (equipment.check_sensor, equipment.check_probe),
    Changer: (changer_table.check_tools,),
    ChangerStep: (
        changer_table.check_step,
        changer_table.check_bits,
        changer_table.check_orient,
        changer_table.check_pocket,
        changer_table.check_level,
    ),
    Macro: (_check_macro,),
    Tool: (_check_tool,),
    NamedFile: (_check_file,),
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
    raise ConfigError(message("file.no_program", name=name, allowed=known))


def with_period(machine: Machine, period_s: float) -> Machine:
    """The same machine at another period; raises ``ConfigError``. ``text`` stays the file's."""
    if PERIODS_S[0] <= period_s <= PERIODS_S[1]:
        return replace(machine, period_s=period_s)
    wrong = message("file.out_of_range", allowed=message("file.may.number", span=span(*PERIODS_S)))
    raise ConfigError(message("file.period", name=machine.name, period=f"{period_s:g}", what=wrong))


def _find(source: str | Path) -> Path:
    path = Path(source)
    if path.is_file():
        return path
    name = str(source).removesuffix(".toml")
    if name in shipped():
        return SHIPPED / f"{name}.toml"
    near = difflib.get_close_matches(name, shipped(), n=1)
    do = message("file.mean", near=near[0]) if near else message("file.give_machine")
    raise ConfigError(message("file.no_machine", source=source, known=", ".join(shipped()), do=do))
