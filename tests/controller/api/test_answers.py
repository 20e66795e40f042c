"""What the panel refuses is told in the language that is asked for, by one text of the catalogue each."""

from __future__ import annotations

import ast
import asyncio
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from support.fakes.fake_socket import FakeDoor
from support.fakes.panels import Scene, take_control

from controller import api
from controller.api import events
from controller.api.access import LOCAL
from controller.api.answers import of_form
from controller.messages import LANGUAGES, text

ROOM = Path(str(api.__file__)).parent
# Told by what is sent by scripts alone, or at the command line before there is a page.
ENGLISH_ONLY = {"multipart.py", "records.py", "programs.py", "database.py"}
# What another room refused goes on with the key that it has there.
HANDED_ON = {"http.py", "service_client.py", "calibration.py", "tables.py", "session.py", "bring_up.py"}
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
    "nothing to be read": ("POST", "/offsets/G54/touch_off", {}, "Es ist nichts angegeben"),
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


def test_a_refusal_without_a_key_is_only_where_no_page_shows_it() -> None:
    plain = {
        file.name
        for file, call in calls()
        if isinstance(call.func, ast.Name) and call.func.id in ("Refusal", "StoreError")
    }
    assert plain <= ENGLISH_ONLY | HANDED_ON


def test_every_text_that_a_refusal_names_is_in_the_catalogue() -> None:
    words, seen = LANGUAGES["de"].texts, 0
    for file, call in calls():
        if ast.unparse(call.func) not in ("Refusal.of", "StoreError.of"):
            continue
        key = call.args[-1]
        if isinstance(key, ast.Constant):
            seen += 1
            assert key.value in words, (file.name, call.lineno, key.value)
    assert seen > 20


async def prepared(folder: Path) -> Scene:
    scene = Scene(folder)
    for name in ("a.ngc", "b.ngc", "loaded.ngc"):
        with scene.store.uploads.begin(name) as upload:
            upload.write(f"({name})\n".encode())
            upload.commit()
    scene.door.job = {"name": "loaded.ngc", "sha256": "0" * 64}
    return scene


@pytest.mark.parametrize("case", CASES)
def test_what_the_page_may_be_refused_is_told_in_the_language_asked_for(case: str, tmp_path: Path) -> None:
    method, path, body, german = CASES[case]

    async def story() -> tuple[dict[str, Any], ...]:
        scene = await prepared(tmp_path)
        async with scene.client() as client:
            await take_control(client)
            told = []
            for language in ("de-CH, en;q=0.8", "fr, en"):
                spoken = {"Accept-Language": language}
                answer = await client.request(method, f"/api/v1{path}", json=body, headers=spoken)
                assert answer.status_code >= 400, answer.text
                assert answer.headers["Content-Language"] == ("de" if language[0] == "d" else "en")
                assert "Accept-Language" in answer.headers["Vary"]
                told.append(dict(answer.json()["error"]))
        return tuple(told)

    in_german, in_english = asyncio.run(story())
    assert german in in_german["sentence"], in_german
    assert in_english["sentence"] and in_english["sentence"] != in_german["sentence"]
    assert (in_english["key"], in_english["values"]) == (in_german["key"], in_german["values"])


@pytest.mark.parametrize("path", ["/status", "/machine/buses"])
def test_that_the_service_is_gone_is_told_in_the_language_of_the_page(path: str, tmp_path: Path) -> None:
    async def story() -> dict[str, Any]:
        scene = Scene(tmp_path)
        scene.door.there = False
        async with scene.client() as client:
            client.cookies.set("directrix_language", "de")
            spoken = {"Accept-Language": "en"}  # of the browser: what was chosen on the page comes first
            return dict((await client.get(f"/api/v1{path}", headers=spoken)).json()["error"])

    assert "antwortet nicht" in asyncio.run(story())["sentence"]


def test_every_listener_hears_in_a_language_of_its_own_that_the_service_is_gone(tmp_path: Path) -> None:
    async def story() -> list[str]:
        scene = Scene(tmp_path, FakeDoor())
        scene.door.there = False
        topics, own = frozenset(events.TOPICS), scene.panel.events
        both = [own.listening(topics, LOCAL, language=language) for language in ("de", "en")]
        with both[0] as german, both[1] as english:
            running = asyncio.create_task(own.run())
            told = ["".join(await asyncio.wait_for(one.next(), 30.0)) for one in (german, english)]
            running.cancel()
        return told

    german, english = asyncio.run(story())
    assert "antwortet nicht" in german and "does not answer" in english


def test_what_does_not_fit_in_a_way_without_a_word_is_told_as_it_was_found() -> None:
    error = {"type": "new_kind", "loc": ("body", "x"), "msg": "Not a plum.", "input": "y" * 99}
    told = of_form([error]).said
    assert text(told).startswith("body.x: does not fit (found 'yyy") and "..." in text(told)
    assert "body.x: passt nicht (" in text(told, "de")


class Form(BaseModel):
    """A key of each kind that a body may have."""

    model_config = ConfigDict(strict=True, extra="forbid")
    number: float | None = Field(None, ge=-1.0, lt=2.0, allow_inf_nan=False)
    whole: int = Field(1, gt=0, le=9)
    name: str = Field("ab", min_length=2, max_length=4, pattern="^[a-z]*$")
    on: bool = False
    kind: Literal["one", "two", "three"] = "one"
    rows: list[int] = Field([1], min_length=1, max_length=2)
    more: dict[str, int] = {}
    inner: Form | None = None


WRONG: tuple[tuple[dict[str, Any], str], ...] = (
    *(
        ({"number": "x"}, "eine Zahl"),
        ({"number": math.inf}, "eine Zahl"),
        ({"number": 5.0}, "kleiner als 2"),
    ),
    *(({"number": -5.0}, "mindestens -1"), ({"whole": 0}, "größer als 0"), ({"whole": 10}, "höchstens 9")),
    *(({"whole": 1.5}, "ganze Zahl"), ({"name": 1}, "ein Text"), ({"name": "a"}, "mindestens 2 Zeichen")),
    *(({"name": "abcde"}, "höchstens 4 Zeichen"), ({"name": "AB"}, "die Form ^[a-z]*$"), ({"on": 1}, "true")),
    *(
        ({"kind": "x"}, "eines von one, two, three"),
        ({"rows": []}, "mindestens 1 Ein"),
        ({"rows": 1}, "Liste"),
    ),
    *(({"rows": [1, 2, 3]}, "höchstens 2 Einträge"), ({"more": 1}, "Objekt"), ({"inner": 1}, "Objekt")),
    ({"other": 1}, "ist hier kein Schlüssel"),
)


@pytest.mark.parametrize(("values", "german"), WRONG)
def test_what_does_not_fit_is_told_without_a_word_of_the_library(values: dict[str, Any], german: str) -> None:
    with pytest.raises(ValidationError) as error:
        Form(**values)
    told = of_form([{**one, "loc": ("body", *one["loc"])} for one in error.value.errors()]).said
    assert german in text(told, "de") and "form.other" not in str(told) and "None" not in text(told)


def test_a_request_as_a_whole_has_a_name_in_each_language() -> None:
    told = of_form([{"type": "json_invalid", "loc": (), "input": "{"}]).said
    assert text(told).startswith("the request: is no JSON") and "die Anfrage: " in text(told, "de")
