"""What the service wrote of runs and alarms, taken into the store.

The service writes a store and records of its own, so that nothing it has to keep waits for the panel. Here
they become rows that can be listed, searched and acknowledged. Taking the same in again changes nothing, so
it may be done at any time and by anybody.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
from pathlib import Path
from typing import Any

from controller import own_database, sealed_rows
from controller.api.database import Database
from controller.state.record_files import RUN, RUNS, facts
from controller.store import service_store

BY_SERVICE = "at the machine"  # who acknowledged, where the service does not say

_OWN = ("id", "time_s", "name", "axis", "sentence", "acknowledged_s")  # columns; the others are facts
_OWN_RUN = ("id", "name", "sha256", "started_s", "ended_s", "result")


class Gatherer:
    """Looks whether there is something new."""

    def __init__(self, database: Database, state: Path) -> None:
        self._database, self._state = database, state
        self._stamped: tuple[object, ...] = ()  # size and time of what was read last
        self._alarms: dict[int, str] = {}  # as they were taken in
        self._runs: set[str] = {
            row[0] for row in database.rows("SELECT source FROM runs WHERE source IS NOT NULL")
        }

    def gather(self) -> bool:
        """Take in what is new; whether there was anything. Raises StoreError."""
        return bool(self._gather_alarms() + self._gather_runs())

    def _gather_alarms(self) -> int:
        """A store that cannot be read is looked at again the next time; rows that are damaged stay out."""
        file = self._state / service_store.FILE
        try:
            if (stamp := _stamp(file)) == self._stamped:
                return 0
            with own_database.reading(file) as sql:
                found = dict(sql.execute("SELECT id, facts FROM alarms"))
                if found != self._alarms:
                    damaged = {row for name, row in sealed_rows.damaged(sql) if name == "alarms"}
                    found = {number: facts for number, facts in found.items() if number not in damaged}
        except (OSError, sqlite3.Error):
            return 0
        new = [facts for number, facts in found.items() if self._alarms.get(number) != facts]
        if new:
            with self._database.write() as own:
                for facts in new:
                    _alarm(own, facts)
        self._stamped, self._alarms = stamp, found
        return len(new)

    def _gather_runs(self) -> int:
        """A record that cannot be read is looked at again the next time."""
        files = sorted((self._state / RUNS).glob(f"*/{RUN}"))
        read = {f.parent.name: _run(f) for f in files if f.parent.name not in self._runs}
        ended = {name: run for name, run in read.items() if run is not None}
        if not ended:
            return 0
        with self._database.write() as sql:
            for run in ended.values():
                sql.execute(
                    "INSERT INTO runs (program, sha256, began_s, ended_s, result, facts, source) "
                    "VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT (source) DO NOTHING",
                    run,
                )
        self._runs |= set(ended)
        return len(ended)


def _stamp(file: Path) -> tuple[object, ...]:
    """Of a database, and of what is written ahead of it. Raises OSError."""
    found = file.stat()
    ahead = None
    with contextlib.suppress(FileNotFoundError):
        ahead = file.with_name(f"{file.name}-wal").stat()
    return found.st_size, found.st_mtime_ns, ahead and (ahead.st_size, ahead.st_mtime_ns)


def _alarm(sql: sqlite3.Connection, facts: str) -> None:
    """A later state of the same alarm adds to it."""
    told = json.loads(facts)
    source = f"{int(told['id'])} {float(told['time_s'])!r}"
    values = (
        float(told["time_s"]),
        str(told["name"]),
        str(told.get("axis") or ""),
        str(told.get("sentence") or ""),  # of those that were kept before keys were
        json.dumps({k: v for k, v in told.items() if k not in _OWN} | {"number": told["id"]}),
        source,
    )
    sql.execute(
        "INSERT INTO alarms (at_s, name, axis, sentence, facts, source) VALUES (?, ?, ?, ?, ?, ?) "
        "ON CONFLICT (source) DO UPDATE SET facts = excluded.facts",
        values,
    )
    if (seen_s := told.get("acknowledged_s")) is not None:
        sql.execute(
            "UPDATE alarms SET acknowledged_s = ?, acknowledged_by = ? "
            "WHERE source = ? AND acknowledged_s IS NULL",
            (float(seen_s), str(told.get("acknowledged_by") or BY_SERVICE), source),
        )


def _run(file: Path) -> tuple[Any, ...] | None:
    """The row of a run; None for what is no record."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        told = facts(file.parent, within=file.parent.parent.parent)
        return (
            str(told.get("name") or "MDI"),
            str(told.get("sha256") or ""),
            float(told["started_s"]),
            float(told["ended_s"]),
            str(told["result"]),
            json.dumps({k: v for k, v in told.items() if k not in _OWN_RUN} | {"record": file.parent.name}),
            file.parent.name,
        )
    return None
