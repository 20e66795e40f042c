"""Rows of SQLite files: no bit that turns over gives another value without a word."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes.written_history import WrittenHistory
from support.faults.harm import PARTS, harmed, times
from support.machines.stored_tools import StoredTools
from support.suite.seed import SEED

from controller import own_database, sealed_rows
from controller.api.database import StoreError
from controller.api.store import Store
from controller.machine.toml_table import ConfigError
from controller.messages import message
from controller.store import history, service_store
from controller.store.tool_store import Step

STORE, TOOLS = "panel/store.sqlite", service_store.FILE


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both files of a shop, with rows in them, closed."""
    folder = tmp_path_factory.mktemp("kept")
    store = Store(folder)
    with store.uploads.begin("a.ngc") as upload:
        upload.write(b"(a)\nM2\n")
        upload.commit()
    for name, role in (("anna", "set_up"), ("bert", "view")):
        store.users.set(name, f"hash of {name}", role)
    store.settings.set("upload_mb", 8, "anna")
    store.verdicts.set("record1", {"gouges": 0}, "verdicts")
    store.queue.add("a.ngc", 3, "anna")
    store.close()
    tools = StoredTools(folder)
    tools.confirm({1: 1, 2: 0, 3: 3})
    tools.begin(Step(2, 3, 1, "to the pocket", 2, 2))
    tools.end()
    tools.close()
    written = WrittenHistory(folder)
    for result in ("completed", "stopped"):
        written.run("a.ngc", result, ticks=7)
    written.alarm("TEST", message("stopped"), axis="X")
    written.store.close()
    for name in (STORE, TOOLS):
        with contextlib.closing(own_database.opened(folder / name)) as sql:
            sql.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return folder


@pytest.fixture
def folder(kept: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(kept, tmp_path / "state"))


def of_store(store: Store) -> dict[str, Any]:
    return {
        "programs": store.programs.list(),
        "users": store.users.all(),
        "settings": store.settings.all(),
        "verdicts": store.verdicts.all(),
        "queue": store.queue.all(),
    }


def of_tools(tools: StoredTools) -> Any:
    with history.reading(tools.kept.file.parent) as past:
        return tools.spindle, dict(tools.places), tools.step, tools.log(), past.runs(), past.alarms()


def harms(file: Path, count: int, rng: random.Random) -> Iterator[bytes]:
    whole = file.read_bytes()
    yield whole
    for _ in range(count):
        yield harmed(whole, rng)


def harm_tools(folder: Path, count: int, part: int = 0) -> int:
    """How many were noticed."""
    rng, file = random.Random(f"{SEED}-tools-{part}"), folder / TOOLS
    known, noticed = None, 0
    for data in harms(file, count, rng):
        for end in own_database.BESIDE:
            (folder / f"{TOOLS}{end}").unlink(missing_ok=True)
        file.write_bytes(data)
        try:
            tools = StoredTools(folder)
        except (ConfigError, OSError):
            noticed += 1
            continue
        try:
            found = None if tools.kept.losses else of_tools(tools)
        except (OSError, sqlite3.Error):
            found = None
        finally:
            tools.close()
        known = known or found
        noticed += found is None
        assert found in (None, known), SEED
    return noticed


def harm_store(folder: Path, count: int, part: int = 0) -> int:
    """How many were noticed."""
    rng, file = random.Random(f"{SEED}-store-{part}"), folder / STORE
    known, noticed = None, 0
    for data in harms(file, count, rng):
        for end in own_database.BESIDE:
            (folder / f"{STORE}{end}").unlink(missing_ok=True)
        file.write_bytes(data)
        found = None
        with contextlib.suppress(StoreError), contextlib.closing(Store(folder)) as store:
            store.sweep()
            if not store.losses:
                found = of_store(store)
        known = known or found
        noticed += found is None
        other = [] if found is None or known is None else [key for key in known if found[key] != known[key]]
        assert not other, (SEED, other, found, known)
    return noticed


def test_no_bit_of_the_tools_places_changes_one_without_a_word(folder: Path) -> None:
    assert harm_tools(folder, 60) > 10


def test_no_bit_of_the_store_changes_what_is_answered_without_a_word(folder: Path) -> None:
    assert harm_store(folder, 25) > 8


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_no_bit_of_thousands_changes_anything(folder: Path, part: int) -> None:
    assert harm_tools(folder, times(100), part) > times(10)
    assert harm_store(folder, times(50), part) > times(10)


