"""Back-up and restore: machine file, offsets, tools, settings and programs in one checked archive.

    backup.save(store, machine, file)     one zip file; manifest.json names every part with its sha256
    backup.check(file)                    Contents, or BackupError: nothing is restored that is not sound
    backup.restore(store, contents, ...)  with a back-up of what is replaced made first, for roll_back

Users and tokens are not in it: an archive is carried about and mailed. Restored while no
service runs on the state folder, because that reads offsets and tools when it starts.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
import zipfile
import zlib
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from controller import config, fitting, whole
from controller.machine import Machine
from controller.panel import names
from controller.panel.database import StoreError
from controller.panel.store import Store
from controller.toml_table import ConfigError

FORMAT = 1
KEPT = 20  # back-ups made by themselves
FOLDER = "backups"  # of those, in the state folder
MOST_BYTES = 4 << 30  # unpacked
BY = "back-up"
UNREADABLE = (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError)

_MANIFEST, _MACHINE, _FITTING, _SETTINGS = "manifest.json", "machine.toml", "fitting.json", "settings.json"
_PROGRAM = re.compile(r"programs/([0-9a-f]{64})\.ngc")


class BackupError(Exception):
    """One sentence: which archive, what is wrong with it, what to do."""


@dataclass(frozen=True, slots=True)
class Contents:
    """An archive that was read whole and found sound."""

    file: Path
    made_s: float  # seconds since 1970
    machine: Machine  # as its builder wrote it
    fitted: dict[str, Any]
    settings: dict[str, Any]
    programs: dict[str, str]  # name: sha256
    machine_file: Path | None = None  # that was replaced when this was kept; a roll-back puts it back there


def save(store: Store, machine: Machine, file: Path, machine_file: Path | None = None) -> Path:
    """Write an archive, whole or not at all; ``machine_file``: see ``Contents``.

    Raises StoreError, ConfigError, OSError.
    """
    parts = {
        _MACHINE: _alone(machine).encode(),
        _FITTING: json.dumps(fitting.load(store.folder)).encode(),
        _SETTINGS: json.dumps(store.settings.all()).encode(),
    }
    programs = {program.name: program.sha256 for program in store.programs.list()}
    sums = {name: hashlib.sha256(data).hexdigest() for name, data in parts.items()}
    manifest = {"format": FORMAT, "made_s": time.time(), "parts": sums, "programs": programs}
    if machine_file is not None:
        manifest["machine_file"] = str(machine_file.absolute())
    new = file.with_name(f"{file.name}.part")
    try:
        with zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(_MANIFEST, json.dumps(manifest, indent=1))
            for name, data in parts.items():
                archive.writestr(name, data)
            for sha256 in sorted(set(programs.values())):
                archive.write(store.programs.path(sha256), f"programs/{sha256}.ngc")
        with open(new, "rb") as written:
            os.fsync(written.fileno())
        os.replace(new, file)
    finally:
        new.unlink(missing_ok=True)
    whole.sync(file.absolute().parent)
    return file


def check(file: Path) -> Contents:
    """Read an archive whole. Raises BackupError."""
    try:
        with zipfile.ZipFile(file) as archive:
            return _contents(file, archive)
    except UNREADABLE as error:
        raise BackupError(f"{file}: cannot be read ({error}); use another back-up.") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BackupError(f"{file}: is no back-up of this program ({error}); use another one.") from error
    except (ConfigError, StoreError) as error:
        raise BackupError(f"{file}: holds what this version does not take: {error}") from error


def _contents(file: Path, archive: zipfile.ZipFile) -> Contents:
    if sum(entry.file_size for entry in archive.infolist()) > MOST_BYTES:
        raise BackupError(f"{file}: holds more than {MOST_BYTES >> 30} GB; use another back-up.")
    manifest = json.loads(archive.read(_MANIFEST))
    if manifest["format"] != FORMAT:
        raise BackupError(f"{file}: has format {manifest['format']}; allowed is {FORMAT}; update first.")
    parts = {name: archive.read(name) for name in (_MACHINE, _FITTING, _SETTINGS)}
    for name, data in parts.items():
        _same(file, name, hashlib.sha256(data).hexdigest(), manifest["parts"][name])
    programs = {names.check(str(name)): str(sha256) for name, sha256 in manifest["programs"].items()}
    for sha256 in set(programs.values()):
        _same(file, f"programs/{sha256}.ngc", _sum(archive, sha256), sha256)
    machine = config.read(parts[_MACHINE].decode(), f"{file.name}/{_MACHINE}")
    fitted, settings = dict(json.loads(parts[_FITTING])), dict(json.loads(parts[_SETTINGS]))
    fitting.applied(machine, fitted)
    replaced = Path(str(manifest["machine_file"])) if "machine_file" in manifest else None
    return Contents(file, float(manifest["made_s"]), machine, fitted, settings, programs, replaced)


def _sum(archive: zipfile.ZipFile, sha256: str) -> str:
    if not _PROGRAM.fullmatch(name := f"programs/{sha256}.ngc"):
        raise ValueError(f"{names.shown(sha256)} is no checksum")
    summed = hashlib.sha256()
    with archive.open(name) as part:
        while chunk := part.read(1 << 20):
            summed.update(chunk)
    return summed.hexdigest()


def _same(file: Path, part: str, found: str, expected: str) -> None:
    if found != expected:
        raise BackupError(f"{file}: {part} is not what was saved (its sha256 differs); use another back-up.")


def restore(store: Store, contents: Contents, machine_file: Path | None, before: Machine | None) -> list[str]:
    """Put back what an archive holds; what was done, a sentence each.

    ``machine_file``: where the service reads its machine file, None = left as it is; ``before``: the
    machine now, for the back-up that is made first. Programs that the archive does not hold stay.
    Raises StoreError, ConfigError, BackupError, OSError.
    """
    done = [f"Kept what was: {keep(store, before, machine_file)}."] if before else []
    with zipfile.ZipFile(contents.file) as archive:
        for name, sha256 in contents.programs.items():
            _restore_program(store, archive, name, sha256)
    done.append(f"Programs: {len(contents.programs)}.")
    with store.database.write() as sql:
        store.settings.replace(contents.settings, BY, sql)
    if machine_file is not None:
        whole.write(machine_file, _alone(contents.machine))
        done.append(f"Machine file: {machine_file}.")
    if machine_file is not None or before is None:
        fitting.note(store.folder, contents.machine)
    fitting.save(store.folder, contents.fitted)
    done.append("Offsets and tools: as in the back-up, from the next start of the service on.")
    return done


def _restore_program(store: Store, archive: zipfile.ZipFile, name: str, sha256: str) -> None:
    with (
        store.uploads.begin(name, sha256=sha256, by=BY) as upload,
        archive.open(f"programs/{sha256}.ngc") as part,
    ):
        while chunk := part.read(1 << 20):
            upload.write(chunk)
        upload.commit()


def update(store: Store, new: Path, machine_file: Path) -> list[str]:
    """Replace the machine file by a new one, checked with what is fitted; what was done.

    Raises ConfigError, StoreError, OSError.
    """
    fitting.applied(config.load(new), fitting.load(store.folder))
    done = []
    if machine_file.exists():
        done.append(f"Kept what was: {keep(store, config.load(machine_file), machine_file)}.")
    whole.write(machine_file, _alone(config.load(new)))
    return [*done, f"Machine file: {machine_file}, from the next start of the service on."]


def keep(store: Store, machine: Machine, machine_file: Path | None = None) -> Path:
    """A back-up in the state folder, made before something is replaced; the oldest go.

    ``machine_file``: the one that is replaced, None where it is left as it is.
    """
    folder = store.folder / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    kept = save(store, machine, folder / datetime.now().strftime("%Y-%m-%dT%H%M%S.%f.zip"), machine_file)
    for old in all_kept(store)[KEPT:]:
        old.unlink(missing_ok=True)
    return kept


def all_kept(store: Store) -> list[Path]:
    """Back-ups that were made by themselves, the latest first."""
    return sorted((store.folder / FOLDER).glob("*.zip"), reverse=True)


def _alone(machine: Machine) -> str:
    """The text of a machine file that needs no other: the tools stand in it, their file is not named."""
    lines, section = [], ""
    for line in machine.text.splitlines():
        section = line.strip() if line.lstrip().startswith("[") else section
        named = section == "[tools]" and re.match(r"\s*file\s*=", line)
        lines.append(f"# {line}  # its tables stand below" if named else line)
    return "\n".join([*lines, ""])
