"""Nobody without the role, and without the control token where it takes one, can do anything."""

from __future__ import annotations

import asyncio
import itertools
import json
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from fastapi.routing import APIRoute
from support.fakes.fake_socket import TABLE
from support.fakes.panels import PASSWORD, ROLES, Scene, sentence, take_control

from controller.api import access, http, roles
from controller.api.access import COOKIE
from controller.api.roles import Principal, Role
from controller.api.service_client import refusal
from controller.api.users import CROWD_TRIES, FREE_TRIES, LONGEST_WAIT_S
from controller.ipc.control_socket import CommandRefused
from controller.messages import message

# A body with which the route would do what it is for.
BODIES: dict[str, Any] = {
    "/job": {"program": "part.ngc"},
    "/machine/home": {"axes": None},
    "/mdi": {"text": "G0 X1"},
    "/overrides/feed": {"share": 0.5},
    "/overrides/rapid": {"share": 0.5},
    "/cycle/single_block": {"on": True},
    "/cycle/optional_stop": {"on": True},
    "/cycle/adaptive_feed": {"on": True},
    "/cycle/retract": {"mm": 1.0},
    "/jog": {"frame": "joint", "axis": "X", "speed": 0.1},
    "/jog/step": {"frame": "joint", "axis": "X", "distance": 0.1},
    "/jog/stop": {},
    "/offsets/G54": {"origin_mm": [1.0, 2.0, 3.0]},
    "/tools/1": {"radius_mm": 3.0, "length_mm": 1.0, "flute_mm": 10.0},
    "/control": {"take_over": True},
    "/users": {"name": "eve", "password": "long enough", "role": "set_up"},
    "/users/nobody": {"role": "set_up"},
    "/tokens": {"name": "eve", "role": "set_up"},
    "/notices": {"webhook": "http://127.0.0.1:9/"},
    "/programs/nobody": {"name": "other"},
    "/folders/nobody": {"name": "other"},
    "/queue": {"program": "nobody"},
    "/queue/1": {"count": 1},
    "/usage/maintenance": {"name": "grease", "counter": "X", "every": 1.0},
    "/usage/maintenance/done": {"name": "grease"},
}
WEBSOCKET = "WEBSOCKET"
VERBS = {"/job": "load", "/mdi": "mdi", "/jog": "jog", "/jog/step": "jog_step"}


@dataclass(frozen=True)
class Asker:
    """Somebody, with the control token or without."""

    name: str
    headers: dict[str, str]
    role: Role | None  # None: not known
    page: bool = True  # False: a cookie without the token that goes with it
    control: bool = False

    def expected(self, method: str, rule: tuple[Role, bool] | None) -> int | None:
        """The status with which the request must be refused; None: it must be let in."""
        if rule is None:
            return None
        if self.role is None:
            return 401
        if not self.page and method not in ("GET", WEBSOCKET):  # of that the origin is looked at
            return 403
        if self.role < rule[0]:
            return 403
        return 409 if rule[1] and not self.control else None


def askers(scene: Scene) -> Iterator[Asker]:
    """Everybody, each as if nobody had asked before."""
    somebody = Principal("somebody", Role.OPERATE, "session")
    for control in ("none", "wrong", "own"):

        def headers(more: dict[str, str], control: str = control) -> dict[str, str]:
            token = scene.panel.control.take(somebody, take_over=True)
            sent = {"wrong": {"X-Control-Token": "wrong"}, "own": {"X-Control-Token": token}}
            return {**more, **sent.get(control, {})}

        yield Asker("nobody", headers({}), None)
        yield Asker("wrong token", headers({"Authorization": "Bearer dx_wrong"}), None)
        yield Asker("wrong cookie", headers({"Cookie": f"{COOKIE}=wrong"}), None)
        for role in ROLES:
            rank, own = Role.named(role), control == "own"
            token = scene.tokens[role]
            yield Asker(role, headers({"Authorization": f"Bearer {token}"}), rank, True, own)
            yield Asker(role, headers({"X-Api-Key": token}), rank, True, own)
            for csrf in ("right", "wrong", ""):
                cookie, who = scene.panel.users.begin(role, rank)
                page = {"Cookie": f"{COOKIE}={cookie}", "X-CSRF-Token": who.csrf if csrf == "right" else csrf}
                yield Asker(role, headers(page), rank, csrf == "right", own)


