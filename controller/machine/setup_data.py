"""What is fitted on the machine now: offsets, tools and the like as operator and programs changed them.

The machine file stays as its builder wrote it. What was changed at the machine is kept in the
service's store (``store.set_up_store``), and laid over the machine when it is loaded:

    {"offsets": {"G54": {"origin_mm": [8, 96, 120], "turned_deg": [0, 0, 0], "rotary_deg": {"C": 30}}},
     "tools": {"2": {"name": "end mill 3 mm", "radius_mm": 1.5, "length_mm": 0, "flute_mm": 15}, "3": null},
     "shift": {"G92": {"origin_mm": [1, 0, 0], "rotary_deg": {}, "suspended": false}},
     "references": {"G28": {"X": 0, "Y": 0, "Z": 250, "A": 0, "C": 0}},
     "parameters": {"500": 12.5},
     "pockets": {"3": 7},
     "sisters": {"1": 11}}

A tool that is null was taken out of the table. Sisters stand in the record of a run alone, which goes on with
those that it began with: T1 was worn, and T11 comes in its place. Which tool is in the spindle is kept by
itself, for a backup that is brought back says nothing of it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from controller import sealed_file
from controller.geometry.vectors import ZERO, Frame
from controller.machine import machine_file, offset_table
from controller.machine.changes import located
from controller.machine.model import (
    KEPT_OFFSETS,
    REFERENCES,
    SET,
    STILL,
    TOOL_AT_POWER_ON,
    USUAL_OFFSETS,
    Machine,
    Shift,
    Tool,
)
from controller.machine.reading import read_alone
from controller.machine.toml_table import ConfigError, Table
from controller.messages import message, of_error

FILE = "fitting.json"  # in a back-up, and of versions before there was the store
MACHINE = "machine.json"  # the machine file that the service runs on, complete, for those beside it
KINDS = ("offsets", "tools", "shift", "references", "parameters", "pockets", "sisters")
_OF_TOOLS = (
    "name, radius_mm, length_mm, flute_mm, corner_mm, taper_deg, holder, wear_radius_mm, wear_length_mm, "
    "centre_cutting, end_mm, point_deg, barrel_mm, back_mm"
)
Values = Mapping[str, Any]
_log = logging.getLogger(__name__)


def read(file: Path, missing: dict[str, Any] | None = None) -> dict[str, Any]:
    """What a file keeps; ``missing``: what there is without one. Raises ConfigError."""
    try:
        values = sealed_file.read(file, FILE)
    except (OSError, ValueError) as error:
        if missing is not None and isinstance(error, FileNotFoundError):
            return missing
        raise ConfigError(message("file.kept_unread", file=file, why=of_error(error))) from error
    return sound(values, file)


def sound(values: Any, file: Path) -> dict[str, Any]:
    """What a file keeps, if it is of the kinds that are kept. Raises ConfigError."""
    if not isinstance(values, dict):
        raise ConfigError(message("file.no_json", file=file))
    for kind, rows in values.items():
        if kind not in KINDS or not isinstance(rows, dict | None):
            raise ConfigError(message("file.no_kind", file=file, kind=kind, known=", ".join(KINDS)))
    return values


def note(state: Path, machine: Machine) -> None:
    """Note the machine file that a service runs on. Raises OSError.

    One that is noted is not written: a full disk forbids no second start.
    """
    file, values = state / MACHINE, note_of(machine)
    try:
        if sealed_file.read(file) == values and sealed_file.is_sealed(file):
            return
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        _log.warning("%s cannot be read (%s), and is written anew.", file, error)
    sealed_file.write(file, values)


def note_of(machine: Machine) -> dict[str, Any]:
    """What notes a machine file, as it stands in its own."""
    return {"name": machine.name, "text": machine.text}


def noted(state: Path) -> Machine:
    """The machine that ``note`` noted, as its builder wrote it.

    Raises ConfigError, and OSError or ValueError where no service has noted it.
    """
    try:
        found = sealed_file.read(state / MACHINE)
        text, name = str(found["text"]), str(found["name"])
    except (sealed_file.Damaged, KeyError, TypeError) as error:
        raise ValueError(f"{state / MACHINE} is no note of a machine file") from error
    return machine_file.read(text, name)


def applied(machine: Machine, values: Values) -> Machine:
    """The machine with what is fitted laid over its file. Raises ConfigError."""
    for kind in KINDS:
        for key, value in dict(values.get(kind) or {}).items():
            machine = _LAID[kind](machine, str(key), value)
    return machine


def with_offset(machine: Machine, name: str, values: object) -> Machine:
    """A work offset (mm; ``turned_deg`` about X, then Y, then Z of the table). Raises ConfigError."""
    table = Table("offsets", "offset", {"name": name})
    table.text("name", KEPT_OFFSETS)
    i = KEPT_OFFSETS.index(name)
    before = machine.offset(i).turned_rad
    found = offset_table.alone(Table("offsets", name, {name: values}), name, machine.axes, before)
    offsets, turned = list(machine.offsets), [machine.offset(k).turned_rad for k in range(len(KEPT_OFFSETS))]
    offsets[i], turned[i] = found.frame, found.turned_rad
    unset = tuple(one for one in machine.unset if one != name)
    return replace(machine, offsets=tuple(offsets), turned_rad=tuple(turned), unset=unset)


def with_shift(machine: Machine, key: str, values: object) -> Machine:
    """The shift of G92. Raises ConfigError."""
    table = Table("shift", key, {key: values}).table(key, key)
    xyz, turned_rad = table.vector("origin_mm", ZERO), offset_table.rotary(table, "rotary_deg", machine.axes)
    suspended = table.flag("suspended", False)
    table.finish()
    return replace(machine, shift=Shift(xyz, turned_rad), suspended=suspended)


def with_reference(machine: Machine, key: str, values: object) -> Machine:
    """The point of G28 or G30: positions of all axes (mm, degrees as shown). Raises ConfigError."""
    Table("references", "reference", {"name": key}).text("name", REFERENCES)
    table = Table("references", key, {key: values}).table(key, key)
    point = tuple([table.number(axis.name) / axis.shown_per_unit for axis in machine.axes])
    table.finish()
    # Where the file has no second one it is the first, as that stood there.
    first, second = (point if key == code else machine.reference(code) for code in REFERENCES)
    rows = zip(machine.axes, first, second, strict=True)
    return replace(machine, axes=tuple(replace(a, reference=p, second_reference=q) for a, p, q in rows))


def with_parameter(machine: Machine, key: str, value: object) -> Machine:
    """A numbered parameter; of those that the machine does not keep (any more) nothing."""
    found = Table("parameters", f"#{key}", {"value": value}).number("value")
    number = int(key) if key.isdigit() else 0
    if not any(first <= number <= last for first, last in machine.kept):
        return machine
    return replace(machine, parameters=tuple(sorted({**dict(machine.parameters), number: found}.items())))


def with_tool(machine: Machine, number: int, values: object, called: str = "") -> Machine:
    """A tool by its number, new or changed; None takes it out of the table. Raises ConfigError.

    ``called``: ``SET`` of one that was set already, by a program for instance.
    """
    kept = tuple(tool for tool in machine.tools if tool.number != number)
    if values is None:
        if number == TOOL_AT_POWER_ON:
            raise ConfigError(message("file.tool_at_power_on"))
        return replace(machine, tools=kept)
    if not isinstance(values, dict):
        raise ConfigError(message("file.no_tool_table", number=number, allowed=_OF_TOOLS))
    named = {"number": number, "name": f"tool {number}", **values}
    table = Table("tools", message("file.tool", number=number), named)
    before = next((tool for tool in machine.tools if tool.number == number), None)
    tool = read_alone(Tool, table, machine_file.RULES, called, before)
    return replace(machine, tools=tuple(sorted((*kept, tool), key=lambda one: one.number)))


def with_pocket(machine: Machine, key: str, value: object) -> Machine:
    """Whose a pocket of the tool changer is, 0 = nobody's; its tool leaves the one that it had."""
    if machine.changer is None:
        return machine
    pockets = list(machine.changer.pockets)
    table = Table("pockets", message("file.pocket", number=key), {"tool": value})
    known = {tool.number for tool in machine.tools} | {0}
    tool = table.integer("tool", 0, 99999)
    if tool not in known:
        table.refuse("tool", "tool_unknown", allowed=", ".join(map(str, sorted(known))))
    if not (key.isdigit() and 1 <= int(key) <= len(pockets)):
        table.refuse("tool", "no_pocket", key=key, most=len(pockets))
    pockets = [0 if one == tool else one for one in pockets]
    pockets[int(key) - 1] = tool
    return replace(machine, changer=replace(machine.changer, pockets=tuple(pockets)))


