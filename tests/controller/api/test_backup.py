"""Back-up and restore: what is put back is what was saved, or nothing is."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import random
import re
import sqlite3
import subprocess
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.machines.stored_tools import StoredTools
from support.suite.seed import SEED
from typer.testing import CliRunner

from controller import atomic_file, own_files
from controller.api import backup
from controller.api.backup import BackupError
from controller.api.store import Store, StoreError
from controller.cli import backup as command
from controller.cli import installation
from controller.machine import machine_file as config
from controller.machine import setup_data
from controller.machine.toml_table import ConfigError
from controller.store import service_store, set_up_store, tool_store
from controller.store.set_up_store import FITTING
from controller.store.tool_store import AWAY, SPINDLE, Step

FITTED = {
    "offsets": {"G54": {"origin_mm": [1.0, 2.0, 3.0]}},
    "tools": {"7": {"name": "ball", "radius_mm": 4.0, "length_mm": 9.0, "flute_mm": 8.0}, "3": None},
}
PLACES = {7: 1, 3: SPINDLE, 12: AWAY}
PROGRAMS = {"a.ngc": b"M2\n", "Teil ü": b"G4 P1\nM2\n", "twin": b"M2\n"}


def put(store: Store, name: str, text: bytes) -> None:
    with store.uploads.begin(name) as upload:
        upload.write(text)
        upload.commit()


def state(store: Store) -> tuple[object, ...]:
    """All that a back-up holds."""
    programs = {p.name: store.programs.path(p.sha256).read_bytes() for p in store.programs.list()}
    tools = tool_store.saved_rows(store.folder)
    fitted = set_up_store.load(store.folder), tools
    return programs, fitted, store.settings.all(), set_up_store.machine(store.folder)


@contextlib.contextmanager
def tools_of(store: Store) -> Iterator[StoredTools]:
    """The store of a tool changer, as the service has it open."""
    opened = StoredTools(store.folder)
    try:
        yield opened
    finally:
        opened.close()


def filled(folder: Path) -> Store:
    store = Store(folder)
    setup_data.note(folder, config.load("trunnion"))
    service_store.put(folder, FITTING, FITTED)
    store.settings.set("upload_mb", 64, "me")
    with tools_of(store) as tools:
        tools.confirm(PLACES)
    for name, text in PROGRAMS.items():
        put(store, name, text)
    return store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return filled(tmp_path / "state")


@pytest.fixture
def archive(store: Store, tmp_path: Path) -> Path:
    return backup.save(store, setup_data.noted(store.folder), tmp_path / "saved.zip")


def test_a_back_up_put_into_an_empty_store_is_what_was_saved(
    store: Store, archive: Path, tmp_path: Path
) -> None:
    other = Store(tmp_path / "other")
    backup.restore(other, backup.check(archive), tmp_path / "machine.toml", None)
    saved, found = state(store), state(other)
    assert found[:3] == saved[:3]
    restored = setup_data.applied(config.load(tmp_path / "machine.toml"), set_up_store.load(other.folder))
    for name in ("axes", "tools", "offsets", "buses", "period_s"):
        assert getattr(restored, name) == getattr(saved[3], name), name


def test_restoring_is_undone_by_rolling_back(store: Store, archive: Path) -> None:
    put(store, "a.ngc", b"G4 P9\nM2\n")
    service_store.put(store.folder, FITTING, {})
    changed = state(store)
    backup.restore(store, backup.check(archive), None, setup_data.noted(store.folder))
    assert state(store)[0]["a.ngc"] == b"M2\n"  # type: ignore[index]
    backup.restore(
        store, backup.check(backup.automatic_backups(store)[0]), None, setup_data.noted(store.folder)
    )
    assert state(store) == changed


@pytest.mark.parametrize("name", [name for name in config.shipped()])
def test_the_machine_file_of_an_archive_needs_no_other_file(tmp_path: Path, name: str) -> None:
    machine = config.load(name)
    store = Store(tmp_path)
    backup.save(store, machine, tmp_path / "saved.zip")
    backup.restore(store, backup.check(tmp_path / "saved.zip"), tmp_path / "m.toml", None)
    found = config.load(tmp_path / "m.toml")
    assert (found.tools, found.axes, found.offsets) == (machine.tools, machine.axes, machine.offsets)


def test_where_tools_were_comes_back_and_must_be_confirmed(store: Store, archive: Path) -> None:
    with tools_of(store) as tools:
        assert tools.known
        tools.confirm({7: SPINDLE, 3: 2})
    changed = state(store)
    backup.restore(store, backup.check(archive), None, setup_data.noted(store.folder))
    with tools_of(store) as tools:
        assert tools.places == PLACES and tools.away == [12]
        assert not tools.known and tools.spindle is None
        assert [row[1] for row in tools.log()] == ["confirmed"]
    backup.restore(
        store, backup.check(backup.automatic_backups(store)[0]), None, setup_data.noted(store.folder)
    )
    assert state(store) == changed
    with tools_of(store) as tools:
        assert tools.places == {7: SPINDLE, 3: 2} and not tools.known


def test_a_back_up_beside_a_change_has_what_the_disk_has(store: Store, tmp_path: Path) -> None:
    """Also what is only in the file beside the store, and nothing of a transaction that is not over."""
    step = Step(3, 7, 4, "arm down", carries=3, goes_to=2)
    with tools_of(store) as tools:
        tools.begin(step)
        with tools._whole() as sql:
            sql.execute("DELETE FROM place")
            made = backup.save(store, config.load("trunnion"), tmp_path / "beside.zip")
    other = Store(tmp_path / "other")
    backup.restore(other, backup.check(made), None, None)
    with tools_of(other) as tools:
        assert tools.places == PLACES and tools.step == step and not tools.known


def left_by_a_killed_service(store: Store) -> None:
    """A store whose last transactions are only in the file beside it."""
    file = store.folder / service_store.FILE
    beside = file.with_name(f"{file.name}-wal")
    with tools_of(store) as tools:
        tools.confirm({7: SPINDLE})
        left = beside.read_bytes()
    beside.write_bytes(left)


@pytest.mark.parametrize("broken", [False, True])
def test_what_a_killed_service_left_beside_its_store_is_not_taken_into_the_restored_one(
    store: Store, archive: Path, broken: bool
) -> None:
    left_by_a_killed_service(store)
    if broken:
        (store.folder / service_store.FILE).write_bytes(b"no store" * 1000)
    done = backup.restore(store, backup.check(archive), None, setup_data.noted(store.folder))
    assert any(one["key"] == "file_damaged" for one in done) is broken
    with tools_of(store) as tools:
        assert tools.places == PLACES and not tools.known and tools.kept.losses == []


def test_a_back_up_of_before_there_were_changers_leaves_where_tools_are_to_be_confirmed(
    store: Store, archive: Path
) -> None:
    with zipfile.ZipFile(archive) as saved:
        told = json.loads(saved.read("manifest.json"))
    del told["parts"]["tools.json"]
    rewritten(archive, "manifest.json", json.dumps({**told, "format": 1}).encode())
    with pytest.raises(BackupError, match=r"holds tools\.json, which no back-up of its format has"):
        backup.check(archive)
    rewritten(archive, "tools.json", None)
    backup.restore(store, backup.check(archive), None, setup_data.noted(store.folder))
    with tools_of(store) as tools:
        assert tools.places == PLACES and not tools.known


def test_no_secrets_are_in_an_archive(store: Store, tmp_path: Path) -> None:
    store.users.set("anna", "$argon2id$secret", "set_up")
    store.users.add_token("ab" * 32, "script", "view", "anna")
    backup.save(store, config.load("trunnion"), tmp_path / "saved.zip")
    with zipfile.ZipFile(tmp_path / "saved.zip") as saved:
        for name in saved.namelist():
            assert b"secret" not in saved.read(name) and b"abab" not in saved.read(name)


def rewritten(archive: Path, part: str, data: bytes | None) -> None:
    """Change one part and nothing else; None takes it out."""
    with zipfile.ZipFile(archive) as old:
        parts = {name: old.read(name) for name in old.namelist()}
    parts = {name: data if name == part and data is not None else kept for name, kept in parts.items()}
    with zipfile.ZipFile(archive, "w") as new:
        for name, kept in parts.items():
            if name != part or data is not None:
                new.writestr(name, kept)


def everything(folder: Path) -> dict[str, bytes]:
    """Every file, but for the database's own, which is asked for what it holds."""
    files = (file for file in folder.rglob("*") if file.is_file() and "store.sqlite" not in file.name)
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def fails_at(monkeypatch: pytest.MonkeyPatch, where: str, machine_file: Path) -> type[Exception]:
    """The disk is full, or something else goes wrong, at one step of a restore."""
    full = OSError(28, "No space left on device")
    through, renamed = atomic_file._write_through, own_files.rename

    def write_through(file: Path, text: str, *more: Any, **others: Any) -> None:
        if file.parent == machine_file.parent and file.suffix == ".new":
            file.write_text(text[:100])
            raise full
        through(file, text, *more, **others)

    def rename(old: Path, new: Path, *within: Path) -> None:
        if new == machine_file and old.suffix == ".new":
            raise full
        renamed(old, new, *within)

    if where == "the machine file's disk":
        monkeypatch.setattr(atomic_file, "_write_through", write_through)
    elif where == "the last name":
        monkeypatch.setattr(own_files, "rename", rename)
    elif where == "the programs' disk":
        monkeypatch.setattr(backup.os, "fchmod", lambda *_: (_ for _ in ()).throw(full))
    elif where == "the transaction's end":
        sync = atomic_file.sync
        monkeypatch.setattr(
            atomic_file,
            "sync",
            lambda folder, *within: sync(folder, *within) if folder != machine_file.parent else _raise(full),
        )
    return OSError