def changed(file: Path, *statements: str) -> None:
    """By somebody who keeps no sums, as a bad bit."""
    with contextlib.closing(sqlite3.connect(file)) as sql:
        for statement in statements:
            sql.execute(statement)
        sql.commit()


def test_another_tool_in_the_spindle_must_be_confirmed_and_a_copy_is_put_aside(folder: Path) -> None:
    changed(folder / TOOLS, "UPDATE place SET pocket = 0 WHERE tool = 1")
    tools = StoredTools(folder)
    (loss,) = tools.kept.losses
    assert tools.spindle is None and not tools.known
    assert loss["values"]["what"] == "place 1" and (folder / f"{TOOLS}.damaged1").exists()
    tools.close()
    tools = StoredTools(folder)
    assert not tools.kept.losses and not tools.known, "as long as nobody has looked"
    tools.confirm({1: 1, 2: 0, 3: 3})
    tools.close()
    tools = StoredTools(folder)
    assert not tools.kept.losses and tools.spindle == 2
    tools.close()


@pytest.mark.parametrize(
    "statement",
    ["UPDATE users SET role = 'set_up' WHERE name = 'bert'", "DELETE FROM users WHERE name = 'bert'"],
)
def test_a_user_who_is_another_than_was_written_is_taken_out_and_reported(
    folder: Path, statement: str
) -> None:
    changed(folder / STORE, statement)
    with contextlib.closing(Store(folder)) as store:
        store.sweep()
        assert [user.name for user in store.users.all()] == ["anna"]
        (lost,) = store.losses
        assert lost["key"] == "store_rows" and lost["values"]["tables"] == "users 1"
        assert store.users.lost is not None
        store.sweep()
        assert len(store.losses) == 1
    with contextlib.closing(sqlite3.connect(folder / f"{STORE}.damaged1")) as sql:
        assert sql.execute("SELECT count(*) FROM users WHERE name = 'anna'").fetchone() == (1,)


@pytest.mark.parametrize("how", [os.unlink, lambda file: os.truncate(file, 0)])
def test_a_store_in_which_nothing_is_any_more_is_reported_and_the_programs_are_there(
    folder: Path, how: Any
) -> None:
    how(folder / STORE)
    for _ in range(2):
        with contextlib.closing(Store(folder)) as store:
            store.sweep()
            assert [loss["key"] for loss in store.losses] == ["store_gone"]
            assert [one.name.split("/")[0] for one in store.programs.list()] == ["recovered"]


def test_sums_follow_every_way_of_writing_a_row(tmp_path: Path) -> None:
    with contextlib.closing(own_database.opened(tmp_path / "a.db")) as sql:
        sql.execute("CREATE TABLE t (name TEXT PRIMARY KEY, x REAL, y)")
        sql.execute("INSERT INTO t VALUES ('before', 1, 2)")
        sealed_rows.seal(sql)
        for statement in (
            "INSERT INTO t VALUES ('a', 1, X'00ff'), ('b', 0.1, NULL), ('c', 9007199254740993, 'x')",
            "INSERT OR REPLACE INTO t VALUES ('a', 2, 3)",
            "INSERT INTO t VALUES ('b', 5, 6) ON CONFLICT (name) DO UPDATE SET x = excluded.x",
            "UPDATE t SET name = name || 'z', rowid = rowid + 100",
            "DELETE FROM t WHERE name = 'cz'",
            "DELETE FROM t",
            "INSERT INTO t VALUES ('d', 1e300, -0.0)",
        ):
            sql.execute(statement)
            assert sealed_rows.damaged(sql) == [], statement
        with contextlib.closing(sqlite3.connect(tmp_path / "a.db", isolation_level=None)) as other:
            other.execute("UPDATE t SET y = 0.1")
        assert [name for name, _ in sealed_rows.damaged(sql)] == ["t"]


def test_a_store_of_before_there_were_sums_is_taken_once(folder: Path) -> None:
    changed(folder / STORE, "DROP TABLE sums", "UPDATE settings SET value = '7'")
    for damaged in (False, True):
        with contextlib.closing(Store(folder)) as store:
            store.sweep()
            assert store.settings.all() == ({} if damaged else {"upload_mb": 7})
        changed(folder / STORE, "UPDATE settings SET value = '8'")
