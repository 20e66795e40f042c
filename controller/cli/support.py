"""``directrix support``: one archive of what somebody who helps from afar needs to see, and no secrets.

    facts.json        versions of all packages, system, boot, clock, room on the disk
    host.json         what ``directrix host check`` finds
    machine.toml      complete, it needs no other file
    state/            what the service keeps of the machine, as it stands there; its store as service.json
    store.json        latest runs, alarms, programs by name and sum, settings
    runs/             records of the latest runs
    recordings/       of the latest faults
    crashes/          what went wrong in our own code
    journal.txt       the units' latest lines, where systemd keeps them

Users, tokens, sessions, the audit log and what the settings hide (``notice_settings.SECRETS``) stay out:
the store's own file is not among it, and nothing of the panel's but what is named here. Of what goes along,
what lets others in is taken out wherever it stands: see ``redaction``.
"""

from __future__ import annotations

import contextlib
import json
import platform
import shutil
import sqlite3
import subprocess
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from controller import messages, own_database, own_files
from controller.api import notice_settings, own_folder
from controller.api.database import StoreError
from controller.api.store import Store
from controller.cli import host_findings, installation, internal_error, redaction
from controller.cli.host_view import Host
from controller.ipc import control_socket
from controller.machine import machine_file, setup_data
from controller.machine.toml_table import ConfigError
from controller.service import older_files, owners, requests
from controller.state.record_files import RECORDINGS, RUNS
from controller.store import history, service_store
from controller.verify.console import Refused, answered, in_words, refusals, say, show

STATE_FILES = (*owners.SEALED, *older_files.DOCUMENTS, older_files.ALARMS)
LATEST = 3  # runs and faults whose records go along
LATEST_ROWS = 200  # of runs and alarms
MAX_BYTES = 64 << 20  # of one record; what is more is named instead
PEOPLE = ("user", "address")  # of requests; the role and the socket's peer say which side it was
JOURNAL_LINES, JOURNAL_TIMEOUT_S = 5000, 20.0
BOOT = Path("/proc/sys/kernel/random/boot_id")

Part = tuple[str, bytes]


def support(
    archive: Path,
    state: Path | None = None,
    records: Annotated[int, typer.Option("--records", min=0, max=100)] = LATEST,
    as_json: bool = False,
) -> None:
    """Write one archive for who helps from afar; no secrets are in it."""
    with refusals(as_json):
        folder = state or control_socket.state_folder()
        if not folder.is_dir():
            raise Refused(say("cli.support.no_state", folder=folder))
        missing: list[str] = []
        _write(archive.absolute(), folder, records, missing)
        size = archive.stat().st_size
        if not answered(as_json, archive=str(archive), bytes=size, missing=missing):
            words = say("cli.support.done", archive=archive, mb=f"{size / 1e6:.1f}")
            show.print("\n".join([words, *missing]))


def _write(archive: Path, folder: Path, records: int, missing: list[str]) -> None:
    """Whole or not at all. Raises OSError."""
    half = archive.with_name(f"{archive.name}.part")
    try:
        with own_files.new(half) as out, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
            secrets = _secrets(folder, missing)
            for name, data in _parts(folder, records, missing):
                for _, clean in _readable(name, partial(redaction.of_part, name, data, secrets), missing):
                    shown = redaction.redacted(name.encode(), secrets).decode()
                    same = sum(one.startswith(shown) for one in file.namelist()) if shown != name else 0
                    file.writestr(f"{shown}.{same}" if same else shown, clean)
            file.writestr("missing.txt", redaction.redacted("\n".join([*missing, ""]).encode(), secrets))
        own_files.rename(half, archive)
    finally:
        own_files.remove(half)


def _secrets(folder: Path, missing: list[str]) -> list[bytes]:
    """The longest first."""
    found, names = list[bytes](), list[str]()
    try:
        with contextlib.closing(Store(folder)) as store:
            found, names = redaction.of_shop(store), [one.name for one in store.programs.list()]
    except StoreError as error:
        missing.append(f"secrets: {in_words(messages.of_error(error))}")
    with contextlib.suppress(OSError, sqlite3.Error), history.reading(folder) as past:
        names += past.by_program()
    return sorted([*found, *redaction.of_names(names)], key=len, reverse=True)


