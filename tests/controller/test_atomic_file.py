"""Files replaced whole: which is there after whatever ends the writer, and after a loss of power."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from support.machines.stepped_runs import shipped

from controller import atomic_file
from controller.api import backup
from controller.api.store import Store
from controller.ipc import control_socket
from controller.machine import setup_data
from controller.service import runs


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was done in its order: names that were synced, and "replace NAME"."""
    done: list[str] = []
    sync, replace = os.fsync, os.replace

    def synced(handle: int) -> None:
        done.append(Path(os.readlink(f"/proc/self/fd/{handle}")).name)
        sync(handle)

    def replaced(old: Path, new: Path, **folders: int) -> None:
        done.append(f"replace {Path(new).name}")
        replace(old, new, **folders)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    return done


def test_the_disk_has_the_text_before_the_name_and_the_name_before_the_end(
    tmp_path: Path, disk: list[str]
) -> None:
    atomic_file.write(tmp_path / "a", "text")
    assert disk == ["a.new", "replace a", tmp_path.name]


def test_what_a_writer_that_died_has_left_is_written_over(tmp_path: Path) -> None:
    (tmp_path / "a.new").write_text("half")
    atomic_file.write(tmp_path / "a", "text")
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("a", "text")]


def test_a_full_disk_leaves_the_old_text_and_nothing_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    atomic_file.write(tmp_path / "a", "old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError):
        atomic_file.write(tmp_path / "a", "new")
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("a", "old")]


def note(folder: Path) -> None:
    setup_data.note(folder, shipped())


def end_a_run(folder: Path) -> None:
    runs.RunRecord(folder, shipped(), {"name": "a"}).end("completed")


def back_up(folder: Path) -> None:
    backup.save(Store(folder), shipped(), folder / "saved.zip")


def serve(folder: Path) -> None:
    control_socket.note_runtime(folder, folder / "run")


@pytest.mark.parametrize(
    ("work", "name"),
    [(note, "machine.json"), (end_a_run, "run.json"), (back_up, "saved.zip"), (serve, "runtime")],
)
def test_what_was_told_as_done_lasts_through_a_loss_of_power(
    tmp_path: Path, disk: list[str], work: Callable[[Path], None], name: str
) -> None:
    work(tmp_path)
    (file,) = tmp_path.rglob(name)
    assert disk[-2:] == [f"replace {name}", file.parent.name]
