"""``/docs`` and the examples of OpenAPI: what a page shows is all there, and what is shown can be sent."""

from __future__ import annotations

import asyncio
import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from support.fakes import as_described
from support.fakes.panels import Scene, take_control

from controller.api.examples import EXAMPLES

REF = "#/components/schemas/"


def bodies() -> list[tuple[str, str, str]]:
    """Method, path and model of every body that is sent as JSON."""
    found = list[tuple[str, str, str]]()
    for path, methods in as_described.whole()["paths"].items():
        for method, operation in methods.items():
            content = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
            schema = content.get("schema", {})
            for one in (schema, *schema.get("anyOf", ())):
                if "$ref" in one:
                    found.append((method, path, one["$ref"].removeprefix(REF)))
    return found


def test_every_body_has_an_example_that_is_taken_for_one(tmp_path: Path) -> None:
    """It is carried out, or refused for what the machine is: never for its form."""
    places = {"number": "2", "name": "G54", "code": "G83", "step": "scale.X"}

    async def story() -> None:
        scene = Scene(tmp_path)
        scene.door.mode = "READY"
        async with scene.client() as client:
            await take_control(client)
            for method, path, model in bodies():
                where = re.sub(r"{(\w+)}", lambda one: places[one[1]], path)
                if path.startswith("/api/v1/calibration"):
                    where = path.replace("{name}", "circle")
                answer = await client.request(method, where, json=EXAMPLES[model])
                formed = answer.status_code != 422 or answer.json()["error"]["code"] != "form"
                assert formed or "calibration" in path, (path, answer.text)

    asyncio.run(story())
    assert len({model for _, _, model in bodies()}) > 30


@pytest.mark.parametrize("model", EXAMPLES)
def test_an_example_is_one_of_its_model(model: str) -> None:
    if model not in as_described.whole()["components"]["schemas"]:
        pytest.fail(f"{model}: there is no such model")
    assert not list(as_described._wrong({"$ref": REF + model}, EXAMPLES[model]))


def shown(scene: Scene, language: str) -> str:
    async def story() -> Any:
        async with scene.client() as client:
            return await client.get("/docs", headers={"Accept-Language": language})

    answer = asyncio.run(story())
    assert answer.status_code == 200 and answer.headers["content-type"].startswith("text/html")
    assert "script-src" not in answer.headers["content-security-policy"]
    text: str = answer.text
    return text


def test_the_page_has_every_route_and_model_and_needs_nothing_from_elsewhere(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    text = shown(scene, "en")
    schema = as_described.whole()
    for path, methods in schema["paths"].items():
        for method in methods:
            assert f"<b>{method.upper()}</b> <code>{path}</code>" in text, (method, path)
    for name in schema["components"]["schemas"]:
        assert f'id="model-{name}"' in text
    links = re.findall(r'href="#([^"]+)"', text)
    ids = set(re.findall(r'id="([^"]+)"', text))
    assert links and set(links) <= ids
    assert not re.search(r"<(script|link|img|iframe)|src=|url\(|@import", text)
    assert "'X-Control-Token: CONTROL'" in unescape(text) and '{"text": "G54 G0 X0. Y0."}' in unescape(text)
    assert ">Answers<" in text and ">Antworten<" in shown(scene, "de")