def with_sister(machine: Machine, key: str, value: object) -> Machine:
    """A tool that comes in the place of a worn one. Raises ConfigError."""
    table = Table("sisters", f"tool {key}", {"tool": int(key), "sister": value})
    pair = table.integer("tool", 1, 99999), table.integer("sister", 1, 99999)
    return replace(machine, sisters=(*machine.sisters, pair))


def _laid_tool(machine: Machine, key: str, values: object) -> Machine:
    return with_tool(machine, int(key), values, SET)


_LAID: Mapping[str, Callable[[Machine, str, object], Machine]] = MappingProxyType(
    dict(
        zip(
            KINDS,
            (with_offset, _laid_tool, with_shift, with_reference, with_parameter, with_pocket, with_sister),
            strict=True,
        )
    )
)


# ---- as it is shown ----------------------------------------------------------------------


def to_json(machine: Machine, values: Values) -> dict[str, Any]:
    """All set-up data as an operator reads them; ``source``: where it was set, "file" or "machine"."""
    offsets, tools = offsets_of(machine), tools_of(machine)
    for name, row in offsets.items():
        row["source"] = _source(values, "offsets", name)
    for row in tools:
        row["source"] = _source(values, "tools", str(row["number"]))
    return {"offsets": offsets, "tools": tools, **_others(machine, values)}


