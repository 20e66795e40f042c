"""The page's gate lets in who may look, by every way that a page takes; without a browser."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send
from support.fakes.panels import ROLES, Scene

from controller.panel.access import COOKIE
from controller.panel.page.gate import LOG_IN, Gate
from controller.panel.roles import Role

ORIGIN = "http://127.0.0.1:8080"
Way = tuple[str, str]  # method and path
OPEN: list[Way] = [("GET", LOG_IN), ("GET", "/page/dx.js"), ("GET", "/_nicegui/3/static/x.js")]
# The document, the socket that builds it and the way of it that is no WebSocket, and what a view may fetch.
GUARDED: list[Way] = [
    *(("GET", path) for path in ("/", "/_nicegui_ws/socket.io/", "/_nicegui_x/y", "/favicon.ico")),
    ("POST", "/_nicegui_ws/socket.io/"),
    ("WEBSOCKET", "/_nicegui_ws/socket.io/"),
]
LET_IN, CLOSED = 200, 403


class Asked:
    """The page behind a gate, and whether something came through to it."""

    def __init__(self, scene: Scene) -> None:
        self._gate = Gate(self._page, scene.app)

    async def _page(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.accept"})
            return
        await send({"type": "http.response.start", "status": LET_IN, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    async def __call__(self, method: str, path: str, headers: dict[str, str], peer: str = "127.0.0.1") -> int:
        """The status of the answer; of a WebSocket 200 or 403."""
        socket = method == "WEBSOCKET"
        kind = {"type": "websocket", "scheme": "ws"} if socket else {"type": "http", "scheme": "http"}
        scope = {
            **{**kind, "path": path, "raw_path": path.encode(), "query_string": b"", "root_path": ""},
            **({} if socket else {"method": method}),
            **{"client": (peer, 50000), "server": ("127.0.0.1", 8080), "http_version": "1.1"},
            "headers": [
                (name.lower().encode(), value.encode())
                for name, value in {"Host": "127.0.0.1:8080", **headers}.items()
            ],
        }
        said: list[dict[str, Any]] = []

        async def receive() -> dict[str, Any]:
            return {"type": "websocket.connect" if socket else "http.request"}

        async def send(message: Any) -> None:
            said.append(message)

        await self._gate(scope, receive, send)
        if socket:
            return LET_IN if said[0]["type"] == "websocket.accept" else CLOSED
        return int(said[0]["status"])


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """With a user of every role."""
    return asyncio.run(Scene(tmp_path).with_users())


@pytest.mark.parametrize("way", GUARDED)
def test_with_users_the_page_is_for_who_is_known_and_comes_from_its_own_server(
    scene: Scene, way: Way
) -> None:
    async def story() -> None:
        ask = Asked(scene)
        strangers: tuple[dict[str, str], ...] = (
            {},
            {"Authorization": "Bearer dx_wrong"},
            {"Cookie": f"{COOKIE}=wrong"},
        )
        for headers in strangers:
            assert await ask(*way, headers) == _sent_away(*way), headers
        for role in ROLES:
            cookie, _ = scene.panel.users.begin(role, Role.named(role))
            known = {"Cookie": f"{COOKIE}={cookie}", "Origin": ORIGIN}
            assert await ask(*way, known) == LET_IN, role
            if way[0] != "GET":
                assert await ask(*way, {**known, "Origin": "http://evil.example"}) == 403, role

    asyncio.run(story())


def _sent_away(method: str, path: str) -> int:
    if method == "WEBSOCKET":
        return CLOSED
    return 303 if path == "/" else 401  # to the log-in


@pytest.mark.parametrize("way", OPEN)
def test_the_log_in_and_what_every_copy_of_the_package_holds_are_open(scene: Scene, way: Way) -> None:
    assert asyncio.run(Asked(scene)(*way, {}, peer="192.168.1.7")) == LET_IN


@pytest.mark.parametrize("way", [*OPEN, *GUARDED])
def test_without_users_the_page_is_for_this_computer_alone_and_others_leave_a_line(
    tmp_path: Path, way: Way
) -> None:
    async def story() -> list[tuple[str, str]]:
        scene = Scene(tmp_path)
        ask = Asked(scene)
        async with scene.panel.running():
            assert await ask(*way, {"Origin": ORIGIN}) == LET_IN
            assert await ask(*way, {"Origin": ORIGIN}, peer="192.168.1.7") == 403
        return [(entry.address, entry.detail) for entry in scene.store.audit.list()]

    assert asyncio.run(story()) == [("192.168.1.7", "local")]