def _raise(error: Exception) -> None:
    raise error


@pytest.mark.parametrize(
    "where", ["the machine file's disk", "the last name", "the programs' disk", "the transaction's end"]
)
def test_a_restore_that_fails_anywhere_has_changed_nothing(
    store: Store, archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    machine_file = tmp_path / "etc" / "machine.toml"
    machine_file.parent.mkdir()
    machine_file.write_text(config.alone(config.load("trunnion")).replace("0.002", "0.004"))
    put(store, "a.ngc", b"G4 P9\nM2\n")
    put(store, "only here.ngc", b"G4 P8\nM2\n")
    service_store.put(store.folder, FITTING, {})
    store.settings.set("upload_mb", 8, "me")
    before = state(store), everything(store.folder), everything(machine_file.parent)
    with monkeypatch.context() as patched:
        error = fails_at(patched, where, machine_file)
        with pytest.raises(error, match="No space"):
            backup.restore(store, backup.check(archive), machine_file, config.load(machine_file))
    assert (state(store), everything(store.folder), everything(machine_file.parent)) == before
    backup.restore(store, backup.check(archive), machine_file, config.load(machine_file))
    assert state(store)[0]["a.ngc"] == b"M2\n" and config.load(machine_file).period_s == 0.002  # type: ignore[index]
    assert sorted(everything(machine_file.parent)) == ["machine.toml"]


def test_a_database_that_cannot_end_its_transaction_leaves_the_files_as_they_were(
    store: Store, archive: Path, tmp_path: Path
) -> None:
    machine_file = tmp_path / "machine.toml"
    machine_file.write_text("as it was")
    before = everything(store.folder)
    store.database._sql.execute(
        "CREATE TEMP TRIGGER full BEFORE DELETE ON settings BEGIN SELECT RAISE(ABORT, 'disk is full'); END"
    )
    with pytest.raises((StoreError, sqlite3.IntegrityError), match="full"):
        backup.restore(store, backup.check(archive), machine_file, None)
    assert machine_file.read_text() == "as it was" and everything(store.folder) == before


@pytest.mark.skipif(os.geteuid() != 0, reason="a small disk is mounted by root only")
def test_a_machine_file_on_another_disk_that_is_really_full(
    store: Store, archive: Path, tmp_path: Path
) -> None:
    small = tmp_path / "etc"
    small.mkdir()
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=32k", "none", str(small)], capture_output=True
    ).returncode:
        pytest.skip("no file system may be mounted here")
    try:
        (small / "machine.toml").write_text("as it was")
        (small / "other").write_bytes(b"x" * 24_000)
        before = state(store), everything(store.folder), everything(small)
        with pytest.raises(OSError, match="No space"):
            backup.restore(store, backup.check(archive), small / "machine.toml", config.load("trunnion"))
        assert (state(store), everything(store.folder), everything(small)) == before
    finally:
        subprocess.run(["umount", str(small)], check=True)


