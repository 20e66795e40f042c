"""The page on the panel's own application: a document, a log-in, and the files that both are made of.

    app = make_app(panel)
    add_page(app)

The files and the log-in are in every copy of the package and open to whom the panel answers at all; the
document is for those who may at least look. All that a page shows it asks for by the guarded routes.
"""

from __future__ import annotations

import json

from fastapi import FastAPI
from starlette.requests import HTTPConnection, Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from controller import messages
from controller.api.access import check_local, note_refused, panel_of, principal
from controller.api.answers import VARY, Refusal, language_of
from controller.web import files

LOG_IN = "/login"
FILES = "/page"
# Everything comes from this server, and nothing that runs or looks stands in a document.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
    "connect-src 'self'; form-action 'none'; frame-ancestors 'none'; base-uri 'none'"
)
HEADERS = {"Content-Security-Policy": POLICY, "Cache-Control": "no-store", "Vary": VARY}


def add_page(app: FastAPI) -> None:
    """Put the page on the application."""
    get = {"methods": ["GET", "HEAD"], "include_in_schema": False}
    app.add_api_route("/", _index, response_class=HTMLResponse, **get)  # type: ignore[arg-type]
    app.add_api_route(LOG_IN, _log_in, response_class=HTMLResponse, **get)  # type: ignore[arg-type]
    app.add_api_route(FILES + "/texts/{language}.json", _texts, **get)  # type: ignore[arg-type]
    app.add_api_route(FILES + "/{name:path}", _file, **get)  # type: ignore[arg-type]


async def _index(request: Request) -> Response:
    try:
        await principal(request)
    except Refusal as refusal:
        if refusal.status == 401:
            return RedirectResponse(LOG_IN, 303)
        _noted(request, refusal)
        raise
    return _document(request, "main")


async def _log_in(request: Request) -> Response:
    _open(request)
    return _document(request, "login")


async def _texts(request: Request, language: str) -> Response:
    _open(request)
    if language not in messages.LANGUAGES:
        raise Refusal.of(404, "missing", "no_page_file", name=language)
    return files.Packed.of(
        json.dumps(words(language), ensure_ascii=False).encode(), "application/json"
    ).answer(request)


async def _file(request: Request, name: str) -> Response:
    _open(request)
    if name not in files.names():
        raise Refusal.of(404, "missing", "no_page_file", name=name)
    return files.file(name).answer(request)


def _open(request: HTTPConnection) -> None:
    """Without users the panel is for this computer alone. Raises Refusal."""
    if panel_of(request).users.any:
        return
    try:
        check_local(request)
    except Refusal as refusal:
        _noted(request, refusal)
        raise


def _noted(request: HTTPConnection, refusal: Refusal) -> None:
    note_refused(request, "", f"page {request.url.path}"[:200], refusal)


def _document(request: Request, script: str) -> HTMLResponse:
    """Dark unless light was chosen: most shops are, and a bright page blinds."""
    theme = "light" if request.cookies.get("directrix_theme") == "light" else "dark"
    text, language = files.file("index.html").body.decode(), language_of(request)
    preloads = "\n".join(
        f'<link rel="modulepreload" href="{FILES}/{name}">' for name in files.modules_of(f"{script}.js")
    )
    places = {"script": script, "language": language, "theme": theme, "preloads": preloads}
    return HTMLResponse(text.format(**places), headers=HEADERS)


def words(language: str) -> dict[str, str]:
    """All texts by key, with the causes and remedies of faults; and the languages that there are, by code."""
    said = messages.of(language)
    faults = {
        f"alarms.{key}": text for key, text in said.texts.items() if key.startswith(("cause.", "remedy."))
    }
    names = {f"language.{code}": one.name for code, one in messages.LANGUAGES.items()}
    return {**said.page, **faults, **names}
