"""The page's gate lets in who may look, by every way that a page takes; without a browser."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from panels import ROLES, Scene
from starlette.types import Receive, Scope, Send

from controller.panel.access import COOKIE
from controller.panel.page.gate import LOG_IN, Gate
from controller.panel.roles import Role

ORIGIN = "http://127.0.0.1:8080"
OPEN = [("GET", LOG_IN), ("GET", "/page/dx.js"), ("GET", "/_nicegui/3/static/x.js")]
# The document, the socket that builds it and the way of it that is no WebSocket, and what a view may fetch.
GUARDED = [
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


@pytest.mark.parametrize(("method", "path"), GUARDED)
def test_with_users_the_page_is_for_who_is_known_and_comes_from_its_own_server(
    tmp_path: Path, method: str, path: str
) -> None:
    async def story() -> None:
        scene = await Scene(tmp_path).with_users()
        ask = Asked(scene)
        strangers: tuple[dict[str, str], ...] = (
            {},
            {"Authorization": "Bearer dx_wrong"},
            {"Cookie": f"{COOKIE}=wrong"},
        )
        for headers in strangers:
            assert await ask(method, path, headers) == _sent_away(method, path), headers
        for role in ROLES:
            cookie, _ = scene.panel.users.begin(role, Role.named(role))
            known = {"Cookie": f"{COOKIE}={cookie}", "Origin": ORIGIN}
            assert await ask(method, path, known) == LET_IN, role
            if method != "GET":
                assert await ask(method, path, {**known, "Origin": "http://evil.example"}) == 403, role

    asyncio.run(story())


def _sent_away(method: str, path: str) -> int:
    if method == "WEBSOCKET":
        return CLOSED
    return 303 if path == "/" else 401  # to the log-in


@pytest.mark.parametrize(("method", "path"), OPEN)
def test_the_log_in_and_what_every_copy_of_the_package_holds_are_open(
    tmp_path: Path, method: str, path: str
) -> None:
    async def story() -> int:
        scene = await Scene(tmp_path).with_users()
        return await Asked(scene)(method, path, {}, peer="192.168.1.7")

    assert asyncio.run(story()) == LET_IN


@pytest.mark.parametrize(("method", "path"), [*OPEN, *GUARDED])
def test_without_users_the_page_is_for_this_computer_alone_and_others_leave_a_line(
    tmp_path: Path, method: str, path: str
) -> None:
    async def story() -> list[tuple[str, str]]:
        scene = Scene(tmp_path)
        ask = Asked(scene)
        async with scene.panel.running():
            assert await ask(method, path, {"Origin": ORIGIN}) == LET_IN
            assert await ask(method, path, {"Origin": ORIGIN}, peer="192.168.1.7") == 403
        return [(entry.address, entry.detail) for entry in scene.store.audit.list()]

    assert asyncio.run(story()) == [("192.168.1.7", "local")]