def manifest(archive: Path, **changed: object) -> bytes:
    with zipfile.ZipFile(archive) as saved:
        return json.dumps({**json.loads(saved.read("manifest.json")), **changed}).encode()


def test_an_archive_that_was_tampered_with_is_refused(archive: Path) -> None:
    saved_bytes = archive.read_bytes()
    with zipfile.ZipFile(archive) as saved:
        names = saved.namelist()
    wrong: list[tuple[str, bytes | None]] = [(name, None) for name in names]
    wrong += [(name, b"x") for name in names]
    wrong += [
        ("manifest.json", manifest(archive, format=3)),
        ("manifest.json", manifest(archive, programs={"../x": "0" * 64})),
        ("manifest.json", manifest(archive, programs={"x": "../../etc/passwd"})),
        ("manifest.json", manifest(archive, programs=7)),
        ("manifest.json", manifest(archive, parts={})),
    ]
    for part, data in wrong:
        archive.write_bytes(saved_bytes)
        rewritten(archive, part, data)
        with pytest.raises(BackupError, match=r"saved\.zip"):
            backup.check(archive)


def added(archive: Path, name: str, data: bytes = b"x", **more: int) -> None:
    info = zipfile.ZipInfo(name)
    for key, value in more.items():
        setattr(info, key, value)
    with zipfile.ZipFile(archive, "a") as opened, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a name that is there already
        opened.writestr(info, data)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../../etc/cron.d/x", r"holds '\.\./\.\./etc/cron\.d/x', which no back-up has"),
        ("/etc/passwd", "holds '/etc/passwd', which no"),
        ("programs/x.ngc", "holds 'programs/x.ngc', which no"),
        ("notes.txt", "holds 'notes.txt', which no"),
        ("settings.json", "holds 'settings.json' twice"),
        (f"programs/{hashlib.sha256(b'x').hexdigest()}.ngc", "which its manifest does not name"),
    ],
)
def test_a_member_that_does_not_belong_there_is_named_and_refused(
    archive: Path, name: str, words: str
) -> None:
    added(archive, name)
    with pytest.raises(BackupError, match=words) as error:
        backup.check(archive)
    assert str(error.value).startswith(str(archive)) and str(error.value).endswith("use another back-up.")


