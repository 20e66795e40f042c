"""`directrix backup` beside a service: what it puts back must not be written over."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from at_the_door import answering, hanging
from typer.testing import CliRunner

from controller import config, fitting
from controller.commands import backup as command
from controller.panel import backup
from controller.panel.store import Store


@pytest.fixture
def state(tmp_path: Path) -> Path:
    store = Store(tmp_path / "state")
    fitting.note(store.folder, config.load("trunnion"))
    backup.save(store, fitting.noted(store.folder), tmp_path / "saved.zip")
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
    assert backup.all_kept(Store(state)) == []


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
