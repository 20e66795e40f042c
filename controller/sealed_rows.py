"""Rows of a SQLite file that carry a checksum each, kept in a table beside theirs.

    sealed_rows.seal(sql)              # of every connection that writes: from then on sums follow its rows
    sealed_rows.damaged(sql)           # [("users", 3)]: rows that are not as they were written, or are gone
    sealed_rows.accept(sql)            # what is there now is what counts

SQLite's own check (``broken``) sees a tree or an index that does not hold together, no other digit in a row.
Triggers of the connection itself keep the sums, in the transaction of the rows. A file of a version without
sums is taken as it is, once: ``seal`` sums what is there where the table of sums is not.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from controller import atomic_file, own_database, own_files

TABLE = "sums"
LENGTH = 16  # digits of a sum
MAX_WORDS = 3  # of SQLite about a broken file
SCHEMA = -1  # instead of a row's number: of how the table was made
Row = tuple[str, int]  # name of its table, and its number there


def seal(sql: sqlite3.Connection, anew: bool = False) -> None:
    """Keeps a sum of every row that this connection writes; in no transaction. ``anew``: of all that is
    there, too, for the tables have other columns now. Raises sqlite3.Error, also for a damaged schema.
    """
    sql.create_function("row_sum", -1, _sum, deterministic=True)
    sql.execute("PRAGMA recursive_triggers = ON")  # so that a row that is replaced counts as deleted first
    schemas = _schemas(sql)
    if anew or TABLE not in schemas or not _is_as_written(sql, schemas):
        sql.execute("BEGIN IMMEDIATE")
        try:
            if anew or TABLE not in _schemas(sql):  # another process may have been quicker
                columns = "name TEXT, row INTEGER, sum BLOB, PRIMARY KEY (name, row)"
                sql.execute(f"CREATE TABLE IF NOT EXISTS {TABLE} ({columns})")
                accept(sql)
            _sum_new(sql)
        except BaseException:
            sql.execute("ROLLBACK")
            raise
        sql.execute("COMMIT")
    for name in _tables(sql):
        _follow(sql, name)


def _is_as_written(sql: sqlite3.Connection, schemas: dict[str, bytes]) -> bool:
    """Whether all tables have the columns that they were made with; False: some are new. Raises
    sqlite3.DatabaseError.
    """
    kept = dict(sql.execute(f"SELECT name, sum FROM {TABLE} WHERE row = {SCHEMA}").fetchall())
    for name in _tables(sql):
        if kept.get(name, schemas[name]) != schemas[name]:
            raise sqlite3.DatabaseError(f"the schema of its table {name} is damaged")
    return kept.keys() >= set(_tables(sql))


def _sum_new(sql: sqlite3.Connection) -> None:
    rows = [(name, SCHEMA, found) for name, found in _schemas(sql).items() if name != TABLE]
    sql.executemany(f"INSERT OR IGNORE INTO {TABLE} VALUES (?, ?, ?)", rows)


def _follow(sql: sqlite3.Connection, name: str) -> None:
    forget = f"DELETE FROM {TABLE} WHERE name = '{name}' AND row = old.rowid;"
    take = f"INSERT OR REPLACE INTO {TABLE} {_summed(sql, name)} WHERE rowid = new.rowid;"
    for event, steps in (("INSERT", take), ("DELETE", forget), ("UPDATE", forget + take)):
        sql.execute(f"DROP TRIGGER IF EXISTS temp.{name}_{event}")
        sql.execute(f"CREATE TEMP TRIGGER {name}_{event} AFTER {event} ON main.{name} BEGIN {steps} END")


def damaged(sql: sqlite3.Connection, table: str = "") -> list[Row]:
    """Rows, of one ``table`` or all, whose sum is of other values, that have none, or that are gone; in the
    caller's transaction, so that all is of one moment. Raises sqlite3.Error.
    """
    sql.create_function("row_sum", -1, _sum, deterministic=True)
    found: list[Row] = []
    sums = (
        f"SELECT row, CAST(sum AS BLOB) FROM {TABLE} WHERE name = ? AND typeof(row) = 'integer' AND row >= 0"
    )
    for name in (table,) if table else _tables(sql):
        kept = {row: found_sum for row, found_sum in sql.execute(sums, (name,))}
        there = {row: found_sum for _, row, found_sum in sql.execute(_summed(sql, name))}
        found += [(name, row) for row in sorted({*kept, *there}) if kept.get(row) != there.get(row)]
    return found


def look(sql: sqlite3.Connection) -> str | None:
    """What is wrong, as ``summary``, "" where nothing is; None: it is of a version without sums. It changes
    nothing. Raises sqlite3.Error.
    """
    begun = not sql.in_transaction  # so that all is of one moment
    if begun:
        sql.execute("BEGIN")
    try:
        schemas, words = _schemas(sql), broken(sql)
        if TABLE not in schemas:
            return summary((), words) or None
        _is_as_written(sql, schemas)
        return summary(damaged(sql), words)
    finally:
        if begun:
            sql.execute("ROLLBACK")


def broken(sql: sqlite3.Connection) -> list[str]:
    """What SQLite itself finds wrong, in its own words, a few at most. Raises sqlite3.Error.

    ``PRAGMA integrity_check``: the quick one does not hold indexes against their tables, and who asks by an
    index would be given another row.
    """
    return [str(row[0]) for row in sql.execute(f"PRAGMA integrity_check({MAX_WORDS})") if row[0] != "ok"]


def index_anew(sql: sqlite3.Connection) -> None:
    """Makes the indexes of what is there, in the caller's transaction. Raises sqlite3.Error."""
    try:
        sql.execute("REINDEX")
    except sqlite3.IntegrityError as error:  # two rows have one name now: no rule of ours was broken
        raise sqlite3.DatabaseError(str(error)) from error