def test_a_bomb_is_refused_before_it_is_unpacked(archive: Path) -> None:
    saved_bytes = archive.read_bytes()
    added(archive, "programs/" + "0" * 64 + ".ngc", b"0" * (64 << 20), compress_type=zipfile.ZIP_DEFLATED)
    rewritten(archive, "settings.json", b" " * (40 << 20))
    with pytest.raises(BackupError, match=r"'settings\.json' of 40 MB, at most 32"):
        backup.check(archive)
    archive.write_bytes(saved_bytes)
    added(archive, "x", b"0", compress_type=zipfile.ZIP_BZIP2)
    with pytest.raises(BackupError, match="which no back-up has"):
        backup.check(archive)
    archive.write_bytes(saved_bytes)
    rewritten(archive, "manifest.json", b'{"format": ' + b"[" * 100_000)
    with pytest.raises(BackupError, match="no sound JSON"):
        backup.check(archive)


STRANGE: list[object] = [
    *(
        None,
        True,
        -1,
        0,
        1,
        1e300,
        10**30,
        "",
        "x",
        "0" * 64,
        "../x",
        "\0",
        "\ud800",
        [],
        [1],
        {},
        {"a": 1},
        [[]],
    ),
    *(
        {"G54": 7},
        {"G99": {}},
        {"1": None},
        {"x": {}},
        {"7": {"radius_mm": "x"}},
        {"G54": {"origin_mm": [1e999]}},
    ),
]


def strange(draw: random.Random, value: object, depth: int = 0) -> object:
    """The value with one place of it, or all of it, something else."""
    if depth < 4 and isinstance(value, dict) and value and draw.random() < 0.8:
        key = draw.choice(list(value))
        changed = {**value, key: strange(draw, value[key], depth + 1)}
        return changed if draw.random() < 0.8 else {str(draw.choice(STRANGE)): changed.pop(key), **changed}
    if depth < 4 and isinstance(value, list) and value and draw.random() < 0.8:
        at = draw.randrange(len(value))
        return [*value[:at], strange(draw, value[at], depth + 1), *value[at + 1 :]]
    return draw.choice(STRANGE)


def resummed(archive: Path, part: str, data: bytes) -> None:
    """Change a part, and its sum in the manifest, as somebody would who means to."""
    rewritten(archive, part, data)
    with zipfile.ZipFile(archive) as saved:
        told = json.loads(saved.read("manifest.json"))
    told["parts"][part] = hashlib.sha256(data).hexdigest()
    rewritten(archive, "manifest.json", json.dumps(told).encode())


