"""Programs of the store: names that point at contents, contents as files, and what their checks said.

A file is made (renamed into place) and removed only while the database's write lock is held:
whoever holds it sees rows and files in step. A process that dies in between leaves a file
without a row at worst, which ``sweep`` removes; never a row without its file.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sqlite3
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from controller import atomic_file, own_files
from controller.api import names, own_folder
from controller.api.database import Database, StoreError
from controller.api.records import Clock, Facts
from controller.messages import Key, message
from controller.program import linked

CHUNK = 1 << 20
FOLDER, INCOMING, CONTENT = own_folder.PROGRAMS, ".incoming", ".ngc"
RECOVERED = "recovered"  # folder of contents whose names were lost


@dataclass(frozen=True, slots=True)
class Program:
    """A name in the store and the content it points at."""

    name: str
    sha256: str
    size: int  # bytes
    lines: int
    uploaded_s: float
    uploaded_by: str


@dataclass(frozen=True, slots=True)
class ProgramCheck:
    """What is known about a content on one machine with its tools and offsets."""

    sha256: str
    machine: str  # hash, see ``checker``
    state: str  # 'waiting', 'running', 'passed', 'refused' (the program is wrong), 'failed' (the check is)
    progress: float  # 0 to 1
    result: Facts  # passed: figures of ``check --json`` without blocks; else sentence, line, column
    changed_s: float


class Programs:
    """Names and contents. ``in_use`` are names and sha256 of what is loaded or running."""

    def __init__(self, database: Database, folder: Path, clock: Clock = time.time) -> None:
        self._database, self.folder, self._clock = database, folder, clock
        self.incoming = folder / INCOMING
        try:
            own_files.make_folder(self.incoming, folder.parent)
        except OSError as error:
            raise StoreError("store", message("store.no_folder", folder=folder, why=error)) from error

    def now_s(self) -> float:
        return self._clock()

    def list(self) -> list[Program]:
        """All programs by name."""
        return [Program(*row) for row in self._database.rows("SELECT * FROM programs ORDER BY name")]

    def get(self, name: str) -> Program:
        """Raises StoreError "missing"."""
        for row in self._database.rows("SELECT * FROM programs WHERE name = ?", (name,)):
            return Program(*row)
        raise _missing(name)

    def unchecked(self) -> Sequence[Program]:
        """Programs whose content was never checked, or whose check has no end yet."""
        rows = self._database.rows(
            "SELECT * FROM programs WHERE sha256 NOT IN (SELECT sha256 FROM checks) OR sha256 IN "
            "(SELECT sha256 FROM checks WHERE state IN ('waiting', 'running')) ORDER BY uploaded_s"
        )
        return [Program(*row) for row in rows]

    def path(self, sha256: str) -> Path:
        """Where a content is."""
        return self.folder / f"{sha256}{CONTENT}"

    def content(self, sha256: str) -> BinaryIO:
        """A content, opened. Raises OSError, and StoreError where it is not as it was uploaded."""
        found = own_files.opened(self.path(sha256), os.O_RDONLY, self.folder.parent, shared=True)
        try:
            summed = hashlib.sha256()
            while data := found.read(CHUNK):
                summed.update(data)
            if summed.hexdigest() != sha256:
                raise StoreError.of("store", "program_damaged", file=self.path(sha256))
            found.seek(0)
            return found
        except BaseException:
            found.close()
            raise

    def read(self, sha256: str) -> bytes:
        """A content, whole. Raises as ``content``."""
        with self.content(sha256) as found:
            return found.read()

    def sound_path(self, sha256: str) -> str:
        """Where a content is that was just found as it was uploaded. Raises as ``content``."""
        self.content(sha256).close()
        return str(self.path(sha256))

    def called(self, program: Program) -> dict[str, str]:
        """Names and paths of the programs whose subs a program calls. Raises StoreError where one of them is
        not as it was uploaded.
        """
        try:
            return self.called_by(program.name, self.read(program.sha256))
        except OSError:  # whoever reads it next says so
            return {}

    def text_of(self, program: Program, file: str) -> Path:
        """Where the text of a program is, or of one whose subs it calls. Raises StoreError: missing."""
        if file in ("", program.name):
            return self.path(program.sha256)
        called = self.called(program)
        if file not in called:
            raise _missing(file)
        return Path(called[file])

    def called_by(self, name: str, text: bytes) -> dict[str, str]:
        """The same of a text that would have that name, shipped cycles among them. Raises OSError."""
        sums = {one.name: one.sha256 for one in self.list() if one.name != name}
        there = {one: self.path(sha256) for one, sha256 in sums.items()}
        beside, top = (_in(folder, there) for folder in (names.folder_of(name), ""))
        _, files = linked.parts(linked.linked(text, lambda label: beside(label) or top(label)))
        called = [one for one, _ in files.values()]
        return {
            one: self.sound_path(sums[one]) if one in sums else str(linked.SHIPPED / one) for one in called
        }

    def opened(self, name: str) -> tuple[Program, BinaryIO]:
        """A program and its content, which stays readable though the program is replaced meanwhile.

        Raises StoreError: missing, store.
        """
        with self._database.write() as sql:
            program = self._needed(sql, name)
            try:
                return program, self.content(program.sha256)
            except OSError as error:
                raise StoreError.of("store", "store_unread", file=name, why=error) from error

    def keep(self, new: Path, program: Program, in_use: Collection[str] = ()) -> Program:
        """Take a complete, synced file of the incoming folder over as ``program``, whole or not at all.

        Replaces what the name pointed at. Raises StoreError: running.
        """
        with self._database.write() as sql:
            old = _named(sql, program.name)
            if old:
                _free(old, in_use)
            own_files.rename(new, self.path(program.sha256), self.folder.parent)
            atomic_file.sync(self.folder, self.folder.parent)
            self.enter(program, sql)
        if old:
            self._forget(old.sha256)
        return program

    def enter(self, program: Program, sql: sqlite3.Connection) -> None:
        """Have a name point at a content that is in its place, within the caller's transaction."""
        sql.execute("REPLACE INTO programs VALUES (?, ?, ?, ?, ?, ?)", _values(program))

    def rename(self, name: str, to: str, in_use: Collection[str] = ()) -> Program:
        """Raises StoreError: missing, name, exists, running."""
        to = names.check(to)
        with self._database.write() as sql:
            old = self._needed(sql, name)
            _free(old, in_use)
            if to != name and _named(sql, to):
                raise StoreError.of("exists", "exists", what=Key("what.program"), name=to)
            _rename(sql, {name: to})
        return self.get(to)

    def move(self, folder: str, to: str, in_use: Collection[str] = ()) -> dict[str, str]:
        """Give a folder another name, all of it or nothing; old names -> new ones.

        Raises StoreError: missing, name, exists, running.
        """
        to = names.check(to)
        with self._database.write() as sql:
            there = {row[0] for row in sql.execute("SELECT name FROM programs")}
            moved = {name: names.check(to + name[len(folder) :]) for name in there if _within(folder, name)}
            if not moved:
                raise StoreError.of("missing", "missing", what=Key("what.folder"), name=names.shown(folder))
            for name in moved:
                _free(self._needed(sql, name), in_use)
            if taken := sorted(set(moved.values()) & (there - set(moved))):
                raise StoreError.of("exists", "exists", what=Key("what.program"), name=taken[0])
            _rename(sql, moved)
        return moved

    def delete(self, name: str, in_use: Collection[str] = ()) -> None:
        """Raises StoreError: missing, running."""
        with self._database.write() as sql:
            old = self._needed(sql, name)
            _free(old, in_use)
            sql.execute("DELETE FROM programs WHERE name = ?", (name,))
        self._forget(old.sha256)

    def recover(self) -> None:
        """Gives a name to contents that have none, after the store has lost some. Raises StoreError."""
        named = {program.sha256 for program in self.list()}
        for sha256 in (name[: -len(CONTENT)] for name in self._there()):
            if sha256 in named:
                continue
            try:
                text = self.read(sha256)
            except (OSError, StoreError):
                continue
            lines = text.count(b"\n") + (text[-1:] != b"\n")
            name = f"{RECOVERED}/{sha256[:12]}{CONTENT}"
            with self._database.write() as sql:
                self.enter(Program(name, sha256, len(text), lines, self.now_s(), RECOVERED), sql)

    def _there(self) -> Sequence[str]:
        """Names of the files of contents."""
        there = own_files.names(self.folder, self.folder.parent)
        return [name for name in there if name.endswith(CONTENT)]

    def sweep(self) -> int:
        """Remove contents that no name points at; how many."""
        return sum(self._forget(name[: -len(CONTENT)]) for name in self._there())

    def _needed(self, sql: sqlite3.Connection, name: str) -> Program:
        if (found := _named(sql, name)) is None:
            raise _missing(name)
        return found

    def _forget(self, sha256: str) -> bool:
        """Remove a content unless some name points at it: asked again, under the lock."""
        with self._database.write() as sql:
            if sql.execute("SELECT 1 FROM programs WHERE sha256 = ?", (sha256,)).fetchone():
                return False
            sql.execute("DELETE FROM checks WHERE sha256 = ?", (sha256,))
            with contextlib.suppress(OSError):  # then the next sweep
                own_files.remove(self.path(sha256), self.folder.parent)
                return True
        return False


