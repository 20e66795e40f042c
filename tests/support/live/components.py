"""Single components of the page in a browser: without a panel, without a machine, and at once.

    with on_stage(chromium) as stage:
        stage.clear()                                       # before each test
        stage.tell(mode="RUNNING", tool=3)                  # a status, as OpenAPI has it
        stage.show("views/run.js", "ToolFeedSpindle")
        stage.page.inner_text(".run-tool")

The files are those that the panel sends, under its policy; what a component asks for is in ``answers`` by
method and path, and what it has asked in ``asked``.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from pydantic import BaseModel
from support.live import browser

from controller.api import models
from controller.api.routes import commands
from controller.commands.table import ALL
from controller.machine import machine_file
from controller.service import status
from controller.web import files, server

PLACE = "http://page.test"
DOCUMENT = (
    '<!doctype html><html lang="{language}" data-theme="dark"><head><meta charset="utf-8"><title>x</title>'
    '<link rel="stylesheet" href="/page/page.css"><link rel="stylesheet" href="/page/views.css"></head>'
    "<body></body></html>"
)
BEGIN = """async ({facts, commands, user, language}) => {
  const [{ dx }, { learn }, live, { html, render }] = await Promise.all(
    ["store", "texts", "live", "dom"].map((name) => import(`/page/${name}.js`)));
  await learn(language);
  window.dx = Object.assign(dx, { commands, facts, view: "run", told: live.shown });
  dx.clear = () => {
    dx.question?.end(false);
    dx.draw = () => {};
    render(null, document.body);
    Object.assign(dx, { stale: false, silent: false, inch: false, notice: null });
    Object.assign(dx, { user, holder: user.name, token: "t" });
  };
  dx.mount = async (module, name, props) => {
    const made = await import(`/page/${module}`);
    dx.draw = () => render(html`<${made[name]} ...${props} />`, document.body);
    dx.draw();
    dx.tell("view", dx.view); // what is asked for now and then is asked for at once
  };
}"""
PAGE = """async () => {
  const [{ html, render }, { Page }] = await Promise.all([import("/page/dom.js"), import("/page/frame.js")]);
  const View = () => html`<button id="opener" type="button" onclick=${() => dx.opener()}>open</button>`;
  dx.draw = () => render(html`<${Page} views=${[{ name: "run", View }]} />`, document.body);
  dx.draw();
}"""


class Asked(NamedTuple):
    method: str
    path: str
    body: Any


class Stage:
    """A browser's page on which components are shown."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.asked: list[Asked] = []
        self.answers: dict[str, Any] = {}
        page.route(f"{PLACE}/**", self._answer)

    def begin(self, language: str, **facts: Any) -> None:
        """``facts``: of the machine, beside or in place of the shipped trunnion's."""
        self.page.goto(f"{PLACE}/?{language}")
        known = {
            "facts": {**status.facts(machine_file.load("trunnion"), {}), **facts},
            "commands": {one.name: commands.facts(one).model_dump() for one in ALL},
            "user": {"name": "local", "role": "set_up", "csrf": "", "may_stop": True},
        }
        self.page.evaluate(BEGIN, {**known, "language": language})

    def clear(self) -> None:
        """Nothing is shown, and nobody but who sets up has control."""
        self.asked.clear()
        self.answers = {"GET usage": {"tools": []}, "GET tools": {"tools": {}}}
        self.page.evaluate("dx.clear()")

    def tell(self, **values: Any) -> None:
        """A status with these values; a name that OpenAPI has not is a mistake of the test."""
        told = {"mode": "READY", "tick": {"number": 500, "period_ms": 2.0}, **values}
        unknown = _unknown(models.Status.model_validate(told))
        assert not unknown, unknown
        self.page.evaluate("(told) => { dx.told(told); dx.draw(); }", told)

    def show(self, module: str, name: str, **props: Any) -> None:
        """One component that a module exports, alone."""
        self.page.evaluate("([module, name, props]) => dx.mount(module, name, props)", [module, name, props])

    def show_page(self) -> None:
        """The frame around a view that has one button; ``dx.opener`` is what it does."""
        self.page.evaluate(PAGE)

    def _answer(self, route: Any) -> None:
        request, parts = route.request, urlsplit(route.request.url)
        if parts.path == "/":
            route.fulfill(
                body=DOCUMENT.format(language=parts.query), content_type="text/html", headers=server.HEADERS
            )
        elif parts.path.startswith("/page/texts/"):
            route.fulfill(json=server.words(parts.path.removeprefix("/page/texts/").removesuffix(".json")))
        elif (name := parts.path.removeprefix("/page/")) in files.names():
            packed = files.file(name)
            route.fulfill(body=packed.body, content_type=packed.kind)
        else:
            self._ask(route, request, parts.path.removeprefix("/api/v1/"))

    def _ask(self, route: Any, request: Any, path: str) -> None:
        body = json.loads(request.post_data) if request.post_data else None
        if request.method != "GET":
            self.asked.append(Asked(request.method, path, body))
        key = f"{request.method} {path}"
        if key in self.answers or request.method != "GET":
            route.fulfill(json=self.answers.get(key, {}))
        else:
            route.fulfill(status=404, json={"error": {"code": "missing", "sentence": ""}})


def _unknown(told: BaseModel, place: str = "status") -> list[str]:
    """What is in a body that its model does not declare."""
    found = [f"{place}.{name}" for name in told.model_extra or {}]
    for name in type(told).model_fields:
        for one in _models(getattr(told, name)):
            found += _unknown(one, f"{place}.{name}")
    return found


def _models(value: Any) -> Iterator[BaseModel]:
    values = value.values() if isinstance(value, dict) else value if isinstance(value, list) else [value]
    return (one for one in values if isinstance(one, BaseModel))


@contextlib.contextmanager
def on_stage(chromium: Any, language: str = "en", **facts: Any) -> Iterator[Stage]:
    """An error of the page's scripts fails the test."""
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, locale="en-GB")
    page = context.new_page()
    page.set_default_timeout(browser.HANGS_S * 1000)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    stage = Stage(page)
    stage.begin(language, **facts)
    yield stage
    context.close()
    assert not errors, errors
