"""``directrix support``: all that helps is in it, and nothing that lets somebody in."""

from __future__ import annotations

import asyncio
import json
import os
import zipfile
from pathlib import Path

import pytest
from support.fakes.panels import Scene
from typer.testing import CliRunner

from controller.__main__ import app
from controller.api import notice_settings
from controller.cli import internal_error
from controller.machine import machine_file, setup_data

WEBHOOK, PASSWORD, OUTSIDE = "https://chat.example/hooks/k3y-of-hook", "pass-of-mail", "what-is-elsewhere"


def state_of_a_shop(folder: Path) -> list[bytes]:
    """A state folder with users, tokens, settings, a run and a crash; its secrets."""
    scene = asyncio.run(Scene(folder).with_users())
    hashes = [user.password for user in scene.store.users.all()]
    scene.store.settings.set(notice_settings.SECRETS[0], WEBHOOK, "anna")
    scene.store.settings.set(notice_settings.PASSWORD, PASSWORD, "anna")
    scene.store.audit.add("anna", "10.0.0.7", "log in", "", True)
    scene.store.runs.end(scene.store.runs.begin("part.ngc", "0" * 64), "completed")
    setup_data.note(folder, machine_file.load("trunnion"))
    (folder / "journal.json").write_text("{}")
    run = folder / "runs" / "0001"
    run.mkdir(parents=True)
    (run / "run.json").write_text('{"result": "completed"}')
    return [one.encode() for one in (*hashes, *scene.tokens.values(), WEBHOOK, PASSWORD, OUTSIDE, "10.0.0.7")]


def written(state: Path, archive: Path) -> dict[str, bytes]:
    done = CliRunner().invoke(app, ["support", str(archive), "--state", str(state), "--json"])
    assert done.exit_code == 0 and json.loads(done.stdout)["ok"], done.output
    with zipfile.ZipFile(archive) as file:
        return {name: file.read(name) for name in file.namelist()}


def test_what_helps_is_in_it_and_no_secret(tmp_path: Path) -> None:
    state = tmp_path / "state"
    secrets = state_of_a_shop(state)
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "key").write_text(OUTSIDE)
    (state / "runs" / "0002").symlink_to(tmp_path / "outside")
    os.symlink(tmp_path / "outside" / "key", state / "runs" / "0001" / "planted.json")
    parts = written(state, tmp_path / "case.zip")
    assert {"facts.json", "host.json", "machine.toml", "state/journal.json", "store.json"} <= set(parts)
    assert parts["runs/0001/run.json"] == b'{"result": "completed"}'
    assert json.loads(parts["store.json"])["runs"][0]["program"] == "part.ngc"
    assert machine_file.read(parts["machine.toml"].decode(), "machine.toml").name
    assert b"planted.json" in parts["missing.txt"] and not any("0002" in name for name in parts)
    for name, data in parts.items():
        assert not [one for one in secrets if one in data], name


def test_a_crash_is_kept_in_the_state_folder_and_goes_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = tmp_path / "state"
    state_of_a_shop(state)
    monkeypatch.setenv("STATE_DIRECTORY", str(state))
    for number in range(internal_error.MOST + 3):
        said = internal_error.sentence(KeyError(f"number {number}"))
        assert str(state / internal_error.FOLDER) in said
    parts = written(state, tmp_path / "case.zip")
    crashes = [data for name, data in parts.items() if name.startswith(internal_error.FOLDER)]
    assert len(crashes) == internal_error.MOST
    assert sum(f"number {internal_error.MOST + 2}".encode() in one for one in crashes) == 1


def test_without_a_state_folder_it_is_refused(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["support", str(tmp_path / "x.zip"), "--state", str(tmp_path / "none")])
    assert done.exit_code == 1 and "--state" in done.output and not (tmp_path / "x.zip").exists()
