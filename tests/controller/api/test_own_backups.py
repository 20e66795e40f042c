"""Back-ups by the panel: saved by who sets up, listed, taken away, and put back by the command line."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import httpx
import pytest
from support.fakes.panels import Scene, sentence
from typer.testing import CliRunner

from controller.api import backup, own_backups, own_folder
from controller.api.store import Store
from controller.cli import backup as command
from controller.machine import machine_file, setup_data
from controller.store import service_store, set_up_store
from controller.store.set_up_store import FITTING

PATH = "/api/v1/backups"
FITTED = {"offsets": {"G54": {"origin_mm": [1.0, 2.0, 3.0]}}}


def told(folder: Path, story: Any) -> Any:
    async def with_client() -> Any:
        scene = await Scene(folder).with_users()
        async with scene.client("set_up") as client:
            return await story(scene, client)

    return asyncio.run(with_client())


@pytest.fixture
def state(tmp_path: Path) -> Path:
    """A state folder on which a service has run, with an offset and a program."""
    folder = tmp_path / "state"
    folder.mkdir()
    setup_data.note(folder, machine_file.load("trunnion"))
    service_store.put(folder, FITTING, FITTED)
    with Store(folder).uploads.begin("a.ngc") as upload:
        upload.write(b"M2\n")
        upload.commit()
    return folder


def test_what_is_saved_is_listed_with_its_date_taken_away_and_put_back_by_the_command_line(
    state: Path, tmp_path: Path
) -> None:
    async def story(_: Scene, client: httpx.AsyncClient) -> None:
        assert (await client.get(PATH)).json()["backups"] == []
        made = await client.post(PATH)
        assert made.status_code == 201, made.text
        listed = (await client.get(PATH)).json()
        assert listed["backups"] == [made.json()] and listed["kept"] == own_backups.KEPT
        file = Path(listed["folder"]) / made.json()["name"]
        assert file.parent.parent == own_folder.of(state) and listed["state"] == str(state)
        assert abs(made.json()["made_s"] - backup.check(file).made_s) < 60.0
        taken = await client.get(f"{PATH}/{file.name}")
        assert taken.content == file.read_bytes() and len(taken.content) == made.json()["size"]

        service_store.put(state, FITTING, {})
        words = ["restore", str(file), "--state", str(state), "--runtime", str(tmp_path)]
        done = CliRunner().invoke(command.app, words)
        assert done.exit_code == 0, done.output

    told(state, story)
    assert set_up_store.load(state)["offsets"] == FITTED["offsets"]


def test_the_latest_are_kept_and_nothing_that_is_no_archive_is_listed(
    state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(own_backups, "KEPT", 2)

    async def story(_: Scene, client: httpx.AsyncClient) -> None:
        names = [(await client.post(PATH)).json()["name"] for _ in range(3)]
        (own_folder.of(state) / own_backups.FOLDER / "notes.txt").write_text("mine")
        found = [one["name"] for one in (await client.get(PATH)).json()["backups"]]
        assert found == names[:0:-1], "the latest first"
        assert (own_folder.of(state) / own_backups.FOLDER / "notes.txt").exists()

    told(state, story)


@pytest.mark.parametrize("role", ["view", "operate"])
def test_only_who_sets_up_saves_and_takes_away(state: Path, role: str) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        name = (await client.post(PATH)).json()["name"]
        async with scene.client(role) as other:
            answers = [await other.get(PATH), await other.post(PATH), await other.get(f"{PATH}/{name}")]
        assert [one.status_code for one in answers] == [200, 403, 403]

    told(state, story)


def test_where_no_service_has_run_nothing_is_saved_and_that_is_said(tmp_path: Path) -> None:
    async def story(_: Scene, client: httpx.AsyncClient) -> None:
        refused = await client.post(PATH)
        assert refused.status_code == 404 and "directrix serve" in sentence(refused)
        assert (await client.get(PATH)).json()["backups"] == []

    told(tmp_path, story)


def test_one_is_saved_at_a_time_and_no_other_file_is_given_out(state: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        async with scene.panel.saving:
            assert (await client.post(PATH)).status_code == 429
        (own_folder.of(state) / own_backups.FOLDER).mkdir()
        (own_folder.of(state) / own_backups.FOLDER / "link.zip").symlink_to(state / "directrix.db")
        for name in ("none.zip", "link.zip", "..%2Ffitting.json"):
            assert (await client.get(f"{PATH}/{name}")).status_code in (404, 422), name

    told(state, story)