def asked() -> list[tuple[str, str, tuple[Role, bool] | None]]:
    """(method, path, rule) of everything that the application answers, its description and events too."""
    found: dict[tuple[str, str], tuple[Role, bool] | None] = {}
    unused: Any = None  # the panel: routes are only looked at here
    own = (route for route in http.make_app(unused).routes if isinstance(route, APIRoute))
    for pattern, route in [*http.routes(), *((route.path, route) for route in own)]:
        path = pattern.replace("/offsets/{name}", "/offsets/G54").replace("{number}", "1")
        path = re.sub(r"\{\w+\}", "nobody", path)
        methods = sorted(route.methods) if isinstance(route, APIRoute) else [WEBSOCKET]
        found |= {(method, path): http.rule_of(route) for method in methods}
    return [(method, path, rule) for (method, path), rule in found.items()]


async def ask(scene: Scene, method: str, path: str, headers: dict[str, str]) -> tuple[int, str]:
    """(status of the answer, code of the refusal or "")."""
    if method == WEBSOCKET:
        return await knock(scene.app, path, headers)
    async with scene.client() as client:
        body = BODIES.get(path.removeprefix(http.API))
        answer = await client.request(method, path, json=body, headers=headers)
    said = answer.json() if answer.content[:1] == b"{" else {}
    return answer.status_code, said.get("error", {}).get("code", "")


async def knock(app: Any, path: str, headers: dict[str, str]) -> tuple[int, str]:
    """The same of a WebSocket, which is left at once; 101 where it was let in."""
    scope = {
        **{"type": "websocket", "path": path, "raw_path": path.encode(), "query_string": b""},
        **{"asgi": {"version": "3.0"}, "http_version": "1.1", "scheme": "ws", "subprotocols": []},
        **{"client": ("127.0.0.1", 50000), "server": ("127.0.0.1", 8080), "root_path": ""},
        "headers": [(b"host", b"127.0.0.1:8080")]
        + [(name.lower().encode(), value.encode()) for name, value in headers.items()],
        "extensions": {"websocket.http.response": {}},
    }
    heard = iter([{"type": "websocket.connect"}])
    said: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return next(heard, {"type": "websocket.disconnect", "code": 1000})

    async def send(message: dict[str, Any]) -> None:
        said.append(message)

    await app(scope, receive, send)
    if said[0]["type"] == "websocket.accept":
        return 101, ""
    body = b"".join(message.get("body", b"") for message in said)
    return int(said[0]["status"]), str(json.loads(body)["error"]["code"])


@pytest.mark.parametrize(("method", "path", "rule"), asked(), ids=lambda v: str(v))
def test_every_route_lets_in_only_who_has_role_and_control(
    shared: Scene, method: str, path: str, rule: tuple[Role, bool] | None
) -> None:
    async def story() -> None:
        # A third of the askers each, every role and every way to log in among them.
        for asker in itertools.islice(askers(shared), zlib.crc32(f"{method} {path}".encode()) % 3, None, 3):
            shared.door.asked.clear()
            status, code = await ask(shared, method, path, asker.headers)
            expected = asker.expected(method, rule)
            if expected is None:
                assert code not in ("role", "csrf", "control") and status < 500, (asker, status, code)
                assert status != 401 or (method, path) in http.PUBLIC
            else:
                assert status == expected, (asker, code)
                assert code in ("log_in", "role", "csrf", "control")
                assert not shared.door.moved, asker

    shared.door.mode = mode_for(path.removeprefix(http.API))
    asyncio.run(story())


def test_the_walk_leaves_nothing_out_that_is_answered() -> None:
    paths = {(method, path) for method, path, _ in asked()}
    assert {("GET", "/openapi.json"), ("GET", "/metrics"), (WEBSOCKET, f"{http.API}/events")} <= paths
    assert all(rule is not None or (method, path) in http.PUBLIC for method, path, rule in asked())


def mode_for(path: str) -> str:
    """One in which the machine would do it."""
    modes = TABLE.get(VERBS.get(path, path.split("/")[-1]), (set(), None))[0]
    return min(modes, default="READY")


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    scene = Scene(tmp_path_factory.mktemp("state"))
    asyncio.run(scene.with_users())
    return scene


def test_hold_stop_and_estop_take_no_control_token_and_every_other_motion_does() -> None:
    free = {path for _, path, rule in asked() if rule == (Role.OPERATE, False)}
    held = {path for _, path, rule in asked() if rule == (Role.OPERATE, True)}
    api = http.API
    assert {f"{api}/cycle/{verb}" for verb in ("hold", "stop")} | {
        f"{api}/machine/estop",
        f"{api}/jog/stop",
    } <= free
    moving = ("cycle/start", "cycle/resume", "cycle/retract", "cycle/return", "jog", "jog/step", "mdi", "job")
    assert {f"{api}/{verb}" for verb in (*moving, "machine/home", "machine/enable")} <= held


