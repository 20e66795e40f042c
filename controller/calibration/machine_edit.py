"""What was found, written into a machine file: its comments stay, what was before is kept beside it.

The new text is read as a machine before it replaces the old one, whole or not at all; the old one stays as
``NAME.before-DATE.toml`` in the same folder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Array, InlineTable

from controller import atomic_file
from controller.machine import machine_file
from controller.machine.model import Axis, Machine
from controller.machine.toml_table import read_text

LENGTH_DIGITS, DIRECTION_DIGITS, TABLE_DIGITS = 6, 10, 7  # 1 nm, 1e-8 degrees, 0.1 nm


def rotaries(text: str, found: Machine) -> str:
    """A machine file with centres and directions of the rotaries of ``found``."""
    document = tomlkit.parse(text)
    for index in found.rotary():
        axis = found.axes[index]
        entry = _entry(document, axis.name)
        _put(entry, "direction", _numbers(axis.direction, DIRECTION_DIGITS))
        _put(entry, "point_mm", _numbers(axis.point_mm, LENGTH_DIGITS))
    return tomlkit.dumps(document)


def pitch(text: str, axis: Axis, table: Mapping[str, Sequence[float]]) -> str:
    """A machine file with the pitch table of one axis: keys as in the file, shown units."""
    document = tomlkit.parse(text)
    made: InlineTable = tomlkit.inline_table()
    for key, values in table.items():
        made[key] = _numbers(values, TABLE_DIGITS)
    _entry(document, axis.name)["pitch"] = made
    return tomlkit.dumps(document)


def offset(text: str, name: str, values: Mapping[str, Sequence[float]]) -> str:
    """A machine file with one work offset: ``origin_mm`` and, where it is turned, ``turned_deg``."""
    document = tomlkit.parse(text)
    offsets = document.setdefault("offsets", tomlkit.table())
    made: InlineTable = tomlkit.inline_table()
    for key, row in values.items():
        made[key] = _numbers(row, LENGTH_DIGITS)
    offsets[name] = made
    return tomlkit.dumps(document)


def thermal(text: str, shift: Sequence[float]) -> str:
    """A machine file with where the tool is too far by now, X Y Z (mm)."""
    document = tomlkit.parse(text)
    document.setdefault("thermal", tomlkit.table())["shift_mm"] = _numbers(shift, LENGTH_DIGITS)
    return tomlkit.dumps(document)


def inverter(text: str, zero_counts: int, full_rev_min: float) -> str:
    """A machine file with scale and offset of the output that tells an inverter its speed."""
    document = tomlkit.parse(text)
    entry: Any = document["spindle"]["inverter"]
    entry["zero_counts"], entry["full_rev_min"] = zero_counts, full_rev_min
    return tomlkit.dumps(document)


def write(file: Path, text: str, stamp: str) -> Path:
    """Replaces a machine file by a text; the path of the old one, as it was. ``stamp``: date and time.

    Raises ConfigError where the text is no machine, OSError where it cannot be written; nothing changed then.
    """
    before = read_text(file)
    trial = file.with_name(f"{file.stem}.trial.toml")
    try:
        atomic_file.write(trial, text)
        machine_file.load(trial)
    finally:
        trial.unlink(missing_ok=True)
    kept = file.with_name(f"{file.stem}.before-{stamp}.toml")
    atomic_file.write(kept, before)
    atomic_file.write(file, text)
    return kept


def _entry(document: tomlkit.TOMLDocument, name: str) -> Any:
    """The [[axis]] of a name. Raises KeyError."""
    for entry in document["axis"]:
        if entry["name"] == name:
            return entry
    raise KeyError(name)


def _put(entry: Any, key: str, value: Array) -> None:
    """A value in the place of another one, with the comment after it."""
    old = entry.get(key)
    if old is not None:
        value.trivia.comment, value.trivia.comment_ws = old.trivia.comment, old.trivia.comment_ws
    entry[key] = value


def _numbers(values: Sequence[float], digits: int) -> Array:
    made = tomlkit.array()
    for value in values:
        made.append(round(float(value), digits) + 0.0)  # no -0.0
    return made
