"""``directrix state``: whether what a state folder holds is as it was written."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import sqlite3
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

import typer
from rich.table import Table as Printed

from controller import messages, npz, own_database, own_files, sealed_file, sealed_rows
from controller.api import log_in_marker, own_folder
from controller.api.programs import CONTENT, FOLDER
from controller.cli.speech import Verbs
from controller.ipc import control_socket
from controller.machine import arrangement
from controller.messages import Message, message, of_error
from controller.runtime import events
from controller.service import older_files, owners, requests
from controller.service.folders import Folders
from controller.state import record_files
from controller.state.setpoints import TABLES, Table
from controller.store import service_store, tool_store
from controller.verify.console import Refused, answered, in_words, refusals, say, show

app = Verbs(add_completion=False, no_args_is_help=True)

Condition = Literal["ok", "older", "unread", "damaged"]
OK: Final = "ok"
OLDER: Final = "older"
UNREAD: Final = "unread"
DAMAGED: Final = "damaged"
WRONG = (OSError, ValueError, events.EventError)
COPIES = 10  # of a database that is written meanwhile
GROUPS = (record_files.RUNS, record_files.RECORDINGS, "checks", arrangement.FOLDER)
PROGRAMS = f"{own_folder.PANEL}/{FOLDER}/"


class FileCondition(NamedTuple):
    """A file, by its path in the state folder; ``why`` it is damaged, or cannot be read by who asks."""

    file: str
    condition: Condition
    why: Message | None = None


@app.callback()
def main() -> None:
    """Whether what a state folder holds is as it was written."""


@app.command()
def check(state: Path | None = None, as_json: bool = False) -> None:
    """Hold every file and row of a state folder against its checksum. It changes nothing; exit code 1 where
    one is damaged, or not for you to read.
    """
    with refusals(as_json):
        folder = state or control_socket.state_folder()
        if not folder.is_dir():
            raise Refused(say("cli.support.no_state", folder=folder))
        found = list(look(folder))
        counts = Counter(one.condition for one in found)
        ok = not counts[DAMAGED] and not counts[UNREAD]
        if as_json:
            rows = [{**one._asdict(), "why": in_words(one.why)} for one in found]
            told = {"ok": ok, "damaged": counts[DAMAGED], "unread": counts[UNREAD], "files": rows}
            print(json.dumps(told))
        else:
            show.print("\n".join(_lines(found)), soft_wrap=True)
    if not ok:
        raise typer.Exit(1)


@app.command("requests")
def list_requests(
    most: Annotated[int, typer.Option("--most", min=1, max=requests.MAX_ROWS)] = 50,
    state: Path | None = None,
    as_json: bool = False,
) -> None:
    """Who asked the machine for what, as the service has noted it."""
    with refusals(as_json):
        file = (state or control_socket.state_folder()) / service_store.FILE
        try:
            with own_database.reading(file) as sql:
                rows = list(requests.listed(sql, most))
        except (OSError, sqlite3.Error) as error:
            raise Refused(say("os_error_of", file=file, why=error)) from error
        if answered(as_json, requests=rows):
            return
        heads = ("time", "user", "role", "address", "request", "arguments", "refused")
        table = Printed(*(say(f"table.{head}") for head in heads), box=None, pad_edge=False)
        for row in rows:
            at = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(row["time_s"]))
            table.add_row(at, *(str(row[name]) for name in requests.COLUMNS[1:] if name != "peer"))
        show.print(table)


def _lines(found: list[FileCondition]) -> Iterator[str]:
    """One each, but for the many of a folder that are as they should be."""
    counts = Counter((_group(one), one.condition) for one in found if one.why is None)
    for (name, condition), count in counts.items():
        yield say(f"cli.state.{condition}", file=f"{name} ({count})" if name.endswith("/") else name)
    for one in found:
        if one.why is not None:
            yield say(f"cli.state.{one.condition}", file=one.file, why=in_words(one.why))
    of = Counter(one.condition for one in found)
    yield say("cli.state.all", count=len(found), damaged=of[DAMAGED], unread=of[UNREAD])


def _group(one: FileCondition) -> str:
    first = Path(one.file).parts[0]
    if one.file.startswith(PROGRAMS):
        return PROGRAMS
    return f"{first}/" if first in GROUPS else one.file


def look(state: Path) -> Iterator[FileCondition]:
    """Every file of a state folder that is read again, in the order of their names. Raises OSError."""
    for name in owners.SEALED:
        yield from _held(state / name, state, _sealed)
    for name in older_files.DOCUMENTS:
        yield from _held(state / name, state, _sealed)
    yield from _held(state / older_files.ALARMS, state, _alarms)
    own = own_folder.of(state)
    yield from _held(own / log_in_marker.FILE, state, _log_in)
    yield from _held(own / own_folder.STORE, state, _rows)
    for name in (tool_store.OLDER, service_store.FILE, service_store.COPY):
        yield from _held(state / name, state, _rows)
    was = os.path.lexists(state / service_store.COPY) or sealed_file.is_marked(state / service_store.FILE)
    if was and not os.path.lexists(state / service_store.FILE):
        yield FileCondition(service_store.FILE, DAMAGED, message("sealed.gone"))
    folders = Folders.within(state)
    for folder, condition in ((folders.arranged, _record), (folders.checks, _sealed)):
        for name in own_files.names(folder, state):
            yield from _held(folder / name, state, condition)
    for name in own_files.names(own / FOLDER, state):
        if name.endswith(CONTENT):
            yield from _held(own / FOLDER / name, state, _program)
    for kind in (record_files.RUNS, record_files.RECORDINGS):
        for name in own_files.names(state / kind, state):
            yield from _of_record(state / kind / name, state)


def _of_record(folder: Path, state: Path) -> Iterator[FileCondition]:
    """Of a run or of a fault."""
    for name in (record_files.RUN, record_files.BEGUN):
        yield from _held(folder / name, state, _facts)
    yield from _held(folder / record_files.EVENTS, state, _events)
    yield from _held(folder / record_files.TRACE, state, _packed)
    for table in TABLES:
        yield from _segments(table, folder, state)


def _segments(table: Table, folder: Path, state: Path) -> Iterator[FileCondition]:
    """Of a run: each by itself."""
    for piece in table.pieces(folder):
        name = str(piece.file.relative_to(state))
        yield FileCondition(name, OK) if piece.spoilt is None else FileCondition(name, DAMAGED, piece.spoilt)


def _held(file: Path, state: Path, condition: Callable[[Path, Path], Condition]) -> Iterator[FileCondition]:
    """What a look at a file finds; nothing where it is not there."""
    name = str(file.relative_to(state))
    if not os.path.lexists(file):
        return
    try:
        yield FileCondition(name, condition(file, state))
    except PermissionError as error:
        yield FileCondition(name, UNREAD if error.errno == errno.EACCES else DAMAGED, of_error(error))
    except WRONG as error:
        yield FileCondition(name, DAMAGED, of_error(error))
    except sqlite3.Error as error:
        yield FileCondition(name, DAMAGED, messages.plain(str(error)))


# -- each raises one of the above for what is damaged


def _sealed(file: Path, state: Path) -> Condition:
    sealed_file.read(file)
    return OK if sealed_file.is_sealed(file) else OLDER


def _record(file: Path, state: Path) -> Condition:
    sealed_file.read(file, within=state, shared=True, older=sealed_file.INDENTED)
    return OK if sealed_file.is_sealed(file, state, shared=True) else OLDER


def _facts(file: Path, state: Path) -> Condition:
    record_files.facts(file.parent, file.name, state)
    return _record(file, state)


def _alarms(file: Path, state: Path) -> Condition:
    lines = [line for line in own_files.read_bytes(file, state).splitlines() if line.strip()]
    for line in lines:
        sealed_file.of_line(line, file)
    return OK if all(sealed_file.has_sum(line) for line in lines) else OLDER


def _log_in(file: Path, state: Path) -> Condition:
    if log_in_marker.users(file.parent) is None:
        raise sealed_file.Damaged(message("sealed.other"))
    return OK


def _rows(file: Path, state: Path) -> Condition:
    """Of a copy: to open it is to take what is written ahead into it, and what is damaged there is gone."""
    with tempfile.TemporaryDirectory(prefix="directrix-") as folder:
        own, stamp = Path(folder) / file.name, None
        for _ in range(COPIES):  # until nothing was taken over from beside it meanwhile
            if stamp == (stamp := file.stat().st_mtime_ns):
                break
            for end in ("-shm", "", "-wal"):  # the count of what is ahead before that itself, which grows
                with contextlib.suppress(FileNotFoundError):
                    data = own_files.read_bytes(file.with_name(f"{file.name}{end}"), shared=True)
                    own.with_name(f"{own.name}{end}").write_bytes(data)
        known = own_database.ahead(own)
        with contextlib.closing(own_database.opened(own)) as sql:
            if own_database.has_lost(sql, own, known):
                raise sealed_file.Damaged(message("cli.state.lost"))
            wrong = sealed_rows.look(sql)
    if wrong:
        raise sealed_file.Damaged(message("cli.state.rows", tables=wrong))
    return OLDER if wrong is None else OK


def _program(file: Path, state: Path) -> Condition:
    """Its name is its sum."""
    _same(own_files.read_bytes(file, state, shared=True), file.name.removesuffix(CONTENT))
    return OK


def _events(file: Path, state: Path) -> Condition:
    """With them what they have sums of."""
    count = None
    with contextlib.suppress(OSError, ValueError):  # which is a line of its own
        count = record_files.facts(file.parent, within=state).get(record_files.COUNT)
    found = events.recorded(file, count)
    if found is not None and found.spoilt:
        first = found.spoilt[0]
        raise events.EventError(message("events.damaged", where=f"{file}:{first.number}", why=first.why))
    if found is None or not events.has_sums(file):
        return OLDER if file.stat().st_size else OK
    for name, wanted in (
        (events.PROGRAM, found.begin.program_sha256),
        (events.MACHINE, found.begin.machine_sha256),
    ):
        if os.path.lexists(file.with_name(name)):
            _same(own_files.read_bytes(file.with_name(name), state, shared=True), wanted)
    return OK


def _same(data: bytes, wanted: str) -> None:
    """Raises Damaged."""
    if hashlib.sha256(data).hexdigest() != wanted:
        raise sealed_file.Damaged(message("sealed.other"))


def _packed(file: Path, state: Path) -> Condition:
    """It has sums of its own."""
    with own_files.opened(file, os.O_RDONLY, state, shared=True) as data:
        npz.check(data)
    return OK
