"""What ``/openapi.json`` says beside the routes and their models: who may ask, how one logs in, an example of
every body; and ``/docs``, the same as a page.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse, JSONResponse
from fastapi.routing import APIRoute

from controller import messages
from controller.api import docs_page
from controller.api.access import COOKIE, needs, panel_of
from controller.api.answers import DESCRIPTIONS, VARY, spoken
from controller.api.examples import EXAMPLES
from controller.api.roles import Role

SCHEMES: dict[str, dict[str, str]] = {
    "token": {"type": "http", "scheme": "bearer"},
    "api_key": {"type": "apiKey", "in": "header", "name": "X-Api-Key"},
    "session": {"type": "apiKey", "in": "cookie", "name": COOKIE},
}
DECLARED = ("openapi.", "http.")  # keys of what routes, models and answers say of themselves
NOT_TEXTS = ("examples", "example", "default")
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
        whole = described(app.openapi(), rules, panel_of(request).users.any, spoken.get())
        return JSONResponse(whole, headers={"Vary": VARY, "Content-Language": spoken.get()})

    @app.get("/docs", include_in_schema=False, dependencies=[needs(Role.VIEW)], response_class=HTMLResponse)
    async def docs(request: Request) -> HTMLResponse:
        whole = described(app.openapi(), rules, panel_of(request).users.any, spoken.get())
        text = docs_page.page(whole, spoken.get())
        headers = {"Content-Security-Policy": docs_page.POLICY, "Vary": VARY}
        return HTMLResponse(text, headers={**headers, "Content-Language": spoken.get()})


def described(
    schema: Mapping[str, Any],
    rules: Mapping[tuple[str, str], Rule],
    log_in: bool,
    language: str = messages.DEFAULT,
) -> dict[str, Any]:
    """FastAPI's description with all that it does not know, in a language. ``log_in``: whether one has to."""
    texts = messages.of(language).texts
    paths = {
        path: {
            method: _operation(one, rules.get((method, path)), language) for method, one in methods.items()
        }
        for path, methods in schema["paths"].items()
    }
    models = {
        name: {**in_language(model, language), **({"examples": [EXAMPLES[name]]} if name in EXAMPLES else {})}
        for name, model in schema["components"]["schemas"].items()
    }
    schemes = {name: {**one, "description": texts[f"openapi.scheme.{name}"]} for name, one in SCHEMES.items()}
    anybody: list[dict[str, list[str]]] = [] if log_in else [{}]
    return {
        **schema,
        "info": {**schema["info"], "description": texts["openapi.about"]},
        "paths": paths,
        "components": {**schema["components"], "schemas": models, "securitySchemes": schemes},
        "security": [*anybody, *({name: []} for name in SCHEMES)],
    }


def _operation(operation: Mapping[str, Any], rule: Rule, language: str) -> dict[str, Any]:
    """With who may ask, where anybody may, without a log-in; and that a body may be too large."""
    if "requestBody" in operation:
        operation = {**operation, "responses": {**TOO_LARGE, **operation["responses"]}}
    operation = in_language(operation, language)
    about = str(operation.get("description", ""))
    if language != messages.DEFAULT:  # FastAPI makes it of the function's name
        operation = {**operation, "summary": re.split(r"[.;:]\s", f"{about} ", maxsplit=1)[0]}
    if rule is None:
        return {**operation, "security": []}
    role, control = rule
    key = "openapi.role_in_control" if control else "openapi.role"
    whole = messages.text(messages.message(key, text=about, role=role.label), language)
    return {**operation, "description": whole.strip()}


def in_language(schema: Any, language: str) -> Any:
    """A part of the description with each of its texts in a language.

    What routes and models say of themselves is the English of a text of the catalogue: by that it is found.
    Titles are left out: FastAPI makes them of the names, and would have them in English.
    """
    if isinstance(schema, list):
        return [in_language(one, language) for one in schema]
    if not isinstance(schema, Mapping):
        return schema
    texts, keys = messages.of(language).texts, declared()
    found = {
        name: one if name in NOT_TEXTS else in_language(one, language)
        for name, one in schema.items()
        if name != "title" or not isinstance(one, str)
    }
    about = schema.get("description")
    if isinstance(about, str) and about in keys:
        found["description"] = texts[keys[about]]
    return found


@cache
def declared() -> dict[str, str]:
    """The key of every text of the description, by its English."""
    texts = messages.of(messages.DEFAULT).texts
    return {text: key for key, text in texts.items() if key.startswith(DECLARED)}
