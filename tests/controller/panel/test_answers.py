"""What the panel refuses is told in English and in German, by one text of the catalogue each."""

from __future__ import annotations

import ast
import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import Scene, take_control

from controller import panel
from controller.catalogue import LANGUAGES
from controller.panel import events
from controller.panel.answers import of_form

ROOM = Path(str(panel.__file__)).parent
# Told by what is sent by scripts alone, or at the command line before there is a page.
ENGLISH_ONLY = {"multipart.py", "listen.py", "records.py", "programs.py", "database.py"}
CASES: dict[str, tuple[str, str, Any, str]] = {
    "a program that is not there": ("GET", "/programs/none.ngc", None, "Programm 'none.ngc'"),
    "its new name is another's": (
        "PATCH",
        "/programs/a.ngc",
        {"name": "b.ngc"},
        "diesen Namen gibt es schon",
    ),
    "its new name is a path": ("PATCH", "/programs/a.ngc", {"name": "a/../b"}, "beginnt mit '.'"),
    "it is loaded": ("DELETE", "/programs/loaded.ngc", None, "ist geladen oder läuft"),
    "a run that is not there": ("GET", "/runs/7", None, "Lauf 7: gibt es nicht"),
    "an alarm that is not there": ("POST", "/alarms/7/acknowledge", None, "Meldung 7: gibt es nicht"),
    "a recording that is not there": ("GET", "/ticks?names=feed&source=recording:x", None, "Aufzeichnung x"),
    "no machine has run": ("GET", "/machine/file", None, "noch keine Maschine"),
    "a restart at a line": ("POST", "/job", {"program": "a", "restart": True, "line": 3}, "keine Zeile dazu"),
    "a tool that is not there": ("POST", "/offsets/G54/touch_off", {"Z": 0, "tool": 9}, "Werkzeug 9"),
    "nothing to be read": ("POST", "/offsets/G54/touch_off", {}, "X, Y und Z sind alle leer"),
    "no picture yet": ("GET", "/programs/a.ngc/picture", None, "hat erst ein Bild"),
    "log-in without users": ("POST", "/session", {"name": "a", "password": "b"}, "keine Benutzer"),
    "a number beyond its limit": ("PUT", "/overrides/feed", {"share": 99}, "darf höchstens"),
    "a value that is missing": ("PUT", "/overrides/feed", {}, "fehlt"),
    "what is no number": ("PUT", "/overrides/feed", {"share": "x"}, "muss eine Zahl sein"),
}


def calls() -> Iterator[tuple[Path, ast.Call]]:
    """Every call in the panel's source."""
    for file in sorted(ROOM.rglob("*.py")):
        nodes = ast.walk(ast.parse(file.read_text("utf-8")))
        yield from ((file, node) for node in nodes if isinstance(node, ast.Call))


def test_a_refusal_without_german_is_only_where_no_page_shows_it() -> None:
    plain = {
        file.name
        for file, call in calls()
        if isinstance(call.func, ast.Name) and call.func.id in ("Refusal", "StoreError")
        if not any(word.arg == "sentence_de" for word in call.keywords) and file.name != "http.py"
    }
    assert plain <= ENGLISH_ONLY


def test_every_text_that_a_refusal_names_is_in_the_catalogue() -> None:
    words = LANGUAGES["de"].refusals
    for file, call in calls():
        if not isinstance(call.func, ast.Attribute) or call.func.attr != "told":
            continue
        texts = [
            one.value for one in call.args if isinstance(one, ast.Constant) and isinstance(one.value, str)
        ]
        assert len(texts) < 2 or texts[-1] in words, (file.name, call.lineno, texts)


async def prepared(folder: Path) -> Scene:
    scene = Scene(folder)
    for name in ("a.ngc", "b.ngc", "loaded.ngc"):
        with scene.store.uploads.begin(name) as upload:
            upload.write(f"({name})\n".encode())
            upload.commit()
    scene.door.job = {"name": "loaded.ngc", "sha256": "0" * 64}
    return scene


@pytest.mark.parametrize("case", CASES)
def test_what_the_page_may_be_refused_is_told_in_german_too(case: str, tmp_path: Path) -> None:
    method, path, body, german = CASES[case]

    async def story() -> dict[str, Any]:
        scene = await prepared(tmp_path)
        async with scene.client() as client:
            await take_control(client)
            answer = await client.request(method, f"/api/v1{path}", json=body)
        assert answer.status_code >= 400, answer.text
        return dict(answer.json()["error"])

    error = asyncio.run(story())
    assert german in error["sentence_de"], error
    assert error["sentence"] and error["sentence"] != error["sentence_de"]


@pytest.mark.parametrize("path", ["/status", "/machine/buses"])
def test_that_the_service_is_gone_is_told_in_german_too(path: str, tmp_path: Path) -> None:
    async def story() -> dict[str, Any]:
        scene = Scene(tmp_path)
        scene.door.there = False
        async with scene.client() as client:
            return dict((await client.get(f"/api/v1{path}")).json()["error"])

    assert "antwortet nicht" in asyncio.run(story())["sentence_de"]


def test_listeners_hear_in_german_too_that_the_service_is_gone(tmp_path: Path) -> None:
    async def story() -> str:
        scene = Scene(tmp_path, FakeDoor())
        scene.door.there = False
        with scene.panel.events.listening(frozenset(events.TOPICS)) as listener:
            running = asyncio.create_task(scene.panel.events.run())
            told = "".join(await asyncio.wait_for(listener.next(), 30.0))
            running.cancel()
        return told

    assert "antwortet nicht" in asyncio.run(story())


def test_what_does_not_fit_in_a_way_without_a_word_is_told_as_it_was_found() -> None:
    error = {"type": "new_kind", "loc": ("body", "x"), "msg": "Not a plum.", "input": "y" * 99}
    facts = of_form([error]).facts
    assert facts.sentence.startswith("body.x: Not a plum (found 'yyy") and "..." in facts.sentence
    assert facts.sentence_de is not None and "passt nicht (Not a plum)" in facts.sentence_de
