"""OpenAPI as a page to be read: every route with its parameters, body, answers and a call to try.

html = page(openapi, "en")

It needs no script and nothing from elsewhere, so it is there on a machine without a network, too. It is in
the reader's language, as ``/openapi.json`` is.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from controller import messages

Schema = Mapping[str, Any]
Words = Mapping[str, str]

_STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:64rem;padding:0 1rem;color:#111;"
    "background:#fff}\n"
    "h2{margin-top:2.5rem;border-bottom:2px solid #111}\nnav a{margin-right:1rem}\n"
    "summary{cursor:pointer;padding:.25rem 0;overflow-wrap:anywhere}\n"
    "summary b{display:inline-block;width:4.5rem}\n"
    "details>div{padding:.25rem 0 1rem 1rem;border-left:3px solid #bbb}\n"
    "table{border-collapse:collapse;margin:.5rem 0}\nth,td{text-align:left;padding:.2rem 1rem .2rem 0;"
    "border-bottom:1px solid #ccc;vertical-align:top;overflow-wrap:anywhere}\n"
    "pre{background:#f2f2f2;padding:.5rem;overflow-x:auto}\np{white-space:pre-line}\n"
    "a{color:#0645ad}\n@media(prefers-color-scheme:dark){body{color:#eee;background:#111}pre{background:#222}"
    "a{color:#8ab4f8}h2{border-color:#eee}}"
)
_HASH = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
POLICY = f"default-src 'none'; style-src 'sha256-{_HASH}'; frame-ancestors 'none'; base-uri 'none'"
BOUNDS = (
    *(("minimum", "≥ {}"), ("exclusiveMinimum", "> {}"), ("maximum", "≤ {}"), ("exclusiveMaximum", "< {}")),
    *(("minLength", "≥ {} ¶"), ("maxLength", "≤ {} ¶"), ("minItems", "≥ {} []"), ("maxItems", "≤ {} []")),
    ("pattern", "{}"),
)
REF = "#/components/schemas/"


def page(whole: Schema, language: str) -> str:
    """The whole document."""
    texts = messages.of(language).texts
    word = {key.removeprefix("docs."): text for key, text in texts.items() if key.startswith("docs.")}
    tags = dict[str, list[str]]()
    for path, methods in whole["paths"].items():
        for method, operation in methods.items():
            tag = (operation.get("tags") or [""])[0]
            tags.setdefault(tag, []).append("".join(_operation(whole, path, method, operation, word)))
    title = escape(f"{whole['info']['title']} {whole['info'].get('version', '')}".strip())
    links = "".join(f'<a href="#tag-{escape(_id(tag))}">{escape(tag)}</a>' for tag in tags)
    parts = "".join(
        f'<h2 id="tag-{escape(_id(tag))}">{escape(tag)}</h2>{"".join(found)}' for tag, found in tags.items()
    )
    return (
        f'<!doctype html><html lang="{language}"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head><body><main>'
        f"<h1>{title}</h1><p>{escape(whole['info'].get('description', ''))}</p>{_schemes(whole, word)}"
        f'<p><a href="openapi.json">openapi.json</a></p><nav>{links}</nav>{parts}{_models(whole, word)}'
        "</main></body></html>\n"
    )


def _schemes(whole: Schema, word: Words) -> str:
    rows = []
    for name, scheme in whole["components"].get("securitySchemes", {}).items():
        where = scheme.get("name") or "Authorization: Bearer …"
        cells = (name, f"{scheme.get('in', 'header')}: {where}", scheme.get("description", ""))
        rows.append(tuple(map(escape, cells)))
    return f"<h2>{escape(word['access'])}</h2>{_table((word['name'], word['where'], word['meaning']), rows)}"


def _operation(whole: Schema, path: str, method: str, operation: Schema, word: Words) -> Iterator[str]:
    description = operation.get("description", "")
    first = description.partition("\n")[0]
    yield f'<details id="{escape(operation.get("operationId", path))}"><summary><b>{method.upper()}</b> '
    yield f"<code>{escape(path)}</code> — {escape(first)}</summary><div><p>{escape(description)}</p>"
    if parameters := operation.get("parameters"):
        heads = (word["name"], word["where"], word["type"], word["meaning"])
        yield f"<h4>{escape(word['parameters'])}</h4>"
        yield _table(heads, [_parameter(one, word) for one in parameters])
    content = (operation.get("requestBody") or {}).get("content") or {}
    for kind, body in content.items():
        schema = body.get("schema") or {}
        yield f"<h4>{escape(word['body'])}: {escape(kind)}, {_type(schema)}</h4>"
        yield _fields(_own(whole, schema), word)
    yield f"<h4>{escape(word['call'])}</h4><pre>{escape(_call(whole, path, method, operation))}</pre>"
    yield f"<h4>{escape(word['answers'])}</h4>"
    yield _table((word["status"], word["type"], word["meaning"]), list(_answers(operation)))
    yield "</div></details>"


def _parameter(one: Schema, word: Words) -> tuple[str, ...]:
    needed = f"{word['needed']}. " if one.get("required") else ""
    meaning = needed + one.get("description", "")
    return escape(one["name"]), escape(one["in"]), _type(one.get("schema") or {}), escape(meaning)


def _answers(operation: Schema) -> Iterator[tuple[str, ...]]:
    for status, answer in operation.get("responses", {}).items():
        content = answer.get("content") or {}
        types = [_type(one.get("schema") or {}) or escape(kind) for kind, one in content.items()]
        yield escape(status), ", ".join(types) or "–", escape(answer.get("description", ""))


def _call(whole: Schema, path: str, method: str, operation: Schema) -> str:
    """For a shell."""
    words = ["curl", "-X", method.upper(), "-H", "'Authorization: Bearer TOKEN'"]
    if any(one["name"].lower() == "x-control-token" for one in operation.get("parameters") or ()):
        words += ["-H", "'X-Control-Token: CONTROL'"]
    content = (operation.get("requestBody") or {}).get("content") or {}
    if "application/json" in content:
        model = _own(whole, content["application/json"].get("schema") or {})
        example = json.dumps((model.get("examples") or [{}])[0]).replace("'", "'\\''")
        words += ["-H", "'Content-Type: application/json'", "-d", f"'{example}'"]
    elif content:
        words += ["-F", "file=@part.ngc"]
    return " ".join([*words, f"'http://127.0.0.1:8080{path}'"])


def _models(whole: Schema, word: Words) -> str:
    parts = [f"<h2>{escape(word['models'])}</h2>"]
    for name, model in sorted(whole["components"]["schemas"].items()):
        example = "".join(
            f"<pre>{escape(json.dumps(one, indent=1))}</pre>" for one in model.get("examples", ())
        )
        about = escape(model.get("description", ""))
        parts.append(f'<h3 id="model-{escape(name)}">{escape(name)}</h3><p>{about}</p>')
        parts.append(_fields(model, word) + example)
    return "".join(parts)


def _fields(model: Schema, word: Words) -> str:
    """The table of an object's properties; nothing of any other."""
    needed = set(model.get("required", ()))
    rows = [
        (
            escape(name),
            _type(one),
            escape(
                " ".join(
                    filter(None, (f"{word['needed']}." if name in needed else "", one.get("description")))
                )
            ),
        )
        for name, one in model.get("properties", {}).items()
    ]
    if not rows:
        return ""
    return _table((word["name"], word["type"], word["meaning"]), rows)


