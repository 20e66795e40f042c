"""The panel as a web application: all routes, one form of refusal, one description.

    app = make_app(Panel(store, door))

What is asked goes through: a limit on its size, the route's guard (``access``), the route.
What comes back, also of mistakes, has the form of ``answers``.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Iterator
from functools import cache

from fastapi import APIRouter, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, HTTPConnection
from starlette.routing import BaseRoute, compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from controller.api import description, health, metrics, octoprint
from controller.api.answers import DESCRIPTIONS, Answer, Refusal, language_of, of_form, spoken
from controller.api.app_state import Panel
from controller.api.database import StoreError
from controller.api.roles import Role
from controller.api.routes import (
    backups,
    bring_up,
    calibration,
    canned_cycles,
    commands,
    cycle,
    diagnostics,
    listen,
    machine,
    notices,
    probing,
    programs,
    queue,
    records,
    session,
    tables,
    ticks,
    usage,
    users,
)
from controller.api.slashes import Slashes
from controller.calibration.measurements import MEASUREMENTS
from controller.messages import message, plain
from controller.version import VERSION

API = "/api/v1"
MAX_BODY_BYTES = 100_000  # of everything but uploads, which count for themselves
LARGE = ("drafts", "tools/import", *(f"calibration/{name}" for name in MEASUREMENTS))
MAX_OF = {f"{API}/{path}": 2_200_000 for path in LARGE}  # a program of a million bytes, as JSON; tables
UPLOADS = (f"{API}/programs", "/api/files/local")
STORE_STATUSES = {
    **{"missing": 404, "slow": 408, "exists": 409, "running": 409, "size": 413, "many": 429},
    **dict.fromkeys(("name", "sha256", "cut", "empty", "form"), 422),
    **{"store": 503, "space": 507},
}
PARTS = (
    *((API, part) for part in (machine, cycle, commands, programs, tables, records, ticks)),
    *((API, part) for part in (diagnostics, session, users, notices, queue, usage, probing)),
    *((API, part) for part in (canned_cycles, calibration, bring_up, backups, listen)),
    ("", metrics),
    ("", health),
    ("", octoprint),
)
# Who is not logged in yet may log in, and who watches over processes needs no log-in.
PUBLIC = {("POST", f"{API}/session"), ("GET", health.ALIVE), ("GET", health.READY)}
HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
)
# A browser that was here by TLS comes by nothing else for a year.
STRICT = ((b"strict-transport-security", b"max-age=31536000"),)


def make_app(panel: Panel) -> FastAPI:
    """The application. Raises RuntimeError for a route that anybody could use."""

    @contextlib.asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        async with panel.running():
            yield

    app = FastAPI(
        title="Directrix",
        version=VERSION,
        lifespan=life,
        docs_url=None,  # they would load their scripts from other computers
        redoc_url=None,
        openapi_url=None,
        redirect_slashes=False,
        default_response_class=Answer,
        routes=_routes_of_parts(),
    )
    app.state.panel = panel
    _check_guards()
    http = [(path, route, rule_of(route)) for path, route in routes() if isinstance(route, APIRoute)]
    description.add(app, http)
    _refusals(app)
    app.add_middleware(Slashes)
    app.add_middleware(Bounds)
    return app


@cache
def _routes_of_parts() -> list[BaseRoute]:
    """The same for every application: FastAPI works out once, at the first request, what each one takes."""
    whole = APIRouter(default_response_class=Answer)
    for prefix, part in PARTS:
        whole.include_router(part.router, prefix=prefix)
    return whole.routes


# ---- refusals


def _refusals(app: FastAPI) -> None:
    @app.exception_handler(Refusal)
    async def refused(_: Request, refusal: Refusal) -> JSONResponse:
        return refusal.response()

    @app.exception_handler(StoreError)
    async def not_stored(_: Request, error: StoreError) -> JSONResponse:
        return Refusal(STORE_STATUSES[error.code], error.code, error.said).response()

    @app.exception_handler(RequestValidationError)
    async def not_as_described(_: Request, error: RequestValidationError) -> JSONResponse:
        return of_form(error.errors()).response()

    @app.exception_handler(ClientDisconnect)
    async def gone(_: Request, error: ClientDisconnect) -> JSONResponse:
        # Nobody reads it any more; but one who goes away is no mistake of ours that belongs into a log.
        return Refusal.of(422, "form", "request_cut").response()

    @app.exception_handler(HTTPException)
    async def no_route(request: Request, error: HTTPException) -> JSONResponse:
        headers = dict(error.headers or {})
        if error.status_code == 405:
            headers["Allow"] = ", ".join(sorted(_methods(request.scope["path"])))
        # 400 is a body that is no JSON: one more that is not as the description says.
        status = 422 if error.status_code == 400 else error.status_code
        known = message(f"http.{status}") if status in DESCRIPTIONS else plain(str(error.detail))
        text = error.said if isinstance(error, TooLarge) else known
        return Refusal(status, "http", text, headers=headers).response()


def routes() -> Iterator[tuple[str, APIRoute | APIWebSocketRoute]]:
    """(path, route) of everything that can be asked."""
    for prefix, part in PARTS:
        for route in part.router.routes:
            assert isinstance(route, APIRoute | APIWebSocketRoute)
            yield prefix + route.path, route


def rule_of(route: APIRoute | APIWebSocketRoute) -> tuple[Role, bool] | None:
    """(role, whether the control token) that a route asks for; None: it has no guard."""
    rules = (getattr(one.call, "rule", None) for one in route.dependant.dependencies)
    return next((rule for rule in rules if rule is not None), None)


def _check_guards() -> None:
    for path, route in routes():
        open_to_all = any((method, path) in PUBLIC for method in getattr(route, "methods", ()))
        if rule_of(route) is None and not open_to_all:
            raise RuntimeError(f"{path}: has no guard; give it one of access.needs or access.moves.")


def _methods(path: str) -> set[str]:
    """All methods of a path: each has a route of its own."""
    found = ((compile_path(pattern)[0], route) for pattern, route in routes())
    return {m for regex, route in found if regex.match(path) for m in getattr(route, "methods", ())}


class TooLarge(HTTPException):
    """A body of more bytes than are taken here; as this kind it comes through whoever reads the body."""

    def __init__(self, most: int) -> None:
        super().__init__(413)
        self.said = message("body_large", most=most)


class Bounds:
    """Around the application: bodies of a bounded size, and headers for browsers."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket"):
            spoken.set(language_of(HTTPConnection(scope)))
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        taken, most = 0, MAX_OF.get(scope["path"], MAX_BODY_BYTES)

        async def bounded() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > most:
                raise TooLarge(most)
            return message

        async def headed(message: Message) -> None:
            if message["type"] == "http.response.start":
                there = {name for name, _ in message["headers"]}
                message["headers"] = [
                    *message["headers"],
                    *(pair for pair in HEADERS if pair[0] not in there),
                    *(STRICT if scope["scheme"] == "https" else ()),
                ]
            await send(message)

        await self._app(scope, receive if scope["path"] in UPLOADS else bounded, headed)
