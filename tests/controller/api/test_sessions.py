"""Log-ins and tokens have a scope and an end, and both outlive a restart of the panel."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest
from support.fakes.panels import PASSWORD, QUICK, Scene, sentence
from typer.testing import CliRunner

from controller.api import database
from controller.api.access import COOKIE
from controller.api.app_state import Panel
from controller.api.http import make_app
from controller.api.records import Users as Rows
from controller.api.sessions import IDLE_S, SEEN_S, SESSION_S
from controller.api.store import Store, StoreError
from controller.api.users import Users
from controller.cli import panel_users

LOGGED_IN = {"name": "operate", "password": PASSWORD}
STATUS = "/api/v1/status"


def restarted(scene: Scene) -> None:
    """Another process: nothing that was in memory is there."""
    scene.store.close()
    scene.store = Store(scene.folder)
    scene.panel = Panel(scene.store, scene.door)
    scene.panel.users = Users(scene.store.users, lambda: scene.now_s, QUICK, lambda: scene.now_s)
    scene.app = make_app(scene.panel)


async def log_in(scene: Scene) -> dict[str, str]:
    """The headers of a page that is logged in."""
    async with scene.client() as client:
        answer = await client.post("/api/v1/session", json=LOGGED_IN)
        assert answer.status_code == 200, answer.text
        cookie = client.cookies[COOKIE]
        return {"Cookie": f"{COOKIE}={cookie}", "X-CSRF-Token": answer.json()["csrf"]}


async def asked(
    scene: Scene, headers: dict[str, str], method: str = "GET", path: str = STATUS
) -> httpx.Response:
    async with scene.client() as client:
        return await client.request(method, path, headers=headers)


def story(of: Callable[[Scene], Any], folder: Path) -> None:
    async def told() -> None:
        scene = await Scene(folder).with_users()
        scene.now_s = scene.store.programs.now_s()
        await of(scene)

    asyncio.run(told())


def test_a_log_in_outlives_a_restart_with_its_role_and_its_page_goes_on(tmp_path: Path) -> None:
    async def of(scene: Scene) -> None:
        page = await log_in(scene)
        restarted(scene)
        assert (await asked(scene, page)).status_code == 200
        assert (await asked(scene, page, "POST", "/api/v1/machine/estop")).status_code == 200, (
            "its CSRF token, too"
        )
        assert (await asked(scene, page, "GET", "/api/v1/users")).status_code == 403, "it does not set up"
        assert (
            await asked(scene, {**page, "X-CSRF-Token": "0" * 64}, "POST", "/api/v1/cycle/stop")
        ).status_code == 403

    story(of, tmp_path)


@pytest.mark.parametrize("between_s", [0.0, 0.5 * SESSION_S])
def test_a_log_in_ends_in_its_time_whether_or_not_there_was_a_restart(
    tmp_path: Path, between_s: float
) -> None:
    async def of(scene: Scene) -> None:
        page, steps = await log_in(scene), 0
        began_s = scene.now_s
        while scene.now_s < began_s + SESSION_S:
            assert (await asked(scene, page)).status_code == 200, scene.now_s
            scene.now_s += 0.9 * IDLE_S
            scene.panel.users.refresh()
            if between_s and (steps := steps + 1) == 3:
                restarted(scene)
        assert (await asked(scene, page)).status_code == 401
        restarted(scene)
        assert (await asked(scene, page)).status_code == 401
        assert not scene.store.users.sessions()

    story(of, tmp_path)


def test_who_was_away_for_long_is_logged_out_also_by_a_restart(tmp_path: Path) -> None:
    async def of(scene: Scene) -> None:
        page = await log_in(scene)
        scene.now_s += IDLE_S + 1.0
        restarted(scene)
        assert (await asked(scene, page)).status_code == 401
        page = await log_in(scene)
        scene.now_s -= 3600.0  # the computer's clock was set back
        assert (await asked(scene, page)).status_code == 401

    story(of, tmp_path)


@pytest.mark.parametrize("change", ["log out", "password", "role", "removed", "removed at the command line"])
def test_what_ended_before_a_restart_does_not_come_back_by_it(tmp_path: Path, change: str) -> None:
    async def of(scene: Scene) -> None:
        page, rows = await log_in(scene), scene.store.users
        if change == "log out":
            assert (await asked(scene, page, "DELETE", "/api/v1/session")).status_code == 204
        elif change == "removed at the command line":
            rows.remove("operate")
        else:
            chief = {"Authorization": f"Bearer {scene.tokens['set_up']}"}
            body = {"password": {"password": "another one"}, "role": {"role": "view"}}.get(change)
            async with scene.client() as client:
                how = "PATCH" if body else "DELETE"
                await client.request(how, "/api/v1/users/operate", headers=chief, json=body)
            assert (await asked(scene, page)).status_code == 401
        restarted(scene)
        assert (await asked(scene, page)).status_code == 401
        assert not scene.store.users.sessions()

    story(of, tmp_path)


def test_a_full_disk_keeps_nobody_out_and_a_look_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def of(scene: Scene) -> None:
        written: list[int] = []
        keep = Rows.keep_sessions

        def full(*_: object) -> None:
            raise StoreError("space", "The disk is full.")

        def noted(rows: Rows, new: Any, ended: Any) -> None:
            written.append(len(new))
            keep(rows, new, ended)

        with monkeypatch.context() as patched:
            patched.setattr(Rows, "keep_sessions", full)
            page = await log_in(scene)
            assert (await asked(scene, page)).status_code == 200
        monkeypatch.setattr(Rows, "keep_sessions", noted)
        for _ in range(100):
            assert (await asked(scene, page)).status_code == 200
            scene.panel.users.refresh()
        assert written == [1], "once there is room, and no more than once a minute"
        scene.now_s += SEEN_S
        await asked(scene, page)
        scene.panel.users.refresh()
        assert written == [1, 1]

    story(of, tmp_path)


def test_the_store_has_nothing_that_somebody_could_log_in_with(tmp_path: Path) -> None:
    async def of(scene: Scene) -> None:
        page = await log_in(scene)
        kept = " ".join(map(str, scene.store.users.sessions()))
        assert page["Cookie"].partition("=")[2] not in kept and page["X-CSRF-Token"] not in kept

    story(of, tmp_path)


def test_a_token_expires_and_says_so(tmp_path: Path) -> None:
    async def of(scene: Scene) -> None:
        chief = {"Authorization": f"Bearer {scene.tokens['set_up']}"}
        async with scene.client() as client:
            body = {"name": "cam", "role": "view", "days": 2}
            made = (await client.post("/api/v1/tokens", headers=chief, json=body)).json()
            assert made["expires_s"] == pytest.approx(scene.now_s + 2 * 86400.0, abs=600.0)
            listed = (await client.get("/api/v1/tokens", headers=chief)).json()["tokens"]
            assert [one["expires_s"] for one in listed if one["name"] == "cam"] == [made["expires_s"]]
            assert (
                await client.post("/api/v1/tokens", headers=chief, json={**body, "days": 0})
            ).status_code == 422
        cam = {"Authorization": f"Bearer {made['token']}"}
        assert (await asked(scene, cam)).status_code == 200
        assert (await asked(scene, cam, "POST", "/api/v1/cycle/stop")).status_code == 403, "it only looks"
        scene.now_s = made["expires_s"] + 1.0
        for _ in range(2):
            said = await asked(scene, cam)
            assert said.status_code == 401 and "The token cam has expired" in sentence(said)
            restarted(scene)
        assert (await asked(scene, chief)).status_code == 200, "one without an end has none"

    story(of, tmp_path)


def test_the_command_line_makes_tokens_that_expire_and_lists_when(tmp_path: Path) -> None:
    run = CliRunner().invoke
    at = ["--state", str(tmp_path)]
    assert run(panel_users.tokens, ["add", "cam", "--days", "30", *at]).exit_code == 0
    (made,) = Store(tmp_path).users.tokens()
    assert made.expires_s is not None and made.expires_s - made.made_s == pytest.approx(30 * 86400.0)
    assert "until" in run(panel_users.tokens, ["list", *at]).output
    assert run(panel_users.tokens, ["add", "x", "--days", "0", *at]).exit_code == 1


def test_a_store_of_before_keeps_its_users_and_tokens(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / "store.sqlite")) as sql:
        sql.executescript(database.MIGRATIONS[0])
        sql.execute("PRAGMA user_version = 1")
        sql.execute("INSERT INTO tokens VALUES ('ab', 'cam', 'view', 1.0, 'me')")
        sql.commit()
    store = Store(tmp_path)
    assert [(one.name, one.expires_s) for one in store.users.tokens()] == [("cam", None)]
    assert store.users.sessions() == []
