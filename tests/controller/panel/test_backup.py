"""Back-up and restore: what is put back is what was saved, or nothing is."""

from __future__ import annotations

import json
import random
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller import config, fitting
from controller.commands import backup as command
from controller.panel import backup
from controller.panel.backup import BackupError
from controller.panel.store import Store, StoreError
from controller.toml_table import ConfigError

FITTED = {
    "offsets": {"G54": {"origin_mm": [1.0, 2.0, 3.0]}},
    "tools": {"7": {"name": "ball", "radius_mm": 4.0, "length_mm": 9.0, "flute_mm": 8.0}, "3": None},
}
PROGRAMS = {"a.ngc": b"M2\n", "Teil ü": b"G4 P1\nM2\n", "twin": b"M2\n"}


def put(store: Store, name: str, text: bytes) -> None:
    with store.uploads.begin(name) as upload:
        upload.write(text)
        upload.commit()


def state(store: Store) -> tuple[object, ...]:
    """All that a back-up holds."""
    programs = {p.name: store.programs.path(p.sha256).read_bytes() for p in store.programs.list()}
    return programs, fitting.load(store.folder), store.settings.all(), fitting.machine(store.folder)


def filled(folder: Path) -> Store:
    store = Store(folder)
    fitting.note(folder, config.load("trunnion"))
    fitting.save(folder, FITTED)
    store.settings.set("upload_mb", 64, "me")
    for name, text in PROGRAMS.items():
        put(store, name, text)
    return store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return filled(tmp_path / "state")


@pytest.fixture
def archive(store: Store, tmp_path: Path) -> Path:
    return backup.save(store, fitting.noted(store.folder), tmp_path / "saved.zip")


def test_a_back_up_put_into_an_empty_store_is_what_was_saved(
    store: Store, archive: Path, tmp_path: Path
) -> None:
    other = Store(tmp_path / "other")
    backup.restore(other, backup.check(archive), tmp_path / "machine.toml", None)
    saved, found = state(store), state(other)
    assert found[:3] == saved[:3]
    restored = fitting.applied(config.load(tmp_path / "machine.toml"), fitting.load(other.folder))
    for name in ("axes", "tools", "offsets", "buses", "period_s"):
        assert getattr(restored, name) == getattr(saved[3], name), name


def test_restoring_is_undone_by_rolling_back(store: Store, archive: Path) -> None:
    put(store, "a.ngc", b"G4 P9\nM2\n")
    fitting.save(store.folder, {})
    changed = state(store)
    backup.restore(store, backup.check(archive), None, fitting.noted(store.folder))
    assert state(store)[0]["a.ngc"] == b"M2\n"  # type: ignore[index]
    backup.restore(store, backup.check(backup.all_kept(store)[0]), None, fitting.noted(store.folder))
    assert state(store) == changed


@pytest.mark.parametrize("name", [name for name in config.shipped()])
def test_the_machine_file_of_an_archive_needs_no_other_file(tmp_path: Path, name: str) -> None:
    machine = config.load(name)
    store = Store(tmp_path)
    backup.save(store, machine, tmp_path / "saved.zip")
    backup.restore(store, backup.check(tmp_path / "saved.zip"), tmp_path / "m.toml", None)
    found = config.load(tmp_path / "m.toml")
    assert (found.tools, found.axes, found.offsets) == (machine.tools, machine.axes, machine.offsets)


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


def manifest(archive: Path, **changed: object) -> bytes:
    with zipfile.ZipFile(archive) as saved:
        return json.dumps({**json.loads(saved.read("manifest.json")), **changed}).encode()


def test_an_archive_that_was_tampered_with_is_refused(archive: Path) -> None:
    whole = archive.read_bytes()
    with zipfile.ZipFile(archive) as saved:
        names = saved.namelist()
    wrong: list[tuple[str, bytes | None]] = [(name, None) for name in names]
    wrong += [(name, b"x") for name in names]
    wrong += [
        ("manifest.json", manifest(archive, format=2)),
        ("manifest.json", manifest(archive, programs={"../x": "0" * 64})),
        ("manifest.json", manifest(archive, programs={"x": "../../etc/passwd"})),
        ("manifest.json", manifest(archive, programs=7)),
        ("manifest.json", manifest(archive, parts={})),
    ]
    for part, data in wrong:
        archive.write_bytes(whole)
        rewritten(archive, part, data)
        with pytest.raises(BackupError, match=r"saved\.zip"):
            backup.check(archive)


def test_an_archive_that_was_cut_or_scratched_is_refused_or_the_same(archive: Path) -> None:
    whole, draw = archive.read_bytes(), random.Random(2)
    sound = backup.check(archive)
    for turn in range(150):
        at = draw.randrange(len(whole))
        scratched = whole[:at] if turn % 2 else whole[:at] + bytes([whole[at] ^ 0x40]) + whole[at + 1 :]
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
    assert backup.check(backup.all_kept(store)[0]).machine.period_s == 0.002


def test_a_disk_that_is_full_leaves_no_half_archive(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "write", full)
    with pytest.raises(OSError, match="No space"):
        backup.save(store, config.load("trunnion"), tmp_path / "saved.zip")
    assert not list(tmp_path.glob("saved*"))


def test_only_the_latest_back_ups_are_kept(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backup, "KEPT", 3)
    made = [backup.keep(store, config.load("trunnion")) for _ in range(5)]
    assert backup.all_kept(store) == made[:1:-1]


def test_restoring_a_program_that_is_larger_than_allowed_says_so(archive: Path, tmp_path: Path) -> None:
    from controller.panel.uploads import UploadLimits

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


def test_an_update_is_undone_with_its_machine_file_and_redone_without_naming_it(
    store: Store, tmp_path: Path
) -> None:
    def run(*words: str) -> None:
        where = ["--state", str(store.folder), "--runtime", str(tmp_path)]
        done = CliRunner().invoke(command.app, [*words, *where, "--json"])
        assert done.exit_code == 0, done.stdout

    def period_s() -> float:
        return config.load(file).period_s

    file, new = tmp_path / "machine.toml", tmp_path / "new.toml"
    text = backup._alone(config.load("trunnion"))
    file.write_text(text.replace("period_s = 0.002", "period_s = 0.004"))
    new.write_text(text)
    before = state(store)
    run("update", str(new), "--machine", str(file))
    put(store, "later.ngc", b"M2\n")
    assert period_s() == 0.002
    run("rollback")
    assert period_s() == 0.004 and state(store)[1:3] == before[1:3]
    run("rollback")
    assert period_s() == 0.002


def test_an_archive_that_is_carried_here_writes_no_file_that_is_not_named(
    store: Store, tmp_path: Path
) -> None:
    file = tmp_path / "machine.toml"
    made = backup.save(store, config.load("trunnion"), tmp_path / "saved.zip", file)
    done = CliRunner().invoke(
        command.app, ["restore", str(made), "--state", str(store.folder), "--runtime", str(tmp_path)]
    )
    assert done.exit_code == 0 and not file.exists()
