"""What OpenAPI says of routes, models and answers is texts of the catalogue, in the language asked for."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes.panels import Scene

from controller import messages
from controller.api import description
from controller.messages import LANGUAGES

# What is put together where it is asked for, and is in no schema.
COMPOSED = {"openapi.about", "openapi.role", "openapi.role_in_control"}


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    made = Scene(tmp_path)
    yield made
    made.store.close()


def texts(schema: Any) -> Iterator[str]:
    """Every description."""
    if isinstance(schema, dict):
        if isinstance(schema.get("description"), str):
            yield schema["description"]
        for name, one in schema.items():
            if name not in description.NOT_TEXTS:
                yield from texts(one)
    elif isinstance(schema, list):
        for one in schema:
            yield from texts(one)


def asked(scene: Scene, language: str) -> dict[str, Any]:
    async def whole() -> dict[str, Any]:
        async with scene.client() as client:
            answer = await client.get("/openapi.json", headers={"Accept-Language": language})
            assert (
                answer.headers["Content-Language"] == language and "Accept-Language" in answer.headers["Vary"]
            )
            found: dict[str, Any] = answer.json()
            return found

    return asyncio.run(whole())


def test_every_description_is_declared_in_the_catalogue(scene: Scene) -> None:
    found = set(texts(scene.app.openapi()))
    assert len(found) > 400
    assert sorted(found - description.declared().keys() - {""}) == []


def test_no_text_of_the_description_is_of_something_that_is_gone(scene: Scene) -> None:
    found, english = set(texts(scene.app.openapi())), LANGUAGES["en"].texts
    schemes = {f"openapi.scheme.{name}" for name in description.SCHEMES}
    own = {key for key in english if key.startswith("openapi.")} - COMPOSED - schemes
    assert sorted(key for key in own if english[key] not in found) == []


def test_a_title_that_is_made_of_a_name_is_left_out(scene: Scene) -> None:
    def titles(schema: Any) -> Iterator[str]:
        for one in (
            schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ()
        ):
            yield from titles(one)
        if isinstance(schema, dict) and isinstance(schema.get("title"), str):
            yield schema["title"]

    assert len([*titles(scene.app.openapi())]) > 400
    assert [*titles(asked(scene, "de"))] == ["Directrix"]


def test_a_third_language_has_all_of_it(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    english = LANGUAGES["en"]
    marked = {key: re.sub(r"[a-z]", "ж", text) for key, text in english.texts.items()}
    marked |= {key: english.texts[key].replace("Role", "Жжжж") for key in COMPOSED - {"openapi.about"}}
    monkeypatch.setitem(LANGUAGES, "xx", english._replace(texts=marked))
    whole = asked(scene, "xx")
    for text in texts(whole):
        text = re.sub(r"Жжжж: \w+(, holding the control token)?\.$", "", text)
        assert not re.search(r"[a-z]{2,} [a-z]{2,}", text), text
    summaries = [one["summary"] for methods in whole["paths"].values() for one in methods.values()]
    assert len(summaries) > 100 and all("ж" in one for one in summaries)


def test_it_is_german_where_that_is_asked_for_and_the_rest_is_the_same(scene: Scene) -> None:
    english, german = asked(scene, "en"), asked(scene, "de")
    hold = german["paths"]["/api/v1/cycle/hold"]["post"]
    assert hold["summary"] == "Auf der Bahn bis zur Ruhe bremsen, sofort"
    assert hold["description"].endswith("Rolle: operate.")
    assert english["paths"]["/api/v1/cycle/hold"]["post"]["summary"] == "Hold"

    def bare(schema: Any) -> Any:
        if isinstance(schema, dict):
            return {k: bare(v) for k, v in schema.items() if k != "summary" and not isinstance(v, str)}
        return [bare(one) for one in schema] if isinstance(schema, list) else schema

    assert json.dumps(bare(english)) == json.dumps(bare(german))
    assert messages.of("de").texts["openapi.about"] == german["info"]["description"]
