"""The store: rows and files in step, whatever is asked and whoever dies."""

from __future__ import annotations

import hashlib
import os
import signal
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from controller.api import database
from controller.api.store import Store, StoreError

TEXT = b"G1 X10 F100\nM2\n"


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "state")


def upload(store: Store, name: str, text: bytes = TEXT, in_use: tuple[str, ...] = ()) -> str:
    with store.uploads.begin(name, by="test") as file:
        file.write(text)
        return file.commit(in_use).sha256


def consistent(store: Store) -> None:
    """Every name has its content, every content its name, and nothing is half."""
    listed = {program.sha256 for program in store.programs.list()}
    files = {file.stem for file in store.programs.folder.glob("*.ngc")}
    assert listed == files
    for sha256 in files:
        assert hashlib.sha256(store.programs.path(sha256).read_bytes()).hexdigest() == sha256
    assert not list(store.programs.incoming.iterdir())


def code(refused: pytest.ExceptionInfo[StoreError]) -> str:
    return refused.value.code


def test_an_upload_becomes_a_program_with_its_facts(store: Store) -> None:
    upload(store, "part.ngc")
    program = store.programs.get("part.ngc")
    assert (program.size, program.lines, program.uploaded_by) == (len(TEXT), 2, "test")
    assert store.programs.path(program.sha256).read_bytes() == TEXT
    consistent(store)


def test_a_program_without_a_last_line_end_has_its_last_line_counted(store: Store) -> None:
    upload(store, "a", b"G0\nM2")
    assert store.programs.get("a").lines == 2


def test_the_same_name_takes_the_new_content_and_drops_the_old(store: Store) -> None:
    old, new = upload(store, "a"), upload(store, "a", b"M2\n")
    assert store.programs.get("a").sha256 == new
    assert not store.programs.path(old).exists()
    consistent(store)


def test_two_names_of_one_content_share_it_until_the_last_goes(store: Store) -> None:
    sha256 = upload(store, "a")
    upload(store, "b")
    store.programs.delete("a")
    assert store.programs.path(sha256).exists()
    store.programs.delete("b")
    consistent(store)


@pytest.mark.parametrize("by", ["name", "content"])
def test_the_running_program_is_neither_replaced_nor_renamed_nor_deleted(store: Store, by: str) -> None:
    sha256 = upload(store, "a")
    in_use = ("a",) if by == "name" else (sha256,)
    with pytest.raises(StoreError) as replaced:
        upload(store, "a", b"M30\n", in_use)
    with pytest.raises(StoreError) as renamed:
        store.programs.rename("a", "b", in_use)
    with pytest.raises(StoreError) as deleted:
        store.programs.delete("a", in_use)
    assert {code(replaced), code(renamed), code(deleted)} == {"running"}
    assert store.programs.get("a").sha256 == sha256
    consistent(store)


def test_renaming_does_not_overwrite(store: Store) -> None:
    upload(store, "a")
    upload(store, "b", b"M2\n")
    with pytest.raises(StoreError) as refused:
        store.programs.rename("a", "b")
    assert code(refused) == "exists"
    assert store.programs.rename("a", "c").name == "c"
    assert [program.name for program in store.programs.list()] == ["b", "c"]


def test_what_is_not_there_is_said_so(store: Store) -> None:
    for ask in (store.programs.get, store.programs.delete, lambda name: store.programs.rename(name, "x")):
        for name in ("no\x00thing", "half \udcff", "../x", ""):
            with pytest.raises(StoreError) as refused:
                ask(name)
            assert code(refused) == "missing"


def test_a_second_process_sees_the_same_store(store: Store, tmp_path: Path) -> None:
    sha256 = upload(store, "a")
    other = Store(tmp_path / "state")
    assert other.programs.get("a").sha256 == sha256
    other.programs.delete("a")
    assert store.programs.list() == []


def test_threads_that_upload_replace_and_delete_the_same_names_leave_no_half(store: Store) -> None:
    def work(seed: int) -> None:
        for turn in range(15):
            name = f"part {(seed + turn) % 3}"
            upload(store, name, b"G4 P%d\n" % ((seed * turn) % 4))
            if (seed + turn) % 4 == 0:
                try:
                    store.programs.delete(name)
                except StoreError as error:
                    assert error.code == "missing"

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    consistent(store)


def test_settings_are_values_by_name(store: Store) -> None:
    store.settings.set("language", "de", "me")
    store.settings.put({"upload_mb": 8, "notices": {"mail": [1, 2]}}, "me")
    assert store.settings.all() == {"language": "de", "notices": {"mail": [1, 2]}, "upload_mb": 8}
    store.settings.remove("language")
    assert store.settings.get("language", "none") == "none"


def test_users_tokens_and_the_audit_log(store: Store) -> None:
    store.users.set("anna", "hash", "operate")
    store.users.add_token("ab" * 32, "script", "view", "anna")
    token = store.users.token("ab" * 32)
    assert token and (token.name, token.role) == ("script", "view")
    with pytest.raises(StoreError) as twice:
        store.users.add_token("cd" * 32, "script", "view", "anna")
    with pytest.raises(StoreError) as role:
        store.users.set("ben", "hash", "root")
    assert (code(twice), code(role)) == ("exists", "form")
    store.audit.most = 3
    for turn in range(5):
        store.audit.add("anna", "127.0.0.1", "home", str(turn), allowed=turn != 4)
    assert [(e.detail, e.allowed) for e in store.audit.list()] == [("4", False), ("3", True), ("2", True)]


