"""Whether an answer of the panel is as ``/openapi.json`` says: status, kind, body, every name in it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import httpx
import jsonschema_rs

from controller.api import description, http
from controller.api.app_state import Panel

REF = "#/components/schemas/"
Schema = Mapping[str, Any]


@cache
def whole() -> Schema:
    """The description; the same for every application, as its routes are."""
    panel: Any = Panel.__new__(Panel)  # described is what it would do, and nothing of it is done
    return description.described(http.make_app(panel).openapi(), {}, log_in=False)


@cache
def _operations() -> tuple[tuple[re.Pattern[str], str, Schema], ...]:
    """Pattern of the path, method, operation; those without parameters first."""
    rows = [
        (re.compile(re.sub(r"\\{\w+\\}", "[^/]+", re.escape(path))), method.upper(), operation)
        for path, methods in whole()["paths"].items()
        for method, operation in methods.items()
    ]
    return tuple(sorted(rows, key=lambda row: row[0].pattern.count("[^/]+")))


@cache
def _validator(name: str) -> Any:
    """Of a model."""
    schema = {"$ref": f"{REF}{name}", "components": whole()["components"]}
    return jsonschema_rs.Draft202012Validator(schema)


def slips(answer: httpx.Response) -> list[str]:
    """What is not as described; nothing of a route that is not in the description, the page's for one."""
    method, path = answer.request.method, answer.request.url.raw_path.decode().partition("?")[0]
    operation = next((o for p, m, o in _operations() if m == method and p.fullmatch(path)), None)
    if operation is None:
        return []
    where, status = f"{method} {path}", str(answer.status_code)
    described = operation["responses"].get(status)
    if described is None:
        return [f"{where}: {status} is not described"]
    content = described.get("content") or {}
    kind = answer.headers.get("content-type", "").partition(";")[0]
    if not content:
        return [f"{where}: {status} has a body, and none is described"] if answer.content else []
    content = {one.partition(";")[0]: schema for one, schema in content.items()}
    if kind not in content:
        return [f"{where}: {status} is {kind}, described {', '.join(content)}"]
    if kind != "application/json":
        return []
    schema, body = content[kind].get("schema") or {}, answer.json()
    wrong = [f"{where}: {error}" for error in _wrong(schema, body)]
    return wrong + [f"{where}: {name} is not described" for name in _unnamed(schema, body, "")]


def _wrong(schema: Schema, body: Any) -> Iterator[str]:
    if name := schema.get("$ref", "").removeprefix(REF):
        for error in _validator(name).iter_errors(body):
            yield f"{'.'.join(map(str, error.instance_path))}: {error.message[:200]}"


def _unnamed(schema: Schema, value: Any, where: str) -> Iterator[str]:
    """Names in objects of models that the models have not."""
    if ref := schema.get("$ref"):
        schema = whole()["components"]["schemas"][ref.removeprefix(REF)]
    for one in schema.get("anyOf", ()):
        if one.get("type") != "null" or value is None:
            yield from _unnamed(one, value, where)
            return
    if isinstance(value, list) and isinstance(schema.get("items"), dict):
        for one in value:
            yield from _unnamed(schema["items"], one, f"{where}[]")
    if not isinstance(value, dict):
        return
    properties, others = schema.get("properties"), schema.get("additionalProperties")
    for name, one in value.items():
        place = f"{where}.{name}".lstrip(".")
        if properties and name in properties:
            yield from _unnamed(properties[name], one, place)
        elif isinstance(others, dict):
            yield from _unnamed(others, one, f"{where}.*")
        elif properties:
            yield place
