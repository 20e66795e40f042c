"""What versions before have kept in files of their own, taken into the service's store once.

A file that was taken over lies beside it from then on, under a name that nobody reads (``OLDER``).
"""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from controller import own_database, own_files, sealed_file, sealed_rows
from controller.messages import Message, message
from controller.service import durations, kept_file, probed, usage
from controller.store import tool_store
from controller.store.service_store import ServiceStore

OLDER = ".older"
ALARMS = "alarms.jsonl"
TABLE = "touches.csv"  # before there was touches.json
# By the file's name: the document that it has become, and what raises for values that are not sound.
DOCUMENTS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "usage.json": (usage.DOCUMENT, usage.taken),
    "probed.json": (probed.DOCUMENT, probed.taken),
    "durations.json": (durations.DOCUMENT, durations.taken),
    "touches.json": (probed.TOUCHES, probed.table_lines),
}


def take_over(store: ServiceStore, state: Path) -> list[Message]:
    """What alarms say of those that could not be read. Raises OSError."""
    losses = []
    for name, (document, taken) in DOCUMENTS.items():
        if not store.has(document):
            found, loss = kept_file.read(state / name, _whole(taken), None)
            losses.append(loss)
            if found is not None:
                store.put(document, found)
        _put_by(state / name)
    losses.append(_take_table(store, state / TABLE))
    losses += [_take_alarms(store, state / ALARMS), _take_tools(store, state / tool_store.OLDER)]
    return [loss for loss in losses if loss is not None]


def _whole(taken: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The values themselves, where ``taken`` takes them."""

    def checked(values: Any) -> Any:
        taken(json.loads(json.dumps(values)))
        return values

    return checked


def _take_table(store: ServiceStore, file: Path) -> Message | None:
    try:
        lines = own_files.read_text(file).splitlines()
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        return kept_file.put_aside(file, error)
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
        return [], kept_file.put_aside(file, error)
    found, bad = [], None
    for line in lines:
        if not line.strip():
            continue
        try:
            alarm = sealed_file.of_line(line, file)
            whole = {**alarm, "id": int(alarm["id"]), "acknowledged_s": alarm["acknowledged_s"]}
            found.append({**whole, "time_s": float(alarm["time_s"]), "name": str(alarm["name"])})
        except kept_file.WRONG as error:
            bad = bad or (error if line.endswith(b"\n") else None)
    return found, kept_file.put_aside(file, bad) if bad else None


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
        return kept_file.put_aside(file, error)
    _put_by(file)
    return message("store_damaged", file=file, what=wrong, aside=f"{file.name}{OLDER}") if wrong else None


def _put_by(file: Path) -> None:
    """What was taken over gets another name; where the disk does not take that, it is the next start's."""
    for one in (file, sealed_file.before(file)):
        if os.path.lexists(one):
            with contextlib.suppress(OSError):
                own_files.rename(one, one.with_name(f"{one.name}{OLDER}"))
