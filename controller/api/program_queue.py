"""The queue: programs that are to run one after another, each so many times.

The front of the queue is loaded and started as any program is, by whoever holds control; every run of it
that ends whole counts, however it was started. Kept in the store, so a panel that is restarted goes on
counting: also runs that ended while it was away.
"""

from __future__ import annotations

import sqlite3
import time
from dataclasses import dataclass

from controller.api.database import Database, StoreError
from controller.api.records import Clock
from controller.messages import Key
from controller.store.history import History

MAX_ENTRIES = 100  # entries
COUNTED = "queue.run"  # the mark: the newest run that was looked at


@dataclass(frozen=True, slots=True)
class Entry:
    """A program of the queue."""

    id: int
    program: str
    count: int  # wanted
    done: int
    added_s: float
    added_by: str


@dataclass(frozen=True, slots=True)
class Ended:
    """A run that ended since the last look."""

    program: str
    result: str
    counted: bool  # it was whole, and of the front


class Queue:
    """Raises StoreError."""

    def __init__(self, database: Database, clock: Clock = time.time) -> None:
        self._database, self._clock = database, clock

    def all(self) -> list[Entry]:
        """In their order, those that are done among them."""
        return [_entry(row) for row in self._database.rows("SELECT * FROM queue ORDER BY place, id")]

    def front(self) -> Entry | None:
        """The first that is not done."""
        return next((one for one in self.all() if one.done < one.count), None)

    def add(self, program: str, count: int, by: str) -> Entry:
        """At the end; runs of before there was any entry do not count. Raises StoreError: missing, many."""
        with self._database.write() as sql:
            if not sql.execute("SELECT 1 FROM programs WHERE name = ?", (program,)).fetchone():
                raise StoreError.of("missing", "missing", what=Key("what.program"), name=program)
            length, last = sql.execute("SELECT COUNT(*), COALESCE(MAX(place), 0) FROM queue").fetchone()
            if length >= MAX_ENTRIES:
                raise StoreError.of("many", "queue_full", most=MAX_ENTRIES)
            if not length:
                sql.execute("DELETE FROM marks WHERE key = ?", (COUNTED,))
            done = sql.execute(
                "INSERT INTO queue (place, program, count, done, added_s, added_by) "
                "VALUES (?, ?, ?, 0, ?, ?)",
                (last + 1, program, count, self._clock(), by),
            )
        return self._get(done.lastrowid or 0)

    def change(self, number: int, count: int | None, place: int | None) -> Entry:
        """Another count, or another place, 0 the first. Raises StoreError: missing."""
        with self._database.write() as sql:
            order = [row[0] for row in sql.execute("SELECT id FROM queue ORDER BY place, id")]
            if number not in order:
                raise _missing(number)
            if count is not None:
                sql.execute("UPDATE queue SET count = ? WHERE id = ?", (count, number))
            if place is not None:
                order.remove(number)
                order.insert(place, number)
                sql.executemany("UPDATE queue SET place = ? WHERE id = ?", list(enumerate(order)))
        return self._get(number)

    def remove(self, number: int) -> None:
        """Raises StoreError: missing."""
        with self._database.write() as sql:
            if not sql.execute("DELETE FROM queue WHERE id = ?", (number,)).rowcount:
                raise _missing(number)

    def count_runs(self, past: History) -> list[Ended]:
        """Take into account the runs that ended since the last look; they, in their order."""
        newest = next((run.id for run in past.runs(1)), 0)
        if self._mark() == newest:
            return []
        with self._database.write() as sql:
            mark = self._mark()  # again: now nobody else counts
            sql.execute("REPLACE INTO marks VALUES (?, ?, ?, 'queue')", (COUNTED, str(newest), self._clock()))
            # What was before the first look ever is not counted.
            ended = past.runs_since(newest if mark is None else mark)
            return [_count(sql, run.program, run.result) for run in ended]

    def _mark(self) -> int | None:
        rows = self._database.rows("SELECT value FROM marks WHERE key = ?", (COUNTED,))
        return int(rows[0][0]) if rows else None

    def _get(self, number: int) -> Entry:
        return _entry(self._database.rows("SELECT * FROM queue WHERE id = ?", (number,))[0])


def _count(sql: sqlite3.Connection, program: str, result: str) -> Ended:
    asked = "SELECT id, program FROM queue WHERE done < count ORDER BY place, id LIMIT 1"
    front = sql.execute(asked).fetchone()
    counted = front is not None and result == "completed" and front["program"] == program
    if counted:
        sql.execute("UPDATE queue SET done = done + 1 WHERE id = ?", (front["id"],))
    return Ended(program, result, counted)


def _entry(row: sqlite3.Row) -> Entry:
    values = dict(row)
    del values["place"]
    return Entry(**values)


def _missing(number: int) -> StoreError:
    return StoreError.of("missing", "missing", what=Key("what.entry"), name=number)