def test_only_looking_needs_no_more_than_to_look() -> None:
    """Another method than GET is a viewer's for the own sessions and password alone."""
    looks = ("GET", WEBSOCKET)
    viewers = {(m, p) for m, p, rule in asked() if rule and rule[0] is Role.VIEW and m not in looks}
    own = {("POST", "session/confirm"), ("PUT", "session/password"), ("DELETE", "sessions/nobody")}
    assert viewers == {(m, f"/api/v1/{path}") for m, path in {*own, ("DELETE", "session")}}


@pytest.mark.parametrize("path", ["cycle/hold", "cycle/stop", "machine/estop"])
def test_where_anybody_may_stop_a_viewer_may_and_starts_nothing(shared: Scene, path: str) -> None:
    async def story() -> None:
        async with shared.client("view") as viewer:
            assert (await viewer.get("/api/v1/session")).json()["may_stop"] is True
            assert (await viewer.post(f"/api/v1/{path}")).status_code == 200
            assert (await viewer.post("/api/v1/cycle/start")).status_code == 403
            assert (await viewer.post("/api/v1/control", json={"take_over": True})).status_code == 403

    shared.door.mode, shared.panel.anybody_stops = "RUNNING", True
    try:
        asyncio.run(story())
    finally:
        shared.panel.anybody_stops = False


@pytest.mark.parametrize("role", ROLES)
def test_a_session_says_whether_a_stop_is_taken_from_it(shared: Scene, role: str) -> None:
    async def story() -> tuple[bool, int]:
        async with shared.client(role) as client:
            may_stop = (await client.get("/api/v1/session")).json()["may_stop"]
            return may_stop, (await client.post("/api/v1/cycle/stop")).status_code

    shared.door.mode = "RUNNING"
    may_stop, status = asyncio.run(story())
    assert (may_stop, status) == ((False, 403) if role == "view" else (True, 200))


@pytest.mark.parametrize("role", ["view", "operate", "set_up"])
def test_a_macro_is_asked_for_with_the_role_of_who_presses_it(shared: Scene, role: str) -> None:
    """Which role it needs, the service knows: it reads the machine file."""

    async def story() -> Any:
        async with shared.client(role) as client:
            if role != "view":
                await take_control(client)
            return await client.post("/api/v1/macros/Warm%20up", json={"still": True})

    shared.door.mode = "READY"
    before = len(shared.door.asked)
    answer = asyncio.run(story())
    asked = [args for verb, args in shared.door.asked[before:] if verb == "macro"]
    if role == "view":
        assert answer.status_code == 403 and not asked
    else:
        assert answer.status_code == 200, answer.text
        assert asked == [{"name": "Warm up", "still": True, "role": role}]


@pytest.mark.parametrize(("code", "status"), [("role", 403), ("missing", 404), ("moves", 409)])
def test_what_the_service_refuses_a_macro_for_has_its_status(code: str, status: int) -> None:
    assert refusal(CommandRefused(code, message("no_macro", name="x", allowed="y"))).status == status


# ---- without users


@pytest.mark.parametrize(
    ("peer", "headers", "why"),
    [
        ("192.168.1.7", {}, "not of this computer"),
        ("127.0.0.1", {"Host": "evil.example:8080"}, "not of this computer"),  # a name that resolves to it
        ("127.0.0.1", {"X-Forwarded-For": "192.168.1.7"}, "through a proxy"),
        ("127.0.0.1", {"Origin": "http://evil.example"}, "page of http://evil.example"),
        ("127.0.0.1", {"Origin": "null"}, "page of null"),
        ("127.0.0.1", {"Sec-Fetch-Site": "cross-site"}, "page of another site"),
    ],
)
def test_without_users_only_this_computer_and_its_own_pages_are_answered(
    tmp_path: Path, peer: str, headers: dict[str, str], why: str
) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with scene.client(peer=peer) as client:
            answer = await client.post("/api/v1/machine/estop", headers=headers)
            assert answer.status_code == 403
            assert why in sentence(answer)
        assert not scene.door.moved

    asyncio.run(story())


