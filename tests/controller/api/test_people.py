"""People look after their own passwords and sessions; what changes others asks for the password again."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from support.fakes.panels import PASSWORD, Scene, sentence
from typer.testing import CliRunner

from controller.api import passwords
from controller.api.sessions import CONFIRMED_S
from controller.api.users import FREE_TRIES
from controller.cli import panel_users

API = "/api/v1/"
NEW = "ruled surfaces cut"
Story = Callable[[Scene], Awaitable[None]]


def told(folder: Path, story: Story) -> None:
    async def run() -> None:
        await story(await Scene(folder).with_users())

    asyncio.run(run())


async def log_in(client: httpx.AsyncClient, name: str, password: str = PASSWORD) -> httpx.Response:
    answer = await client.post(f"{API}session", json={"name": name, "password": password})
    if answer.status_code == 200:
        client.headers["X-CSRF-Token"] = answer.json()["csrf"]
    return answer


@pytest.mark.parametrize("role", ["view", "operate", "set_up"])
def test_whoever_knows_the_old_password_sets_another_and_only_this_session_goes_on(
    tmp_path: Path, role: str
) -> None:
    async def story(scene: Scene) -> None:
        async with scene.client() as here, scene.client() as there:
            await log_in(here, role)
            await log_in(there, role)
            path = f"{API}session/password"
            wrong = await here.put(path, json={"old": "wrong", "password": NEW})
            assert wrong.status_code == 403 and role in sentence(wrong)
            for weak in ("Passw0rd!", f"{role}1234", "aaaaaaaaaaaa"):
                refused = await here.put(path, json={"old": PASSWORD, "password": weak})
                assert refused.status_code == 422 and "easy to guess" in sentence(refused)
            assert (await here.put(path, json={"old": PASSWORD, "password": "short"})).status_code == 422
            assert (await there.get(f"{API}status")).status_code == 200
            done = await here.put(path, json={"old": PASSWORD, "password": NEW})
            assert done.status_code == 200, done.text
            here.headers["X-CSRF-Token"] = done.json()["csrf"]
            assert (await here.get(f"{API}status")).status_code == 200
            assert (await here.put(path, json={"old": "wrong", "password": NEW})).status_code == 403
            assert (await there.get(f"{API}status")).status_code == 401
            assert (await log_in(there, role)).status_code == 401
            assert (await log_in(there, role, NEW)).status_code == 200

    told(tmp_path, story)


def test_the_old_password_is_guessed_no_quicker_here_than_at_the_log_in(tmp_path: Path) -> None:
    async def story(scene: Scene) -> None:
        async with scene.client() as client:
            await log_in(client, "view")
            tries = [
                client.put(f"{API}session/password", json={"old": f"guess {n}", "password": NEW})
                for n in range(20)
            ]
            assert [one.status_code for one in await asyncio.gather(*tries)].count(403) == FREE_TRIES

    told(tmp_path, story)


CHANGES: tuple[tuple[str, str, Any], ...] = (
    ("POST", "users", {"name": "eve", "password": NEW, "role": "view"}),
    ("PATCH", "users/view", {"role": "operate"}),
    ("POST", "tokens", {"name": "robot", "role": "operate"}),
    ("DELETE", "tokens/script-view", None),
    ("DELETE", "users/view", None),
)


@pytest.mark.parametrize(("method", "path", "body"), CHANGES)
def test_what_changes_users_and_tokens_asks_for_the_password_again_for_a_while(
    tmp_path: Path, method: str, path: str, body: Any
) -> None:
    async def story(scene: Scene) -> None:
        users = scene.store.users

        def kept() -> tuple[Any, Any]:
            return users.all(), users.tokens()

        before = kept()
        async with scene.client() as client:
            await log_in(client, "set_up")

            async def ask() -> tuple[int, str]:
                answer = await client.request(method, f"{API}{path}", json=body)
                return answer.status_code, answer.json()["error"]["code"] if answer.is_error else ""

            assert await ask() == (403, "confirm") and kept() == before
            wrong = await client.post(f"{API}session/confirm", json={"password": "wrong"})
            assert wrong.status_code == 403 and await ask() == (403, "confirm")
            right = {"password": PASSWORD}
            assert (await client.post(f"{API}session/confirm", json=right)).status_code == 204
            scene.now_s += CONFIRMED_S + 1.0
            assert await ask() == (403, "confirm") and kept() == before
            await client.post(f"{API}session/confirm", json=right)
            assert (await ask())[1] == "" and kept() != before
        async with scene.client("set_up") as script:
            assert (await script.post(f"{API}session/confirm", json=right)).status_code == 409

    told(tmp_path, story)


def test_everybody_sees_and_ends_his_own_sessions_and_who_sets_up_all(tmp_path: Path) -> None:
    async def story(scene: Scene) -> None:
        async with scene.client() as anna, scene.client() as phone, scene.client() as chief:
            await log_in(anna, "operate")
            await log_in(phone, "operate")
            await log_in(chief, "set_up")
            own = (await anna.get(f"{API}sessions")).json()["sessions"]
            assert [one["user"] for one in own] == ["operate"] * 2 and sum(one["mine"] for one in own) == 1
            every = (await chief.get(f"{API}sessions")).json()["sessions"]
            assert sorted(one["user"] for one in every) == ["operate", "operate", "set_up"]
            (of_chief,) = (one["id"] for one in every if one["user"] == "set_up")
            assert (await anna.delete(f"{API}sessions/{of_chief}")).status_code == 404
            (of_phone,) = (one["id"] for one in own if not one["mine"])
            assert (await anna.delete(f"{API}sessions/{of_phone}")).status_code == 204
            assert (await phone.get(f"{API}status")).status_code == 401
            assert (await anna.get(f"{API}status")).status_code == 200
            (of_anna,) = (one["id"] for one in own if one["mine"])
            assert (await chief.delete(f"{API}sessions/{of_anna}")).status_code == 204
            assert (await anna.get(f"{API}status")).status_code == 401
            assert len(scene.store.users.sessions()) == 1, "nor does it come back by a restart"
            assert (await chief.get(f"{API}sessions")).json()["sessions"][0]["mine"] is True

    told(tmp_path, story)


def test_a_browser_that_was_here_by_tls_comes_by_nothing_else(tmp_path: Path) -> None:
    async def story(scene: Scene) -> None:
        for url, there in (("https://machine.example", True), ("http://127.0.0.1:8080", False)):
            async with scene.client("view", url=url) as client:
                for path in (f"{API}status", "/healthz", "/nowhere"):
                    headers = (await client.get(path)).headers
                    assert ("max-age=31536000" in headers.get("Strict-Transport-Security", "")) is there

    told(tmp_path, story)


@pytest.mark.parametrize(
    "password",
    [
        *("password1", "P@ssw0rd!", "Passwort2024", "qwertz123", "1q2w3e4r", "12345678", "aaaaaaaa"),
        *("anna1234", "Iloveyou!", "letmein123", "Administrator1", "Sommer2023!", "directrix1", "Fußball1"),
    ],
)
def test_what_anybody_tries_first_is_no_password(password: str) -> None:
    assert passwords.check(password, ["anna"]) is not None


@pytest.mark.parametrize("password", [PASSWORD, NEW, "x7#kP0q!", "Testament-Blau", "übergang", "ключ замок"])
def test_what_is_not_among_them_is_one(password: str) -> None:
    assert passwords.check(password, ["anna"]) is None


def test_the_command_line_refuses_the_same(tmp_path: Path) -> None:
    def added(password: str) -> Any:
        words = ["add", "anna", "--state", str(tmp_path)]
        return CliRunner().invoke(panel_users.users, words, input=f"{password}\n")

    for password, why in (("short", "5 characters"), ("anna1234", "easy to guess")):
        refused = added(password)
        assert refused.exit_code == 1 and why in " ".join(refused.output.split())
    assert added(NEW).exit_code == 0
