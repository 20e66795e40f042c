"""What has been at a machine: its runs and its alarms, rows of the service's store.

    history.add_run(sql, facts)              # of a run that has ended, in a transaction of the service
    with history.reading(state) as past:     # whoever else wants to know: all of it is of one moment
        past.runs(10), past.alarms(open_only=True)

A row that is not as it was written is left out; the service itself reports it. Every ``..._s`` that names a
moment is seconds since 1970 (UTC); ``facts`` are JSON values.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from controller import own_database, sealed_rows
from controller.store import service_store
from controller.store.service_store import ServiceStore

TYPED = "MDI"  # a line typed by hand is no program
MAX_RUNS = 50_000  # rows; sums are of these
AT_THE_MACHINE = "at the machine"  # who acknowledged, where that is not known

_OF_RUN = ("id", "name", "sha256", "started_s", "ended_s", "result")  # columns; the others are facts
_OF_ALARM = ("id", "time_s", "name", "axis", "key", "values", "sentence", "acknowledged_s", "acknowledged_by")
_COLUMNS = "id, program, sha256, began_s, ended_s, result, facts, record"

Facts = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Run:
    """One start of a program and what became of it."""

    id: int
    program: str
    sha256: str
    began_s: float
    ended_s: float
    # 'completed', 'stopped', 'refused', 'fault', 'interrupted', or 'lost': its service ended, or was killed.
    result: str
    facts: Facts  # duration_s, cut_time_s, following_error {axis, value}, record = name of its folder, ...


@dataclass(frozen=True, slots=True)
class Alarm:
    """A fault as it was raised."""

    id: int
    at_s: float
    name: str  # of the row in the fault table
    axis: str  # "" = of none
    key: str | None  # of what is said, with its values; None: it was stored as a sentence, before keys were
    values: Facts | None
    sentence: str
    facts: Facts  # cause, remedy, recovery, position_trusted, recording, ...
    acknowledged_s: float | None
    acknowledged_by: str | None


class History:
    """Answers from the rows of an open store. Raises sqlite3.Error."""

    def __init__(self, sql: sqlite3.Connection) -> None:
        self._sql = sql
        self._sound = {name: sealed_rows.sound(sql, name) for name in ("runs", "alarms")}

    # -- runs

    def runs(self, most: int = 100, before: int | None = None) -> list[Run]:
        """The latest first; ``before`` a number, for the next page."""
        rows = self._runs("id < coalesce(?, 1 << 62) ORDER BY id DESC LIMIT ?", before, most)
        return [_run(row) for row in rows]

    def runs_since(self, number: int) -> list[Run]:
        """All with a greater number, in their order."""
        return [_run(row) for row in self._runs("id > ? ORDER BY id", number)]

    def run(self, number: int) -> Run | None:
        return next((_run(row) for row in self._runs("id = ?", number)), None)

    def by_program(self) -> dict[str, tuple[Run, int]]:
        """By name of a program its latest run, and how often it came to its end."""
        rows = self._sql.execute(
            f"SELECT {_COLUMNS}, max(id), sum(result = 'completed') FROM runs "  # columns: those of max(id)
            f"WHERE {self._sound['runs']} GROUP BY program"
        )
        return {row[1]: (_run(row), row[-1]) for row in rows}

    def sums_of_runs(self) -> dict[str, tuple[int, float, float]]:
        """By result: how many runs, seconds in motion, seconds of cutting."""
        rows = self._sql.execute(
            "SELECT result, COUNT(*), TOTAL(json_extract(facts, '$.duration_s')), "
            "TOTAL(json_extract(facts, '$.cut_time_s')) "
            f"FROM runs WHERE {self._sound['runs']} GROUP BY result"
        )
        return {row[0]: (row[1], row[2], row[3]) for row in rows}

    def _runs(self, which: str, *values: object) -> Iterable[tuple[Any, ...]]:
        asked = f"SELECT {_COLUMNS} FROM runs WHERE {self._sound['runs']} AND {which}"
        return self._sql.execute(asked, values)

    # -- alarms

    def alarms(self, most: int = 100, before: int | None = None, open_only: bool = False) -> list[Alarm]:
        """The latest first; ``open_only``: not yet acknowledged."""
        found = self._alarms("id < coalesce(?, 1 << 62) ORDER BY id DESC", before)
        return [*islice((one for one in found if not open_only or one.acknowledged_s is None), most)]

    def alarm(self, number: int) -> Alarm | None:
        return next(self._alarms("id = ?", number), None)

    def sums_of_alarms(self) -> dict[str, tuple[int, int]]:
        """By name: how many were raised, and how many of them nobody has acknowledged."""
        there = [*self._alarms("1 ORDER BY id")]
        unseen = Counter(one.name for one in there if one.acknowledged_s is None)
        raised = Counter(one.name for one in there)
        return {name: (raised[name], unseen[name]) for name in sorted(raised)}

    def _alarms(self, which: str, *values: object) -> Iterator[Alarm]:
        asked = f"SELECT facts FROM alarms WHERE {self._sound['alarms']} AND {which}"
        for (facts,) in self._sql.execute(asked, values):
            yield _alarm(json.loads(facts))


def _run(row: tuple[Any, ...]) -> Run:
    number, program, sha256, began_s, ended_s, result, facts, record = row[:8]
    known = {**json.loads(facts), **({"record": record} if record else {})}
    return Run(number, program, sha256, began_s, ended_s, result, known)


def _alarm(raised: dict[str, Any]) -> Alarm:
    seen_s, axis, sentence = (raised.get(name) for name in ("acknowledged_s", "axis", "sentence"))
    by = None if seen_s is None else raised.get("acknowledged_by") or AT_THE_MACHINE
    facts = {name: value for name, value in raised.items() if name not in _OF_ALARM}
    own = raised["id"], raised["time_s"], raised["name"], axis or "", raised.get("key"), raised.get("values")
    return Alarm(*own, sentence or "", facts, seen_s, by)


@contextlib.contextmanager
def reading(state: Path) -> Iterator[History]:
    """What is in the store of a state folder, for who only reads. Raises OSError, sqlite3.Error."""
    with own_database.reading(state / service_store.FILE) as sql:
        yield History(sql)


def add_run(sql: sqlite3.Connection, facts: Facts) -> None:
    """A row of a run that has ended, of the facts that its record has; nothing where there is one. Raises
    sqlite3.Error, and what facts that are none lead to: KeyError, TypeError, ValueError.
    """
    program = str(facts.get("name") or TYPED)
    moments = float(facts["started_s"]), float(facts["ended_s"])
    more = json.dumps({name: value for name, value in facts.items() if name not in _OF_RUN})
    sql.execute(
        "INSERT OR IGNORE INTO runs (record, program, sha256, began_s, ended_s, result, facts) "
        "VALUES (?, ?, ?, ?, ?, ?, ?)",
        (str(facts["id"]), program, str(facts.get("sha256") or ""), *moments, str(facts["result"]), more),
    )
    sql.execute("DELETE FROM runs WHERE id <= (SELECT max(id) FROM runs) - ?", (MAX_RUNS,))


def end_of(store: ServiceStore, record: str) -> dict[str, Any] | None:
    """The facts that ``add_run`` was given of a record; None: it has no row. Raises OSError."""
    for _, *own, facts, _ in store.rows(f"SELECT {_COLUMNS} FROM runs WHERE record = ?", (record,)):
        return {**json.loads(facts), **dict(zip(_OF_RUN, (record, *own), strict=True))}
    return None


def records(store: ServiceStore) -> set[str]:
    """Names of the records whose runs have a row. Raises OSError."""
    return {row[0] for row in store.rows("SELECT record FROM runs WHERE record IS NOT NULL")}
