"""The archive of a back-up: what must be in it, and what is refused.

    machine.toml            complete, it needs no other file
    fitting.json            offsets and tools as fitted
    settings.json           names and plain values
    tools.json              rows of the tool changer's store, {} where there is none; not in format 1
    programs/<sha256>.ngc   contents
    manifest.json           format, time, the sha256 of every part, and names of programs

An archive comes from anywhere: a stick, a mail. So everything is looked at, and nothing of it is
unpacked, before all of it was found sound; what is not named here is foreign and refused by name.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller.api import names
from controller.api.database import StoreError
from controller.machine import machine_file as config
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.messages import Key, Message, TextError, message, of_error
from controller.store import set_up_store

FORMAT = 2
MANIFEST, MACHINE, FITTING, SETTINGS = "manifest.json", "machine.toml", "fitting.json", "settings.json"
TOOLS = "tools.json"
PARTS = {1: (MACHINE, FITTING, SETTINGS), 2: (MACHINE, FITTING, SETTINGS, TOOLS)}  # by format
MAX_BYTES = 4 << 30  # unpacked
MAX_PART_BYTES = 32 << 20  # of anything but a program: they are read into memory
MAX_MEMBERS = 100_000
LATEST_S = 1e11  # seconds since 1970; later is no time that anything was saved at
KINDS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # others need libraries that may be missing
UNREADABLE = (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError)
WRONG = (ValueError, KeyError, TypeError, AttributeError, OverflowError)

_PROGRAM = re.compile(r"programs/([0-9a-f]{64})\.ngc")
_SETTING = re.compile(r"[a-z][a-z0-9_.]{0,63}")


class BackupError(TextError):
    """Which archive, what is wrong with it, what to do."""


@dataclass(frozen=True, slots=True)
class Contents:
    """An archive that was read whole and found sound."""

    file: Path
    made_s: float  # seconds since 1970
    machine: Machine  # as its builder wrote it
    fitted: dict[str, Any]
    settings: dict[str, Any]
    tools: dict[str, Any]  # rows of the tool changer's store, where the back-up has any
    programs: dict[str, str]  # name: sha256
    machine_file: Path | None = None  # that was replaced when this was kept; a roll-back puts it back there


def member_of(sha256: str) -> str:
    """Where a program's content is."""
    return f"programs/{sha256}.ngc"


def check(file: Path) -> Contents:
    """Read an archive whole. Raises BackupError."""
    try:
        with zipfile.ZipFile(file) as archive:
            _members(archive.infolist())
            return _contents(file, archive)
    except BackupError as error:
        raise BackupError(message("archive.unsound", file=file, what=error.said)) from error
    except UNREADABLE as error:
        raise BackupError(message("archive.unreadable", file=file, why=_error_message(error))) from error
    except WRONG as error:
        raise BackupError(message("archive.none", file=file, why=_error_message(error))) from error
    except (ConfigError, StoreError) as error:
        raise BackupError(message("archive.not_taken", file=file, why=_error_message(error))) from error


def _error_message(error: BaseException) -> Message:
    """What an error says, fit for a sentence whatever of the archive it quotes."""
    found: Message = _plain(of_error(error))
    return found


