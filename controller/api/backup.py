"""Back-up and restore: machine file, offsets, tools and where they are, settings and programs in one archive.

    backup.save(store, machine, file)     one zip file; manifest.json names every part with its sha256
    backup.check(file)                    Contents, or BackupError: nothing is restored that is not sound
    backup.restore(store, contents, ...)  with a back-up of what is replaced made first, for roll_back

Users and tokens are not in it: an archive is carried about and mailed. Restored while no
service runs on the state folder, because that reads offsets and tools when it starts.

What is put back is put back whole or not at all, though it lies in a database, in files beside it and,
with the machine file, perhaps on another disk: all of it is written beside its place first, where a full disk
changes nothing; then files take their names, within the transaction, and go back if it fails.

What a roll-back goes by lies beside the state folder and not in it: the panel writes that. A machine file is
rolled back only from there, and only to where the operator has it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import secrets
import shutil
import sqlite3
import time
import zipfile
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from controller import atomic_file, own_files, sealed_file
from controller.api import notice_settings
from controller.api.archive import (
    FITTING,
    FORMAT,
    MACHINE,
    MANIFEST,
    SETTINGS,
    TOOLS,
    BackupError,
    Contents,
    check,
    member_of,
)
from controller.api.database import StoreError
from controller.api.programs import Program
from controller.api.store import Store
from controller.api.uploads import MODE
from controller.machine import machine_file as config
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.messages import Message, message
from controller.store import service_store, set_up_store, tool_store

__all__ = ["BackupError", "Contents", "automatic_backups", "check", "keep", "restore", "save", "update"]

KEPT = 20  # back-ups made by themselves
BY = "back-up"
CHUNK = 1 << 20


def save(store: Store, machine: Machine, file: Path, machine_file: Path | None = None) -> Path:
    """Write an archive, whole or not at all; ``machine_file``: see ``Contents``.

    Raises StoreError, ConfigError, OSError.
    """
    return _write(store, machine, tool_store.saved_rows(store.folder), file, machine_file)


def _write(
    store: Store, machine: Machine, tools: Mapping[str, Any], file: Path, machine_file: Path | None
) -> Path:
    parts = {
        MACHINE: config.alone(machine).encode(),
        FITTING: json.dumps(set_up_store.load(store.folder)).encode(),
        SETTINGS: json.dumps(notice_settings.without_secrets(store.settings.all())).encode(),
        TOOLS: json.dumps(tools).encode(),
    }
    programs = {program.name: program.sha256 for program in store.programs.list()}
    sums = {name: hashlib.sha256(data).hexdigest() for name, data in parts.items()}
    manifest = {"format": FORMAT, "made_s": time.time(), "parts": sums, "programs": programs}
    if machine_file is not None:
        manifest["machine_file"] = str(machine_file.absolute())
    new = file.with_name(f"{file.name}.part")
    try:
        with own_files.new(new) as out:
            with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
                archive.writestr(MANIFEST, json.dumps(manifest, indent=1))
                for name, data in parts.items():
                    archive.writestr(name, data)
                for sha256 in sorted(set(programs.values())):
                    with store.programs.content(sha256) as text, archive.open(member_of(sha256), "w") as part:
                        shutil.copyfileobj(text, part, CHUNK)
            out.flush()
            os.fsync(out.fileno())
        own_files.rename(new, file)
    finally:
        own_files.remove(new)
    atomic_file.sync(file.absolute().parent)
    return file


def restore(
    store: Store, contents: Contents, machine_file: Path | None, before: Machine | None
) -> list[Message]:
    """Put back what an archive holds, all of it or nothing; what was done, a sentence each.

    ``machine_file``: where the service reads its machine file, None = left as it is; ``before``: the
    machine now, for the back-up that is made first. Programs that the archive does not hold stay.
    Raises StoreError, ConfigError, BackupError, OSError.
    """
    lost = service_store.settle(store.folder / service_store.FILE)
    kept, tools = store.folder / service_store.FILE, contents.tools or _readable_tools(store)
    # Tools were changed between the two, by hand or by program: nobody knows for sure where they are.
    texts: dict[Path, str | bytes] = {kept: set_up_store.file_with(kept, contents.fitted, tools)}
    if machine_file is not None:
        texts[machine_file] = config.alone(contents.machine)
    if machine_file is not None or before is None:
        note = store.folder / setup_data.MACHINE
        texts[note] = sealed_file.text(setup_data.note_of(contents.machine), note.name)
    with contextlib.ExitStack() as work:
        replaced = machine_file if machine_file is not None and machine_file.exists() else None
        done = [lost] if lost is not None else list[Message]()
        if before:
            done.append(
                message("backup.kept", kept=work.enter_context(_backup_before(store, before, replaced)))
            )
        put = work.enter_context(atomic_file.all_or_none(texts))
        staged = work.enter_context(_unpacked(store, contents))
        with store.database.write() as sql:
            _enter(store, contents, staged, sql)
            put()
    _forget_old(store)
    done.append(message("backup.programs", count=len(contents.programs)))
    if machine_file is not None:
        done.append(message("backup.machine", machine_file=machine_file))
    if tools:
        done.append(message("backup.changer"))
    return [*done, message("backup.offsets")]


def _readable_tools(store: Store) -> dict[str, list[list[Any]]]:
    """{} also for a file that is no tool store: a restore is the way out of that."""
    try:
        return tool_store.saved_rows(store.folder)
    except ConfigError:
        return {}


@contextlib.contextmanager
def _backup_before(store: Store, before: Machine, machine_file: Path | None) -> Iterator[Path]:
    """A back-up of the state before, for a roll-back; removed where the work raises."""
    made = keep(store, before, machine_file)
    try:
        yield made
    except BaseException:
        own_files.remove(made)
        raise


@contextlib.contextmanager
def _unpacked(store: Store, contents: Contents) -> Iterator[dict[str, Path]]:
    """Every content, by its sum, as a file on the store's disk that is there until the end of the restore."""
    staged: dict[str, Path] = {}
    with zipfile.ZipFile(contents.file) as archive, contextlib.ExitStack() as tidy:
        _fits(store, contents, archive)
        for sha256 in set(contents.programs.values()):
            staged[sha256] = store.programs.incoming / f"restore-{secrets.token_hex(8)}"
            tidy.callback(own_files.remove, staged[sha256], store.own)
            with (
                archive.open(member_of(sha256)) as part,
                own_files.new(staged[sha256], store.own, MODE) as out,
            ):
                shutil.copyfileobj(part, out, CHUNK)
                out.flush()
                os.fchmod(out.fileno(), MODE)
                os.fsync(out.fileno())
        yield staged