def test_a_check_is_of_a_content_on_a_machine_and_goes_with_it(store: Store) -> None:
    sha256 = upload(store, "a")
    store.checks.set(sha256, "m1", "running", 0.5)
    store.checks.set("nobody's", "m1", "running", 0.5)
    assert [c.progress for c in store.checks.interrupted()] == [0.5]
    store.checks.set(sha256, "m1", "passed", 1.0, {"duration_s": 2.0})
    assert store.checks.get(sha256, "m2") is None
    assert store.checks.interrupted() == []
    upload(store, "a", b"M2\n")
    assert store.checks.get(sha256, "m1") is None


def test_a_store_of_a_newer_version_is_refused_and_left_alone(store: Store, tmp_path: Path) -> None:
    store.close()
    with sqlite3.connect(store.database.file) as sql:
        sql.execute("PRAGMA user_version = 99")
    with pytest.raises(StoreError, match="has schema 99"):
        Store(tmp_path / "state")


def test_a_migration_keeps_what_is_there_and_puts_a_copy_beside_it(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sha256 = upload(store, "a")
    store.close()
    step = "ALTER TABLE programs ADD COLUMN note TEXT NOT NULL DEFAULT ''"
    before = database.MIGRATIONS
    monkeypatch.setattr("controller.api.database.MIGRATIONS", (*before, step))
    folder = tmp_path / "state"
    with sqlite3.connect(Store(folder).database.file) as sql:
        assert sql.execute("SELECT sha256, note FROM programs").fetchall() == [(sha256, "")]
    with sqlite3.connect(store.own / f"store.schema{len(before)}.sqlite") as sql:
        assert sql.execute("SELECT sha256 FROM programs").fetchall() == [(sha256,)]


def test_a_migration_that_fails_changes_nothing(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(store, "a")
    store.close()
    step = "CREATE TABLE half (x INTEGER) STRICT;\nALTER TABLE nowhere ADD COLUMN x"
    with monkeypatch.context() as patched, pytest.raises(StoreError):
        patched.setattr("controller.api.database.MIGRATIONS", (*database.MIGRATIONS, step))
        Store(tmp_path / "state")
    again = Store(tmp_path / "state")
    assert [program.name for program in again.programs.list()] == ["a"]
    assert not again.database.rows("SELECT 1 FROM sqlite_master WHERE name = 'half'")


def test_a_database_that_becomes_unreadable_is_a_sentence_and_no_crash(store: Store) -> None:
    for n in range(200):
        store.audit.add("me", "here", "x" * 300, str(n))
    store.close()
    file = store.database.file
    data = bytearray(file.read_bytes())
    data[4096:] = b"\xa5" * (len(data) - 4096)
    file.write_bytes(data)
    with pytest.raises(StoreError, match=r"could not be read|cannot be used"):
        Store(store.folder).audit.list(1000)


def test_a_file_that_is_no_database_is_refused_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "store.sqlite").write_text("not one at all " * 100)
    with pytest.raises(StoreError, match="cannot be used"):
        Store(tmp_path)


KILLED = """
import sys
from pathlib import Path
from controller.api.store import Store
store = Store(Path(sys.argv[1]))
turn = 0
print("ready", flush=True)
while True:
    turn += 1
    with store.uploads.begin(f"part {turn % 3}") as upload:
        for line in range(40):
            upload.write(b"G4 P%d\\n" % (turn + line))
        upload.commit()
    if turn % 5 == 0:
        store.programs.delete(f"part {turn % 3}")
"""


@pytest.mark.parametrize("wait_ms", [1, 13, 53])
def test_a_process_killed_at_any_instant_leaves_a_store_that_sweeping_makes_whole(
    tmp_path: Path, wait_ms: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(tmp_path)],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.getcwd()},
    )
    assert child.stdout
    child.stdout.readline()
    threading.Event().wait(wait_ms / 1e3)
    child.send_signal(signal.SIGKILL)
    child.wait()
    child.stdout.close()
    monkeypatch.setattr("controller.api.uploads.JUST_MADE_S", -1.0)
    store = Store(tmp_path)
    store.sweep()
    consistent(store)
    assert store.database.rows("PRAGMA integrity_check")[0][0] == "ok"


def test_a_sweep_leaves_an_upload_alone_that_is_under_way(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("controller.api.uploads.JUST_MADE_S", -1.0)
    with store.uploads.begin("a") as upload:
        upload.write(TEXT)
        assert Store(tmp_path / "state").sweep() == 0
        upload.commit()
    consistent(store)


def test_the_programs_that_a_program_calls_are_found_by_name(store: Store) -> None:
    upload(store, "main.ngc", b"o<pocket> call\nM98 P12\nM30\n")
    upload(store, "pocket.ngc", b"o<pocket> sub\nG0X1\no<pocket> endsub\n")
    upload(store, "O12", b"O12\nG0X1\nM99\n")
    upload(store, "other.ngc", b"G0X1\n")
    called = store.programs.called(store.programs.get("main.ngc"))
    assert called == {
        name: str(store.programs.path(store.programs.get(name).sha256)) for name in ("pocket.ngc", "O12")
    }
    assert store.programs.called(store.programs.get("other.ngc")) == {}