def mend(sql: sqlite3.Connection, file: Path) -> tuple[list[Row], str, Path] | None:
    """Takes out what is not as it was written, in the caller's transaction: which rows, in words, and where a
    copy of the whole lies; None: all is well. Raises sqlite3.Error, OSError.
    """
    words = broken(sql)
    rows = [] if words else damaged(sql)
    if not words and not rows:
        return None
    aside = own_files.aside(file)
    atomic_file.write(aside, sql.serialize(), mode=own_database.MODE)
    if words:
        index_anew(sql)
        rows = damaged(sql)
    take_out(sql, rows)
    return rows, summary(rows, words), aside


def take_out(sql: sqlite3.Connection, rows: Iterable[Row]) -> None:
    """Deletes damaged rows, in the caller's transaction. Raises sqlite3.Error."""
    known = _tables(sql)
    for name, row in rows:
        if name in known:
            sql.execute(f"DELETE FROM {name} WHERE rowid = ?", (row,))
        sql.execute(f"DELETE FROM {TABLE} WHERE name = ? AND row IS ?", (name, row))


def summary(rows: Iterable[Row], words: Iterable[str]) -> str:
    """How many rows of which tables, and what SQLite says, for people: ``users 2, runs 1``."""
    counts = Counter(name for name, _ in rows)
    return ", ".join([*(f"{name} {count}" for name, count in sorted(counts.items())), *words])


def accept(sql: sqlite3.Connection) -> None:
    """Sums all rows anew, in the caller's transaction. Raises sqlite3.Error."""
    sql.execute(f"DELETE FROM {TABLE}")
    for name in _tables(sql):
        sql.execute(f"INSERT INTO {TABLE} {_summed(sql, name)}")
    _sum_new(sql)


def sound(sql: sqlite3.Connection, name: str) -> str:
    """The condition that a row of a SELECT from this table is as it was written. Raises sqlite3.Error."""
    sql.create_function("row_sum", -1, _sum, deterministic=True)
    written = f"SELECT CAST(sum AS BLOB) FROM {TABLE} WHERE name = '{name}' AND row = main.{name}.rowid"
    return f"{_row_sum(sql, name)} IS ({written})"


def _summed(sql: sqlite3.Connection, name: str) -> str:
    """A SELECT of a table's name, and of its rows' numbers and sums."""
    return f"SELECT '{name}', rowid, {_row_sum(sql, name)} FROM main.{name}"


def _row_sum(sql: sqlite3.Connection, name: str) -> str:
    """The sum of a row of a table, as an expression."""
    names = [row[1] for row in sql.execute(f"PRAGMA main.table_info({name})")]
    # Text as its bytes: what is damaged may be no UTF-8.
    columns = [f"CASE typeof({one}) WHEN 'text' THEN CAST({one} AS BLOB) ELSE {one} END" for one in names]
    return f"row_sum('{name}', rowid, {', '.join(columns)})"


def _schemas(sql: sqlite3.Connection) -> dict[str, bytes]:
    """By name of a table the sum of how it was made."""
    rows = sql.execute("SELECT name, sql FROM main.sqlite_master WHERE type = 'table'").fetchall()
    return {name: _sum(made) for name, made in rows}


def _tables(sql: sqlite3.Connection) -> list[str]:
    """Names that are plain words, as all of ours are."""
    rows = sql.execute("SELECT name FROM main.sqlite_master WHERE type = 'table' ORDER BY name").fetchall()
    return [
        row[0] for row in rows if str(row[0]).isidentifier() and row[0] != TABLE and "sqlite_" not in row[0]
    ]


def _sum(*values: object) -> bytes:
    return hashlib.sha256(repr(values).encode()).hexdigest()[:LENGTH].encode()
