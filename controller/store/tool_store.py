"""Where every tool of a changer is, and which step of a change is under way: tables of the service's store.

A step that moves a tool is one transaction with what the tool's new place is, and with the step that comes
next; nothing moves before the disk has it. So a loss of power finds the step that was under way, and of the
tool that it carries both places where it may be.

    place   where a tool is: in its pocket, in the spindle (pocket 0), or out of the machine (-1)
    change  the step under way; no row: no change is
    preparation  likewise of the steps that bring a pocket to where its tool is taken, beside a cut
    log     the last steps, and what operators confirmed

What they hold is read once, and again behind every transaction: whoever asks where the tools are (the status,
a refusal, every look at the tick) waits for no disk.

A back-up has their rows (``saved_rows``). One that is brought back (``replace``) is what was last known,
and no more: since then tools were changed, so an operator must confirm first where they are.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from controller import own_database
from controller.machine.toml_table import ConfigError
from controller.messages import message
from controller.store import service_store
from controller.store.service_store import ServiceStore

OLDER = "tools.db"  # where versions before kept them, in tables of the same names
SPINDLE, AWAY = 0, -1
KEPT = 2000  # rows of the log


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

    def __init__(self, store: ServiceStore) -> None:
        """Where the store has lost something, somebody must look where the tools are. Raises OSError."""
        self._store = store
        self._held = self._read()
        if store.losses:
            self.forget()

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

    def log(self, last: int = 100) -> list[tuple[Any, ...]]:
        """(time, what, tools out and in, step, name), the newest first.

        What: "begun", "over", "preparing", "prepared" or "confirmed".
        """
        newest_first = "SELECT time_s, what, tool_out, tool_in, step, name FROM log ORDER BY id DESC LIMIT ?"
        return self._store.rows(newest_first, (last,))

    # -- what becomes of it

    def begin(self, step: Step) -> None:
        """The step before is over, and this one may move. Raises OSError; then nothing may."""
        with self._whole() as sql:
            self._arrive(sql)
            sql.execute("INSERT OR REPLACE INTO change VALUES (1, ?, ?, ?, ?, ?, ?)", step)
            self._note(sql, "begun", step)

    def end(self) -> None:
        """The last step is over. Raises OSError."""
        with self._whole() as sql:
            self._arrive(sql)
            sql.execute("DELETE FROM change")
            if self.step is not None:
                self._note(sql, "over", self.step)

    def prepare(self, step: Step) -> None:
        """The step of a preparation before is over, and this one may switch. Raises OSError."""
        with self._whole() as sql:
            sql.execute("INSERT OR REPLACE INTO preparation VALUES (1, ?, ?, ?, ?)", step[:4])
            self._note(sql, "preparing", step)

    def prepared(self) -> None:
        """No step of a preparation is under way any more. Raises OSError."""
        with self._whole() as sql:
            sql.execute("DELETE FROM preparation")
            if self.preparation is not None:
                self._note(sql, "prepared", self.preparation)

    def confirm(self, places: Mapping[int, int]) -> None:
        """An operator has looked where every tool is. Raises OSError."""
        with self._whole() as sql:
            sql.execute("DELETE FROM change")
            sql.execute("DELETE FROM preparation")
            sql.execute("DELETE FROM place")
            sql.executemany("INSERT INTO place VALUES (?, ?)", places.items())
            sql.execute("INSERT OR REPLACE INTO known VALUES (1, ?)", (time.time(),))
            self._note(sql, "confirmed", Step(0, _in_spindle(places), 0, ""))

    def forget(self) -> None:
        """Pockets were given to other tools: somebody must look anew. Raises OSError."""
        with self._whole() as sql:
            sql.execute("DELETE FROM known")

    def _arrive(self, sql: sqlite3.Connection) -> None:
        """What the step under way carries is where it was to go."""
        step = self.step
        if step is not None and step.carries > 0:
            sql.execute("INSERT OR REPLACE INTO place VALUES (?, ?)", (step.carries, step.goes_to))

    def _note(self, sql: sqlite3.Connection, what: str, step: Step) -> None:
        sql.execute(
            "INSERT INTO log (time_s, what, tool_out, tool_in, step, name) VALUES (?, ?, ?, ?, ?, ?)",
            (time.time(), what, *step[:4]),
        )
        sql.execute("DELETE FROM log WHERE id <= (SELECT MAX(id) FROM log) - ?", (KEPT,))

    @contextlib.contextmanager
    def _whole(self) -> Iterator[sqlite3.Connection]:
        """One transaction, taken whole or not at all."""
        with self._store.write() as sql:
            yield sql
        self._held = self._read()

    def _read(self) -> _Held:
        rows = self._store.rows
        known = bool(rows("SELECT 1 FROM known"))
        step = rows("SELECT tool_out, tool_in, step, name, carries, goes_to FROM change")
        beside = rows("SELECT tool_out, tool_in, step, name FROM preparation")
        return _Held(
            dict(rows("SELECT tool, pocket FROM place")),
            known,
            Step(*step[0]) if step else None,
            Step(*beside[0]) if beside else None,
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


def saved_rows(state: Path) -> dict[str, list[list[Any]]]:
    """The rows of a state folder as one moment has them, also while the service writes them; {} where no tool
    was ever anywhere. Raises ConfigError.
    """
    for file in (state / service_store.FILE, state / OLDER):
        if os.path.lexists(file):
            try:
                found = rows_of(file)
            except (OSError, sqlite3.Error) as error:
                raise ConfigError(message("file.no_tool_store", file=file, why=error)) from error
            if any(found.values()):
                return found
    return {}


def rows_of(file: Path) -> dict[str, list[list[Any]]]:
    """Raises OSError, sqlite3.Error."""
    with own_database.reading(file) as db:
        return {name: [list(row) for row in db.execute(rows)] for name, rows in _ROWS.items()}


def replace(sql: sqlite3.Connection, rows: Mapping[str, Any]) -> None:
    """Has a store these rows of the tools; nobody has confirmed yet where they are.

    Raises ValueError for what are no rows of ``saved_rows``.
    """
    for table in ("place", "known", "change", "preparation", "log"):
        sql.execute(f"DELETE FROM {table}")
    put(sql, rows)


def put(sql: sqlite3.Connection, rows: Mapping[str, Any]) -> None:
    """Rows of ``saved_rows`` into empty tables. Raises ValueError."""
    for name in _ROWS:
        values = _checked(name, rows.get(name))
        try:
            sql.executemany(_INTO[name], values)
        except sqlite3.Error as error:
            raise ValueError(f"{name}: {error}") from error


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
