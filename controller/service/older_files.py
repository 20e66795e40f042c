"""What versions before have kept in files of their own, taken into the service's store once.

A file that was taken over lies beside it from then on, under a name that nobody reads (``OLDER``). One that
is damaged is put aside and reported.
"""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from controller import own_database, own_files, sealed_file, sealed_rows
from controller.machine import setup_data
from controller.machine.toml_table import ConfigError
from controller.messages import Message, message
from controller.service import durations, journal, probed, thread_guard, usage
from controller.store import set_up_store, tool_store
from controller.store.service_store import ServiceStore

OLDER = ".older"
ALARMS = "alarms.jsonl"
TABLE = "touches.csv"  # before there was touches.json
OF_PANEL = "of_panel"  # document: what the panel had of runs and alarms was taken over
PANEL_STORES = ("panel/store*.sqlite", "store*.sqlite")  # the panel's own, and copies of before a migration
WRONG = (*sealed_file.UNREADABLE, ConfigError)


class Document(NamedTuple):
    """What a file has become: ``taken`` raises for values that are not sound; ``unknown`` counts instead."""

    name: str
    taken: Callable[[Any], Any]
    unknown: Any = None


def _fitting(values: Any) -> Any:
    return setup_data.sound(values, Path(setup_data.FILE))


DOCUMENTS = {
    "usage.json": Document(usage.DOCUMENT, usage.taken),
    "probed.json": Document(probed.DOCUMENT, probed.taken),
    "durations.json": Document(durations.DOCUMENT, durations.taken),
    "touches.json": Document(probed.TOUCHES, probed.table_lines),
    "journal.json": Document(journal.DOCUMENT, journal.entry_of),
    setup_data.FILE: Document(set_up_store.FITTING, _fitting),
    "in_spindle": Document(set_up_store.SPINDLE, int, 0),
    "thread.json": Document(thread_guard.DOCUMENT, thread_guard.taken, thread_guard.UNKNOWN._asdict()),
}


def take_over(store: ServiceStore, state: Path) -> list[Message]:
    """What alarms say of those that could not be read. Raises OSError."""
    losses = []
    for name, document in DOCUMENTS.items():
        if not store.has(document.name):
            found, loss = _read(state / name, document)
            losses.append(loss)
            if found is not None:
                store.put(document.name, found)
        _put_by(state / name)
    losses.append(_take_table(store, state / TABLE))
    losses += [_take_alarms(store, state / ALARMS), _take_tools(store, state / tool_store.OLDER)]
    if not store.has(OF_PANEL):
        _take_panels(store, state)
    return [loss for loss in losses if loss is not None]


def _read(file: Path, document: Document) -> tuple[Any, Message | None]:
    """The values of a file, or of what counts instead, and what an alarm says then; None: there are none."""
    try:
        values = sealed_file.read(file)
        document.taken(json.loads(json.dumps(values)))
    except FileNotFoundError:
        return None, None
    except WRONG as error:
        return document.unknown, _put_aside(file, error)
    return values, None


def _take_table(store: ServiceStore, file: Path) -> Message | None:
    try:
        lines = own_files.read_text(file).splitlines()
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        return _put_aside(file, error)
    if lines and not store.has(probed.TOUCHES):
        store.put(probed.TOUCHES, lines)
    _put_by(file)
    return None


def _take_alarms(store: ServiceStore, file: Path) -> Message | None:
    found, loss = alarms(file)
    with store.write() as sql:
        if sql.execute("SELECT 1 FROM alarms").fetchone() is None:
            rows = {alarm["id"]: json.dumps(alarm) for alarm in found}
            sql.executemany("INSERT INTO alarms VALUES (?, ?)", rows.items())
    _put_by(file)
    return loss


def alarms(file: Path) -> tuple[list[dict[str, Any]], Message | None]:
    """What is sound of a file of alarms, of which the last line of an id counts, and what an alarm says of
    the rest; the last line may be cut short.
    """
    try:
        lines = own_files.read_bytes(file).splitlines(keepends=True)
    except FileNotFoundError:
        return [], None
    except OSError as error:
        return [], _put_aside(file, error)
    found, bad = [], None
    for line in lines:
        if not line.strip():
            continue
        try:
            alarm = sealed_file.of_line(line, file)
            whole = {**alarm, "id": int(alarm["id"]), "acknowledged_s": alarm["acknowledged_s"]}
            found.append({**whole, "time_s": float(alarm["time_s"]), "name": str(alarm["name"])})
        except WRONG as error:
            bad = bad or (error if line.endswith(b"\n") else None)
    return found, _put_aside(file, bad) if bad else None


def _take_panels(store: ServiceStore, state: Path) -> None:
    """The panel kept copies: of runs also those whose records have gone, under the numbers that they have,
    and of alarms who has acknowledged them.
    """
    for file in (file for where in PANEL_STORES for file in sorted(state.glob(where), reverse=True)):
        with contextlib.suppress(OSError, ValueError, sqlite3.Error), own_database.reading(file) as sql:
            runs, seen = sql.execute(_OLDER_RUNS).fetchall(), sql.execute(_OLDER_ALARMS).fetchall()
            with store.write() as into:
                into.executemany("INSERT OR IGNORE INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?)", runs)
                into.executemany(_SEEN, [(at_s, by, *source.split()) for at_s, by, source in seen])
            break
    with contextlib.suppress(OSError):  # the next start looks again
        store.put(OF_PANEL, True)


_OLDER_RUNS = """
SELECT id, source, program, sha256, began_s, ended_s, result,
json_remove(facts, '$.record', '$.as_cut', '$.kept')
FROM runs WHERE ended_s IS NOT NULL AND json_type(facts) = 'object'
"""
_OLDER_ALARMS = """
SELECT acknowledged_s, acknowledged_by, source FROM alarms
WHERE acknowledged_s IS NOT NULL AND source IS NOT NULL
"""
_SEEN = """
UPDATE alarms SET facts = json_set(facts, '$.acknowledged_s', ?, '$.acknowledged_by', ?)
WHERE id = ? AND json_extract(facts, '$.time_s') = CAST(? AS REAL)
"""


def _take_tools(store: ServiceStore, file: Path) -> Message | None:
    """Where the tools are is known only if each row is as it was written."""
    if not os.path.lexists(file):
        return None
    try:
        with contextlib.closing(own_database.opened(file)) as sql:
            wrong = message("cli.state.lost") if own_database.has_lost(sql, file) else sealed_rows.look(sql)
            known = not wrong and sql.execute("SELECT 1 FROM known").fetchone() is not None
        rows = tool_store.rows_of(file)
        with store.write() as into:
            if into.execute("SELECT 1 FROM log UNION SELECT 1 FROM place").fetchone() is None:
                tool_store.put(into, rows)
                if known:
                    into.execute("INSERT INTO known VALUES (1, ?)", (time.time(),))
    except (ValueError, sqlite3.Error) as error:
        return _put_aside(file, error)
    _put_by(file)
    return message("store_damaged", file=file, what=wrong, aside=f"{file.name}{OLDER}") if wrong else None


def _put_aside(file: Path, why: Exception) -> Message:
    """Gives a file that cannot be read another name; what an alarm says of it."""
    aside = own_files.put_aside(file)
    return sealed_file.begun_anew(file, why, aside.name if aside else "")


def _put_by(file: Path) -> None:
    """What was taken over gets another name; where the disk does not take that, it is the next start's."""
    if os.path.lexists(file):
        with contextlib.suppress(OSError):
            own_files.rename(file, file.with_name(f"{file.name}{OLDER}"))
