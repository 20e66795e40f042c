"""A panel for tests: a store in a folder, a fake door, users of every role, and who asks."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import httpx
from argon2 import PasswordHasher
from support.fakes import as_described, written_history
from support.fakes.fake_socket import FakeDoor
from support.fakes.written_history import WrittenHistory

from controller.api.app_state import Panel
from controller.api.http import make_app
from controller.api.store import Store
from controller.api.users import Users, new_token

URL = "http://127.0.0.1:8080"
ROLES = ("view", "operate", "set_up")
QUICK = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
PASSWORD = "correct horse"


@dataclass
class Scene:
    """An application, and what stands behind it."""

    folder: Path
    door: FakeDoor = field(default_factory=FakeDoor)
    now_s: float = 0.0  # of log-ins
    tokens: dict[str, str] = field(default_factory=dict)  # of scripts, by role

    def __post_init__(self) -> None:
        self.store = Store(self.folder)
        written_history.begin(self.folder)
        self.door.acknowledge = lambda number, by: self.history.acknowledge(number, by)
        self.panel = Panel(self.store, self.door)
        self.panel.users = Users(self.store.users, lambda: self.now_s, QUICK, lambda: self.now_s)
        self.app: Any = make_app(self.panel)

    @cached_property
    def history(self) -> WrittenHistory:
        """What the service has written of runs and alarms."""
        return WrittenHistory(self.folder)

    async def with_users(self) -> Scene:
        """A user and a script's token of every role; the user's name is the role."""
        hashed = await self.panel.users.hash(PASSWORD)
        for role in ROLES:
            self.store.users.set(role, hashed, role)
            self.tokens[role], sha256 = new_token()
            self.store.users.add_token(sha256, f"script-{role}", role, "test")
        self.panel.users.refresh()
        return self

    def client(self, role: str = "", peer: str = "127.0.0.1", url: str = URL) -> httpx.AsyncClient:
        """Who asks from ``peer``; with a script's token of that role, if any."""
        headers = {"Authorization": f"Bearer {self.tokens[role]}"} if role else {}
        transport = httpx.ASGITransport(self.app, client=(peer, 50000))
        hooks: dict[str, list[Any]] = {"response": [_as_described]}
        return httpx.AsyncClient(transport=transport, base_url=url, headers=headers, event_hooks=hooks)


async def _as_described(answer: httpx.Response) -> None:
    """Whatever a test asks for, the answer must be what /openapi.json says."""
    await answer.aread()
    assert not (found := as_described.slips(answer)), found


async def take_control(client: httpx.AsyncClient) -> str:
    """Take the control token, and send it from now on."""
    answer = await client.post("/api/v1/control", json={"take_over": True})
    token: str = answer.json()["token"]
    client.headers["X-Control-Token"] = token
    return token


def sentence(answer: httpx.Response) -> str:
    found: str = answer.json()["error"]["sentence"]
    return found
