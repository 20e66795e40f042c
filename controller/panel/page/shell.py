"""The page as a whole: one document with the frame and every view, on the panel's own application.

    app = make_app(panel)
    add_page(app, panel)

NiceGUI knows one application a process, so there is one page a process.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse
from nicegui import Client, background_tasks, core, ui
from nicegui.element import Element
from nicegui.events import GenericEventArguments
from starlette.routing import Match, Mount
from starlette.types import Scope

from controller.panel.access import principal
from controller.panel.answers import Refusal
from controller.panel.core import Panel
from controller.panel.events import TOPICS
from controller.panel.page import frame, login, words
from controller.panel.page.gate import LOG_IN, Gate
from controller.panel.page.view import Page, View, given
from controller.panel.page.views import VIEWS

STATIC = Path(__file__).parent / "static"
SCRIPTS, STYLES = ("dx.js", "looks.js"), ("page.css",)
OWN_PATHS = ("/_nicegui", "/page/", "/favicon.ico", LOG_IN)
AWAY_S = 30.0  # how long a browser may be away before its page is forgotten
CHECK_S = 5.0  # how long a page that was logged out still lives
TEXTS = tuple(topic for topic in TOPICS if topic != "status")
HEARD = frozenset(TEXTS)


class PageMount(Mount):
    """Takes the page's own paths and leaves all others to the routes, with their refusals."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        path = str(scope.get("path", ""))
        if path != "/" and not path.startswith(OWN_PATHS):
            return Match.NONE, {}
        return super().matches(scope)


def add_page(app: FastAPI, panel: Panel, views: tuple[View, ...] = VIEWS) -> None:
    """Put the page on the application, behind the same rules as its routes."""
    nicegui: Any = core.app
    nicegui.state.panel = panel
    nicegui.add_static_files("/page", STATIC, max_cache_age=0)

    def log_in(request: Request) -> HTMLResponse:
        return HTMLResponse(login.page(_language(request), _dark(request)))

    nicegui.add_api_route(LOG_IN, log_in, include_in_schema=False)

    @ui.page("/", title="Directrix", favicon=STATIC / "icon.svg", reconnect_timeout=AWAY_S)
    async def index(request: Request, client: Client) -> None:
        await _index(panel, views, request, client)

    ui.run_with(app, tailwind=False, show_welcome_message=False, message_history_length=200)
    app.router.routes.pop()  # NiceGUI's own mount, which takes every path and knows no rules
    app.router.routes.append(PageMount("/", Gate(nicegui, app)))


def _language(request: Request) -> words.Language:
    return words.chosen(
        request.cookies.get("directrix_language", ""), request.headers.get("accept-language", "")
    )


def _dark(request: Request) -> bool:
    """Dark unless light was chosen: most shops are, and a bright page blinds."""
    return request.cookies.get("directrix_theme") != "light"


async def _index(panel: Panel, views: tuple[View, ...], request: Request, client: Client) -> None:
    who, language = await principal(request), _language(request)
    spoken = words.spoken((words.FRAME, *(view.WORDS for view in views)), language)
    page = Page(panel, who, language, spoken, client)
    await page.refresh_facts()
    _head(page, views)
    ui.dark_mode(_dark(request))
    sections = frame.build(page, views)
    built: set[str] = set()

    async def shown(event: GenericEventArguments) -> None:
        await _show(page, views, sections, built, str(event.args))

    ui.on("dx-view", shown)
    listening = background_tasks.create(_listen(page, request), name="page events")
    client.on_delete(listening.cancel)


def _head(page: Page, views: tuple[View, ...]) -> None:
    boot = {
        "words": dict(page.words),
        "language": page.language,
        "csrf": page.who.csrf,
        "role": page.who.role.label,
        "facts": page.facts,
    }
    told = json.dumps(boot).replace("<", "\\u003c")
    styles = [*STYLES, *(style for view in views if (style := getattr(view, "STYLE", "")))]
    scripts = [*SCRIPTS, *(script for view in views if (script := getattr(view, "SCRIPT", "")))]
    lines = [
        f"<script>window.dxBoot = {told}; document.documentElement.lang = '{page.language}';</script>",
        *(f'<link rel="stylesheet" href="/page/{name}">' for name in dict.fromkeys(styles)),
        *(f'<script defer src="/page/{name}"></script>' for name in dict.fromkeys(scripts)),
    ]
    ui.add_head_html("\n".join(lines))


async def _show(
    page: Page, views: tuple[View, ...], sections: dict[str, Element], built: set[str], name: str
) -> None:
    """A view came on the screen: made when it is the first time."""
    page.shown = name
    for view in views:
        if name == view.NAME and name not in built:
            built.add(name)
            if not page.facts:
                await page.refresh_facts()
            with sections[name]:
                await given(view.build(page))
            sections[name].props["data-built"] = "1"
    for handler in page.on_shown.get(name, ()):
        await given(handler())


async def _listen(page: Page, request: Request) -> None:
    """Hand on what is told, until the page is gone or its user may not look any more."""
    with contextlib.suppress(Refusal), page.panel.events.listening(HEARD) as listener:
        while not listener.lost:
            with contextlib.suppress(TimeoutError):
                for told in await asyncio.wait_for(listener.next(), CHECK_S):
                    await _hand_on(page, told)
            await principal(request)


async def _hand_on(page: Page, told: str) -> None:
    said = json.loads(told)
    with page.client:
        for handler in page.handlers.get(said["event"], ()):
            await given(handler(said["data"]))