def _own(whole: Schema, schema: Schema) -> Schema:
    """The model that a schema names, through "or null"."""
    for one in (schema, *schema.get("anyOf", ())):
        if ref := one.get("$ref"):
            found: Schema = whole["components"]["schemas"][ref.removeprefix(REF)]
            return found
    return schema


def _type(schema: Schema) -> str:
    """As HTML; models are links."""
    if ref := schema.get("$ref"):
        name = escape(ref.removeprefix(REF))
        return f'<a href="#model-{name}">{name}</a>'
    if several := schema.get("anyOf") or schema.get("oneOf"):
        return " | ".join(filter(None, map(_type, several)))
    if "enum" in schema or "const" in schema:
        values = schema.get("enum", [schema.get("const")])
        return escape(" | ".join(json.dumps(one) for one in values))
    kind = str(schema.get("type", ""))
    kind = f"[{_type(schema.get('items') or {})}]" if kind == "array" else escape(kind)
    bounds = [text.format(_figure(schema[key])) for key, text in BOUNDS if key in schema]
    default = [f"= {json.dumps(schema['default'])}"] if schema.get("default") is not None else []
    return " ".join([kind, *map(escape, (*bounds, *default))]).strip()


def _figure(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, int | float) else str(value)


def _table(heads: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """The cells of the rows are HTML."""
    head = "".join(f'<th scope="col">{escape(one)}</th>' for one in heads)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _id(tag: str) -> str:
    """Of a tag, as a link has it."""
    return "-".join(tag.split()).replace("'", "")
