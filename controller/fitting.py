"""What is fitted on the machine now: work offsets and tools as the operator changed them.

The machine file stays as its builder wrote it. What was changed at the machine is kept
beside it, in one small file of the state folder, and laid over the machine when it is loaded:

    {"offsets": {"G54": {"origin_mm": [8, 96, 120], "turned_deg": [0, 0, 0]}},
     "tools": {"2": {"name": "end mill 3 mm", "radius_mm": 1.5, "length_mm": 0, "flute_mm": 15}, "3": null}}

A tool that is null was taken out of the table. Which one is in the spindle is kept in a file of its own,
for a backup that is brought back says nothing of it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller import config, whole
from controller.geometry import Frame
from controller.machine import OFFSETS, TOOL_AT_POWER_ON, USUAL_OFFSETS, Machine
from controller.toml_table import ConfigError, Table

FILE = "fitting.json"
IN_SPINDLE = "in_spindle"
MACHINE = "machine.json"  # the machine file that the service runs on, complete, for those beside it
Values = Mapping[str, Any]


def load(state: Path) -> dict[str, Any]:
    """What is kept in a state folder; nothing where nothing was changed. Raises ConfigError."""
    file = state / FILE
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"{file}: cannot be read ({error}); restore it from a backup or remove it."
        ) from error
    if not isinstance(values, dict):
        raise ConfigError(f"{file}: is no JSON object; restore it from a backup or remove it.")
    return values


def save(state: Path, values: Values) -> None:
    """Keep it, whole or not at all. Raises OSError."""
    state.mkdir(parents=True, exist_ok=True)
    whole.write(state / FILE, text_of(values))


def text_of(values: Values) -> str:
    """What is kept, as it stands in its file."""
    return json.dumps(values, indent=1)


def in_spindle(state: Path) -> int:
    """Number of the tool that is in the spindle: T1 where nobody has changed it yet; 0 = not known."""
    try:
        return int((state / IN_SPINDLE).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return TOOL_AT_POWER_ON
    except (OSError, ValueError):
        return 0


def put_in(state: Path, number: int) -> None:
    """Keep which tool is in the spindle, 0 = not known. Raises OSError."""
    whole.write(state / IN_SPINDLE, f"{number}\n")


def note(state: Path, machine: Machine) -> None:
    """Note the machine file that a service runs on. Raises OSError."""
    file, text = state / MACHINE, note_of(machine)
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        whole.write(file, text)


def note_of(machine: Machine) -> str:
    """What notes a machine file, as it stands in its own."""
    return json.dumps({"name": machine.name, "text": machine.text})


def machine(state: Path) -> Machine:
    """The machine of the service that runs, or ran last, on a state folder, as it is fitted.

    Raises ConfigError, and OSError or ValueError where no service has noted it.
    """
    return applied(noted(state), load(state))


def noted(state: Path) -> Machine:
    """The machine that ``note`` noted, as its builder wrote it; raises as ``machine`` does."""
    found = json.loads((state / MACHINE).read_text(encoding="utf-8"))
    return config.read(found["text"], found["name"])


def applied(machine: Machine, values: Values) -> Machine:
    """The machine with what is fitted laid over its file. Raises ConfigError."""
    for name, offset in dict(values.get("offsets") or {}).items():
        machine = with_offset(machine, str(name), offset)
    for number, tool in dict(values.get("tools") or {}).items():
        machine = with_tool(machine, int(number), tool)
    return machine


def with_offset(machine: Machine, name: str, values: object) -> Machine:
    """A work offset (mm; ``turned_deg`` about X, then Y, then Z of the table). Raises ConfigError."""
    table = Table("offsets", "offset", {"name": name})
    table.text("name", OFFSETS)
    frame = config.offset(Table("offsets", name, {name: values}), name)
    offsets = list(machine.offsets)
    offsets[OFFSETS.index(name)] = frame
    unset = tuple(one for one in machine.unset if one != name)
    return replace(machine, offsets=tuple(offsets), unset=unset)


def with_tool(machine: Machine, number: int, values: object) -> Machine:
    """A tool by its number, new or changed; None takes it out of the table. Raises ConfigError."""
    kept = tuple(tool for tool in machine.tools if tool.number != number)
    if values is None:
        if number == TOOL_AT_POWER_ON:
            raise ConfigError(
                "tools: tool 1: it is in the spindle at power-on; change it, it cannot be removed."
            )
        return replace(machine, tools=kept)
    if not isinstance(values, dict):
        raise ConfigError(
            f"tools: tool {number}: is no table; allowed: name, radius_mm, length_mm, flute_mm, corner_mm, "
            "taper_deg, holder, wear_radius_mm, wear_length_mm."
        )
    table = Table("tools", f"tool {number}", {"number": number, **values})
    before = next((tool for tool in machine.tools if tool.number == number), None)
    tool = config.tool(table, f"tool {number}", before)
    return replace(machine, tools=tuple(sorted((*kept, tool), key=lambda one: one.number)))


def offsets_of(machine: Machine) -> dict[str, Any]:
    """The work offsets as an operator reads them; a turned one shows its axes, too, and one may be unset."""
    named = zip(OFFSETS, machine.offsets, strict=False)
    shown = ((name, frame) for name, frame in named if name in USUAL_OFFSETS or name not in machine.unset)
    return {name: {**_shown(frame), "unset": name in machine.unset} for name, frame in shown}


def _shown(frame: Frame) -> dict[str, Any]:
    shown: dict[str, Any] = {"origin_mm": list(frame.origin)}
    if frame != Frame(frame.origin):
        shown["axes"] = [list(frame.x), list(frame.y), list(frame.z)]
    return shown


def tools_of(machine: Machine) -> list[dict[str, Any]]:
    """The tool table."""
    return [{name: getattr(tool, name) for name in tool.__slots__} for tool in machine.tools]