class Checks:
    """What checks said of contents."""

    def __init__(self, database: Database, clock: Clock = time.time) -> None:
        self._database, self._clock = database, clock

    def get(self, sha256: str, machine: str) -> ProgramCheck | None:
        """Of a content on a machine; None = never asked for."""
        rows = self._database.rows("SELECT * FROM checks WHERE sha256 = ? AND machine = ?", (sha256, machine))
        return next((_check(row) for row in rows), None)

    def set(
        self, sha256: str, machine: str, state: str, progress: float = 0.0, result: Facts | None = None
    ) -> None:
        """Note a state, if some program still points at that content."""
        with self._database.write() as sql:
            if not sql.execute("SELECT 1 FROM programs WHERE sha256 = ?", (sha256,)).fetchone():
                return
            text = json.dumps(dict(result or {}), allow_nan=False)
            sql.execute(
                "REPLACE INTO checks VALUES (?, ?, ?, ?, ?, ?)",
                (sha256, machine, state, progress, text, self._clock()),
            )

    def interrupted(self) -> list[ProgramCheck]:
        """Checks that were waiting or running when their process ended."""
        rows = self._database.rows("SELECT * FROM checks WHERE state IN ('waiting', 'running')")
        return [_check(row) for row in rows]


def _within(folder: str, name: str) -> bool:
    return name.startswith(f"{folder}/")