@pytest.mark.parametrize("url", ["http://127.0.0.1:8080", "http://localhost:8080", "http://[::1]:8080"])
def test_without_users_this_computer_may_do_everything(tmp_path: Path, url: str) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client(url=url) as client:
            answer = await client.post("/api/v1/machine/estop", headers={"Origin": url})
            assert answer.status_code == 200
            assert (await client.get("/api/v1/session")).json()["role"] == "set_up"

    asyncio.run(story())


def test_the_first_user_is_not_made_by_whoever_asks_first(tmp_path: Path) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            new = {"name": "eve", "password": PASSWORD, "role": "set_up"}
            refused = await client.post("/api/v1/users", json=new)
            assert refused.status_code == 409
            assert "directrix users add" in sentence(refused)
        assert not scene.store.users.all()

    asyncio.run(story())


def test_with_the_first_user_everybody_has_to_log_in_and_openapi_says_how(tmp_path: Path) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        async with scene.client() as client:
            described = (await client.get("/openapi.json")).json()
            assert {} in described["security"], "on this computer nobody logs in"
            assert set(described["components"]["securitySchemes"]) == {"token", "api_key", "session"}
            scene.store.users.set("anna", await scene.panel.users.hash(PASSWORD), "operate")
            scene.panel.users.refresh()
            assert (await client.get("/api/v1/status")).status_code == 401
            page = await logged_in(client, "anna", PASSWORD)
            assert (await client.get("/api/v1/status", headers=page)).status_code == 200
            described = (await client.get("/openapi.json", headers=page)).json()
            assert described["security"] == [{"token": []}, {"api_key": []}, {"session": []}]
            assert described["paths"]["/api/v1/session"]["post"]["security"] == []
            start = described["paths"]["/api/v1/cycle/start"]["post"]["description"]
            assert start.endswith("Role: operate, holding the control token.")

    asyncio.run(story())


async def logged_in(client: httpx.AsyncClient, name: str, password: str) -> dict[str, str]:
    answer = await client.post("/api/v1/session", json={"name": name, "password": password})
    assert answer.status_code == 200, answer.text
    return {"X-CSRF-Token": answer.json()["csrf"]}


# ---- log-in


def test_the_cookie_is_for_this_server_alone_and_no_script_reads_it(tmp_path: Path) -> None:
    async def story() -> str:
        scene = await Scene(tmp_path).with_users()
        async with scene.client(url="https://machine.example") as client:
            answer = await client.post("/api/v1/session", json={"name": "view", "password": PASSWORD})
            return str(answer.headers["Set-Cookie"])

    cookie = asyncio.run(story()).lower()
    assert "httponly" in cookie and "samesite=strict" in cookie and "secure" in cookie


def test_guessing_passwords_is_slowed_down_for_the_address_whatever_the_name(tmp_path: Path) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        async with scene.client() as client:
            wrong = {"name": "set_up", "password": "wrong"}
            for _ in range(FREE_TRIES):
                assert (await client.post("/api/v1/session", json=wrong)).status_code == 401
            stopped = await client.post("/api/v1/session", json={**wrong, "password": PASSWORD})
            assert stopped.status_code == 429
            assert int(stopped.headers["Retry-After"]) >= 1
            other_name = await client.post("/api/v1/session", json={"name": "view", "password": PASSWORD})
            assert other_name.status_code == 429
        right = {"name": "view", "password": PASSWORD}
        async with scene.client(peer="127.0.0.2") as client:
            assert (await client.post("/api/v1/session", json=right)).status_code == 200
        scene.now_s = LONGEST_WAIT_S
        async with scene.client() as client:
            assert (await client.post("/api/v1/session", json=right)).status_code == 200

    asyncio.run(story())


async def guess(scene: Scene, name: str, peer: str, password: str = "wrong") -> int:
    """The status of the answer to one log-in."""
    async with scene.client(peer=peer) as client:
        body = {"name": name, "password": password}
        return (await client.post("/api/v1/session", json=body)).status_code


def test_nobody_keeps_somebody_else_from_logging_in_by_wrong_passwords(tmp_path: Path) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        for _ in range(2 * CROWD_TRIES):  # for hours, as quickly as this address may
            while await guess(scene, "operate", "192.168.1.66") == 429:
                scene.now_s += 20.0
        assert await guess(scene, "operate", "192.168.1.5", PASSWORD) == 200

    asyncio.run(story())


