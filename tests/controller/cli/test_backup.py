"""`directrix backup` beside a service: what it puts back must not be written over."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from support.fakes.service_stand_ins import answering, hanging
from typer.testing import CliRunner

from controller.__main__ import app
from controller.api import backup
from controller.api.store import Store
from controller.cli import backup as command
from controller.machine import machine_file as config
from controller.machine import setup_data
from controller.messages import plain


@pytest.fixture
def state(tmp_path: Path) -> Path:
    store = Store(tmp_path / "state")
    setup_data.note(store.folder, config.load("trunnion"))
    backup.save(store, setup_data.noted(store.folder), tmp_path / "saved.zip")
    return store.folder


def changes(folder: Path) -> list[list[str]]:
    machine_file = str(folder / "machine.toml")
    return [
        ["restore", str(folder / "saved.zip")],
        ["update", machine_file, "--machine", machine_file],
        ["rollback"],
    ]


def outcome(words: list[str], state: Path) -> tuple[int, str]:
    done = CliRunner().invoke(command.app, [*words, "--state", str(state), "--json"])
    return done.exit_code, str(json.loads(done.stdout).get("error", ""))


@pytest.mark.parametrize("service", [answering, hanging])
def test_nothing_is_put_back_while_the_service_of_that_state_folder_runs_or_hangs(
    service: Callable[[Path, Path], contextlib.AbstractContextManager[None]],
    state: Path,
    runtime: Path,
    tmp_path: Path,
) -> None:
    """Its runtime folder is not the one of the user who asks, and nobody has to know it."""
    with service(state, runtime):
        for words in changes(tmp_path):
            code, error = outcome(words, state)
            assert code == 1 and "its service runs" in error and str(runtime) in error, words
    assert backup.automatic_backups(Store(state)) == []


def test_after_the_service_it_is_put_back(state: Path, runtime: Path, tmp_path: Path) -> None:
    with contextlib.ExitStack() as ending:
        ending.enter_context(answering(state, runtime))
    assert outcome(["restore", str(tmp_path / "saved.zip")], state) == (0, "")


def test_another_service_with_a_state_folder_of_its_own_forbids_nothing(
    state: Path, runtime: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path / "usual"))  # whose is elsewhere
    with answering(tmp_path / "other", runtime):
        assert outcome(["restore", str(tmp_path / "saved.zip")], state) == (0, "")


@pytest.mark.parametrize(("change", "words"), [(("period_s = 0.002", "period_s = 0.0005"), "bus|tick")])
def test_a_machine_file_that_check_and_bus_refuse_is_not_put_in_use(
    state: Path, runtime: Path, tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    file, new = tmp_path / "machine.toml", tmp_path / "new.toml"
    text = config.alone(config.load("trunnion"))
    file.write_text(text)
    new.write_text(text.replace(*change))
    assert new.read_text() != text
    refused = CliRunner().invoke(app, ["bus", str(new), "--json"])
    said = json.loads(refused.stdout)["error"]
    code, error = outcome(["update", str(new), "--machine", str(file)], state)
    assert code == 1 and re.search(words, error) and error.splitlines()[0] in said
    assert file.read_text() == text and backup.automatic_backups(Store(state)) == []
    strained = tmp_path / "strained.zip"
    backup.save(Store(state), config.load(str(new)), strained)
    assert outcome(["restore", str(strained), "--machine", str(file)], state)[0] == 1
    assert file.read_text() == text
    assert outcome(["restore", str(strained)], state) == (0, ""), "its machine file is not put in use"


def test_a_machine_whose_drives_commissioning_would_refuse_is_not_put_in_use(
    state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from controller.runtime import drive_sheets

    monkeypatch.setattr(drive_sheets, "look", lambda _: ([plain("X (can0, node 1): has no 607Ah")], []))
    file = tmp_path / "machine.toml"
    file.write_text(config.alone(config.load("trunnion")))
    code, error = outcome(["update", str(file), "--machine", str(file)], state)
    assert code == 1 and "has no 607Ah" in error
