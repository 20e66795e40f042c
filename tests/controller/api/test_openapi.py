"""What the application does is what /openapi.json says, for requests that a generator makes up."""

from __future__ import annotations

import asyncio
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import CHECKS
from support.fakes.panels import Scene

from controller.api import health
from controller.api.roles import Principal, Role
from controller.machine import machine_file, setup_data

EVERY_CHECK = list(CHECKS.get_all())
ANYHOW: dict[str, Any] = {"deadline": None, "suppress_health_check": list(HealthCheck), "print_blob": True}
HURRY = settings(max_examples=1, **ANYHOW)
SHIFT = settings(max_examples=15, **ANYHOW)
PATIENCE = settings(max_examples=150, **ANYHOW)
OPERATOR = Principal("test", Role.OPERATE, "local")


def scene_of(users: bool) -> Scene:
    """One store for a whole module: what one request leaves behind is met by the next ones."""
    scene = Scene(Path(mkdtemp()))
    setup_data.note(scene.folder, machine_file.load("trunnion"))  # as the service does when it starts
    if users:
        asyncio.run(scene.with_users())
    return scene


def asked_from_here(scene: Scene) -> Any:
    """The application, asked from this computer; the generator's own client names none."""

    async def asked(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "http":
            others = [pair for pair in scope["headers"] if pair[0] != b"host"]
            host = (b"host", b"127.0.0.1:8080")
            scope = {**scope, "client": ("127.0.0.1", 50000), "headers": [*others, host]}
        await scene.app(scope, receive, send)

    return asked


LOCAL, WITH_USERS = scene_of(False), scene_of(True)
WITH_USERS.app.openapi_schema = LOCAL.app.openapi()  # the same, and a second to describe
CHIEF = {"Authorization": f"Bearer {WITH_USERS.tokens['set_up']}"}
local = schemathesis.openapi.from_asgi("/openapi.json", asked_from_here(LOCAL))
with_users = schemathesis.openapi.from_asgi("/openapi.json", asked_from_here(WITH_USERS), headers=CHIEF)


def ask(scene: Scene, case: Any, **more: Any) -> None:
    """Ask in the mode in which most is taken, holding the control token; then compare."""
    scene.door.mode = "READY"
    token = scene.panel.control.take(OPERATOR, take_over=True)
    case.headers = {**(case.headers or {}), "X-Control-Token": token}
    case.call_and_validate(checks=EVERY_CHECK, **more)


ASKED = set[tuple[str, ...]]()


def is_of_a_new_kind(case: Any) -> bool:
    """Whether the generator has tried that with that value of that route for the first time.

    It tries each value of each route with every wrong type, in every combination with the others.
    """
    data = case.meta.phase.data if case.meta else None
    if getattr(data, "scenario", None) is None:  # made up at random, or an example
        return True
    kind = (case.method, case.path, str(data.scenario), str(data.parameter), str(data.parameter_location))
    return kind not in ASKED and not ASKED.add(kind)


@local.parametrize()
@HURRY
def test_what_is_made_up_is_answered_as_described(case: Any) -> None:
    if is_of_a_new_kind(case):
        ask(LOCAL, case)


@pytest.mark.slow
@local.parametrize()
@SHIFT
def test_more_that_is_made_up_is_answered_as_described(case: Any) -> None:
    ask(LOCAL, case)


@pytest.mark.soak
@local.parametrize()
@PATIENCE
def test_much_that_is_made_up_is_answered_as_described(case: Any) -> None:
    ask(LOCAL, case)


@pytest.mark.soak
@with_users.parametrize()
@PATIENCE
def test_with_users_it_is_answered_as_described_and_nothing_without_log_in(case: Any) -> None:
    ask(WITH_USERS, case, headers=CHIEF)


def test_every_answer_that_is_no_success_has_the_one_form_of_refusal() -> None:
    """In the description: 401, 403 and the others all refer to the same schema."""
    for path, methods in LOCAL.app.openapi()["paths"].items():
        for method, operation in methods.items():
            if path in (health.ALIVE, health.READY):  # for anybody, and nothing but ok or not
                continue
            assert {"401", "403"} <= operation["responses"].keys(), (method, path)
            for status, answer in operation["responses"].items():
                if status[0] in "45":  # 304 has no body
                    schema = answer["content"]["application/json"]["schema"]
                    assert schema == {"$ref": "#/components/schemas/ErrorAnswer"}, (method, path, status)
