"""What the application does is what /openapi.json says, for requests that a generator makes up."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import CHECKS
from schemathesis.pytest.lazy import get_all_tests
from schemathesis.schemas import BaseSchema
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
PARTS = 60  # of the routes, so that a share of the slow tests is a share of them


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


@pytest.fixture(scope="module")
def local() -> Scene:
    return scene_of(False)


@pytest.fixture(scope="module")
def with_users(local: Scene) -> Scene:
    scene = scene_of(True)
    scene.app.openapi_schema = local.app.openapi()  # the same, and a second to describe
    return scene


def chief(scene: Scene) -> dict[str, str]:
    return {"Authorization": f"Bearer {scene.tokens['set_up']}"}


@pytest.fixture(scope="module")
def described(local: Scene) -> BaseSchema:
    return schemathesis.openapi.from_asgi("/openapi.json", asked_from_here(local))


@pytest.fixture(scope="module")
def described_with_users(with_users: Scene) -> BaseSchema:
    asked = asked_from_here(with_users)
    return schemathesis.openapi.from_asgi("/openapi.json", asked, headers=chief(with_users))


@pytest.fixture(scope="module")
def routes(described: BaseSchema) -> list[str]:
    return [found.ok().label for found in described.get_all_operations()]


def ask_each(schema: BaseSchema, how: settings, test: Callable[..., None], **fixtures: Any) -> None:
    """What the generator makes up for each route of a schema, built only where it is asked.

    ``schema.parametrize`` builds it while tests are collected, in every worker and for every choice of tests.
    """
    asked = 0
    for found in get_all_tests(schema=schema, test_func=test, settings=how, given_kwargs={}):
        _, made = found.ok()
        made(**fixtures)
        asked += 1
    assert asked


def ask(scene: Scene, case: Any, **more: Any) -> None:
    """Ask in the mode in which most is taken, holding the control token; then compare."""
    scene.door.mode = "READY"
    token = scene.panel.control.take(OPERATOR, take_over=True)
    case.headers = {**(case.headers or {}), "X-Control-Token": token}
    case.call_and_validate(checks=EVERY_CHECK, **more)


ASKED = set[tuple[str, ...]]()


def is_of_a_new_kind(case: Any) -> bool:
    """Whether the generator has tried that with that value of that route for the first time.

    It tries each value of each route with every wrong type, in every combination with the others, and on each
    path all methods that it has not: that there are none is seen by one of them.
    """
    data = case.meta.phase.data if case.meta else None
    scenario = getattr(data, "scenario", None)
    if scenario is None:  # made up at random, or an example
        return True
    method = "" if scenario == "unspecified_http_method" else case.method
    kind = (method, case.path, str(scenario), str(data.parameter), str(data.parameter_location))
    return kind not in ASKED and not ASKED.add(kind)


@pytest.mark.parametrize("part", range(PARTS))
def test_what_is_made_up_is_answered_as_described(
    part: int, described: BaseSchema, routes: list[str], local: Scene
) -> None:
    def asked(case: Any) -> None:
        if is_of_a_new_kind(case):
            ask(local, case)

    ask_each(described.include(name=routes[part::PARTS]), HURRY, asked)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_more_that_is_made_up_is_answered_as_described(
    part: int, described: BaseSchema, routes: list[str], local: Scene
) -> None:
    def asked(case: Any) -> None:
        ask(local, case)

    ask_each(described.include(name=routes[part::PARTS]), SHIFT, asked)


@pytest.mark.soak
def test_much_that_is_made_up_is_answered_as_described(described: BaseSchema, local: Scene) -> None:
    def asked(case: Any) -> None:
        ask(local, case)

    ask_each(described, PATIENCE, asked)


@pytest.mark.soak
def test_with_users_it_is_answered_as_described_and_nothing_without_log_in(
    described_with_users: BaseSchema, with_users: Scene
) -> None:
    def asked(case: Any) -> None:
        ask(with_users, case, headers=chief(with_users))

    ask_each(described_with_users, PATIENCE, asked)


def test_every_answer_that_is_no_success_has_the_one_form_of_refusal(local: Scene) -> None:
    """In the description: 401, 403 and the others all refer to the same schema."""
    for path, methods in local.app.openapi()["paths"].items():
        for method, operation in methods.items():
            if path in (health.ALIVE, health.READY):  # for anybody, and nothing but ok or not
                continue
            assert {"401", "403"} <= operation["responses"].keys(), (method, path)
            for status, answer in operation["responses"].items():
                if status[0] in "45":  # 304 has no body
                    schema = answer["content"]["application/json"]["schema"]
                    assert schema == {"$ref": "#/components/schemas/ErrorAnswer"}, (method, path, status)
