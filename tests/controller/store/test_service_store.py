"""The service's store: what was kept is there after a kill, and no damage changes it without a word."""

from __future__ import annotations

import contextlib
import errno
import os
import random
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from support.faults.harm import PARTS, harmed, times
from support.machines.stored_tools import StoredTools
from support.suite.seed import SEED

from controller import own_database, own_files
from controller.machine.toml_table import ConfigError
from controller.store.service_store import COPY, FILE, ServiceStore

NONE = object()


def value(store: ServiceStore, name: str = "usage") -> Any:
    return store.document(name, lambda found: found, NONE)


def lost(folder: Path) -> tuple[Any, list[str]]:
    """What a start finds of the document, and the keys of what it reports."""
    with contextlib.closing(ServiceStore(folder)) as store:
        return value(store), [loss["key"] for loss in store.losses]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With two generations of a document and an alarm, closed; a copy of the first beside it."""
    for number in (1, 2):
        with contextlib.closing(ServiceStore(tmp_path)) as store:
            assert store.losses == []
            store.put("usage", {"n": number})
            if number == 1:
                with store.write() as sql:
                    sql.execute('INSERT INTO alarms VALUES (7, \'{"name": "ESTOP"}\')')
                assert store.check() == []
    return tmp_path


def test_the_newest_is_there_and_one_before(folder: Path) -> None:
    assert lost(folder) == ({"n": 2}, [])
    with contextlib.closing(ServiceStore(folder)) as store:
        store.put("usage", {"n": 3})
        rows = store.rows("SELECT generation, value FROM documents ORDER BY generation")
        assert rows == [(3, '{"n": 2}'), (4, '{"n": 3}')]
        assert value(store, "other") is NONE and not store.has("other") and store.has("usage")


def test_a_kill_loses_nothing_that_was_kept(tmp_path: Path) -> None:
    if (child := os.fork()) == 0:
        try:
            store = ServiceStore(tmp_path)
            for number in range(20):
                store.put("usage", {"n": number})
        finally:  # or the tests after this one would go on in the child, too
            os._exit(9)
    os.waitpid(child, 0)
    assert lost(tmp_path) == ({"n": 19}, [])


def test_what_fails_in_a_transaction_leaves_all_as_it_was(folder: Path) -> None:
    with contextlib.closing(ServiceStore(folder)) as store:
        with pytest.raises(KeyError), store.write() as sql:
            sql.execute("DELETE FROM documents")
            raise KeyError
        with pytest.raises(OSError), store.write() as sql:
            sql.execute("DELETE FROM documents")
            sql.execute("INSERT INTO alarms VALUES (7, '')")
        assert value(store) == {"n": 2} and store.check() == []


def changed(folder: Path, statement: str) -> None:
    """By somebody who keeps no sums, as a bad bit."""
    with contextlib.closing(sqlite3.connect(folder / FILE)) as sql:
        sql.execute(statement)
        sql.commit()


@pytest.mark.parametrize(
    ("statement", "found"),
    [
        ("UPDATE documents SET value = '{\"n\": 5}' WHERE generation = 3", {"n": 1}),
        ("DELETE FROM documents WHERE generation = 3", {"n": 1}),
        ("UPDATE documents SET value = '{\"n\": 5}'", NONE),
        ("UPDATE alarms SET facts = '{}'", {"n": 2}),
        ("UPDATE starts SET count = 0", {"n": 2}),
        ("DELETE FROM starts", {"n": 2}),
    ],
)
def test_rows_that_are_not_as_they_were_written_are_taken_out_and_reported_once(
    folder: Path, statement: str, found: Any
) -> None:
    changed(folder, statement)
    assert lost(folder) == (found, ["store_damaged"]) and lost(folder) == (found, [])
    with contextlib.closing(sqlite3.connect(folder / f"{FILE}.damaged1")) as sql:
        assert sql.execute("SELECT count(*) FROM sums").fetchone()[0] > 3, "a copy of the whole is put aside"


def test_what_is_damaged_while_it_runs_is_found_by_a_look(folder: Path) -> None:
    with contextlib.closing(ServiceStore(folder)) as store:
        assert store.check() == []
        changed(folder, "UPDATE documents SET value = '{\"n\": 5}' WHERE generation = 3")
        (loss,) = store.check()
        assert loss["key"] == "store_damaged" and value(store) == {"n": 1} and store.check() == []


def test_after_any_loss_somebody_must_look_where_the_tools_are(folder: Path) -> None:
    """Also where a look found it, and the machine was switched off before anybody did."""
    statement = "UPDATE place SET pocket = 2 WHERE tool = 1"
    for at_a_start in (True, False):
        with contextlib.closing(StoredTools(folder)) as tools:
            tools.confirm({1: 1, 2: 0})
            if not at_a_start:
                changed(folder, statement)
                assert tools.kept.check()
        if at_a_start:
            changed(folder, statement)
            assert lost(folder)[1] == ["store_damaged"]
        with contextlib.closing(StoredTools(folder)) as tools:
            assert not tools.known and tools.spindle is None and not tools.kept.losses


def test_a_file_that_is_none_or_gone_or_older_than_its_copy_is_replaced_by_that(folder: Path) -> None:
    """Reported with when that was; what was beside it is not taken into the copy."""
    for damage in (b"\xff" * 5000, None, (folder / FILE).read_bytes()):
        lost(folder)
        lost(folder)
        if damage is None:
            (folder / FILE).unlink()
        else:
            (folder / FILE).write_bytes(damage)
        found = "file_gone_before" if damage is None else "file_before"
        assert lost(folder) == ({"n": 2}, [found]) and lost(folder) == ({"n": 2}, [])
    assert len(list(folder.glob(f"{FILE}.damaged*"))) == 2


def test_where_the_copy_is_damaged_too_all_is_begun_anew(folder: Path) -> None:
    (folder / FILE).write_bytes(b"\xff" * 5000)
    (folder / COPY).write_bytes(b"\xff" * 5000)
    assert lost(folder) == (NONE, ["file_before", "file_damaged"])


def test_a_copy_with_a_name_that_is_no_text_is_none(folder: Path) -> None:
    data = (folder / COPY).read_bytes()
    assert b"CREATE TABLE starts" in data
    (folder / COPY).write_bytes(data.replace(b"CREATE TABLE starts", b"CREATE T\xd5BLE starts"))
    assert lost(folder) == ({"n": 2}, [])


def test_a_file_of_a_newer_version_is_refused_and_left_as_it_is(folder: Path) -> None:
    changed(folder, "PRAGMA user_version = 99")
    data = (folder / FILE).read_bytes()
    with pytest.raises(ConfigError, match="99"):
        ServiceStore(folder)
    assert (folder / FILE).read_bytes() == data


@pytest.mark.parametrize("code", [sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE, sqlite3.SQLITE_CANTOPEN])
def test_a_disk_that_takes_nothing_is_no_damage_of_the_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    """A full one is given the reserve."""
    real, times = own_database.opened, []

    def refused(*given: Any) -> sqlite3.Connection:
        times.append(given)
        if len(times) == 1 or code == sqlite3.SQLITE_CANTOPEN:
            error = sqlite3.OperationalError("of the disk")
            error.sqlite_errorcode = code
            raise error
        return real(*given)

    monkeypatch.setattr(own_database, "opened", refused)
    if code == sqlite3.SQLITE_CANTOPEN:
        with pytest.raises(OSError) as raised:
            ServiceStore(folder)
        assert raised.value.errno == errno.EACCES
    else:
        assert lost(folder) == ({"n": 2}, [])
    monkeypatch.undo()
    assert lost(folder) == ({"n": 2}, []) and not list(folder.glob("*.damaged*"))


def harm(folder: Path, count: int, part: int = 0) -> int:
    """How often damage of the file was noticed; what is not noticed is as it was."""
    rng, noticed = random.Random(f"{SEED}-service-{part}"), 0
    whole = (folder / FILE).read_bytes()
    copy = (folder / COPY).read_bytes()
    for _ in range(count):
        for path in folder.iterdir():
            path.unlink()
        (folder / FILE).write_bytes(harmed(whole, rng))
        (folder / COPY).write_bytes(copy)
        with contextlib.suppress(ConfigError), contextlib.closing(ServiceStore(folder)) as store:
            found = value(store), store.rows("SELECT * FROM alarms")
            assert store.losses or found == ({"n": 2}, [(7, '{"name": "ESTOP"}')]), SEED
            noticed += bool(store.losses)
    return noticed


def test_no_bit_changes_what_is_read_without_a_word(folder: Path) -> None:
    assert harm(folder, 40) > 10


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_no_bit_of_thousands_changes_what_is_read_without_a_word(folder: Path, part: int) -> None:
    assert harm(folder, times(40), part) > times(8)


def test_a_bad_bit_in_what_is_written_ahead_is_reported(tmp_path: Path) -> None:
    with contextlib.closing(ServiceStore(tmp_path)) as store:
        for number in range(3):
            store.put("usage", {"n": number})
        killed = Path(shutil.copytree(tmp_path, tmp_path.with_name("killed")))
    data = bytearray((killed / f"{FILE}-wal").read_bytes())
    data[-100] ^= 1
    (killed / f"{FILE}-wal").write_bytes(data)
    (killed / f"{FILE}-shm").unlink()
    assert lost(killed) == ({"n": 1}, ["store_damaged"])
    assert own_files.names(killed).count(f"{FILE}-wal.damaged1") == 1


def test_nobody_else_is_needed_to_read_it(folder: Path) -> None:
    newest = "SELECT value FROM documents ORDER BY generation DESC"
    with contextlib.closing(ServiceStore(folder)) as store, own_database.reading(folder / FILE) as sql:
        assert sql.execute(newest).fetchone() == ('{"n": 2}',)
        store.put("usage", {"n": 3})
        assert sql.execute(newest).fetchone() == ('{"n": 2}',), "all that is read is of one moment"


@pytest.mark.parametrize("how", [os.unlink, lambda file: os.truncate(file, 0)])
def test_a_store_that_is_gone_with_its_copy_is_not_taken_for_a_new_machines(folder: Path, how: Any) -> None:
    for file in [folder / name for name in own_files.names(folder) if name.startswith(FILE)]:
        how(file)
    found, keys = lost(folder)
    assert found is NONE and keys[-1] in ("file_gone", "file_damaged")
    assert lost(folder) == (NONE, []), "it is said once"


def test_nobody_but_the_owners_group_reads_the_store_or_a_copy_of_it(folder: Path) -> None:
    changed(folder, "UPDATE alarms SET facts = '{}'")
    assert lost(folder)[1]
    modes = {file.name: file.stat().st_mode & 0o777 for file in folder.glob(f"{FILE}*")}
    assert set(modes) >= {FILE, COPY, f"{FILE}.damaged1"} and set(modes.values()) == {0o640}, modes