def _fits(store: Store, contents: Contents, archive: zipfile.ZipFile) -> None:
    """Raises StoreError for a program that is larger than allowed, or a disk that is too full."""
    sizes = {sha256: archive.getinfo(member_of(sha256)).file_size for sha256 in contents.programs.values()}
    most = store.uploads.limits.most_bytes
    for name, sha256 in contents.programs.items():
        if sizes[sha256] > most:
            raise StoreError.of("size", "upload_more", name=name, most=most)
    store.uploads.room(sum(sizes.values()))


def _enter(store: Store, contents: Contents, staged: dict[str, Path], sql: sqlite3.Connection) -> None:
    """Names, contents and settings, within one transaction. A content that no name points at is swept."""
    programs, now_s = store.programs, store.programs.now_s()
    facts = {sha256: _facts(file, store.own) for sha256, file in staged.items()}
    for sha256, file in staged.items():
        own_files.rename(file, programs.path(sha256), store.own)
    atomic_file.sync(programs.folder, store.own)
    for name, sha256 in contents.programs.items():
        programs.enter(Program(name, sha256, *facts[sha256], now_s, BY), sql)
    settings = notice_settings.restored(store.settings.all(), contents.settings)
    store.settings.replace(settings, BY, sql)


def _facts(file: Path, within: Path) -> tuple[int, int]:
    """(bytes, lines)."""
    size, ends, last = 0, 0, b"\n"
    with own_files.opened(file, os.O_RDONLY, within, shared=True) as text:
        while chunk := text.read(CHUNK):
            size, ends, last = size + len(chunk), ends + chunk.count(b"\n"), chunk[-1:]
    return size, ends + (last != b"\n")


def update(store: Store, new: Path, machine_file: Path) -> list[Message]:
    """Replace the machine file by a new one, checked with what is fitted; what was done.

    Raises ConfigError, StoreError, OSError.
    """
    machine = config.load(new)
    setup_data.applied(machine, set_up_store.load(store.folder))
    with contextlib.ExitStack() as work:
        done = list[Message]()
        if machine_file.exists():
            kept = work.enter_context(_backup_before(store, config.load(machine_file), machine_file))
            done.append(message("backup.kept", kept=kept))
        work.enter_context(atomic_file.all_or_none({machine_file: config.alone(machine)}))()
    _forget_old(store)
    return [*done, message("backup.machine_from_next", machine_file=machine_file)]


def keep(store: Store, machine: Machine, machine_file: Path | None = None) -> Path:
    """A back-up beside the state folder, made before something is replaced. Raises OSError.

    ``machine_file``: the one that is replaced, None where it is left as it is.
    """
    folder = own_files.make_private(folder_of(store))
    file = folder / datetime.now().strftime("%Y-%m-%dT%H%M%S.%f.zip")
    return _write(store, machine, _readable_tools(store), file, machine_file)


def folder_of(store: Store) -> Path:
    """Where what was is kept: beside the state folder, for who may write that shall not plant it."""
    state = store.folder.resolve()
    return state.with_name(f"{state.name}-backups")


def _forget_old(store: Store) -> None:
    """What nobody goes back to: contents that no name points at any more, and the oldest back-ups."""
    with contextlib.suppress(StoreError, OSError):  # it has been restored all the same
        store.programs.sweep()
        for old in automatic_backups(store)[KEPT:]:
            own_files.remove(old)


def automatic_backups(store: Store) -> list[Path]:
    """Back-ups that were made automatically, the latest first. Raises OSError for a folder of another."""
    if not os.path.lexists(folder := folder_of(store)):
        return []
    own_files.make_private(folder)
    return sorted((folder / name for name in own_files.names(folder) if name.endswith(".zip")), reverse=True)