def test_many_addresses_together_are_slowed_down_by_the_name_they_guess_at(tmp_path: Path) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        assert await guess(scene, "operate", "192.168.1.5", PASSWORD) == 200
        tries = [guess(scene, "operate", f"10.0.0.{1 + n // FREE_TRIES}") for n in range(CROWD_TRIES)]
        assert set(await asyncio.gather(*tries)) == {401}
        assert await guess(scene, "operate", "10.0.0.99", PASSWORD) == 429
        assert await guess(scene, "operate", "192.168.1.5", PASSWORD) == 200, "was here before"
        assert await guess(scene, "view", "10.0.0.99", PASSWORD) == 200

    asyncio.run(story())


def test_an_own_account_is_no_way_to_go_on_guessing_at_another(tmp_path: Path) -> None:
    async def story() -> list[int]:
        scene, answers = await Scene(tmp_path).with_users(), []
        for _ in range(2 * FREE_TRIES):
            answers.append(await guess(scene, "set_up", "10.0.0.1"))
            await guess(scene, "view", "10.0.0.1", PASSWORD)
        return answers

    assert asyncio.run(story()).count(401) == FREE_TRIES


def test_a_script_is_known_without_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hold does not wait for what others ask of the store."""

    async def story() -> int:
        scene = await Scene(tmp_path).with_users()
        monkeypatch.setattr(scene.store.database, "rows", None)
        async with scene.client("operate") as client:
            return (await client.post("/api/v1/machine/estop")).status_code

    assert asyncio.run(story()) == 200


def test_a_hundred_guesses_at_once_get_no_more_tries_than_one_after_another(tmp_path: Path) -> None:
    async def story() -> list[int]:
        scene = await Scene(tmp_path).with_users()
        async with scene.client() as client:
            wrong = {"name": "set_up", "password": "wrong"}
            tries = (client.post("/api/v1/session", json=wrong) for _ in range(30))
            return [answer.status_code for answer in await asyncio.gather(*tries)]

    assert asyncio.run(story()).count(401) == FREE_TRIES


def test_a_new_password_a_new_role_and_a_removal_end_the_sessions(tmp_path: Path) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        for change in ({"password": "another one"}, {"role": "view"}, None):
            password = "another one" if change != {"password": "another one"} else PASSWORD
            async with scene.client() as anna, scene.client("set_up") as chief:
                page = await logged_in(anna, "operate", password)
                assert (await anna.get("/api/v1/status", headers=page)).status_code == 200
                path = "/api/v1/users/operate"
                done = await (chief.patch(path, json=change) if change else chief.delete(path))
                assert done.status_code in (200, 204), done.text
                assert (await anna.get("/api/v1/status", headers=page)).status_code == 401

    asyncio.run(story())


def test_the_last_one_who_sets_up_can_be_neither_removed_nor_lowered(tmp_path: Path) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        async with scene.client("set_up") as chief:
            for answer in (
                await chief.delete("/api/v1/users/set_up"),
                await chief.patch("/api/v1/users/set_up", json={"role": "view"}),
            ):
                assert answer.status_code == 409
                assert "last one who sets up" in sentence(answer)

    asyncio.run(story())


def test_a_removed_token_is_refused_and_a_token_is_not_kept_as_it_is(tmp_path: Path) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        async with scene.client("set_up") as chief:
            made = (await chief.post("/api/v1/tokens", json={"name": "cam", "role": "view"})).json()
            assert made["token"] not in (await chief.get("/api/v1/tokens")).text
            headers = {"Authorization": f"Bearer {made['token']}"}
            assert (await chief.get("/api/v1/status", headers=headers)).status_code == 200
            assert (await chief.delete("/api/v1/tokens/cam")).status_code == 204
            assert (await chief.get("/api/v1/status", headers=headers)).status_code == 401
        assert made["token"].encode() not in scene.store.database.file.read_bytes()

    asyncio.run(story())


# ---- control token and audit


def test_control_is_with_one_at_a_time_and_taking_it_over_brings_a_jog_to_rest(tmp_path: Path) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        scene.door.mode = "READY"
        move = {"frame": "joint", "axis": "X", "speed": 0.5}
        async with scene.client() as first, scene.client() as second:
            await take_control(first)
            assert (await first.post("/api/v1/jog", json=move)).status_code == 200
            refused = await second.post("/api/v1/control", json={})
            assert refused.status_code == 409 and "holds control" in sentence(refused)
            await take_control(second)
            assert scene.door.moved == ["jog", "jog_stop"]
            assert (await first.post("/api/v1/jog", json=move)).status_code == 409
            own = {**move, "press": "another key"}  # that of the first one was ended with its control
            assert (await second.post("/api/v1/jog", json=own)).status_code == 200
            assert (await second.delete("/api/v1/control")).status_code == 204
            assert (await second.post("/api/v1/jog", json=own)).status_code == 409

    asyncio.run(story())


def test_the_audit_log_says_who_did_what_and_who_was_not_allowed_to(tmp_path: Path) -> None:
    async def story() -> list[tuple[str, str, bool]]:
        scene = await Scene(tmp_path).with_users()
        viewer, operator = scene.client("view"), scene.client("operate")
        async with scene.panel.running(), viewer, operator:
            await viewer.post("/api/v1/machine/estop")
            await operator.post("/api/v1/machine/estop")
            await operator.get("/api/v1/status")
            for _ in range(5):
                await operator.post("/api/v1/jog", json={})
        return [(entry.user, entry.action, entry.allowed) for entry in scene.store.audit.list()][::-1]

    assert asyncio.run(story()) == [
        ("token script-view", "POST /api/v1/machine/estop", False),
        ("token script-operate", "POST /api/v1/machine/estop", True),
        ("token script-operate", "POST /api/v1/jog", True),
    ]


def test_a_jog_is_one_line_of_the_audit_log_however_long_it_is_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    halves = itertools.count()  # of the time without a refresh after which it is another jog
    clock = SimpleNamespace(monotonic=lambda: next(halves) * 0.5 * access.AGAIN_S)
    monkeypatch.setattr(access, "time", clock)

    async def story() -> list[str]:
        scene = await Scene(tmp_path).with_users()
        async with scene.panel.running(), scene.client("operate") as client:
            for _ in range(5):
                await client.post("/api/v1/jog", json={})
        return [entry.action for entry in scene.store.audit.list()]

    assert asyncio.run(story()) == ["POST /api/v1/jog"]


def test_the_audit_log_says_who_was_not_let_in_and_why(tmp_path: Path) -> None:
    """Each address and reason once a minute: whoever tries without end does not push the others out."""

    async def story() -> list[tuple[str, str, str, str]]:
        scene = await Scene(tmp_path).with_users()
        cookie, _ = scene.panel.users.begin("operate", Role.OPERATE)
        refused: tuple[dict[str, str], ...] = (
            {"Authorization": "Bearer dx_wrong"},
            {"Cookie": f"{COOKIE}={cookie}", "X-CSRF-Token": "wrong"},
        )
        async with scene.panel.running():
            for headers in refused:
                async with scene.client(peer="192.168.1.66") as client:
                    for turn in range(20):
                        await client.post(f"/api/v1/machine/estop?{turn}", headers=headers)
                        await client.delete(f"/api/v1/programs/{turn}", headers=headers)
            async with scene.client(peer="192.168.1.67") as client:
                await client.get("/api/v1/users")
                for turn in range(FREE_TRIES + 20):
                    body = {"name": f"name{turn}", "password": "wrong"}
                    await client.post("/api/v1/session", json=body)
        entries = scene.store.audit.list()[::-1]
        assert not any(entry.allowed for entry in entries)
        return [(entry.user, entry.address, entry.action, entry.detail) for entry in entries]

    told = asyncio.run(story())
    estop, stranger, guesser = "POST /api/v1/machine/estop", "192.168.1.66", "192.168.1.67"
    assert told[:3] == [
        ("", stranger, estop, "log_in"),
        ("operate", stranger, estop, "csrf"),
        ("", guesser, "GET /api/v1/users", "log_in"),
    ]
    tries = [(f"name{turn}", guesser, "log in", "") for turn in range(FREE_TRIES)]
    assert told[3:] == [*tries, ("", guesser, "log in", "too_often")]


def test_a_foreign_page_on_this_computer_leaves_a_line_though_nobody_is_known(tmp_path: Path) -> None:
    async def story() -> list[tuple[str, str, bool]]:
        scene = Scene(tmp_path)
        async with scene.panel.running(), scene.client() as client:
            await client.post("/api/v1/machine/estop", headers={"Origin": "http://evil.example"})
        return [(entry.user, entry.detail, entry.allowed) for entry in scene.store.audit.list()]

    assert asyncio.run(story()) == [("", "origin", False)]


def test_of_a_holder_it_is_told_how_long_nothing_was_heard_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(roles.time, "monotonic", lambda: now_s)
    control = roles.Control()
    assert control.silent_s is None
    token = control.take(Principal("anna", Role.OPERATE, "local"))
    now_s = 140.0
    assert not control.holds("another") and control.silent_s == 40.0
    assert control.holds(token) and control.silent_s == 0.0
    control.free()
    assert control.silent_s is None