def _source(values: Values, kind: str, key: str) -> str:
    return "machine" if key in (values.get(kind) or {}) else "file"


def _others(machine: Machine, values: Values) -> dict[str, Any]:
    """The shift of G92, the reference points and the parameters that are kept."""
    points = {name: machine.shown(machine.reference(name)) for name in REFERENCES}
    names = [axis.name for axis in machine.axes]
    shift = located(machine, machine.shift.xyz, machine.shift.turned_rad)
    return {
        "shift": {**shift, "suspended": machine.suspended, "source": _source(values, "shift", "G92")},
        "references": {
            name: {**dict(zip(names, point, strict=True)), "source": _source(values, "references", name)}
            for name, point in points.items()
        },
        "parameters": {f"#{number}": value for number, value in machine.parameters},
    }


def names(values: Values) -> list[str]:
    """Of all that is kept: "G54", "T3", "G92", "G28", "#500"."""
    marks = {"tools": "T", "parameters": "#", "pockets": "P"}
    return [f"{marks.get(kind, '')}{key}" for kind in KINDS for key in values.get(kind) or {}]


def without(values: Values, name: str) -> dict[str, Any]:
    """What is kept but for one thing: "G54", "T3", "G92", "G28", "#500", "P2", or "all". Raises KeyError."""
    if name == "all":
        return {}
    kind = next(kind for kind, is_its in _NAMED.items() if is_its(name))
    rows = dict(values.get(kind) or {})
    del rows[name[1:] if name[0] in "T#P" else name]
    return {**values, kind: rows}


_NAMED: Mapping[str, Callable[[str], bool]] = MappingProxyType(
    {
        "tools": lambda name: name[:1] == "T",
        "parameters": lambda name: name[:1] == "#",
        "pockets": lambda name: name[:1] == "P",
        "shift": lambda name: name == "G92",
        "references": lambda name: name in REFERENCES,
        "offsets": lambda name: True,
    }
)


def offsets_of(machine: Machine) -> dict[str, Any]:
    """The work offsets as an operator reads them; a turned one shows its axes, too, and one may be unset."""
    shown = (name for name in KEPT_OFFSETS if name in USUAL_OFFSETS or name not in machine.unset)
    return {name: {**_shown(machine, name), "unset": name in machine.unset} for name in shown}


def rotary_deg(machine: Machine, name: str) -> dict[str, Any]:
    """Of a work offset, as it stands in the file; nothing where its rotaries are not shifted."""
    offset = machine.offset(KEPT_OFFSETS.index(name))
    at = located(machine, offset.frame.origin, offset.turned_rad)
    return {"rotary_deg": at["rotary_deg"]} if offset.turned_rad != STILL else {}


def _shown(machine: Machine, name: str) -> dict[str, Any]:
    offset = machine.offset(KEPT_OFFSETS.index(name))
    frame = offset.frame
    shown: dict[str, Any] = {"origin_mm": list(frame.origin), **rotary_deg(machine, name)}
    if frame != Frame(frame.origin):
        shown["axes"] = [list(frame.x), list(frame.y), list(frame.z)]
    return shown


def tools_of(machine: Machine) -> list[dict[str, Any]]:
    """The tool table, each tool with the outlines of its bodies (rho and h, mm) by their kind."""
    from controller.machine.tool_profile import whole

    rows = []
    for tool in machine.tools:
        profile = [(body.name, body.outline().round(4).tolist()) for body in whole(tool)]
        rows.append({**{name: getattr(tool, name) for name in tool.__slots__}, "profile": profile})
    return rows