def _in(folder: str, there: Mapping[str, Path]) -> linked.Find:
    """Finds files of subs in a folder, not in those within it."""
    return linked.among({name: path for name, path in there.items() if names.folder_of(name) == folder})


def _rename(sql: sqlite3.Connection, moved: Mapping[str, str]) -> None:
    """Programs, and what of the queue names them; by way of names that none has, for one may be another's."""
    for name, to in (
        *((old, f"/{new}") for old, new in moved.items()),
        *((f"/{to}", to) for to in moved.values()),
    ):
        sql.execute("UPDATE programs SET name = ? WHERE name = ?", (to, name))
        sql.execute("UPDATE queue SET program = ? WHERE program = ?", (to, name))


def _named(sql: sqlite3.Connection, name: str) -> Program | None:
    try:
        row = sql.execute("SELECT * FROM programs WHERE name = ?", (name,)).fetchone()
    except UnicodeEncodeError:
        return None
    return Program(*row) if row else None


def _free(program: Program, in_use: Collection[str]) -> None:
    if program.name in in_use or program.sha256 in in_use:
        raise StoreError.of("running", "in_use", program=program.name)


def _missing(name: str) -> StoreError:
    return StoreError.of("missing", "missing", what=Key("what.program"), name=names.shown(name))


def _values(program: Program) -> tuple[Any, ...]:
    return (
        program.name,
        program.sha256,
        program.size,
        program.lines,
        program.uploaded_s,
        program.uploaded_by,
    )


def _check(row: sqlite3.Row) -> ProgramCheck:
    values = dict(row)
    return ProgramCheck(**{**values, "result": json.loads(values["result"])})