def _parts(folder: Path, records: int, missing: list[str]) -> Iterator[Part]:
    """Name and content of each; what cannot be read is named in ``missing``."""
    yield "facts.json", _json(_facts(folder))
    yield "host.json", _json([line.to_dict() for line in host_findings.look(Host(Path("/")))])
    yield from _readable("machine.toml", lambda: _machine(folder), missing)
    for name in STATE_FILES:
        if (folder / name).exists():
            yield from _readable(f"state/{name}", partial(_read, folder / name, folder), missing)
    if (folder / service_store.FILE).exists():
        yield from _readable("state/service.json", lambda: _json(_service_facts(folder)), missing)
    yield from _readable("store.json", lambda: _json(_stored(folder)), missing)
    for kind in (RUNS, RECORDINGS):
        for one in _latest(folder / kind, folder, records):
            yield from _folder(one, folder, missing)
    for of in (folder, own_folder.of(folder)):
        yield from _folder(of / internal_error.FOLDER, folder, missing)
    if journal := _journal():
        yield "journal.txt", journal


def _readable(name: str, make: Callable[[], bytes], missing: list[str]) -> Iterator[Part]:
    try:
        yield name, make()
    except (OSError, ValueError, sqlite3.Error, StoreError, ConfigError, Refused) as error:
        missing.append(f"{name}: {in_words(messages.of_error(error))}")


def _read(file: Path, within: Path) -> bytes:
    """Raises OSError, and Refused for what is too large."""
    if (size := file.lstat().st_size) > MAX_BYTES:
        raise Refused(say("cli.support.large", size=size >> 20, most=MAX_BYTES >> 20))
    return own_files.read_bytes(file, within, shared=True)


def _folder(folder: Path, within: Path, missing: list[str]) -> Iterator[Part]:
    """The files of one folder, none below it, and no link: the small ones first, as many as go along."""
    sizes = {folder / name: (folder / name).lstat().st_size for name in _names(folder, within)}
    total = 0
    for file in sorted(sizes, key=lambda one: (sizes[one], one)):
        name, total = str(file.relative_to(within)), total + sizes[file]
        if total > MAX_BYTES:
            missing.append(f"{name}: {say('cli.support.large', size=total >> 20, most=MAX_BYTES >> 20)}")
        else:
            yield from _readable(name, partial(_read, file, within), missing)


def _latest(folder: Path, within: Path, count: int) -> list[Path]:
    """The folders in it that were written last."""
    found = sorted((folder / name for name in _names(folder, within)), key=lambda one: one.lstat().st_mtime)
    return found[len(found) - min(count, len(found)) :]


def _names(folder: Path, within: Path) -> list[str]:
    try:
        return own_files.names(folder, within)
    except OSError:  # a file, or a link
        return []


def _machine(folder: Path) -> bytes:
    return machine_file.alone(setup_data.noted(folder)).encode()


def _facts(folder: Path) -> dict[str, Any]:
    packages = {one.name: one.version for one in metadata.distributions()}
    disk = shutil.disk_usage(folder) if folder.is_dir() else None
    return {
        "packages": dict(sorted(packages.items())),
        "python": platform.python_version(),
        "system": platform.platform(),
        "at_s": time.time(),
        "since_boot_s": time.monotonic(),
        "boot": BOOT.read_text().strip() if BOOT.exists() else None,
        "state": str(folder),
        "disk_bytes": None if disk is None else disk._asdict(),
    }


def _service_facts(folder: Path) -> dict[str, Any]:
    """Of the service's store. Raises OSError, ValueError, sqlite3.Error."""
    with own_database.reading(folder / service_store.FILE) as sql:
        documents = sql.execute("SELECT name, generation, value FROM documents").fetchall()
        past = history.History(sql)
        runs, alarms = past.runs(LATEST_ROWS), past.alarms(LATEST_ROWS)
        asked = [
            {name: row[name] for name in row if name not in PEOPLE}
            for row in requests.listed(sql, LATEST_ROWS)
        ]
    return {
        "documents": {f"{name} {generation}": json.loads(value) for name, generation, value in documents},
        "runs": [asdict(one) for one in runs],
        "alarms": [asdict(one) for one in alarms],
        "requests": asked,
    }


def _stored(folder: Path) -> dict[str, Any]:
    """Raises StoreError."""
    with contextlib.closing(Store(folder)) as store:
        return {
            "programs": [asdict(one) for one in store.programs.list()],
            "settings": notice_settings.without_secrets(store.settings.all()),
        }


def _journal() -> bytes:
    """What systemd has of our units; nothing where there is no systemd, or it does not answer."""
    units = [word for unit in installation.UNITS for word in ("-u", unit)]
    asked = ["journalctl", "--no-pager", "-o", "short-iso", "-n", str(JOURNAL_LINES), *units]
    try:
        return subprocess.run(asked, capture_output=True, timeout=JOURNAL_TIMEOUT_S, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return b""


def _json(value: Any) -> bytes:
    return json.dumps(value, indent=1, default=str).encode()
