"""Where every tool of a changer is, and which step of a change is under way: one SQLite file.

A step that moves a tool is one transaction with what the tool's new place is, and with the step that comes
next; nothing moves before the disk has it. So a loss of power finds the step that was under way, and of the
tool that it carries both places where it may be.

    place   where a tool is: in its pocket, in the spindle (pocket 0), or out of the machine (-1)
    change  the step under way; no row: no change is
    preparation  likewise of the steps that bring a pocket to where its tool is taken, beside a cut
    log     the last steps, and what operators confirmed

The service alone writes it. What it holds is read once, and again behind every transaction: whoever asks
where the tools are (the status, a refusal, every look at the tick) waits for no disk.

A back-up has its rows (``saved_rows``). One that is brought back (``file_of``) is what was last known only:
since then tools were changed, so an operator must confirm first where they are.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from controller import atomic_file, own_database, own_files, sealed_rows
from controller.machine.toml_table import ConfigError
from controller.messages import Message, message

FILE = "tools.db"
SPINDLE, AWAY = 0, -1
KEPT = 2000  # rows of the log
_SCHEMA = """
CREATE TABLE IF NOT EXISTS place (tool INTEGER PRIMARY KEY, pocket INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS known (id INTEGER PRIMARY KEY CHECK (id = 1), time_s REAL NOT NULL);
CREATE TABLE IF NOT EXISTS change (
    id INTEGER PRIMARY KEY CHECK (id = 1), tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL,
    step INTEGER NOT NULL, name TEXT NOT NULL, carries INTEGER NOT NULL, goes_to INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS preparation (
    id INTEGER PRIMARY KEY CHECK (id = 1), tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL,
    step INTEGER NOT NULL, name TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS log (
    id INTEGER PRIMARY KEY AUTOINCREMENT, time_s REAL NOT NULL, what TEXT NOT NULL,
    tool_out INTEGER NOT NULL, tool_in INTEGER NOT NULL, step INTEGER NOT NULL, name TEXT NOT NULL);
"""


class Step(NamedTuple):
    """A step under way: its number in its change, and the tool that it carries to a pocket (0: none)."""

    tool_out: int
    tool_in: int
    step: int
    name: str
    carries: int = 0
    goes_to: int = SPINDLE


class _Held(NamedTuple):
    """What the file holds; never changed, but replaced as a whole."""

    places: Mapping[int, int]
    known: bool
    step: Step | None
    preparation: Step | None


class ToolStore:
    """One per service; every change of it is on the disk when it returns."""

    def __init__(self, file: Path) -> None:
        """Raises ConfigError for a file that is no store."""
        self._lock = threading.Lock()
        try:
            self._db = own_database.opened(file)
            lost = own_database.has_lost(self._db, file)
            self._db.executescript(_SCHEMA)
            for name, rows in _ROWS.items():
                _checked(name, [list(row) for row in self._db.execute(rows)])
            self._held = self._read()
            sealed_rows.seal(self._db)
            self.damaged = self._damaged(file)
            if lost or self.damaged is not None:  # somebody must look
                self.forget()
        except (OSError, ValueError, sqlite3.Error) as error:
            raise _no_store(file, error) from error

    def _damaged(self, file: Path) -> Message | None:
        """What an alarm says of rows that are not as they were written; a copy of them is put aside."""
        with self._whole():
            words = sealed_rows.broken(self._db)
            rows = sealed_rows.damaged(self._db)
            if not rows and not words:
                return None
            aside = own_files.aside(file)
            atomic_file.write(aside, self._db.serialize())
            sealed_rows.index_anew(self._db)
            sealed_rows.accept(self._db)
        tables = sealed_rows.summary(rows, words)
        return message("tool_store_damaged", file=file, tables=tables, aside=aside.name)

    def close(self) -> None:
        self._db.close()

    # -- what is known

    @property
    def places(self) -> Mapping[int, int]:
        """By tool the pocket where it was last; of the one that is carried now, before that."""
        return self._held.places

    @property
    def away(self) -> list[int]:
        """Tools that were out of the machine when somebody looked last."""
        return sorted(tool for tool, pocket in self.places.items() if pocket == AWAY)

    @property
    def spindle(self) -> int | None:
        """The tool in the spindle, 0 = it is empty; None: somebody must say so first."""
        held = self._held
        return _in_spindle(held.places) if held.known else None

    @property
    def known(self) -> bool:
        """Whether somebody has ever said where the tools are."""
        return self._held.known

    @property
    def step(self) -> Step | None:
        """That is under way, or was when all ended."""
        return self._held.step

    @property
    def preparation(self) -> Step | None:
        """The same of a preparation beside a cut, which carries no tool."""
        return self._held.preparation

    def log(self, last: int = 100) -> list[tuple[float, str, int, int, int, str]]:
        """(time, what, tools out and in, step, name), the newest first.

        What: "begun", "over", "preparing", "prepared" or "confirmed".
        """
        with self._lock:
            return list(
                self._db.execute(
                    "SELECT time_s, what, tool_out, tool_in, step, name FROM log ORDER BY id DESC LIMIT ?",
                    (last,),
                )
            )

    # -- what becomes of it

    def begin(self, step: Step) -> None:
        """The step before is over, and this one may move. Raises sqlite3.Error; then nothing may."""
        with self._whole():
            self._arrive()
            self._db.execute("INSERT OR REPLACE INTO change VALUES (1, ?, ?, ?, ?, ?, ?)", step)
            self._note("begun", step)

    def end(self) -> None:
        """The last step is over. Raises sqlite3.Error."""
        with self._whole():
            self._arrive()
            self._db.execute("DELETE FROM change")
            if self.step is not None:
                self._note("over", self.step)

    def prepare(self, step: Step) -> None:
        """The step of a preparation before is over, and this one may switch. Raises sqlite3.Error."""
        with self._whole():
            self._db.execute("INSERT OR REPLACE INTO preparation VALUES (1, ?, ?, ?, ?)", step[:4])
            self._note("preparing", step)

    def prepared(self) -> None:
        """No step of a preparation is under way any more. Raises sqlite3.Error."""
        with self._whole():
            self._db.execute("DELETE FROM preparation")
            if self.preparation is not None:
                self._note("prepared", self.preparation)

    def confirm(self, places: Mapping[int, int]) -> None:
        """An operator has looked where every tool is. Raises sqlite3.Error."""
        with self._whole():
            self._db.execute("DELETE FROM change")
            self._db.execute("DELETE FROM preparation")
            self._db.execute("DELETE FROM place")
            self._db.executemany("INSERT INTO place VALUES (?, ?)", places.items())
            self._db.execute("INSERT OR REPLACE INTO known VALUES (1, ?)", (time.time(),))
            self._note("confirmed", Step(0, _in_spindle(places), 0, ""))

    def forget(self) -> None:
        """Pockets were given to other tools: somebody must look anew. Raises sqlite3.Error."""
        with self._whole():
            self._db.execute("DELETE FROM known")

    def _arrive(self) -> None:
        """What the step under way carries is where it was to go."""
        step = self.step
        if step is not None and step.carries > 0:
            self._db.execute("INSERT OR REPLACE INTO place VALUES (?, ?)", (step.carries, step.goes_to))

    def _note(self, what: str, step: Step) -> None:
        self._db.execute(
            "INSERT INTO log (time_s, what, tool_out, tool_in, step, name) VALUES (?, ?, ?, ?, ?, ?)",
            (time.time(), what, *step[:4]),
        )
        self._db.execute("DELETE FROM log WHERE id <= (SELECT MAX(id) FROM log) - ?", (KEPT,))

    @contextlib.contextmanager
    def _whole(self) -> Iterator[None]:
        """One transaction, taken whole or not at all."""
        with self._lock:
            with self._db:
                self._db.execute("BEGIN IMMEDIATE")
                yield
            self._held = self._read()

    def _read(self) -> _Held:
        places = dict(self._db.execute("SELECT tool, pocket FROM place"))
        known = self._db.execute("SELECT 1 FROM known").fetchone() is not None
        row = self._db.execute(
            "SELECT tool_out, tool_in, step, name, carries, goes_to FROM change"
        ).fetchone()
        beside = self._db.execute("SELECT tool_out, tool_in, step, name FROM preparation").fetchone()
        return _Held(
            places, known, None if row is None else Step(*row), None if beside is None else Step(*beside)
        )


def _in_spindle(places: Mapping[int, int]) -> int:
    return next((tool for tool, pocket in places.items() if pocket == SPINDLE), 0)


def placed(pockets: Iterable[int], in_spindle: int, away: Iterable[int]) -> dict[int, int]:
    """Every tool's place: in its pocket, but for the one in the spindle and those out of the machine."""
    places = {tool: number for number, tool in enumerate(pockets, 1) if tool}
    places |= dict.fromkeys(away, AWAY)
    return places | ({in_spindle: SPINDLE} if in_spindle else {})


# -- of a back-up

_ROWS = {
    "places": "SELECT tool, pocket FROM place ORDER BY tool",
    "step": "SELECT tool_out, tool_in, step, name, carries, goes_to FROM change",
    "log": "SELECT time_s, what, tool_out, tool_in, step, name FROM log ORDER BY id",
}
_INTO = {
    "places": "INSERT INTO place VALUES (?, ?)",
    "step": "INSERT INTO change VALUES (1, ?, ?, ?, ?, ?, ?)",
    "log": "INSERT INTO log (time_s, what, tool_out, tool_in, step, name) VALUES (?, ?, ?, ?, ?, ?)",
}
_KINDS: dict[str, tuple[type, ...]] = {
    "places": (int, int),
    "step": (int, int, int, str, int, int),
    "log": (float, str, int, int, int, str),
}
_MAX_NUMBER = 2**31


def saved_rows(file: Path) -> dict[str, list[list[Any]]]:
    """The rows of a store as one moment has them, also while the service writes it; {} where there is none.

    Raises ConfigError.
    """
    if not os.path.lexists(file):
        return {}
    try:
        with contextlib.closing(own_database.opened(file)) as db:
            db.execute("BEGIN")  # all that is read from here on is of one moment
            return {name: [list(row) for row in db.execute(rows)] for name, rows in _ROWS.items()}
    except (OSError, sqlite3.Error) as error:
        raise _no_store(file, error) from error


def file_of(rows: Mapping[str, Any]) -> bytes:
    """The file of a store with these rows, in which nobody has confirmed yet where the tools are.

    Raises ValueError for what are no rows of ``saved_rows``.
    """
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as db:
        db.executescript(_SCHEMA)
        for name in _ROWS:
            values = _checked(name, rows.get(name))
            try:
                db.executemany(_INTO[name], values)
            except sqlite3.Error as error:
                raise ValueError(f"{name}: {error}") from error
        return db.serialize()


def settle(file: Path) -> None:
    """Take into the file what stands beside it, so that it can be replaced; the service must not run.

    What stood beside a file that is no store goes: it would be taken into the next one.
    """
    if not os.path.lexists(file):
        return
    try:
        with contextlib.closing(own_database.opened(file)) as db:
            db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    except (OSError, sqlite3.Error):
        for end in own_database.BESIDE:
            own_files.remove(file.with_name(f"{file.name}{end}"))


def _checked(name: str, rows: object) -> list[list[Any]]:
    if not isinstance(rows, list):
        raise ValueError(f"{name} is no list of rows")
    kinds = _KINDS[name]
    for row in rows:
        if not isinstance(row, list) or len(row) != len(kinds):
            raise ValueError(f"{name} has a row that is none of {len(kinds)} values")
        for value, kind in zip(row, kinds, strict=True):
            if type(value) is not kind or (isinstance(value, int) and not -1 <= value < _MAX_NUMBER):
                raise ValueError(f"{name} has a row with a value that cannot stand there")
    return rows


def _no_store(file: Path, error: OSError | ValueError | sqlite3.Error) -> ConfigError:
    return ConfigError(message("file.no_tool_store", file=file, why=error))