@pytest.mark.parametrize("part", ["manifest.json", "fitting.json", "settings.json", "tools.json"])
def test_a_strange_part_is_one_sentence_and_never_a_traceback(archive: Path, part: str) -> None:
    sound, draw, refused = archive.read_bytes(), random.Random(SEED), 0
    with zipfile.ZipFile(archive) as saved:
        found = json.loads(saved.read(part))
    for _ in range(50):
        archive.write_bytes(sound)
        changed = json.dumps(strange(draw, found)).encode()
        rewritten(archive, part, changed) if part == "manifest.json" else resummed(archive, part, changed)
        done = CliRunner().invoke(command.app, ["check", str(archive), "--json"])
        told = json.loads(done.stdout)
        assert done.exit_code == (0 if told["ok"] else 1), changed
        if not told["ok"]:
            refused += 1
            said = told["error"]
            assert said.startswith(str(archive)) and said.isprintable() and said.endswith("."), (
                changed,
                said,
            )
    assert refused > 12


@pytest.mark.parametrize(
    ("part", "text", "words"),
    [
        ("manifest.json", "", "manifest.json: is no sound JSON"),
        ("manifest.json", "[]", "is a list and no JSON object"),
        ("manifest.json", '{"format": 1, "format": 1}', "a key stands twice"),
        ("manifest.json", '{"format": 1, "made_s": NaN}', "NaN is no number"),
        ("manifest.json", '{"format": 1, "made_s": 1e999}', "beyond all bounds"),
        ("manifest.json", '{"format": 1, "made_s": ' + "9" * 5000 + "}", "is no sound JSON"),
        ("manifest.json", '{"format": 1, "made_s": 1e12}', "no time in seconds"),
        ("manifest.json", '{"format": 1, "made_s": 1, "parts": []}', "parts is a list"),
        ("settings.json", '{"Upload MB": 1}', "'Upload MB' is no name of a setting"),
        ("settings.json", '{"upload_mb": {"a": 1}}', "upload_mb is an object"),
        ("tools.json", '{"places": [[1, 1]]}', "tools.json: step is no list of rows"),
        ("tools.json", '{"places": [[1]], "step": [], "log": []}', "a row that is none of 2 values"),
        ("tools.json", '{"places": [[1, true]], "step": [], "log": []}', "that cannot stand there"),
        ("tools.json", '{"places": [[1, 2], [1, 3]], "step": [], "log": []}', "UNIQUE constraint failed"),
        (
            "fitting.json",
            '{"axes": {}}',
            "'axes' is an object; allowed are offsets, tools, shift, references, parameters",
        ),
        ("fitting.json", '{"tools": [1]}', "'tools' is a list"),
    ],
)
def test_what_is_wrong_with_a_part_is_said(archive: Path, part: str, text: str, words: str) -> None:
    (rewritten if part == "manifest.json" else resummed)(archive, part, text.encode())
    with pytest.raises(BackupError, match=re.escape(words)):
        backup.check(archive)


def test_an_archive_that_was_cut_or_scratched_is_refused_or_the_same(archive: Path) -> None:
    saved_bytes, draw = archive.read_bytes(), random.Random(2)
    sound = backup.check(archive)
    for turn in range(50):
        at = draw.randrange(len(saved_bytes))
        scratched = saved_bytes[:at] + (
            b"" if turn % 2 else bytes([saved_bytes[at] ^ 0x40]) + saved_bytes[at + 1 :]
        )
        archive.write_bytes(scratched)
        try:
            assert backup.check(archive) == sound
        except BackupError as error:
            assert "saved.zip" in str(error)


def test_a_machine_file_that_does_not_fit_is_refused_and_the_old_one_stays(
    store: Store, tmp_path: Path
) -> None:
    old, new = tmp_path / "machine.toml", tmp_path / "new.toml"
    done = backup.update(store, config.SHIPPED / "trunnion.toml", old)
    assert len(done) == 1
    text = old.read_text()
    new.write_text(text.replace("period_s = 0.002", "period_s = 77"))
    with pytest.raises(ConfigError, match="period_s"):
        backup.update(store, new, old)
    assert old.read_text() == text
    new.write_text(text.replace("period_s = 0.002", "period_s = 0.004"))
    backup.update(store, new, old)
    assert config.load(old).period_s == 0.004
    assert backup.check(backup.automatic_backups(store)[0]).machine.period_s == 0.002


