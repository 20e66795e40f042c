"""Checks that are kept: what ``check`` found out, so that a start need not read the program twice.

A stored check belongs to one program on one machine file with its tools and offsets, from
one place, as this version of the controller plans it: its name is the hash of all that.
It carries what the first block cannot know: the rotaries chosen over the whole program.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from controller import own_files, sealed_file
from controller.machine.model import Joints, Machine
from controller.machine.plain import plain
from controller.messages import Message, message, of_error
from controller.motion.motions import Rotaries
from controller.plan import timetable
from controller.plan.report.passing import Mark
from controller.plan.report.verdict import Verdict
from controller.plan.segment import Note
from controller.plan.surfaces.placements import Recipe
from controller.plan.timetable import Event
from controller.program.program import Place
from controller.version import VERSION

FORMAT = 7  # of the files
KEPT = 500  # files; the oldest go


@dataclass(frozen=True, slots=True)
class Overcut:
    """How deep the cut of a surface goes below it at most, where it is in place: by the twist."""

    line: int
    mm: float
    u: float
    v: float


@dataclass(frozen=True, slots=True)
class Stored:
    """What is kept of a check."""

    ticks: int
    duration_s: float
    blocks: int
    choices: Mapping[int, Rotaries]  # by line of a block: the rotaries (rad) with which it begins
    notes: tuple[Note, ...] = ()
    overcuts: tuple[Overcut, ...] = ()  # of the surfaces, in the program's order
    placements: Mapping[str, Recipe] = field(default_factory=dict)  # of the cutter, by name
    verdicts: tuple[Verdict, ...] = ()  # on the surfaces that have a form tolerance
    marks: tuple[Mark, ...] = ()  # when which place is passed
    events: tuple[Event, ...] = ()  # in which the path clock stands, at the same seconds

    @property
    def waits_s(self) -> float:
        """What it waits beside ``duration_s``, as expected."""
        return sum(event.wait.seconds for event in self.events)


def folder() -> Path:
    """Where checks are kept unless told otherwise: the XDG state folder."""
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(base) / "directrix" / "checks"


def key(program: bytes, machine: Machine, start: Joints, begin: Mapping[str, Any] | None = None) -> str:
    """The name of a check: a hash of program, machine (tools and offsets included), start and version.

    ``begin``: the modal state before its first line, where that is not the one of power-on.
    """
    facts = {
        "format": FORMAT,
        "version": VERSION,
        "program": hashlib.sha256(program).hexdigest(),
        "machine": plain(machine),
        "start": start,
        **({} if begin is None else {"begin": begin}),
    }
    text = json.dumps(facts, sort_keys=True, default=plain)
    return hashlib.sha256(text.encode()).hexdigest()


def save(stored: Stored, name: str, where: Path) -> Path:
    """Write a check under its name, whole or not at all; the file. Raises OSError."""
    own_files.make_folder(where, where.parent)
    values = {
        "key": name,
        "ticks": stored.ticks,
        "duration_s": stored.duration_s,
        "blocks": stored.blocks,
        "choices": {str(line): list(pair) for line, pair in stored.choices.items()},
        "notes": [[note.place.line, note.place.column, note.said] for note in stored.notes],
        "overcuts": [[one.line, one.mm, one.u, one.v] for one in stored.overcuts],
        "placements": {found: recipe.to_dict() for found, recipe in stored.placements.items()},
        "verdicts": [one.to_dict() for one in stored.verdicts],
        "marks": [[*place, time_s] for place, time_s in stored.marks],
        "events": timetable.to_json(stored.events),
    }
    file = where / f"{name}.json"
    new = where / f"{name}.{secrets.token_hex(8)}.new"  # several may write it at once
    try:
        with own_files.new(new, where.parent) as out:
            out.write(sealed_file.text(values, file.name).encode())
            os.fchmod(out.fileno(), 0o640)  # the group reads
        own_files.rename(new, file, where.parent)
    finally:
        own_files.remove(new, where.parent)
    _forget_old(where)
    return file


def _forget_old(where: Path) -> None:
    files = [where / name for name in own_files.names(where, where.parent) if name.endswith(".json")]
    for file in sorted(files, key=lambda file: file.lstat().st_mtime)[:-KEPT]:
        own_files.remove(file, where.parent)


def load(name: str, where: Path) -> tuple[Stored | None, Message | str]:
    """The check of that name and "", or None and a warning; the warning is "" where there is none."""
    file = where / f"{name}.json"
    try:
        values = sealed_file.read(file, within=where.parent)
    except FileNotFoundError:
        return None, ""
    except (OSError, ValueError) as error:
        return None, message("stored.unread", file=file, why=of_error(error))
    try:
        return _stored(values, name), ""
    except (ValueError, KeyError, TypeError):
        return None, message("stored.of_another", file=file)


def _stored(values: Any, name: str) -> Stored:
    """Raises ValueError, KeyError or TypeError for anything but what ``save`` writes."""
    if values["key"] != name:
        raise ValueError("of another program")
    return Stored(
        int(values["ticks"]),
        float(values["duration_s"]),
        int(values["blocks"]),
        {int(line): (float(a), float(b)) for line, (a, b) in values["choices"].items()},
        tuple(
            Note(Place(int(line), int(column)), _message(words)) for line, column, words in values["notes"]
        ),
        tuple(Overcut(int(n), float(mm), float(u), float(v)) for n, mm, u, v in values["overcuts"]),
        {str(found): Recipe.from_dict(recipe) for found, recipe in values["placements"].items()},
        tuple(map(Verdict.from_dict, values["verdicts"])),
        tuple(((int(n), float(f), int(way), float(s)), float(t)) for n, f, way, s, t in values["marks"]),
        timetable.from_json(values["events"]),
    )


def _message(words: Any) -> Message:
    """Raises KeyError or TypeError for anything but a text."""
    return Message(key=str(words["key"]), values=dict(words["values"]))