def _plain(value: Any) -> Any:
    """A text's values without what cannot be shown, and not too long."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    if not isinstance(value, str):
        return value
    words = " ".join("".join(c if c.isprintable() else " " for c in value).split())
    return words if len(words) <= 300 else f"{words[:297]}..."


def _members(entries: Sequence[zipfile.ZipInfo]) -> None:
    """Raises BackupError for what the list of members shows already, before anything is unpacked."""
    if len(entries) > MAX_MEMBERS:
        raise BackupError(message("archive.members", count=len(entries), max_members=MAX_MEMBERS))
    known: set[str] = set()
    for entry in entries:
        name, shown = entry.filename, names.shown(entry.filename)
        if name not in (MANIFEST, *PARTS[FORMAT]) and not _PROGRAM.fullmatch(name):
            raise BackupError(message("archive.foreign", shown=shown))
        if name in known:
            raise BackupError(message("archive.twice", shown=shown))
        if entry.compress_type not in KINDS or entry.flag_bits & 1:
            raise BackupError(message("archive.packed", shown=shown))
        if entry.file_size > MAX_PART_BYTES and not _PROGRAM.fullmatch(name):
            raise BackupError(
                message(
                    "archive.part_large",
                    shown=shown,
                    file_size=entry.file_size >> 20,
                    max_part_bytes=MAX_PART_BYTES >> 20,
                )
            )
        known.add(name)
    if MANIFEST not in known:
        raise BackupError(message("archive.no_part", name=MANIFEST))
    if sum(entry.file_size for entry in entries) > MAX_BYTES:
        raise BackupError(message("archive.large", max_bytes=MAX_BYTES >> 30))


def _contents(file: Path, archive: zipfile.ZipFile) -> Contents:
    manifest = _object(MANIFEST, archive.read(MANIFEST))
    _manifest(manifest)
    parts = {name: _part(archive, name) for name in PARTS[manifest["format"]]}
    if foreign := sorted({*PARTS[FORMAT]} - {*parts} & {*archive.namelist()}):
        raise BackupError(message("archive.foreign_of_format", shown=foreign[0]))
    for name, data in parts.items():
        _same(name, hashlib.sha256(data).hexdigest(), manifest["parts"].get(name))
    programs = {names.check(name): sha256 for name, sha256 in manifest["programs"].items()}
    _programs(archive, set(programs.values()))
    machine = config.read(parts[MACHINE].decode(), f"{file.name}/{MACHINE}")
    fitted, settings = _fitted(parts[FITTING], machine), _settings(parts[SETTINGS])
    tools = _tools(parts.get(TOOLS, b"{}"))
    replaced = Path(manifest["machine_file"]) if "machine_file" in manifest else None
    return Contents(file, float(manifest["made_s"]), machine, fitted, settings, tools, programs, replaced)


def _part(archive: zipfile.ZipFile, name: str) -> bytes:
    if name not in archive.namelist():
        raise BackupError(message("archive.no_part", name=name))
    return archive.read(name)


def _manifest(manifest: dict[str, Any]) -> None:
    """Raises BackupError for a value of the manifest that is not of its kind."""
    if type(found := manifest.get("format")) is not int or found not in PARTS:
        allowed = ", ".join(map(str, PARTS))
        raise BackupError(message("archive.format", found=_short(found), allowed=allowed))
    made_s = manifest.get("made_s")
    if isinstance(made_s, bool) or not isinstance(made_s, int | float) or not 0.0 <= made_s < LATEST_S:
        raise BackupError(message("archive.made", manifest=MANIFEST, found=_short(made_s)))
    for name in ("parts", "programs"):
        sums = manifest.get(name)
        if not isinstance(sums, dict) or not all(isinstance(value, str) for value in sums.values()):
            raise BackupError(message("archive.no_sums", manifest=MANIFEST, name=name, found=_short(sums)))
    path = manifest.get("machine_file", "/")
    if not isinstance(path, str) or "\0" in path:
        raise BackupError(message("archive.path", manifest=MANIFEST, found=_short(path)))
    known = {"format", "made_s", "parts", "programs", "machine_file"}
    if foreign := sorted(set(manifest) - known) or sorted(set(manifest["parts"]) - set(PARTS[found])):
        raise BackupError(message("archive.foreign_name", manifest=MANIFEST, shown=names.shown(foreign[0])))


def _programs(archive: zipfile.ZipFile, wanted: set[str]) -> None:
    """Raises BackupError unless those, and no others, are there as they were saved."""
    there = {found[1] for name in archive.namelist() if (found := _PROGRAM.fullmatch(name))}
    for sha256 in sorted(wanted):
        if sha256 not in there:
            raise BackupError(message("archive.no_program", sum=names.shown(sha256)))
        summed = hashlib.sha256()
        with archive.open(member_of(sha256)) as part:
            while chunk := part.read(1 << 20):
                summed.update(chunk)
        _same(member_of(sha256), summed.hexdigest(), sha256)
    if more := sorted(there - wanted):
        raise BackupError(message("archive.unnamed", shown=member_of(more[0])))


def _fitted(data: bytes, machine: Machine) -> dict[str, Any]:
    fitted = _object(FITTING, data)
    for name, rows in fitted.items():
        if name not in setup_data.KINDS or not isinstance(rows, dict):
            allowed = ", ".join(setup_data.KINDS)
            raise BackupError(
                message(
                    "archive.no_kind",
                    fitting=FITTING,
                    name=names.shown(name),
                    found=_short(rows),
                    allowed=allowed,
                )
            )
    setup_data.applied(machine, fitted)
    return fitted


def _settings(data: bytes) -> dict[str, Any]:
    settings = _object(SETTINGS, data)
    for name, value in settings.items():
        if not _SETTING.fullmatch(name):
            raise BackupError(message("archive.no_setting", settings=SETTINGS, name=names.shown(name)))
        if not isinstance(value, str | bool | int | float | None):
            raise BackupError(message("archive.setting", settings=SETTINGS, name=name, found=_short(value)))
    return settings


def _tools(data: bytes) -> dict[str, Any]:
    rows = _object(TOOLS, data)
    try:
        if rows:
            set_up_store.file_with(None, {}, rows)  # they can be put there
    except ValueError as error:
        raise BackupError(message("archive.tools", part=TOOLS, why=_error_message(error))) from error
    return rows


def _object(part: str, data: bytes) -> dict[str, Any]:
    """A part that is a JSON object, with every key once and numbers that are some."""
    try:
        found = json.loads(data.decode(), object_pairs_hook=_once, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise BackupError(message("archive.no_json", part=part, why=_error_message(error))) from error
    if not isinstance(found, dict):
        raise BackupError(message("archive.no_object", part=part, found=_short(found)))
    if not all(math.isfinite(value) for value in found.values() if isinstance(value, float)):
        raise BackupError(message("archive.number", part=part))
    return found


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key stands twice in it")
    return found


def _no_number(word: str) -> float:
    raise ValueError(f"{word} is no number")


def _short(value: object) -> str:
    """In a sentence."""
    kinds: dict[type, Key] = {dict: Key("archive.object"), list: Key("archive.list")}
    if value is None:
        return "null"
    return kinds.get(type(value)) or names.shown(str(value)[:100])


def _same(part: str, found: str, expected: object) -> None:
    if found != expected:
        raise BackupError(message("archive.other_sum", part=part))