def test_a_disk_that_is_full_leaves_no_half_archive(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        backup.save(store, config.load("trunnion"), tmp_path / "saved.zip")
    assert not list(tmp_path.glob("saved*"))


def test_only_the_latest_back_ups_are_kept(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backup, "KEPT", 3)
    made = [backup.keep(store, config.load("trunnion")) for _ in range(4)]
    assert backup.automatic_backups(store) == made[::-1], "none goes before what it was made for is done"
    backup.update(store, config.SHIPPED / "trunnion.toml", store.folder / "machine.toml")
    assert backup.automatic_backups(store) == made[:0:-1]


def test_restoring_a_program_that_is_larger_than_allowed_says_so(archive: Path, tmp_path: Path) -> None:
    from controller.api.uploads import UploadLimits

    small = Store(tmp_path / "small", UploadLimits(most_bytes=4))
    with pytest.raises(StoreError, match="Teil"):
        backup.restore(small, backup.check(archive), None, None)


def test_the_commands_save_check_restore_and_roll_back(store: Store, tmp_path: Path) -> None:
    def run(*words: str) -> dict[str, object]:
        where = [] if words[0] == "check" else ["--state", str(store.folder)]
        at = ["--runtime", str(tmp_path)] if words[0] in ("restore", "rollback", "update") else []
        done = CliRunner().invoke(command.app, [*words, *where, *at, "--json"])
        return {"code": done.exit_code, **json.loads(done.stdout)}

    archive = str(tmp_path / "saved.zip")
    assert run("rollback")["code"] == 1
    assert run("save", archive)["programs"] == 3
    assert run("check", archive)["machine"] == "trunnion"
    before = state(store)
    put(store, "a.ngc", b"G4 P9\nM2\n")
    assert run("restore", archive)["code"] == 0
    assert state(store) == before
    assert run("rollback")["code"] == 0
    assert state(store)[0]["a.ngc"] == b"G4 P9\nM2\n"  # type: ignore[index]
    assert "cannot be read" in str(run("check", str(tmp_path / "nothing.zip"))["error"])


def test_an_update_is_undone_where_the_operator_names_the_machine_file_or_it_is_installed(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(*words: str, code: int = 0) -> str:
        where = ["--state", str(store.folder), "--runtime", str(tmp_path)]
        done = CliRunner().invoke(command.app, [*words, *where, "--json"])
        assert done.exit_code == code, done.stdout
        return done.stdout

    def period_s() -> float:
        return config.load(file).period_s

    file, new = tmp_path / "machine.toml", tmp_path / "new.toml"
    text = config.alone(config.load("trunnion"))
    file.write_text(text.replace("period_s = 0.002", "period_s = 0.004"))
    new.write_text(text)
    before = state(store)
    run("update", str(new), "--machine", str(file))
    put(store, "later.ngc", b"M2\n")
    assert period_s() == 0.002
    assert f"say with --machine where it is (it was {file})" in run("rollback", code=1)
    assert period_s() == 0.002
    run("rollback", "--machine", str(file))
    assert period_s() == 0.004 and state(store)[1:3] == before[1:3]
    (environment := tmp_path / "directrix.env").write_text(f"DIRECTRIX_MACHINE={file}\n")
    monkeypatch.setattr(installation, "STATE", store.folder)
    monkeypatch.setattr(installation, "ENVIRONMENT", environment)
    run("rollback")
    assert period_s() == 0.002
    run("restore", str(backup.save(store, config.load(file), tmp_path / "saved.zip")))
    file.write_text("as it is")
    run("rollback", "--machine", str(file))
    assert file.read_text() == "as it is", "the restore had not replaced it"


def test_an_archive_planted_in_the_state_folder_undoes_nothing(store: Store, tmp_path: Path) -> None:
    """Nor does one in a folder of another's that has the place of the service's own."""
    victim = tmp_path / "victim.toml"
    for folder, owner in ((store.own / "backups", 0), (backup.folder_of(store), 4321)):
        folder.mkdir()
        backup.save(store, config.load("trunnion"), folder / "9999-12-31T000000.000000.zip", victim)
        if owner and os.geteuid() == 0:
            os.chown(folder, owner, owner)
        elif owner:
            folder.chmod(0o777)
        done = CliRunner().invoke(
            command.app,
            ["rollback", "--machine", str(victim), "--state", str(store.folder), "--runtime", str(tmp_path)],
        )
        assert done.exit_code == 1 and not victim.exists(), done.output
        assert "Traceback" not in done.output


def test_an_archive_that_is_carried_here_writes_no_file_that_is_not_named(
    store: Store, tmp_path: Path
) -> None:
    file = tmp_path / "machine.toml"
    made = backup.save(store, config.load("trunnion"), tmp_path / "saved.zip", file)
    done = CliRunner().invoke(
        command.app, ["restore", str(made), "--state", str(store.folder), "--runtime", str(tmp_path)]
    )
    assert done.exit_code == 0 and not file.exists()
