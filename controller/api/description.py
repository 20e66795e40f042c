"""What ``/openapi.json`` says beside the routes and their models: who may ask, how one logs in, an example of
every body; and ``/docs``, the same as a page.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse, JSONResponse
from fastapi.routing import APIRoute

from controller.api import docs_page
from controller.api.access import COOKIE, needs, panel_of
from controller.api.answers import DESCRIPTIONS, VARY, spoken
from controller.api.examples import EXAMPLES
from controller.api.roles import Role

SCHEMES: dict[str, dict[str, str]] = {
    "token": {
        **{"type": "http", "scheme": "bearer"},
        "description": "A script's token: directrix tokens add NAME, or POST /api/v1/tokens.",
    },
    "api_key": {
        **{"type": "apiKey", "in": "header", "name": "X-Api-Key"},
        "description": "The same token, as senders that speak OctoPrint's way have it.",
    },
    "session": {
        **{"type": "apiKey", "in": "cookie", "name": COOKIE},
        "description": "After POST /api/v1/session; all but GET needs its csrf as X-CSRF-Token, too.",
    },
}
ABOUT = (
    "REST interface of one machine. Lengths are mm, angles degrees, feeds mm/min, shares 0 to 1; whatever is "
    "refused has one sentence why (ErrorAnswer), in the language of Accept-Language.\n\n"
    "Without users only this computer is answered, and needs no log-in; with users a token or a session. "
    "What moves the machine needs the control token, too: POST /api/v1/control; send it as X-Control-Token."
)
TOO_LARGE = {
    "413": {
        "description": DESCRIPTIONS[413],
        "content": {"application/json": {"schema": {"$ref": "#/components/schemas/ErrorAnswer"}}},
    }
}
Rule = tuple[Role, bool] | None


def add(app: FastAPI, routes: Iterable[tuple[str, APIRoute, Rule]]) -> None:
    """Put ``/openapi.json`` and ``/docs`` on the application; each route with the rule of its guard."""
    rules = {
        (method.lower(), re.sub(r":path}", "}", path)): rule
        for path, route, rule in routes
        for method in route.methods or ()
    }

    @app.get("/openapi.json", include_in_schema=False, dependencies=[needs(Role.VIEW)])
    async def openapi(request: Request) -> JSONResponse:
        return JSONResponse(described(app.openapi(), rules, panel_of(request).users.any))

    @app.get("/docs", include_in_schema=False, dependencies=[needs(Role.VIEW)], response_class=HTMLResponse)
    async def docs(request: Request) -> HTMLResponse:
        whole = described(app.openapi(), rules, panel_of(request).users.any)
        text = docs_page.page(whole, spoken.get())
        headers = {"Content-Security-Policy": docs_page.POLICY, "Vary": VARY}
        return HTMLResponse(text, headers={**headers, "Content-Language": spoken.get()})


def described(
    schema: Mapping[str, Any], rules: Mapping[tuple[str, str], Rule], log_in: bool
) -> dict[str, Any]:
    """FastAPI's description with all that it does not know. ``log_in``: whether one has to."""
    paths = {
        path: {method: _operation(one, rules.get((method, path))) for method, one in methods.items()}
        for path, methods in schema["paths"].items()
    }
    models = {
        name: {**model, "examples": [EXAMPLES[name]]} if name in EXAMPLES else model
        for name, model in schema["components"]["schemas"].items()
    }
    anybody: list[dict[str, list[str]]] = [] if log_in else [{}]
    return {
        **schema,
        "info": {**schema["info"], "description": ABOUT},
        "paths": paths,
        "components": {**schema["components"], "schemas": models, "securitySchemes": SCHEMES},
        "security": [*anybody, *({name: []} for name in SCHEMES)],
    }


def _operation(operation: Mapping[str, Any], rule: Rule) -> dict[str, Any]:
    """With who may ask, where anybody may, without a log-in; and that a body may be too large."""
    if "requestBody" in operation:
        operation = {**operation, "responses": {**TOO_LARGE, **operation["responses"]}}
    if rule is None:
        return {**operation, "security": []}
    role, control = rule
    who = f"Role: {role.label}{', holding the control token' if control else ''}."
    return {**operation, "description": f"{operation.get('description', '')}\n\n{who}".strip()}
