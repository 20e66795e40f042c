"""How the drives of a machine were found when they were last commissioned, on disk: a file per machine.

What stops and how fast is in it, so it belongs to the axes of a machine file: with another travel, limit or
drive it is no longer true, and is not found. Tools and offsets may change.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from controller import sealed_file
from controller.machine.model import Machine
from controller.messages import Message, plain
from drives.arranged import Arranged

FOLDER = "arranged"  # in the state folder


class Found(NamedTuple):
    """What was read, and when (local time, ISO 8601)."""

    at: str
    drives: tuple[Arranged, ...]


def save(where: Path, machine: Machine, drives: Sequence[Arranged]) -> Path:
    """Keep it instead of what was known before. Raises OSError.

    Damaged, it is as good as not there: it is read from the drives again.
    """
    before = load(where, machine)
    kept = {one.name: one for one in before.drives} if before else {}
    kept |= {one.name: one for one in drives}  # a bus may be commissioned by itself
    at = time.strftime("%Y-%m-%dT%H:%M:%S", time.localtime())
    facts = {"machine": machine.name, "at": at, "drives": [asdict(one) for one in kept.values()]}
    file = _file(where, machine)
    sealed_file.write(file, facts, where.parent)
    return file


def load(where: Path, machine: Machine) -> Found | None:
    """What is kept of this machine; None where nothing is, or nothing that can be read."""
    try:
        facts = sealed_file.read(_file(where, machine), within=where.parent, older=sealed_file.INDENTED)
        return Found(str(facts["at"]), tuple(_one(**row) for row in facts["drives"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _one(objects: list[tuple[str, int]], notes: list[Message | str], **values: object) -> Arranged:
    """Notes were words once."""
    pairs = tuple((str(place), int(value)) for place, value in objects)
    return Arranged(**values, objects=pairs, notes=tuple(map(plain, notes)))  # type: ignore[arg-type]


def _file(where: Path, machine: Machine) -> Path:
    facts = (machine.name, machine.max_quick_stop_s, [asdict(axis) for axis in machine.axes])
    text = json.dumps(facts, sort_keys=True, default=_plain)
    return where / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.json"


def _plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f"An axis holds a {type(value).__name__}, which JSON cannot.")
